"""The errors of a trace before and after, laid out once for every format."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Mapping
from typing import Any, Final

from airtruth.report.layout import NONE, Grid, Group, Row
from airtruth.units import DEG

STAGES: Final = ("declared", "before", "after", "control", "floor")
SETS: Final = (("held_out", "held-out records"), ("fit", "fitted records"))
KINDS: Final = (("free_run", "Free run"), ("innovation", "Innovations"))
CSV_COLUMNS: Final = ("records", "kind", "channel", "stage", "rms")

Answer = Mapping[str, Any]


def shown(channel: str) -> tuple[str, float]:
    """Name of a channel with the unit that people read, and the factor to it from SI."""
    if channel.endswith("_rad"):
        return f"{channel.removesuffix('_rad')} [deg]", 1.0 / DEG
    if channel.endswith("_rad_s"):
        return f"{channel.removesuffix('_rad_s')} [deg/s]", 1.0 / DEG
    for ending, unit in (("_m_s2", "m/s2"), ("_m_s", "m/s")):
        if channel.endswith(ending):
            return f"{channel.removesuffix(ending)} [{unit}]", 1.0
    return channel, 1.0


def stages(answer: Answer) -> list[str]:
    """Stages that the answer states, in the order of the report."""
    return [stage for stage in STAGES if stage in answer["error"]]


def error_grid(answer: Answer) -> Grid:
    """Root mean squares per channel and stage, held-out records first.

    Parameters
    ----------
    answer : what trace.json holds.
    """
    found = stages(answer)
    groups = [
        Group(f"{title}, {where}", tuple(_rows(answer, found, which, kind)))
        for which, where in SETS
        for kind, title in KINDS
    ]
    if answer.get("replay"):
        groups.append(Group("Flown again in JSBSim, held-out records", tuple(_replayed(answer, found))))
    return Grid(
        title="Root mean square of the error",
        header=("", "signal", *found),
        groups=tuple(g for g in groups if g.rows),
        notes=tuple(_notes(found)),
    )


def error_csv(answer: Answer) -> str:
    """The same in long form, SI, full precision."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(CSV_COLUMNS)
    for which, _ in SETS:
        for kind, _ in KINDS:
            for stage in stages(answer):
                rms = answer["error"][stage].get(which, {}).get(kind, {})
                for channel, value in rms.items():
                    writer.writerow([which, kind, channel, stage, repr(float(value))])
    for stage, rms in answer.get("replay", {}).items():
        for channel, value in rms.items():
            writer.writerow(["held_out", "replay", channel, stage, repr(float(value))])
    return out.getvalue()


def figures(value: float, digits: int = 3) -> str:
    """A number in so many significant figures, no power of ten where it can be helped."""
    if not math.isfinite(value):
        return NONE
    size = math.floor(math.log10(abs(value))) if value else 0
    if -5 < size < 6:
        return f"{value:.{max(0, digits - 1 - size)}f}"
    return f"{value:.{digits - 1}e}"


def _rows(answer: Answer, found: list[str], which: str, kind: str) -> Iterator[Row]:
    for channel, signal in answer["error"]["channels"].items():
        cells = [answer["error"][stage].get(which, {}).get(kind, {}).get(channel) for stage in found]
        if any(cell is not None for cell in cells):
            yield _row(channel, signal, cells)


def _replayed(answer: Answer, found: list[str]) -> Iterator[Row]:
    places = {"declared": "declared", "updated": "after"}
    for channel, signal in answer["error"]["channels"].items():
        cells: dict[str, float] = {
            places[name]: rms[channel] for name, rms in answer["replay"].items() if channel in rms
        }
        yield _row(channel, signal, [cells.get(stage) for stage in found])


def _row(channel: str, signal: float, cells: list[float | None]) -> Row:
    name, factor = shown(channel)
    told = (NONE if cell is None else figures(cell * factor) for cell in cells)
    return (name, figures(signal * factor), *told)


def _notes(found: list[str]) -> Iterator[str]:
    said = {
        "declared": "declared: the aircraft as declared",
        "before": "before: its derivatives and noise levels refitted, no effect",
        "after": "after: with the effect",
        "control": "control: with the runner-up in its place",
        "floor": "floor: what gusts and sensor noise alone explain",
    }
    yield "; ".join(said[stage] for stage in found) + "."
    yield (
        "Biases, initial state and trim of each record are free in every stage; the effect is credited with "
        "before to after only. signal: standard deviation of the measured channel."
    )


__all__ = ["CSV_COLUMNS", "STAGES", "error_csv", "error_grid", "figures", "shown", "stages"]
