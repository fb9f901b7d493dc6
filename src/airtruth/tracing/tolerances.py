"""Free runs against the tolerances for the short period of a training simulator (`airtruth.physics.proof_of_match`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airtruth.physics.proof_of_match import NORMAL_M_S2, PITCH_RAD, RATE_RAD_S, SOURCE, pitch_change
from airtruth.tracing.inference.assess import Assessment
from airtruth.tracing.inference.posterior import TraceProblem
from airtruth.tracing.model.compile import CHANNELS
from airtruth.tracing.stage_errors import BySet, Excursions, Tolerances
from airtruth.tracing.stages import Stages

Array = NDArray[np.float64]

_Q, _AZ = CHANNELS.index("q_rad_s"), CHANNELS.index("az_m_s2")


@dataclass(frozen=True)
class Excursion:
    """Largest distances of one free run from its record.

    Attributes
    ----------
    pitch_rad : distance in pitch angle, the integral of the distance in pitch rate [rad].
    rate_rad_s, normal_m_s2 : distances in pitch rate [rad/s] and az [m/s2].
    share : share of the samples at which pitch or rate, and az, are inside [-].
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
    """Largest residuals of a free run, and the share of its samples inside the tolerances.

    Parameters
    ----------
    residual : (samples, 3), channels as in `CHANNELS`.
    dt_s : sample period [s].
    """
    q, az = residual[:, _Q], residual[:, _AZ]
    pitch = pitch_change(q, dt_s * np.arange(len(q), dtype=np.float64))
    motion = (np.abs(pitch) <= PITCH_RAD) | (np.abs(q) <= RATE_RAD_S)
    inside = motion & (np.abs(az) <= NORMAL_M_S2)
    return Excursion(
        pitch_rad=float(np.abs(pitch).max()),
        rate_rad_s=float(np.abs(q).max()),
        normal_m_s2=float(np.abs(az).max()),
        share=float(inside.mean()),
    )


def tolerances(stages: Stages) -> Tolerances:
    """Compare the free runs of every stage with the tolerances."""
    found = {}
    for name, assessed in stages.fitted.items():
        held = _compare(stages.held[name], stages.case.held) if stages.case.held is not None else None
        found[name] = BySet(_compare(assessed, stages.case.fitted), held)
    limits = {"pitch_rad": PITCH_RAD, "q_rad_s": RATE_RAD_S, "az_m_s2": NORMAL_M_S2}
    return Tolerances(SOURCE, limits, found)


def _compare(assessed: Sequence[Assessment], problem: TraceProblem) -> Excursions:
    pairs = zip(assessed, problem.records, strict=True)
    found = [excursion(a.residual, record.signals.dt_s) for a, record in pairs]
    return Excursions(
        pitch_rad=max(e.pitch_rad for e in found),
        q_rad_s=max(e.rate_rad_s for e in found),
        az_m_s2=max(e.normal_m_s2 for e in found),
        share_inside=float(np.mean([e.share for e in found])),
        records_within=sum(e.within for e in found),
        records=len(found),
    )


__all__ = ["Excursion", "excursion", "tolerances"]
