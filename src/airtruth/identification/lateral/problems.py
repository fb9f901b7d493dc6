"""Regressions of the lateral-directional motion: least squares, and instrumental variables behind two filters.

Every equation of a record has the same regressors, so that Z and X have one row for each signal and serve all
coefficients. Instruments are the states of the linear model (`airtruth.physics.lateral`) at the last estimate, driven by
the measured surfaces.

Source of the instruments and filters: M. Brunot, "An Instrumental Variable Approach for Aircraft Identification", eqs (7),
(9) and (11). The dynamic filter has the third-order denominator of beta, p and r alone: the spiral root, a tenth of a
radian per second or less, would make it an integrator of the noise.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airtruth.identification.lateral.kernels import (
    grow_less,
    orthonormal,
    products,
    remove,
    swept,
    systems_of,
)
from airtruth.identification.lateral.observation import CONTROLS, LateralObservation
from airtruth.identification.lateral.responses import LANES, Driven, filter_rows, respond, response_sums
from airtruth.identification.options import Options
from airtruth.identification.regression.auxiliary import GROWTH
from airtruth.numerics.intersample import smooth_bend
from airtruth.numerics.prefilter import butterworth, zero_phase
from airtruth.physics.lateral import structure
from airtruth.physics.linear_model import places
from airtruth.physics.motion import LATERAL

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

_STATES: Final = [number for is_state, number in places(LATERAL) if is_state]
"""States among the signals, in the order of the signals."""
_COLUMNS: Final = np.array([n + (0 if is_state else len(LATERAL.states)) for is_state, n in places(LATERAL)])
"""Columns of [A, B] that belong to the signals."""
_MOMENTS: Final = slice(1, None)
"""Coefficients whose left side is a rate: the side force is measured itself."""
_INSIDE: Final = slice(2, -2)
"""Samples that have a fourth-order difference."""
_INDEPENDENT: Final = 1e-12
"""Square of a free column outside those before it, over its own, from which it counts as another [-]; judgement, four digits
above rounding."""


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


class SmoothRows(NamedTuple):
    """Low-passed signals of runs: rows of least squares, and surfaces (runs, controls, samples) from their first sample."""

    rows: Rows
    surfaces: Array


@dataclass(frozen=True)
class LateralProblem:
    """A regression whose instruments theta makes.

    Attributes
    ----------
    rows : (theta (active, 15), active) -> rows of the runs ``active``.
    moments : likewise -> (active, signals, signals + coefficients) sums Z X' and Z Y' of these rows.
    usable : likewise -> (active,) whether theta makes instruments.
    runs : number of runs.
    """

    rows: Callable[[Array, Ints], Rows]
    moments: Callable[[Array, Ints], Array]
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
    """Rows orthogonal to the free columns (runs, columns, samples); they are made so in place."""
    basis = np.empty(columns.shape)
    orthonormal(np.ascontiguousarray(columns), _INDEPENDENT, basis)
    for part in (x, y) if z is x else (x, y, z):
        remove(basis, part)
    return Rows(z, x, y, basis)


def with_corners(o: LateralObservation, more: Sequence[Array] = ()) -> Array:
    """Regressors whose surfaces have, sample by sample, the area that they have between the samples, and more rows.

    The corners of a servo behind a held command, sampled, change the moments of the surfaces by up to half a percent.
    """
    width = o.regressors.shape[1]
    made = np.concatenate([o.regressors, *more], axis=1)
    made[:, width - len(CONTROLS) : width, :-1] += 0.5 * (o.bend[..., :-1] + o.bend[..., 1:])
    return made


def low_passed(o: LateralObservation, options: Options) -> tuple[Array, Array]:
    """Low-passed regressors (runs, signals, samples), and left sides (runs, coefficients, samples - 4) of their `_INSIDE`."""
    width = o.regressors.shape[1]
    moments = o.slopes[:, _MOMENTS]
    sos = butterworth(options.cutoff_of(o.dt_s), options.order, o.dt_s)
    smooth = zero_phase(with_corners(o, [o.added, moments]), sos, in_place=True)
    left = width + o.added.shape[1]
    y = smooth[:, width:left, _INSIDE].copy()
    y[:, _MOMENTS] += rate_of(smooth[:, left:], o.dt_s)
    return smooth[:, :width], y


def smoothed(o: LateralObservation, options: Options) -> SmoothRows:
    """Rows of least squares: low-passed signals, and fourth-order differences of the left sides."""
    smooth, y = low_passed(o, options)
    surfaces = smooth[:, -len(CONTROLS) :]
    x = np.ascontiguousarray(smooth[..., _INSIDE])
    columns = o.nuisance()
    if columns.shape[1] > o.trend + 1:
        sos = butterworth(options.cutoff_of(o.dt_s), options.order, o.dt_s)
        columns[:, o.trend + 1 :] = zero_phase(columns[:, o.trend + 1 :], sos)
    return SmoothRows(free_of(x, x, y, columns[..., _INSIDE]), surfaces - surfaces[..., :1])


def moments_of(rows: Rows) -> Array:
    """Sums Z X' and Z Y' (runs, signals, signals + coefficients)."""
    sums = np.empty((*rows.z.shape[:2], rows.x.shape[1] + rows.y.shape[1]))
    products(rows.z, rows.x, rows.y, sums)
    return sums


def _all(theta: Array, active: Ints) -> Bools:
    return np.ones(active.size, dtype=np.bool_)


def picked(rows: Rows, active: Ints) -> Rows:
    """Rows of some runs."""
    if active.size == rows.x.shape[0]:
        return rows
    z = rows.z[active]
    return Rows(z, z if rows.z is rows.x else rows.x[active], rows.y[active], rows.free[active])


def ls_problem(o: LateralObservation, options: Options, smooth: SmoothRows) -> LateralProblem:
    """Least squares of low-passed rows: the regressors are their own instruments."""
    rows = smooth.rows
    return LateralProblem(
        lambda theta, active: picked(rows, active),
        lambda theta, active: moments_of(picked(rows, active)),
        _all,
        rows.x.shape[0],
    )


def lowpass_problem(o: LateralObservation, options: Options, smooth: SmoothRows) -> LateralProblem:
    """Instruments of the low-passed surfaces for the rows of least squares: IV(de_f) of the paper."""
    rows, u = smooth
    bend = smooth_bend(u)
    model = LinearModels.of(o)
    fixed = np.empty((len(u), len(LATERAL.signals), rows.x.shape[1] + rows.y.shape[1]))
    products(np.ascontiguousarray(u[..., _INSIDE]), rows.x, rows.y, fixed[:, len(_STATES) :])

    def at(theta: Array, active: Ints) -> Rows:
        own = picked(rows, active)
        z = np.ascontiguousarray(model.instruments(theta, active, u, bend)[..., _INSIDE])
        remove(own.free, z)
        return Rows(z, own.x, own.y, own.free)

    def moments(theta: Array, active: Ints) -> Array:
        # regressors and left sides are orthogonal to the constants, so that the instruments need not be
        sums: Array = fixed[active]
        response_sums(model.driven(theta, active, u, bend), rows.x, rows.y, sums)
        return sums

    return LateralProblem(at, moments, model.bounded, rows.x.shape[0])


def f1_problem(o: LateralObservation, options: Options, smooth: SmoothRows) -> LateralProblem:
    """Regressors, instruments and left sides behind F(p) = 1/Delta(p), Delta = |p I - A| of beta, p and r.

    Filters start from rest, and left sides count from the first sample, so that F p x = F x' holds exactly. Signals are
    linear between samples plus the area of the cubic through the four nearest; surfaces have the corners of their servo.
    The low-passed rows have no effect.
    """
    rates, constants = o.slopes[:, _MOMENTS], o.nuisance()
    rows = np.concatenate([rates, o.added, constants, o.regressors], axis=1)
    runs, instruments, samples = rows.shape
    u = np.ascontiguousarray(o.controls)
    bend = smooth_bend(u) + o.bend
    model = LinearModels.of(o)
    coefficients, count, first = o.added.shape[1], constants.shape[1], rates.shape[1]
    y = slice(first, first + coefficients)
    free, x = slice(y.stop, y.stop + count), slice(y.stop + count, instruments)
    states = range(instruments, instruments + len(_STATES))
    z = np.array([*states, *range(instruments - len(CONTROLS), instruments)])
    chosen = np.array([*z, *range(free.start, free.stop)])

    def filtered(theta: Array, active: Ints, kept: int) -> tuple[Array, Array]:
        out = np.empty((kept, -(-(instruments + len(_STATES)) // LANES), LANES, samples))
        sums = np.empty((active.size, chosen.size, instruments - first))
        filter_rows(model.driven(theta, active, u, bend), o.bend, rows, chosen, out, sums)
        return out.reshape(kept, -1, samples), sums

    def at(theta: Array, active: Ints) -> Rows:
        out, _ = filtered(theta, active, active.size)
        return free_of(np.take(out, z, axis=1), out[:, x].copy(), out[:, y].copy(), out[:, free])

    def moments(theta: Array, active: Ints) -> Array:
        _, sums = filtered(theta, active, 1)
        made = np.empty((active.size, z.size, z.size + coefficients))
        swept(sums, coefficients, count, _INDEPENDENT, made)
        return made

    return LateralProblem(at, moments, model.bounded, runs)


@dataclass(frozen=True)
class LinearModels:
    """The linear models of runs, each at its own flight condition.

    Attributes
    ----------
    kinematics : (runs, states, states + controls) the part of [A, B] that needs no aerodynamics.
    forces, rates : as in `airtruth.physics.lateral.Structure`.
    dt_s, samples : sample period [s] and length of the records.
    """

    kinematics: Array
    forces: Array
    rates: Array
    dt_s: float
    samples: int

    @classmethod
    def of(cls, o: LateralObservation) -> LinearModels:
        """Models of an observation."""
        own = structure(o.scale)
        known = np.concatenate([own.kinematics, np.zeros((*own.forces.shape[:2], len(CONTROLS)))], axis=2)
        return cls(known, own.forces, own.rates, o.dt_s, o.regressors.shape[2])

    def systems(self, theta: Array, active: Ints) -> Array:
        """[A, B] (active, states, states + controls) of theta (active, 15)."""
        made = np.empty((active.size, *self.kinematics.shape[1:]))
        systems_of(theta, active, self.kinematics, self.forces, self.rates, _COLUMNS, made)
        return made

    def driven(self, theta: Array, active: Ints, u: Array, bend: Array) -> Driven:
        """The models of theta (active, 15) driven by inputs (all runs, controls, samples)."""
        return Driven(self.systems(theta, active), active, u, bend, self.rates, self.dt_s)

    def instruments(self, theta: Array, active: Ints, u: Array, bend: Array) -> Array:
        """States of the models driven by surfaces (all runs, controls, samples), and the surfaces, as the regressors.

        Returns
        -------
        (active, signals, samples).
        """
        z = np.empty((active.size, len(LATERAL.signals), self.samples))
        respond(self.driven(theta, active, u, bend), z)
        z[:, len(_STATES) :] = u[active]
        return z

    def bounded(self, theta: Array, active: Ints) -> Bools:
        """(active,) whether the motion grows by less than `GROWTH` over the record, by the fastest root."""
        a = self.systems(theta, active)[..., : -len(CONTROLS)]
        less = np.empty(active.size, dtype=np.bool_)
        grow_less(a, np.log(GROWTH) / (self.dt_s * self.samples), less)
        return less


__all__ = [
    "LateralProblem",
    "LinearModels",
    "Rows",
    "SmoothRows",
    "f1_problem",
    "free_of",
    "lowpass_problem",
    "ls_problem",
    "moments_of",
    "rate_of",
    "smoothed",
]
