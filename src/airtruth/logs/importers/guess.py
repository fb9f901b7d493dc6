"""A first mapping, from the names and sizes of a file's columns, for a person to correct."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import AirtruthError
from airtruth.logs.importers.convert import convert
from airtruth.logs.importers.mapping import TIME_UNITS, MappingFile, SourceSection
from airtruth.logs.importers.plausible import problems
from airtruth.logs.importers.sources import Source, open_source
from airtruth.signals import REQUIRED, SIGNALS
from airtruth.units import UNITS

Array = NDArray[np.float64]

_NAMES: Final = {
    "t_s": r"t|time|time_?stamp|times|sec(onds)?|clock",
    "airspeed_m_s": r"v|vt|tas|v_?tas|vtrue|airspeed|true_?air_?speed(_.*)?|vinf|ktas",
    "alpha_rad": r"alpha|aoa|angle_?of_?attack|alfa|alpha_(vane|cg|true|meas)|vane_?(a|alpha)",
    "theta_rad": r"theta|pitch|pitch_?(angle|attitude)|the",
    "q_rad_s": r"q|pitch_?rate|q_?(body|gyro|rate|meas)|qb|omega_?y|gyro_?y|w_?y",
    "ax_m_s2": r"ax|a_?x|acc(el)?_?x|nx|x_?acc(el)?|ax_?(body|imu)",
    "az_m_s2": r"az|a_?z|acc(el)?_?z|nz|z_?acc(el)?|az_?(body|imu)",
    "elevator_rad": r"de|elevator|elev|delta_?e|el(e)?|stab|de_?(meas|pos)|elevator_?(pos|position|surface)",
    "elevator_command_rad": r"de_?c(md|om)?|elevator_?(cmd|command)|de_?(command|ref)",
    "throttle": r"throttle|thr|pla|power_?lever",
    "altitude_m": r"h|alt|altitude|h_?p|pressure_?alt(itude)?|hbaro|baro_?alt",
    "density_kg_m3": r"rho|density|air_?density",
}
_UNIT_WORDS: Final = {
    "rad": "rad", "deg": "deg", "degree": "deg", "degrees": "deg", "rad_s": "rad_s", "deg_s": "deg_s",
    "rad_sec": "rad_s", "deg_sec": "deg_s", "dps": "deg_s", "m_s": "m_s", "mps": "m_s", "ms": "m_s", "ft_s": "ft_s",
    "ft_sec": "ft_s", "fps": "ft_s", "kt": "kt", "kts": "kt", "knots": "kt", "km_h": "km_h", "kmh": "km_h", "kph": "km_h",
    "m_s2": "m_s2", "mps2": "m_s2", "ms2": "m_s2", "g": "g", "gs": "g", "ft_s2": "ft_s2", "fps2": "ft_s2",
    "m": "m", "ft": "ft", "feet": "ft", "kg_m3": "kg_m3", "kgm3": "kg_m3", "slug_ft3": "slug_ft3", "pct": "pct",
    "percent": "pct", "s": "s", "sec": "s", "us": "us", "millis": "ms", "msec": "ms",
}  # fmt: skip


@dataclass(frozen=True)
class _Column:
    key: str | int
    variable: str | None
    name: str
    unit: str | None
    values: Array


def guess_mapping(path: Path | str, section: SourceSection | None = None) -> str:
    """A mapping as TOML, with what was not found, and what physics says of the guess, as comments.

    Raises
    ------
    StoreError, ConfigurationError
        If the file cannot be read.
    """
    source = open_source(path, section)
    columns = list(_columns(source))
    chosen = {name: found for name in _NAMES if (found := _best(name, columns)) is not None}
    body = "\n".join(_body(source, chosen))
    lines = [f"# A guess from {source.path.name}: check every unit and sign before use."]
    lines += [f"# {text}" for text in _judgement(source, body, chosen)]
    lines += ["", body, "", "# Columns of the file, first and last value, smallest and largest:"]
    for c in columns[:200]:
        finite = c.values[np.isfinite(c.values)]
        if len(finite):
            where = f"{c.variable} column {c.key}" if c.variable else repr(c.key)
            label = f" ({c.name})" if c.variable and c.name else ""
            lines.append(
                f"#   {where}{label}: {finite[0]:.6g}, {finite[-1]:.6g}; {finite.min():.6g}, {finite.max():.6g}"
            )
    return "\n".join(lines) + "\n"


def _columns(source: Source) -> Iterator[_Column]:
    for name, values in source.arrays.items():
        if values.ndim == 2:
            labels = source.labels.get(name, ("",) * values.shape[1])
            for i, label in enumerate(labels):
                if values.dtype.kind in "biuf" and values.shape[0] > 1:
                    plain, unit = _split(label)
                    yield _Column(i + 1, name, plain, unit, values[:, i].astype(np.float64))
        elif values.dtype.kind in "biuf" and len(values) > 1:
            plain, unit = _split(name.rsplit(".", 1)[-1])
            yield _Column(name, None, plain, unit, values.astype(np.float64))


def _split(label: str) -> tuple[str, str | None]:
    """ "alpha [deg]", "alpha (deg)", "* alpha    (deg)", "alpha_deg" as ("alpha", "deg")."""
    text = label.lower().replace("²", "2").replace("^", "").strip("* ")
    bracket = re.search(r"[\[(]([^\])]*)[\])]", text)
    if bracket:
        plain = re.sub(r"\W+", "_", text[: bracket.start()]).strip("_")
        return plain, _UNIT_WORDS.get(re.sub(r"\W+", "_", bracket[1]).strip("_").replace("sec", "s"))
    plain = re.sub(r"\W+", "_", text).strip("_")
    words = plain.split("_")
    for count in (2, 1):
        unit = _UNIT_WORDS.get("_".join(words[-count:])) if len(words) > count else None
        if unit:
            return "_".join(words[:-count]), unit
    return plain, None


def _best(channel: str, columns: list[_Column]) -> _Column | None:
    """The column whose name fits; of several the one with a unit of the right dimension, then the first."""
    dimension = SIGNALS[channel].dimension if channel in SIGNALS else "time"
    units = TIME_UNITS if dimension == "time" else UNITS[dimension]
    fitting = [
        c for c in columns if re.fullmatch(_NAMES[channel], c.name) and (c.unit is None or c.unit in units)
    ]
    moving = [c for c in fitting if np.isfinite(c.values).any() and np.nanmax(c.values) > np.nanmin(c.values)]
    with_unit = [c for c in moving if c.unit is not None]
    return next(iter(with_unit or moving or fitting), None)


def _unit(channel: str, column: _Column) -> tuple[str, str]:
    """Unit and why."""
    if column.unit is not None:
        return column.unit, "from its name"
    values = column.values[np.isfinite(column.values)]
    peak, middle = (
        (float(np.abs(values).max()), float(np.abs(np.median(values)))) if len(values) else (0.0, 0.0)
    )
    dimension = SIGNALS[channel].dimension if channel in SIGNALS else "time"
    if dimension == "angle":
        return ("deg" if peak > 1.6 else "rad"), "by its size"
    if dimension == "angular_rate":
        return ("deg_s" if peak > 2.0 else "rad_s"), "by its size"
    if channel == "az_m_s2":
        return ("g" if middle < 3.0 else "ft_s2" if middle > 22.0 else "m_s2"), "by its size"
    if channel == "density_kg_m3":
        return ("slug_ft3" if middle < 0.004 else "kg_m3"), "by its size"
    if dimension == "time":
        step = float(np.median(np.diff(values))) if len(values) > 1 else 1.0
        return ("us" if step > 500.0 else "ms" if step >= 1.0 else "s"), "by its step"
    return next(iter(UNITS[dimension])), "assumed"


def _body(source: Source, chosen: dict[str, _Column]) -> Iterator[str]:
    yield "schema = 1"
    yield f"run_id = {json.dumps(source.path.stem)}"
    time = chosen.get("t_s")
    yield "\n[time]"
    if time is not None:
        yield _entry(time)
        yield f'unit = "{_unit("t_s", time)[0]}"'
    elif source.clocks:
        yield "# each topic has its own times"
    else:
        yield "# no time was found: state column and unit, or"
        yield "rate_hz = 50.0"
    if source.clocks:
        yield '\n[resample] # linear, cubic or previous\nrate_hz = 50.0\nmethod = "linear"'
    for name, signal in SIGNALS.items():
        if name not in chosen:
            continue
        unit, reason = _unit(name, chosen[name])
        sign = ""
        if name == "az_m_s2" and np.nanmedian(chosen[name].values) > 0.0:
            sign = "\nsign = -1 # body z points down: level flight has about -1 g"
        yield f'\n[channels.{name}] # {signal.description}\n{_entry(chosen[name])}\nunit = "{unit}" # {reason}{sign}'
    for name in REQUIRED:
        if name not in chosen:
            yield f"\n# [channels.{name}] # needed, not found: {SIGNALS[name].description}"
            yield '# column = "..."\n# unit = "..."'
    if not {"density_kg_m3", "altitude_m"} & chosen.keys():
        yield "\n# [channels.density_kg_m3] # needed, or altitude_m: a column, or a number"
        yield '# value = 1.225\n# unit = "kg_m3"'


def _entry(column: _Column) -> str:
    entry = f"column = {json.dumps(column.key)}"
    return entry + (f"\nvariable = {json.dumps(column.variable)}" if column.variable else "")


def _judgement(source: Source, body: str, chosen: dict[str, _Column]) -> list[str]:
    """What physics says of the guess."""
    import tomllib

    if not set(REQUIRED) <= chosen.keys():
        missing = [name for name in REQUIRED if name not in chosen]
        return [f"Not found: {', '.join(missing)}."]
    try:
        found = problems(convert(source, MappingFile.model_validate(tomllib.loads(body))))
    except AirtruthError as error:
        return str(error).splitlines()[:1]
    return [p.sentence for p in found] or ["Gravity and kinematics do not contradict it."]


__all__ = ["guess_mapping"]
