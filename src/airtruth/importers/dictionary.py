"""Names and units by which the columns of other people's files are known; a TOML file adds to them.

[names]
alpha_rad = ["AOA NOSE", "vane 1"]     # headers, compared without case, blanks and punctuation
[units]
"deg TEU" = { unit = "deg", sign = -1 }
kias = "kt"
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from airtruth.channels import SIGNALS
from airtruth.documents import read_toml
from airtruth.errors import ConfigurationError, choices
from airtruth.importers.mapping import DERIVED, TIME_UNITS
from airtruth.units import UNITS

TIME: Final = "t_s"
"""Name of the time among the channels of a guess."""

NAMES: Final = {
    TIME: r"t|time|time_?stamp|times|sec(onds)?|clock|time_?us",
    "airspeed_m_s": r"v|vt|tas|v_?tas|vtrue|airspeed|true_?air_?speed(_.*)?|vinf|ktas",
    "alpha_rad": r"alpha|aoa|angle_?of_?attack|alfa|alpha_(vane|cg|true|meas)|vane_?(a|alpha)",
    "theta_rad": r"theta|pitch|pitch_?(angle|att(itude)?)|the",
    "q_rad_s": r"q|pitch_?rate|q_?(body|gyro|rate|meas)|qb|omega_?y|gyro?_?y|w_?y",
    "ax_m_s2": r"ax|a_?x|acc(el)?_?x|nx|x_?acc(el)?|ax_?(body|imu)",
    "az_m_s2": r"az|a_?z|acc(el)?_?z|nz|z_?acc(el)?|az_?(body|imu)",
    "elevator_rad": r"de|elevator|elev|delta_?e|el(e)?|stab(ilator)?(_?pos(ition)?)?|de_?(meas|pos)|"
    r"elev(ator)?_?(pos|position|surface|defl(ection)?)|elev(ator|on)?s?_?mean",
    "elevator_command_rad": r"de_?c(md|om)?|elevator_?(cmd|command)|de_?(command|ref)",
    "throttle": r"throttle|thr|pla|power_?lever",
    "altitude_m": r"h|alt|altitude|h_?p|pressure_?alt(itude)?|hbaro|baro_?alt",
    "density_kg_m3": r"rho|density|air_?density",
    "dynamic_pressure_pa": r"q_?bar|dynamic_?pressure|q_?dyn|dyn_?press(ure)?",
}
"""Channel -> regular expression of the headers that usually name it."""
_UNIT_WORDS: Final = {
    "rad": "rad", "deg": "deg", "degree": "deg", "degrees": "deg", "°": "deg", "rad_s": "rad_s", "deg_s": "deg_s",
    "°_s": "deg_s", "rad_sec": "rad_s", "deg_sec": "deg_s", "dps": "deg_s", "degps": "deg_s", "m_s": "m_s", "mps": "m_s",
    "ms": "m_s", "ft_s": "ft_s", "ft_sec": "ft_s", "fps": "ft_s", "fts": "ft_s", "kt": "kt", "kts": "kt", "knots": "kt",
    "km_h": "km_h", "kmh": "km_h", "kph": "km_h", "m_s2": "m_s2", "m_s_s": "m_s2", "mps2": "m_s2", "ms2": "m_s2", "g": "g",
    "gs": "g", "ft_s2": "ft_s2", "ft_s_s": "ft_s2", "fps2": "ft_s2", "m": "m", "ft": "ft", "feet": "ft", "kg_m3": "kg_m3",
    "kgm3": "kg_m3", "slug_ft3": "slug_ft3", "pct": "pct", "percent": "pct", "%": "pct", "s": "s", "sec": "s", "us": "us",
    "µs": "us", "millis": "ms", "msec": "ms", "pa": "pa", "hpa": "hpa", "kpa": "kpa", "psf": "psf", "lb_ft2": "psf",
    "psi": "psi",
}  # fmt: skip
"""Word in a header -> unit of `airtruth.units.UNITS`."""
_DOWN: Final = {"ted": 1, "te_down": 1, "teu": -1, "te_up": -1}
"""Direction beside a unit -> sign that makes trailing edge down positive [-]."""
SHORT: Final = {"d": "deg"}
"""Endings of a name that are units only where the dimension fits: THETA_D."""


@dataclass(frozen=True)
class Unit:
    """A unit and the sign that its words state."""

    name: str
    sign: int = 1


@dataclass(frozen=True)
class Words:
    """What a user adds to the names and units.

    Attributes
    ----------
    names : plain header -> channel.
    units : plain words -> unit.
    """

    names: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, Unit] = field(default_factory=dict)

    def unit(self, text: str) -> Unit | None:
        """Unit that words state, "deg TEU", "m/s²", "°/s"; None if they state none that is known."""
        plain = plain_unit(text)
        if plain in self.units:
            return self.units[plain]
        if plain in _UNIT_WORDS:
            return Unit(_UNIT_WORDS[plain])
        for words, sign in _DOWN.items():
            rest = plain.removesuffix("_" + words)
            if rest != plain and rest in _UNIT_WORDS:
                return Unit(_UNIT_WORDS[rest], sign)
        return None


def plain_name(text: str) -> str:
    """A header in lower case with underscores between its words."""
    return re.sub(r"\W+", "_", text.lower()).strip("_")


def plain_unit(text: str) -> str:
    """A unit in lower case with underscores between its words; powers as digits."""
    text = text.strip().lower().replace("²", "2").replace("³", "3").replace("^", "").replace("**", "")
    return re.sub(r"[^\w°%µ]+", "_", text).strip("_").replace("sec", "s")


def read_dictionary(path: Path | str) -> Words:
    """Read names and units from a TOML file.

    Raises
    ------
    ConfigurationError
        If it is no TOML, or names a channel or unit that does not exist.
    """
    path = Path(path)
    raw = read_toml(path, ConfigurationError, "docs/measured.md shows one")
    unknown = sorted(set(raw) - {"names", "units"})
    if unknown:
        raise ConfigurationError(f"{path}: {unknown[0]!r}: {choices(unknown[0], ('names', 'units'))}")
    names: dict[str, str] = {}
    for channel, headers in _table(path, raw, "names").items():
        known = (TIME, *SIGNALS, *DERIVED)
        if channel not in known:
            raise ConfigurationError(
                f"{path}: [names] {channel!r} is not a channel; {choices(channel, known)}"
            )
        for header in headers if isinstance(headers, list) else [headers]:
            if not isinstance(header, str) or not plain_name(header):
                raise ConfigurationError(
                    f"{path}: [names] {channel}: {header!r} is not a column name; write text"
                )
            names[plain_name(header)] = channel
    known_units = sorted({u for table in (*UNITS.values(), TIME_UNITS) for u in table if u})
    units: dict[str, Unit] = {}
    for words, entry in _table(path, raw, "units").items():
        table = entry if isinstance(entry, dict) else {"unit": entry}
        unit, sign = table.get("unit"), table.get("sign", 1)
        if unit not in known_units:
            raise ConfigurationError(
                f"{path}: [units] {words!r}: {unit!r} is not a unit; {choices(str(unit), known_units)}"
            )
        if sign not in (1, -1) or set(table) - {"unit", "sign"}:
            raise ConfigurationError(f"{path}: [units] {words!r}: state unit, and sign = 1 or -1")
        units[plain_unit(words)] = Unit(str(unit), int(sign))
    return Words(names, units)


def _table(path: Path, raw: Mapping[str, object], key: str) -> Mapping[str, object]:
    value = raw.get(key, {})
    if not isinstance(value, dict):
        raise ConfigurationError(f"{path}: {key} must be a table, [{key}]")
    return value


__all__ = ["NAMES", "SHORT", "TIME", "Unit", "Words", "plain_name", "read_dictionary"]
