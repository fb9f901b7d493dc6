"""Figure of the distribution of each method's estimates over the runs of a campaign."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from airtruth.physics import short_period
from airtruth.report import style
from airtruth.report.campaign import Campaign
from airtruth.report.published import SYMBOLS, PublishedTable

Array = NDArray[np.float64]

_QUANTILES: Final = (0.05, 0.25, 0.5, 0.75, 0.95)
_BOX: Final = 0.42
"""Height of a box; methods are 1 apart."""


def estimates(
    campaign: Campaign,
    methods: Sequence[str] | None = None,
    printed: Sequence[PublishedTable] = (),
    title: str = "",
) -> Figure:
    """Spread of the six derivatives by method, with the truth and the published mean +- std.

    Every finite estimate enters, converged or not. Boxes are quartiles with the median, whiskers hold
    90 % of the runs, dots are the runs beyond. Runs outside the panel are counted at its edge.

    Parameters
    ----------
    campaign : truth and estimates.
    methods : methods from top to bottom, all by default.
    printed : the paper's tables whose figures are drawn beside; a method takes the first that has it.
    title : heading, "" for none.
    """
    shown = list(methods if methods is not None else campaign.estimates)
    truth = campaign.truth[campaign.flown]
    with style.applied():
        figure = style.new_figure(9.6, 2.4 + 0.72 * len(shown))
        axes = figure.subplots(2, 3, sharey=True)
        for j, (ax, name) in enumerate(zip(axes.flat, short_period.PARAMETERS, strict=True)):
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
    found = (table.column(method) for table in tables)
    column = next(filter(None, found), None)
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
    """Frame the bulk of every method, and say how many runs lie outside the frame."""
    edges = [truth]
    for column in columns:
        if len(column):
            q1, q3 = np.quantile(column, (0.25, 0.75))
            reach = 2.5 * (q3 - q1)  # 3.4 standard deviations beyond the quartiles of a normal sample
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
