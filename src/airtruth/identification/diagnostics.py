"""Diagnostics of an estimate: excitation, strength of the instruments, residuals.

Sources: J. G. Cragg and S. G. Donald, "Testing Identifiability and Specification in Instrumental Variable
Models", Econometric Theory 9, 1993; F. Kleibergen and R. Paap, "Generalized Reduced Rank Tests Using the
Singular Value Decomposition", Journal of Econometrics 133, 2006; J. H. Stock and M. Yogo, "Testing for
Weak Instruments in Linear IV Regression", 2005; G. M. Ljung and G. E. P. Box, "On a Measure of Lack of
Fit in Time Series Models", Biometrika 65, 1978.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft
from scipy.special import chdtrc

from airtruth.identification.condition import AircraftConstants, observe
from airtruth.identification.estimates import Estimates
from airtruth.identification.methods import method, regression
from airtruth.identification.options import Options
from airtruth.identification.regression.covariance import correction
from airtruth.identification.regression.rows import LIFT, MOMENT, NORMAL, Projected, project
from airtruth.identification.regression.solve import chunks
from airtruth.identification.signals import ELEVATOR
from airtruth.logs.flight_log import Batch

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

EQUATIONS: Final = len((LIFT, MOMENT, NORMAL))
"""Number of the equations."""
WEAK: Final = 7.03
"""Stock and Yogo's critical value for two endogenous regressors and two instruments [-]: below it a nominal
5 % test may reject in 10 % of the cases (their table 5.2)."""

_WHITENESS_LAGS: Final = 20
"""Lags of the Ljung-Box test [samples]; judgement."""
_CROSS_LAG_S: Final = 1.0
"""Largest lag of the cross-correlation [s]; judgement, a short-period oscillation."""
_INSIDE: Final = 1.96
"""Half-width of a 95 % interval of the normal distribution, in standard deviations [-]."""


@dataclass(frozen=True)
class Diagnostics:
    """Per run; NaN where there is no estimate. Equations in the order lift, moment, normal.

    Attributes
    ----------
    run_ids : names of the runs.
    elevator_rms_rad : (runs,) root mean square of the elevator about its mean [rad].
    condition : (runs,) condition number of the regressors alpha, q, elevator, each of unit length.
    cragg_donald : (runs,) joint strength of the instruments if the noise were white; NaN for ls.
    kleibergen_paap : (runs,) the same for the actual, coloured noise; below `WEAK`, intervals and means
        are unreliable. NaN for ls.
    equivalent_samples : (runs, 3) number of independent samples equivalent to the coloured residuals.
    ljung_box_p : (runs, 3) probability of residuals as coloured as these if they were white; filtered
        residuals are always coloured, so that a covariance for white residuals is wrong.
    cross_lag_s : (lags,) lag of the elevator behind the residual [s].
    cross : (runs, 3, lags) cross-correlation of residual and elevator over its standard deviation, as
        it would be in a correct model: within +-1.96 for 95 % of the lags.
    cross_share : (runs, 3) share of the lags outside +-1.96.
    """

    run_ids: tuple[str, ...]
    elevator_rms_rad: Array
    condition: Array
    cragg_donald: Array
    kleibergen_paap: Array
    equivalent_samples: Array
    ljung_box_p: Array
    cross_lag_s: Array
    cross: Array
    cross_share: Array


def diagnose(
    batch: Batch, constants: AircraftConstants, estimates: Estimates, options: Options | None = None
) -> Diagnostics:
    """Diagnostics of the estimates of a batch.

    Parameters
    ----------
    batch, constants, options : as given to `airtruth.identification.identify_batch`.
    estimates : the estimates that it returned.
    """
    options = options or Options()
    chosen = method(estimates.method)
    runs = len(batch.run_ids)
    reach = int(min(_CROSS_LAG_S / batch.dt_s, batch.t_s.shape[1] // 4))
    lags = np.arange(-reach, reach + 1)
    scalars = np.full((4, runs), np.nan)
    threes = np.full((3, runs, EQUATIONS), np.nan)
    cross = np.full((runs, EQUATIONS, lags.size), np.nan)
    first = 0
    for part in chunks(batch):
        observation = observe(part, constants, options)
        problem = regression(chosen)(observation, options)
        size = len(part.run_ids)
        theta = estimates.theta[first : first + size]
        known = np.flatnonzero(np.isfinite(theta).all(axis=1))
        known = known[problem.usable(theta[known], known)]
        at = first + known
        scalars[0, first : first + size] = observation.signals[:, ELEVATOR].std(axis=1)
        if known.size:
            rows = problem.rows(theta[known], known)
            projected = project(rows, theta[known], observation.factors[known], options.trim == "intercept")
            scalars[1, at] = _condition(projected)
            if chosen.iterates:
                scalars[2, at], scalars[3, at] = instrument_strength(projected)
            threes[0, at], threes[1, at] = whiteness(projected.e)
            cross[at] = cross_correlation(projected, observation.factors[known], lags)
        first += size
    with np.errstate(invalid="ignore"):
        outside = np.where(np.isfinite(cross), np.abs(cross) > _INSIDE, np.nan)
    threes[2] = outside.mean(axis=2)
    return Diagnostics(
        run_ids=batch.run_ids,
        elevator_rms_rad=scalars[0],
        condition=scalars[1],
        cragg_donald=scalars[2],
        kleibergen_paap=scalars[3],
        equivalent_samples=threes[0],
        ljung_box_p=threes[1],
        cross_lag_s=(lags * batch.dt_s).astype(np.float64),
        cross=cross,
        cross_share=threes[2],
    )


def residuals(
    batch: Batch, constants: AircraftConstants, estimates: Estimates, options: Options | None = None
) -> Array:
    """Residuals of the filtered equations, (runs, 3, rows): lift [rad/s], moment [rad/s2], normal [g].

    Rows are samples; the differencing methods have none for the first and the last. NaN where there is
    no estimate.

    Parameters
    ----------
    batch, constants, estimates, options : as in `diagnose`.
    """
    options = options or Options()
    chosen = method(estimates.method)
    parts = []
    first = 0
    for part in chunks(batch):
        observation = observe(part, constants, options)
        problem = regression(chosen)(observation, options)
        theta = estimates.theta[first : first + len(part.run_ids)]
        known = np.flatnonzero(np.isfinite(theta).all(axis=1))
        rows = problem.rows(theta[known], known)
        e = np.full((theta.shape[0], EQUATIONS, rows.shape[2]), np.nan)
        e[known] = project(rows, theta[known], observation.factors[known], options.trim == "intercept").e
        parts.append(e)
        first += len(part.run_ids)
    return np.concatenate(parts)


def _condition(p: Projected) -> Array:
    length = np.sqrt(np.einsum("rin,rin->ri", p.x, p.x))
    correlation = np.matmul(p.x, np.swapaxes(p.x, 1, 2)) / (length[:, :, None] * length[:, None, :])
    values = np.linalg.eigvalsh(correlation)
    return np.asarray(np.sqrt(values[:, -1] / np.maximum(values[:, 0], np.finfo(np.float64).tiny)))


def instrument_strength(p: Projected) -> tuple[Array, Array]:
    """Cragg-Donald F and its Kleibergen-Paap analogue, (runs,) each.

    With as many instruments as endogenous regressors, K of them, both rest on the smallest singular
    value l of (Z'Z)^-1/2 Z'X S^-1/2, S the covariance of the first stage's residuals V: l^2/K is Cragg
    and Donald's minimum eigenvalue over K, and dividing by the variance that coloured residuals give l,
    sum_ts a(t) R(t - s) a(s) with a = Z (Z'Z)^-1/2 u and R of V S^-1/2 v, as in `corrected`, makes it
    robust. A regressor that is its own instrument is projected out first.
    """
    own = (p.z[:, 2] == p.x[:, 2]).all(axis=1)
    weak, robust = np.empty(own.size), np.empty(own.size)
    for r in range(own.size):
        count = 2 if own[r] else 3
        z, x = p.z[r, :count], p.x[r, :count]
        if own[r]:
            d = p.z[r, 2] / np.linalg.norm(p.z[r, 2])
            z, x = z - np.outer(z @ d, d), x - np.outer(x @ d, d)
        # an orthonormal basis of the instruments: a = u' basis has unit length
        basis = np.linalg.qr(z.T)[0].T
        first_stage = basis @ x.T
        v = x - first_stage.T @ basis
        freedom = z.shape[1] - count - (4 - count)
        values, vectors = np.linalg.eigh(v @ v.T / freedom)
        inverse_root = vectors / np.sqrt(values) @ vectors.T
        left, singular, right = np.linalg.svd(first_stage @ inverse_root)
        a = left[:, -1] @ basis
        b = right[-1] @ inverse_root @ v
        transform = int(next_fast_len(2 * z.shape[1] - 1, real=True))
        taken = np.vstack([basis, *([d] if own[r] else []), p.trim[r]])[None]
        spread = rfft(taken, transform)
        of_a, of_b = np.abs(rfft(np.stack([a, b]), transform)) ** 2 / np.array([[1.0], [z.shape[1]]])
        of_b = of_b * correction(taken, spread, spread, of_b[None], transform)[0]
        variance = irfft(of_a * of_b, transform)[0]
        weak[r] = singular[-1] ** 2 / count
        robust[r] = weak[r] / variance
    return weak, robust


def _autocovariance(e: Array) -> Array:
    """(1/N) sum_t e(t) e(t + k), (..., samples), along the last axis."""
    samples = e.shape[-1]
    transform = int(next_fast_len(2 * samples - 1, real=True))
    return np.asarray(irfft(np.abs(rfft(e, transform)) ** 2, transform)[..., :samples] / samples)


def whiteness(e: Array) -> tuple[Array, Array]:
    """Equivalent number of independent samples, and Ljung and Box's p-value, (runs, 3) each.

    A variance estimated from the series is as accurate as one from N / (1 + 2 sum_k rho(k)^2) independent
    samples. The sum over all lags of squared sample correlations is about twice that of the true ones.

    Parameters
    ----------
    e : (runs, 3, samples) of mean zero.
    """
    samples = e.shape[-1]
    c = _autocovariance(e)
    rho = c[..., 1:] / np.maximum(c[..., :1], np.finfo(np.float64).tiny)
    equivalent = np.minimum(samples, 2.0 * samples / (1.0 + 2.0 * np.sum(rho**2, axis=-1)))
    lags = np.arange(1, min(_WHITENESS_LAGS, samples - 1) + 1)
    statistic = samples * (samples + 2.0) * np.sum(rho[..., : lags.size] ** 2 / (samples - lags), axis=-1)
    return equivalent, chdtrc(lags.size, statistic)


def cross_correlation(p: Projected, factors: Array, lags: Ints) -> Array:
    """Sum over t of e(t) u(t - lag), over its standard deviation in a correct model, (runs, 3, lags).

    u is the elevator's instrument. The deviation accounts for the colour of e and for the fit, which made
    e orthogonal to the instruments: with the acting residual nu_L = f_lift nu_lift + f_normal nu_normal
    of the lift block (and f_moment nu_moment of the other), e_i = nu_i - f_i x' (z x')^-1 z nu / sum f^2.

    Parameters
    ----------
    p : instruments, regressors and residuals.
    factors : (runs, 4) of the equations.
    lags : in samples; positive: the elevator leads.
    """
    samples = p.e.shape[2]
    transform = int(next_fast_len(2 * samples - 1, real=True))
    result = np.empty((*p.e.shape[:-1], lags.size))
    for r in range(p.e.shape[0]):
        z, x, trim = p.z[r], p.x[r], p.trim[r]
        shifted = np.stack([_shift(p.z[r, 2], int(lag)) for lag in lags])
        shifted -= np.outer(shifted @ trim, trim)
        hat = shifted @ x.T @ np.linalg.solve(z @ x.T, z)
        e = rfft(p.e[r], transform)
        by_shift, by_hat = rfft(shifted, transform), rfft(hat, transform)
        lift, normal = factors[r, LIFT], factors[r, NORMAL]
        both = lift**2 + normal**2
        own = (lift**2 / both, 1.0, normal**2 / both)
        for i in range(EQUATIONS):
            series = (by_shift - own[i] * by_hat) * e[i].conj()
            if i != MOMENT:
                other = NORMAL if i == LIFT else LIFT
                series = series - lift * normal / both * by_hat * e[other].conj()
            weight = np.full(series.shape[1], 2.0)
            weight[0] = 1.0
            if transform % 2 == 0:
                weight[-1] = 1.0
            variance = (np.abs(series) ** 2 * weight).sum(axis=1) / (transform * samples)
            result[r, i] = (shifted @ p.e[r, i]) / np.sqrt(variance)
    return result


def _shift(u: Array, lag: int) -> Array:
    """u(t - lag), zero beyond the record."""
    out = np.zeros_like(u)
    if lag >= 0:
        out[lag:] = u[: u.size - lag]
    else:
        out[:lag] = u[-lag:]
    return out
