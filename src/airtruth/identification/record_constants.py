"""Mass, inertia and reference lengths that records state, which replace those of the aircraft.

An imported log keeps them in its metadata under ``record_constants``, run by run (docs/measured.md).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass, fields, replace
from typing import Final

import numpy as np

from airtruth.aircraft import Aircraft
from airtruth.errors import ConfigurationError, LogError, choices
from airtruth.logs.flight_log import Batch, FlightLog, batches
from airtruth.physics.motion import LATERAL, LONGITUDINAL, Motion
from airtruth.physics.short_period import PitchConstants


@dataclass(frozen=True)
class RecordConstants:
    """Constants of an aircraft: S [m2], c [m], m [kg], Iyy [kg m2]."""

    wing_area_m2: float
    chord_m: float
    mass_kg: float
    inertia_yy_kg_m2: float


@dataclass(frozen=True)
class LateralValues(RecordConstants):
    """Constants of an aircraft whose lateral-directional motion is identified: further b [m], Ixx, Izz, Ixz [kg m2]."""

    span_m: float
    inertia_xx_kg_m2: float
    inertia_zz_kg_m2: float
    inertia_xz_kg_m2: float


NAMES: Final = tuple(f.name for f in fields(LateralValues))
"""Names of the constants."""
_SIGNED: Final = ("inertia_xz_kg_m2",)
"""Constants that may be zero or negative."""
CG: Final = "cg_mac"
"""Centre of gravity aft of the leading edge of the mean aerodynamic chord, in chords [-]; only differences count."""
REFERENCE: Final = ("wing_area_m2", "chord_m", "span_m")
"""Constants that normalise the derivatives, which a joint estimate therefore needs in common."""


@dataclass(frozen=True)
class EqualRuns:
    """Runs of one length, rate and loading.

    Attributes
    ----------
    batch : the runs.
    constants : those of these runs.
    cg_mac : centre of gravity that the log states for them [-], see `CG`; None if it states none.
    """

    batch: Batch
    constants: PitchConstants
    cg_mac: float | None


def stated(metadata: Mapping[str, object], run_id: str) -> dict[str, float]:
    """Constants that a log's metadata states for a run, in SI; {} if none.

    Raises
    ------
    LogError
        If it states anything but positive numbers under known names.
    """
    table = metadata.get("record_constants", {})
    raw = table.get(run_id, {}) if isinstance(table, Mapping) else table
    if not isinstance(raw, Mapping):
        raise LogError(f"record_constants of run {run_id!r}: must be a table of {', '.join(NAMES)}")
    known: dict[str, float] = {}
    for name, value in raw.items():
        if name not in (*NAMES, CG):
            raise LogError(f"record_constants of run {run_id!r}: {name!r}: {choices(name, (*NAMES, CG))}")
        number = isinstance(value, int | float) and not isinstance(value, bool)
        least = -np.inf if name in _SIGNED else 0.0
        if not number or not least < value < np.inf:
            must = "finite" if name in _SIGNED else "above 0"
            raise LogError(f"record_constants of run {run_id!r}: {name} = {value!r}: must be {must}")
        known[name] = float(value)
    return known


def of_run(constants: PitchConstants, metadata: Mapping[str, object], run_id: str) -> PitchConstants:
    """The aircraft with the constants that the log states for a run; itself if it states none.

    Raises
    ------
    LogError
        As `stated`.
    """
    known = {name: value for name, value in stated(metadata, run_id).items() if name != CG}
    if not known:
        return constants
    if isinstance(constants, Aircraft):  # its declared sensors remain
        return constants.model_copy(update={"constants": constants.constants.model_copy(update=known)})
    kind = (
        LateralValues
        if all(name in known or stated_value(constants, name) for name in NAMES)
        else RecordConstants
    )
    return kind(**{f.name: known.get(f.name, stated_value(constants, f.name)) for f in fields(kind)})


def stated_value(constants: object, name: str) -> float:
    """A constant of an aircraft, or of the table of constants within; 0 where it states none."""
    within = getattr(constants, "constants", None)
    value = getattr(constants, name, getattr(within, name, 0.0))
    return float(value) if value is not None else 0.0


def values_of(constants: PitchConstants, motion: Motion = LONGITUDINAL) -> RecordConstants:
    """The constants that the identification of a motion needs, alone.

    Raises
    ------
    ConfigurationError
        If the aircraft lacks one that the lateral-directional motion needs, naming it.
    """
    kind = LateralValues if motion is LATERAL else RecordConstants
    values = {f.name: stated_value(constants, f.name) for f in fields(kind)}
    if motion is LATERAL:
        lacking = [name for name, value in values.items() if not value > 0.0 and name not in _SIGNED]
        if lacking:
            key, _, _ = lacking[0].partition("_kg" if "_kg" in lacking[0] else "_m")
            table = "geometry" if "span" in key or "wing" in key else "mass"
            raise ConfigurationError(
                f"the {motion.name} motion needs {lacking[0]}, which the aircraft lacks; state {key} under [{table}] in "
                "aircraft.toml, or use --motion longitudinal"
            )
        if values["inertia_xz_kg_m2"] ** 2 >= values["inertia_xx_kg_m2"] * values["inertia_zz_kg_m2"]:
            raise ConfigurationError(
                f"inertia_xz of the aircraft = {values['inertia_xz_kg_m2']:g} kg m2: its square must be below inertia_xx times "
                "inertia_zz; correct [mass] in aircraft.toml"
            )
    return kind(**values)


def with_constants(
    log: FlightLog, constants: PitchConstants, motion: Motion = LONGITUDINAL
) -> Iterator[EqualRuns]:
    """Batches of a log whose runs share their constants and centre of gravity.

    Raises
    ------
    LogError
        As `stated`.
    """
    for batch in batches(log):
        groups: dict[tuple[float, ...], list[int]] = {}
        owners: dict[tuple[float, ...], tuple[PitchConstants, float | None]] = {}
        for run, run_id in enumerate(batch.run_ids):
            own = of_run(constants, log.metadata, run_id)
            cg = stated(log.metadata, run_id).get(CG)
            values = values_of(own, motion)
            key = (*astuple(values), -1.0 if cg is None else cg)
            groups.setdefault(key, []).append(run)
            owners.setdefault(key, (own, cg))
        for key, runs in groups.items():
            yield EqualRuns(batch if len(groups) == 1 else _some(batch, runs), *owners[key])


def by_loading(parts: Sequence[EqualRuns]) -> dict[float | None, list[EqualRuns]]:
    """Parts of a joint estimate by their centre of gravity; mass and inertia may differ within a group.

    Raises
    ------
    ConfigurationError
        If reference lengths differ, or only some runs state a centre of gravity.
    """
    first = parts[0]
    groups: dict[float | None, list[EqualRuns]] = {}
    for part in parts:
        for name in REFERENCE:
            a, b = (stated_value(one.constants, name) for one in (first, part))
            if a != b:
                raise ConfigurationError(
                    f"--joint: {name} is {a:.6g} in run {first.batch.run_ids[0]!r} and {b:.6g} in run "
                    f"{part.batch.run_ids[0]!r}, and the derivatives are normalised by it; state one value for all runs"
                )
        if (part.cg_mac is None) != (first.cg_mac is None):
            lacking = part if part.cg_mac is None else first
            raise ConfigurationError(
                f"--joint: run {lacking.batch.run_ids[0]!r} states no {CG} and others do; state it under [constants] in "
                "all mappings, or in none"
            )
        groups.setdefault(part.cg_mac, []).append(part)
    return groups


def differing(
    metadata: Mapping[str, object], run_ids: Sequence[str], constants: PitchConstants
) -> list[tuple[str, str, float, float]]:
    """(run, name, value of the record, value of the aircraft) where a record states another value."""
    return [
        (run, name, value, stated_value(constants, name))
        for run in run_ids
        for name, value in stated(metadata, run).items()
        if name != CG and value != stated_value(constants, name)
    ]


def _some(batch: Batch, runs: Sequence[int]) -> Batch:
    index = np.asarray(runs)
    return replace(
        batch,
        run_ids=tuple(batch.run_ids[i] for i in runs),
        t_s=batch.t_s[index],
        channels={name: np.ascontiguousarray(values[index]) for name, values in batch.channels.items()},
    )
