"""Knowledge of the columns of other people's files: one TOML file for each source, of a form that users write too.

title = "test centre"
marks = ["ADC1_*"]                     # columns by which the source is recognised; without them it always counts
[names]
alpha_rad = ["AOA NOSE", "vane 1"]     # headers, compared without case, blanks and punctuation
[units]
"deg TEU" = { unit = "deg", sign = -1 }
kias = "kt"
[words]
context = ["noseboom"]                 # words beside a name that change nothing
[refused]
limit = "a limit"                      # words beside a name that make it something else
[[column]]                             # whole columns, with * for any text
match = ["ADC1_TAS"]
channel = "airspeed_m_s"
unit = "kt"
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, Final

from airtruth.documents import read_toml
from airtruth.errors import ConfigurationError, choices
from airtruth.importers.mapping import MAPPED, TIME_UNITS
from airtruth.units import UNITS

TIME: Final = "t_s"
"""Name of the time among the channels of a guess."""
QUATERNION: Final = ("quaternion_w", "quaternion_x", "quaternion_y", "quaternion_z")
"""Components of a quaternion, the scalar first."""
VELOCITY: Final = ("u_m_s", "v_m_s", "w_m_s")
"""Components of the velocity relative to the air in body axes."""
OTHERS: Final[dict[str, str]] = {
    TIME: "time",
    **dict.fromkeys(QUATERNION, "ratio"),
    **dict.fromkeys(VELOCITY, "speed"),
    "elevon_rad": "angle",
    "gps_altitude_m": "length",
    "ground_speed_m_s": "speed",
}
"""Quantities that a guess knows beside channels, because channels follow from them or are tested against them."""
DIMENSIONS: Final[dict[str, str]] = {**OTHERS, **MAPPED}
"""Everything that a column may be -> dimension."""
_KNOWN: Final = Path(__file__).parent / "known"
"""Folder of the files of the package, one for each source."""
_TABLES: Final = ("title", "marks", "names", "units", "words", "refused", "column")
"""Keys of a file."""
_ENTRY: Final = (
    "match",
    "channel",
    "unit",
    "sign",
    "offset",
    "rank",
    "refuse",
    "synthetic",
    "surface",
    "quaternion",
)
"""Keys of a column."""
_DOWN: Final = {"ted": 1, "te_down": 1, "teu": -1, "te_up": -1}
"""Direction beside a unit -> sign that makes trailing edge down positive [-]."""
SHORT: Final = {"d": "deg", "deg": "deg", "r": "rad"}
"""Endings of a name that are units only where the dimension fits: THETA_D."""


@dataclass(frozen=True)
class Unit:
    """A unit and the sign that its words state."""

    name: str
    sign: int = 1


@dataclass(frozen=True)
class Entry:
    """A column of a source.

    Attributes
    ----------
    match : patterns of the whole name, with * for any text.
    channel : what it is; "" of a column that is none.
    unit, sign, offset : as in a mapping; sign 0 where the source has no convention.
    rank : preference among the columns of one channel, 1 first.
    refuse : why it is no channel.
    synthetic : whether it is an angle of attack that was computed without a vane.
    surface : why the deflection of a surface cannot be read from it, although the surface follows it.
    quaternion : order of the components of an attitude, whose four patterns are in ``match``.
    """

    match: tuple[str, ...]
    channel: str = ""
    unit: str = ""
    sign: int = 0
    offset: float = 0.0
    rank: int = 1
    refuse: str | None = None
    synthetic: bool = False
    surface: str = ""
    quaternion: str = ""

    def matches(self, name: str) -> bool:
        """Whether a pattern matches the whole name."""
        return any(_pattern(one).fullmatch(name) for one in self.match)


@dataclass(frozen=True)
class Words:
    """Knowledge of one source, or of a user.

    Attributes
    ----------
    title : name of the source.
    marks : patterns of columns by which it is recognised; none if it always counts.
    names : plain header -> what it may be.
    units : plain words -> unit.
    context : words that change nothing.
    refused : words -> what they make of a column.
    columns : whole columns.
    """

    title: str = "the dictionary"
    marks: tuple[str, ...] = ()
    names: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    units: Mapping[str, Unit] = field(default_factory=dict)
    context: frozenset[str] = frozenset()
    refused: Mapping[str, str] = field(default_factory=dict)
    columns: tuple[Entry, ...] = ()

    def counts(self, names: Iterable[str]) -> bool:
        """Whether the source is recognised by the columns of a file."""
        patterns = [_pattern(mark) for mark in self.marks]
        return not patterns or any(p.fullmatch(name) for name in names for p in patterns)


@dataclass(frozen=True)
class Lexicon:
    """Knowledge that counts for one file, the user's first."""

    parts: tuple[Words, ...]

    def unit(self, text: str) -> Unit | None:
        """Unit that words state, "deg TEU", "m/s²", "°/s"; None if they state none that is known."""
        plain = plain_unit(text)
        for part in self.parts:
            if plain in part.units:
                return part.units[plain]
        for words, sign in _DOWN.items():
            rest = plain.removesuffix("_" + words)
            found = next((part.units[rest] for part in self.parts if rest in part.units), None)
            if rest != plain and found:
                return Unit(found.name, sign)
        return None

    def entry(self, name: str) -> tuple[Entry, Words] | None:
        """The first whole column that matches a name, and its source."""
        return next(((e, p) for p in self.parts for e in p.columns if e.matches(name)), None)

    def meanings(self, plain: str) -> tuple[str, ...]:
        """Possible meanings of a compact name; only the user's meaning where there is one."""
        for part in self.parts:
            if part.title == Words.title and plain in part.names:
                return part.names[plain]
        return tuple(dict.fromkeys(c for p in self.parts for c in p.names.get(plain, ())))

    @property
    def context(self) -> frozenset[str]:
        """Words that change nothing."""
        return frozenset().union(*(part.context for part in self.parts))

    @property
    def refused(self) -> dict[str, str]:
        """Words -> what they make of a column."""
        return {word: what for part in reversed(self.parts) for word, what in part.refused.items()}


