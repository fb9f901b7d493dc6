"""Gust histories by spectral synthesis: the amplitude of each frequency is exact, its phase random.

One-sided spectra over angular frequency, integrating to sigma^2 (MIL-F-8785C, 3.7.1; MIL-HDBK-1797, app. A):

- Dryden (3.7.1.2): Phi_u = sigma^2 (2 L/(pi V)) / (1 + x^2), Phi_w = sigma^2 (L/(pi V)) (1 + 3 x^2)/(1 + x^2)^2,
  x = L omega/V
- von Karman (3.7.1.1): Phi_u = sigma^2 (2 L/(pi V)) / (1 + (1.339 x)^2)^(5/6),
  Phi_w = sigma^2 (L/(pi V)) (1 + 8/3 (1.339 x)^2) / (1 + (1.339 x)^2)^(11/6)
- rotary: H_q = (s/V) / (1 + 4 b s/(pi V)) on w, b the span.

The irrational von Karman form needs no rational approximation here.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

KINDS: Final = ("dryden", "von_karman")
_LENGTH: Final = 2**18  # 262 s at 1 kHz: the first line lies below V/L


def spectrum(
    kind: str, axis: str, omega_rad_s: Array, sigma_m_s: float, length_m: float, v_m_s: float
) -> Array:
    """One-sided spectrum [m2/s2 per rad/s] of ``axis`` "u" or "w"; (n,) of omega [rad/s]."""
    x2 = np.square(omega_rad_s * length_m / v_m_s)
    unit = sigma_m_s**2 * length_m / (np.pi * v_m_s)
    if kind == "dryden":
        return np.asarray(
            2.0 * unit / (1.0 + x2) if axis == "u" else unit * (1.0 + 3.0 * x2) / (1.0 + x2) ** 2
        )
    y2 = 1.339**2 * x2
    if axis == "u":
        return np.asarray(2.0 * unit / (1.0 + y2) ** (5.0 / 6.0))
    return np.asarray(unit * (1.0 + 8.0 / 3.0 * y2) / (1.0 + y2) ** (11.0 / 6.0))


def rotary(omega_rad_s: Array, v_m_s: float, span_m: float) -> NDArray[np.complex128]:
    """Rotation of the air, nose-up positive, per downward gust: -dw/dx smoothed over the span [rad/m]."""
    s = 1j * omega_rad_s
    return np.asarray(-(s / v_m_s) / (1.0 + 4.0 * span_m * s / (np.pi * v_m_s)))


def synthesise(
    kind: str,
    sigma_m_s: tuple[float, float],
    length_m: tuple[float, float],
    v_m_s: float,
    span_m: float,
    step_s: float,
    count: int,
    rng: np.random.Generator,
) -> Array:
    """One stationary history: (3, count) of u, w [m/s] and the air's rotation [rad/s].

    The history is a stretch of a period of 2^18 steps; lines lie at multiples of d omega, and the constant
    carries the half line below the first.
    """
    n = max(_LENGTH, count)
    spacing = 2.0 * np.pi / (n * step_s)
    omega = np.asarray(spacing * np.arange(n // 2 + 1), dtype=np.float64)
    lines = []
    for axis, sigma, length in zip("uw", sigma_m_s, length_m, strict=True):
        variance = spectrum(kind, axis, omega, sigma, length, v_m_s) * spacing
        variance[0] /= 2.0
        normals = rng.standard_normal((2, len(omega)))
        line = np.sqrt(variance) * (normals[0] + 1j * normals[1])  # power |line|^2/2
        line[0] = np.sqrt(variance[0]) * normals[0, 0]
        lines.append(line)
    lines.append(lines[1] * rotary(omega, v_m_s, span_m))
    first = int(rng.integers(0, n - count + 1))
    half = np.asarray(lines)
    half[:, 0] *= 2.0  # irfft halves every line but the constant
    return np.asarray(np.fft.irfft(half, n, axis=-1)[:, first : first + count] * (n / 2.0))
