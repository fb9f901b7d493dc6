"""States of a gust: Dryden's filter, the gust that reaches the tail late, and low-passed copies for the rolloff.

Source: MIL-F-8785C, 3.7.1.1 and 3.7.1.2.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.numerics.compiled import inner, shared
from airtruth.tracing.model.kernel_input import GustModel
from airtruth.tracing.model.parameters import GUST_1, LEAD, LEAD_COUNT

Array = NDArray[np.float64]

_W1: Final = math.sqrt(1.5)
"""Gain of the first state of MIL-F-8785C's vertical Dryden filter, states of unit drive [-]."""
_W2: Final = math.sqrt(1.5) * (1.0 / math.sqrt(3.0) - 1.0)
"""Gain of its second state [-]."""
_LEAD_RAD_S: Final = (2.1, 21.0, 217.0)
"""Corners of the rolloff [rad/s]. Fitted here: with `_LEAD_GAIN` they turn Dryden's spectrum into von Karman's, both
of 840 m at 43 m/s, within 6 % (rms 2 %) from 0.5 to 600 rad/s, the level left free. In this band both spectra are
powers of the frequency, so that the corners serve any speed and length; a record of seconds shows little below it."""
_LEAD_GAIN: Final = (0.58, 0.84, 1.39)
"""Gains at these corners [-]; fitted with them."""
_LEADS: Final = LEAD - GUST_1
"""Position of the first low-passed copy among the states of the gusts [-]."""


@shared
def gust_of(x: Array, first: int, rolloff: float) -> float:
    """Gust of two states of Dryden's filter, the first of them at ``first``, over the level of Dryden's part [-]."""
    lead = 0.0
    for i in range(LEAD_COUNT):
        lead += _LEAD_GAIN[i] * (x[first] - x[first + _LEADS + i])
    return float(_W1 * x[first] + _W2 * x[first + 1] + rolloff * lead)


@inner
def gust_rates(x: Array, first: int, v: float, late: float, gusts: GustModel, out: Array) -> None:
    """x' of the states of a gust, the first of them at ``first``."""
    a = v / gusts.length_m
    out[first] = -a * x[first]
    out[first + 1] = a * (x[first] - x[first + 1])
    out[first + 2] = late
    for i in range(LEAD_COUNT):
        out[first + _LEADS + i] = _LEAD_RAD_S[i] * (x[first] - x[first + _LEADS + i])


def lead_decay(dt_s: float, i: int) -> tuple[float, float]:
    """Decay of a low-passed copy over a time [s], and its mean over that time [-]."""
    r = _LEAD_RAD_S[i] * dt_s
    decay = math.exp(-r)
    return decay, (1.0 - decay) / r


__all__ = ["gust_of", "gust_rates", "lead_decay"]
