"""Lateral Dryden gusts along the flight path: v, and p and r of a span, in the exact form of `airtruth.physics.dryden`.

Spectra of MIL-F-8785C, 3.7.1.2, over the angular frequency omega, V the airspeed, b the span:

- Phi_v = sigma_v^2 (Lv/(pi V)) (1 + 3 (Lv omega/V)^2) / (1 + (Lv omega/V)^2)^2
- Phi_p = sigma_w^2/(V Lw) 0.8 (pi Lw/(4 b))^(1/3) / (1 + (4 b omega/(pi V))^2)
- Phi_r = (omega/V)^2 / (1 + (3 b omega/(pi V))^2) Phi_v

v is positive to the right. p and r are rotations of the air, right wing down and nose right positive; r is dv/dx, smoothed
over the span, and p has no correlation with the other gusts. Aircraft relative to the air: v - v_gust, p - p_gust,
r - r_gust.

v and r are the vertical gust and its rotary part with 3 b instead of 4 b, and p is a first-order lag as the longitudinal
gust is: its scale length is 4 b/pi and its variance sigma_w^2/(b Lw) (pi^2/10) (pi Lw/(4 b))^(1/3).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from airtruth.physics import dryden
from airtruth.physics.dryden import DiscreteGust, Dryden

Array = NDArray[np.float64]

_ORDER: Final = ([1], [1, 0, 2])
"""Positions of v, and of v, p and r, in the outputs of the gust of equal form [-]."""


@dataclass(frozen=True)
class LateralDryden:
    """Lateral gusts of one flight condition.

    Attributes
    ----------
    sigma_v_m_s, sigma_w_m_s : standard deviations of v and of the vertical gust, which sets that of p [m/s].
    length_v_m, length_w_m : scale lengths Lv, Lw [m].
    airspeed_m_s : true airspeed V [m/s].
    span_m : span b [m]; None for no rotary gusts.
    """

    sigma_v_m_s: float
    sigma_w_m_s: float
    length_v_m: float
    length_w_m: float
    airspeed_m_s: float
    span_m: float | None = None


def roll_deviation_rad_s(sigma_w_m_s: float, length_w_m: float, span_m: float) -> float:
    """Standard deviation of p [rad/s], the root of the integral of Phi_p.

    Parameters
    ----------
    sigma_w_m_s : standard deviation of the vertical gust [m/s].
    length_w_m, span_m : scale length Lw and span b [m].
    """
    shape = 0.1 * math.pi**2 * (0.25 * math.pi * length_w_m / span_m) ** (1.0 / 3.0)
    return sigma_w_m_s * math.sqrt(shape / (span_m * length_w_m))


def discretise(gust: LateralDryden, dt_s: float) -> DiscreteGust:
    """Exact discrete model at a time step [s] for `airtruth.physics.dryden.simulate`; outputs v [m/s] and, with a span, p and
    r [rad/s].
    """
    model = dryden.discretise(_of_equal_form(gust), dt_s)
    return replace(model, output=model.output[_order(gust)])


def covariance(gust: LateralDryden, lag_s: ArrayLike) -> Array:
    """Analytic covariances E[y_i(t + lag) y_j(t)] of v and, with a span, p and r.

    Parameters
    ----------
    gust : the gusts.
    lag_s : (...) lags of either sign [s].

    Returns
    -------
    (..., m, m) [m2/s2], [m/s rad/s], [rad2/s2].
    """
    order = _order(gust)
    return dryden.covariance(_of_equal_form(gust), lag_s)[..., order, :][..., order]


def spectrum(gust: LateralDryden, omega_rad_s: ArrayLike) -> Array:
    """One-sided spectra; each integrates from 0 to infinity over omega to the variance.

    Parameters
    ----------
    gust : the gusts.
    omega_rad_s : (...) angular frequency [rad/s].

    Returns
    -------
    (..., m) for v [m2/s2 per rad/s] and, with a span, p and r [rad2/s2 per rad/s].
    """
    return dryden.spectrum(_of_equal_form(gust), omega_rad_s)[..., _order(gust)]


def _order(gust: LateralDryden) -> list[int]:
    return _ORDER[gust.span_m is not None]


def _of_equal_form(gust: LateralDryden) -> Dryden:
    """The gusts along the flight path and downward whose u is p, w is v and q is r; without a span u is no gust."""
    v, span = gust.airspeed_m_s, gust.span_m
    if span is None:
        return Dryden(0.0, gust.sigma_v_m_s, gust.length_v_m, gust.length_v_m, v)
    sigma_p = roll_deviation_rad_s(gust.sigma_w_m_s, gust.length_w_m, span)
    return Dryden(sigma_p, gust.sigma_v_m_s, 4.0 * span / math.pi, gust.length_v_m, v, 0.75 * span)


__all__ = [
    "LateralDryden",
    "covariance",
    "discretise",
    "roll_deviation_rad_s",
    "spectrum",
]
