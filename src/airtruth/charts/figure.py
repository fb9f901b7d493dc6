"""Charts as Matplotlib figures."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from airtruth.charts.model import SHAPES, Cells, Chart, Colour, Panel, Shape, drawable
from airtruth.charts.ticks import log_ticks

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_WIDTH_IN: Final = 3.3
"""Width of a panel [inch] (judgement)."""
_WIDE_IN: Final = 6.6
"""Width of the only panel of a row [inch] (judgement)."""
_HEIGHT_IN: Final = 1.9
"""Height of a panel without rows [inch] (judgement)."""
_ROW_IN: Final = 0.19
"""Height of a row [inch]; judgement: a line of type."""
_TICKS: Final = 5
"""Most intervals between ticks of the scale of x [-] (judgement: five labels of five characters fit into a panel)."""
_INSIDE: Final = 0.6
"""Share of the scale from which the words of a bar stand inside it [-] (judgement: they fit)."""
_UNDER_LABEL: Final = -0.3
"""Top of a legend below a panel with a label, in heights of the panel [-] (judgement)."""
_UNDER_TICKS: Final = -0.14
"""The same below a panel without a label [-] (judgement)."""
_DASHES: Final = {"solid": "-", "dashed": "--", "dotted": ":", "points": "."}
"""Matplotlib's name of each stroke."""
_MARKERS: Final[dict[Shape, str]] = {
    "circle": "o",
    "square": "s",
    "triangle": "^",
    "diamond": "D",
    "wedge": "v",
}
"""Matplotlib's name of each shape."""
_MARK_PT: Final = 4.5
"""Size of a mark [pt] (judgement: wider than the line of its interval)."""
_CAPTION_IN: Final = 0.16
"""Height of a line of the caption [inch]; judgement: a line of its type."""
_LETTERS_PER_IN: Final = 15
"""Characters of the caption in an inch of width [1/inch] (judgement: its type, with a margin)."""


