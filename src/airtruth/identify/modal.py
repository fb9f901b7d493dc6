"""Natural frequency and damping ratio with their uncertainty, to first order in the derivatives."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from airtruth.physics.short_period import Scale, modal, system

Array = NDArray[np.float64]


def modal_jacobian(theta: Array, s: Scale) -> Array:
    """d(wn, zeta)/d theta, (..., 2, 6): wn^2 = det A and 2 zeta wn = -tr A of eq. (2).

    Source of A: M. Brunot, "An Instrumental Variable Approach for Aircraft Identification", eq. (2).
    The elevator derivatives do not enter. NaN where det A is not positive.
    """
    a, _ = system(theta, s)
    wn, zeta = modal(theta, s)
    h = s.half_chord_time
    zero = np.zeros_like(wn)
    # dA/dtheta: each of the four derivatives enters one element of A
    trace = np.stack([-s.lift + zero, zero, zero, zero, s.moment * h + zero, zero], axis=-1)
    det = np.stack(
        [
            -s.lift * a[..., 1, 1],
            s.lift * h * a[..., 1, 0],
            zero,
            -a[..., 0, 1] * s.moment,
            a[..., 0, 0] * s.moment * h,
            zero,
        ],
        axis=-1,
    )
    d_wn = det / (2.0 * wn)[..., None]
    d_zeta = -trace / (2.0 * wn)[..., None] - (zeta / wn)[..., None] * d_wn
    return np.stack([d_wn, d_zeta], axis=-2)


def modal_with_covariance(theta: Array, covariance: Array, s: Scale) -> tuple[Array, Array]:
    """wn [rad/s] and zeta [-], (..., 2), and their covariance (..., 2, 2), by the delta method."""
    jacobian = modal_jacobian(theta, s)
    return np.stack(modal(theta, s), axis=-1), jacobian @ covariance @ np.swapaxes(jacobian, -1, -2)
