"""Motions of pitch that an elevator causes, and know nothing of gusts and noise."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.checks.samples import integral, lagged
from airtruth.numerics.prefilter import butterworth, zero_phase
from airtruth.numerics.recursion import low_pass
from airtruth.numerics.srivc import simulate, srivc

Array = NDArray[np.float64]

CUTOFF_HZ: Final = 5.0
"""Cutoff of the low-pass that smooths a measured surface [Hz], lowered for slow records: judgement."""
_LAGS: Final = (0.3, 1.0, 3.0)
"""Time constants of the low-passes of the simulated pitch rate, over the period of the motion per radian [-]."""
_BANK_HZ: Final = (0.1, 0.2, 0.4, 0.8, 1.6, 3.2)
"""Corner frequencies of the low-passes of the elevator where no model is identified [Hz]: judgement, an octave
apart."""


def smoothing(dt_s: float) -> Array:
    """Sections of the low-pass at `CUTOFF_HZ` of a measured surface."""
    return butterworth(min(CUTOFF_HZ, 0.2 / dt_s), 4, dt_s)


def smoothed_surface(surface_rad: Array, dt_s: float) -> Array:
    """(samples,) a measured surface without the noise above `CUTOFF_HZ`, less its first value."""
    smooth = zero_phase(surface_rad[None], smoothing(dt_s))
    return np.asarray((smooth - smooth[:, :1])[0])


def pitch_motions(elevator_rad: Array, q_rad_s: Array, dt_s: float) -> Array:
    """(k, samples) motions that an elevator causes.

    From the second-order transfer function of elevator to pitch rate that fits the record (SRIVC): simulated q, q',
    its integral and lags of that; the elevator. Where none fits, the elevator through a bank of low-passes.

    Parameters
    ----------
    elevator_rad, q_rad_s : (samples,) [rad], [rad/s].
    dt_s : sample period [s].
    """
    dt = dt_s
    elevator = (elevator_rad - elevator_rad[0])[None]
    smooth = smoothed_surface(elevator_rad, dt)
    model = srivc(elevator, q_rad_s[None], dt, 2, 2, 3.0, "foh")
    if not np.isfinite(model.a).all():
        rows = [smooth]
        for corner in _BANK_HZ:
            rows.append(low_pass(float(np.exp(-2.0 * np.pi * corner * dt)), smooth))
        return np.array(rows)
    q = simulate(model, elevator, dt, "foh")[0]
    unit = 1.0 / np.sqrt(max(float(model.a[0, 1]), 1e-6))
    once = integral(q, dt)
    rows = [q, np.gradient(q, dt), once, smooth]
    rows += [lagged(once, dt, share * unit) for share in _LAGS]
    return np.array(rows)


__all__ = ["pitch_motions", "smoothed_surface", "smoothing"]
