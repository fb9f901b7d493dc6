"""Feedback from the motion to a control surface: a damper, an autopilot or a pilot.

Innovations of a filter that is right are white and independent of what was measured before, in open and in closed loop, so
that the likelihood needs no such test. A free run is another matter: where a surface answers the gusts, the recorded
surface is correlated with them, and the free run of a false model may come closer to the record than that of the true one
(L. Ljung, System Identification, 2nd ed. (1999), section 13.4). The test is that of C. W. J. Granger, Econometrica 37 (1969)
424-438: the next deflection is regressed on its own past, and on the last innovations besides.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.special import fdtrc

Array = NDArray[np.float64]

_OWN_PAST: Final = 20
"""Number of earlier deflections [-] (judgement: two for each of the nine lines of a multisine, and the servo)."""
_INNOVATIONS: Final = 4
"""Number of innovations of each channel [-] (judgement: a damper acts within a few samples)."""
_OUTLIER: Final = 5.0
"""Residual over its robust standard deviation from which a sample is left out [-]: the step of a pilot."""
_LEAST_RAD: Final = 1e-7
"""Standard deviation of the deflection about its own past below which nothing but the command moves it [rad] (judgement: far
below the resolution of a sensor)."""
_LEVEL: Final = 1e-6
"""Probability below which a surface responds to the motion [-] (judgement: no verdict rests on the test alone)."""
_NORMAL: Final = 1.4826
"""Standard deviation over the median of the absolute deviation, of a normal distribution [-]."""


def responds_to_motion(controls_rad: Sequence[Array], whitened: Sequence[Array]) -> bool:
    """Whether a control of records responds to their innovations.

    Parameters
    ----------
    controls_rad : (controls, samples) of each record [rad].
    whitened : (samples, channels) innovations of each [-]; records with a NaN are left out.
    """
    return any(_responds(control, whitened) for control in zip(*controls_rad, strict=True))


def _responds(surface_rad: Sequence[Array], whitened: Sequence[Array]) -> bool:
    """Whether one control (samples,) of each record [rad] responds."""
    parts = [
        _regression(de - de.mean(), e)
        for de, e in zip(surface_rad, whitened, strict=True)
        if np.isfinite(e).all() and len(de) > _OWN_PAST + _INNOVATIONS
    ]
    if not parts:
        return False
    following, past, shocks = (np.concatenate(x) for x in zip(*parts, strict=True))
    shocks = shocks[:, np.ptp(shocks, axis=0) > 0.0]
    alone = _residual(past, following)
    scale = _NORMAL * float(np.median(np.abs(alone)))
    usual = np.abs(alone) < _OUTLIER * scale
    freedom = int(usual.sum()) - past.shape[1] - shocks.shape[1]
    if scale < _LEAST_RAD or freedom < past.shape[1] or not shocks.size:
        return False
    before = _residual(past[usual], following[usual])
    after = _residual(np.hstack([past, shocks])[usual], following[usual])
    left = float(after @ after)
    ratio = (float(before @ before) - left) / shocks.shape[1] / (left / freedom)
    return bool(fdtrc(shocks.shape[1], freedom, ratio) < _LEVEL)


def _regression(de: Array, whitened: Array) -> tuple[Array, Array, Array]:
    """Next deflection (rows,), its past (rows, _OWN_PAST), and the last innovations (rows, channels * _INNOVATIONS)."""
    past = sliding_window_view(de[:-1], _OWN_PAST)
    last = sliding_window_view(whitened[_OWN_PAST - _INNOVATIONS : -1], _INNOVATIONS, axis=0)
    return de[_OWN_PAST:], past, last.reshape(len(past), -1)


def _residual(regressors: Array, y: Array) -> Array:
    return np.asarray(y - regressors @ np.linalg.lstsq(regressors, y, rcond=None)[0])


__all__ = ["responds_to_motion"]