def lexicon(names: Iterable[str], own: Words | None = None) -> Lexicon:
    """Knowledge of the sources that a file's columns show, with a user's own first."""
    listed = list(names)
    shipped = [part for part in _shipped() if part.counts(listed)]
    shipped.sort(key=lambda part: not part.marks)
    return Lexicon((*([own] if own else []), *shipped))


def compact(text: str) -> str:
    """A header in lower case without blanks and punctuation."""
    return re.sub(r"[\W_]+", "", text.lower())


def plain_unit(text: str) -> str:
    """A unit in lower case with underscores between its words; powers as digits."""
    text = text.strip().lower().replace("²", "2").replace("³", "3").replace("^", "").replace("**", "")
    return re.sub(r"[^\w°%µμ]+", "_", text).strip("_").replace("sec", "s")


def read_dictionary(path: Path | str) -> Words:
    """Read knowledge of a source from a TOML file.

    Raises
    ------
    ConfigurationError
        If it is no TOML, or names a channel or unit that does not exist.
    """
    path = Path(path)
    raw = read_toml(path, ConfigurationError, "docs/measured.md shows one")
    unknown = sorted(set(raw) - set(_TABLES))
    if unknown:
        raise ConfigurationError(f"{path}: {unknown[0]!r}: {choices(unknown[0], _TABLES)}")
    words = _table(path, raw, "words")
    title = raw.get("title", Words.title)
    if not isinstance(title, str) or not title:
        raise ConfigurationError(f"{path}: title {title!r} is not a name; write text")
    return Words(
        title,
        _texts(path, "marks", raw.get("marks", [])),
        _names(path, raw),
        dict(_units(path, raw)),
        frozenset(compact(w) for w in _texts(path, "[words] context", words.get("context", []))),
        {compact(word): str(what) for word, what in _table(path, raw, "refused").items()},
        tuple(_columns(path, raw)),
    )


@cache
def _shipped() -> tuple[Words, ...]:
    return tuple(read_dictionary(file) for file in sorted(_KNOWN.glob("*.toml")))


@cache
def _pattern(text: str) -> re.Pattern[str]:
    return re.compile(".*".join(re.escape(part) for part in text.split("*")), re.IGNORECASE | re.DOTALL)


