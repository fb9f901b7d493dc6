"""Free runs against the tolerances that a training simulator's short period has to keep.

Source: 14 CFR Part 60, Appendix A, Table A2A, test 2.c.10 (short-period dynamics): 1.5 deg pitch angle or
2 deg/s pitch rate, and 0.10 g normal acceleration.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from airtruth.trace.answer import Outcome
from airtruth.trace.holdout import Assessment
from airtruth.trace.lower import CHANNELS
from airtruth.trace.prepare import Case
from airtruth.units import DEG, G0

Array = NDArray[np.float64]

SOURCE: Final = "14 CFR Part 60, Appendix A, Table A2A, test 2.c.10"
PITCH_RAD: Final = 1.5 * DEG
RATE_RAD_S: Final = 2.0 * DEG
NORMAL_M_S2: Final = 0.10 * G0
_Q, _AZ = CHANNELS.index("q_rad_s"), CHANNELS.index("az_m_s2")


@dataclass(frozen=True)
class Excursion:
    """Largest distances of one free run from its record.

    Attributes
    ----------
    pitch_rad : of the pitch angle, counted from the start: the integral of the pitch rate's.
    rate_rad_s, normal_m_s2 : of pitch rate and az.
    share : of the samples at which pitch or rate, and az, are inside [-].
    """

    pitch_rad: float
    rate_rad_s: float
    normal_m_s2: float
    share: float

    @property
    def within(self) -> bool:
        """Whether pitch throughout or rate throughout, and az throughout, are inside."""
        motion = self.pitch_rad <= PITCH_RAD or self.rate_rad_s <= RATE_RAD_S
        return motion and self.normal_m_s2 <= NORMAL_M_S2


def excursion(residual: Array, dt_s: float) -> Excursion:
    """Judge the residuals (samples, 3) of a free run, channels as in `CHANNELS`, sampled every ``dt_s`` [s]."""
    q, az = residual[:, _Q], residual[:, _AZ]
    pitch = np.concatenate([[0.0], np.cumsum(0.5 * dt_s * (q[1:] + q[:-1]))])
    motion = (np.abs(pitch) <= PITCH_RAD) | (np.abs(q) <= RATE_RAD_S)
    inside = motion & (np.abs(az) <= NORMAL_M_S2)
    return Excursion(
        pitch_rad=float(np.abs(pitch).max()),
        rate_rad_s=float(np.abs(q).max()),
        normal_m_s2=float(np.abs(az).max()),
        share=float(inside.mean()),
    )


def tolerances(case: Case, outcome: Outcome) -> dict[str, Any]:
    """Every stage's free runs against the tolerances, for the answer.

    Returns
    -------
    "source"; "limits"; stage -> "fit", "held_out" -> the largest of each quantity over the records, the mean
    share of samples inside, and the number of records within out of all.
    """
    rows: dict[str, Any] = {
        "source": SOURCE,
        "limits": {"pitch_rad": PITCH_RAD, "q_rad_s": RATE_RAD_S, "az_m_s2": NORMAL_M_S2},
    }
    for name, assessed in outcome.fitted.items():
        rows[name] = {"fit": _judged(assessed, [r.signals.dt_s for r in case.fitted.records])}
    if case.held is not None:
        times = [r.signals.dt_s for r in case.held.records]
        for name, assessed in outcome.held.items():
            rows[name]["held_out"] = _judged(assessed, times)
    return rows


def _judged(assessed: Sequence[Assessment], dt_s: Sequence[float]) -> dict[str, Any]:
    found = [excursion(a.residual, dt) for a, dt in zip(assessed, dt_s, strict=True)]
    return {
        "pitch_rad": max(f.pitch_rad for f in found),
        "q_rad_s": max(f.rate_rad_s for f in found),
        "az_m_s2": max(f.normal_m_s2 for f in found),
        "share_inside": float(np.mean([f.share for f in found])),
        "records_within": sum(f.within for f in found),
        "records": len(found),
    }


__all__ = ["NORMAL_M_S2", "PITCH_RAD", "RATE_RAD_S", "SOURCE", "Excursion", "excursion", "tolerances"]
