"""The lag of the vane that a friction of the vane imitates in gusts."""

from __future__ import annotations

from typing import Final

import numpy as np

from airtruth.effects.registry import EFFECTS
from airtruth.physics.motion import VANES
from airtruth.tracing.anomalies.omnibus import views
from airtruth.tracing.inference.posterior import PosteriorFit, TraceProblem
from airtruth.units import DEG

PLAUSIBLE_RAD: Final = 0.1 * DEG
"""Half width of the play of a plausible vane with friction [rad] (judgement: a dry bearing or a potentiometer)."""


def is_late_vane(key: str) -> bool:
    """Whether an effect of the library makes the vane late, by a time [s]."""
    return key in EFFECTS and EFFECTS[key].late_signal in VANES


def imitated_lag_s(problem: TraceProblem, fitted: PosteriorFit) -> float:
    """Lag of the vane [s] nearest to a friction of the half width `PLAUSIBLE_RAD`; 0 where a calm record shows the difference.

    While its angle a moves, a vane with friction reads a - w sgn(a'), one with a lag a - T a'. The mean square of the
    difference is least for T = w E|a'| / E a'^2. Gusts keep the vane moving, so that it does not
    show where it sticks.

    Source: equivalent linearisation, A. Gelb and W. E. Vander Velde, Multiple-Input Describing Functions, 1968, section 1.5.

    Parameters
    ----------
    problem, fitted : records, and a fit of them; the motion is the one that the filter predicts.
    """
    airspeed_m_s = np.array([r.signals.airspeed_m_s.mean() for r in problem.records])
    gust_rad = np.exp(fitted.point.per_record[:, problem.layout.per_record.log_gust]) / airspeed_m_s
    if gust_rad.min() <= PLAUSIBLE_RAD:
        return 0.0
    rate_rad_s = np.concatenate([np.diff(v.flow_rad) / v.dt_s for v in views(fitted, problem)])
    return float(PLAUSIBLE_RAD * np.abs(rate_rad_s).mean() / np.square(rate_rad_s).mean())


__all__ = ["PLAUSIBLE_RAD", "imitated_lag_s", "is_late_vane"]
