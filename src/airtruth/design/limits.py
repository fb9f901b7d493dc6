"""Limits of a planned input: what the elevator and the aircraft may reach in the flight."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import ConfigurationError
from airtruth.physics.motion import LONGITUDINAL
from airtruth.units import DEG, G0

Array = NDArray[np.float64]

LEAST_LENGTH_S: Final = 1.0
"""Shortest input that is planned [s] (judgement: a short period of a small aircraft)."""
MOST_LENGTH_S: Final = 60.0
"""Longest input that is planned [s] (judgement: the search flies it some hundred times)."""
_WORDS: Final[Mapping[str, tuple[str, str, float]]] = {
    "amplitude_rad": ("the largest deviation of the elevator", "deg", DEG),
    "rate_rad_s": ("the largest rate of the surface", "deg/s", DEG),
    "alpha_rad": ("the largest deviation of the angle of attack", "deg", DEG),
    "airspeed": ("the largest change of the airspeed", "%", 0.01),
}
"""Limit -> words, the unit of its option, and the size of that unit [SI]."""


@dataclass(frozen=True)
class Limits:
    """Limits of an input and of the motion that it causes.

    Attributes
    ----------
    amplitude_rad : largest deviation of the elevator from its trim [rad].
    rate_rad_s : largest rate of the surface [rad/s].
    alpha_rad : largest deviation of the angle of attack from its trim [rad].
    load_factor : lowest and highest normal load factor [-].
    length_s : length of the input [s].
    airspeed : largest change of the airspeed over that of the trim [-]; the tracer's tables are those of one speed.
    """

    amplitude_rad: float = 2.0 * DEG
    rate_rad_s: float = math.inf
    alpha_rad: float = 6.0 * DEG
    load_factor: tuple[float, float] = (0.0, 2.0)
    length_s: float = 8.0
    airspeed: float = 0.1

    def __post_init__(self) -> None:
        """Refuse limits that no flight keeps.

        Raises
        ------
        ConfigurationError
            Naming the limit, its value and what is allowed.
        """
        for name, (words, unit, size) in _WORDS.items():
            value = getattr(self, name)
            if not value > 0.0 or (math.isinf(value) and name != "rate_rad_s"):
                raise ConfigurationError(
                    f"plan: {words} ({name}) is {value / size:g} {unit}; state a finite value above 0"
                )
        low, high = self.load_factor
        if not low < 1.0 < high or math.isinf(low) or math.isinf(high):
            raise ConfigurationError(
                f"plan: load factors of {low:g} to {high:g}; state a finite LOW below 1 and a finite HIGH above 1, which is "
                "steady flight"
            )
        if not LEAST_LENGTH_S <= self.length_s <= MOST_LENGTH_S:
            raise ConfigurationError(
                f"plan: an input of {self.length_s:g} s; allowed are {LEAST_LENGTH_S:g} to {MOST_LENGTH_S:g} s"
            )

    @property
    def rise_s(self) -> float:
        """Time in which the elevator moves from one end of its range to the other [s]."""
        return 2.0 * self.amplitude_rad / self.rate_rad_s

    def to_dict(self) -> dict[str, Any]:
        """The limits; a rate without limit is None."""
        return asdict(self) | {"rate_rad_s": self.rate_rad_s if math.isfinite(self.rate_rad_s) else None}


@dataclass(frozen=True)
class Extremes:
    """Extreme values of a flight.

    Attributes
    ----------
    elevator_rad, alpha_rad : largest deviations from the trim [rad].
    rate_rad_s : largest rate of the surface between two samples of the log [rad/s].
    load_factor : lowest and highest normal load factor [-].
    airspeed : largest change of the airspeed over that of the trim [-].
    """

    elevator_rad: float
    rate_rad_s: float
    alpha_rad: float
    load_factor: tuple[float, float]
    airspeed: float

    def share(self, limits: Limits) -> float:
        """Largest share of a limit that is used [-]; above 1 a limit is exceeded.

        The deviation of the load factor from 1 is compared with that of the limit on the same side.
        """
        low, high = self.load_factor
        least, most = limits.load_factor
        return max(
            self.elevator_rad / limits.amplitude_rad,
            self.rate_rad_s / limits.rate_rad_s,
            self.alpha_rad / limits.alpha_rad,
            (1.0 - low) / (1.0 - least),
            (high - 1.0) / (most - 1.0),
            self.airspeed / limits.airspeed,
        )

    def beside(self, limits: Limits) -> str:
        """The extreme values and the limits, in words."""
        low, high = self.load_factor
        least, most = limits.load_factor
        limit = (
            f"of {limits.rate_rad_s / DEG:.3g} deg/s"
            if math.isfinite(limits.rate_rad_s)
            else "deg/s, not limited"
        )
        return (
            f"elevator {self.elevator_rad / DEG:.3g} of {limits.amplitude_rad / DEG:.3g} deg, rate "
            f"{self.rate_rad_s / DEG:.3g} {limit}, alpha {self.alpha_rad / DEG:.3g} of "
            f"{limits.alpha_rad / DEG:.3g} deg about the trim, load factor {low:.3g} to {high:.3g} of {least:.3g} to "
            f"{most:.3g}, airspeed {100.0 * self.airspeed:.3g} of {100.0 * limits.airspeed:.3g} % from the trim"
        )

    def and_of(self, other: Extremes) -> Extremes:
        """The larger of two flights in each respect."""
        lows, highs = zip(self.load_factor, other.load_factor, strict=True)
        largest = {f.name: max(getattr(self, f.name), getattr(other, f.name)) for f in fields(self)}
        return Extremes(**largest | {"load_factor": (min(lows), max(highs))})


def extremes(channels: Mapping[str, Array], dt_s: float) -> Extremes:
    """Largest values of a flight that starts at its trim.

    Parameters
    ----------
    channels : name -> (samples,) of the elevator, alpha, az and the airspeed, without sensor errors [SI].
    dt_s : time between two samples [s].

    Examples
    --------
    >>> flat = np.zeros(3)
    >>> flown = {"elevator_rad": np.array([0.0, 0.01, 0.0]), "alpha_rad": flat, "az_m_s2": flat - 9.80665}
    >>> flown["airspeed_m_s"] = flat + 40.0
    >>> extremes(flown, 0.02).rate_rad_s
    0.5
    """
    surface, alpha = channels[LONGITUDINAL.surfaces[0]], channels[LONGITUDINAL.vane]
    factor, speed = -channels[LONGITUDINAL.outputs[-1].channel] / G0, channels["airspeed_m_s"]
    return Extremes(
        elevator_rad=float(np.abs(surface - surface[0]).max()),
        rate_rad_s=float(np.abs(np.diff(surface)).max() / dt_s),
        alpha_rad=float(np.abs(alpha - alpha[0]).max()),
        load_factor=(float(factor.min()), float(factor.max())),
        airspeed=float(np.abs(speed / speed[0] - 1.0).max()),
    )


__all__ = ["Extremes", "Limits", "extremes"]
