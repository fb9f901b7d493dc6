"""A finished search: its cost, its last fit where the derivatives were released, and the lead that another search needs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from airtruth.tracing.inference.optimise import fit
from airtruth.tracing.selection.explanation import AS_PROBABLE, REFERENCE, least_cost
from airtruth.tracing.selection.ranking import WHITENED_ITERATIONS
from airtruth.tracing.selection.rounds import Rival, SearchRound
from airtruth.tracing.selection.set_table import SetTable
from airtruth.tracing.selection.significance import BEYOND_DOUBT, REMAINS

STRONG_ODDS: Final = float(np.log(AS_PROBABLE))
"""Log-posterior, negative, by which a set of fewer effects may be behind."""
KINEMATIC_ODDS: Final = -5.0
"""Log-posterior by which a set that explains the kinematics may be behind one that does not [-] (judgement: odds of 150, from
the level of 0.005 of one comparison of the kinematic check; measured, the check of six records excluded the true cause in 6 of
100 flights, odds of 16)."""
CLEAN: Final = 0.05
"""Probability of the remaining anomaly from which a search explains the records, so that no tied effect is tried
instead [-] (convention)."""


@dataclass(frozen=True)
class SearchOutcome:
    """A finished search.

    Attributes
    ----------
    effects : number of effects that it names.
    p_value : of the remaining anomaly [-].
    agrees : whether it accepts all errors of a set that explains the kinematics of the records; true where none is known.
    """

    effects: int
    p_value: float
    agrees: bool

    @property
    def is_misfit(self) -> bool:
        """Whether it leaves an anomaly beyond doubt."""
        return self.p_value < BEYOND_DOUBT


def required_lead(old: SearchOutcome, new: SearchOutcome, lead: float) -> float:
    """Log-posterior by which a new search has to lead the old one; negative where it may be behind, infinite where it is refused.

    A simpler set wins unless the odds against it are strong; a set of as many effects wins without a lead if it alone leaves no
    anomaly. The kinematics need no aerodynamics. Where both searches leave an anomaly beyond doubt, the aerodynamics are wrong,
    and the kinematics tell errors of sensors better than the filter: a search that agrees with them does not give way to another
    one.

    Parameters
    ----------
    lead : what a search of any other kind needs.
    """
    if old.is_misfit and new.is_misfit and old.agrees != new.agrees:
        return KINEMATIC_ODDS if new.agrees else np.inf
    if new.effects < old.effects:
        return STRONG_ODDS
    return 0.0 if new.p_value > CLEAN and old.p_value < REMAINS else lead


def total_cost(last: SearchRound) -> float:
    """Negative log-posterior at the end of a search, with one for each parameter of an effect."""
    if last.null.hypothesis.spread is None:
        own = last.null.cost if last.release is None else last.release.cost
    else:
        own = least_cost(last.sets) if last.sets else np.inf
    return own + len(last.null.point.sizes)


def settled(sets: SetTable, rounds: tuple[SearchRound, ...]) -> tuple[SearchRound, ...]:
    """The rounds with the last fit under the best explanation of the derivatives, where they were released.

    Parameters
    ----------
    rounds : a finished search, with what explains the derivatives at its last null.
    """
    if not rounds or not rounds[-1].sets:
        return rounds
    last = rounds[-1]
    spread = last.sets[0].covariance - sets.problem.declared_covariance
    hypothesis = replace(last.null.hypothesis, spread=spread)
    null = gls = sets.fit(hypothesis, last.null.point, near=last.null) or last.null
    if last.whitener.order:
        again = fit(
            sets.problem,
            hypothesis,
            last.gls.point,
            last.whitener,
            free_levels=False,
            iterations=WHITENED_ITERATIONS,
        )
        gls = again or null
    first = next(r.release for r in rounds if r.release is not None)
    end = replace(last, null=null, gls=gls, release=replace(first, fit=last.null, sets=last.sets))
    return (*rounds[:-1], _with_declared(sets, end, last))


def _with_declared(sets: SetTable, end: SearchRound, last: SearchRound) -> SearchRound:
    """The last round with the set of its effects under the declaration, where derivatives are released beside effects."""
    effects = last.null.hypothesis.effects
    if not effects:
        return end
    declared = sets.declared(last.null)
    if declared is None:
        return end
    names = tuple(sorted({e.label for e in effects}))
    excess = declared.cost + len(declared.point.sizes) - total_cost(last)
    log_weight = min(0.0, REFERENCE - max(0.0, excess))
    return replace(end, rival=Rival({**(end.rival.sets if end.rival else {}), names: log_weight}))


__all__ = ["CLEAN", "STRONG_ODDS", "SearchOutcome", "required_lead", "settled", "total_cost"]
