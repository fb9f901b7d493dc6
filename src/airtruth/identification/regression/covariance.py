"""Covariance of the estimates, by name.

Sources: M. Brunot, "An Instrumental Variable Approach for Aircraft Identification", eq. (10), for "paper"
and "white"; E. A. Morelli and V. Klein, "Accuracy of Aerodynamic Model Parameters Estimated
from Flight Test Data", Journal of Guidance, Control, and Dynamics 20(1), 1997, for "coloured".

Each is B^-1 M B^-T. The free intercept is projected out of Z and X first. Sums run over the samples t, s
of a record, and over records for a joint estimate; e is the residual of the filtered equations.

    paper      B = M/N = sum_t Z' L^-1 Z, N samples, L = (1/N) sum e e': (10) as the paper prints it
    white      B = M = sum_t Z' L^-1 Z: (10) with the factor 1/N that it lacks
    coloured   B = sum_t Z' X, M = sum_ts Z(t)' R(t - s) Z(s), R(k) = (1/N) sum_t e(t + k) e(t)'
    corrected  as coloured, with R corrected for the degrees of freedom that the fit removed
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft

from airtruth.identification.regression.rows import HALF_CHORD, LIFT, MOMENT, NORMAL, Projected

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

Parts = tuple[Array, Array]
"""B and M, (runs, 6, 6) each."""

LARGEST_CORRECTION: Final = 3.0
"""Largest factor by which "corrected" raises or lowers the spectrum of R at a frequency [-]; judgement: a larger
one follows the noise of short records."""


def _weights(factors: Array) -> Array:
    """(runs, 3) scale of the instruments in each block of Z: 1, c/(2V), 1."""
    weights = np.ones((factors.shape[0], 3))
    weights[:, 1] = factors[:, HALF_CHORD]
    return weights


def _blocks(lift: Array, cross: Array, moment: Array) -> Array:
    blocks = np.empty((lift.shape[0], 6, 6))
    blocks[:, :3, :3] = lift
    blocks[:, :3, 3:] = cross
    blocks[:, 3:, :3] = np.swapaxes(cross, 1, 2)
    blocks[:, 3:, 3:] = moment
    return blocks


def _information(p: Projected, factors: Array) -> Array:
    samples = p.e.shape[2]
    inverse = np.linalg.pinv(np.matmul(p.e, np.swapaxes(p.e, 1, 2)) / samples)
    d = _weights(factors)
    zz = np.matmul(p.z, np.swapaxes(p.z, 1, 2)) * d[:, :, None] * d[:, None, :]
    lift, moment, normal = factors[:, LIFT], factors[:, MOMENT], factors[:, NORMAL]
    in_lift = (
        lift**2 * inverse[:, LIFT, LIFT]
        + normal**2 * inverse[:, NORMAL, NORMAL]
        + 2.0 * lift * normal * inverse[:, LIFT, NORMAL]
    )
    in_cross = moment * (lift * inverse[:, LIFT, MOMENT] + normal * inverse[:, NORMAL, MOMENT])
    in_moment = moment**2 * inverse[:, MOMENT, MOMENT]
    return _blocks(*(c[:, None, None] * zz for c in (in_lift, in_cross, in_moment)))


def paper(p: Projected, factors: Array, samples: int) -> Parts:
    """Eq. (10) as the paper prints it: a factor 1/N inside the inverse makes the intervals sqrt(N) too wide.

    Parameters
    ----------
    p, factors : instruments and residuals of the runs; factors of their equations.
    samples : N, samples of the estimate: those of the run, or of all runs of a joint estimate.

    Returns
    -------
    B, M : (runs, 6, 6) each; a joint estimate sums them over runs.
    """
    information = _information(p, factors)
    return information, information * samples


def white(p: Projected, factors: Array, samples: int) -> Parts:
    """Eq. (10) with 1/N: residuals taken as white, and (9) as weighted by L^-1."""
    information = _information(p, factors)
    return information, information


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def _spectral_sum(z: Complex, lift: Array, cross: Complex, moment: Array, transform: int, out: Array) -> None:
    """out[r] = [lift, cross, moment] (3, 3, 3) of sum_ts z(t) R(t - s) z(s), R by its spectrum."""
    count = z.shape[2]
    for r in range(z.shape[0]):
        sums = out[r]
        for i in range(3):
            for j in range(3):
                sums[0, i, j] = sums[1, i, j] = sums[2, i, j] = 0.0
        for f in range(count):
            # a real sequence: each frequency except 0 and Nyquist counts twice
            single = f == 0 or (transform % 2 == 0 and f == count - 1)
            share = (1.0 if single else 2.0) / transform
            ll, mm = lift[r, f] * share, moment[r, f] * share
            real, imag = cross[r, f].real * share, cross[r, f].imag * share
            for i in range(3):
                ar, ai = z[r, i, f].real, z[r, i, f].imag
                for j in range(3):
                    br, bi = z[r, j, f].real, z[r, j, f].imag
                    zz = ar * br + ai * bi
                    sums[0, i, j] += ll * zz
                    sums[1, i, j] += real * zz - imag * (ar * bi - ai * br)
                    sums[2, i, j] += mm * zz


@dataclass(frozen=True)
class _Spectra:
    """Spectra of z and of R over twice the record, for the residuals that act on each block.

    Attributes
    ----------
    transform : length of the transforms [samples].
    z : (runs, 3, frequencies) of the instruments.
    lift, cross, moment : (runs, frequencies) of R: lift block, lift against moment, moment block.
    """

    transform: int
    z: Complex
    lift: Array
    cross: Complex
    moment: Array


def _spectra(p: Projected, factors: Array) -> _Spectra:
    """Spectra of lift e_lift + normal e_normal, which acts on the lift block, and of moment e_moment."""
    samples = p.e.shape[2]
    transform = int(next_fast_len(2 * samples - 1, real=True))
    acting = np.stack(
        [
            factors[:, LIFT, None] * p.e[:, LIFT] + factors[:, NORMAL, None] * p.e[:, NORMAL],
            factors[:, MOMENT, None] * p.e[:, MOMENT],
        ],
        axis=1,
    )
    e = rfft(acting, transform)
    lift, moment = e[:, 0], e[:, 1]
    return _Spectra(
        transform=transform,
        z=rfft(p.z, transform),
        lift=(lift.real**2 + lift.imag**2) / samples,
        cross=lift * moment.conj() / samples,
        moment=(moment.real**2 + moment.imag**2) / samples,
    )


def _parts(p: Projected, factors: Array, s: _Spectra) -> Parts:
    sums = np.empty((p.z.shape[0], 3, 3, 3))
    _spectral_sum(s.z, s.lift, s.cross, s.moment, s.transform, sums)
    d = _weights(factors)
    sums *= d[:, None, :, None] * d[:, None, None, :]
    return products(p, factors), _blocks(sums[:, 0], sums[:, 1], sums[:, 2])


def products(p: Projected, factors: Array) -> Array:
    """(runs, 6, 6) Z'X, B of the covariances but for "paper" and "white"."""
    d = _weights(factors)
    zx = np.matmul(p.z, np.swapaxes(p.x, 1, 2)) * d[:, :, None] * d[:, None, :]
    lift, moment = (k[:, None, None] * zx for k in _block_weights(factors))
    return _blocks(lift, np.zeros_like(lift), moment)


