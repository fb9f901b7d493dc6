"""Page of estimates: the answer, intervals, records against model, provenance."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from airtruth.aircraft import Aircraft
from airtruth.errors import AirtruthError, ConfigurationError, StoreError
from airtruth.identification.estimates import JOINT
from airtruth.identification.methods import DEFAULT
from airtruth.identification.record_constants import LateralValues, RecordConstants, values_of
from airtruth.identification.simulated import simulated_records, spaced
from airtruth.identification.store import other_constants
from airtruth.identification.stored import Record, read_stored
from airtruth.logs.digest import sha256_of
from airtruth.logs.histories import Histories
from airtruth.logs.sources import Logs
from airtruth.physics.motion import LATERAL, LONGITUDINAL, Motion, motion_of
from airtruth.table import significant

if TYPE_CHECKING:
    import pandas as pd

    from airtruth.reporting.pages.declared import DeclaredDerivatives

SIMULATED: Final[Mapping[str, str]] = {
    LONGITUDINAL.name: "Simulation: the linear short period with the derivatives of each method, from the measured elevator, at "
    "the mean airspeed and density of the record; initial state, trim and offset of az are fitted to each record, alike for all "
    "methods.",
    LATERAL.name: "Simulation: the linear motion with the derivatives of each method, from the measured controls, airspeed and "
    "pitching motion; initial state and biases of the outputs are fitted to each record. No gust is simulated.",
}
"""Motion -> how the models of an identification are simulated."""


@dataclass(frozen=True)
class Identified:
    """Estimates with what is known of their origin.

    Attributes
    ----------
    frame : rows of contract 2; those of the records alone where more are not needed.
    records : method -> how its rows were made; empty in old files.
    histories : records against model, None where they cannot be simulated; ``reason`` says why.
    declared : derivatives of the declared aircraft, None where it was not given.
    """

    frame: pd.DataFrame
    records: Mapping[str, Record]
    histories: Histories | None
    reason: str = ""
    declared: DeclaredDerivatives | None = None

    @property
    def confidence(self) -> float:
        """Probability of the intervals [-]."""
        stated = next(iter(self.records.values()), None)
        value = stated["options"].get("confidence", 0.95) if stated else 0.95
        return float(value) if isinstance(value, int | float) else 0.95


def read_identified(
    path: Path,
    logs: Logs | None = None,
    aircraft: Aircraft | None = None,
    layout: tuple[int, int] | None = None,
) -> Identified:
    """Read a file of estimates, and simulate the records of its logs.

    Parameters
    ----------
    path : the file.
    logs : its logs; None looks for them beside the file and in the folder ``logs`` there.
    aircraft : the declared aircraft, another model of the records; None for none.
    layout : numbers of runs and methods of a file that has all methods of a run together, of which the rows of the records
        alone are read; None for any other file.

    Raises
    ------
    StoreError, LogError
        If the file cannot be read or is damaged, or a log that is given cannot be used.
    ConfigurationError
        If an aircraft is given for estimates of the lateral motion, or it has other constants.
    AircraftError, TrimError
        If the aircraft cannot be trimmed at the condition of the records.
    """
    runs, methods = layout or (None, 1)
    rows = (
        None if runs is None else np.add.outer(np.array(spaced(runs)) * methods, np.arange(methods)).ravel()
    )
    frame, records = read_stored(path, rows)
    motion = motion_of(frame.columns)
    refuse_declared(motion, aircraft)
    if logs is None:
        logs, reason = _beside(path.parent, records)
        if reason:
            return Identified(frame, records, None, reason)
        try:
            histories = _simulated(logs, frame, records, runs)
        except AirtruthError as error:
            return Identified(frame, records, None, f"The records cannot be simulated: {error}.")
    else:
        histories = _simulated(logs, frame, records, runs)
    if aircraft is None:
        return Identified(frame, records, histories)
    require_same_aircraft(records, aircraft)
    from airtruth.reporting.pages.declared import declared_at  # the tracer takes seconds

    declared = declared_at(aircraft, histories)
    histories = _simulated(logs, declared.before(frame), records, runs)
    return Identified(frame, records, histories, declared=declared)


def compares(motion: Motion) -> bool:
    """Whether a page compares the estimates of a motion with the declared aircraft."""
    return motion is LONGITUDINAL


def refuse_declared(motion: Motion, aircraft: Aircraft | None) -> None:
    """Refuse an aircraft for estimates of a motion that are not compared with it.

    Raises
    ------
    ConfigurationError
        Naming the option.
    """
    if aircraft is not None and not compares(motion):
        raise ConfigurationError(
            f"--aircraft compares the declared aircraft, which the page of estimates of the {motion.name} motion does not show; "
            "leave it out"
        )


def require_same_aircraft(records: Mapping[str, Record], aircraft: Aircraft) -> None:
    """Refuse an aircraft with other constants than the estimates have: its derivatives are those of another scale.

    Raises
    ------
    ConfigurationError
        Naming the first constant that differs.
    """
    other = other_constants(records, asdict(values_of(aircraft)))
    if other:
        raise ConfigurationError(
            f"--aircraft {aircraft.name}: the estimates are of another aircraft ({other}); identify the logs with this "
            "aircraft first"
        )


def _simulated(logs: Logs, frame: pd.DataFrame, records: Mapping[str, Record], runs: int | None) -> Histories:
    if not records:
        raise StoreError("the estimates do not state the constants of their aircraft; identify again")
    own = next(iter(records.values()))
    taken = own.get("sensors", {})
    kind = LateralValues if motion_of(frame.columns) is LATERAL else RecordConstants
    return simulated_records(logs, frame, kind(**own["constants"]), of_runs=runs, taken=taken)


def _beside(folder: Path, records: Mapping[str, Record]) -> tuple[list[str], str]:
    """The logs of estimates beside their file, or a sentence that says why they cannot be used."""
    sources: dict[str, set[str]] = {}
    for record in records.values():
        for name, digest, _ in record["sources"]:
            sources.setdefault(name, set()).add(digest)
    if not sources:
        return (
            [],
            "The estimates do not state their logs, so the records are not shown; name them with --log.",
        )
    found = []
    for name, digests in sources.items():
        path = next((p for p in (folder / "logs" / name, folder / name) if p.is_file()), None)
        if path is None:
            return (
                [],
                f"The log {name} is not beside the estimates, so the records are not shown; name it with --log.",
            )
        if digests != {sha256_of(path)}:
            return (
                [],
                f"The log {name} has changed since the estimates were made, so the records are not shown.",
            )
        found.append(str(path))
    return found, ""


def answer_of(frame: pd.DataFrame) -> list[str]:
    """Sentences of the answer: the modes by the default method if it was run, and where methods disagree."""
    motion = motion_of(frame.columns)
    methods = list(dict.fromkeys(map(str, frame["method"])))
    leading = DEFAULT[motion.name] if DEFAULT[motion.name] in methods else methods[0]
    own = frame[(frame["method"] == leading) & frame["converged"]]
    runs = int((frame["method"] == leading).sum())
    joint = list(dict.fromkeys(frame["run_id"])) == [JOINT]
    if own.empty:
        return [f"{leading} converged in none of {runs} runs."]
    words = ", ".join(
        f"{symbol} = {_with_error(own, name)} {unit}".rstrip()
        for name, (symbol, unit) in _ANSWERED[motion.name].items()
        if name in own
    )
    if joint:
        of = "all runs jointly, with the standard deviation"
    elif runs > 1:
        of = f"mean of {len(own)} of {runs} runs, with its standard error"
    else:
        of = f"run {own['run_id'].iloc[0]}, with the standard deviation"
    sentences = [f"{leading} estimates {words} ({of})."]
    if len(methods) > 1:
        apart = [name for name in motion.parameters if _disagree(frame, methods, name)]
        sentences.append(
            f"The methods differ by more than their intervals in {', '.join(apart)}."
            if apart
            else f"The {len(methods)} methods agree within their intervals."
        )
    return sentences


_ANSWERED: Final[Mapping[str, Mapping[str, tuple[str, str]]]] = {
    LONGITUDINAL.name: {
        "wn_rad_s": ("wn", "rad/s"),
        "zeta": ("zeta", ""),
        "Cmalpha": ("Cmalpha", "1/rad"),
    },
    LATERAL.name: {
        "dutch_roll_wn_rad_s": ("wn of the Dutch roll", "rad/s"),
        "dutch_roll_zeta": ("zeta of the Dutch roll", ""),
        "roll_1_s": ("root of the roll", "1/s"),
        "Cnbeta": ("Cnbeta", "1/rad"),
    },
}
"""Motion -> column -> symbol and unit in the answer."""


def _with_error(rows: pd.DataFrame, name: str) -> str:
    """Mean and its standard error; of one row, its value and standard deviation."""
    values = rows[name].to_numpy(dtype=np.float64)
    with np.errstate(over="ignore", invalid="ignore"):
        if len(values) > 1:
            mean, error = float(values.mean()), float(values.std(ddof=1)) / math.sqrt(len(values))
        else:
            mean, error = (
                float(values[0]),
                float(rows[f"{name}_std"].iloc[0]) if f"{name}_std" in rows else math.nan,
            )
    return (
        f"{significant(mean, 4)} +- {significant(error, 2)}" if math.isfinite(error) else significant(mean, 4)
    )


def _disagree(frame: pd.DataFrame, methods: Sequence[str], name: str) -> bool:
    """Whether two methods have mean intervals that do not overlap."""
    ends = []
    for method in methods:
        own = frame[(frame["method"] == method) & frame["converged"]]
        with np.errstate(over="ignore", invalid="ignore"):
            low, high = float(own[f"{name}_lower"].mean()), float(own[f"{name}_upper"].mean())
        if np.isfinite(low) and np.isfinite(high):
            ends.append((low, high))
    return bool(ends) and max(low for low, _ in ends) > min(high for _, high in ends)


__all__ = [
    "SIMULATED",
    "Identified",
    "answer_of",
    "compares",
    "read_identified",
    "refuse_declared",
]
