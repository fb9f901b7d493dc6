"""Damaged files of other formats, imported through a mapping or described by a guess."""

from __future__ import annotations

import io
import struct
import tempfile
import tomllib
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from random import Random
from typing import Any, Final

import h5py
import numpy as np
import pandas as pd
import scipy.io

from airtruth import importers
from airtruth.importers import MappingFile, guess_mapping, import_log, read_dictionary
from airtruth.isolation import client
from airtruth.logs.flight_log import FlightLog
from validation import recorders
from validation.fuzz import logs
from validation.fuzz.mutate import NUMBERS, WORDS, damaged
from validation.recorders import Topic

_KNOWN: Final = Path(importers.__file__).parent / "known"
"""Folder of the sources that the package knows."""
DEG: Final = np.pi / 180.0
"""Degree [rad]."""
NAMES: Final = {
    "airspeed_m_s": ("TAS", "m/s", 1.0),
    "alpha_rad": ("AOA", "deg", DEG),
    "theta_rad": ("Pitch", "deg", DEG),
    "q_rad_s": ("PitchRate", "deg/s", DEG),
    "ax_m_s2": ("Ax", "m/s^2", 1.0),
    "az_m_s2": ("Az", "m/s^2", 1.0),
    "elevator_rad": ("Elev", "deg", DEG),
    "altitude_m": ("Hp", "m", 1.0),
    "density_kg_m3": ("rho", "kg/m3", 1.0),
}
"""Channel -> column, unit and factor of the foreign files."""


@cache
def columns() -> dict[str, np.ndarray]:
    """One run of the base log as a test centre might write it."""
    log: FlightLog = logs.base()
    rows = log.rows(0)
    own = {column: log.channels[name][rows] / factor for name, (column, _, factor) in NAMES.items()}
    return {"time": log.t_s[rows], **own}


@cache
def mapping() -> dict[str, Any]:
    """The mapping of the columns by name."""
    channels = {name: {"column": column, "unit": unit} for name, (column, unit, _) in NAMES.items()}
    return {"schema": 1, "run_id": "flight", "time": {"column": "time", "unit": "s"}, "channels": channels}


def by_number(matrix: str) -> dict[str, Any]:
    """The mapping of the columns of a matrix, or of a table without a header if ``matrix`` is empty."""

    def place(column: int) -> dict[str, Any]:
        return {"column": column} | ({"variable": matrix} if matrix else {})

    channels = {name: place(k) | {"unit": unit} for k, (name, (_, unit, _)) in enumerate(NAMES.items(), 2)}
    return {"schema": 1, "run_id": "flight", "time": place(1), "channels": channels}


def _renamed(prefix: str, **more: Any) -> dict[str, Any]:
    channels = {
        name: entry | {"column": f"{prefix}{entry['column']}"}
        for name, entry in mapping()["channels"].items()
    }
    return {"schema": 1, "run_id": "flight", "channels": channels, **more}


@cache
def csv() -> tuple[tuple[bytes, dict[str, Any]], ...]:
    """A table with commas, and one with semicolons, decimal commas and comments."""
    frame = pd.DataFrame(columns())
    plain = frame.to_csv(index=False, float_format="%.9g").encode()
    other = ("% by hand\n" + frame.to_csv(index=False, sep=";", decimal=",", float_format="%.9g")).encode()
    return (plain, mapping()), (other, mapping() | {"source": {"delimiter": ";", "decimal": ","}})


@cache
def table() -> tuple[tuple[bytes, dict[str, Any]], ...]:
    """A table of blanks without names."""
    out = io.BytesIO()
    np.savetxt(out, np.column_stack(list(columns().values())), fmt="%.9g")
    return ((out.getvalue(), by_number("")),)


@cache
def mat5() -> tuple[tuple[bytes, dict[str, Any]], ...]:
    """A struct, and a matrix with names of its columns, plain and compressed."""
    results = []
    for compressed in (False, True):
        out = io.BytesIO()
        matrix = np.column_stack(list(columns().values()))
        content = {"fdata": matrix, "note": "text", "count": np.arange(9, dtype=np.int16)}
        scipy.io.savemat(out, content, do_compression=compressed)
        results.append((out.getvalue(), by_number("fdata")))
        out = io.BytesIO()
        scipy.io.savemat(
            out, {"rec": {"imu": columns(), "names": list(columns())}}, do_compression=compressed
        )
        results.append((out.getvalue(), _renamed("rec.imu.", time={"column": "rec.imu.time", "unit": "s"})))
    return tuple(results)


@cache
def mat73() -> tuple[tuple[bytes, dict[str, Any]], ...]:
    """A matrix and a group of vectors, some of them compressed."""
    out = io.BytesIO()
    with h5py.File(out, "w", userblock_size=512) as file:
        file.create_dataset("fdata", data=np.column_stack(list(columns().values())).T)
        file["fdata"].attrs["MATLAB_class"] = np.bytes_("double")
        group = file.create_group("rec")
        for name, values in columns().items():
            group.create_dataset(name, data=values[None], compression="gzip", shuffle=True)
    content = out.getvalue()
    return (content, by_number("fdata")), (
        content,
        _renamed("rec.", time={"column": "rec.time", "unit": "s"}),
    )


