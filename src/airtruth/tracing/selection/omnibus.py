"""Omnibus tests: whether the declared aircraft lacks anything, whichever effect it is.

Six families of directions, each a chi-square test with the nuisance parameters eliminated, and a test of the spectrum
(`airtruth.tracing.selection.spectrum`). A direction is a series added to CL, Cm or an output. Series of the motion are
functions of predicted outputs: a prediction does not contain the noise of its own sample, so that under the null the scores
are a martingale.

Source: C. R. Rao's score test as in `airtruth.tracing.selection.score_test`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.stats import chi2

from airtruth.tracing.inference.posterior import PosteriorFit, TraceProblem
from airtruth.tracing.inference.whitening import Whitener
from airtruth.tracing.model.compile import CHANNELS
from airtruth.tracing.model.records import TraceRecord, fine, nodes
from airtruth.tracing.model.response import External, Response, filter_inputs, respond_to
from airtruth.tracing.model.settings import without_vane
from airtruth.tracing.model.surface import play
from airtruth.tracing.selection.anomaly import DERIVATIVES_MOVED, Anomaly
from airtruth.tracing.selection.direction import inserted, projected
from airtruth.tracing.selection.spectrum import lines

Array = NDArray[np.float64]

LIFT, MOMENT, ALPHA, Q = range(4)
"""Destinations of a series: CL, Cm, and the outputs alpha and q."""
_UNIT: Final = (1e-3, 1e-4, 1e-4, 1e-4)
"""Amounts for differences, per destination [-, -, rad, rad/s] (judgement: small against noise, large against rounding)."""
_BASIS: Final = 5
"""Number of Laguerre functions of the elevator [-] (judgement: with the pole below they reach from 0.2 to 2 Hz)."""
_POLE_RAD_S: Final = 6.0
"""Pole of the Laguerre functions [rad/s] (judgement: near the short period of a transport model)."""
_HINGES: Final = 6
"""Number of hinges of a piecewise linear function [-] (judgement: more test finer bends with less power for each)."""
_MEMORY_S: Final = 0.05
"""Time constant of the low-pass before the rate of the predicted angle of attack is taken [s] (judgement)."""
_TURN: Final = 0.5
"""Share of the rate's standard deviation over which its sign changes [-] (judgement: a smooth sign is less noisy)."""
_PLAYS: Final = (0.1, 0.25)
"""Half widths of hysteresis over the range of the angle of attack [-] (judgement)."""
_FRICTIONS: Final = (0.01, 0.04, 0.12)
"""Half widths of the friction of a vane over the same range [-] (judgement)."""
_DISTINCT: Final = 1e-3
"""Least eigenvalue, over the largest, of directions that count as distinct [-] (judgement: responses to an elevator
overlap)."""
_QUANTILES: Final = (0.02, 0.98)
"""Quantiles of the predicted angle of attack that count as its range [-] (judgement)."""


@dataclass(frozen=True)
class View:
    """One record as the families of directions use it.

    Attributes
    ----------
    elevator_rad : (points,) on the filter's grid, from the record's first value; largest_rad : over all records.
    alpha_rad, rate_rad_s : (samples,) predicted angle of attack, and its rate behind a low-pass.
    without_vane_rad : (samples,) reading of the vane as gyro and accelerometer show it.
    low_rad, high_rad, rate_std_rad_s : range and spread over all records.
    dt_s, sub : sample period [s]; cells of the filter's grid per sample.
    """

    elevator_rad: Array
    largest_rad: float
    alpha_rad: Array
    rate_rad_s: Array
    without_vane_rad: Array
    low_rad: float
    high_rad: float
    rate_std_rad_s: float
    dt_s: float
    sub: int


Series = list[tuple[int, Array]]
"""(destination, values): (points,) on the filter's grid, or (samples,) of an output."""


