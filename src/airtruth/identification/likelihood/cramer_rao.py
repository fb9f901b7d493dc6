"""The Cramer-Rao bound of an experiment: the least covariance of an unbiased estimator of the derivatives.

It follows from the Fisher information of the innovations of the exact, time-varying Kalman predictor, which
starts from a stated covariance. With e white of covariance S at the truth (Maine and Iliff, NASA RP-1138, 1985),

    F_ij = sum_k E[e_i' S^-1 e_j] + 1/2 tr(S^-1 S_i S^-1 S_j),

with indices for derivatives. E[.] has a part from the mean motion and one from the innovations, which drive the
differentiated filter: their joint covariance is propagated. Nothing is simulated or drawn.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_lyapunov

from airtruth.errors import ConfigurationError, choices
from airtruth.identification.condition import AircraftConstants
from airtruth.identification.likelihood.fit import records
from airtruth.identification.likelihood.kalman_kernel import KalmanSignals
from airtruth.identification.likelihood.linearise import Matrices, matrices, slopes
from airtruth.identification.likelihood.options import FilterOptions, declared_values, free_parameters
from airtruth.identification.likelihood.predictor import LevelLayout
from airtruth.logs.flight_log import Batch
from airtruth.physics.dryden import STARTS

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


class _Update(NamedTuple):
    """Measurement update at one sample: covariance of the innovations, its inverse, phi K, and their derivatives.

    ``d_...`` are derivatives, (free, ...).
    """

    covariance: Array
    inverse: Array
    gain: Array
    gain_p: Array
    d_covariance: Array
    d_gain: Array
    d_gain_p: Array


@dataclass
class _Moments:
    """Quantities that are propagated from sample to sample.

    Attributes
    ----------
    mean, d_mean : state of the mean motion and its derivatives.
    unknowns : its derivatives by the free initial states and the output biases.
    p, d_p : prediction covariance and its derivatives.
    spread : covariance of the state of the filter and of its derivatives, driven by the innovations.
    """

    mean: Array
    d_mean: Array
    unknowns: Array
    p: Array
    d_p: Array
    spread: Array


def bound(
    layout: LevelLayout,
    run: int,
    z: Array,
    free: Ints,
    signals: KalmanSignals,
    dt_s: float,
    start: Array,
    unknown: Ints,
) -> Array:
    """Smallest covariance of an unbiased estimate of the free parameters from one record.

    The output biases are unknown. ``unknown`` initial states are zero, which the estimator does not know.

    Parameters
    ----------
    layout, run : predictor and which of its runs.
    z : (parameters,) truth, logarithms where the layout has them.
    free : indices of the parameters that are unknown.
    signals : of all runs; the outputs are not read.
    dt_s : sample period [s].
    start : (states, states) covariance of the initial state.
    unknown : indices of states whose initial value is a free parameter; of no variance in ``start``.

    Returns
    -------
    (free, free).
    """
    at, u, bend = np.array([run]), signals.u[run], signals.bend[run]
    value = Matrices(*(part[0] for part in matrices(layout, at, z[None], dt_s)))
    slope = Matrices(*(part[0] for part in slopes(layout, at, z[None], free, dt_s)))
    m, n = value.c.shape
    count, others = free.size, unknown.size + m
    by_bias = np.hstack([np.zeros((m, unknown.size)), np.eye(m)])
    state = _Moments(
        mean=np.zeros(n),
        d_mean=np.zeros((count, n)),
        unknowns=np.hstack([np.eye(n)[:, unknown], np.zeros((n, m))]),
        p=start.copy(),
        d_p=np.zeros((count, n, n)),
        spread=np.zeros((n * (1 + count), n * (1 + count))),
    )
    information, across, normal = (
        np.zeros((count, count)),
        np.zeros((count, others)),
        np.zeros((others, others)),
    )
    for k in range(u.shape[0]):
        update = _updated(value, slope, state)
        de = -(state.d_mean @ value.c.T) - slope.c @ state.mean - slope.d @ u[k]
        columns = -value.c @ state.unknowns - by_bias
        information += de @ update.inverse @ de.T
        across += de @ update.inverse @ columns
        normal += columns.T @ update.inverse @ columns
        information += _by_innovations(value, slope, update, state.spread)
        if k + 1 < u.shape[0]:
            _advance_mean(
                value, slope, state, update, de, columns, u[k] + bend[k + 1], u[k + 1] + bend[k + 1]
            )
            _advance_spread(value, slope, state, update)
            _advance_covariance(value, slope, state, update)
    whole = information - across @ np.linalg.solve(normal, across.T)
    return np.asarray(np.linalg.inv(whole), dtype=np.float64)


def _updated(value: Matrices, slope: Matrices, state: _Moments) -> _Update:
    c, p = value.c, state.p
    covariance = c @ p @ c.T + np.diag(value.variance)
    inverse: Array = np.asarray(np.linalg.inv(covariance), dtype=np.float64)
    gain = p @ c.T @ inverse
    half = slope.c @ p @ c.T
    d_covariance = half + np.swapaxes(half, 1, 2) + c @ state.d_p @ c.T
    outputs = np.arange(len(c))
    d_covariance[:, outputs, outputs] += slope.variance
    d_gain = (state.d_p @ c.T + p @ np.swapaxes(slope.c, 1, 2) - gain @ d_covariance) @ inverse
    gain_p, d_gain_p = value.phi @ gain, slope.phi @ gain + value.phi @ d_gain
    return _Update(covariance, inverse, gain, gain_p, d_covariance, d_gain, d_gain_p)


def _by_innovations(value: Matrices, slope: Matrices, update: _Update, spread: Array) -> Array:
    """Information (free, free) of the innovations at one sample."""
    count, m, n = slope.c.shape

    def innovations(columns: Array) -> Array:
        """Derivatives of the innovations (free m, ...) of columns of states of the filter and of its derivatives."""
        blocks = columns.reshape(1 + count, n, -1)
        return np.asarray(-(slope.c @ blocks[0] + value.c @ blocks[1:]).reshape(count * m, -1))

    moments = innovations(innovations(spread).T).reshape(count, m, count, m)
    whitened = update.inverse @ update.d_covariance
    own: Array = np.einsum("iajb,ab->ij", moments, update.inverse)
    of_variance: Array = 0.5 * np.einsum("iab,jba->ij", whitened, whitened)
    return own + of_variance


def _advance_mean(
    value: Matrices,
    slope: Matrices,
    state: _Moments,
    update: _Update,
    de: Array,
    columns: Array,
    u: Array,
    later: Array,
) -> None:
    """Propagate the mean motion and its derivatives; u, later : the ends of the input over the step."""
    state.d_mean = state.d_mean @ value.phi.T + de @ update.gain_p.T + slope.phi @ state.mean
    state.d_mean += slope.early @ u + slope.late @ later
    state.mean = value.phi @ state.mean + value.early @ u + value.late @ later
    state.unknowns = value.phi @ state.unknowns + update.gain_p @ columns


def _advance_spread(value: Matrices, slope: Matrices, state: _Moments, update: _Update) -> None:
    """Propagate the covariance of the filter's state and of its derivatives, block by block.

    x+ = phi x + phi K e, and of a derivative x_i+ = (phi - phi K c) x_i + (phi_i - phi K c_i) x + (phi K)_i e.
    """
    count, _, n = slope.c.shape
    closed, across = value.phi - update.gain_p @ value.c, slope.phi - update.gain_p @ slope.c

    def advanced(columns: Array) -> Array:
        blocks = columns.reshape(1 + count, n, -1)
        result = closed @ blocks
        result[0] = value.phi @ blocks[0]
        result[1:] += across @ blocks[0]
        return np.asarray(result.reshape(columns.shape))

    drive = np.concatenate([update.gain_p[None], update.d_gain_p]).reshape(n * (1 + count), -1)
    state.spread = advanced(advanced(state.spread).T) + drive @ update.covariance @ drive.T


def _advance_covariance(value: Matrices, slope: Matrices, state: _Moments, update: _Update) -> None:
    """Propagate the prediction covariance and its derivatives."""
    phi, c, p = value.phi, value.c, state.p
    filtered = p - update.gain @ c @ p
    inner = state.d_p - update.d_gain @ c @ p - update.gain @ (slope.c @ p + c @ state.d_p)
    half = slope.phi @ filtered @ phi.T
    state.d_p = phi @ inner @ phi.T + half + np.swapaxes(half, 1, 2) + slope.noise
    state.p = phi @ filtered @ phi.T + value.noise


def experiment_bound(
    batch: Batch, constants: AircraftConstants, theta: Array, options: FilterOptions, start: str = "rest"
) -> Array:
    """Smallest covariance of unbiased derivatives from each run, by its elevator alone.

    The elevator, its sample times and the flight condition come from the log. The levels are those of the
    options, unknown unless ``level_prior`` is None; the prior itself is not counted as information.

    Parameters
    ----------
    batch, constants, options : as in `airtruth.identification.likelihood.fit.fit`.
    theta : (6,) true derivatives [-].
    start : "rest", the gusts build up from zero, aircraft at rest in an unknown state; "stationary",
        aircraft and gusts have been in statistical equilibrium, which the estimator knows.

    Returns
    -------
    (runs, 6, 6).

    Raises
    ------
    ConfigurationError
        If ``start`` is not known.
    """
    if start not in STARTS:
        raise ConfigurationError(f"gust start {start!r} is not known; {choices(start, STARTS)}")
    data = records(batch, constants, options)
    z = declared_values(options, options.levels[None, :])[0]
    z[: theta.size] = theta
    free = free_parameters(options)
    n = data.layout.sizes[0]
    runs = data.signals.u.shape[0]
    result = np.empty((runs, theta.size, theta.size))
    for run in range(runs):
        begin, unknown = np.zeros((n, n)), np.arange(2)
        if start == "stationary":
            value = matrices(data.layout, np.array([run]), z[None], data.dt_s)
            begin = solve_discrete_lyapunov(value.phi[0], value.noise[0])
            unknown = np.arange(0)
        whole = bound(data.layout, run, z, free, data.signals, data.dt_s, begin, unknown)
        result[run] = whole[: theta.size, : theta.size]
    return result
