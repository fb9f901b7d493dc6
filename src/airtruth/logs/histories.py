"""Measured records beside their simulations by one or more models, and the file that keeps them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Final, NotRequired

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from pydantic import Field, TypeAdapter, ValidationError
from typing_extensions import TypedDict

from airtruth.channels import RUN_ID, TIME
from airtruth.errors import StoreError
from airtruth.logs.tables import read_metadata, read_table, require_kinds, write_table
from airtruth.physics.motion import LONGITUDINAL

Array = NDArray[np.float64]

FILE: Final = "records.parquet"
"""Name of the file in the folder of a trace."""
CONTROLS: Final = tuple(control.channel for control in LONGITUDINAL.controls)
"""Channels that drive the simulations where a file states no others."""
KEY: Final = "histories"
"""Key of the file-level JSON that describes the records."""


_LARGEST: Final = 1e30
"""Size from which a value is no measurement [SI] (judgement: beyond any quantity)."""


@dataclass(frozen=True)
class History:
    """One record and its simulations.

    Attributes
    ----------
    run_id : name of the record.
    group : "fitted", "held out", or "" where records are not divided.
    t_s : (samples,) time from the start of the record [s].
    controls_rad : channel -> (samples,) measured control surface [rad].
    measured : channel -> (samples,) measured values in SI.
    models : model -> channel -> (samples,) simulation from the controls, without correction by measurements.
    innovations : model -> channel -> (samples,) whitened errors of the prediction one sample ahead [-].
    effect : channel -> (samples,) part of the simulation that the accepted effects make.
    floor : channel -> root mean square of a simulation's error that gusts and sensor noise alone explain.
    conditions : quantity, with its unit in the name -> value.
    """

    run_id: str
    group: str
    t_s: Array
    controls_rad: Mapping[str, Array]
    measured: Mapping[str, Array]
    models: Mapping[str, Mapping[str, Array]]
    innovations: Mapping[str, Mapping[str, Array]] = field(default_factory=dict)
    effect: Mapping[str, Array] = field(default_factory=dict)
    floor: Mapping[str, float] = field(default_factory=dict)
    conditions: Mapping[str, float] = field(default_factory=dict)

    def residual(self, model: str, channel: str) -> Array:
        """(samples,) measurement less simulation."""
        return np.asarray(self.measured[channel] - self.models[model][channel])

    def rms(self, model: str, channel: str) -> float:
        """Root mean square of `residual`."""
        with np.errstate(over="ignore"):
            return float(np.sqrt(np.mean(self.residual(model, channel) ** 2)))


@dataclass(frozen=True)
class Histories:
    """Records with their simulations.

    Attributes
    ----------
    records : the records.
    models : names of the models in the order of the report.
    shown : name of the record that a report shows first.
    of_records : number of records from which ``records`` were chosen.
    facts : further entries of the file, of types that JSON has.
    """

    records: tuple[History, ...]
    models: tuple[str, ...]
    shown: str
    of_records: int
    facts: Mapping[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        """Return the number of records and the models in a line."""
        return f"Histories({len(self.records)} of {self.of_records} records; {', '.join(self.models)})"

    @property
    def first(self) -> History:
        """The record that a report shows first."""
        return next((r for r in self.records if r.run_id == self.shown), self.records[0])


class _Record(TypedDict):
    group: str
    floor: dict[str, float]
    conditions: dict[str, float]


class _Document(TypedDict):
    channels: Annotated[list[str], Field(min_length=1)]
    models: Annotated[list[str], Field(min_length=1)]
    shown: str
    of_records: int
    innovations: bool
    effect: bool
    records: dict[str, _Record]
    controls: NotRequired[list[str]]
    facts: NotRequired[dict[str, Any]]


def write_histories(path: Path, histories: Histories) -> None:
    """Write records to a Parquet file, one row per sample, columns in SI.

    Raises
    ------
    StoreError
        If the file cannot be written.
    """
    first = histories.records[0]
    channels, controls = list(first.measured), list(first.controls_rad)
    columns: dict[str, Any] = {
        RUN_ID: pa.array([r.run_id for r in histories.records for _ in r.t_s], pa.string())
    }
    for name in _columns(controls, channels, histories.models, bool(first.innovations), bool(first.effect)):
        columns[name] = np.concatenate([_series(record, name) for record in histories.records])
    document = {
        "channels": channels,
        "models": list(histories.models),
        "shown": histories.shown,
        "of_records": histories.of_records,
        "innovations": bool(first.innovations),
        "effect": bool(first.effect),
        "records": {
            r.run_id: {"group": r.group, "floor": _finite(r.floor), "conditions": _finite(r.conditions)}
            for r in histories.records
        },
        "facts": dict(histories.facts),
    }
    if tuple(controls) != CONTROLS:
        document["controls"] = controls
    write_table(path, pa.table(columns), {KEY: document})


def read_histories(path: Path, cure: str) -> Histories:
    """Read a file that `write_histories` wrote.

    Parameters
    ----------
    path : the file.
    cure : what writes it again, for messages.

    Raises
    ------
    StoreError, LogError
        If the file cannot be read or is not complete.
    """
    metadata = read_metadata(path)
    try:
        document = TypeAdapter(_Document).validate_python(metadata.get(KEY))
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"])) or KEY
        raise StoreError(f"{path}: is not complete ({where}: {first['msg'].lower()}); {cure}") from None
    channels, models = document["channels"], document["models"]
    controls = document.get("controls", list(CONTROLS))
    names = _columns(controls, channels, models, document["innovations"], document["effect"])
    frame = read_table(path)
    require_kinds(path, frame, {RUN_ID: "text", **dict.fromkeys(names, "number")}, cure)
    values = {name: _of_motion(frame[name].to_numpy(dtype=np.float64)) for name in names}
    runs = frame[RUN_ID].to_numpy(dtype=object)
    records = []
    for run_id, described in document["records"].items():
        own = {name: column[runs == run_id] for name, column in values.items()}
        if len(own[TIME]):
            records.append(_history(run_id, described, document, own))
    if not records:
        raise StoreError(f"{path}: holds no record; {cure}")
    return Histories(
        tuple(records), tuple(models), document["shown"], document["of_records"], document.get("facts", {})
    )


def _columns(
    controls: list[str],
    channels: list[str],
    models: list[str] | tuple[str, ...],
    innovations: bool,
    effect: bool,
) -> list[str]:
    kinds = ["free_run", "innovation"] if innovations else ["free_run"]
    names = [TIME, *controls]
    for channel in channels:
        names += [f"{channel}_measured", *(f"{channel}_{kind}_{m}" for m in models for kind in kinds)]
        names += [f"{channel}_effect"] if effect else []
    return list(dict.fromkeys(names))


def _finite(values: Mapping[str, float]) -> dict[str, float]:
    return {name: value for name, value in values.items() if math.isfinite(value)}


def _of_motion(values: Array) -> Array:
    """Values with NaN in place of those that no motion has, whose squares would overflow."""
    with np.errstate(invalid="ignore"):
        return np.where(np.abs(values) < _LARGEST, values, np.nan)


def _series(record: History, name: str) -> Array:
    return dict(_named(record))[name]


def _named(record: History) -> Iterator[tuple[str, Array]]:
    yield TIME, record.t_s
    yield from record.controls_rad.items()
    for channel, measured in record.measured.items():
        yield f"{channel}_measured", measured
        for model, simulated in record.models.items():
            yield f"{channel}_free_run_{model}", simulated[channel]
        for model, innovation in record.innovations.items():
            yield f"{channel}_innovation_{model}", innovation[channel]
        if record.effect:
            yield f"{channel}_effect", record.effect[channel]


def _history(run_id: str, described: _Record, document: _Document, own: Mapping[str, Array]) -> History:
    channels, models = document["channels"], document["models"]

    def by_model(kind: str) -> dict[str, dict[str, Array]]:
        return {m: {c: own[f"{c}_{kind}_{m}"] for c in channels} for m in models}

    return History(
        run_id=run_id,
        group=described["group"],
        t_s=own[TIME],
        controls_rad={c: own[c] for c in document.get("controls", CONTROLS)},
        measured={c: own[f"{c}_measured"] for c in channels},
        models=by_model("free_run"),
        innovations=by_model("innovation") if document["innovations"] else {},
        effect={c: own[f"{c}_effect"] for c in channels} if document["effect"] else {},
        floor={name: v for name, v in described["floor"].items() if 0.0 < v < _LARGEST},
        conditions={name: v for name, v in described["conditions"].items() if abs(v) < _LARGEST},
    )


__all__ = ["CONTROLS", "FILE", "Histories", "History", "read_histories", "write_histories"]
