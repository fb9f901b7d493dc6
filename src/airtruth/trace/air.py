"""The air of a set of records: Dryden's spectrum, which the filter has, or von Karman's, by the innovations.

A record's gust level is fitted to innovations, most of which lie above 5 Hz; a free run is moved below 2 Hz.
Between the two von Karman's spectrum rises by omega^(1/3) less than Dryden's, so that in such air a level
that is right for the innovations is about half as large again as it should be for a free run.

Sources: MIL-F-8785C, 3.7.1 (both forms); P. Whittle, Ark. Mat. 2 (1953), for the likelihood of a spectrum.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from airtruth.identify.kalman_step import step
from airtruth.physics import dryden, von_karman
from airtruth.trace.kernel import CORE, LENGTH_W, gain, linear, states
from airtruth.trace.lower import Lowered
from airtruth.trace.model import Settings, plane_of
from airtruth.trace.records import Record

Array = NDArray[np.float64]

_BY_FIRST: Final = float(np.sqrt(1.5))
"""What the first of the filter's two gust states adds to the gust."""
_LOG_LEVELS: Final = (-4.0, 2.0)
_FOLDS: Final = 4


@dataclass(frozen=True)
class Air:
    """Spectrum of the vertical gust.

    Attributes
    ----------
    von_karman : its form; else Dryden's.
    level : variance over that which the filter's gust has.
    """

    von_karman: bool
    level: float


DRYDEN: Final = Air(False, 1.0)
"""The filter's own."""


@dataclass(frozen=True)
class Motion:
    """Linearised motion of one record in the filter's gusts, x' = A x + drive, y = C x + noise.

    Attributes
    ----------
    a, c : (n, n) and (3, n); states as in `airtruth.trace.kernel`, the gust's in places 2 to 4.
    process : (n,) intensities of the drive [1/s].
    variance : (3,) of the sensors' noise.
    airspeed_m_s : mean.
    constants : of the kernel.
    """

    a: Array
    c: Array
    process: Array
    variance: Array
    airspeed_m_s: float
    constants: Array

    @property
    def length_m(self) -> float:
        """Scale length of the gust."""
        return float(self.constants[LENGTH_W])


def motion(record: Record, settings: Settings, low: Lowered, shared: Array, local: Array) -> Motion:
    """The motion about a record's mean, sensors' lags and delays included."""
    plant, s = record.plant, record.signals
    inner = CORE + sum(1 if kind == 0 else 2 for kind in low.state_index[:, 0])
    n = states(inner, low.lags, low.delays)
    a, c = np.empty((n, n)), np.empty((3, n))
    v, density = float(s.airspeed_m_s.mean()), float(s.density_kg_m3.mean())
    x = np.zeros(n)
    x[0] = float(s.y[:, 0].mean()) - plant.alpha_shift_rad
    plane = plane_of(plant, settings, low, shared, local, v)
    linear(
        x,
        float(s.elevator_rad.mean()),
        v,
        0.5 * density * v * v,
        float(s.theta_rad.mean()) - plant.alpha_shift_rad,
        inner,
        low.lags,
        low.delays,
        plane,
        low.arms,
        low.scales,
        a,
        c,
    )
    process = np.zeros(n)
    process[2] = 2.0 * v / settings.length_w_m
    variance = (settings.noise * np.exp(shared[6:9])) ** 2
    return Motion(a, c, process, variance, v, plane[0])


def spectrum(air: Air, length_m: float, airspeed_m_s: float, omega_rad_s: Array) -> Array:
    """One-sided spectrum of the gust over the filter's standard deviation, (...) [s]."""
    if air.von_karman:
        return air.level * von_karman.vertical(1.0, length_m, airspeed_m_s, omega_rad_s)
    unit = dryden.Dryden(1.0, 1.0, length_m, length_m, airspeed_m_s)
    return np.asarray(air.level * dryden.spectrum(unit, omega_rad_s)[..., 1])