@cache
def parquet() -> tuple[tuple[bytes, dict[str, Any]], ...]:
    """A table with an index, text and times."""
    out = io.BytesIO()
    frame = pd.DataFrame(columns()).assign(note="text", when=pd.Timestamp("2019-07-01"))
    frame.to_parquet(out)
    return ((out.getvalue(), mapping()),)


@cache
def ulg() -> tuple[tuple[bytes, dict[str, Any]], ...]:
    """A PX4 log with two topics of their own rates, a parameter, a message and a dropout."""

    def message(kind: str, body: bytes) -> bytes:
        return struct.pack("<HB", len(body), ord(kind)) + body

    names = list(NAMES)
    fields = "".join(f"float {name};" for name in names[1:])
    parts = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0), message("B", bytes(40))]
    parts += [message("I", b"\x08char[3] sabc")]
    parts += [message("F", b"air:uint64_t timestamp;float v;float[2] raw;")]
    parts += [message("F", f"att:uint64_t timestamp;{fields}".encode())]
    parts += [message("P", b"\x07float P" + struct.pack("<f", 1.0))]
    parts += [
        message("A", struct.pack("<BH", 0, 0) + b"air"),
        message("A", struct.pack("<BH", 0, 1) + b"att"),
    ]
    values = columns()
    for i, t in enumerate(values["time"]):
        stamp = round(1e6 * t)
        own = [float(values[NAMES[name][0]][i]) for name in names]
        parts.append(message("D", struct.pack("<HQ3f", 0, stamp + 3, own[0], 1.0, 2.0)))
        parts.append(message("D", struct.pack(f"<HQ{len(own) - 1}f", 1, stamp, *own[1:])))
        if i == 20:
            parts += [
                message("L", b"6" + struct.pack("<Q", stamp) + b"hello"),
                message("O", struct.pack("<H", 20)),
            ]
    channels = {
        name: {"column": "air.v" if name == names[0] else f"att.{name}", "unit": unit}
        for name, (_, unit, _) in NAMES.items()
    }
    text = {
        "schema": 1,
        "run_id": "f",
        "resample": {"rate_hz": 50.0, "method": "linear"},
        "channels": channels,
    }
    return ((b"".join(parts), text),)


def _topics() -> list[Topic]:
    """The columns as two topics, one of them without the airspeed."""
    values = columns()
    t = values["time"] + 36.0
    first, *rest = [column for column, _, _ in NAMES.values()]
    units = {column: unit for column, unit, _ in NAMES.values()}
    return [
        Topic("AIR", t + 3e-6, {first: values[first]}, units),
        Topic("ATT", t, {n: values[n] for n in rest}, units),
    ]


def _by_topic(prefixes: tuple[str, str], **more: Any) -> dict[str, Any]:
    channels = {
        name: {"column": f"{prefixes[number > 0]}{column}", "unit": unit}
        for number, (name, (column, unit, _)) in enumerate(NAMES.items())
    }
    resample = {"rate_hz": 50.0, "method": "linear"}
    return {"schema": 1, "run_id": "f", "resample": resample, "channels": channels, **more}


@cache
def dataflash() -> tuple[tuple[bytes, dict[str, Any]], ...]:
    """An ArduPilot log of two messages."""
    return ((recorders.dataflash(_topics()), _by_topic(("AIR.", "ATT."))),)


@cache
def mdf() -> tuple[tuple[bytes, dict[str, Any]], ...]:
    """An MDF4 file of two channel groups."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "f.mf4"
        recorders.mdf4(path, _topics())
        return ((path.read_bytes(), _by_topic(("", ""))),)


@cache
def hdf5() -> tuple[tuple[bytes, dict[str, Any]], ...]:
    """An HDF5 file of two groups."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "f.h5"
        recorders.hdf5(path, _topics())
        text = _by_topic(("AIR.", "ATT."))
        for number, entry in enumerate(text["channels"].values()):
            entry["clock"] = {"column": ("ATT.time" if number else "AIR.time"), "unit": "s"}
        return ((path.read_bytes(), text),)


def _text(frame: pd.DataFrame, sep: str) -> str:
    return frame.to_csv(index=False, sep=sep, float_format="%.9g", lineterminator="\n")


