"""Slots of a guess: what may fill each, its usual size, and how often its sign is the opposite one."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.channels import LATERAL, SIGNALS
from airtruth.checks.means import LIMITS, MEANS
from airtruth.physics.motion import LATERAL as MOTION
from airtruth.physics.motion import LONGITUDINAL, Motion

Array = NDArray[np.float64]

_CHANNEL: Final = {one.stem: name for name, one in SIGNALS.items()}
"""Slot -> channel of the log that fills it."""
_INSTEAD: Final[dict[str, tuple[str, ...]]] = {
    "airspeed": (
        "calibrated_airspeed_m_s",
        "equivalent_airspeed_m_s",
        "indicated_airspeed_m_s",
        "dynamic_pressure_pa",
    ),
    "altitude": ("static_pressure_pa", "height_m"),
    "ground_speed": ("ground_speed_m_s",),
    "gps_altitude": ("gps_altitude_m",),
}
"""Slot -> other quantities that may fill it, the best first."""


def _deflections(motion: Motion) -> tuple[str, ...]:
    """Slots of the control surfaces of a motion and of their commands."""
    return tuple(SIGNALS[name].stem for name in (*motion.surfaces, *motion.commands))


SLOTS: Final[dict[str, tuple[str, ...]]] = {
    slot: (*(name for name in (_CHANNEL.get(slot),) if name), *_INSTEAD.get(slot, ()))
    for slot in (
        "az", "q", "theta", "airspeed", "alpha", "ax", "elevator", "ground_speed", "gps_altitude", "altitude", "density",
        "elevator_command", "throttle",
    )
}  # fmt: skip
"""Slot of an assignment -> what may fill it, the best first."""
LATERAL_SLOTS: Final[dict[str, tuple[str, ...]]] = {
    slot: (_CHANNEL[slot],) for slot in ("p", "phi", "r", "psi", "ay", "beta", *_deflections(MOTION))
}
"""The same of the lateral-directional motion, which is assigned after the other one and never changes it."""
ALL_SLOTS: Final = {**SLOTS, **LATERAL_SLOTS}
"""Both."""
SLOT_OF: Final = {name: slot for slot, names in ALL_SLOTS.items() for name in names}
"""Channel -> its slot."""
SIZE: Final = {
    "airspeed": (40.0, 0.9), "alpha": (0.08, 0.9), "theta": (0.12, 1.1), "q": (0.2, 1.3), "az": (9.81, 0.15), "ax": (1.5, 1.1),
    "altitude": (800.0, 1.6), "density": (1.1, 0.25),
    "throttle": (0.5, 0.8), "ground_speed": (40.0, 0.9), "gps_altitude": (800.0, 1.6),
    "p": (0.3, 1.3), "phi": (0.3, 1.2), "r": (0.12, 1.3), "psi": (1.5, 1.2), "ay": (0.8, 1.2), "beta": (0.05, 1.0),
    **dict.fromkeys((*_deflections(LONGITUDINAL), *_deflections(MOTION)), (0.1, 1.1)),
    "rudder": (0.08, 1.1), "rudder_command": (0.08, 1.1),
}  # fmt: skip
"""Slot -> median and standard deviation of the logarithm of a usual size [SI] (judgement: from a 1 kg model to an airliner)."""
CENTRED: Final = frozenset({"airspeed", "az", "altitude", "density", "ground_speed", "gps_altitude"})
"""Slots whose size is that of the median; of the others it is the 95th percentile of the magnitude."""
SIGN: Final = {
    "az": 0.5,
    "ax": 0.04,
    "ay": 0.04,
    **dict.fromkeys(_deflections(LONGITUDINAL), 0.3),
    **dict.fromkeys(_deflections(MOTION), 0.5),
}
"""Slot -> probability of the sign opposite to the contract's (judgement)."""
OPPOSITE: Final = 0.02
"""The same of other angles and rates."""
SIGNED: Final = frozenset({"az", "ax", "q", "theta", "alpha", *_deflections(LONGITUDINAL), *LATERAL_SLOTS})
"""Slots that have a sign."""
OUTSIDE: Final = 20.0
"""Loss of a reading that leaves the range of flight (judgement)."""


def limits(channel: str) -> tuple[float, float, float, float]:
    """Range of the samples of a channel in flight, and of their mean [SI]."""
    lateral = SIGNALS[channel].limit if channel in LATERAL else float("inf")
    low, high = LIMITS.get(channel, (-lateral, lateral))
    least, most = MEANS.get(channel, (-float("inf"), float("inf")))
    return low, high, least, most


def size_of(slot: str, values: Array) -> float:
    """Logarithm of the density of a size over that of the usual one, and the loss of a reading outside the range of flight."""
    low, high, least, most = limits(ALL_SLOTS[slot][0])
    inner = np.quantile(values, [0.02, 0.98])
    loss = OUTSIDE * float(inner[0] < low or inner[1] > high or not least <= np.median(values) <= most)
    middle, spread = SIZE[slot]
    size = abs(float(np.median(values))) if slot in CENTRED else float(np.quantile(np.abs(values), 0.95))
    return -0.5 * (np.log(max(size, 1e-9) / middle) / spread) ** 2 - loss if size > 0.0 else -loss
