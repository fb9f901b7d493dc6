"""Figure of the distribution of estimates over the runs of a campaign, by method."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from airtruth import style
from airtruth.physics.motion import LONGITUDINAL
from airtruth.reporting.campaign import Campaign
from airtruth.reporting.paper.published import SYMBOLS, PublishedTable

Array = NDArray[np.float64]

_QUANTILES: Final = (0.05, 0.25, 0.5, 0.75, 0.95)
"""Quantiles at the ends of whiskers and boxes, and at the median [-]."""

_BOX: Final = 0.42
"""Height of a box over the distance between methods [-]; judgement: leaves room for the published value below it."""

_REACH: Final = 2.5
"""Reach of a panel beyond the quartiles, in interquartile ranges [-]; judgement: 3.4 standard deviations of a normal
sample beyond the quartiles."""


def estimates(
    campaign: Campaign,
    methods: Sequence[str] | None = None,
    printed: Sequence[PublishedTable] = (),
    title: str = "",
) -> Figure:
    """Draw the spread of the six derivatives by method, with the truth and the published mean and standard deviation.

    Every finite estimate counts, converged or not. Boxes show the quartiles and the median, whiskers 90 % of
    the runs, dots the runs beyond. The edge of a panel states the number of runs outside.

    Parameters
    ----------
    campaign : truth and estimates.
    methods : methods from top to bottom, all by default.
    printed : tables of the paper; a method is compared with the first that has it.
    title : heading, "" for none.
    """
    shown = list(methods if methods is not None else campaign.estimates)
    truth = campaign.truth[campaign.flown]
    with style.applied():
        figure = style.new_figure(9.6, 2.4 + 0.72 * len(shown))
        axes = figure.subplots(2, 3, sharey=True)
        for j, (ax, name) in enumerate(zip(axes.flat, LONGITUDINAL.parameters, strict=True)):
            columns = [campaign.estimates[m].values[:, j] for m in shown]
            columns = [column[np.isfinite(column)] for column in columns]
            beside = [_printed(printed, m, name) for m in shown]
            ax.axvline(float(np.mean(truth[:, j])), color=style.BLACK, lw=1.1, label="true value")
            for row, (column, figure_beside) in enumerate(zip(columns, beside, strict=True)):
                _draw(ax, row, column, figure_beside)
            _limit(ax, columns, beside, float(np.mean(truth[:, j])))
            ax.set_xlabel(f"{SYMBOLS[name]} [-]")
            ax.set_yticks(range(len(shown)), shown)
            ax.grid(axis="y", visible=False)
            ax.tick_params(axis="y", length=0)
            ax.xaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
            ax.set_ylim(len(shown) - 0.45, -0.55)
        style.legend_above(figure, axes.flat, title)
    return figure


def _printed(tables: Sequence[PublishedTable], method: str, name: str) -> tuple[float, float] | None:
    columns = (table.column(method) for table in tables)
    column = next(filter(None, columns), None)
    return (column.mean[name].value, column.std[name].value) if column else None


def _draw(ax: Axes, row: int, column: Array, printed: tuple[float, float] | None) -> None:
    y = row - 0.14 if printed else row
    if len(column):
        low, q1, median, q3, high = np.quantile(column, _QUANTILES)
        ax.hlines(y, low, high, color=style.BLUE, lw=1.2)
        ax.barh(
            y,
            q3 - q1,
            _BOX,
            left=q1,
            color=style.SKY,
            edgecolor=style.BLUE,
            lw=1.0,
            label="estimates: quartiles, 5-95 %",
        )
        ax.vlines(median, y - _BOX / 2, y + _BOX / 2, color=style.BLUE, lw=2.0)
        beyond = column[(column < low) | (column > high)]
        ax.plot(beyond, np.full(len(beyond), y), ".", ms=2.5, color=style.BLUE, alpha=0.45, mew=0.0)
    if printed:
        mean, std = printed
        ax.errorbar(
            mean, row + 0.25, xerr=std, fmt="D", ms=3.5, lw=1.2, capsize=2.5, color=style.VERMILLION,
            label="published mean ± standard deviation",
        )  # fmt: skip


def _limit(
    ax: Axes, columns: Sequence[Array], printed: Sequence[tuple[float, float] | None], truth: float
) -> None:
    """Set limits that show the bulk of every method, and state the number of runs outside."""
    edges = [truth]
    for column in columns:
        if len(column):
            q1, q3 = np.quantile(column, (0.25, 0.75))
            reach = _REACH * (q3 - q1)
            edges += [max(float(column.min()), q1 - reach), min(float(column.max()), q3 + reach)]
    edges += [mean + sign * std for mean, std in filter(None, printed) for sign in (-1, 1)]
    margin = 0.04 * (max(edges) - min(edges)) or 1.0
    left, right = min(edges) - margin, max(edges) + margin
    ax.set_xlim(left, right)
    for row, column in enumerate(columns):
        outside = int(np.sum((column < left) | (column > right)))
        if outside:
            ax.text(
                0.99,
                row - 0.44,
                f"{outside} outside",
                transform=ax.get_yaxis_transform(),
                ha="right",
                va="center",
                fontsize=7.5,
                color=style.BLUE,
            )