@cache
def dialects() -> tuple[tuple[bytes, dict[str, Any]], ...]:
    """Prose with a row of units in Windows-1252; bars and a clock that starts again; records one below another with their names.

    In the latter two the airspeed has a third of the rate, and there are lateral columns.
    """
    frame = pd.DataFrame(columns())
    units = ["s", *(unit for _, unit, _ in NAMES.values())]
    head = ["Flugversuch 7, Höhe in m", "", "|".join(frame.columns), "|".join(units)]
    prose = "\n".join([*head, *_text(frame, "|").splitlines()[1:]]).encode("cp1252")
    held = frame.assign(
        TAS=frame["TAS"].to_numpy()[np.arange(len(frame)) // 3 * 3], roll=0.01, **{"yaw [deg]": 359.0}
    )
    again = pd.concat([held.assign(time=held["time"] + 100.0), held])
    stacked = pd.concat([held.assign(Record="first"), held.assign(Record="second")])
    bars = {"source": {"delimiter": "|"}}
    named = {"time": {"column": "time", "unit": "s", "run": "Record"}}
    lateral = {"phi_rad": {"column": "roll", "unit": "rad"}, "psi_rad": {"column": "yaw", "unit": "deg"}}
    wide = {"channels": {**mapping()["channels"], **lateral}}
    return (
        (prose, mapping() | bars),
        (_text(again, "|").encode(), mapping() | bars | wide),
        (_text(stacked, ",").encode(), mapping() | named | wide),
    )


@cache
def structs() -> tuple[tuple[bytes, dict[str, Any]], ...]:
    """Two structs of one layout, plain and compressed, and an array of structs."""
    results = []
    for compressed in (False, True):
        out = io.BytesIO()
        scipy.io.savemat(out, {"a": columns(), "b": columns(), "day": 3.0}, do_compression=compressed)
        results.append((out.getvalue(), mapping() | {"source": {"structs": ["a", "b"]}}))
    out = io.BytesIO()
    array = np.empty((1, 2), dtype=[(name, object) for name in columns()])
    array[0, 0] = array[0, 1] = tuple(columns().values())
    scipy.io.savemat(out, {"runs": array})
    results.append((out.getvalue(), mapping() | {"source": {"structs": ["runs(1)", "runs(2)"]}}))
    return tuple(results)


TEXT: Final = ("csv", "table", "dialects")
"""Formats whose cells are replaced too."""
FORMATS: Final[Mapping[str, tuple[str, Callable[[], tuple[tuple[bytes, dict[str, Any]], ...]]]]] = {
    "csv": ("f.csv", csv),
    "table": ("f.txt", table),
    "mat 5": ("f.mat", mat5),
    "mat 7.3": ("f.mat", mat73),
    "parquet": ("f.parquet", parquet),
    "ulg": ("f.ulg", ulg),
    "dataflash": ("f.bin", dataflash),
    "mdf": ("f.mf4", mdf),
    "hdf5": ("f.h5", hdf5),
    "dialects": ("f.csv", dialects),
    "structs": ("f.mat", structs),
}
"""Format -> file name and its contents with their mappings."""


def damaged_file(rng: Random, name: str) -> tuple[bytes, dict[str, Any]]:
    """A damaged file of a format, and the mapping of the sound one."""
    content, document = rng.choice(FORMATS[name][1]())
    text = name in TEXT and rng.random() < 0.5
    return _cells(rng, content) if text else damaged(rng, content), document


def importing(name: str) -> Callable[[Random, Path], None]:
    """A case that damages a file of a format and imports it, or guesses its mapping."""

    def run(rng: Random, folder: Path) -> None:
        content, document = damaged_file(rng, name)
        path = folder / FORMATS[name][0]
        path.write_bytes(content)
        if rng.random() < 0.2:
            tomllib.loads(guess_mapping(path))
        else:
            import_log(path, MappingFile.model_validate(document), force=rng.random() < 0.5)

    return run


def words_case(rng: Random, folder: Path) -> None:
    """A damaged file of knowledge of a source, and a guess with it."""
    path, table = folder / "words.toml", folder / "f.csv"
    text = rng.choice(sorted(_KNOWN.glob("*.toml"))).read_bytes()
    path.write_bytes(damaged(rng, text) if rng.random() < 0.5 else _cells(rng, text, "utf-8"))
    table.write_bytes(csv()[0][0])
    tomllib.loads(guess_mapping(table, words=read_dictionary(path)))


def _cells(rng: Random, content: bytes, encoding: str = "cp1252") -> bytes:
    """A table of text with cells and lines replaced."""
    lines = content.decode(encoding).splitlines()
    for _ in range(rng.choice((1, 2, 5))):
        at = rng.randrange(len(lines))
        cells = lines[at].split(sep := rng.choice((",", ";", " ", "|")))
        odd = (str(rng.choice(NUMBERS)), rng.choice(WORDS), '"', "1e999", "0x10", "1_0", "#")
        cells[rng.randrange(len(cells))] = rng.choice(odd)
        lines[at] = sep.join(cells)
        if rng.random() < 0.2:
            lines.insert(rng.randrange(len(lines)), rng.choice((lines[0], "", "# x", lines[at] * 2, "\x00")))
    return "\n".join(lines).encode("utf-8", "surrogatepass")


def warm(folder: Path) -> None:
    """Compute the contents before the cases; every one imports as it is."""
    for file, contents in FORMATS.values():
        for content, document in contents():
            (folder / file).write_bytes(content)
            import_log(folder / file, MappingFile.model_validate(document))
    client.close()


__all__ = ["FORMATS", "damaged_file", "importing", "mapping", "warm", "words_case"]
