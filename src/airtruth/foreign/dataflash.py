"""ArduPilot DataFlash logs (.bin): every message type has times of its own, and states the units of its fields."""

from __future__ import annotations

import contextlib
import io
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import ConfigurationError, StoreError, reason
from airtruth.foreign.source import Source

Array = NDArray[np.float64]

_TYPES: Final = {
    "b": "<i1", "B": "<u1", "g": "<f2", "h": "<i2", "H": "<u2", "i": "<i4", "I": "<u4", "f": "<f4", "n": "S4", "N": "S16",
    "Z": "S64", "c": "<i2", "C": "<u2", "e": "<i4", "E": "<u4", "L": "<i4", "d": "<f8", "M": "<u1", "q": "<i8", "Q": "<u8",
    "a": "S64",
}  # fmt: skip
"""Letter of a format -> numpy type (ArduPilot, libraries/AP_Logger/LogStructure.h)."""
_DIVISORS: Final = {"c": 1e2, "C": 1e2, "e": 1e2, "E": 1e2, "L": 1e7}
"""Letter of a format -> divisor of its integers [-] (same source)."""
_HEADER: Final = 3
"""Bytes before the fields of a message: two that mark its start, and its type (same source)."""
_MARK: Final = b"\xa3\x95"
"""First bytes of a message (same source)."""
_CHUNK: Final = 50_000
"""Messages that are decoded at a time [-] (judgement: bounds the memory to some 30 MB)."""
_TIMES: Final = {"TimeUS": 1e-6, "TimeMS": 1e-3}
"""Field with the time of a message -> factor to seconds [s]."""


def read_dataflash(path: Path) -> Source:
    """Fields as "MESSAGE.Field", of further instances "MESSAGE#1.Field", with times [s] and units.

    The messages are located by pymavlink and decoded here, a type at a time: one hour has millions of messages.

    Raises
    ------
    ConfigurationError
        If pymavlink is not installed.
    StoreError
        If the file is no DataFlash log, or holds no message with a time.
    """
    try:
        from pymavlink.DFReader import DFReader_binary
    except ImportError:
        raise ConfigurationError(
            f"{path}: ArduPilot logs need pymavlink; run: pip install airtruth[ardupilot]"
        ) from None
    with path.open("rb") as file:
        if file.read(2) != _MARK:
            raise StoreError(
                f"{path}: is not a DataFlash log, which begins with the bytes A3 95; download it again"
            )
    try:
        with contextlib.redirect_stderr(io.StringIO()), contextlib.redirect_stdout(io.StringIO()):
            log = DFReader_binary(str(path))  # it prints a line for each damaged byte
    except MemoryError:
        raise
    except Exception as error:  # pymavlink raises struct.error, KeyError, ValueError and plain Exception
        raise StoreError(
            f"{path}: is not a DataFlash log, or is damaged ({reason(error)}); download it again"
        ) from None
    arrays: dict[str, NDArray[Any]] = {}
    clocks: dict[str, Array] = {}
    units: dict[str, str] = {}
    content = np.frombuffer(log.data_map, dtype=np.uint8)
    for kind, form in sorted(log.formats.items()):
        time = next((name for name in _TIMES if name in form.columns), None)
        if time is None or not len(log.offsets[kind]):
            continue
        fields = _decoded(content, np.asarray(log.offsets[kind], dtype=np.int64), form)
        for suffix, rows in _instances(fields, form.instance_field):
            times = fields[time][rows].astype(np.float64) * _TIMES[time]
            for name, values in fields.items():
                if values.dtype.kind not in "biuf" or name == form.instance_field:
                    continue
                key = f"{form.name}{suffix}.{name}"
                arrays[key], clocks[key] = values[rows], times
                if form.units is not None and form.get_unit(name):
                    units[key] = form.get_unit(name)
    if not arrays:
        raise StoreError(f"{path}: the log holds no message with a time; record it again")
    return Source(path, arrays, clocks, units=units, ordered=False)


def _decoded(content: NDArray[np.uint8], offsets: NDArray[np.int64], form: Any) -> dict[str, NDArray[Any]]:
    """Fields of all whole messages of a type; the last one of a file may be cut off."""
    letters = form.format.rstrip("\0")
    names = form.columns[: len(letters)]
    layout = np.dtype([(f"f{i}", _TYPES[letter]) for i, letter in enumerate(letters)])
    whole = offsets[offsets + _HEADER + layout.itemsize <= len(content)]
    body = np.arange(_HEADER, _HEADER + layout.itemsize)[None, :]
    table = np.empty(len(whole), dtype=layout)
    for first in range(0, len(whole), _CHUNK):  # the index has eight times the bytes that it selects
        part = content[whole[first : first + _CHUNK, None] + body]
        table[first : first + _CHUNK] = np.ascontiguousarray(part).view(layout)[:, 0]
    fields = {}
    for i, (letter, name) in enumerate(zip(letters, names, strict=False)):
        values = table[f"f{i}"]
        fields[name] = values / _DIVISORS[letter] if letter in _DIVISORS else values.copy()
    return fields


def _instances(fields: dict[str, NDArray[Any]], field: str | None) -> list[tuple[str, NDArray[np.bool_]]]:
    """Suffix and rows of each instance of a message; instance 0 has no suffix."""
    first = next(iter(fields.values()))
    if field is None or field not in fields or fields[field].dtype.kind not in "iu":
        return [("", np.ones(len(first), dtype=np.bool_))]
    numbers = fields[field]
    return [(f"#{n}" if n else "", numbers == n) for n in np.unique(numbers).tolist()]


__all__ = ["read_dataflash"]
