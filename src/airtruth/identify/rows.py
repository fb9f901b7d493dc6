"""Rows of the regression: filtered instruments, regressors and observations of each run.

One array (runs, 10, samples) holds, per run, what eq. (4) of M. Brunot, "An Instrumental Variable
Approach for Aircraft Identification", is made of: Z and X share one form, so that three signals of each
are enough, whatever the equation:

    y_lift   = alpha_dot - q   = -(q_bar S/(m V)) (CLalpha alpha + (c/2V) CLq q + CLde de)    [rad/s]
    y_moment = q_dot           = (q_bar S c/Iyy) (Cmalpha alpha + (c/2V) Cmq q + Cmde de)     [rad/s2]
    y_normal = az              = -(q_bar S/(m g)) (CLalpha alpha + (c/2V) CLq q + CLde de)    [g]

TRIM is the column of the free intercept: the constant 1 after the same filter.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.physics.short_period import Scale
from airtruth.units import G0

Array = NDArray[np.float64]

Z_ALPHA: Final = 0
Z_Q: Final = 1
Z_DE: Final = 2
TRIM: Final = 3
X_ALPHA: Final = 4
X_Q: Final = 5
X_DE: Final = 6
Y_LIFT: Final = 7
Y_MOMENT: Final = 8
Y_NORMAL: Final = 9
COUNT: Final = 10


def row_factors(scale: Scale) -> Array:
    """Factors (runs, 4): of the equations lift, moment and normal (az in g), and c/(2V) [s] of q."""
    return np.stack(
        np.broadcast_arrays(-scale.lift, scale.moment, -scale.normal / G0, scale.half_chord_time), axis=-1
    ).astype(np.float64)


@njit(cache=True, fastmath={"reassoc", "contract", "nsz"})
def products(z: Array, x: Array, moments: Array) -> None:
    """Sums over samples of z (4, samples) against x (6, samples) and the last row of z, into (4, 7).

    Reassociation lets the sums run in vector registers; their order is the same for every run.
    """
    samples = z.shape[1]
    for i in range(4):
        m0 = m1 = m2 = m3 = m4 = m5 = m6 = 0.0
        for k in range(samples):
            v = z[i, k]
            m0 += v * x[0, k]
            m1 += v * x[1, k]
            m2 += v * x[2, k]
            m3 += v * x[3, k]
            m4 += v * x[4, k]
            m5 += v * x[5, k]
            m6 += v * z[3, k]
        moments[i, 0], moments[i, 1], moments[i, 2] = m0, m1, m2
        moments[i, 3], moments[i, 4], moments[i, 5] = m3, m4, m5
        moments[i, 6] = m6


@njit(cache=True)
def _moments(rows: Array, moments: Array) -> None:
    for r in range(rows.shape[0]):
        products(rows[r, :4], rows[r, 4:], moments[r])


def moments_of(rows: Array) -> Array:
    """Sums of products (runs, 4, 7): [Z | TRIM] against [X | Y | TRIM]."""
    moments = np.empty((rows.shape[0], 4, 7))
    _moments(rows, moments)
    return moments