def _names(path: Path, raw: Mapping[str, Any]) -> dict[str, tuple[str, ...]]:
    names: dict[str, tuple[str, ...]] = {}
    for channel, headers in _table(path, raw, "names").items():
        _check_channel(path, "[names]", channel)
        for header in headers if isinstance(headers, list) else [headers]:
            if not isinstance(header, str) or not compact(header):
                raise ConfigurationError(
                    f"{path}: [names] {channel}: {header!r} is not a column name; write text"
                )
            names[compact(header)] = (*names.get(compact(header), ()), channel)
    return names


def _units(path: Path, raw: Mapping[str, Any]) -> Iterator[tuple[str, Unit]]:
    for words, entry in _table(path, raw, "units").items():
        table = entry if isinstance(entry, dict) else {"unit": entry}
        unit, sign = table.get("unit"), table.get("sign", 1)
        _check_unit(path, f"[units] {words!r}", unit)
        if sign not in (1, -1) or set(table) - {"unit", "sign"}:
            raise ConfigurationError(f"{path}: [units] {words!r}: state unit, and sign = 1 or -1")
        yield plain_unit(words), Unit(str(unit), int(sign))


def _columns(path: Path, raw: Mapping[str, Any]) -> Iterator[Entry]:
    listed = raw.get("column", [])
    if not isinstance(listed, list) or not all(isinstance(one, dict) for one in listed):
        raise ConfigurationError(f"{path}: column must be a list of tables, [[column]]")
    for number, one in enumerate(listed, 1):
        where = f"[[column]] {number}"
        unknown = sorted(set(one) - set(_ENTRY))
        if unknown:
            raise ConfigurationError(f"{path}: {where}: {unknown[0]!r}: {choices(unknown[0], _ENTRY)}")
        patterns = _texts(path, f"{where} match", one.get("match", []))
        if not patterns:
            raise ConfigurationError(f"{path}: {where}: state match, the names of columns")
        if "channel" in one:
            _check_channel(path, where, one["channel"])
            dimension = DIMENSIONS[one["channel"]]
            if one.get("unit") not in (TIME_UNITS if dimension == "time" else UNITS[dimension]):
                known = TIME_UNITS if dimension == "time" else UNITS[dimension]
                raise ConfigurationError(
                    f"{path}: {where}: {one.get('unit')!r} is not a unit of {one['channel']}; "
                    f"{choices(str(one.get('unit')), known)}"
                )
        elif not {"refuse", "surface", "quaternion"} & set(one):
            raise ConfigurationError(f"{path}: {where}: state channel and unit, or refuse, a reason")
        if one.get("sign", 0) not in (-1, 0, 1):
            raise ConfigurationError(f"{path}: {where}: sign is 1 or -1")
        order = one.get("quaternion", "")
        if order and (order not in ("wxyz", "xyzw") or len(patterns) != 4):
            raise ConfigurationError(
                f'{path}: {where}: quaternion is "wxyz" or "xyzw", and match has four names'
            )
        try:
            yield Entry(**{**one, "match": patterns, "offset": float(one.get("offset", 0.0))})
        except (TypeError, ValueError):
            raise ConfigurationError(f"{path}: {where}: offset is not a number") from None


def _check_channel(path: Path, where: str, channel: object) -> None:
    if channel not in DIMENSIONS:
        raise ConfigurationError(
            f"{path}: {where} {channel!r} is not a channel; {choices(str(channel), DIMENSIONS)}"
        )


def _check_unit(path: Path, where: str, unit: object) -> None:
    known = sorted({u for table in (*UNITS.values(), TIME_UNITS) for u in table if u})
    if unit not in known:
        raise ConfigurationError(f"{path}: {where}: {unit!r} is not a unit; {choices(str(unit), known)}")


def _texts(path: Path, where: str, value: object) -> tuple[str, ...]:
    listed = value if isinstance(value, list) else [value]
    if not all(isinstance(one, str) and one for one in listed):
        raise ConfigurationError(f"{path}: {where}: write a list of texts")
    return tuple(listed)


def _table(path: Path, raw: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    value = raw.get(key, {})
    if not isinstance(value, dict):
        raise ConfigurationError(f"{path}: {key} must be a table, [{key}]")
    return value


__all__ = [
    "DIMENSIONS",
    "QUATERNION",
    "SHORT",
    "TIME",
    "VELOCITY",
    "Entry",
    "Lexicon",
    "Unit",
    "Words",
    "compact",
    "lexicon",
    "plain_unit",
    "read_dictionary",
]