def anomalies(null: PosteriorFit, problem: TraceProblem, whitener: Whitener) -> tuple[Anomaly, ...]:
    """Run every test at the optimum of a null hypothesis.

    Parameters
    ----------
    null : a fit; whitener : autoregression of its innovations.
    """
    seen = views(null, problem)
    measured = problem.settings.measured
    built = [
        {
            name: [s for s in family.series(view) if s[0] < ALPHA or measured[s[0] - ALPHA]]
            for name, family in FAMILIES.items()
        }
        for view in seen
    ]

    def one(index: int) -> Array:
        return _tangents(null, problem, index, [s for series in built[index].values() for s in series])

    extra = problem.each(one, range(len(problem.records)))
    extended = [
        inserted(base, null.layout.sizes.stop, t, np.zeros((len(t), 3, 3)))
        for base, t in zip(null.sensitivities, extra, strict=True)
    ]
    gradient, information = projected(null, problem, extended, whitener)
    found, at = [], 0
    for name, series in built[0].items():
        span = slice(at, at + len(series))
        at += len(series)
        found.append(Anomaly(name, *chi_square(gradient[span], information[span, span])))
    residuals = [np.where(measured, t.r, 0.0) for t in null.sensitivities]
    return (*found, lines(residuals, [r.signals.dt_s for r in problem.records]))


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
    elevators = [nodes(r.signals.elevator_rad) for r in problem.records]
    elevators = [e - e[0] for e in elevators]
    largest = max(float(np.abs(e).max()) for e in elevators)
    settings = without_vane(problem.settings)
    predicted, rates, others = [], [], []
    for i, (record, tangent) in enumerate(zip(problem.records, null.sensitivities, strict=True)):
        given = filter_inputs(record, change)
        y = given.y[given.lead :]
        predicted.append(y[:, 0] - np.linalg.solve(tangent.white, tangent.r.T)[0])
        rates.append(_rate(predicted[-1], record.signals.dt_s))
        without = respond_to(given, settings, null.point.common, null.point.per_record[i])
        lost = not np.isfinite(without.logdet)
        others.append(predicted[-1] if lost else y[:, 0] - without.e[:, 0] + _from_others(without))
    low, high = np.quantile(np.concatenate(predicted), _QUANTILES)
    spread = max(float(np.std(np.concatenate(rates))), 1e-9)
    return [
        View(
            elevator_rad=elevator,
            largest_rad=max(largest, 1e-9),
            alpha_rad=alpha,
            rate_rad_s=rate,
            without_vane_rad=other,
            low_rad=float(low),
            high_rad=max(float(high), float(low) + 1e-6),
            rate_std_rad_s=spread,
            dt_s=record.signals.dt_s,
            sub=record.signals.sub,
        )
        for record, elevator, alpha, rate, other in zip(
            problem.records, elevators, predicted, rates, others, strict=True
        )
    ]


def _from_others(without: Response) -> Array:
    """Innovation of the vane that those of gyro and accelerometer lead to expect, (samples,) [rad].

    A reading that rests on the other sensors' current samples, and on all earlier ones, is independent of the current
    residual of the vane given them, so that its score is a martingale too.
    """
    s = without.covariance
    return np.asarray(without.e[:, 1:] @ np.linalg.solve(s[1:, 1:], s[1:, 0]))


def _rate(x: Array, dt_s: float) -> Array:
    pole = np.exp(-dt_s / _MEMORY_S)
    smooth = lfilter([1.0 - pole], [1.0, -pole], x - x[0])
    return np.asarray(np.diff(smooth, prepend=0.0) / dt_s)


def _elevator(view: View) -> Series:
    """Unknown responses of lift, moment, alpha and q to the elevator.

    Laguerre functions show memory, the squares of the elevator and of its first filter show curvature.
    """
    de = view.elevator_rad / view.largest_rad
    pole = np.exp(-_POLE_RAD_S * view.dt_s / view.sub)
    basis = [lfilter([1.0 - pole], [1.0, -pole], de)]
    for _ in range(_BASIS - 1):
        basis.append(lfilter([-pole, 1.0], [1.0, -pole], basis[-1]))
    basis += [de**2, basis[0] ** 2]
    return [(to, b if to < ALPHA else b[:: view.sub]) for to in (LIFT, MOMENT, ALPHA, Q) for b in basis]


def _static(view: View) -> Series:
    """Lift and moment as a piecewise linear function of the angle of attack."""
    shapes = [fine(s, view.sub) for s in _bends(view.alpha_rad, view.low_rad, view.high_rad)]
    return [(to, s) for to in (LIFT, MOMENT) for s in shapes]


def _surface(view: View) -> Series:
    """Lift and moment as a piecewise linear function of the deflection."""
    shapes = _bends(view.elevator_rad / view.largest_rad, -1.0, 1.0)
    return [(to, s) for to in (LIFT, MOMENT) for s in shapes]


def _bends(x: Array, low: float, high: float) -> list[Array]:
    return [np.maximum(0.0, x - at) for at in np.linspace(low, high, _HINGES + 2)[1:-1]]


