"""Tests that name no effect: whether anything is missing, whatever it is.

Five families of directions, each a chi-square with every nuisance eliminated, and one of the spectrum. A direction
is a series added to CL, Cm or an output. Series of the motion are made of predicted outputs: a prediction does not
contain the noise of its own sample, so that under the null the scores are those of a martingale.

Sources: C. R. Rao's score test as in `airtruth.trace.score`; P. Whittle, J. R. Statist. Soc. B 19 (1957), for
powers in bands of a white series: 2 I/s^2 is chi-square with two degrees of freedom for each frequency.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.stats import chi2

from airtruth.trace.fit import Fit, Problem, Whitener
from airtruth.trace.lower import CHANNELS
from airtruth.trace.model import External, Response, answered, inputs
from airtruth.trace.records import Record, fine, nodes
from airtruth.trace.score import inserted, projected
from airtruth.trace.surface import play

Array = NDArray[np.float64]

LIFT, MOMENT, ALPHA, Q = range(4)
"""Where a series enters."""
_UNIT: Final = (1e-3, 1e-4, 1e-4, 1e-4)
"""Amounts [-, -, rad, rad/s] of the differences that give derivatives: small against noise, large against rounding."""
_BASIS: Final = 5
_POLE_RAD_S: Final = 6.0
"""About the short period of a transport's model; five functions then reach from 0.2 to 2 Hz."""
_HINGES: Final = 6
_MEMORY_S: Final = 0.05
"""Of the low-pass that takes the scatter out of the rate of the predicted angle of attack."""
_TURN: Final = 0.5
"""Share of the rate's standard deviation over which its sign turns."""
_PLAYS: Final = (0.1, 0.25)
"""Half widths over the range of the angle of attack."""
_FRICTIONS: Final = (0.02, 0.06, 0.15)
"""The same of a vane."""
_APART: Final = 1e-3
"""Least eigenvalue, over the largest, of directions that count as different; the answers to an elevator overlap."""
_BAND_HZ: Final = 0.5
_LOWEST_HZ: Final = 1.0
"""Below, the level of the gusts, the biases and a sensor's coloured noise have freedoms of their own."""


@dataclass(frozen=True)
class Anomaly:
    """Evidence that something is missing.

    Attributes
    ----------
    where : what shows it.
    statistic, degrees : a chi-square with so many degrees of freedom where nothing is missing.
    p_value : of the test.
    """

    where: str
    statistic: float
    degrees: int
    p_value: float


@dataclass(frozen=True)
class View:
    """One record as the families see it.

    Attributes
    ----------
    elevator_rad : (points,) on the filter's grid, from the record's first value; largest_rad : over all records.
    alpha_rad, rate_rad_s : (samples,) predicted angle of attack, and its rate behind a low-pass.
    low_rad, high_rad, rate_std_rad_s : range and spread over all records.
    dt_s, sub : sample period [s]; cells of the filter's grid per sample.
    """

    elevator_rad: Array
    largest_rad: float
    alpha_rad: Array
    rate_rad_s: Array
    low_rad: float
    high_rad: float
    rate_std_rad_s: float
    dt_s: float
    sub: int


Series = list[tuple[int, Array]]
"""(entry, (points,) on the filter's grid or (samples,) of an output)."""


def anomalies(null: Fit, problem: Problem, whitener: Whitener) -> tuple[Anomaly, ...]:
    """What each test finds at the optimum of a null hypothesis.

    Parameters
    ----------
    null : a fit; whitener : autoregression of its innovations.
    """
    views = _views(null, problem)
    built = [{name: family.series(view) for name, family in FAMILIES.items()} for view in views]

    def one(index: object) -> Array:
        i = int(index)  # type: ignore[call-overload]
        return _tangents(null, problem, i, [s for series in built[i].values() for s in series])

    extra = problem.each(one, range(len(problem.records)))
    k = len(null.point.sizes)
    extended = [
        inserted(base, k, t, np.zeros((len(t), 3, 3))) for base, t in zip(null.tangents, extra, strict=True)
    ]
    gradient, information = projected(null, problem, extended, whitener, k, len(extra[0]))
    found, at = [], 0
    for name, series in built[0].items():
        span = slice(at, at + len(series))
        at += len(series)
        found.append(Anomaly(name, *chi_square(gradient[span], information[span, span])))
    return (*found, lines([t.r for t in null.tangents], [r.signals.dt_s for r in problem.records]))


