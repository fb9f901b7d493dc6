"""The lead in log-posterior by which one finished search replaces another."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from airtruth.tracing.selection.explanation import AS_PROBABLE
from airtruth.tracing.selection.significance import BEYOND_DOUBT, REMAINS

STRONG_ODDS: Final = float(np.log(AS_PROBABLE))
"""Log-posterior, negative, by which a set of fewer effects may be behind."""
KINEMATIC_ODDS: Final = -5.0
"""Log-posterior by which a set that explains the kinematics may be behind one that does not [-] (judgement: odds of 150, from
the level of 0.005 of one comparison of the kinematic check; measured, the check of six records excluded the true cause in 6 of
100 flights, odds of 16)."""
CLEAN: Final = 0.05
"""Probability of the remaining anomaly from which a search explains the records, so that no tied effect is tried
instead [-] (convention)."""


@dataclass(frozen=True)
class Outcome:
    """A finished search.

    Attributes
    ----------
    effects : number of effects that it names.
    p_value : of the remaining anomaly [-].
    agrees : whether it accepts all errors of a set that explains the kinematics of the records; true where none is known.
    """

    effects: int
    p_value: float
    agrees: bool

    @property
    def is_misfit(self) -> bool:
        """Whether it leaves an anomaly beyond doubt."""
        return self.p_value < BEYOND_DOUBT


def required_lead(old: Outcome, new: Outcome, lead: float) -> float:
    """Log-posterior by which a new search has to lead the old one; negative where it may be behind, infinite where it is refused.

    A simpler set wins unless the odds against it are strong; a set of as many effects wins without a lead if it alone leaves no
    anomaly. The kinematics need no aerodynamics. Where both searches leave an anomaly beyond doubt, the aerodynamics are wrong,
    and the kinematics tell errors of sensors better than the filter: a search that agrees with them does not give way to another
    one.

    Parameters
    ----------
    lead : what a search of any other kind needs.
    """
    if old.is_misfit and new.is_misfit and old.agrees != new.agrees:
        return KINEMATIC_ODDS if new.agrees else np.inf
    if new.effects < old.effects:
        return STRONG_ODDS
    return 0.0 if new.p_value > CLEAN and old.p_value < REMAINS else lead


__all__ = ["CLEAN", "STRONG_ODDS", "Outcome", "required_lead"]
