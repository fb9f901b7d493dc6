"""Mass, inertia and reference lengths that records state for themselves, in place of the aircraft's.

An imported log keeps them in its metadata under ``record_constants``, run by run (docs/measured.md).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass, fields, replace
from typing import Any

import numpy as np

from airtruth.aircraft import Aircraft
from airtruth.errors import ConfigurationError, LogError, choices
from airtruth.identify.condition import AircraftConstants
from airtruth.logs.flight_log import Batch, FlightLog, batches


@dataclass(frozen=True)
class Constants:
    """What an identification must know of the aircraft: S [m2], c [m], m [kg], Iyy [kg m2]."""

    wing_area_m2: float
    chord_m: float
    mass_kg: float
    inertia_yy_kg_m2: float


NAMES = tuple(f.name for f in fields(Constants))


def stated(metadata: Mapping[str, object], run_id: str) -> dict[str, float]:
    """What a log's metadata states of a run, in SI; {} if nothing.

    Raises
    ------
    LogError
        If it states something else than positive numbers under known names.
    """
    table = metadata.get("record_constants", {})
    raw = table.get(run_id, {}) if isinstance(table, Mapping) else table
    if not isinstance(raw, Mapping):
        raise LogError(f"record_constants of run {run_id!r}: has to be a table of {', '.join(NAMES)}")
    found: dict[str, float] = {}
    for name, value in raw.items():
        if name not in NAMES:
            raise LogError(f"record_constants of run {run_id!r}: {name!r}: {choices(name, NAMES)}")
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not number or not 0.0 < value < np.inf:
            raise LogError(f"record_constants of run {run_id!r}: {name} = {value!r}: has to be above 0")
        found[name] = float(value)
    return found


def of_run(constants: AircraftConstants, metadata: Mapping[str, object], run_id: str) -> AircraftConstants:
    """The aircraft with what the log states of a run in place of its own; itself if nothing is stated.

    Raises
    ------
    LogError
        As `stated`.
    """
    known = stated(metadata, run_id)
    if not known:
        return constants
    if isinstance(constants, Aircraft):  # its declared sensors still count
        return constants.model_copy(update={"constants": constants.constants.model_copy(update=known)})
    return Constants(**{name: known.get(name, getattr(constants, name)) for name in NAMES})


def values_of(constants: AircraftConstants) -> Constants:
    """The four numbers alone."""
    return Constants(**{name: float(getattr(constants, name)) for name in NAMES})


def with_constants(log: FlightLog, constants: AircraftConstants) -> Iterator[tuple[Batch, AircraftConstants]]:
    """Batches of a log whose runs share their constants too, each with them.

    Raises
    ------
    LogError
        As `stated`.
    """
    for batch in batches(log):
        groups: dict[tuple[float, ...], list[int]] = {}
        owners: dict[tuple[float, ...], AircraftConstants] = {}
        for run, run_id in enumerate(batch.run_ids):
            own = of_run(constants, log.metadata, run_id)
            key = astuple(values_of(own))
            groups.setdefault(key, []).append(run)
            owners.setdefault(key, own)
        for key, runs in groups.items():
            yield (batch if len(groups) == 1 else _some(batch, runs)), owners[key]


def common(parts: Sequence[tuple[Batch, AircraftConstants]]) -> AircraftConstants:
    """The constants that all parts share.

    Raises
    ------
    ConfigurationError
        If they differ: one estimate then has no one mass.
    """
    first = values_of(parts[0][1])
    for batch, constants in parts:
        own = values_of(constants)
        for name in NAMES:
            a, b = getattr(first, name), getattr(own, name)
            if a != b:
                raise ConfigurationError(
                    f"--joint: {name} is {a:.6g} in run {parts[0][0].run_ids[0]!r} and {b:.6g} in run "
                    f"{batch.run_ids[0]!r}; identify run by run, or leave [constants] out of the mapping so that "
                    "those of the aircraft count for all"
                )
    return parts[0][1]


def note(metadata: Mapping[str, object], run_ids: Sequence[str], constants: AircraftConstants) -> list[Any]:
    """(run, name, value of the record, value of the aircraft) wherever a record states another value."""
    return [
        (run, name, value, float(getattr(constants, name)))
        for run in run_ids
        for name, value in stated(metadata, run).items()
        if value != float(getattr(constants, name))
    ]


def _some(batch: Batch, runs: Sequence[int]) -> Batch:
    index = np.asarray(runs)
    return replace(
        batch,
        run_ids=tuple(batch.run_ids[i] for i in runs),
        t_s=batch.t_s[index],
        channels={name: np.ascontiguousarray(values[index]) for name, values in batch.channels.items()},
    )