def chi_square(gradient: Array, information: Array) -> tuple[float, int, float]:
    """Statistic g' I^-1 g over the directions that can be told apart, their number, and the p-value; 1 of none."""
    known = np.diag(information) > 0.0
    if not known.any():
        return 0.0, 0, 1.0
    gradient, information = gradient[known], information[np.ix_(known, known)]
    scale = np.sqrt(np.diag(information))
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    kept = values > _APART * values.max()
    amounts = (vectors.T @ (gradient / scale))[kept] / np.sqrt(values[kept])
    statistic, degrees = float(amounts @ amounts), int(kept.sum())
    return statistic, degrees, float(chi2.sf(statistic, degrees))


def lines(residuals: Sequence[Array], dt_s: Sequence[float]) -> Anomaly:
    """Whether innovations have more power in a band than they should: a lightly damped mode rings in one.

    Each channel is whitened by an autoregression of first order, which takes up the colour of a sensor's noise and
    cannot take up a mode: one of more orders and channels would.

    Parameters
    ----------
    residuals : of each record (samples, 3).
    dt_s : of each record [s].
    """
    residuals = _whitened(residuals)
    top = 0.5 / max(dt_s)
    edges = np.arange(_LOWEST_HZ, top + 1e-9, _BAND_HZ)
    bands = max(len(edges) - 1, 0)
    power, degrees = np.zeros((bands, 3)), np.zeros(bands)
    square = np.maximum(np.mean(np.concatenate(residuals) ** 2, axis=0), 1e-300)
    for r, dt in zip(residuals, dt_s, strict=True):
        f = np.fft.rfftfreq(len(r), dt)
        ordinates = 2.0 * np.abs(np.fft.rfft(r, axis=0)) ** 2 / (len(r) * square)
        for b in range(bands):
            inside = (f > edges[b]) & (f <= edges[b + 1]) & (f < 0.5 / dt * (1.0 - 1e-9))
            power[b] += ordinates[inside].sum(axis=0)
            degrees[b] += 2.0 * np.count_nonzero(inside)
    seen = degrees > 0.0
    if not seen.any():
        return Anomaly(CHANNELS[0], 0.0, 1, 1.0)
    p = np.ones_like(power)
    p[seen] = chi2.sf(power[seen], degrees[seen][:, None])
    excess = np.sqrt(2.0 * power) - np.sqrt(2.0 * degrees)[:, None]
    # of bands whose p-values are all zero the one with the most power
    b, channel = divmod(int(np.lexsort((-excess.ravel(), p.ravel()))[0]), p.shape[1])
    where = f"{CHANNELS[channel]} at {edges[b]:.1f} to {edges[b + 1]:.1f} Hz"
    return Anomaly(
        where,
        float(power[b, channel]),
        int(degrees[b]),
        min(1.0, 3.0 * int(np.count_nonzero(seen)) * float(p[b, channel])),
    )


def _whitened(residuals: Sequence[Array]) -> list[Array]:
    """Residuals behind a first-order autoregression of each channel, the same for all records."""
    product = sum((r[1:] * r[:-1]).sum(axis=0) for r in residuals)
    square = sum((r[:-1] ** 2).sum(axis=0) for r in residuals)
    pole = product / np.maximum(square, 1e-300)
    return [
        np.concatenate([r[:1] * np.sqrt(np.maximum(1.0 - pole**2, 0.0)), r[1:] - pole * r[:-1]])
        for r in residuals
    ]


def _views(null: Fit, problem: Problem) -> list[View]:
    change = null.hypothesis.change(null.point.sizes)
    elevators = [nodes(r.signals.elevator_rad) for r in problem.records]
    elevators = [e - e[0] for e in elevators]
    largest = max(float(np.abs(e).max()) for e in elevators)
    predicted, rates = [], []
    for record, tangent in zip(problem.records, null.tangents, strict=True):
        y = inputs(record, change).y
        predicted.append(y[:, 0] - np.linalg.solve(tangent.white, tangent.r.T)[0])
        rates.append(_rate(predicted[-1], record.signals.dt_s))
    low, high = np.quantile(np.concatenate(predicted), [0.02, 0.98])
    spread = max(float(np.std(np.concatenate(rates))), 1e-9)
    return [
        View(
            elevator_rad=elevator,
            largest_rad=max(largest, 1e-9),
            alpha_rad=alpha,
            rate_rad_s=rate,
            low_rad=float(low),
            high_rad=max(float(high), float(low) + 1e-6),
            rate_std_rad_s=spread,
            dt_s=record.signals.dt_s,
            sub=record.signals.sub,
        )
        for record, elevator, alpha, rate in zip(problem.records, elevators, predicted, rates, strict=True)
    ]


def _rate(x: Array, dt_s: float) -> Array:
    pole = np.exp(-dt_s / _MEMORY_S)
    smooth = lfilter([1.0 - pole], [1.0, -pole], x - x[0])
    return np.asarray(np.diff(smooth, prepend=0.0) / dt_s)


