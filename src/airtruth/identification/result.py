"""The result of an identification."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from airtruth.aircraft import Aircraft
from airtruth.errors import ConfigurationError, choices
from airtruth.identification import tables
from airtruth.identification.condition import AircraftConstants
from airtruth.identification.declared_sensors import Taken, taken_out
from airtruth.identification.estimates import Estimates, Parts, estimates_table
from airtruth.identification.options import Options
from airtruth.identification.record_constants import RecordConstants, values_of
from airtruth.logs.histories import Histories
from airtruth.logs.sources import Logs
from airtruth.physics.motion import LONGITUDINAL, Motion
from airtruth.result import shortened
from airtruth.table import Table, as_html, as_text

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class LogSource:
    """A log that was read from a file: its name, the SHA-256 of its bytes and its number of runs."""

    name: str
    sha256: str
    runs: int


@dataclass(frozen=True)
class IdentificationSettings:
    """The choices that decide the numbers of an identification.

    Attributes
    ----------
    options : choices that all methods share.
    joint : whether all runs share one estimate.
    aircraft : name of the aircraft.
    constants : its constants.
    sensors : errors of its instruments that are taken out of the records (`declared_sensors.taken_out`).
    motion : whose derivatives are estimated.
    """

    options: Options
    joint: bool
    aircraft: str
    constants: RecordConstants
    sensors: Taken = field(default_factory=dict)
    motion: Motion = LONGITUDINAL

    def to_dict(self) -> dict[str, Any]:
        """The settings in types that JSON has."""
        options = {f.name: getattr(self.options, f.name) for f in dataclasses.fields(self.options)}
        if self.options.auxiliary is not None:
            options["auxiliary"] = getattr(self.options.auxiliary, "__qualname__", "custom")
        # files of older versions do not name the terms
        if self.options.terms:
            options["terms"] = list(self.options.terms)
        else:
            del options["terms"]
        if self.options.band_hz is not None:
            options["band_hz"] = list(self.options.band_hz)
        return {
            "options": options,
            "joint": self.joint,
            "aircraft": self.aircraft,
            "constants": dataclasses.asdict(self.constants),
            **({"sensors": {name: dict(own) for name, own in self.sensors.items()}} if self.sensors else {}),
            # files of older versions hold the longitudinal motion and do not name it
            **({} if self.motion is LONGITUDINAL else {"motion": self.motion.name}),
        }


def settings_of(
    aircraft: AircraftConstants, options: Options, joint: bool, motion: Motion = LONGITUDINAL
) -> IdentificationSettings:
    """Settings of an identification of this aircraft.

    Raises
    ------
    ConfigurationError
        If the aircraft lacks a constant that the motion needs.
    """
    name = aircraft.name if isinstance(aircraft, Aircraft) else type(aircraft).__name__
    return IdentificationSettings(
        options, joint, name, values_of(aircraft, motion), taken_out(aircraft, motion), motion
    )


RUNS_PER_FRAME: Final = 2000
"""Runs in a part of `IdentificationResult.frames` [-] (judgement: 0.6 MB for each method)."""


@dataclass(frozen=True)
class IdentificationResult:
    """Estimates of the derivatives of a motion by one or more methods, with their provenance.

    Attributes
    ----------
    estimates : one per method, in the order asked for; all have the same runs.
    settings : options, joint, aircraft and its constants; ``notes`` lists the runs that state other constants.
    notes : sentences that a reader of the estimates should know.
    forced : faults of the logs that ``force`` overrode.
    version : of airtruth.
    sources : logs that were read from files.
    logs : the logs as they were given, which figures read again.
    others : results of the other motions that the same logs answer; the summary has each under its heading.
    """

    estimates: tuple[Estimates, ...]
    settings: IdentificationSettings
    notes: tuple[str, ...]
    forced: tuple[str, ...]
    version: str
    sources: tuple[LogSource, ...]
    logs: Logs | None = field(default=None, repr=False, compare=False)
    others: tuple[IdentificationResult, ...] = ()

    @property
    def motion(self) -> str:
        """Name of the motion whose derivatives are estimated."""
        return self.settings.motion.name

    @property
    def motions(self) -> dict[str, IdentificationResult]:
        """Name of each motion that is answered -> its result."""
        return {one.motion: one for one in (self, *self.others)}

    @property
    def methods(self) -> tuple[str, ...]:
        """Names of the methods."""
        return tuple(e.method for e in self.estimates)

    @property
    def run_ids(self) -> tuple[str, ...]:
        """Names of the runs; of a joint estimate the single name "joint"."""
        return self.estimates[0].run_ids

    def of(self, method: str) -> Estimates:
        """Estimates of one method.

        Raises
        ------
        ConfigurationError
            If the method is not in the result.
        """
        for estimates in self.estimates:
            if estimates.method == method:
                return estimates
        raise ConfigurationError(f"method {method!r} is not in this result: {choices(method, self.methods)}")

    def to_frame(self) -> pd.DataFrame:
        """One row per run and method, the columns of estimates.parquet (docs/methods.md).

        run_id, method, converged, iterations; NAME, NAME_std, NAME_lower, NAME_upper of each derivative [-] and modal
        parameter; status; NAME_OTHER_corr, the correlations of the derivatives [-]; airspeed_m_s and density_kg_m3, of
        the lateral motion alpha_rad and theta_rad, the flight condition of the estimate. Runs keep their order,
        and each run the order of the methods.
        """
        return _frame(self.estimates, self.settings.constants)

    def tidy(self) -> pd.DataFrame:
        """One row for each method, run and quantity, see `airtruth.identification.frames.tidy`."""
        from airtruth.identification.frames import tidy

        return tidy(self.estimates)

    def frames(self) -> Iterator[pd.DataFrame]:
        """The rows of `to_frame` in parts of up to `RUNS_PER_FRAME` runs, so that the memory need not hold them all."""
        return frames_of(self._parts, self.settings.constants)

    def summary(self) -> str:
        """Estimates of each method with their intervals, or mean and spread over runs; then the notes."""
        if not self.others:
            return as_text(self.table())
        return "\n\n".join(
            f"{r.settings.motion.heading}\n{as_text(r.table())}" for r in self.motions.values()
        )

    def table(self) -> Table:
        """The table of `summary`."""
        return table_of(self._parts, self.forced, self.notes)

    def details(self, method: str, run_id: str | None = None) -> Table:
        """Estimates of one method: of one run, or their distribution over the converged runs.

        Raises
        ------
        ConfigurationError
            If the method or the run is not in the result.
        """
        return tables.details(self.of(method), run_id)

    def compare(self, run_id: str | None = None) -> Table:
        """Methods side by side: estimate and standard deviation of one run, or mean and spread over runs.

        Raises
        ------
        ConfigurationError
            If the run is not in the result.
        """
        return tables.comparison(self.estimates, run_id)

    def to_dict(self) -> dict[str, Any]:
        """Settings, provenance, notes and the rows of `to_frame`; null for a number that is not finite."""
        rows = [
            {
                name: None if isinstance(value, float) and not math.isfinite(value) else value
                for name, value in row.items()
            }
            for row in self.to_frame().to_dict(orient="records")
        ]
        return {
            "version": self.version,
            **self.settings.to_dict(),
            "methods": list(self.methods),
            "sources": [dataclasses.asdict(source) for source in self.sources],
            "notes": list(self.notes),
            "forced": list(self.forced),
            "estimates": rows,
        }

    def plot(self) -> Figure:
        """Intervals of the methods side by side, one panel for each derivative and modal parameter."""
        from airtruth.charts import as_figure
        from airtruth.identification.charts import intervals_chart

        return as_figure(intervals_chart(self.to_frame(), confidence=self.estimates[0].confidence))

    def histories(self) -> Histories | None:
        """Records of the logs beside the simulations by each method; None where the logs are unknown.

        Raises
        ------
        StoreError, LogError
            If a log cannot be read again.
        """
        from airtruth.identification.simulated import simulated_records

        if self.logs is None:
            return None
        return simulated_records(
            self.logs, self.to_frame(), self.settings.constants, taken=self.settings.sensors
        )

    def _parts(self) -> Iterable[Sequence[Estimates]]:
        return (self.estimates,)

    def __repr__(self) -> str:
        """Return the first lines of the summary."""
        return shortened(self.summary())

    def _repr_html_(self) -> str:
        return as_html(self.table())


@dataclass(frozen=True)
class SpooledResult:
    """The result of an identification whose estimates are in a temporary file, while that is open.

    Attributes
    ----------
    parts : the estimates, a few logs at a time.
    methods : names of the methods.
    settings, notes, forced, version, sources : as in `IdentificationResult`.
    """

    parts: Parts
    methods: tuple[str, ...]
    settings: IdentificationSettings
    notes: tuple[str, ...]
    forced: tuple[str, ...]
    version: str
    sources: tuple[LogSource, ...]

    def to_frame(self) -> pd.DataFrame:
        """`IdentificationResult.to_frame`; the memory holds all rows."""
        import pandas as pd

        return pd.concat(list(self.frames()), ignore_index=True)

    def frames(self) -> Iterator[pd.DataFrame]:
        """The rows of `to_frame` in parts."""
        return frames_of(self.parts, self.settings.constants)

    def summary(self) -> str:
        """`IdentificationResult.summary`."""
        return as_text(table_of(self.parts, self.forced, self.notes))


def frames_of(parts: Parts, constants: RecordConstants) -> Iterator[pd.DataFrame]:
    """Rows of contract 2 in frames of up to `RUNS_PER_FRAME` runs."""
    for estimates in parts():
        for first in range(0, len(estimates[0].run_ids), RUNS_PER_FRAME):
            yield _frame([e.rows(first, first + RUNS_PER_FRAME) for e in estimates], constants)


def json_of(frames: Iterable[pd.DataFrame]) -> Iterator[str]:
    """One JSON array of the rows of at least one frame, in pieces: the text of ``to_json`` of the joined frames."""
    before = "[\n"
    for frame in frames:
        yield before + frame.to_json(orient="records", indent=1).removeprefix("[\n").removesuffix("\n]")
        before = ",\n"
    yield "\n]\n"


def table_of(parts: Parts, forced: Iterable[str], notes: Iterable[str]) -> Table:
    """The estimates of each method with their intervals, or mean and spread over runs; then faults and notes."""
    overridden = (f"Overridden by --force: {sentence}" for sentence in forced)
    return dataclasses.replace(tables.overview_of(parts), notes=(*overridden, *notes))


def _frame(estimates: Sequence[Estimates], constants: RecordConstants) -> pd.DataFrame:
    """Rows of several methods for the same runs: run by run, and of each run the methods in their order."""
    import pandas as pd

    table = pd.concat([estimates_table(e, constants) for e in estimates], ignore_index=True)
    order = np.arange(len(table)).reshape(len(estimates), -1).T.ravel()
    return table.iloc[order].reset_index(drop=True)