def coloured(p: Projected, factors: Array, samples: int) -> Parts:
    """Morelli and Klein's correction for coloured residuals, carried over from LS to IV.

    The double sum over all lags is evaluated in the frequency domain, exactly (zero padding to twice the
    record).
    """
    return _parts(p, factors, _spectra(p, factors))


def corrected(p: Projected, factors: Array, samples: int) -> Parts:
    """As `coloured`, with R corrected for the degrees of freedom that the fit removed from the residuals.

    The residuals are e = Q nu, Q = I - x (z'x)^-1 z' - s s', so that their autocovariance c is too small
    at the frequencies of instruments and regressors: E c = D(Q R Q'), D the mean along each diagonal (over
    N). One step of a multiplicative iteration solves c = D(Q R Q') for R approximately: the spectrum of c
    times its ratio to the spectrum of D(Q C Q'), C the Toeplitz matrix of c. The ratio is kept between
    1/`LARGEST_CORRECTION` and `LARGEST_CORRECTION`.
    """
    s = _spectra(p, factors)
    zx = np.matmul(p.z, np.swapaxes(p.x, 1, 2))
    weights = np.concatenate([np.matmul(np.linalg.inv(zx), p.z), p.trim[:, None]], axis=1)
    columns = np.concatenate([p.x, p.trim[:, None]], axis=1)
    w, u = rfft(weights, s.transform), rfft(columns, s.transform)
    by_lift = correction(weights, w, u, s.lift, s.transform)
    by_moment = correction(weights, w, u, s.moment, s.transform)
    return _with_corrections(p, factors, s, by_lift, by_moment)