def _elevator(view: View) -> Series:
    """Unknown responses of lift, moment, alpha and q to the elevator: Laguerre functions, so that memory is seen, the
    square and the square of its first filter, so that curvature is.
    """
    de = view.elevator_rad / view.largest_rad
    pole = np.exp(-_POLE_RAD_S * view.dt_s / view.sub)
    basis = [lfilter([1.0 - pole], [1.0, -pole], de)]
    for _ in range(_BASIS - 1):
        basis.append(lfilter([-pole, 1.0], [1.0, -pole], basis[-1]))
    basis += [de**2, basis[0] ** 2]
    return [
        (entry, b if entry < ALPHA else b[:: view.sub]) for entry in (LIFT, MOMENT, ALPHA, Q) for b in basis
    ]


def _static(view: View) -> Series:
    """Lift and moment as any function of the angle of attack: a slope that changes at each of several hinges."""
    shapes = [fine(s, view.sub) for s in _bends(view.alpha_rad, view.low_rad, view.high_rad)]
    return [(entry, s) for entry in (LIFT, MOMENT) for s in shapes]


def _surface(view: View) -> Series:
    """Lift and moment as any function of the deflection, likewise."""
    shapes = _bends(view.elevator_rad / view.largest_rad, -1.0, 1.0)
    return [(entry, s) for entry in (LIFT, MOMENT) for s in shapes]


def _bends(x: Array, low: float, high: float) -> list[Array]:
    return [np.maximum(0.0, x - at) for at in np.linspace(low, high, _HINGES + 2)[1:-1]]


def _history(view: View) -> Series:
    """Lift and moment that depend on where the angle of attack comes from."""
    span = view.high_rad - view.low_rad
    middle = (view.alpha_rad - 0.5 * (view.low_rad + view.high_rad)) / (0.5 * span)
    rate = view.rate_rad_s / view.rate_std_rad_s
    sign = np.tanh(rate / _TURN)
    shapes = [sign, sign * middle, rate * middle, np.abs(rate)]
    shapes += [play(view.alpha_rad, half * span) / span for half in _PLAYS]
    return [(entry, fine(s - s[0], view.sub)) for entry in (LIFT, MOMENT) for s in shapes]


def _vane(view: View) -> Series:
    """A vane that follows with friction: what a play holds back, and the sign of the rate."""
    span = view.high_rad - view.low_rad
    held = [(view.alpha_rad - play(view.alpha_rad, half * span)) / span for half in _FRICTIONS]
    return [(ALPHA, s) for s in (*held, np.tanh(view.rate_rad_s / view.rate_std_rad_s / _TURN))]


@dataclass(frozen=True)
class Family:
    """Directions of one kind, and the flight that would tell more of what they show."""

    series: Callable[[View], Series]
    advice: str


FAMILIES: Final = {
    "the response to the elevator": Family(
        _elevator,
        "repeat the manoeuvre in both signs and two amplitudes, and add sensors (ax, theta, surface) to see where it "
        "enters.",
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
    "friction of the vane": Family(
        _vane,
        "repeat the manoeuvre small and large, and move the vane by hand on the ground with the log running.",
    ),
}
_RINGING: Final = "sample this channel faster, and shake or excite the aircraft at these frequencies."
_LIBRARY: Final = (
    "repeat the manoeuvre in both signs and two amplitudes: no size of this effect stands every test."
)


def advice(where: str) -> str:
    """The flight that would tell more of an anomaly, by where it shows."""
    if where in FAMILIES:
        return FAMILIES[where].advice
    return _RINGING if where.startswith(CHANNELS) else _LIBRARY


def _tangents(null: Fit, problem: Problem, index: int, series: Series) -> Array:
    """Whitened derivatives of a record's innovations in the amounts of some series, (series, samples, 3)."""
    record: Record = problem.records[index]
    base = null.tangents[index]
    given = inputs(record, null.hypothesis.change(null.point.sizes))
    nothing, still = np.zeros(given.de.size), np.zeros_like(given.y)

    def response(more: External | None = None) -> Response:
        return answered(given, problem.settings, null.point.shared, null.point.local[index], more)

    e, t = response().e, []
    for entry, x in series:
        unit = _UNIT[entry]
        output = still
        if entry >= ALPHA:
            output = still.copy()
            output[:, entry - ALPHA] = unit * x
        more = External(
            unit * x if entry == LIFT else nothing, unit * x if entry == MOMENT else nothing, output
        )
        moved = response(more)
        sound = np.isfinite(moved.logdet)  # else the motion was lost, and nothing can be said
        t.append((moved.e - e) @ base.white.T / unit if sound else np.zeros_like(e))
    return np.array(t)


__all__ = ["FAMILIES", "Anomaly", "Family", "View", "advice", "anomalies", "chi_square", "lines"]
