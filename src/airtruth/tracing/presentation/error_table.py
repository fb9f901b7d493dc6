"""The table of the errors of a trace, per channel and stage."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from airtruth.channels import shown
from airtruth.table import MISSING, Group, Number, Row, Table, as_csv, flat, significant
from airtruth.tracing.answer import TraceAnswer
from airtruth.tracing.stage_errors import MOST_RECORDS, SETS, STAGES, AxialErrors, PerChannel, Rms

SET_NAMES: Final = {"held_out": "held-out records", "fit": "fitted records"}
"""One of `SETS` -> its name in a heading."""
KINDS: Final = (("free_run", "Free run"), ("innovation", "Innovations"))
"""Kinds of error and their names in a heading."""
CSV_COLUMNS: Final = ("records", "kind", "channel", "stage", "rms")
"""Columns of `error_csv`."""
MEANING: Final = {
    "declared": "declared: the aircraft as declared",
    "before": "before: derivatives and noise levels refitted, no effect",
    "after": "after: with the effects",
    "control": "control: with the runner-up instead",
    "floor": "floor: gusts and sensor noise alone",
}
"""Stage -> its meaning in a note."""
_REPLAY_STAGES: Final = {"declared": ("declared",), "updated": ("after", "before")}
"""Aircraft flown again in JSBSim -> column of the table, the first that there is."""


def stages_of(answer: TraceAnswer) -> list[str]:
    """Stages that the answer states, in the order of the report."""
    return [stage for stage in STAGES if stage in answer.error.stages]


def error_table(answer: TraceAnswer) -> Table:
    """Root mean squares per channel and stage, held-out records first."""
    names = stages_of(answer)
    groups = [
        Group(f"{title}, {SET_NAMES[records]}", tuple(_rows(answer, names, records, kind)))
        for records in SETS
        for kind, title in KINDS
    ]
    if answer.replay is not None:
        flown = f"Flown again in JSBSim, {_counted(answer)}"
        groups.append(Group(flown, tuple(_replayed(answer, names))))
    return Table(
        title="Root mean square of the error",
        columns=("", "signal", *names),
        groups=tuple(g for g in groups if g.rows),
        notes=(
            "; ".join(MEANING[name] for name in names) + ".",
            "Every stage has the same free biases, initial states and trims of the records; an effect is credited "
            "with the step from before to after alone. signal: standard deviation of the measured channel.",
        ),
        keys=2,
    )


def axial_words(errors: AxialErrors) -> str:
    """The errors of ax as a sentence: held-out records where there are any, else fitted ones."""
    declared, after = errors.declared, errors.after
    records, before, then = SET_NAMES["fit"], declared.fit, after.fit
    if declared.held_out is not None and after.held_out is not None:
        records, before, then = SET_NAMES["held_out"], declared.held_out, after.held_out
    words = f"RMS of ax beyond the declared model on {records} {significant(before)} m/s2"
    return words + ("." if then == before else f", with the increment of CX {significant(then)} m/s2.")


def error_csv(answer: TraceAnswer) -> str:
    """The errors in long form, in SI with all digits."""
    rows: list[Row] = []
    for records in SETS:
        for kind, _ in KINDS:
            for stage in stages_of(answer):
                rms = _of_kind(answer.error.stages[stage].on(records), kind)
                rows += [(records, kind, channel, stage, value) for channel, value in rms.items()]
    for aircraft, rms in ({} if answer.replay is None else answer.replay.to_dict()).items():
        rows += [(_flown_again(answer), "replay", channel, aircraft, value) for channel, value in rms.items()]
    return as_csv(flat("Root mean square of the error", CSV_COLUMNS, rows))


def _flown_again(answer: TraceAnswer) -> str:
    """One of `SETS`: the records that are flown again, the held-out ones where there are any."""
    return "held_out" if answer.records.held_out else "fit"


def _counted(answer: TraceAnswer) -> str:
    """The records that are flown again in words; of many the first ones."""
    kind = _flown_again(answer)
    count = len(answer.records.held_out if kind == "held_out" else answer.records.fitted)
    return SET_NAMES[kind] if count <= MOST_RECORDS else f"{MOST_RECORDS} of {count} {SET_NAMES[kind]}"


def _of_kind(rms: Rms | None, kind: str) -> PerChannel:
    if rms is None:
        return {}
    return rms.free_run if kind == "free_run" else rms.innovation


def _rows(answer: TraceAnswer, names: list[str], records: str, kind: str) -> Iterator[Row]:
    by_stage = [_of_kind(answer.error.stages[name].on(records), kind) for name in names]
    for channel, signal in answer.error.channels.items():
        cells = [rms.get(channel) for rms in by_stage]
        if any(cell is not None for cell in cells):
            yield _row(channel, signal, cells)


def _replayed(answer: TraceAnswer, names: list[str]) -> Iterator[Row]:
    replay = {} if answer.replay is None else answer.replay.to_dict()
    by_stage = {next(s for s in _REPLAY_STAGES[plane] if s in names): rms for plane, rms in replay.items()}
    for channel, signal in answer.error.channels.items():
        cells = [by_stage.get(name, {}).get(channel) for name in names]
        if any(cell is not None for cell in cells):
            yield _row(channel, signal, cells)


def _row(channel: str, signal: float, cells: list[float | None]) -> Row:
    name, factor = shown(channel)
    numbers = (MISSING if cell is None else Number(cell * factor, digits=3) for cell in cells)
    return (name, Number(signal * factor, digits=3), *numbers)


__all__ = ["CSV_COLUMNS", "MEANING", "axial_words", "error_csv", "error_table", "stages_of"]
