"""Omnibus tests: whether the declared aircraft lacks anything, whichever effect it is.

Families of directions, each a chi-square test with the nuisance parameters eliminated, and a test of the spectrum
(`airtruth.tracing.selection.spectrum`). A direction is a series added to a coefficient or an output. Series of the motion are
functions of predicted outputs: a prediction does not contain the noise of its own sample, so that under the null the scores
are a martingale.

Source: C. R. Rao's score test as in `airtruth.tracing.selection.score_test`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, partial
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.stats import chi2

from airtruth.physics.motion import Motion
from airtruth.tracing.inference.posterior import PosteriorFit, TraceProblem
from airtruth.tracing.inference.whitening import Whitener
from airtruth.tracing.model.records import TraceRecord, fine, nodes
from airtruth.tracing.model.response import External, Response, filter_inputs, respond_to
from airtruth.tracing.model.settings import without
from airtruth.tracing.model.surface import play
from airtruth.tracing.selection.anomaly import DERIVATIVES_MOVED, Anomaly
from airtruth.tracing.selection.direction import inserted, projected
from airtruth.tracing.selection.spectrum import lines

Array = NDArray[np.float64]

_UNIT: Final = {"force": 1e-3, "moment": 1e-4, "output": 1e-4}
"""Amounts for differences of a coefficient [-] and of an output [rad, rad/s] (judgement: small against noise, large against
rounding)."""
_BASIS: Final = 5
"""Number of Laguerre functions of a control [-] (judgement: with the pole below they reach from 0.2 to 2 Hz)."""
_POLE_RAD_S: Final = 6.0
"""Pole of the Laguerre functions [rad/s] (judgement: near the short period of a transport model)."""
_HINGES: Final = 6
"""Number of hinges of a piecewise linear function [-] (judgement: more test finer bends with less power for each)."""
_MEMORY_S: Final = 0.05
"""Time constant of the low-pass before the rate of the predicted flow angle is taken [s] (judgement)."""
_TURN: Final = 0.5
"""Share of the rate's standard deviation over which its sign changes [-] (judgement: a smooth sign is less noisy)."""
_PLAYS: Final = (0.1, 0.25)
"""Half widths of hysteresis over the range of the flow angle [-] (judgement)."""
_FRICTIONS: Final = (0.01, 0.04, 0.12)
"""Half widths of the friction of a vane over the same range [-] (judgement)."""
_DISTINCT: Final = 1e-3
"""Least eigenvalue, over the largest, of directions that count as distinct [-] (judgement: responses to a control
overlap)."""
_QUANTILES: Final = (0.02, 0.98)
"""Quantiles of the predicted flow angle that count as its range [-] (judgement)."""


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
    units : amount for differences of each [-, rad, rad/s].
    """

    forces: tuple[int, ...]
    vane: int
    drifting: tuple[int, ...]
    units: tuple[float, ...]

    @classmethod
    def of(cls, motion: Motion) -> Destinations:
        """Those of a motion."""
        count = len(motion.coefficients)
        kinds = ["force" if c.length is None else "moment" for c in motion.coefficients]
        at_once = [count + i for i, y in enumerate(motion.outputs) if y.instrument in ("vane", "gyro")]
        vane = next(count + i for i, y in enumerate(motion.outputs) if y.instrument == "vane")
        units = (*(_UNIT[kind] for kind in kinds), *(_UNIT["output"] for _ in motion.outputs))
        return cls(tuple(range(count)), vane, tuple(at_once), units)

    def output(self, to: int) -> int | None:
        """Number of the output; None for a coefficient."""
        return to - len(self.forces) if to >= len(self.forces) else None


Series = list[tuple[int, Array]]
"""(destination, values): (points,) on the filter's grid, or (samples,) of an output."""


def anomalies(null: PosteriorFit, problem: TraceProblem, whitener: Whitener) -> tuple[Anomaly, ...]:
    """Run every test at the optimum of a null hypothesis.

    Parameters
    ----------
    null : a fit; whitener : autoregression of its innovations.
    """
    seen = views(null, problem)
    measured, motion = problem.settings.measured, problem.layout.motion
    to_outputs = Destinations.of(motion).output
    built = [
        {
            name: [x for x in family.series(view) if (i := to_outputs(x[0])) is None or measured[i]]
            for name, family in families(motion).items()
        }
        for view in seen
    ]

    def one(index: int) -> Array:
        return _tangents(null, problem, index, [s for series in built[index].values() for s in series])

    extra = problem.each(one, range(len(problem.records)))
    extended = [
        inserted(base, null.layout.sizes.stop, t, np.zeros((len(t), *base.white.shape)))
        for base, t in zip(null.sensitivities, extra, strict=True)
    ]
    gradient, information = projected(null, problem, extended, whitener)
    found, at = [], 0
    for name, series in built[0].items():
        span = slice(at, at + len(series))
        at += len(series)
        found.append(Anomaly(name, *chi_square(gradient[span], information[span, span])))
    residuals = [np.where(measured, t.r, 0.0) for t in null.sensitivities]
    periods = [r.signals.dt_s for r in problem.records]
    return (*found, lines(residuals, periods, motion.output_channels))


