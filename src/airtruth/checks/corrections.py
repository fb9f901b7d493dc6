"""Corrections: what each known mistake of a log would be undone by."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, product
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.channels import ATTITUDE, LATERAL, SIGNALS
from airtruth.checks.excitation import turned
from airtruth.checks.relation import ATMOSPHERE_M
from airtruth.checks.rotation import side_gravity
from airtruth.checks.stated import Stated
from airtruth.checks.together import Runs
from airtruth.physics.atmosphere import density_kg_m3
from airtruth.physics.motion import LATERAL as MOTION
from airtruth.physics.motion import LONGITUDINAL, MOTIONS
from airtruth.units import DEG, FT, G0, KT, SLUG, UNITS

Array = NDArray[np.float64]
Channels = Mapping[str, Array]
Change = Callable[[Channels, float], Channels]


@dataclass(frozen=True)
class Correction:
    """The inverse of a mistake.

    Attributes
    ----------
    channels : channels that it changes, the one to name first.
    code : kind of fault, see `airtruth.checks.fault.CODES`.
    mistake : the mistake in words.
    cure : what to write in the import mapping.
    apply : channels (runs, samples) and sample period [s] -> the channels that change.
    sensor : whether it is an error of a sensor and none of the mapping; such an error never refuses a log.
    parts : the corrections of the single channels, if several channels share the mistake.
    penalty : what it adds to the sum: minus twice the logarithm of how often the mistake is made,
        relative to a wrong sign (judgement).
    """

    channels: tuple[str, ...]
    code: str
    mistake: str
    cure: str
    apply: Change
    penalty: float = 0.0
    sensor: bool = False
    parts: tuple[Correction, ...] = ()


def _scaled(name: str, factor: float) -> Change:
    return lambda c, dt_s: {name: factor * c[name]}


def _setting(name: str, stated: Stated | None, unit: str = "", sign: bool = False, scale: float = 1.0) -> str:
    """Lines to add to the mapping."""
    parts = []
    if unit and (stated is None or unit != stated.unit):
        instead = f' in place of "{stated.unit}"' if stated is not None else ""
        parts.append(f'unit = "{unit}"{instead}')
    if scale != 1.0:
        parts.append(f"scale = {scale * (1.0 if stated is None else stated.scale):g}")
    if sign:
        parts.append("sign = -1" if stated is None or stated.sign > 0 else "sign = 1 in place of -1")
    return f"state {' and '.join(parts)} under [channels.{name}] in the import mapping"


_FEET_OR_KM_H: Final = 0.5 * (FT + 1.0 / 3.6)
"""Mean of ft/s and km/h in m/s [-]: the two differ by 10 %, less than a log can tell."""
_UNITS: Final[dict[str, dict[str, tuple[float, str]]]] = {
    "angle": {"rad": (1.0, "radians"), "deg": (DEG, "degrees")},
    "angular_rate": {"rad_s": (1.0, "radians"), "deg_s": (DEG, "degrees")},
    "acceleration": {"m_s2": (1.0, "m/s2"), "g": (G0, "g"), "ft_s2": (FT, "ft/s2")},
    "speed": {"m_s": (1.0, "m/s"), "kt": (KT, "knots"), 'ft_s" or "km_h': (_FEET_OR_KM_H, "ft/s or km/h")},
    "length": {"m": (1.0, "metres"), "ft": (FT, "feet"), "mm": (1e-3, "mm")},
    "density": {"kg_m3": (1.0, "kg/m3"), "slug_ft3": (SLUG / FT**3, "slug/ft3")},
    "ratio": {"": (1.0, "a share"), "pct": (0.01, "per cent")},
}
"""Dimension -> unit of a mapping -> factor to SI and its name in sentences; the first one is that of the channel."""
_PARTS: Final[dict[str, tuple[tuple[str, str, float], ...]]] = {
    "angle": (("1/100 deg", "deg", 0.01),),
    "angular_rate": (("1/100 deg/s", "deg_s", 0.01),),
    "acceleration": (("1/1000 g", "g", 1e-3),),
    "speed": (("cm/s", "m_s", 0.01),),
    "length": (("km", "m", 1000.0), ("cm", "m", 0.01)),
}
"""Dimension -> unit that recorders write and no mapping names, as a multiple of one that it names."""
_REVERSED: Final = ("angle", "angular_rate", "acceleration", "speed")
"""Dimensions whose log may have been converted from a unit that its column did not have, where no mapping is known."""
_SIGNED: Final = ("angle", "angular_rate", "acceleration")
"""Dimensions whose positive sense a recorder may have the other way round."""
_SCALES: Final = (0.1, 0.2, 0.5, 2.0, 5.0, 10.0)
"""Factors by which an airspeed or density of no known unit may be wrong [-]."""
_PULSE_US: Final = (700.0, 2300.0)
"""Pulse widths of servos [microseconds]: 1000 to 2000 usually, and up to 2300 with extended travel."""
_PULSE_RAD: Final = 0.05 * DEG
"""Deflection by microsecond that stands for the unknown one [rad]: 25 deg in 500 (judgement)."""


def _unit_corrections(name: str, stated: Stated | None) -> Iterator[Correction]:
    """Each unit that the column may have in place of the one that it was taken for, the other sign, and both.

    Without a mapping the column was taken for SI, or a column in SI for something else.
    """
    dimension = SIGNALS[name].dimension
    units = _UNITS[dimension]
    own = next(iter(units))
    signed = dimension in _SIGNED
    if signed:
        ailerons = MOTION.controls[0]
        sides = name in (ailerons.channel, ailerons.command)
        words = "opposite sign (left and right mixed up)" if sides else "opposite sign"
        yield Correction((name,), "sign", words, _setting(name, stated, sign=True), _scaled(name, -1.0))
    taken = own if stated is None else stated.unit
    to_si, taken_words = units.get(taken, (UNITS[dimension].get(taken, 1.0), taken.replace("_", "/")))
    found = [
        (f"{words} taken as {taken_words}", factor / to_si, unit, 1.0, 1.0)
        for unit, (factor, words) in units.items()
        if unit != taken and not np.isclose(factor, to_si, rtol=0.15)
    ]
    if stated is None and dimension in _REVERSED:
        found += [
            (f"{units[own][1]} taken as {words}", 1.0 / factor, own, 1.0, 1.0)
            for unit, (factor, words) in units.items()
            if unit not in (own, "ft_s2")
        ]
    for words, unit, scale in _PARTS.get(dimension, ()):
        factor = scale * units[unit][0] / to_si
        found.append((f"{words} taken as {taken_words}", factor, unit, scale, 2.0))
    for mistake, factor, unit, scale, penalty in found:
        cure = _setting(name, stated, unit, scale=scale)
        yield Correction((name,), "unit", mistake, cure, _scaled(name, factor), penalty)
        if signed and scale == 1.0:
            cure = _setting(name, stated, unit, sign=True)
            both = f"{mistake} and opposite sign"
            yield Correction((name,), "unit_and_sign", both, cure, _scaled(name, -factor), penalty + 1.0)


def _pulses(name: str, runs: Runs, stated: Stated | None) -> Iterator[Correction]:
    """Pulse widths of a servo that were taken for an angle."""
    if stated is not None and not stated.is_plain:
        return
    units = ("rad", "deg") if stated is None else (stated.unit,)
    for unit in units:
        to_si = UNITS["angle"][unit]
        raw = runs.each(lambda c, dt_s: np.stack([c[name].min(axis=1), c[name].max(axis=1)])[None]) / to_si
        size = np.abs(raw)
        if size.min() < _PULSE_US[0] or size.max() > _PULSE_US[1]:
            continue

        def change(c: Channels, dt_s: float, to_si: float = to_si) -> Channels:
            x = c[name] / to_si
            return {name: _PULSE_RAD * (x - np.median(x, axis=1, keepdims=True))}

        yield Correction(
            (name,),
            "unit",
            f"pulse widths of a servo in microseconds taken as {_UNITS['angle'][unit][1]}",
            f'state the degrees per microsecond as scale, less their product with the centre as offset, and unit = "deg" under '
            f"[channels.{name}] in the import mapping",
            change,
            1.0,  # 1/100 deg explains the same numbers, and seldom leaves all of them in `_PULSE_US`
        )


_ALPHA, _Q, _AZ = LONGITUDINAL.output_channels
_BETA, _P, _R, _PHI, _AY = MOTION.output_channels
_SENSES: Final = (
    (_ALPHA, "theta_rad", _Q),
    *((c.channel, c.command) for c in LONGITUDINAL.controls),
    (_AZ, "ax_m_s2"),
    (_PHI, _P),
    ("psi_rad", _R),
    (_BETA, _AY),
    *((c.channel, c.command) for c in MOTION.controls),
    tuple(n for c in MOTION.controls for n in (c.channel, c.command)),
)
"""Groups of channels whose positive sense a recorder may have the other way round: pitch axis, elevator, specific force, roll,
yaw, side, aileron, rudder, and both of these."""
_SURFACES: Final = tuple(n for m in MOTIONS.values() for n in (*m.surfaces, *m.commands))
"""Control surfaces and their commands."""


def _shared(names: tuple[str, ...], single: Sequence[Correction]) -> Iterator[Correction]:
    """Mistakes that several channels share: any of the angles and rates has one unit, and an axis one positive sense.

    Parameters
    ----------
    names : channels of the log.
    single : corrections of single channels.
    """
    turns = tuple(n for n in names if SIGNALS[n].dimension in ("angle", "angular_rate"))
    pitch = tuple(n for n in turns if n not in LATERAL)
    groups = [*(g for k in range(2, len(pitch) + 1) for g in combinations(pitch, k)), _SENSES[2]]
    if pitch != turns:
        groups += _of_all_axes(turns)
    for code, tried in (("unit", groups), ("sign", list(_SENSES))):
        by_mistake: dict[str, dict[str, Correction]] = {}
        for one in single:
            if one.code == code and one.penalty <= 1.0:
                by_mistake.setdefault(code if code == "sign" else one.mistake, {})[one.channels[0]] = one
        for group in tried:
            for of_channel in by_mistake.values():
                parts = tuple(of_channel[n] for n in group if n in of_channel)
                if len(parts) > 1 and (code == "sign" or len(parts) == len(group)):
                    yield _together(parts)


def _of_all_axes(turns: tuple[str, ...]) -> list[tuple[str, ...]]:
    """Groups of angles and rates that one recorder converts, and the specific forces."""
    side = tuple(n for n in turns if n in LATERAL)
    rates = tuple(n for n in turns if SIGNALS[n].dimension == "angular_rate")
    surfaces = tuple(n for n in turns if n in _SURFACES)
    attitude = tuple(n for n in turns if n in ATTITUDE)
    angles = tuple(n for n in turns if n not in rates)
    motion = tuple(n for n in turns if n not in surfaces)
    found = [turns, angles, motion, rates, surfaces, attitude, (_AZ, "ax_m_s2", _AY)]
    found += [
        tuple(n for n in group if n in side) for group in (turns, angles, motion, rates, surfaces, attitude)
    ]
    return [*dict.fromkeys(found)]


def _together(parts: tuple[Correction, ...]) -> Correction:
    return Correction(
        tuple(c.channels[0] for c in parts),
        parts[0].code,
        min((c.mistake for c in parts), key=len),
        "; ".join(c.cure for c in parts),
        lambda c, dt_s: {name: values for part in parts for name, values in part.apply(c, dt_s).items()},
        0.5 * len(parts),
        parts=parts,
    )


def _gravity(c: Channels, name: str) -> Array:
    """Share of gravity in an accelerometer that an acceleration without gravity lacks [m/s2]."""
    theta = c.get("theta_rad", np.zeros_like(c[name]))
    if name == _AY:
        return -side_gravity(theta, c.get(_PHI, np.zeros_like(c[name])))
    return -G0 * np.cos(theta) if name == _AZ else G0 * np.sin(theta)


def _gravity_corrections(name: str) -> Iterator[Correction]:
    missing = "no gravity"
    cure = f"map the specific force that an accelerometer feels, gravity included, to {name}"
    yield Correction(
        (name,), "gravity", missing, cure, lambda c, dt_s: {name: c[name] + _gravity(c, name)}, 1.0
    )
    yield Correction(
        (name,),
        "gravity",
        f"{missing} and opposite sign",
        cure,
        lambda c, dt_s: {name: -c[name] + _gravity(c, name)},
        2.0,
    )
    yield Correction(
        (name,),
        "gravity",
        f"{missing} and g taken as m/s2",
        cure,
        lambda c, dt_s: {name: G0 * c[name] + _gravity(c, name)},
        2.0,
    )
    yield Correction(
        (name,), "gravity", "gravity twice", cure, lambda c, dt_s: {name: c[name] - _gravity(c, name)}, 1.0
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
        if (one in LATERAL) != (other in LATERAL) and SIGNALS[one].dimension != SIGNALS[other].dimension:
            continue
        yield Correction(
            (one, other),
            "swapped",
            f"swapped with {other}",
            f"exchange the columns of {one} and {other} in the import mapping",
            lambda c, dt_s, one=one, other=other: {one: c[other], other: c[one]},  # type: ignore[misc]
            3.0,
        )


def _standard(c: Channels) -> Array:
    return np.asarray(density_kg_m3(np.clip(c["altitude_m"], *ATMOSPHERE_M)))


def _lags(names: tuple[str, ...]) -> Iterator[Correction]:
    """Lags of a slow vane: without them its weak response passes for a wrong airspeed."""
    vanes = [motion.vane for motion in MOTIONS.values() if motion.vane in names]
    for name, lag in product(vanes, LAGS_S):
        yield Correction(
            (name,),
            "lag",
            f"about {lag:g} s late",
            "`airtruth check` measures the lag; declare it under [sensors] of the aircraft",
            lambda c, dt_s, n=name, lag=lag: {  # type: ignore[misc]
                n: c[n] + lag * np.gradient(c[n], dt_s, axis=1)
            },
            2.0,
            True,
        )


def _scales(names: tuple[str, ...]) -> Iterator[Correction]:
    """Factors of no known unit."""
    name = "airspeed_m_s"
    for factor in _SCALES if name in names else ():
        mistake = f"factor of about {1.0 / factor:g}"
        cure = f"state the unit and scale of {name} in the import mapping"
        yield Correction((name,), "scale", mistake, cure, _scaled(name, factor), 2.0)
    name = "density_kg_m3"
    if {name, "altitude_m"} <= set(names):
        yield Correction(
            (name,),
            "scale",
            "unknown factor",
            f"state the unit of {name}, or leave it out: altitude_m is enough",
            lambda c, dt_s: {name: _standard(c) + 0.0 * c[name]},
            4.0,
        )


def catalogue(runs: Runs, stated: Mapping[str, Stated] | None = None) -> list[Correction]:
    """Every known mistake in a log, and lags of its vane.

    Parameters
    ----------
    runs : runs of the log.
    stated : what the mapping states of the channels: a mistake is a difference from that. Empty if no mapping is known.
    """
    stated = stated or {}
    turning = turned(runs)
    names = tuple(name for name in runs.channels if name in SIGNALS and (turning or name not in LATERAL))
    result: list[Correction] = []
    for name in names:
        if SIGNALS[name].dimension in _UNITS:
            result += _unit_corrections(name, stated.get(name))
        if SIGNALS[name].dimension == "acceleration":
            result += _gravity_corrections(name)
        if name in _SURFACES:
            result += _pulses(name, runs, stated.get(name))
    return [*result, *_shared(names, result), *_scales(names), *_swaps(names), *_lags(names)]


__all__ = ["Correction", "catalogue"]
