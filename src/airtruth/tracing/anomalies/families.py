"""Families of directions of the omnibus tests: series added to a coefficient or an output, as functions of the flown motion."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, partial
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.numerics.recursion import low_pass, recursion
from airtruth.physics.motion import Motion
from airtruth.tracing.inference.derivative_likelihood import DERIVATIVES_MOVED
from airtruth.tracing.model.records import fine
from airtruth.tracing.model.surface import play

Array = NDArray[np.float64]

_BASIS: Final = 5
"""Number of Laguerre functions of a control [-] (judgement: with the pole below they reach from 0.2 to 2 Hz)."""
_POLE_RAD_S: Final = 6.0
"""Pole of the Laguerre functions [rad/s] (judgement: near the short period of a transport model)."""
_HINGES: Final = 6
"""Number of hinges of a piecewise linear function [-] (judgement: more test finer bends with less power for each)."""
_TURN: Final = 0.5
"""Share of the rate's standard deviation over which its sign changes [-] (judgement: a smooth sign is less noisy)."""
_PLAYS: Final = (0.1, 0.25)
"""Half widths of hysteresis over the range of the flow angle [-] (judgement)."""
_FRICTIONS: Final = (0.01, 0.04, 0.12)
"""Half widths of the friction of a vane over the same range [-] (judgement)."""


@dataclass(frozen=True)
class View:
    """One record as the families of directions use it.

    Attributes
    ----------
    controls_rad : (controls, points) on the filter's grid, from the record's first values; largest_rad : (controls,) over all
        records.
    flow_rad, rate_rad_s : (samples,) predicted flow angle, and its rate behind a low-pass.
    without_vane_rad : (samples,) reading of the vane as the other sensors show it.
    low_rad, high_rad, rate_std_rad_s : range and spread over all records.
    dt_s, sub : sample period [s]; cells of the filter's grid per sample.
    """

    controls_rad: Array
    largest_rad: Array
    flow_rad: Array
    rate_rad_s: Array
    without_vane_rad: Array
    low_rad: float
    high_rad: float
    rate_std_rad_s: float
    dt_s: float
    sub: int


@dataclass(frozen=True)
class Destinations:
    """Where the series of a motion act: its coefficients by number, then its outputs.

    Attributes
    ----------
    forces : of the coefficients; vane : of the vane.
    drifting : of the vane and the gyros, which respond at once and may drift.
    """

    forces: tuple[int, ...]
    vane: int
    drifting: tuple[int, ...]

    @classmethod
    def of(cls, motion: Motion) -> Destinations:
        """Those of a motion."""
        count = len(motion.coefficients)
        at_once = [count + i for i, y in enumerate(motion.outputs) if y.instrument in ("vane", "gyro")]
        vane = next(count + i for i, y in enumerate(motion.outputs) if y.instrument == "vane")
        return cls(tuple(range(count)), vane, tuple(at_once))

    def output(self, to: int) -> int | None:
        """Number of the output; None for a coefficient."""
        return to - len(self.forces) if to >= len(self.forces) else None


Series = list[tuple[int, Array]]
"""(destination, values): (points,) on the filter's grid, or (samples,) of an output."""


def _response(view: View, to: Destinations, control: int) -> Series:
    """Unknown responses of the coefficients, the vane and the gyros to a control.

    Laguerre functions show memory, the squares of the deflection and of its first filter show curvature.
    """
    de = view.controls_rad[control] / view.largest_rad[control]
    pole = float(np.exp(-_POLE_RAD_S * view.dt_s / view.sub))
    basis = [low_pass(pole, de)]
    for _ in range(_BASIS - 1):
        delayed = np.append(0.0, basis[-1][:-1])
        basis.append(recursion(pole, delayed - pole * basis[-1]))
    basis += [de**2, basis[0] ** 2]
    return [
        (where, b if to.output(where) is None else b[:: view.sub])
        for where in (*to.forces, *to.drifting)
        for b in basis
    ]


def _static(view: View, to: Destinations) -> Series:
    """Coefficients as a piecewise linear function of the flow angle."""
    shapes = [fine(s, view.sub) for s in _bends(view.flow_rad, view.low_rad, view.high_rad)]
    return [(where, s) for where in to.forces for s in shapes]


def _surface(view: View, to: Destinations, control: int) -> Series:
    """Coefficients as a piecewise linear function of a deflection."""
    shapes = _bends(view.controls_rad[control] / view.largest_rad[control], -1.0, 1.0)
    return [(where, s) for where in to.forces for s in shapes]


def _bends(x: Array, low: float, high: float) -> list[Array]:
    return [np.maximum(0.0, x - at) for at in np.linspace(low, high, _HINGES + 2)[1:-1]]


