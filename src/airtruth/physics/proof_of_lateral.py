"""Dutch roll, spiral and steady sideslip of the linear lateral model against the tolerances of a training simulator.

Source: 14 CFR Part 60, Appendix A, Table A2A: tests 2.d.4 (spiral stability), 2.d.7 (Dutch roll, yaw damper off) and 2.d.8
(steady sideslip). The model is that of `airtruth.physics.lateral`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.physics.lateral import LateralScale, lateral_modes, lateral_system
from airtruth.physics.motion import LATERAL
from airtruth.physics.proof_of_match import Tolerance
from airtruth.units import DEG, G0

Array = NDArray[np.float64]

SPIRAL_S: Final = 20.0
"""Time after which the bank of a spiral is compared [s]; source: test 2.d.4."""
BANK_RAD: Final = 30.0 * DEG
"""Bank from which the spiral starts [rad] (judgement: that of a usual turn)."""
RUDDER_RAD: Final = 5.0 * DEG
"""Rudder of the steady sideslip [rad] (judgement: small enough for a linear model)."""
TOLERANCES: Final[Mapping[str, Tolerance]] = MappingProxyType(
    {
        "dutch_roll_period_s": Tolerance(0.5, 0.10),
        "dutch_roll_damping": Tolerance(0.02),
        "dutch_roll_half_s": Tolerance(0.0, 0.10),
        "dutch_roll_peaks_s": Tolerance(1.0, 0.20),
        "spiral_bank_rad": Tolerance(2.0 * DEG, 0.10),
        "sideslip_bank_rad": Tolerance(2.0 * DEG),
        "sideslip_angle_rad": Tolerance(1.0 * DEG),
        "sideslip_control_rad": Tolerance(2.0 * DEG, 0.10),
    }
)
"""Field of `LateralProof` -> its tolerance. Damping ratio or time to half amplitude is enough; source: the tests."""


@dataclass(frozen=True)
class LateralProof:
    """Values that the tests of the lateral modes compare; NaN where the motion has no such root or state.

    Attributes
    ----------
    dutch_roll_period_s : period of the damped oscillation [s].
    dutch_roll_damping : damping ratio [-].
    dutch_roll_half_s : time to half amplitude, of a divergent one to double amplitude [s].
    dutch_roll_peaks_s : time from a peak of sideslip to the next or last peak of bank, the nearer of them [s].
    spiral_bank_rad : bank `SPIRAL_S` after the spiral starts from `BANK_RAD` [rad].
    sideslip_bank_rad, sideslip_angle_rad, sideslip_control_rad : bank, sideslip and aileron of the steady straight sideslip at
        the rudder `RUDDER_RAD` [rad].
    """

    dutch_roll_period_s: float
    dutch_roll_damping: float
    dutch_roll_half_s: float
    dutch_roll_peaks_s: float
    spiral_bank_rad: float
    sideslip_bank_rad: float
    sideslip_angle_rad: float
    sideslip_control_rad: float

    def within(self, reference: LateralProof) -> dict[str, bool]:
        """Field -> whether it is within its tolerance of a reference; damping ratio and time to half hold together.

        A spiral needs the right trend besides: both banks grow, or both shrink.
        """
        found = {name: self._near(reference, name) for name in TOLERANCES}
        damped = found["dutch_roll_damping"] or found["dutch_roll_half_s"]
        found["dutch_roll_damping"] = found["dutch_roll_half_s"] = damped
        found["spiral_bank_rad"] &= (self.spiral_bank_rad > BANK_RAD) == (
            reference.spiral_bank_rad > BANK_RAD
        )
        return found

    def _near(self, reference: LateralProof, name: str) -> bool:
        own, wanted = getattr(self, name), getattr(reference, name)
        if math.isnan(own) or math.isnan(wanted):
            return math.isnan(own) and math.isnan(wanted)
        return bool(abs(own - wanted) <= TOLERANCES[name].allowed(np.array(wanted)))


def lateral_proof(theta: Array, s: LateralScale) -> LateralProof:
    """Evaluate the linear model of one flight condition.

    An oscillation Re(v exp(lambda t)) with lambda = -zeta wn + i wd has the period 2 pi/wd, halves in ln 2/(zeta wn), and the
    peaks of two states follow each other by the difference of the arguments of v over wd. The bank of a spiral is
    exp(lambda t) of its start. A steady straight sideslip has Cl = Cn = 0 and q_bar S CY + m g cos(theta) phi = 0.

    Parameters
    ----------
    theta : (15,) derivatives in the order of the motion [-].
    s : factors of the model, of one flight condition.
    """
    wn, zeta, _, spiral = (float(x) for x in lateral_modes(theta, s)[0])
    with np.errstate(all="ignore"):
        damped = wn * math.sqrt(max(1.0 - zeta**2, 0.0)) if math.isfinite(wn) else math.nan
        half = math.log(2.0) / abs(zeta * wn) if zeta * wn != 0.0 else math.inf
        bank = BANK_RAD * float(np.exp(SPIRAL_S * spiral))
    slip, control, rolled = _steady_sideslip(theta, s)
    return LateralProof(
        dutch_roll_period_s=math.tau / damped if damped > 0.0 else math.nan,
        dutch_roll_damping=zeta,
        dutch_roll_half_s=half,
        dutch_roll_peaks_s=_peaks_s(theta, s),
        spiral_bank_rad=bank,
        sideslip_bank_rad=rolled,
        sideslip_angle_rad=slip,
        sideslip_control_rad=control,
    )


def _peaks_s(theta: Array, s: LateralScale) -> float:
    """Time from a peak of sideslip to the nearest peak of bank in the Dutch roll [s]; NaN without an oscillation."""
    a = lateral_system(theta, s).a
    if not np.isfinite(a).all():
        return math.nan
    roots, vectors = np.linalg.eig(a)
    pairs = np.flatnonzero(roots.imag > 0.0)
    if not pairs.size:
        return math.nan
    k = pairs[np.argmax(np.abs(roots[pairs]))]
    states = [state.name for state in LATERAL.states]
    slip, bank = (vectors[states.index(name), k] for name in ("beta", "phi"))
    return float(np.angle(slip / bank) / roots[k].imag)


def _steady_sideslip(theta: Array, s: LateralScale) -> tuple[float, float, float]:
    """Sideslip, aileron and bank [rad] at `RUDDER_RAD`; NaN where the equations have no solution."""
    table = np.asarray(theta).reshape(LATERAL.shape)
    column = [signal.name for signal in LATERAL.signals].index
    roll, yaw = (column(control.name) for control in LATERAL.controls)
    weight = G0 * math.cos(float(s.theta_rad)) / float(s.force)
    matrix = np.column_stack([table[:, column("beta")], table[:, roll], [weight, 0.0, 0.0]])
    try:
        slip, control, bank = np.linalg.solve(matrix, -RUDDER_RAD * table[:, yaw])
    except np.linalg.LinAlgError:
        return math.nan, math.nan, math.nan
    return float(slip), float(control), float(bank)


__all__ = ["BANK_RAD", "RUDDER_RAD", "SPIRAL_S", "TOLERANCES", "LateralProof", "lateral_proof"]
