"""One table over several traces: verdict, effects with their sizes, held-out error before and after."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from airtruth.logs.atomic import make_folder, write_text
from airtruth.report import render
from airtruth.report.layout import NONE, Grid, Group, Row
from airtruth.report.trace_table import figures
from airtruth.report.trace_text import key, unit_of

NAME: Final = "traces"
STAGES: Final = ("declared", "before", "after")
CSV_COLUMNS: Final = ("log", "verdict", "effect", "parameter", "value", "lower", "upper")

Answer = Mapping[str, Any]


def over_floor(answer: Answer, stage: str) -> float | None:
    """Innovations of a stage over what gusts and sensors explain, largest of the channels; None without the stage.

    Of held-out records if there are any.
    """
    which = "held_out" if answer["records"]["held_out"] else "fit"
    if stage not in answer["error"]:
        return None
    own, floor = (answer["error"][name][which]["innovation"] for name in (stage, "floor"))
    return max(float(own[c] / floor[c]) for c in own)


def lay_out(answers: Mapping[str, Answer]) -> Grid:
    """The table in words.

    Parameters
    ----------
    answers : name of the log -> what trace.json holds.
    """
    return Grid(
        title="Traces",
        header=("log", "verdict", "effect", "value (95 %)", *STAGES, "p left"),
        groups=(
            Group(
                "Effects, and the errors over the floor",
                tuple(r for name, a in answers.items() for r in _rows(name, a)),
            ),
        ),
        notes=(
            "declared, before, after: root mean square of the innovations in held-out records over what gusts and "
            "sensors explain, largest of the channels; before has derivatives and biases refitted, after the effects too. "
            "p left: of the anomaly that remains.",
        ),
    )


def _rows(name: str, answer: Answer) -> Iterator[Row]:
    errors = [over_floor(answer, stage) for stage in STAGES]
    tail = (
        *(NONE if e is None else figures(e) for e in errors),
        figures(float(answer["remaining"]["p_value"]), 2),
    )
    verdict = answer["verdict"] + (" (provisional)" if answer["provisional"] else "")
    lines = list(_effects(answer)) or [(NONE, NONE)]
    for number, (effect, size) in enumerate(lines):
        if number == 0:
            yield name, verdict, effect, size, *tail
        else:
            yield "", "", effect, size, *[""] * len(tail)


def _effects(answer: Answer) -> Iterator[tuple[str, str]]:
    for effect in answer["effects"]:
        for number, (parameter, value) in enumerate(effect["parameters"].items()):
            low, high = (figures(x) if x is not None else NONE for x in value["ci95"])
            size = f"{parameter} {figures(value['value'])} {unit_of(key(effect), parameter)}".rstrip()
            yield key(effect) if number == 0 else "", f"{size} ({low} to {high})"
        if effect["indistinguishable_from"]:
            yield "", "or " + ", ".join(effect["indistinguishable_from"])


def csv_text(answers: Mapping[str, Answer]) -> str:
    """One row per parameter of each accepted effect, SI, full precision."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(CSV_COLUMNS)
    for name, answer in answers.items():
        if not answer["effects"]:
            writer.writerow([name, answer["verdict"], "", "", "", "", ""])
        for effect in answer["effects"]:
            for parameter, value in effect["parameters"].items():
                cells = ("" if x is None else repr(float(x)) for x in (value["value"], *value["ci95"]))
                writer.writerow([name, answer["verdict"], key(effect), parameter, *cells])
    return out.getvalue()


def write_traces(answers: Mapping[str, Answer], out: Path) -> tuple[str, tuple[Path, ...]]:
    """Write traces.md, traces.csv and traces.tex; the table in plain text and the files.

    Raises
    ------
    StoreError
        If a file cannot be written.
    """
    make_folder(out)
    grid = lay_out(answers)
    paths = []
    for suffix, content in (
        ("md", render.markdown(grid)),
        ("csv", csv_text(answers)),
        ("tex", render.latex(grid, NAME)),
    ):
        paths.append(out / f"{NAME}.{suffix}")
        write_text(paths[-1], content)
    return render.text(grid), tuple(paths)


__all__ = ["NAME", "csv_text", "lay_out", "over_floor", "write_traces"]