def chi_square(gradient: Array, information: Array) -> tuple[float, int, float]:
    """Statistic g' I^-1 g over the distinct directions, their number, and the p-value, 1 where there are none."""
    known = np.diag(information) > 0.0
    if not known.any():
        return 0.0, 0, 1.0
    gradient, information = gradient[known], information[np.ix_(known, known)]
    scale = np.sqrt(np.diag(information))
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    kept = values > _DISTINCT * values.max()
    amounts = (vectors.T @ (gradient / scale))[kept] / np.sqrt(values[kept])
    statistic, degrees = float(amounts @ amounts), int(kept.sum())
    return statistic, degrees, float(chi2.sf(statistic, degrees))


def views(null: PosteriorFit, problem: TraceProblem) -> list[View]:
    """Each record as the families of directions use it, at the optimum of a null hypothesis."""
    change = null.hypothesis.compiled(null.point.sizes)
    vane = _vane_number(problem.layout.motion)
    controls = [np.array([nodes(row) for row in r.signals.controls_rad]) for r in problem.records]
    controls = [c - c[:, :1] for c in controls]
    largest = np.maximum(np.max([np.abs(c).max(axis=1) for c in controls], axis=0), 1e-9)
    settings = without(problem.settings, vane)
    predicted, rates, others = [], [], []
    for i, (record, tangent) in enumerate(zip(problem.records, null.sensitivities, strict=True)):
        given = filter_inputs(record, change)
        y = given.y[given.lead :, vane]
        predicted.append(y - np.linalg.solve(tangent.white, tangent.r.T)[vane])
        rates.append(_rate(predicted[-1], record.signals.dt_s))
        unread = respond_to(given, settings, null.point.common, null.point.per_record[i])
        lost = not np.isfinite(unread.logdet)
        others.append(predicted[-1] if lost else y - unread.e[:, vane] + _from_others(unread, vane))
    low, high = np.quantile(np.concatenate(predicted), _QUANTILES)
    spread = max(float(np.std(np.concatenate(rates))), 1e-9)
    return [
        View(
            controls_rad=control,
            largest_rad=largest,
            flow_rad=flow,
            rate_rad_s=rate,
            without_vane_rad=other,
            low_rad=float(low),
            high_rad=max(float(high), float(low) + 1e-6),
            rate_std_rad_s=spread,
            dt_s=record.signals.dt_s,
            sub=record.signals.sub,
        )
        for record, control, flow, rate, other in zip(
            problem.records, controls, predicted, rates, others, strict=True
        )
    ]


def _vane_number(motion: Motion) -> int:
    """Number of the vane among the outputs."""
    return next(i for i, y in enumerate(motion.outputs) if y.instrument == "vane")


def _from_others(without_vane: Response, vane: int) -> Array:
    """Innovation of the vane that those of the other sensors lead to expect, (samples,) [rad].

    A reading that rests on the other sensors' current samples, and on all earlier ones, is independent of the current
    residual of the vane given them, so that its score is a martingale too.
    """
    s, rest = without_vane.covariance, np.arange(len(without_vane.covariance)) != vane
    return np.asarray(without_vane.e[:, rest] @ np.linalg.solve(s[np.ix_(rest, rest)], s[rest, vane]))


def _rate(x: Array, dt_s: float) -> Array:
    pole = np.exp(-dt_s / _MEMORY_S)
    smooth = lfilter([1.0 - pole], [1.0, -pole], x - x[0])
    return np.asarray(np.diff(smooth, prepend=0.0) / dt_s)


def _response(view: View, to: Destinations, control: int) -> Series:
    """Unknown responses of the coefficients, the vane and the gyros to a control.

    Laguerre functions show memory, the squares of the deflection and of its first filter show curvature.
    """
    de = view.controls_rad[control] / view.largest_rad[control]
    pole = np.exp(-_POLE_RAD_S * view.dt_s / view.sub)
    basis = [lfilter([1.0 - pole], [1.0, -pole], de)]
    for _ in range(_BASIS - 1):
        basis.append(lfilter([-pole, 1.0], [1.0, -pole], basis[-1]))
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


def _tangents(null: PosteriorFit, problem: TraceProblem, index: int, series: Series) -> Array:
    """Whitened derivatives of a record's innovations in the amounts of some series, (series, samples, outputs)."""
    record: TraceRecord = problem.records[index]
    base, to = null.sensitivities[index], Destinations.of(problem.layout.motion)
    given = filter_inputs(record, null.hypothesis.compiled(null.point.sizes))
    still = np.zeros_like(base.r)
    nothing = np.zeros((len(to.forces), (len(still) - 1) * record.signals.sub + 1))

    def response(more: External | None = None) -> Response:
        common, own = null.point.common, null.point.per_record[index]
        return respond_to(given, problem.settings, common, own, external=more)

    e, t = response().e, []
    for where, x in series:
        unit, column = to.units[where], to.output(where)
        force, output = nothing, still
        if column is None:
            force = nothing.copy()
            force[where] = unit * x
        else:
            output = still.copy()
            output[:, column] = unit * x
        moved = response(External(force, output))
        sound = np.isfinite(moved.logdet)  # else the motion diverged, and the direction has no evidence
        t.append((moved.e - e) @ base.white.T / unit if sound else np.zeros_like(e))
    return np.array(t)


__all__ = ["FRICTION", "Family", "View", "advice", "anomalies", "chi_square", "families", "views"]