def _history(view: View, to: Destinations) -> Series:
    """Coefficients that depend on the history of the flow angle."""
    span = view.high_rad - view.low_rad
    middle = (view.flow_rad - 0.5 * (view.low_rad + view.high_rad)) / (0.5 * span)
    rate = view.rate_rad_s / view.rate_std_rad_s
    sign = np.tanh(rate / _TURN)
    shapes = [sign, sign * middle, rate * middle, np.abs(rate)]
    shapes += [play(view.flow_rad, half * span) / span for half in _PLAYS]
    return [(where, fine(s - s[0], view.sub)) for where in to.forces for s in shapes]


def _drift(view: View, to: Destinations) -> Series:
    """Coefficients and their slopes over the flow angle, vane and gyros that drift in time: fuel that moves, a sensor that
    warms up."""
    span = view.high_rad - view.low_rad
    middle = (view.flow_rad - 0.5 * (view.low_rad + view.high_rad)) / (0.5 * span)
    time = np.linspace(0.0, 1.0, len(middle))
    forces = [(where, fine(s, view.sub)) for where in to.forces for s in (time, time * middle)]
    return [*forces, *((where, time) for where in to.drifting)]


def _vane(view: View, to: Destinations) -> Series:
    """A vane with friction: the distance to a vane with play, by the motion that the other sensors show.

    In gusts the filter's own prediction follows the vane and shows no motion that the vane withholds.
    """
    span = view.high_rad - view.low_rad
    return [
        (to.vane, (view.without_vane_rad - play(view.without_vane_rad, half * span)) / span)
        for half in _FRICTIONS
    ]


FRICTION: Final = "friction of the vane"
"""Name of the family whose evidence makes a named error of the vane doubtful."""


@dataclass(frozen=True)
class Family:
    """Directions of one kind, and the flight that shows them better."""

    series: Callable[[View], Series]
    advice: str


@cache
def families(motion: Motion) -> Mapping[str, Family]:
    """Name of each family of a motion, as an anomaly states it -> its directions and the flight that shows it better."""
    to, forces, incidence = Destinations.of(motion), motion.forces, motion.incidence
    several = len(motion.controls) > 1
    deflection = {c.name: f" of the {c.name}" if several else "" for c in motion.controls}
    every = [
        (
            f"the response to the {c.name}",
            partial(_response, to=to, control=i),
            "repeat the manoeuvre in both signs and two amplitudes, and add sensors (ax, theta, surface) to locate it.",
        )
        for i, c in enumerate(motion.controls)
    ]
    every.append(
        (
            f"{forces} over the {incidence}",
            partial(_static, to=to),
            f"sweep the {incidence} slowly through the same range, at two airspeeds.",
        )
    )
    every += [
        (
            f"{forces} over the deflection{deflection[c.name]}",
            partial(_surface, to=to, control=i),
            f"repeat the manoeuvre in both signs and at several amplitudes of the {c.name}.",
        )
        for i, c in enumerate(motion.controls)
    ]
    every += [
        (
            f"{forces} by the history of the {incidence}",
            partial(_history, to=to),
            f"sweep the same range of {incidence.replace('angle', 'angles')} up and down, at two rates.",
        ),
        (
            "a drift in time",
            partial(_drift, to=to),
            "repeat the manoeuvre at the start and at the end of a long record, log the fuel, and compare the sensors at rest "
            "before and after the flight.",
        ),
        (
            FRICTION,
            partial(_vane, to=to),
            "repeat the manoeuvre small and large, and move the vane by hand on the ground with the log running.",
        ),
    ]
    return MappingProxyType({name: Family(series, advice) for name, series, advice in every})


_RINGING: Final = "sample this channel faster, and shake or excite the aircraft at these frequencies."
"""Advice for an anomaly of the spectrum."""
_LIBRARY: Final = (
    "repeat the manoeuvre in both signs and two amplitudes. "
    "This effect has a significant score and was not accepted; the list of candidates states the reason."
)
"""Advice for an effect of the library that was not accepted."""
_GROUND: Final = (
    "trace again with `derivatives` among the candidates, and measure CG, mass and inertia on the ground."
)
"""Advice for derivatives that no accepted effect explains."""


def advice(where: str, motion: Motion) -> str:
    """The flight that shows an anomaly better, by the test that shows it."""
    known = families(motion)
    if where in known:
        return known[where].advice
    if where == DERIVATIVES_MOVED:
        return _GROUND
    return _RINGING if where.startswith(motion.output_channels) else _LIBRARY


__all__ = ["FRICTION", "Destinations", "Family", "Series", "View", "advice", "families"]
