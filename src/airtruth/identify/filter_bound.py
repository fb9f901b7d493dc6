"""The Cramer-Rao bound of an experiment: what no unbiased estimator of the derivatives can beat.

From the Fisher information of the innovations of the exact, time-varying Kalman predictor, which starts
from a stated covariance. With e white of covariance S at the truth (Maine and Iliff, NASA RP-1138, 1985),

    F_ij = sum_k E[e_i' S^-1 e_j] + 1/2 tr(S^-1 S_i S^-1 S_j),

indices for derivatives. E[.] has a part from the mean motion and one from the innovations, which drive the
differentiated filter: their joint covariance is propagated. Nothing is simulated or drawn.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_lyapunov

from airtruth.errors import ConfigurationError, choices
from airtruth.identify.condition import AircraftConstants
from airtruth.identify.filter_error import records
from airtruth.identify.filter_options import FilterOptions, declared_values, free_parameters
from airtruth.identify.kalman_step import TINY, assemble, step
from airtruth.identify.predictor import Layout
from airtruth.logs.flight_log import Batch
from airtruth.physics.dryden import STARTS

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Slopes:
    """Matrices of one step and, their derivatives.

    Attributes
    ----------
    value : phi, early, late, noise of `airtruth.identify.kalman.step`; c, d, variance (R) of the outputs.
    slope : the same names, derivatives (free, ...).
    """

    value: dict[str, Array]
    slope: dict[str, Array]


def linearise(layout: Layout, run: int, z: Array, free: NDArray[np.int64], dt_s: float) -> Slopes:
    """Step and output matrices at z, and their derivatives by complex step.

    Parameters
    ----------
    layout, run : predictor and which of its runs.
    z : (parameters,), logarithms where the layout says so; free : indices to differentiate for.
    dt_s : sample period [s].
    """
    n, inputs, m, _ = layout.sizes
    slopes: list[dict[str, Array]] = []
    value: dict[str, Array] = {}
    for index in free:
        values = np.where(layout.logarithmic == 1, np.exp(z), z).astype(np.complex128)
        values[index] += 1j * TINY * (values[index].real if layout.logarithmic[index] else 1.0)
        system = np.empty((n + m, n + inputs), dtype=np.complex128)
        process, variance = np.empty(n, dtype=np.complex128), np.empty(m, dtype=np.complex128)
        phi, noise = np.empty((n, n), dtype=np.complex128), np.empty((n, n), dtype=np.complex128)
        early, late = np.empty((n, inputs), dtype=np.complex128), np.empty((n, inputs), dtype=np.complex128)
        assemble(values, layout.place, layout.coefficient[run], system, process, variance)
        step(system, process, n, dt_s, phi, early, late, noise)
        parts = {"phi": phi, "early": early, "late": late, "noise": noise}
        parts |= {"c": system[n:, :n], "d": system[n:, n:], "variance": np.diag(variance)}
        slopes.append({name: part.imag / TINY for name, part in parts.items()})
        value = {name: part.real.copy() for name, part in parts.items()}
    return Slopes(value, {name: np.stack([s[name] for s in slopes]) for name in value})


def bound(
    layout: Layout,
    run: int,
    z: Array,
    free: NDArray[np.int64],
    u: Array,
    bend: Array,
    dt_s: float,
    start: Array,
    unknown: NDArray[np.int64],
) -> Array:
    """Smallest covariance of an unbiased estimate of the free parameters from one record.

    The output biases are unknown. ``unknown`` initial states are at rest, but the estimator does not know.

    Parameters
    ----------
    layout, run : predictor and which of its runs.
    z : (parameters,) truth, logarithms where the layout says so.
    free : indices of the parameters that are unknown.
    u, bend : (samples, inputs) input, and its mean over the cell that ends at a sample less the mean of
        its two samples.
    dt_s : sample period [s].
    start : (states, states) covariance of the initial state.
    unknown : indices of states whose initial value is a free parameter; of no variance in ``start``.

    Returns
    -------
    (free, free).
    """
    n, _, m, _ = layout.sizes
    s = linearise(layout, run, z, free, dt_s)
    phi, c, variance, noise = (s.value[name] for name in ("phi", "c", "variance", "noise"))
    count = free.size
    mean, d_mean = np.zeros(n), np.zeros((count, n))
    begun = np.hstack([np.eye(n)[:, unknown], np.zeros((n, m))])  # by free starts, by output biases
    shown = np.hstack([np.zeros((m, unknown.size)), np.eye(m)])
    p: Array = start.copy()
    d_p = np.zeros((count, n, n))
    spread = np.zeros((n * (1 + count), n * (1 + count)))
    information = np.zeros((count, count))
    across = np.zeros((count, unknown.size + m))
    normal = np.zeros((unknown.size + m, unknown.size + m))
    for k in range(u.shape[0]):
        covariance = c @ p @ c.T + variance
        inverse = np.linalg.inv(covariance)
        gain = p @ c.T @ inverse
        half = s.slope["c"] @ p @ c.T
        d_covariance = half + np.swapaxes(half, 1, 2) + c @ d_p @ c.T + s.slope["variance"]
        d_gain = (d_p @ c.T + p @ np.swapaxes(s.slope["c"], 1, 2) - gain @ d_covariance) @ inverse
        gain_p = phi @ gain
        d_gain_p = s.slope["phi"] @ gain + phi @ d_gain
        # of the mean
        de = -(d_mean @ c.T) - s.slope["c"] @ mean - s.slope["d"] @ u[k]
        columns = -c @ begun - shown
        information += de @ inverse @ de.T
        across += de @ inverse @ columns
        normal += columns.T @ inverse @ columns
        # of the innovations: de = rows [x; dx]
        rows = np.zeros((count, m, n * (1 + count)))
        rows[:, :, :n] = -s.slope["c"]
        for i in range(count):
            rows[i, :, n * (1 + i) : n * (2 + i)] = -c
        flat = rows.reshape(count * m, -1)
        moments = (flat @ spread @ flat.T).reshape(count, m, count, m)
        information += np.einsum("iajb,ab->ij", moments, inverse)
        whitened = inverse @ d_covariance
        information += 0.5 * np.einsum("iab,jba->ij", whitened, whitened)
        if k + 1 == u.shape[0]:
            break
        first, second = u[k] + bend[k + 1], u[k + 1] + bend[k + 1]
        d_mean = d_mean @ phi.T + de @ gain_p.T + s.slope["phi"] @ mean
        d_mean += s.slope["early"] @ first + s.slope["late"] @ second
        mean = phi @ mean + s.value["early"] @ first + s.value["late"] @ second
        begun = phi @ begun + gain_p @ columns
        advance = np.zeros_like(spread)
        drive = np.zeros((spread.shape[0], m))
        advance[:n, :n], drive[:n] = phi, gain_p
        for i in range(count):
            at = slice(n * (1 + i), n * (2 + i))
            advance[at, :n] = s.slope["phi"][i] + gain_p @ rows[i, :, :n]
            advance[at, at] = phi - gain_p @ c
            drive[at] = d_gain_p[i]
        spread = advance @ spread @ advance.T + drive @ covariance @ drive.T
        filtered = p - gain @ c @ p
        inner = d_p - d_gain @ c @ p - gain @ (s.slope["c"] @ p + c @ d_p)
        half = s.slope["phi"] @ filtered @ phi.T
        d_p = phi @ inner @ phi.T + half + np.swapaxes(half, 1, 2) + s.slope["noise"]
        p = phi @ filtered @ phi.T + noise
    return np.asarray(
        np.linalg.inv(information - across @ np.linalg.solve(normal, across.T)), dtype=np.float64
    )


def experiment_bound(
    batch: Batch, constants: AircraftConstants, theta: Array, options: FilterOptions, start: str = "rest"
) -> Array:
    """Smallest covariance of unbiased derivatives from each run, by its elevator alone.

    Of the log it reads the elevator, its sample times and the flight condition. The levels are those of
    the options, unknown unless ``level_prior`` is None; the prior itself is not counted as information.

    Parameters
    ----------
    batch, constants, options : as in `airtruth.identify.filter_error.fit`.
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
    result = np.empty((data.y.shape[0], 6, 6))
    for run in range(data.y.shape[0]):
        begin, unknown = np.zeros((n, n)), np.arange(2)
        if start == "stationary":
            value = linearise(data.layout, run, z, free, data.dt_s).value
            begin = solve_discrete_lyapunov(value["phi"], value["noise"])
            unknown = np.arange(0)
        whole = bound(data.layout, run, z, free, data.u[run], data.bend[run], data.dt_s, begin, unknown)
        result[run] = whole[:6, :6]
    return result
