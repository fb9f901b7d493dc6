"""Corrections: what each known mistake of a log would be undone by."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.channels import SIGNALS
from airtruth.checks.relation import ATMOSPHERE_M
from airtruth.physics.atmosphere import density_kg_m3
from airtruth.units import DEG, FT, G0, KT, SLUG

Array = NDArray[np.float64]
Channels = Mapping[str, Array]


@dataclass(frozen=True)
class Correction:
    """The inverse of a mistake.

    Attributes
    ----------
    channels : channels that it changes, the one to name first.
    code : kind of fault, see `airtruth.checks.fault.CODES`.
    mistake : the mistake in words.
    cure : what to write in the import mapping.
    apply : channels (runs, samples) -> those that change.
    sensor : whether it is an error of a sensor and none of the mapping; such an error never refuses a log.
    parts : the corrections of the single channels, if several channels share the mistake.
    penalty : what it adds to the sum: minus twice the logarithm of how often the mistake is made,
        relative to a wrong sign (judgement).
    """

    channels: tuple[str, ...]
    code: str
    mistake: str
    cure: str
    apply: Callable[[Channels], Channels]
    penalty: float = 0.0
    sensor: bool = False
    parts: tuple[Correction, ...] = ()


def _scaled(name: str, factor: float) -> Callable[[Channels], Channels]:
    return lambda c: {name: factor * c[name]}


def _setting(name: str, unit: str = "", sign: bool = False) -> str:
    parts = [f'unit = "{unit}"'] if unit else []
    parts += ["sign = -1"] if sign else []
    return f"state {' and '.join(parts)} under [channels.{name}] in the import mapping"


def _unit_corrections(name: str, units: Mapping[str, tuple[float, str]]) -> Iterator[Correction]:
    """The other sign, each other unit, and both."""
    yield Correction((name,), "sign", "opposite sign", _setting(name, sign=True), _scaled(name, -1.0))
    for unit, (factor, mistake) in units.items():
        cure = _setting(name, unit)
        yield Correction((name,), "unit", mistake, cure, _scaled(name, factor), 1.0)
        both = f"{mistake} and opposite sign"
        cure = _setting(name, unit, sign=True)
        yield Correction((name,), "unit_and_sign", both, cure, _scaled(name, -factor), 2.0)


_ANGLE: Final = {"deg": (DEG, "degrees taken as radians"), "rad": (1.0 / DEG, "radians taken as degrees")}
"""Unit to state in a mapping -> factor that undoes the mistake [-], and the mistake, for angles."""
_RATE: Final = {"deg_s": _ANGLE["deg"], "rad_s": _ANGLE["rad"]}
"""The same for angular rates."""
_FORCE: Final = {
    "g": (G0, "g taken as m/s2"),
    "ft_s2": (FT, "ft/s2 taken as m/s2"),
    "m_s2": (1.0 / G0, "m/s2 taken as g"),
}
"""The same for specific forces."""
_FEET_OR_KM_H: Final = 0.5 * (FT + 1.0 / 3.6)
"""Mean of ft/s and km/h in m/s [-]: the two differ by 10 %, less than a log can tell."""
_SPEED: Final = {
    "kt": (KT, "knots taken as m/s"),
    'ft_s" or "km_h': (_FEET_OR_KM_H, "ft/s or km/h taken as m/s"),
    "m_s": (1.0 / KT, "m/s taken as knots"),
    'm_s" (no longer "ft_s" or "km_h")': (1.0 / _FEET_OR_KM_H, "m/s taken as ft/s or km/h"),
}
"""The same as `_ANGLE` for airspeeds."""
_SCALES: Final = (0.1, 0.2, 0.5, 2.0, 5.0, 10.0)
"""Factors by which an airspeed or density of no known unit may be wrong [-]."""


_PITCH: Final = ("alpha_rad", "theta_rad", "q_rad_s")
"""Channels of the motion about the pitch axis, whose positive sense a recorder may have the other way round."""
_SURFACE: Final = ("elevator_rad", "elevator_command_rad")
"""Channels of the elevator."""
_FORCES: Final = ("az_m_s2", "ax_m_s2")
"""Channels of the specific force."""


def _shared(names: tuple[str, ...], single: Sequence[Correction]) -> Iterator[Correction]:
    """Mistakes that several channels share: a recorder has one unit for its angles, and one positive sense for an axis.

    Parameters
    ----------
    names : channels of the log.
    single : corrections of single channels.
    """
    angles = tuple(n for n in names if SIGNALS[n].dimension == "angle")
    rates = tuple(n for n in names if SIGNALS[n].dimension == "angular_rate")
    in_units = ((*angles, *rates), angles, _PITCH, _PITCH[:2], _SURFACE, _FORCES)
    in_sense = (_PITCH, _SURFACE, _FORCES)
    tried: set[frozenset[Correction]] = set()
    for code, groups in (("unit", in_units), ("sign", in_sense)):
        for group in groups:
            members = [c for c in single if c.code == code and c.channels[0] in group]
            for mistake in dict.fromkeys(c.mistake for c in members):
                parts = tuple(c for c in members if c.mistake == mistake)
                if len(parts) > 1 and frozenset(parts) not in tried:
                    tried.add(frozenset(parts))
                    yield _together(parts)


def _together(parts: tuple[Correction, ...]) -> Correction:
    return Correction(
        tuple(c.channels[0] for c in parts),
        parts[0].code,
        parts[0].mistake,
        "; ".join(c.cure for c in parts),
        lambda c: {name: values for part in parts for name, values in part.apply(c).items()},
        0.5 * len(parts),
        parts=parts,
    )


def _gravity(c: Channels, name: str) -> Array:
    """Share of gravity in an accelerometer that an acceleration without gravity lacks [m/s2]."""
    theta = c.get("theta_rad", np.zeros_like(c[name]))
    return -G0 * np.cos(theta) if name == "az_m_s2" else G0 * np.sin(theta)


def _gravity_corrections(name: str) -> Iterator[Correction]:
    missing = "no gravity"
    cure = f"map the specific force that an accelerometer feels, gravity included, to {name}"
    yield Correction((name,), "gravity", missing, cure, lambda c: {name: c[name] + _gravity(c, name)}, 1.0)
    yield Correction(
        (name,),
        "gravity",
        f"{missing} and opposite sign",
        cure,
        lambda c: {name: -c[name] + _gravity(c, name)},
        2.0,
    )
    yield Correction(
        (name,),
        "gravity",
        f"{missing} and g taken as m/s2",
        cure,
        lambda c: {name: G0 * c[name] + _gravity(c, name)},
        2.0,
    )
    yield Correction(
        (name,), "gravity", "gravity twice", cure, lambda c: {name: c[name] - _gravity(c, name)}, 1.0
    )


LAGS_S: Final = (0.1, 0.2, 0.3, 0.5, 0.8)
"""Lags of an alpha vane that are tried [s] (judgement: pneumatic probes of transports have half a second)."""
_STATE_OF_FLIGHT: Final = frozenset({"airspeed_m_s", "altitude_m", "density_kg_m3", "throttle"})
"""Channels that hardly change within a record. One of them is not exchanged by mistake with one that follows the motion:
such an exchange fits only because it makes the physical relations uninformative."""


def _swaps(names: tuple[str, ...]) -> Iterator[Correction]:
    for one, other in combinations(names, 2):
        if (one in _STATE_OF_FLIGHT) != (other in _STATE_OF_FLIGHT):
            continue
        yield Correction(
            (one, other),
            "swapped",
            f"swapped with {other}",
            f"exchange the columns of {one} and {other} in the import mapping",
            lambda c, one=one, other=other: {one: c[other], other: c[one]},  # type: ignore[misc]
            3.0,
        )


def _air_corrections(names: tuple[str, ...]) -> Iterator[Correction]:
    if "altitude_m" in names:
        for unit, factor, mistake in (("ft", FT, "feet taken as metres"), ("km", 1e3, "km taken as metres")):
            cure = _setting("altitude_m", unit)
            yield Correction(("altitude_m",), "unit", mistake, cure, _scaled("altitude_m", factor), 1.0)
    if "density_kg_m3" in names:
        name = "density_kg_m3"
        cure = _setting(name, "slug_ft3")
        slug = SLUG / FT**3
        yield Correction((name,), "unit", "slug/ft3 taken as kg/m3", cure, _scaled(name, slug), 1.0)
        if "altitude_m" in names:
            yield Correction(
                (name,),
                "scale",
                "unknown factor",
                f"state the unit of {name}, or leave it out: altitude_m is enough",
                lambda c: {name: _standard(c) + 0.0 * c[name]},
                4.0,
            )


def _standard(c: Channels) -> Array:
    return np.asarray(density_kg_m3(np.clip(c["altitude_m"], *ATMOSPHERE_M)))


def _lags(names: tuple[str, ...], dt_s: float) -> Iterator[Correction]:
    """Lags of a slow vane: without them its weak response passes for a wrong airspeed."""
    if "alpha_rad" not in names:
        return
    for lag in LAGS_S:
        yield Correction(
            ("alpha_rad",),
            "lag",
            f"about {lag:g} s late",
            "`airtruth check` measures the lag; declare it under [sensors] of the aircraft",
            lambda c, lag=lag: {  # type: ignore[misc]
                "alpha_rad": c["alpha_rad"] + lag * np.gradient(c["alpha_rad"], dt_s, axis=1)
            },
            2.0,
            True,
        )


def catalogue(names: tuple[str, ...], dt_s: float) -> list[Correction]:
    """Every known mistake in a log of these channels and this sample period [s], and lags of its vane."""
    result: list[Correction] = []
    for name in names:
        dimension = SIGNALS[name].dimension
        if dimension == "angle":
            result += _unit_corrections(name, _ANGLE)
        elif dimension == "angular_rate":
            result += _unit_corrections(name, _RATE)
        elif dimension == "acceleration":
            result += [*_unit_corrections(name, _FORCE), *_gravity_corrections(name)]
    result += [*_shared(names, result)]
    name = "airspeed_m_s"
    if name in names:
        for unit, (factor, mistake) in _SPEED.items():
            cure = _setting(name, unit)
            result.append(Correction((name,), "unit", mistake, cure, _scaled(name, factor), 1.0))
        for factor in _SCALES:
            mistake, cure = (
                f"factor of about {1.0 / factor:g}",
                f"state the unit and scale of {name} in the import mapping",
            )
            result.append(Correction((name,), "scale", mistake, cure, _scaled(name, factor), 2.0))
    if "throttle" in names:
        cure = _setting("throttle", "pct")
        scaled = _scaled("throttle", 0.01)
        result.append(Correction(("throttle",), "unit", "per cent taken as a share", cure, scaled, 1.0))
    return [*result, *_air_corrections(names), *_swaps(names), *_lags(names, dt_s)]


__all__ = ["Correction", "catalogue"]
