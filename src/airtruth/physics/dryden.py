"""Dryden gusts along the flight path: spectra, covariances, and an exact simulation at any time step.

Forms of MIL-F-8785C, 3.7.1.2 (as written out in the GTM simulator, NASA GTM_DesignSim), V the airspeed:

- H_u(s) = sigma_u sqrt(2 V/(pi Lu)) / (s + V/Lu)
- H_w(s) = sigma_w sqrt(3 V/(pi Lw)) (s + V/(sqrt(3) Lw)) / (s + V/Lw)^2
- H_q(s) = (s/V) / (1 + 4 b s/(pi V)) H_w(s), b the span

driven by white noise of intensity pi, so that the one-sided spectra integrate to sigma^2 over omega.
u is positive forward, w positive down; q is the rate dw/dx that the aircraft meets, smoothed over the
span. Aircraft relative to the air: u - u_gust, w - w_gust, and a pitch rate q + q_gust, since air
that turns nose-up has dw/dx < 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from airtruth.errors import ConfigurationError, choices
from airtruth.physics.gust_figures import FIGURES, LEVELS, GustScales, gust_scales

Array = NDArray[np.float64]

STARTS: Final = ("stationary", "rest")
"""Initial states of a gust: a draw from its stationary distribution, or zero."""
_LONG_STEP: Final = 0.1
"""Step over the longest time constant from which the noise is a difference of covariances [-]; there the difference has
lost at most four digits, and a cascade of rates 1 to 10,000 has been doubled up to 14 times."""
_ZERO: Final = 1.0 / math.sqrt(3.0)
"""Zero of H_w in units of V/Lw [-]."""


@dataclass(frozen=True)
class Dryden:
    """Gusts of one flight condition, or of several: scalars, or arrays that broadcast to one shape (...).

    Attributes
    ----------
    sigma_u_m_s, sigma_w_m_s : standard deviations [m/s].
    length_u_m, length_w_m : scale lengths Lu, Lw [m].
    airspeed_m_s : true airspeed V [m/s].
    span_m : span b [m]; None for no rotary gust.
    """

    sigma_u_m_s: Array | float
    sigma_w_m_s: Array | float
    length_u_m: Array | float
    length_w_m: Array | float
    airspeed_m_s: Array | float
    span_m: float | None = None


@dataclass(frozen=True)
class DiscreteGust:
    """x[i+1] = phi x[i] + gamma n[i], y[i] = output x[i], with n standard normal; exact at the samples.

    The k = 3 states (4 with the rotary gust) have unit variance: one for u, the others for w and q.

    Attributes
    ----------
    phi : (..., k, k) transition matrix, lower triangular.
    gamma : (..., k, k) lower Cholesky factor of the covariance of the process noise over a step.
    output : (..., m, k) from states to u [m/s], w [m/s] and, with a span, q [rad/s].
    start : (..., k, k) lower Cholesky factor of the stationary covariance of the states.
    """

    phi: Array
    gamma: Array
    output: Array
    start: Array


def discretise(d: Dryden, dt_s: float) -> DiscreteGust:
    """Exact discrete model of the gusts at a time step [s].

    The states of w and q are a cascade of first-order lags, x1' = -r1 x1 + noise, xi' = -ri xi + x(i-1),
    with rates (V/Lw, V/Lw), preceded by pi V/(4 b) with the rotary gust. In this order w and
    q are sums without cancellation. The noise of a step comes from Van Loan (IEEE Trans. Automatic
    Control 23, 1978, eqs (2.1) and following) over a step short enough to be exact, then by doubling. For a step longer than
    `_LONG_STEP`, in which doubling adds up rounding, it is the stationary covariance less what is left of it.
    """
    u_rate, rates, output = _shaping(d)
    stationary = _cascade_covariance(rates)
    deviation = np.sqrt(np.diagonal(stationary, axis1=-2, axis2=-1))
    correlation = stationary / (deviation[..., :, None] * deviation[..., None, :])
    phi_w, noise_w = _cascade_step(rates, deviation, dt_s)
    long = (dt_s * rates.min(axis=-1) > _LONG_STEP)[..., None, None]
    noise_w = np.where(long, correlation - phi_w @ correlation @ np.swapaxes(phi_w, -1, -2), noise_w)
    n = rates.shape[-1]
    shape = rates.shape[:-1]
    phi, gamma, start = (np.zeros((*shape, n + 1, n + 1)) for _ in range(3))
    phi[..., 0, 0] = np.exp(-u_rate * dt_s)
    gamma[..., 0, 0] = np.sqrt(-np.expm1(-2.0 * u_rate * dt_s))
    start[..., 0, 0] = 1.0
    phi[..., 1:, 1:] = phi_w
    gamma[..., 1:, 1:] = np.linalg.cholesky(noise_w)
    start[..., 1:, 1:] = np.linalg.cholesky(correlation)
    rows = np.zeros((*shape, output.shape[-2] + 1, n + 1))
    rows[..., 0, 0] = d.sigma_u_m_s
    rows[..., 1:, 1:] = output * deviation[..., None, :]
    return DiscreteGust(phi=phi, gamma=gamma, output=rows, start=start)


def simulate(discrete: DiscreteGust, normals: Array, start: str = "stationary") -> Array:
    """Gust histories from standard normals.

    Parameters
    ----------
    discrete : model of one condition, or with a leading axis (runs,).
    normals : (runs, samples, k) independent standard normals, k = ``discrete.phi.shape[-1]``; those of
        the first sample set the initial state, those of sample i > 0 drive the step that ends there.
    start : "stationary", the first sample has the gust's own distribution, or "rest", it is zero (the
        first normals are then unused) and the variance builds up within a few L/V.

    Returns
    -------
    (runs, samples, m) u [m/s], w [m/s] and, with a span, q [rad/s].

    Raises
    ------
    ConfigurationError
        If ``start`` is not known.
    """
    if start not in STARTS:
        raise ConfigurationError(f"gust start {start!r} is not known; {choices(start, STARTS)}")
    runs, samples, k = normals.shape
    first = discrete.start if start == "stationary" else np.zeros_like(discrete.start)
    m = discrete.output.shape[-2]
    result = np.empty((runs, samples, m))
    _recursion(
        np.broadcast_to(discrete.phi, (runs, k, k)),
        np.broadcast_to(discrete.gamma, (runs, k, k)),
        np.broadcast_to(discrete.output, (runs, m, k)),
        np.broadcast_to(first, (runs, k, k)),
        np.ascontiguousarray(normals, dtype=np.float64),
        result,
    )
    return result


def covariance(d: Dryden, lag_s: ArrayLike) -> Array:
    """Analytic covariances E[y_i(t + lag) y_j(t)] of one flight condition.

    R_u = sigma_u^2 exp(-|lag| V/Lu) and R_w = sigma_w^2 (1 - |lag| V/(2 Lw)) exp(-|lag| V/Lw), the
    Fourier transforms of the spectra; those with q by the matrix exponential of the cascade.

    Parameters
    ----------
    d : scalars only.
    lag_s : (...) lags of either sign [s].

    Returns
    -------
    (..., m, m) for u, w and, with a span, q.
    """
    lag = np.asarray(lag_s, dtype=np.float64)
    size = np.abs(lag)
    u_rate, rates, output = _shaping(d)
    m = output.shape[-2] + 1
    result = np.zeros((*lag.shape, m, m))
    x = size * rates[-1]
    result[..., 0, 0] = np.square(d.sigma_u_m_s) * np.exp(-size * u_rate)
    result[..., 1, 1] = np.square(d.sigma_w_m_s) * (1.0 - 0.5 * x) * np.exp(-x)
    if d.span_m is not None:
        stationary = _cascade_covariance(rates)
        deviation = np.sqrt(np.diagonal(stationary))
        system = _cascade_matrix(rates) * deviation / deviation[:, None]
        correlation = stationary / np.outer(deviation, deviation)
        rows = output * deviation
        both = rows @ _exponential(system * size[..., None, None]) @ correlation @ rows.T
        both = np.where(lag[..., None, None] < 0.0, np.swapaxes(both, -1, -2), both)
        result[..., 2, 2] = both[..., 1, 1]
        result[..., 1, 2] = both[..., 0, 1]
        result[..., 2, 1] = both[..., 1, 0]
    return result


def spectrum(d: Dryden, omega_rad_s: ArrayLike) -> Array:
    """One-sided spectra over angular frequency; each integrates from 0 to infinity to the variance.

    Phi_u = sigma_u^2 (2 Lu/(pi V)) / (1 + (Lu omega/V)^2), Phi_w = sigma_w^2 (Lw/(pi V))
    (1 + 3 (Lw omega/V)^2) / (1 + (Lw omega/V)^2)^2, Phi_q = (omega/V)^2 / (1 + (4 b omega/(pi V))^2) Phi_w
    (MIL-F-8785C, 3.7.1.2).

    Parameters
    ----------
    d : scalars only.
    omega_rad_s : (...) angular frequency [rad/s].

    Returns
    -------
    (..., m) for u [m2/s2 per rad/s], w and, with a span, q [rad2/s2 per rad/s].
    """
    omega = np.asarray(omega_rad_s, dtype=np.float64)
    v = d.airspeed_m_s
    xu, xw = np.square(omega * d.length_u_m / v), np.square(omega * d.length_w_m / v)
    phi_u = np.square(d.sigma_u_m_s) * 2.0 * d.length_u_m / (np.pi * v) / (1.0 + xu)
    phi_w = np.square(d.sigma_w_m_s) * d.length_w_m / (np.pi * v) * (1.0 + 3.0 * xw) / np.square(1.0 + xw)
    parts = [phi_u, phi_w]
    if d.span_m is not None:
        parts.append(np.square(omega / v) / (1.0 + np.square(4.0 * d.span_m * omega / (np.pi * v))) * phi_w)
    return np.stack(parts, axis=-1)


def _shaping(d: Dryden) -> tuple[Array, Array, Array]:
    """Rate of u (...), rates of the cascade (..., n), and its output rows (..., m - 1, n) for w and q."""
    values = (d.sigma_u_m_s, d.sigma_w_m_s, d.length_u_m, d.length_w_m, d.airspeed_m_s)
    _, sigma, length_u, length, v = np.broadcast_arrays(*(np.asarray(x, dtype=np.float64) for x in values))
    a = v / length
    gain = sigma * np.sqrt(3.0 * a)
    if d.span_m is None:
        return (
            v / length_u,
            np.stack([a, a], axis=-1),
            np.stack([gain, gain * a * (_ZERO - 1.0)], axis=-1)[..., None, :],
        )
    p = np.pi * v / (4.0 * d.span_m)
    one = np.ones_like(a)
    w = [
        one,
        p + a * (_ZERO - 2.0),
        a * (a - p) * (1.0 - _ZERO),
    ]  # (s + a/sqrt 3)(s + p) over (s + p)(s + a)^2
    q = [one, a * (_ZERO - 2.0), np.square(a) * (1.0 - _ZERO)]  # s (s + a/sqrt 3)
    rows = np.stack(
        [np.stack(w, axis=-1) * gain[..., None], np.stack(q, axis=-1) * (gain * p / v)[..., None]], axis=-2
    )
    return v / length_u, np.stack([p, a, a], axis=-1), rows


def _cascade_matrix(rates: Array) -> Array:
    n = rates.shape[-1]
    return np.eye(n, k=-1) - np.eye(n) * rates[..., None, :]


def _cascade_covariance(rates: Array) -> Array:
    """Stationary covariance under unit white noise: (ri + rj) Pij = P(i-1)j + Pi(j-1), 1 for i = j = 0."""
    n = rates.shape[-1]
    p = np.zeros((*rates.shape[:-1], n, n))
    for i in range(n):
        for j in range(i + 1):
            source = p[..., i - 1, j] if i else np.ones(rates.shape[:-1])
            if i and j:
                source = source + p[..., i, j - 1]
            p[..., i, j] = p[..., j, i] = source / (rates[..., i] + rates[..., j])
    return p


def _cascade_step(rates: Array, deviation: Array, dt_s: float) -> tuple[Array, Array]:
    """Transition and noise covariance over a step, in states of unit stationary variance."""
    n = rates.shape[-1]
    doublings = np.maximum(np.ceil(np.log2(2.0 * dt_s * rates.max(axis=-1))), 0.0)
    h = dt_s * np.exp2(-doublings)[..., None]
    # in units of h the couplings are 1 and the noise covariance is well conditioned however small h is
    scale = deviation / h ** (np.arange(n) + 0.5)
    system = _cascade_matrix(rates * h)
    block = np.zeros((*rates.shape[:-1], 2 * n, 2 * n))
    block[..., :n, :n] = -system
    block[..., 0, n] = 1.0
    block[..., n:, n:] = np.swapaxes(system, -1, -2)
    block = _exponential(block)
    phi = np.swapaxes(block[..., n:, n:], -1, -2)
    noise = phi @ block[..., :n, n:]
    for done in range(int(doublings.max())):
        active = (done < doublings)[..., None, None]
        noise = np.where(active, noise + phi @ noise @ np.swapaxes(phi, -1, -2), noise)
        phi = np.where(active, phi @ phi, phi)
    columns, rows = scale[..., None, :], scale[..., :, None]
    return phi * columns / rows, noise / (columns * rows)


def _exponential(matrix: Array) -> Array:
    """Matrix exponential (..., n, n) by a Taylor series of the scaled matrix and squaring.

    scipy.linalg.expm (1.17) is wrong in the fourth digit for triangular matrices whose diagonal holds
    values that differ by rounding only, as the double pole V/Lw does.
    """
    norm = np.abs(matrix).sum(axis=-1).max(axis=-1)
    squarings = np.maximum(np.frexp(norm)[1] + 1, 0)  # norm/2^squarings is at most 1/2
    scaled = matrix * np.exp2(-squarings)[..., None, None]
    term = np.broadcast_to(np.eye(matrix.shape[-1]), matrix.shape)
    result = term.copy()
    for order in range(1, 17):  # the next term is below 0.5^17/17! = 2e-20
        term = term @ scaled / order
        result += term
    for done in range(int(squarings.max())):
        result = np.where((done < squarings)[..., None, None], result @ result, result)
    return result


@njit(cache=True)
def _recursion(phi: Array, gamma: Array, output: Array, start: Array, normals: Array, result: Array) -> None:
    runs, samples, k = normals.shape
    m = output.shape[1]
    x = np.empty(k)
    for r in range(runs):
        f, g, c = phi[r].copy(), gamma[r].copy(), output[r].copy()
        for i in range(k):
            total = 0.0
            for j in range(i + 1):
                total += start[r, i, j] * normals[r, 0, j]
            x[i] = total
        for t in range(samples):
            if t > 0:
                for i in range(k - 1, -1, -1):  # lower triangular: the last row first, in place
                    total = 0.0
                    for j in range(i + 1):
                        total += f[i, j] * x[j] + g[i, j] * normals[r, t, j]
                    x[i] = total
            for i in range(m):
                total = 0.0
                for j in range(k):
                    total += c[i, j] * x[j]
                result[r, t, i] = total


__all__ = [
    "FIGURES",
    "LEVELS",
    "STARTS",
    "DiscreteGust",
    "Dryden",
    "GustScales",
    "covariance",
    "discretise",
    "gust_scales",
    "simulate",
    "spectrum",
]
