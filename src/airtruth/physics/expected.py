"""Expected derivatives of ordinary aircraft, by the motion: sizes, meanings, and signs that physics requires.

Source of the signs: B. Etkin and L. D. Reid, *Dynamics of Flight*, 3rd ed., 1996, chapters 2, 3 and 5.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from airtruth.physics.motion import LATERAL, LONGITUDINAL


@dataclass(frozen=True)
class Expected:
    """Expectations on the derivatives of a motion.

    Attributes
    ----------
    sizes : magnitudes of the derivatives of ordinary aircraft [-]: judgement.
    terms : physical meaning of each derivative.
    signs : sign of a derivative, and what the other one is.
    stiffness : that one of `signs` which has the other sign in an unstable aircraft; empty for none.
    by_interval : whether a derivative counts as undetermined where its interval contains zero; otherwise where its standard
        deviation exceeds its size.
    modal : what the absence of the modal parameters means.
    """

    sizes: Mapping[str, float]
    terms: Mapping[str, str]
    signs: Mapping[str, tuple[float, str]]
    by_interval: bool
    modal: str
    stiffness: str = ""


_LONGITUDINAL: Final = Expected(
    sizes={"CLalpha": 5.0, "CLq": 30.0, "CLde": 1.0, "Cmalpha": 1.0, "Cmq": 30.0, "Cmde": 1.5},
    terms={
        "CLalpha": "lift by angle of attack",
        "CLq": "lift by pitch rate",
        "CLde": "lift of the elevator",
        "Cmalpha": "pitch stiffness",
        "Cmq": "pitch damping",
        "Cmde": "moment of the elevator",
    },
    # a canard is declared with the sign of its deflection turned; CLq is small and of either sign without a tail
    signs={
        "CLalpha": (1.0, "lift slope of the wrong sign, which no aircraft has below the stall"),
        "CLde": (1.0, "lift of the elevator of the wrong sign, which no elevator behind the CG has"),
        "Cmalpha": (-1.0, "pitch stiffness of the wrong sign, which no stable aircraft has"),
        "Cmq": (-1.0, "pitch damping of the wrong sign, which no tail gives"),
        "Cmde": (-1.0, "moment of the elevator of the wrong sign, which no elevator behind the CG has"),
    },
    by_interval=False,
    modal="the short period is not an oscillation about a stable trim (its stiffness is negative)",
    stiffness="Cmalpha",
)
"""Expectations on the short period."""
_LATERAL: Final = Expected(
    sizes={
        "CYbeta": 0.7,
        "CYp": 0.2,
        "CYr": 0.4,
        "CYda": 0.05,
        "CYdr": 0.2,
        "Clbeta": 0.1,
        "Clp": 0.4,
        "Clr": 0.15,
        "Clda": 0.15,
        "Cldr": 0.02,
        "Cnbeta": 0.1,
        "Cnp": 0.06,
        "Cnr": 0.15,
        "Cnda": 0.01,
        "Cndr": 0.1,
    },
    terms={
        "CYbeta": "side force by sideslip",
        "CYp": "side force by roll rate",
        "CYr": "side force by yaw rate",
        "CYda": "side force of the ailerons",
        "CYdr": "side force of the rudder",
        "Clbeta": "dihedral effect",
        "Clp": "roll damping",
        "Clr": "roll by yaw rate",
        "Clda": "roll of the ailerons",
        "Cldr": "roll of the rudder",
        "Cnbeta": "weathercock stability",
        "Cnp": "yaw by roll rate",
        "Cnr": "yaw damping",
        "Cnda": "adverse yaw",
        "Cndr": "yaw of the rudder",
    },
    signs={
        "CYbeta": (-1.0, "side force by sideslip of the wrong sign, which no body has"),
        "Clp": (-1.0, "roll damping of the wrong sign, which no wing has below the stall"),
        "Clda": (-1.0, "roll of the ailerons of the wrong sign"),
        "Cndr": (-1.0, "yaw of the rudder of the wrong sign, which no rudder behind the CG has"),
    },
    by_interval=True,
    modal="the motion has no Dutch roll with two real roots beside it",
)
"""Expectations on the lateral-directional motion."""
EXPECTED: Final[Mapping[str, Expected]] = {LONGITUDINAL.name: _LONGITUDINAL, LATERAL.name: _LATERAL}
"""Expectations by the name of the motion."""

__all__ = ["EXPECTED", "Expected"]