def as_figure(chart: Chart) -> Figure:
    """Return the chart as a figure in the theme of `airtruth.style`."""
    from airtruth import style

    columns = min(chart.columns, len(chart.panels))
    rows = -(-len(chart.panels) // columns)
    tallest = max((_height(panel) for panel in chart.panels), default=_HEIGHT_IN)
    width = _WIDE_IN if columns == 1 else _WIDTH_IN * columns
    caption = textwrap.wrap(chart.caption, int(_LETTERS_PER_IN * width))
    with style.applied():
        figure, axes = style.panels(
            rows,
            columns,
            width_in=width,
            height_in=0.8 + rows * tallest + _CAPTION_IN * len(caption),
        )
        for ax, panel in zip(axes.ravel(), chart.panels, strict=False):
            _draw(ax, panel)
            if not chart.legend:
                _legend(ax, panel)
        for ax in axes.ravel()[len(chart.panels) :]:
            ax.set_visible(False)
        title = textwrap.fill(chart.title, 70 if columns == 1 else 45 * columns)
        if chart.legend and chart.entries():
            style.legend_above(figure, axes.ravel(), title)
        else:
            figure.suptitle(title, fontsize=10.0, fontweight="bold")
        if caption:
            figure.supxlabel("\n".join(caption), fontsize=7.5)
    return figure


def _height(panel: Panel) -> float:
    return 0.6 + _ROW_IN * len(panel.rows) if panel.rows else _HEIGHT_IN


def _legend(ax: Axes, panel: Panel) -> None:
    """Put the legend of one panel below it, where it hides no data."""
    handles = dict(zip(*reversed(ax.get_legend_handles_labels()), strict=True))
    if handles:
        below = _UNDER_LABEL if panel.x_label else _UNDER_TICKS
        ax.legend(
            list(handles.values()),
            list(handles),
            loc="upper center",
            bbox_to_anchor=(0.5, below),
            ncols=len(handles),
            fontsize=7.5,
        )


def _draw(ax: Axes, panel: Panel) -> None:
    _draw_ranges(ax, panel)
    for line in panel.lines:
        x, y = (np.array([v if drawable(v) else np.nan for v in values]) for values in (line.x, line.y))
        marks: dict[str, Any] = {"markersize": 3.0} if line.stroke == "points" else {"linewidth": 1.1}
        ax.plot(x, y, _DASHES[line.stroke], color=_shade(line.colour), label=line.label or None, **marks)
    for bar in panel.bars:
        if drawable(bar.value):
            ax.barh(bar.row, bar.value, 0.7, color=_shade(bar.colour), label=bar.label or None)
            inside = bar.value > _INSIDE * panel.x_range()[1]
            words = f"{bar.words} " if inside else f" {bar.words}"
            ax.text(
                bar.value,
                bar.row,
                words,
                va="center",
                ha="right" if inside else "left",
                color="white" if inside else _shade("ink"),
                fontsize=7.5,
            )
    for mark in panel.marks:
        if drawable(mark.value):
            colour = _shade(mark.colour)
            if mark.widest is not None and all(map(drawable, mark.widest)):
                ax.hlines(mark.row, *mark.widest, color=colour, linewidth=1.0)
            if drawable(mark.lower) and drawable(mark.upper):
                ax.hlines(mark.row, mark.lower, mark.upper, color=colour, linewidth=3.0)
            size = 0.5 * _MARK_PT if mark.small else _MARK_PT
            marker = _MARKERS[SHAPES[mark.colour]]
            ax.plot(mark.value, mark.row, marker, color=colour, markersize=size, label=mark.label or None)
    if panel.words:
        ax.text(0.5, 0.5, panel.words, transform=ax.transAxes, ha="center", va="center", color=_shade("grey"))
    _label(ax, panel)


def _draw_cells(ax: Axes, cells: Cells) -> None:
    from matplotlib.patches import Rectangle

    for row, column, value in cells.each():
        colour = _shade("blue" if value >= 0.0 else "vermillion")
        box = Rectangle(
            (column - 0.5, row - 0.5), 1.0, 1.0, color=colour, alpha=min(0.75, 0.75 * abs(value)), lw=0.0
        )
        ax.add_patch(box)
        ax.text(column, row, f"{value:.2f}".replace("-", "\u2212"), ha="center", va="center", fontsize=7.5)
    ax.set_xticks(range(len(cells.columns)), cells.columns)
    ax.grid(visible=False)


def _draw_ranges(ax: Axes, panel: Panel) -> None:
    for area in panel.areas:
        for number, piece in enumerate(area.pieces()):
            x, low, high = zip(*piece, strict=True)
            label = area.label if area.label and not number else None
            ax.fill_between(x, low, high, color=_shade(area.colour), alpha=0.25, lw=0.0, label=label)
    for band in panel.bands:
        if drawable(band.low) and drawable(band.high):
            span = ax.axvspan if band.axis == "x" else ax.axhspan
            span(
                band.low,
                band.high,
                color=_shade("sky"),
                alpha=0.25,
                lw=0.0,
                zorder=0,
                label=band.label or None,
            )
    for rule in panel.rules:
        if drawable(rule.at):
            line = ax.axvline if rule.axis == "x" else ax.axhline
            line(rule.at, color=_shade(rule.colour), lw=1.0, label=rule.label or None)


def _label(ax: Axes, panel: Panel) -> None:
    ax.set(title=panel.title, xlabel=panel.x_label)
    ax.set_xlim(*panel.x_range())
    if panel.cells is not None:
        _draw_cells(ax, panel.cells)
    elif panel.x_log:
        at = log_ticks(*panel.x_range())
        ax.set_xticks(at, [f"{10.0**value:g}" for value in at])
    else:
        ax.locator_params(axis="x", nbins=_TICKS)
    if panel.rows:
        ax.set_yticks(range(len(panel.rows)), panel.rows, fontsize=7.5)
        margin = 0.6 if panel.cells is None else 0.5
        ax.set_ylim(len(panel.rows) - 1.0 + margin, -margin)
        ax.grid(axis="y", visible=False)
    else:
        ax.set_ylabel(panel.y_label)
        ax.set_ylim(*panel.y_range())


def _shade(colour: Colour) -> str:
    from airtruth import style

    return {
        "blue": style.BLUE,
        "vermillion": style.VERMILLION,
        "green": style.GREEN,
        "purple": style.PURPLE,
        "orange": style.ORANGE,
        "sky": style.SKY,
        "ink": style.BLACK,
        "grey": style.GREY,
    }[colour]


__all__ = ["as_figure"]
