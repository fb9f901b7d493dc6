"""Figures of a trace: one page of residual before, effect, residual after; the scores; the innovations."""

from __future__ import annotations

import csv
import io
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.stats import norm

from airtruth.logs.atomic import make_folder, write_text
from airtruth.report import style
from airtruth.report.render import WIDTH
from airtruth.report.trace_effect import contribution, draw_effect
from airtruth.report.trace_table import error_csv, shown, stages
from airtruth.report.trace_text import key, verdict
from airtruth.trace import Trace
from airtruth.trace.holdout import Assessment, explained
from airtruth.trace.lower import CHANNELS, lower
from airtruth.trace.records import Record

Array = NDArray[np.float64]

PAGES: Final = ("trace.png", "scores.png", "innovations.png")
LEVEL: Final = 0.05
_LABELS: Final = {
    "alpha_rad": "angle of attack\n[deg]",
    "q_rad_s": "pitch rate\n[deg/s]",
    "az_m_s2": "normal force\n[m/s²]",
}
_WIDEST_SIGMA: Final = 40.0


@dataclass(frozen=True)
class Sight:
    """The record that is shown, and what two stages say of it.

    Attributes
    ----------
    record : a held-out record if there is one: that whose free run the effect improves most.
    time_s : (samples,).
    stages : the two stages that are compared.
    before, after : their assessments of the record.
    floor : (3,) root mean square of what gusts and sensors explain of a free run.
    """

    record: Record
    time_s: Array
    stages: tuple[str, str]
    before: Assessment
    after: Assessment
    floor: Array


def sight(found: Trace) -> Sight:
    """Choose the record to show."""
    case, outcome = found.case, found.outcome
    problem = case.held or case.fitted
    assessed = outcome.held if case.held else outcome.fitted
    pair = ("before", "after") if "after" in outcome.models else ("declared", "before")
    model = outcome.models[pair[1]]
    low = lower(model.hypothesis.change(model.sizes))
    floors = [
        explained(record, problem, low, model.shared, own.local, number, model.hypothesis.loose)
        for number, (record, own) in enumerate(zip(problem.records, assessed[pair[1]], strict=True))
    ]
    gains = [
        float(((first.free_run**2 - second.free_run**2) / level**2).sum())
        for first, second, level in zip(assessed[pair[0]], assessed[pair[1]], floors, strict=True)
    ]
    at = int(np.argmax(np.nan_to_num(gains, nan=-np.inf)))
    record = problem.records[at]
    return Sight(
        record=record,
        time_s=record.signals.dt_s * np.arange(record.samples, dtype=np.float64),
        stages=pair,
        before=assessed[pair[0]][at],
        after=assessed[pair[1]][at],
        floor=floors[at],
    )


def page(found: Trace, seen: Sight) -> Figure:
    """Residual before, the effect, residual after, of one record's free run."""
    answer = found.answer
    with style.applied():
        figure = style.new_figure(11.0, 6.6)
        axes = figure.subplots(3, 3)
        for column, (name, own) in zip(
            (0, 2), zip(seen.stages, (seen.before, seen.after), strict=True), strict=True
        ):
            _residuals(axes[:, column], seen, own)
            axes[0, column].set_title(f"residual of the free run: {name}")
        for row in range(3):
            low, high = zip(*(axes[row, c].get_ylim() for c in (0, 2)), strict=True)
            for c in (0, 2):
                axes[row, c].set_ylim(min(low), max(high))
        draw_effect(axes[0, 1], found, seen.record, seen.after, seen.time_s)
        _contribution(axes[1, 1], found, seen)
        _stages(axes[2, 1], answer)
        figure.suptitle(
            f"{textwrap.fill(verdict(answer), WIDTH)}\nRecord {seen.record.signals.run_id}, "
            f"{'held out' if found.case.held else 'fitted'}; shaded: two standard deviations of what gusts and sensors explain",
            fontsize=10.0,
        )
    return figure


