"""Trace: logs and a declared aircraft in, a verdict and an updated aircraft out."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from airtruth import aircraft as planes
from airtruth.aircraft import Aircraft
from airtruth.effects.effect import Effect
from airtruth.effects.library import EFFECTS
from airtruth.errors import ConfigurationError, LogError, choices
from airtruth.logs import atomic
from airtruth.logs.flight_log import FlightLog
from airtruth.logs.store import log_paths, read_log
from airtruth.logs.validate import validate
from airtruth.trace.answer import Outcome, answer, assessed
from airtruth.trace.colour import begun
from airtruth.trace.options import TraceOptions
from airtruth.trace.plausible import plausible
from airtruth.trace.prepare import Case, prepare
from airtruth.trace.replay import disagreement, flown_again
from airtruth.trace.search import Stage, search
from airtruth.trace.tolerances import tolerances
from airtruth.trace.update import place, write_update

ANSWER: Final = "trace.json"


@dataclass(frozen=True)
class Trace:
    """A finished trace: what was traced, the rounds of the search, the stages of the report, the answer."""

    case: Case
    stages: tuple[Stage, ...]
    outcome: Outcome
    answer: dict[str, Any]


def traced(
    logs: Sequence[FlightLog],
    aircraft: Aircraft,
    options: TraceOptions | None = None,
    advance: Callable[[str], None] = lambda what: None,
) -> Trace:
    """Trace the residual of records to effects that the declared aircraft lacks.

    Parameters
    ----------
    logs : checked flight logs of one aircraft.
    aircraft : the declared aircraft.
    options : choices.
    advance : told what is being done.

    Raises
    ------
    LogError, ConfigurationError, AircraftError
        Saying what is wrong, where, and what to do.
    """
    options = options or TraceOptions()
    effects = _effects(options)
    plausible(logs)
    advance("probe the declared aircraft")
    case = prepare(logs, aircraft, effects, options)
    advance("refit the declared aircraft")
    case, start = begun(case)
    stages = search(case.fitted, case.hypothesis, start, case.effects, options.seed, advance)
    if not stages:
        raise LogError(
            f"the declared aircraft {aircraft.name} does not fly like these records: its motion leaves all bounds; "
            "check units and signs with `airtruth check`, and that it is the right aircraft"
        )
    advance("judge every stage on fitted and held-out records")
    outcome = assessed(case, stages)
    found = answer(case, stages, outcome) | {"tolerances": tolerances(case, outcome)}
    return Trace(case, stages, outcome, found)


def run(
    logs: Sequence[str | Path] | FlightLog,
    aircraft: str | Path | Aircraft,
    options: TraceOptions | None = None,
    out: Path | None = None,
    advance: Callable[[str], None] = lambda what: None,
) -> Trace:
    """Read logs, trace, and with ``out`` write trace.json and the updated aircraft there.

    Parameters
    ----------
    logs : files or folders of flight logs, or a log in memory.
    aircraft : folder with aircraft.toml, a shipped name, or a loaded aircraft.
    options : choices; None for the defaults.
    out : folder of the result, or None to write nothing.
    advance : told what is being done.

    Raises
    ------
    LogError, ConfigurationError, AircraftError, StoreError
        Saying what is wrong, where, and what to do.
    """
    options = options or TraceOptions()
    plane = aircraft if isinstance(aircraft, Aircraft) else planes.load(aircraft)
    if isinstance(logs, FlightLog):
        validate(logs)
        read = [logs]
    else:
        paths = [path for place in logs for path in log_paths(place)]
        read = [read_log(path) for path in paths]
        for log, path in zip(read, paths, strict=True):
            validate(log, source=str(path))
    if out is not None:
        place(plane, out)  # both before the search, which takes minutes
        atomic.make_folder(out)
    found = traced(read, plane, options, advance)
    if out is not None:
        advance("write the updated aircraft")
        found.answer["updated_aircraft"] = write_update(
            found.case, found.stages, plane, out, options.refitted
        )
        found.answer["replay"] = flown_again(
            found.case, found.outcome, plane, found.answer["updated_aircraft"]
        )
        found.answer["notes"] += disagreement(found.answer)
        atomic.write_text(out / ANSWER, json.dumps(found.answer, indent=1, allow_nan=False) + "\n")
    return found


def trace(
    logs: Sequence[str | Path] | FlightLog,
    aircraft: str | Path | Aircraft,
    options: TraceOptions | None = None,
    out: Path | None = None,
) -> dict[str, Any]:
    """As `run`; what trace.json holds, as a dict (docs/trace.md)."""
    return run(logs, aircraft, options, out).answer


def _effects(options: TraceOptions) -> list[Effect]:
    """The candidates that were asked for, each once; a name without a variant stands for all of its variants."""
    if options.effects is None:
        return list(EFFECTS.values())
    found: dict[str, Effect] = {}
    for key in options.effects:
        meant = {k: e for k, e in EFFECTS.items() if key in (k, e.name)}
        if not meant:
            names = {*EFFECTS, *(e.name for e in EFFECTS.values())}
            raise ConfigurationError(f"effect {key!r}: {choices(key, names)}")
        found |= meant
    return list(found.values())
