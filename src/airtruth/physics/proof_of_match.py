"""Tolerances for the short period of a training simulator.

Source: 14 CFR Part 60, Appendix A, Table A2A, test 2.c.10 (short-period dynamics): 1.5 deg pitch angle or
2 deg/s pitch rate, and 0.10 g normal acceleration.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.units import DEG, G0

SOURCE: Final = "14 CFR Part 60, Appendix A, Table A2A, test 2.c.10"
"""The regulation that states the tolerances."""
PITCH_RAD: Final = 1.5 * DEG
"""Tolerance of the pitch angle [rad]; source: `SOURCE`."""
RATE_RAD_S: Final = 2.0 * DEG
"""Tolerance of the pitch rate [rad/s]; source: `SOURCE`."""
NORMAL_M_S2: Final = 0.10 * G0
"""Tolerance of the normal acceleration [m/s2]; source: `SOURCE`."""
OF_CHANNEL: Final = {"q_rad_s": RATE_RAD_S, "az_m_s2": NORMAL_M_S2}
"""Channel -> its tolerance in SI; the pitch angle is the integral of q, and alpha has none."""


def pitch_change(rate_rad_s: NDArray[np.float64], t_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """(samples,) pitch angle less that of the first sample [rad]: integral of the pitch rate by the trapezoidal rule.

    Parameters
    ----------
    rate_rad_s : (samples,) pitch rate [rad/s].
    t_s : (samples,) time [s].

    Examples
    --------
    >>> pitch_change(np.array([0.0, 0.1, 0.1]), np.array([0.0, 1.0, 2.0])).round(6).tolist()
    [0.0, 0.05, 0.15]
    """
    steps = 0.5 * np.diff(t_s) * (rate_rad_s[1:] + rate_rad_s[:-1])
    return np.concatenate([[0.0], np.cumsum(steps)])


__all__ = ["NORMAL_M_S2", "OF_CHANNEL", "PITCH_RAD", "RATE_RAD_S", "SOURCE", "pitch_change"]