def _residuals(axes: Sequence[Axes], seen: Sight, own: Assessment) -> None:
    for i, (ax, channel) in enumerate(zip(axes, CHANNELS, strict=True)):
        factor = shown(channel)[1]
        width = 2.0 * seen.floor[i] * factor
        ax.axhspan(-width, width, color=style.SKY, alpha=0.25, lw=0.0, zorder=0)
        ax.plot(seen.time_s, own.residual[:, i] * factor, color=style.BLUE, lw=0.9)
        ax.set_ylabel(_LABELS[channel])
        ax.margins(x=0.01)
    axes[-1].set_xlabel("time [s]")


def _contribution(ax: Axes, found: Trace, seen: Sight) -> None:
    """What the effects do to the outputs, over what gusts and sensors explain."""
    moved = contribution(found, seen.record, seen.after)
    ax.set_ylabel("effect on the output\n[σ of the floor]")
    ax.margins(x=0.01)
    if moved is None:
        ax.text(0.5, 0.5, "no effect", transform=ax.transAxes, ha="center", va="center", color=style.GREY)
        return
    for i, (channel, colour) in enumerate(zip(CHANNELS, style.PALETTE, strict=False)):
        ax.plot(
            seen.time_s,
            moved[:, i] / seen.floor[i],
            color=colour,
            lw=1.1,
            label=shown(channel)[0].split(" ")[0],
        )
    ax.margins(y=0.2)
    ax.legend(loc="upper right", fontsize=7.5, ncols=3)


def _stages(ax: Axes, answer: dict[str, Any]) -> None:
    """Root mean squares of every stage over the floor, free run and innovations."""
    which = "held_out" if answer["records"]["held_out"] else "fit"
    names = stages(answer)
    x = np.arange(len(names))
    for kind, offset, marker in (("free_run", -0.1, "o"), ("innovation", 0.1, "s")):
        for channel, colour in zip(CHANNELS, style.PALETTE, strict=False):
            unit = answer["error"]["floor"][which][kind][channel]
            values = [answer["error"][n][which][kind][channel] / unit for n in names]
            label = kind.replace("_", " ") if channel == CHANNELS[0] else None
            ax.plot(x + offset, values, marker, color=colour, ms=4.5, label=label)
    ax.axhline(1.0, color=style.GREY, lw=0.8)
    ax.set_xticks(x, names)
    ax.set_ylabel("rms over the floor")
    ax.margins(y=0.25)
    ax.legend(loc="upper right", fontsize=7.5, ncols=2)


def scores(answer: dict[str, Any]) -> Figure:
    """How significant each candidate is alone, and what Holm's rule asks of it."""
    rows = [c for c in answer["candidates"] if c["testable"]]
    sigma = [_sigma(c) for c in rows]
    leading = {key(e) for e in answer["effects"]}
    alike = {name for e in answer["effects"] for name in e["indistinguishable_from"]}
    colours = [
        style.VERMILLION if key(c) in leading else style.ORANGE if c["name"] in alike else style.BLUE
        for c in rows
    ]
    count = len(rows)
    needed = norm.isf(0.5 * LEVEL / (count - np.arange(count))) if count else np.zeros(0)
    with style.applied():
        figure = style.new_figure(7.2, 1.1 + 0.19 * max(count, 3))
        ax = figure.subplots()
        y = np.arange(count)
        ax.barh(y, sigma, color=colours, height=0.7)
        ax.step(
            needed, y, where="mid", color=style.BLACK, lw=1.0, label=f"Holm, {100.0 * LEVEL:g} % over all"
        )
        ax.set_yticks(y, [key(c) for c in rows], fontsize=7.5)
        ax.set_ylim(count - 0.4, -0.6)
        ax.set_xlabel("significance of the score [σ of a normal]")
        ax.grid(axis="y", visible=False)
        for colour, label, names in (
            (style.VERMILLION, "accepted", leading),
            (style.ORANGE, "cannot be told from it", alike),
        ):
            if names:
                ax.barh([0], [0], color=colour, label=label)
        ax.legend(loc="lower right")
        ax.set_title("scores of the candidates at the refitted, effect-free aircraft", loc="left")
    return figure


