"""Files as flight recorders write them: ArduPilot DataFlash, MDF4 and HDF5, from topics with times of their own."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MARK: Final = b"\xa3\x95"
"""First bytes of a DataFlash message."""
FMT: Final = 0x80
"""Type of the message that describes others."""


@dataclass(frozen=True)
class Topic:
    """Fields of one rate.

    Attributes
    ----------
    name : at most four letters for DataFlash.
    t_s : times [s].
    fields : name -> values.
    units : name -> unit as a DataFlash UNIT message or an MDF channel states it.
    letters : format letters of the fields of a DataFlash message; f (float32) for each if empty.
    instance : instance number, which DataFlash writes as field "I"; None writes none.
    """

    name: str
    t_s: Array
    fields: Mapping[str, Array]
    units: Mapping[str, str]
    letters: str = ""
    instance: int | None = None


def dataflash(topics: Sequence[Topic]) -> bytes:
    """A DataFlash log (ArduPilot, libraries/AP_Logger): formats, units, and messages in the order of time."""
    ids = "abcdefghijklmnopqrstuvwxyz"
    units = sorted({u for topic in topics for u in topic.units.values()})
    letter = dict(zip(units, ids, strict=False))
    kinds: dict[str, int] = {}
    head = [_format(FMT, 89, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns")]
    head.append(_format(0x81, 3 + 8 + 1 + 64, "UNIT", "QbZ", "TimeUS,Id,Label"))
    head.append(_format(0x82, 3 + 8 + 1 + 16 + 16, "FMTU", "QBNN", "TimeUS,FmtType,UnitIds,MultIds"))
    head += [_message(0x81, struct.pack("<Qb64s", 1, ord(letter[u]), u.encode())) for u in units]
    blocks: list[tuple[Array, NDArray[np.uint8]]] = []
    for topic in topics:
        letters = topic.letters or "f" * len(topic.fields)
        own = "" if topic.instance is None else "B"
        names = ["TimeUS", *(["I"] if own else []), *topic.fields]
        body = np.dtype(
            [("m", "<u2"), ("k", "u1"), ("t", "<u8"), *([("i", "u1")] if own else [])]
            + [(f"f{i}", _NUMPY[c]) for i, c in enumerate(letters)]
        )
        if topic.name not in kinds:
            kinds[topic.name] = 0x90 + len(kinds)
            kind = kinds[topic.name]
            head.append(_format(kind, body.itemsize, topic.name, "Q" + own + letters, ",".join(names)))
            marks = "-" + ("#" if own else "")
            marks += "".join(letter.get(topic.units.get(n, ""), "-") for n in topic.fields)
            head.append(_message(0x82, struct.pack("<QB16s16s", 1, kind, marks.encode(), b"-" * len(marks))))
        table = np.zeros(len(topic.t_s), body)
        table["m"], table["k"] = struct.unpack("<H", MARK)[0], kinds[topic.name]
        table["t"] = np.round(topic.t_s * 1e6).astype(np.uint64)
        if own:
            table["i"] = topic.instance
        for i, (c, values) in enumerate(zip(letters, topic.fields.values(), strict=True)):
            scaled = values * {"c": 1e2, "C": 1e2, "e": 1e2, "E": 1e2, "L": 1e7}.get(c, 1.0)
            table[f"f{i}"] = scaled if c in "fdg" else np.round(scaled)
        blocks.append((topic.t_s, table.view(np.uint8).reshape(len(table), -1)))
    return b"".join(head) + _in_order(blocks)


def mdf4(path: Path, topics: Sequence[Topic]) -> None:
    """An MDF4 file with one channel group for each topic."""
    from asammdf import MDF, Signal

    with MDF(version="4.10") as mdf:
        for topic in topics:
            signals = [
                Signal(
                    samples=np.asarray(v, dtype=np.float64),
                    timestamps=topic.t_s,
                    name=n,
                    unit=topic.units.get(n, ""),
                )
                for n, v in topic.fields.items()
            ]
            mdf.append(signals, acq_name=topic.name, comment=topic.name)
        mdf.save(path, overwrite=True)


def hdf5(path: Path, topics: Sequence[Topic], matrix: bool = False) -> None:
    """An HDF5 file with a group for each topic, or with a labelled matrix for each."""
    import h5py

    with h5py.File(path, "w") as file:
        for topic in topics:
            if matrix:
                data = np.column_stack([topic.t_s, *topic.fields.values()])
                file.create_dataset(topic.name, data=data).attrs["columns"] = ["time", *topic.fields]
                continue
            group = file.create_group(topic.name)
            group.create_dataset("time", data=topic.t_s).attrs["units"] = "s"
            for name, values in topic.fields.items():
                group.create_dataset(name, data=values).attrs["units"] = topic.units.get(name, "")


_NUMPY: Final = {
    "f": "<f4",
    "d": "<f8",
    "h": "<i2",
    "H": "<u2",
    "i": "<i4",
    "I": "<u4",
    "c": "<i2",
    "L": "<i4",
    "B": "<u1",
}
"""Letter of a format -> numpy type."""


def _message(kind: int, body: bytes) -> bytes:
    return MARK + bytes([kind]) + body


def _format(kind: int, length: int, name: str, letters: str, columns: str) -> bytes:
    return _message(
        FMT, struct.pack("<BB4s16s64s", kind, length, name.encode(), letters.encode(), columns.encode())
    )


def _in_order(blocks: Sequence[tuple[Array, NDArray[np.uint8]]]) -> bytes:
    """Messages of all topics in the order of their times."""
    times = np.concatenate([t for t, _ in blocks])
    order = np.argsort(times, kind="stable")
    lengths = np.concatenate([np.full(len(t), rows.shape[1]) for t, rows in blocks])
    starts = np.concatenate([[0], np.cumsum(lengths[order])])
    target = np.empty(len(order), dtype=np.int64)
    target[order] = starts[:-1]
    out = np.empty(int(starts[-1]), dtype=np.uint8)
    first = 0
    for t, rows in blocks:
        at = target[first : first + len(t)]
        out[at[:, None] + np.arange(rows.shape[1])[None, :]] = rows
        first += len(t)
    return out.tobytes()


__all__ = ["Topic", "dataflash", "hdf5", "mdf4"]
