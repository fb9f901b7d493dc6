"""Increments of a coefficient or of a reading that have no name: piecewise linear functions of a signal, with memory or
without.

    dC = sum_k b_k/w h_k(s) [(p - p0)]  [+ c/w (s - s0)]  [+ a (x - s)],
    h_k = max(0, s - s_k) above the trim s0, min(0, s - s_k) below it

s is the signal, or the state x of a first-order lag, of a mode or of a play that the signal drives; w is the width of a
cell. With a factor p, which counts from p0, the function is an increment of the derivative of p. With the factor x - p, x
the lag of p with the time constant tau, it is the change of a lag's time constant over tau, small against one. The
function is zero at the trim and constant outside the range in which it was learned. In the cell that holds the trim it
is a straight line of slope c/w: the slope of a function that nothing declares, and beside a declared derivative the part
by which a bend within the cell moves the mean slope away from it. c is left out of an increment of CX, whose declared
slope is a parameter of its own, and of a lag that changes. A step behind a play is a straight line over one cell and constant
on either side of it: the step switches on at a larger s than it switches off. The bends b_k and c have independent normal priors,
which is the prior of an integrated random walk: a penalised linear spline.

Source: S. N. Wood, Generalized Additive Models, 2nd ed., 2017, sections 5.3 and 5.8 (splines as normal priors);
D. Ruppert, M. P. Wand and R. J. Carroll, Semiparametric Regression, 2003, section 3.5 (truncated lines).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Final, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from airtruth.physics.motion import MOTIONS
from airtruth.physics.motion_parts import Signal
from airtruth.physics.terms import OUTPUTS, QBAR, AeroTerm, Change, ReadingTerm, StateTerm, shape_of

Array = NDArray[np.float64]

NAME: Final = "increment"
"""Name of every learned increment."""
SIGNALS: Final[Mapping[str, Signal]] = {
    s.name: s for m in MOTIONS.values() for s in (*m.known_signals, *m.signals)
}
"""Signal of a motion, or known input that is one -> its description."""
SIGNAL_NAMES: Final[Mapping[str, str]] = {
    **{s.name: s.channel if s.length is None else f"{s.symbol}_hat" for s in SIGNALS.values()},
    **{m.flow_rate: m.flow_rate for m in MOTIONS.values()},
    QBAR: f"{QBAR}_pa",
}
"""Signal of a term -> its name in an answer; a rate is multiplied by its reference length over 2 V."""
AXIAL: Final = "CX"
"""Coefficient of the axial force, which is none of a motion."""
SLOPE: Final = "slope"
"""Name of the rise c over the cell of the trim."""
STEP: Final = "step"
"""Name of the rise of a step."""
STEPS: Final = 12
"""Number of cells in which a step is tried first, which are equally probable a priori [-] (judgement: in five
flight tests that switch, steps of a width between 1/24 and 1/10 of the range have similar evidence)."""


@dataclass(frozen=True)
class Memory:
    """A state that a signal drives, see `airtruth.physics.terms.StateTerm`.

    Attributes
    ----------
    kind : "lag", "mode" or "play".
    time_s : time constant of the lag, 1/wn of the mode [s].
    damping : damping ratio of the mode [-].
    half_width : of the play [unit of the signal].
    """

    kind: Literal["lag", "mode", "play"]
    time_s: float = 0.0
    damping: float = 0.0
    half_width: float = 0.0

    @property
    def values(self) -> dict[str, float]:
        """Parameters of the memory that a refit estimates, by name."""
        if self.kind == "play":
            return {"half_width": self.half_width}
        return {"time_s": self.time_s} | ({"damping": self.damping} if self.kind == "mode" else {})


class Piece(NamedTuple):
    """Part of an increment: signal, shape, amplitude and origin, as of `airtruth.physics.terms.AeroTerm`."""

    signal: str
    shape: Literal["linear", "above", "below"]
    amplitude: float
    at: float


@dataclass(frozen=True)
class Shape:
    """Where a learned increment acts, and by which functions.

    Attributes
    ----------
    acts_on : coefficient, or the channel whose reading changes.
    signal : one of `airtruth.physics.terms.signals_of` a motion.
    low, high : range of the signal in which the increment is learned [unit of the signal].
    cells : number of equal cells of the range; 0 for a linear increment, which needs ``memory``.
    trim : value of the signal at the trim.
    memory : state between the signal and the increment; None for an increment of the signal itself. With a factor, the lag
        whose time constant changes.
    factor : one of `airtruth.physics.terms.factors_of` it, whose derivative changes, or whose lag in a reading does; empty where
        the coefficient or the reading itself does.
    factor_trim : value of the factor at the trim.
    step_cell : number of the cell over which a step behind a play rises; None for a function that may bend at every knot. The
        half width of its play is not estimated: the cost has a kink there.
    """

    acts_on: str
    signal: str
    low: float
    high: float
    cells: int
    trim: float
    memory: Memory | None = None
    factor: str = ""
    factor_trim: float = 0.0
    step_cell: int | None = None

    @property
    def width(self) -> float:
        """Width of a cell [unit of the signal]."""
        return (self.high - self.low) / self.cells

    @property
    def knots(self) -> tuple[float, ...]:
        """Points between the cells, where the increment may bend."""
        return tuple(np.linspace(self.low, self.high, self.cells + 1)[1:-1].tolist()) if self.cells else ()

    @property
    def coefficients(self) -> tuple[str, ...]:
        """Names of the coefficients of the function: of its bends, and of the slope where it has one."""
        if self.step_cell is not None:
            return (STEP,)
        bends = tuple(_bend(k) for k in range(len(self.knots)))
        slope = self.acts_on != AXIAL and not (self.memory and self.factor)
        return (*bends, SLOPE) if bends and slope else bends

    @property
    def state(self) -> str:
        """Name of the state; one for each coefficient, signal and kind."""
        kind = self.memory.kind if self.memory is not None else ""
        return f"{NAME}-{self.acts_on}-{self.signal}-{kind}".replace("_", "-")

    @property
    def of_reading(self) -> bool:
        """Whether it changes a reading instead of a coefficient."""
        return self.acts_on in OUTPUTS

    @property
    def of_derivative(self) -> bool:
        """Whether it changes a derivative instead of a coefficient."""
        return bool(self.factor) and not self.of_reading

    @property
    def estimated_memory(self) -> Mapping[str, float]:
        """Constants of the memory that a refit estimates, by name."""
        if self.memory is None or self.factor or self.step_cell is not None:
            return {}
        return self.memory.values

    @property
    def prior_weight(self) -> float:
        """Prior probability over that of a function [-]: all steps behind one play share that of one function."""
        return 1.0 if self.step_cell is None else 1.0 / STEPS

    @property
    def variant(self) -> str:
        """Variant of the effect: coefficient or channel, signal and memory."""
        over = SIGNAL_NAMES[self.signal]
        if self.factor and self.memory is not None:
            return f"{self.acts_on} by a {self.memory.kind} of {SIGNAL_NAMES[self.factor]} over {over}"
        if self.factor:
            return f"{self.acts_on} by {SIGNAL_NAMES[self.factor]} over {over}"
        if self.memory is None:
            return f"{self.acts_on} over {over}"
        return f"{self.acts_on} over a {self.memory.kind} of {over}"

    def terms(self, values: Mapping[str, float]) -> Change:
        """Terms of the increment at given parameters."""
        if self.memory is None:
            return self._change(self._bends(values, self.signal))
        if self.factor:
            lag = StateTerm(self.state, self.memory.kind, self.factor, self.memory.time_s)
            return self._change(self._bends(values, self.signal), lag)
        own = self.memory.values | {name: values[name] for name in self.estimated_memory}
        state = StateTerm(self.state, self.memory.kind, self.signal, **own)
        if self.cells:
            return self._change(self._bends(values, state.name), state)
        share = values["share"]
        pieces = (
            Piece(state.name, "linear", share, self.trim),
            Piece(self.signal, "linear", -share, self.trim),
        )
        return self._change(pieces, state)

    def _change(self, pieces: tuple[Piece, ...], *states: StateTerm) -> Change:
        """The pieces as terms of what the increment acts on."""
        if not self.of_reading:
            by = (self.factor, self.factor_trim) if self.factor else ()
            return Change(states=states, aero=tuple(AeroTerm(self.acts_on, *piece, *by) for piece in pieces))
        behind = self.state if self.factor else ""
        return Change(
            states=states,
            readings=tuple(ReadingTerm(self.acts_on, *piece, behind=behind) for piece in pieces),
        )

    def _bends(self, values: Mapping[str, float], signal: str) -> tuple[Piece, ...]:
        if self.step_cell is not None:
            first = self.low + self.step_cell * self.width
            rise = self._rise(values[STEP] / self.width, signal, first, first + self.width)
            # ends without a slope: the table of a written aircraft then covers the learned range, and its flag states the rest
            return (*rise, Piece(signal, "below", 0.0, self.low), Piece(signal, "above", 0.0, self.high))
        sides: tuple[Literal["below", "above"], ...] = ("below", "above")
        above = [(at, values[_bend(k)] / self.width) for k, at in enumerate(self.knots) if at > self.trim]
        below = [(at, values[_bend(k)] / self.width) for k, at in enumerate(self.knots) if at <= self.trim]
        above.append((self.high, -sum(slope for _, slope in above)))
        below.append((self.low, -sum(slope for _, slope in below)))
        pieces = tuple(
            Piece(signal, shape, slope, at)
            for shape, rows in zip(sides, (below, above), strict=True)
            for at, slope in rows
            if len(rows) > 1
        )
        slope = values.get(SLOPE)
        return pieces + (() if slope is None else self._rise(slope / self.width, signal, self.low, self.high))

    def _rise(self, slope: float, signal: str, low: float, high: float) -> tuple[Piece, ...]:
        """A straight line between two values of the signal, zero at the trim and constant outside of them."""
        above, below = max(low, self.trim), min(high, self.trim)
        pieces: tuple[Piece, ...] = ()
        if high > self.trim:
            pieces += (Piece(signal, "above", slope, above), Piece(signal, "above", -slope, high))
        if low < self.trim:
            pieces += (Piece(signal, "below", slope, below), Piece(signal, "below", -slope, low))
        return pieces

    def basis(self, signal: ArrayLike) -> Array:
        """Increments by a unit of each coefficient, without the factor.

        Parameters
        ----------
        signal : (points,) of the signal, or of the state where there is one.

        Returns
        -------
        (points, coefficients) [-].
        """
        at = np.asarray(signal, dtype=np.float64)
        lines, amplitudes = _pieces_of(self)
        values = np.stack(
            [shape_of(AeroTerm(self.acts_on, self.signal, form, 1.0, at=x), at) for form, x in lines], axis=-1
        )
        return np.asarray(values @ amplitudes)


@lru_cache(maxsize=1024)
def _pieces_of(shape: Shape) -> tuple[tuple[tuple[Literal["linear", "above", "below"], float], ...], Array]:
    """Lines that the basis of a shape consists of, and their amplitudes (lines, coefficients)."""
    rows: dict[tuple[Literal["linear", "above", "below"], float], Array] = {}
    names = shape.coefficients
    for i, name in enumerate(names):
        for piece in shape._bends(dict.fromkeys(names, 0.0) | {name: 1.0}, shape.signal):
            if piece.amplitude != 0.0:
                rows.setdefault((piece.shape, piece.at), np.zeros(len(names)))[i] += piece.amplitude
    return tuple(rows), np.array(list(rows.values())).reshape(len(rows), len(names))


def _bend(k: int) -> str:
    return f"bend_{k + 1}"


__all__ = ["AXIAL", "NAME", "SIGNALS", "SIGNAL_NAMES", "SLOPE", "STEP", "STEPS", "Memory", "Shape"]
