"""How `airtruth.numerics.levenberg_marquardt` searches: damping, rules of stopping, and reuse of derivatives.

Sources: K. Madsen, H. B. Nielsen and O. Tingleff, Methods for Non-Linear Least Squares Problems, 2nd ed. (2004), section
3.2 (the gain ratio governs the damping).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Damping:
    """Schedule of the damping, relative to the scaled diagonal of the information [-].

    The gain ratio is the decrease of the cost over the decrease that the step promised. A step whose decrease exceeds
    ``slack`` is accepted.

    Attributes
    ----------
    initial, least : at the start, and the smallest.
    most : the search stalls beyond this.
    rejected : factor after a rejected step, which is followed by at least ``restart``.
    poor, fair, good : factors after an accepted step with a gain ratio up to ``poor_ratio``, between, and above
        ``good_ratio``.
    slack : least decrease of an accepted step [unit of the cost]; slightly negative tolerates rounding.
    """

    initial: float = 1e-3
    least: float = 1e-9
    most: float = 1e9
    rejected: float = 10.0
    restart: float = 0.0
    poor: float = 3.0
    fair: float = 1.0
    good: float = 0.1
    poor_ratio: float = 0.25
    good_ratio: float = 0.75
    slack: float = 0.0

    def after(self, damping: float, ratio: float | None) -> float:
        """Damping that follows a gain ratio; None for a rejected step."""
        if ratio is None:
            return max(damping * self.rejected, self.restart, self.least)
        factor = self.good if ratio > self.good_ratio else self.fair if ratio > self.poor_ratio else self.poor
        return max(damping * factor, self.least)


@dataclass(frozen=True)
class Stopping:
    """Decreases of the cost at which a search ends [unit of the cost]; a rule whose value is None is not applied.

    Attributes
    ----------
    undamped : promised by an undamped step, which is then taken: converged.
    promised : promised by the damped step. Converged if an undamped step promises less than ``promised_confirm``,
        else `airtruth.numerics.levenberg_marquardt.SolverStatus.SHORT`.
    decrease : achieved by an accepted step. Converged if an undamped step promises less than ``decrease_confirm``,
        else the search continues.
    rejected : promised by an undamped step after a rejected one: converged.
    """

    undamped: float | None = None
    promised: float | None = None
    promised_confirm: float | None = None
    decrease: float | None = None
    decrease_confirm: float | None = None
    rejected: float | None = None


@dataclass(frozen=True)
class SolverOptions:
    """How to search.

    Attributes
    ----------
    iterations : most iterations.
    damping, stopping : see there.
    reuse : whether a trial point is evaluated with the derivatives of the point before it. They are renewed once a
        step decreases the cost by less than ``stale``, or by less than ``creeping`` times what it promised. A search
        converges with renewed derivatives alone.
    renewed_end : whether they are also renewed where a search ends without convergence.
    renewed_outrun : whether this includes a search that cannot reach its rival.
    chords : most further steps with the same derivatives after a trial that decreases the cost by less than half of
        what was promised: they lead back into a curved valley.
    outrun : margin behind a rival's cost beyond which a search ends, provided that four more steps like the last
        would not make it up [unit of the cost].
    outrun_renewed : the same margin after a step with renewed derivatives, where it is smaller: such a step tells more
        of those to come.
    """

    iterations: int
    damping: Damping = field(default_factory=Damping)
    stopping: Stopping = field(default_factory=Stopping)
    reuse: bool = False
    stale: float = 0.0
    creeping: float = 0.0
    renewed_end: bool = True
    renewed_outrun: bool = True
    chords: int = 0
    outrun: float = np.inf
    outrun_renewed: float = np.inf


__all__ = ["Damping", "SolverOptions", "Stopping"]