def gusts(air: Air, m: Motion, dt_s: float, samples: int, draws: int, rng: np.random.Generator) -> Array:
    """Histories over the filter's standard deviation, (samples, draws), stationary.

    Lines of exact power and random phase; those up to 4.5 sample rates are folded back. The period is
    eight records: what is slower is a constant to a record.
    """
    n = int(2 ** np.ceil(np.log2(8 * samples)))
    line = 2.0 * np.pi / (n * dt_s)
    omega = line * np.arange(n // 2 + 1)
    rate = n * line
    power = np.zeros(omega.size)
    for fold in range(-_FOLDS, _FOLDS + 1):
        power += spectrum(air, m.length_m, m.airspeed_m_s, np.abs(omega + fold * rate))
    # over both signs of omega a line carries half of the one-sided density
    size = np.sqrt(0.5 * power * line)
    normals = rng.standard_normal((2, omega.size, draws))
    lines = np.sqrt(0.5) * size[:, None] * (normals[0] + 1j * normals[1])
    lines[0] = size[0] * normals[0, 0]
    return np.asarray(np.fft.irfft(n * lines, n, axis=0)[:samples])


def response(m: Motion, w: Array, dt_s: float) -> Array:
    """Noise-free outputs (samples, 3, draws) to gusts (samples, draws) that are linear between samples.

    It begins with alpha and q at their mean, the late gust at its first value.
    """
    inner = [i for i in range(m.a.shape[0]) if i not in (2, 3)]
    # the gust's two states enter as one sum alone
    by_gust, out_gust = m.a[inner, 2] / _BY_FIRST, m.c[:, 2] / _BY_FIRST
    k = len(inner)
    phi, spread = np.empty((k, k)), np.empty((k, k))
    early, late = np.empty((k, 1)), np.empty((k, 1))
    system = np.column_stack([m.a[np.ix_(inner, inner)], by_gust])
    step(system, np.zeros(k), k, dt_s, phi, early, late, spread)
    x = np.zeros((k, w.shape[1]))
    x[inner.index(4)] = w[0]
    y = np.empty((len(w), 3, w.shape[1]))
    for i in range(len(w)):
        y[i] = m.c[:, inner] @ x + out_gust[:, None] * w[i]
        if i + 1 < len(w):
            x = phi @ x + early * w[i] + late * w[i + 1]
    return y


def chosen(motions: Sequence[Motion], whitened: Sequence[Array], dt_s: Sequence[float]) -> Air:
    """The spectrum, and its level, under which the innovations of some records are most likely.

    Whittle's likelihood. In other air than the filter's the whitened innovations have the spectrum
    I + (ratio - 1) u u*, ratio that of the spectra, u what the filter makes of the gust.

    Parameters
    ----------
    motions : of each record at the fitted levels.
    whitened : (samples, 3) innovations of each record; dt_s : its sample period [s].
    """
    seen = []
    for m, r, dt in zip(motions, whitened, dt_s, strict=True):
        if not np.isfinite(r).all():
            return DRYDEN
        omega: Array = 2.0 * np.pi / (len(r) * dt) * np.arange(1.0, (len(r) + 1) // 2)
        u = _share(m, dt, omega)
        if u is None:
            return DRYDEN
        lines = np.fft.rfft(r, axis=0)[1 : len(omega) + 1] / np.sqrt(len(r))
        slope = spectrum(Air(True, 1.0), m.length_m, m.airspeed_m_s, omega) / spectrum(
            DRYDEN, m.length_m, m.airspeed_m_s, omega
        )
        size = np.minimum(np.sum(np.abs(u) ** 2, axis=1), 1.0)
        seen.append((size, np.abs(np.sum(u.conj() * lines, axis=1)) ** 2, slope))
    size, along, slope = (np.concatenate(parts) for parts in zip(*seen, strict=True))

    def cost(log_level: float, ratio: Array | float) -> float:
        more = np.exp(log_level) * ratio - 1.0
        whole = 1.0 + more * size
        return float(np.sum(np.log(whole) - more * along / whole))

    own, other = (
        minimize_scalar(cost, bounds=_LOG_LEVELS, args=(ratio,), method="bounded") for ratio in (1.0, slope)
    )
    best = other if other.fun < own.fun else own
    return Air(best is other, float(np.exp(best.x)))


def _share(m: Motion, dt_s: float, omega: Array) -> NDArray[np.complex128] | None:
    """The gust in the whitened innovations, (frequencies, 3): W (I + C (z - Phi)^-1 Phi K)^-1 C (s - A)^-1 drive.

    None where the filter has no gain.
    """
    n = m.a.shape[0]
    k_gain, white, _, logdet = gain(m.a, m.c, m.airspeed_m_s, m.constants, m.variance, dt_s)
    if not np.isfinite(logdet):
        return None
    phi, spread = np.empty((n, n)), np.empty((n, n))
    early, late = np.empty((n, 1)), np.empty((n, 1))
    step(np.hstack([m.a, np.zeros((n, 1))]), m.process, n, dt_s, phi, early, late, spread)
    eye = np.eye(n)
    drive = np.sqrt(m.process[2] / dt_s) * eye[:, 2]
    z = np.exp(1j * omega * dt_s)[:, None, None]
    outputs = m.c @ np.linalg.solve(1j * omega[:, None, None] * eye - m.a, drive[:, None])
    predicted = np.eye(3) + m.c @ np.linalg.solve(z * eye - phi, phi @ k_gain)
    return np.asarray((white @ np.linalg.solve(predicted, outputs))[..., 0])


__all__ = ["DRYDEN", "Air", "Motion", "chosen", "gusts", "motion", "response", "spectrum"]
