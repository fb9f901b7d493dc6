"""Error of the six derivatives where the air sees the elevator later than the record states it.

Least squares on the linear short period: the motion is that of a late elevator, the regressor is the elevator as recorded.
The input is a 3-2-1-1 whose step is a quarter of the period. Other estimators weigh the record differently, and err by
a similar amount.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lsim

from airtruth.errors import ConfigurationError
from airtruth.physics.short_period import Scale, modal, normal_force_row, system

Array = NDArray[np.float64]

_SAMPLES: Final = 4000
"""Samples of the record [-] (judgement: the regression is exact to four digits)."""
_STEPS: Final = ((3, 1.0), (2, -1.0), (1, 1.0), (1, -1.0))
"""A 3-2-1-1: lengths in steps, and signs."""
_LENGTH: Final = 16.0
"""Length of the record in steps of the input [-]: the input and as much of the free motion."""


def shift_of_a_delay(theta: Array, s: Scale, delay_s: float) -> Array:
    """(6,) estimates of least squares less the true derivatives, for an elevator that is late [-].

    Parameters
    ----------
    theta : (6,) derivatives of a stable short period [-].
    s : factors of the linear model.
    delay_s : delay of the surface that the record does not show [s].

    Raises
    ------
    ConfigurationError
        If the short period does not oscillate about the trim.
    """
    wn = float(modal(theta, s)[0])
    if not np.isfinite(wn):
        raise ConfigurationError(
            "the derivatives give no stable short period, so the effect of a late elevator on them is not known; "
            "state --late-ms 0, or identify a log again"
        )
    step = 0.5 * np.pi / wn
    t = np.linspace(0.0, _LENGTH * step, _SAMPLES)
    recorded, late = (_input(t - shift, step) for shift in (0.0, delay_s))
    a, b = system(theta, s)
    _, motion, _ = lsim((a, b[:, None], np.eye(2), np.zeros((2, 1))), late, t, interp=False)
    regressors = np.column_stack([motion[:, 0], s.half_chord_time * motion[:, 1], recorded])
    turning = (motion @ a[1] + b[1] * late) / s.moment
    row = normal_force_row(theta, s)
    lift = -(motion @ row[:2] + row[2] * late) / s.normal
    found = np.linalg.lstsq(regressors, np.column_stack([lift, turning]), rcond=None)[0]
    return np.asarray(found.T.ravel() - theta)


def _input(t: Array, step: float) -> Array:
    """3-2-1-1 of one radian, from one step on."""
    made, start = np.zeros_like(t), step
    for count, sign in _STEPS:
        made[(t >= start) & (t < start + count * step)] = sign
        start += count * step
    return made


__all__ = ["shift_of_a_delay"]
