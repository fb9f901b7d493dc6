"""Instrument errors from one kinematic equation, by instrumental variables, with honest intervals.

Gusts move alpha and airspeed but no inertial quantity, and the aircraft answers them: residual and
regressors are correlated, and least squares is biased. The elevator of an open loop knows nothing of
gusts and noise: instruments are motions that it causes, and the residual's colour is whitened before.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import toeplitz
from scipy.signal import lfilter
from scipy.stats import chi2

from airtruth.identify.kinematics_model import ERRORS, Record, integral, predicted
from airtruth.identify.prefilter import butterworth, zero_phase
from airtruth.identify.srivc import simulate, srivc

Array = NDArray[np.float64]

ORDER: Final = 8
"""Order of the autoregression that whitens residuals, lowered for short records."""
STEPS: Final = 12
DOUBT: Final = 0.01
"""Probability of the unexplained motion below which standard errors are inflated."""
CLOSE: Final = 1e-3
"""A Gauss-Newton step below this many standard errors ends the search."""
SHARE: Final = 8
"""The autocovariance of what is left is taken up to this part of the shortest record."""
LIMITS: Final = {"-": 0.25, "s": 0.15, "m": 25.0}
"""Largest Gauss-Newton step, by the unit of the error."""
CUTOFF_HZ: Final = 5.0
"""Of the low-pass that smooths the measured elevator, lowered for slow records."""
_BANK_HZ: Final = (0.2, 0.5, 1.0, 2.0)


@dataclass(frozen=True)
class Fit:
    """Errors fitted to one equation.

    Attributes
    ----------
    equation : "theta", "alpha" or "airspeed".
    names : errors that were free.
    value, covariance : (k,), (k, k).
    converged : whether the search ended.
    overidentification, degrees : statistic and degrees of freedom of the motion that the elevator
        causes and the fitted errors do not explain; chi-square where they explain all.
    strength : smallest first-stage F over the free errors; small where the manoeuvre does not show them.
    slope, slope_std : (records,) ramp left over, as biases cause it [unit/s].
    bandwidth : largest lag of the autocovariance over the number of samples [-].
    residual_rms : of the measured channel less the prediction, constant and ramp [unit].
    """

    equation: str
    names: tuple[str, ...]
    value: Array
    covariance: Array
    converged: bool
    overidentification: float
    degrees: int
    strength: float
    slope: Array
    slope_std: Array
    bandwidth: float
    residual_rms: float

    @property
    def inflation(self) -> float:
        """Factor on standard errors for what the errors leave unexplained (R. T. Birge, 1932), at least 1."""
        if self.p_value > DOUBT:
            return 1.0
        return float(np.sqrt(self.overidentification / self.degrees))

    @property
    def std(self) -> Array:
        """(k,) standard errors, inflated."""
        return np.asarray(self.inflation * np.sqrt(np.maximum(np.diagonal(self.covariance), 0.0)))

    @property
    def quantile(self) -> float:
        """Standard errors in half a 95 % interval, the covariance being an estimate from few samples.

        N. M. Kiefer and T. J. Vogelsang, *Econometric Theory* 21(6), 2005, table 1: Bartlett, 97.5 %.
        """
        b = self.bandwidth
        return 1.96 + 2.9694 * b + 0.4160 * b**2 - 0.5324 * b**3

    @property
    def p_value(self) -> float:
        """Probability of as much unexplained motion, or more, if the fitted errors were all."""
        return float(chi2.sf(self.overidentification, self.degrees)) if self.degrees > 0 else 1.0


def instruments(record: Record) -> Array:
    """(k, samples) motions that the elevator causes, noise-free, each of unit length.

    From the second-order transfer function of elevator to pitch rate that fits the record (SRIVC):
    simulated q, q', its first and second integral; the elevator and its integral. Where none fits, the
    elevator through a bank of first-order low-passes.
    """
    dt = record.dt_s
    elevator = (record.elevator - record.elevator[0])[None]
    smooth = zero_phase(record.elevator[None], butterworth(min(CUTOFF_HZ, 0.2 / dt), 4, dt))
    smooth = smooth - smooth[:, :1]
    model = srivc(elevator, record.q[None], dt, 2, 2, 3.0, "foh")
    if np.isfinite(model.a).all():
        q = simulate(model, elevator, dt, "foh")[0]
        rows = [q, np.gradient(q, dt), integral(q, dt), integral(integral(q, dt), dt)]
        rows += [smooth[0], integral(smooth[0], dt)]
    else:
        rows = [integral(smooth[0], dt), smooth[0]]
        for corner in _BANK_HZ:
            pole = np.exp(-2.0 * np.pi * corner * dt)
            rows.append(lfilter([1.0 - pole], [1.0, -pole], smooth[0]))
    stacked = np.array(rows)
    return np.asarray(stacked / np.maximum(np.linalg.norm(stacked, axis=1, keepdims=True), 1e-300))


def fit(
    equation: str,
    records: Sequence[Record],
    names: Sequence[str],
    known: Mapping[str, float] | None = None,
    basis: Sequence[Array] | None = None,
) -> Fit:
    """Fit instrument errors to one equation, all records together.

    Each record has a constant and a ramp of its own. Gauss-Newton steps by two-stage least squares on
    residuals whitened by an autoregression; covariance from the autocovariance of what is left.

    Parameters
    ----------
    equation : see `airtruth.identify.kinematics_model.predicted`.
    records : at least one.
    names : free errors, names of ERRORS; at least one.
    known : errors held at a value other than none.
    basis : instruments of each record; None makes them.
    """
    known = known or {}
    basis = basis or [instruments(r) for r in records]
    value = np.array([ERRORS[n][1] if n not in known else known[n] for n in names])
    polynomial = np.array([1.0])
    converged = False
    for iteration in range(STEPS):
        parts = [_linearised(equation, r, names, known, value) for r in records]
        residuals = [_detrended(e[None])[0] for e, _ in parts]
        polynomial = _autoregression(residuals, polynomial)
        whitened = [_whitened(polynomial, e, j, z) for (e, j), z in zip(parts, basis, strict=True)]
        e, j, z = (np.concatenate(column, axis=-1) for column in zip(*whitened, strict=True))
        weight, projected, covariance = _two_stage(e, j, z, [w[0].size for w in whitened])
        step = weight @ e
        std = np.sqrt(np.maximum(np.diagonal(covariance), 1e-300))
        if iteration > 0 and (np.abs(step) <= CLOSE * std).all():
            converged = True
            break
        limit = np.array([LIMITS[ERRORS[n][0]] for n in names])
        value = value + np.clip(step, -limit, limit)
        value = np.array([_bounded(n, v) for n, v in zip(names, value, strict=True)])
    moments = z @ e
    spread = _moment_covariance(e, z, [w[0].size for w in whitened])
    statistic = float(moments @ np.linalg.lstsq(spread, moments, rcond=1e-10)[0])
    slopes, slope_stds = _slopes(parts, covariance)
    period = np.array([r.dt_s for r in records])
    sizes = [w[0].size for w in whitened]
    return Fit(
        equation=equation,
        names=tuple(names),
        value=value,
        covariance=covariance,
        converged=converged and bool(np.isfinite(covariance).all()),
        overidentification=statistic,
        degrees=int(np.linalg.matrix_rank(z @ z.T)) - len(names),
        strength=_strength(j, projected, z.shape[0]),
        slope=slopes / period,
        slope_std=slope_stds / period,
        bandwidth=min(sizes) // SHARE / sum(sizes),
        residual_rms=float(np.sqrt(np.mean(np.concatenate(residuals) ** 2))),
    )


def _bounded(name: str, value: float) -> float:
    if name.endswith("_scale"):
        return float(np.clip(value, 0.2, 5.0))
    return max(value, 1e-4) if name == "vane_lag" else value


def _linearised(
    equation: str, record: Record, names: Sequence[str], known: Mapping[str, float], value: Array
) -> tuple[Array, Array]:
    """Residual (samples,) and its negative derivatives (k, samples)."""
    errors = {**known, **dict(zip(names, value, strict=True))}
    measured, now = predicted(equation, record, errors)
    rows = []
    for name in names:
        h = ERRORS[name][2]
        ends = [predicted(equation, record, {**errors, name: errors[name] + s * h})[1] for s in (0.5, -0.5)]
        rows.append((ends[0] - ends[1]) / h)
    return measured - now, np.array(rows).reshape(len(names), len(now))


def _trend(samples: int) -> Array:
    t = np.linspace(-1.0, 1.0, samples)
    return np.stack([np.ones(samples), t])


def _detrended(x: Array) -> Array:
    basis = _trend(x.shape[-1])
    return np.asarray(x - (x @ np.linalg.pinv(basis)) @ basis)


def _autoregression(residuals: Sequence[Array], old: Array) -> Array:
    """Polynomial 1 + a1 z^-1 + ... that whitens the residuals, by least squares over all records."""
    order = min(ORDER, min(len(r) for r in residuals) // 12)
    rows = [toeplitz(r[order - 1 : -1], r[order - 1 :: -1][:order]) for r in residuals]
    x = np.concatenate(rows)
    y = np.concatenate([r[order:] for r in residuals])
    if not np.any(x):
        return old
    return np.concatenate([[1.0], -np.linalg.lstsq(x, y, rcond=None)[0]])


def _whitened(polynomial: Array, e: Array, j: Array, z: Array) -> tuple[Array, Array, Array]:
    """Residual, derivatives and instruments through the polynomial, constant and ramp projected out."""
    order = len(polynomial) - 1
    rows = np.concatenate([e[None], j, z, _trend(len(e))])
    rows = lfilter(polynomial, [1.0], rows, axis=-1)[:, order:]
    nuisance = np.linalg.qr(rows[-2:].T)[0]
    rows = rows[:-2] - (rows[:-2] @ nuisance) @ nuisance.T
    k = j.shape[0]
    return rows[0], rows[1 : 1 + k], rows[1 + k :]


def _two_stage(e: Array, j: Array, z: Array, sizes: Sequence[int]) -> tuple[Array, Array, Array]:
    """Weights (k, samples) that turn a residual into a step, projected derivatives, covariance."""
    projected = (j @ np.linalg.pinv(z)) @ z
    normal = projected @ j.T
    weight: Array = np.asarray(np.linalg.lstsq(normal, projected, rcond=1e-12)[0])
    covariance = _moment_covariance(np.asarray(e - (weight @ e) @ j), weight, sizes)
    return weight, projected, covariance


def _moment_covariance(e: Array, z: Array, sizes: Sequence[int]) -> Array:
    """Sum over t, s of z(t) r(t - s) z(s)', r the autocovariance of the residual, tapered."""
    longest = min(sizes)
    width = max(1, longest // SHARE)
    total = np.zeros((len(z), len(z)))
    r = np.zeros(width)
    starts = np.concatenate([[0], np.cumsum(sizes)])
    for a, b in pairwise(starts):
        part = e[a:b]
        r += np.array([part[k:] @ part[: len(part) - k] for k in range(width)])
    r *= (1.0 - np.arange(width) / width) / (len(e) - 2 * len(sizes) - len(z))
    for a, b in pairwise(starts):
        column = np.zeros(b - a)
        column[:width] = r
        total += z[:, a:b] @ toeplitz(column) @ z[:, a:b].T
    return total


def _strength(j: Array, projected: Array, count: int) -> float:
    """Smallest first-stage F over the errors, what the others explain taken out of both."""
    smallest = np.inf
    for i in range(len(j)):
        rest = np.delete(projected, i, axis=0)
        own = projected[i] - (projected[i] @ np.linalg.pinv(rest)) @ rest if len(rest) else projected[i]
        left = j[i] - projected[i]
        noise = (left @ left) / max(len(left) - count, 1)
        smallest = min(smallest, float(own @ own / max(count * noise, 1e-300)))
    return smallest


def _slopes(parts: Sequence[tuple[Array, Array]], covariance: Array) -> tuple[Array, Array]:
    """Ramp of each record by least squares, and its standard error [unit per sample].

    What integrates noise wanders, and an autoregression fitted to a detrended record does not see how
    far; the autocovariance of the residual's increments does.
    """
    slopes, stds = [], []
    for e, j in parts:
        n = len(e)
        t = np.arange(n) - 0.5 * (n - 1)
        weights = t / (t @ t)
        steps = np.diff(e)
        # sum_t w(t) e(t) = sum_s W(s) step(s), W(s) the weights after s
        reach = np.cumsum(weights[::-1])[::-1][1:]
        own = _moment_covariance(steps - steps.mean(), reach[None], [n - 1])[0, 0]
        share = j @ weights
        slopes.append(weights @ e)
        stds.append(np.sqrt(max(own, 0.0) + share @ covariance @ share))
    return np.array(slopes), np.array(stds)


__all__ = ["Fit", "fit", "instruments"]
