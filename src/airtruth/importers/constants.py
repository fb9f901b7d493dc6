"""Facts of records that a mapping states beside the channels: mass, inertia and reference lengths of each run."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import LogError
from airtruth.importers.mapping import CONSTANTS, MappingFile, Place, unit_factor
from airtruth.importers.series import Series, base_clock
from airtruth.importers.sources import Source, numbers
from airtruth.logs.flight_log import RECORD_CONSTANTS, FlightLog

Array = NDArray[np.float64]


def record_constants(log: FlightLog, run_id: str) -> Mapping[str, float]:
    """Mass, inertia and reference lengths that the mapping stated for a run, in SI; {} if none."""
    facts = log.metadata.get(RECORD_CONSTANTS, {})
    return dict(facts.get(run_id, {})) if isinstance(facts, Mapping) else {}


def constants_of(
    source: Source,
    mapping: MappingFile,
    part: tuple[float, float, NDArray[np.bool_] | None],
    moved: Callable[[Array], Array],
) -> dict[str, float]:
    """Constants of a run in SI; a column counts with its mean over the run.

    Parameters
    ----------
    source, mapping : file and its mapping.
    part : start and end of the run [s], and its rows (rows,) where a column names them.
    moved : times of the file [s] -> times on the clock of the log [s].

    Raises
    ------
    LogError
        If a constant is not above 0.
    """
    result: dict[str, float] = {}
    start, end, rows = part
    for name, one in mapping.constants.items():
        factor = unit_factor(CONSTANTS[name], one.unit)
        if one.column is None:
            assert one.value is not None
            result[name] = factor * one.value
            continue
        values, own = numbers(
            source, Place(column=one.column, variable=one.variable), mapping.source.variable
        )
        clock = base_clock(source, mapping)
        t = clock.t_s if clock is not None else own
        if len(values) > 1 and t is not None and len(t) == len(values):
            values = Series(moved(t), values).between(start, end, rows).values
        mean = float(np.nanmean(values)) * factor
        if not np.isfinite(mean) or mean <= 0.0:
            raise LogError(
                f"{source.path}: {name} is {mean:g}, which has to be above 0; map another column, or state a value"
            )
        result[name] = mean
    return result


__all__ = ["constants_of", "record_constants"]