def _history(view: View) -> Series:
    """Lift and moment that depend on the history of the angle of attack."""
    span = view.high_rad - view.low_rad
    middle = (view.alpha_rad - 0.5 * (view.low_rad + view.high_rad)) / (0.5 * span)
    rate = view.rate_rad_s / view.rate_std_rad_s
    sign = np.tanh(rate / _TURN)
    shapes = [sign, sign * middle, rate * middle, np.abs(rate)]
    shapes += [play(view.alpha_rad, half * span) / span for half in _PLAYS]
    return [(to, fine(s - s[0], view.sub)) for to in (LIFT, MOMENT) for s in shapes]


def _drift(view: View) -> Series:
    """Lift, moment and their slopes over the angle of attack, vane and gyro that drift in time: fuel that moves, a sensor that
    warms up."""
    span = view.high_rad - view.low_rad
    middle = (view.alpha_rad - 0.5 * (view.low_rad + view.high_rad)) / (0.5 * span)
    time = np.linspace(0.0, 1.0, len(middle))
    forces = [(to, fine(s, view.sub)) for to in (LIFT, MOMENT) for s in (time, time * middle)]
    return [*forces, (ALPHA, time), (Q, time)]


def _vane(view: View) -> Series:
    """A vane with friction: the distance to a vane with play, by the motion that the other sensors show.

    In gusts the filter's own prediction follows the vane and shows no motion that the vane withholds.
    """
    span = view.high_rad - view.low_rad
    return [
        (ALPHA, (view.without_vane_rad - play(view.without_vane_rad, half * span)) / span)
        for half in _FRICTIONS
    ]


FRICTION: Final = "friction of the vane"
"""Name of the family whose evidence makes a named error of the vane doubtful."""


@dataclass(frozen=True)
class Family:
    """Directions of one kind, and the flight that shows them better."""

    series: Callable[[View], Series]
    advice: str


FAMILIES: Final = {
    "the response to the elevator": Family(
        _elevator,
        "repeat the manoeuvre in both signs and two amplitudes, and add sensors (ax, theta, surface) to locate it.",
    ),
    "lift or moment over the angle of attack": Family(
        _static, "sweep the angle of attack slowly through the same range, at two airspeeds."
    ),
    "lift or moment over the deflection": Family(
        _surface, "repeat the manoeuvre in both signs and at several amplitudes of the elevator."
    ),
    "lift or moment by the history of the angle of attack": Family(
        _history, "sweep the same range of angles of attack up and down, at two rates."
    ),
    "a drift in time": Family(
        _drift,
        "repeat the manoeuvre at the start and at the end of a long record, log the fuel, and compare the sensors at rest "
        "before and after the flight.",
    ),
    FRICTION: Family(
        _vane,
        "repeat the manoeuvre small and large, and move the vane by hand on the ground with the log running.",
    ),
}
"""Name of a family, as an anomaly states it -> its directions and the flight that shows it better."""
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


def advice(where: str) -> str:
    """The flight that shows an anomaly better, by the test that shows it."""
    if where in FAMILIES:
        return FAMILIES[where].advice
    if where == DERIVATIVES_MOVED:
        return _GROUND
    return _RINGING if where.startswith(CHANNELS) else _LIBRARY


def _tangents(null: PosteriorFit, problem: TraceProblem, index: int, series: Series) -> Array:
    """Whitened derivatives of a record's innovations in the amounts of some series, (series, samples, 3)."""
    record: TraceRecord = problem.records[index]
    base = null.sensitivities[index]
    given = filter_inputs(record, null.hypothesis.compiled(null.point.sizes))
    still = np.zeros_like(base.r)
    nothing = np.zeros((len(still) - 1) * record.signals.sub + 1)

    def response(more: External | None = None) -> Response:
        common, own = null.point.common, null.point.per_record[index]
        return respond_to(given, problem.settings, common, own, external=more)

    e, t = response().e, []
    for to, x in series:
        unit = _UNIT[to]
        output = still
        if to >= ALPHA:
            output = still.copy()
            output[:, to - ALPHA] = unit * x
        more = External(unit * x if to == LIFT else nothing, unit * x if to == MOMENT else nothing, output)
        moved = response(more)
        sound = np.isfinite(moved.logdet)  # else the motion diverged, and the direction has no evidence
        t.append((moved.e - e) @ base.white.T / unit if sound else np.zeros_like(e))
    return np.array(t)


__all__ = ["FAMILIES", "FRICTION", "Family", "View", "advice", "anomalies", "chi_square", "views"]
