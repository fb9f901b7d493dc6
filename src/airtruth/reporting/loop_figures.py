"""Figures of the closed loop: bias of every method before and after; innovations of several traces."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from airtruth import style
from airtruth.channels import shown
from airtruth.physics.motion import LONGITUDINAL
from airtruth.reporting.loop import BARS, LoopTable, bias_pct
from airtruth.reporting.paper.published import SYMBOLS
from airtruth.tracing import TraceResult
from airtruth.tracing.model.compile import CHANNELS
from airtruth.tracing.presentation.shown_record import ShownRecord, shown_record

Array = NDArray[np.float64]

SHOWN: Final = ("Cmalpha", "Cmq", "CLalpha")
"""Derivatives of the figure of biases: the two with a bar, and the lift-curve slope."""

_WIDEST_PCT: Final = 30.0
"""Half width of a panel of biases [%]; judgement: larger biases are written as numbers at its edge."""

_STAGES: Final = (
    ("before: the method as it is", style.VERMILLION, -0.16, "o"),
    ("after: with the traced effects", style.BLUE, 0.16, "s"),
)
"""Stage, colour, vertical offset over the distance between methods [-], and marker."""


def bias_figure(table: LoopTable) -> Figure:
    """Draw the bias of three derivatives by method, before and after, with two standard errors."""
    methods = list(table.statistics)
    with style.applied():
        figure = style.new_figure(9.6, 1.3 + 0.34 * len(methods))
        axes = np.atleast_1d(figure.subplots(1, len(SHOWN), sharey=True))
        for ax, name in zip(axes, SHOWN, strict=True):
            _bias_panel(ax, table, methods, name)
        axes[0].set_yticks(range(len(methods)), methods)
        axes[0].set_ylim(len(methods) - 0.5, -0.5)
        style.legend_above(figure, axes[:1])
    return figure


def _bias_panel(ax: Axes, table: LoopTable, methods: list[str], name: str) -> None:
    j = LONGITUDINAL.parameters.index(name)
    limit = BARS.get(name)
    if limit is not None:
        ax.axvspan(-limit, limit, color=style.SKY, alpha=0.25, lw=0.0, label=f"bias of at most {limit:g} %")
    ax.axvline(0.0, color=style.BLACK, lw=1.0)
    for stage, (label, colour, offset, marker) in enumerate(_STAGES):
        biases = [bias_pct(pair[stage], table.truth) for pair in table.statistics.values()]
        x, se = np.array([b[j] for b, _ in biases]), np.array([s[j] for _, s in biases])
        y = np.arange(len(methods)) + offset
        inside = np.abs(x) <= _WIDEST_PCT
        ax.errorbar(
            x[inside], y[inside], xerr=2.0 * se[inside], fmt=marker, color=colour, ms=4.5, lw=1.0, label=label
        )
        for value, at in zip(x[~inside], y[~inside], strict=True):
            edge = np.sign(value) * _WIDEST_PCT
            ax.annotate(
                f"{value:+.0f}",
                (edge, at),
                color=colour,
                fontsize=7.5,
                va="center",
                ha="right" if value > 0 else "left",
            )
    widest = min(_WIDEST_PCT, 1.1 * max(abs(v) for v in ax.get_xlim()))
    ax.set_xlim(-widest, widest)
    ax.set_xlabel(f"bias of {SYMBOLS[name]} [%]")
    ax.grid(axis="y", visible=False)
    ax.tick_params(axis="y", length=0)


def traces_page(found: Mapping[str, TraceResult]) -> Figure:
    """One page over several traces: innovations before, what the effects take out of them, innovations after.

    Of one record each, and the channel from which most is taken; whitened, so that gusts do not hide an effect.
    Where no effect was accepted, before and after are the aircraft as declared and refitted.

    Parameters
    ----------
    found : name of the log -> its trace.
    """
    with style.applied():
        figure = style.new_figure(10.0, 0.9 + 1.15 * len(found))
        axes = figure.subplots(len(found), 3, squeeze=False, sharex="row")
        for row, (name, trace) in zip(axes, found.items(), strict=True):
            _trace_row(row, name, trace, shown_record(trace.stages))
        for ax, title in zip(
            axes[0], ("innovations before", "taken out of them", "innovations after"), strict=True
        ):
            ax.set_title(title)
        for ax in axes[-1]:
            ax.set_xlabel("time [s]")
        figure.suptitle(
            "Whitened innovations of one held-out record each (shaded: two standard deviations)",
            fontsize=10.0,
        )
    return figure


def _trace_row(row: NDArray[np.object_], name: str, trace: TraceResult, seen: ShownRecord) -> None:
    before, after = seen.before.whitened, seen.after.whitened
    i = int(np.argmax(((before - after) ** 2).mean(axis=0)))
    for ax, values, colour in zip(
        row,
        (before[:, i], before[:, i] - after[:, i], after[:, i]),
        (style.VERMILLION, style.GREEN, style.BLUE),
        strict=True,
    ):
        ax.plot(seen.time_s, values, color=colour, lw=0.8)
        ax.margins(x=0.01)
    low, high = zip(*(ax.get_ylim() for ax in (row[0], row[2])), strict=True)
    for ax in (row[0], row[2]):
        ax.axhspan(-2.0, 2.0, color=style.SKY, alpha=0.25, lw=0.0, zorder=0)
        ax.set_ylim(min(low), max(high))
    bottom, top = row[1].get_ylim()
    row[1].set_ylim(bottom, top + 0.35 * (top - bottom))
    effects = ", ".join(e.key for e in trace.answer.effects)
    told = (
        f"{trace.answer.verdict}: {effects}" if effects else f"{trace.answer.verdict} (as declared, refitted)"
    )
    row[1].text(0.02, 0.96, told, transform=row[1].transAxes, fontsize=7.5, va="top")
    row[0].set_ylabel(f"{name}: {shown(CHANNELS[i])[0].split(' ')[0]} [σ]")


__all__ = ["SHOWN", "bias_figure", "traces_page"]
