"""Regressions of the lateral-directional motion: least squares, and instrumental variables behind two filters.

Every equation of a record has the same regressors, so that Z and X have one row for each signal and serve all
coefficients. Instruments are the states of the linear model (`airtruth.physics.lateral`) at the last estimate, driven by
the measured surfaces.

Source of the instruments and filters: M. Brunot, "An Instrumental Variable Approach for Aircraft Identification", eqs (7),
(9) and (11). The dynamic filter has the third-order denominator of beta, p and r alone: the spiral root, a tenth of a
radian per second or less, would make it an integrator of the noise.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.identification.estimates import chosen
from airtruth.identification.lateral.kernels import filter_rows, respond, steps
from airtruth.identification.lateral.observation import CONTROLS, LateralObservation
from airtruth.identification.options import Options
from airtruth.identification.regression.auxiliary import GROWTH
from airtruth.numerics.prefilter import butterworth, zero_phase
from airtruth.physics.lateral import lateral_system, places
from airtruth.physics.motion import LATERAL

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

_STATES: Final = [number for is_state, number in places(LATERAL) if is_state]
"""States among the signals, in the order of the signals."""
_FAST: Final = 3
"""Order of the dynamic filter: the states beta, p and r."""


@dataclass(frozen=True)
class Rows:
    """Filtered regression of runs, orthogonal to its free constants.

    Attributes
    ----------
    z, x : (runs, signals, samples) instruments and regressors.
    y : (runs, coefficients, samples) left sides.
    free : (runs, columns, samples) orthonormal rows of the free constants and trends.
    """

    z: Array
    x: Array
    y: Array
    free: Array


@dataclass(frozen=True)
class LateralProblem:
    """A regression whose instruments theta makes.

    Attributes
    ----------
    rows : (theta (active, 15), active) -> rows of the runs ``active``.
    usable : likewise -> (active,) whether theta makes instruments.
    runs : number of runs.
    """

    rows: Callable[[Array, Ints], Rows]
    usable: Callable[[Array, Ints], Bools]
    runs: int


def rate_of(x: Array, dt_s: float) -> Array:
    """Fourth-order differences along the last axis, two samples shorter at each end: their error falls as dt^4.

    Examples
    --------
    >>> rate_of(np.arange(6.0) ** 4, 1.0).tolist()
    [32.0, 108.0]
    """
    return np.asarray((8.0 * (x[..., 3:-1] - x[..., 1:-3]) - (x[..., 4:] - x[..., :-4])) / (12.0 * dt_s))


def free_of(z: Array, x: Array, y: Array, columns: Array) -> Rows:
    """Rows orthogonal to the free columns (runs, columns, samples)."""
    basis = np.ascontiguousarray(np.swapaxes(np.linalg.qr(np.swapaxes(columns, 1, 2))[0], 1, 2))

    def without(rows: Array) -> Array:
        return np.asarray(rows - np.matmul(np.matmul(rows, np.swapaxes(basis, 1, 2)), basis))

    own = without(x)
    return Rows(own if z is x else without(z), own, without(y), basis)


def with_corners(o: LateralObservation) -> Array:
    """Regressors whose surfaces have, sample by sample, the area that they have between the samples.

    The corners of a servo behind a held command, sampled, change the moments of the surfaces by up to half a percent.
    """
    x: Array = o.regressors.copy()
    x[:, -len(CONTROLS) :, :-1] += 0.5 * (o.bend[..., :-1] + o.bend[..., 1:])
    return x


def smoothed(o: LateralObservation, options: Options) -> Rows:
    """Rows of least squares: low-passed signals, and fourth-order differences of the left sides."""
    sos = butterworth(options.cutoff_of(o.dt_s), options.order, o.dt_s)
    inside = slice(2, -2)
    x = zero_phase(with_corners(o), sos)[..., inside]
    y = rate_of(zero_phase(o.slopes, sos), o.dt_s) + zero_phase(o.added, sos)[..., inside]
    columns = o.nuisance()
    columns[:, o.trend + 1 :] = zero_phase(columns[:, o.trend + 1 :], sos)
    return free_of(x, x, y, columns[..., inside])


def _all(theta: Array, active: Ints) -> Bools:
    return np.ones(active.size, dtype=np.bool_)


def picked(rows: Rows, active: Ints) -> Rows:
    """Rows of some runs."""
    z = rows.z[active]
    return Rows(z, z if rows.z is rows.x else rows.x[active], rows.y[active], rows.free[active])


def ls_problem(o: LateralObservation, options: Options, rows: Rows) -> LateralProblem:
    """Least squares of `smoothed` rows: the regressors are their own instruments."""
    return LateralProblem(lambda theta, active: picked(rows, active), _all, rows.x.shape[0])


def lowpass_problem(o: LateralObservation, options: Options, rows: Rows) -> LateralProblem:
    """Instruments of the low-passed surfaces for the `smoothed` rows of least squares: IV(de_f) of the paper."""
    u = zero_phase(
        with_corners(o)[:, -len(CONTROLS) :], butterworth(options.cutoff_of(o.dt_s), options.order, o.dt_s)
    )
    u = u - u[..., :1]
    bend = smooth_bend(u)

    def at(theta: Array, active: Ints) -> Rows:
        own = picked(rows, active)
        z = instruments(o, theta, active, u[active], bend[active])[..., 2:-2]
        # instruments have to be orthogonal to the constants; the regressors are so already
        return Rows(
            z - np.matmul(np.matmul(z, np.swapaxes(own.free, 1, 2)), own.free), own.x, own.y, own.free
        )

    return LateralProblem(at, lambda theta, active: bounded(o, theta, active), rows.x.shape[0])


def f1_problem(o: LateralObservation, options: Options, rows: Rows) -> LateralProblem:
    """Regressors, instruments and left sides behind F(p) = 1/Delta(p), Delta = |p I - A| of beta, p and r.

    Filters start from rest, and left sides count from the first sample, so that F p x = F x' holds exactly. Signals are
    linear between samples plus the area of the cubic through the four nearest; surfaces have the corners of their servo.
    The `smoothed` rows of least squares have no effect.
    """
    count = len(LATERAL.signals)
    coefficients = len(LATERAL.coefficients)
    u = np.concatenate([o.regressors, o.slopes, o.added, o.nuisance()], axis=1)
    more = smooth_bend(u)
    more[:, count - o.bend.shape[1] : count] += o.bend
    controls, control_bend = o.controls, more[:, count - o.bend.shape[1] : count]
    taps = np.zeros(u.shape[1] + count, dtype=np.int64)
    taps[count : count + coefficients] = 1

    def at(theta: Array, active: Ints) -> Rows:
        z = instruments(o, theta, active, controls[active], control_bend[active])
        z_bend = smooth_bend(z)
        z_bend[:, len(_STATES) :] = control_bend[active]
        rows = np.concatenate([u[active], z], axis=1)
        bends = np.concatenate([more[active], z_bend], axis=1)
        out = np.empty_like(rows)
        phi, early, late = _denominator_step(o, theta, active)
        filter_rows(phi, early, late, rows, bends, taps, out)
        x, slopes = out[:, :count], out[:, count : count + coefficients]
        added = out[:, count + coefficients : count + 2 * coefficients]
        return free_of(out[:, -count:], x, slopes + added, out[:, count + 2 * coefficients : -count])

    return LateralProblem(at, lambda theta, active: bounded(o, theta, active), u.shape[0])


def smooth_bend(u: Array) -> Array:
    """Mean of the cubic through the four nearest samples over the cell that ends at each sample, less that of its ends."""
    edge = np.concatenate([u[..., :1], u, u[..., -1:]], axis=-1)
    bend = np.zeros_like(u)
    bend[..., 1:] = (edge[..., 1:-2] + edge[..., 2:-1] - edge[..., :-3] - edge[..., 3:]) / 24.0
    return bend


def instruments(o: LateralObservation, theta: Array, active: Ints, u: Array, bend: Array) -> Array:
    """States of the linear model driven by the surfaces, and the surfaces: (active, signals, samples), as the regressors."""
    scale = chosen(o.scale, active)
    linear = lateral_system(theta, scale)
    x = np.empty((active.size, len(LATERAL.states), u.shape[2]))
    respond(
        *_discrete(np.concatenate([linear.a, linear.b], axis=2), o.dt_s), np.ascontiguousarray(u), bend, x
    )
    z = np.concatenate([x[:, _STATES], u], axis=1)
    for number, signal in enumerate(LATERAL.signals):
        if signal.length is not None:
            z[:, number] *= scale.half_span_time[:, None]
    return z


def _discrete(systems: Array, dt_s: float) -> tuple[Array, Array, Array]:
    runs, n, width = systems.shape
    phi, early, late = np.empty((runs, n, n)), np.empty((runs, n, width - n)), np.empty((runs, n, width - n))
    steps(np.ascontiguousarray(systems), dt_s, phi, early, late)
    return phi, early, late


def _denominator_step(o: LateralObservation, theta: Array, active: Ints) -> tuple[Array, Array, Array]:
    """Exact step of 1/Delta(p) in the states F u, p F u, p^2 F u."""
    a = lateral_system(theta, chosen(o.scale, active)).a[:, :_FAST, :_FAST]
    trace = np.trace(a, axis1=1, axis2=2)
    second = 0.5 * (trace**2 - np.einsum("rij,rji->r", a, a))
    systems = np.zeros((active.size, _FAST, _FAST + 1))
    systems[:, 0, 1] = systems[:, 1, 2] = systems[:, 2, 3] = 1.0
    systems[:, 2, 0], systems[:, 2, 1], systems[:, 2, 2] = np.linalg.det(a), -second, trace
    phi, early, late = _discrete(systems, o.dt_s)
    return phi, np.ascontiguousarray(early[..., 0]), np.ascontiguousarray(late[..., 0])


def bounded(o: LateralObservation, theta: Array, active: Ints) -> Bools:
    """(active,) whether the motion of the linear model grows by less than `GROWTH` over the record."""
    a = lateral_system(theta, chosen(o.scale, active)).a
    duration_s = o.dt_s * o.regressors.shape[2]
    phi = _discrete(a, duration_s)[0]
    with np.errstate(invalid="ignore"):
        return np.asarray(np.isfinite(phi).all(axis=(1, 2)) & (np.abs(phi).max(axis=(1, 2)) < GROWTH))


__all__ = [
    "LateralProblem",
    "Rows",
    "f1_problem",
    "free_of",
    "instruments",
    "lowpass_problem",
    "ls_problem",
    "rate_of",
    "smooth_bend",
    "smoothed",
]
