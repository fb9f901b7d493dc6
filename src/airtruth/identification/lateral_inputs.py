"""The lateral motion as a known input of the pitch plane, for records of both motions.

    alpha' = q - (p cos(alpha) + r sin(alpha)) tan(beta) + (g/V) cos(theta') - lift/(m V)
    Iyy q' = M + (Izz - Ixx) p r - Ixz (p^2 - r^2)

Source: V. Klein and E. A. Morelli, Aircraft System Identification, AIAA, 2006, 3.2.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.checks.rotation import alpha_coupling
from airtruth.checks.spectra import integral
from airtruth.identification.record_constants import stated_value
from airtruth.logs.flight_log import Batch
from airtruth.physics.motion import LATERAL, LONGITUDINAL

Array = NDArray[np.float64]

_LEAST: Final = 0.02
"""Pitch rate that the lateral motion causes, over that of the record, from which the motion is an input [-]; judgement: below it
the derivatives move by less than their standard errors in a record."""
ROLLS: Final = (
    "Warning: the lateral motion causes part of the pitch rate. Roll, yaw, sideslip and bank are known inputs. The forces "
    "that sideslip and the lateral surfaces cause in the pitch plane are left out and may bias the estimates; use records of "
    "the longitudinal motion alone, or `airtruth trace`, which has these forces of the JSBSim model"
)
"""Warning about records in which the lateral motion is an input."""
_Q, _P, _R = (s.channel for m in (LONGITUDINAL, LATERAL) for s in m.signals if s.length is not None)


def lateral_inputs(batch: Batch, constants: object) -> tuple[Array, Array]:
    """Parts of alpha' [rad/s] and q' [rad/s2] that the lateral motion causes, (runs, samples) each.

    Zero where the log lacks p, r or the sideslip, where the aircraft states no inertias, and in runs whose lateral motion causes
    less than `_LEAST` of the pitch rate.

    Parameters
    ----------
    batch : runs with alpha and q.
    constants : the aircraft; its inertias Iyy, Ixx, Izz and Ixz [kg m2].
    """
    c = batch.channels
    alpha, q = c[LONGITUDINAL.vane], c[_Q]
    nothing = np.zeros_like(alpha), np.zeros_like(alpha)
    ixx, iyy, izz, ixz = (
        stated_value(constants, f"inertia_{axes}_kg_m2") for axes in ("xx", "yy", "zz", "xz")
    )
    if not ({_P, _R, LATERAL.vane} <= set(c) and ixx > 0.0 and izz > 0.0):
        return nothing
    p, r = c[_P], c[_R]
    q_rate_rad_s2 = ((izz - ixx) * p * r - ixz * (p**2 - r**2)) / iyy
    alpha_rate_rad_s = alpha_coupling(p, r, alpha, c[LATERAL.vane])
    caused = integral(q_rate_rad_s2, batch.dt_s)
    # a constant moment is a trim: its integral is a trend
    time = np.linspace(-1.0, 1.0, q.shape[1])
    time /= np.linalg.norm(time)
    caused -= caused.mean(axis=1, keepdims=True)
    caused -= (caused @ time)[:, None] * time
    counts = (caused.std(axis=1) > _LEAST * q.std(axis=1))[:, None]
    return np.where(counts, alpha_rate_rad_s, 0.0), np.where(counts, q_rate_rad_s2, 0.0)


__all__ = ["ROLLS", "lateral_inputs"]