def _sigma(candidate: dict[str, Any]) -> float:
    """Its p-value as the size of a normal variable; beyond what a float holds, its score's root."""
    p = float(candidate["p_value_alone"])
    root = abs(float(candidate["z"]))
    return float(norm.isf(0.5 * p)) if p > 1e-290 else max(root, _WIDEST_SIGMA - 4.0)


def innovations(seen: Sight) -> Figure:
    """Whitened innovations of the two stages and their autocorrelation."""
    lags = np.arange(1, min(51, len(seen.time_s) // 4))
    bound = 1.96 / np.sqrt(len(seen.time_s))
    with style.applied():
        figure = style.new_figure(8.6, 5.4)
        axes = figure.subplots(3, 2, width_ratios=(2.0, 1.0))
        for i, channel in enumerate(CHANNELS):
            for own, name, colour in zip(
                (seen.before, seen.after), seen.stages, (style.GREY, style.BLUE), strict=True
            ):
                e = own.whitened[:, i]
                axes[i, 0].plot(seen.time_s, e, color=colour, lw=0.8, label=name)
                axes[i, 1].plot(lags * seen.record.signals.dt_s, _correlation(e, lags), color=colour, lw=1.1)
            axes[i, 0].set_ylabel(f"{shown(channel)[0].split(' ')[0]} [σ]")
            axes[i, 1].axhspan(-bound, bound, color=style.SKY, alpha=0.25, lw=0.0)
        axes[0, 0].set_title("whitened innovations")
        axes[0, 1].set_title("autocorrelation")
        axes[0, 0].legend(loc="upper right", ncols=2)
        axes[-1, 0].set_xlabel("time [s]")
        axes[-1, 1].set_xlabel("lag [s]")
    return figure


def _correlation(e: Array, lags: NDArray[np.int64]) -> Array:
    x = e - e.mean()
    total = float(x @ x)
    return np.array([float(x[k:] @ x[:-k]) / total for k in lags])


def record_csv(seen: Sight) -> str:
    """What the figures draw of the record: measured, free run and residual of both stages, SI."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    first, second = seen.stages
    header = ["t_s", "run_id"]
    for channel in CHANNELS:
        header += [
            f"{channel}_measured",
            *(f"{channel}_{kind}_{s}" for s in (first, second) for kind in ("free_run", "innovation")),
        ]
    writer.writerow(header)
    y = seen.record.signals.y
    for k, t in enumerate(seen.time_s):
        row: list[object] = [repr(float(t)), seen.record.signals.run_id]
        for i in range(3):
            row.append(repr(float(y[k, i])))
            for own in (seen.before, seen.after):
                row += [repr(float(y[k, i] - own.residual[k, i])), repr(float(own.whitened[k, i]))]
        writer.writerow(row)
    return out.getvalue()


def write_trace_figures(found: Trace, out: Path) -> tuple[Path, ...]:
    """Write the figures of a trace, and what they draw, into its folder.

    Parameters
    ----------
    found : a finished trace.
    out : folder, made if need be: `PAGES`, record.csv (the record that is shown) and error.csv.

    Returns
    -------
    The files, in the order in which they were written.

    Raises
    ------
    StoreError
        If a file cannot be written.
    """
    make_folder(out)
    seen = sight(found)
    written = []
    for name, figure in zip(PAGES, (page(found, seen), scores(found.answer), innovations(seen)), strict=True):
        style.save(figure, out / name)
        written.append(out / name)
    for name, content in (("record.csv", record_csv(seen)), ("error.csv", error_csv(found.answer))):
        write_text(out / name, content)
        written.append(out / name)
    return tuple(written)


__all__ = ["PAGES", "Sight", "innovations", "page", "record_csv", "scores", "sight", "write_trace_figures"]