def corrected_jointly(p: Projected, factors: Array, total: Array) -> Parts:
    """As `corrected`, of runs that one fit has in common: it removes its degrees of freedom from all of them once.

    Parameters
    ----------
    total : (6, 6) sum of `products` over all runs of the fit.
    """
    s, d = _spectra(p, factors), _weights(factors)
    columns = np.concatenate([p.x * d[:, :, None], p.trim[:, None]], axis=1)
    u = rfft(columns, s.transform)
    by_block = []
    blocks = total[:3, :3], total[3:, 3:]
    for block, k, spectrum in zip(blocks, _block_weights(factors), (s.lift, s.moment), strict=True):
        own = np.linalg.inv(block) @ (p.z * d[:, :, None] * k[:, None, None])
        weights = np.concatenate([own, p.trim[:, None]], axis=1)
        by_block.append(correction(weights, rfft(weights, s.transform), u, spectrum, s.transform))
    return _with_corrections(p, factors, s, *by_block)


def _block_weights(factors: Array) -> tuple[Array, Array]:
    """(runs,) weights of Z'X in the lift and in the moment block."""
    return factors[:, LIFT] ** 2 + factors[:, NORMAL] ** 2, factors[:, MOMENT] ** 2


def _with_corrections(p: Projected, factors: Array, s: _Spectra, by_lift: Array, by_moment: Array) -> Parts:
    return _parts(
        p,
        factors,
        _Spectra(
            s.transform,
            s.z,
            s.lift * by_lift,
            s.cross * np.sqrt(by_lift * by_moment),
            s.moment * by_moment,
        ),
    )


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def _ratio(
    expected: Complex,
    carried: Complex,
    u: Complex,
    inner: Array,
    spectrum: Array,
    floor: Array,
    samples: int,
    limit: float,
) -> None:
    """Replace ``spectrum`` by its ratio to expected - 2 Re sum_i conj(u_i) (carried_i - u' inner/2)/N."""
    runs, count, size = u.shape
    for r in range(runs):
        for f in range(size):
            taken = 0.0
            for i in range(count):
                re, im = carried[r, i, f].real, carried[r, i, f].imag
                for j in range(count):
                    re -= 0.5 * inner[r, j, i] * u[r, j, f].real
                    im -= 0.5 * inner[r, j, i] * u[r, j, f].imag
                taken += u[r, i, f].real * re + u[r, i, f].imag * im
            ratio = spectrum[r, f] / max(expected[r, f].real - 2.0 * taken / samples, floor[r])
            spectrum[r, f] = min(max(ratio, 1.0 / limit), limit)


def correction(weights: Array, w: Complex, u: Complex, spectrum: Array, transform: int) -> Array:
    """Spectrum of c over the spectrum of D(Q C Q'), within limits, (runs, frequencies).

    Parameters
    ----------
    weights : (runs, k, samples) rows W of Q = I - U' W.
    w, u : (runs, k, frequencies) spectra of W and U, padded to ``transform``.
    spectrum : (runs, frequencies) of c.
    transform : length of the transforms, at least twice the samples less one.
    """
    samples = weights.shape[2]
    lags = np.minimum(np.arange(transform), transform - np.arange(transform))
    taper = np.maximum(1.0 - lags / samples, 0.0)
    expected = rfft(irfft(spectrum, transform) * taper)
    # C w inside the record
    carried = irfft(w * spectrum[:, None], transform)[:, :, :samples]
    inner = np.matmul(weights, np.swapaxes(carried, 1, 2))
    ratio = spectrum.copy()
    floor = 1e-9 * ratio.max(axis=1) + 1e-300
    _ratio(expected, rfft(carried, transform), u, inner, ratio, floor, samples, LARGEST_CORRECTION)
    return ratio


COVARIANCES: Final[dict[str, Callable[[Projected, Array, int], Parts]]] = {
    "paper": paper,
    "white": white,
    "coloured": coloured,
    "corrected": corrected,
}
"""B and M by the name of the covariance."""
REGULAR: Final = 1e-24
"""Least determinant of B with rows of unit length that is inverted [-]; judgement, above rounding."""


def sandwich(parts: Parts) -> Array:
    """B^-1 M B^-T, (runs, 6, 6); NaN where B is singular."""
    bread, meat = parts
    # lift and moment rows differ by orders of magnitude
    size = np.sqrt(np.einsum("rij,rij->ri", bread, bread))
    with np.errstate(divide="ignore", invalid="ignore"):
        scaled = bread / size[:, :, None]
    covariance = np.full(bread.shape, np.nan)
    regular = np.isfinite(scaled).all(axis=(1, 2))
    regular[regular] = np.abs(np.linalg.det(scaled[regular])) > REGULAR
    inverse = np.linalg.inv(scaled[regular]) / size[regular, None, :]
    covariance[regular] = inverse @ meat[regular] @ np.swapaxes(inverse, 1, 2)
    return covariance
