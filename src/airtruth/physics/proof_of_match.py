"""Tolerances of a training simulator for the time histories of a motion.

Source: 14 CFR Part 60, Appendix A, Table A2A: test 2.c.10 (short-period dynamics): 1.5 deg pitch angle or 2 deg/s pitch rate,
and 0.10 g normal acceleration; tests 2.d.2 (roll response) and 2.d.6 (rudder response): 2 deg/s or 10 % of the rate.
`airtruth.physics.proof_of_lateral` has the tolerances of the modes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.physics.motion import LATERAL, LONGITUDINAL, Motion
from airtruth.units import DEG, G0

Array = NDArray[np.float64]

SOURCE: Final = "14 CFR Part 60, Appendix A, Table A2A, test 2.c.10"
"""The regulation that states the tolerances of the short period."""
PITCH_RAD: Final = 1.5 * DEG
"""Tolerance of the pitch angle [rad]; source: `SOURCE`."""
RATE_RAD_S: Final = 2.0 * DEG
"""Tolerance of the pitch rate [rad/s]; source: `SOURCE`."""
NORMAL_M_S2: Final = 0.10 * G0
"""Tolerance of the normal acceleration [m/s2]; source: `SOURCE`."""
PITCH: Final = "pitch_rad"
"""Name of the pitch angle, the integral of the pitch rate, among the quantities of a motion."""


@dataclass(frozen=True)
class Tolerance:
    """Largest allowed distance of a simulation from a measurement; the larger of the two counts.

    Attributes
    ----------
    absolute : in SI.
    relative : share of the measured value [-]; 0 for none.
    """

    absolute: float
    relative: float = 0.0

    def allowed(self, measured: Array) -> Array:
        """Largest allowed distance at each measured value, in SI.

        Examples
        --------
        >>> Tolerance(2.0, 0.1).allowed(np.array([0.0, 10.0, -40.0])).tolist()
        [2.0, 2.0, 4.0]
        """
        return np.maximum(self.absolute, self.relative * np.abs(measured))


_OF_RATE: Final = Tolerance(2.0 * DEG, 0.10)
"""Tolerance of the roll rate and of the yaw rate; source: tests 2.d.2 and 2.d.6."""


@dataclass(frozen=True)
class Proof:
    """Tolerances that a simulation of a motion has to keep.

    Attributes
    ----------
    source : regulation and tests.
    name : of the tests, in words.
    tolerances : channel of the motion -> its tolerance.
    pitch : tolerance of the pitch angle, which may hold in place of that of the pitch rate; None without one.
    """

    source: str
    name: str
    tolerances: Mapping[str, Tolerance]
    pitch: Tolerance | None = None


def _of(motion: Motion, **tolerances: Tolerance) -> dict[str, Tolerance]:
    """Channel of each output of some instruments -> the tolerance of the instrument."""
    return {o.channel: tolerances[o.instrument] for o in motion.outputs if o.instrument in tolerances}


PROOFS: Final[Mapping[str, Proof]] = MappingProxyType(
    {
        LONGITUDINAL.name: Proof(
            SOURCE,
            "short-period dynamics",
            _of(LONGITUDINAL, gyro=Tolerance(RATE_RAD_S), accelerometer=Tolerance(NORMAL_M_S2)),
            Tolerance(PITCH_RAD),
        ),
        LATERAL.name: Proof(
            "14 CFR Part 60, Appendix A, Table A2A, tests 2.d.2, 2.d.4, 2.d.6, 2.d.7 and 2.d.8",
            "roll and rudder response",
            _of(LATERAL, gyro=_OF_RATE),
        ),
    }
)
"""Name of a motion -> what a simulation of it has to match."""
OF_CHANNEL: Final[Mapping[str, Tolerance]] = MappingProxyType(
    {channel: own for proof in PROOFS.values() for channel, own in proof.tolerances.items()}
)
"""Channel -> its tolerance; the pitch angle is the integral of q, and alpha has none."""


def pitch_change(rate_rad_s: Array, t_s: Array) -> Array:
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


__all__ = [
    "NORMAL_M_S2",
    "OF_CHANNEL",
    "PITCH",
    "PITCH_RAD",
    "PROOFS",
    "RATE_RAD_S",
    "SOURCE",
    "Proof",
    "Tolerance",
    "pitch_change",
]
