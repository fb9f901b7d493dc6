"""One record of a trace as a figure for readers in a hurry: controls, measured against both models, residual."""

from __future__ import annotations

from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator
from numpy.typing import NDArray

from airtruth import style
from airtruth.channels import shown
from airtruth.logs.histories import Histories, History
from airtruth.physics.motion import motion_with
from airtruth.table import significant
from airtruth.units import DEG

Array = NDArray[np.float64]

_SIZE_IN: Final = (8.0, 5.2)
"""Width and height [inch]; judgement: legible at a width of 800 px."""
_MODELS: Final = ("declared model", "corrected model")
"""Words of the first and the last model of a trace."""
_POINTS: Final = 160
"""Most measured points of a panel [-] (judgement: single dots are seen between the lines)."""
_LEAD_S: Final = 0.6
"""Time shown before the elevator moves [s] (judgement)."""
_SPAN_S: Final = 4.4
"""Time that is shown [s] (judgement: the manoeuvre and its free response)."""


@style.themed
def match_figure(histories: Histories) -> Figure:
    """Draw the record that a report shows first: controls, two outputs beside the first and the last model, residuals.

    Parameters
    ----------
    histories : of a trace; its first model is the declared one.
    """
    record = histories.first
    models = (histories.models[0], histories.models[-1])
    span = _span(record)
    figure = style.new_figure(*_SIZE_IN)
    columns = columns_of(record)
    axes = figure.subplots(3, len(columns), sharex=True, height_ratios=(0.55, 1.5, 1.0))
    for column, (channel, control) in enumerate(columns):
        _control(axes[0, column], record, control, span)
        _signals(axes[1, column], record, models, channel, span)
        _residuals(axes[2, column], record, models, channel, span)
        axes[2, column].set_xlabel("time [s]")
    if len(record.controls_rad) == 1:
        axes[0, 1].set_ylabel("")
    for ax in axes.flat:
        ax.xaxis.set_major_locator(MultipleLocator(1.0))
    _words(axes, record, models, span, [channel for channel, _ in columns])
    for column in axes.T:
        figure.align_ylabels(column)
    return figure


def columns_of(record: History) -> list[tuple[str, str]]:
    """The outputs of the columns, each with the control above it: of one control, the first two; of several, its rate each."""
    controls = motion_with(record.measured).controls
    if len(controls) == 1:
        return [(channel, controls[0].channel) for channel in list(record.measured)[:2]]
    return [(control.damped, control.channel) for control in controls]


def _span(record: History) -> NDArray[np.bool_]:
    """Samples from shortly before a control moves."""
    moved = np.max([np.abs(x - x[0]) for x in record.controls_rad.values()], axis=0)
    first = float(record.t_s[int(np.argmax(moved > 0.2 * moved.max()))])
    return np.asarray((record.t_s >= first - _LEAD_S) & (record.t_s <= first - _LEAD_S + _SPAN_S))


def _control(ax: Axes, record: History, control: str, span: NDArray[np.bool_]) -> None:
    ax.plot(record.t_s[span], record.controls_rad[control][span] / DEG, color=style.BLACK, lw=1.2)
    ax.set_ylabel(shown(control)[0].replace(" ", "\n"))


def _signals(
    ax: Axes, record: History, models: tuple[str, str], channel: str, span: NDArray[np.bool_]
) -> None:
    factor = shown(channel)[1]
    step = max(1, int(span.sum()) // _POINTS)
    t = record.t_s[span]
    ax.plot(
        t[::step], record.measured[channel][span][::step] * factor, "o", color=style.GREY, ms=2.6, mew=0.0
    )
    for model, colour, dash in zip(models, (style.VERMILLION, style.BLUE), ("--", "-"), strict=True):
        ax.plot(t, record.models[model][channel][span] * factor, dash, color=colour, lw=1.7)
    quantity = next(o.quantity for o in motion_with(record.measured).outputs if o.channel == channel)
    ax.set_ylabel(f"{quantity} [{shown(channel)[0].partition('[')[2]}")


def _residuals(
    ax: Axes, record: History, models: tuple[str, str], channel: str, span: NDArray[np.bool_]
) -> None:
    factor = shown(channel)[1]
    floor = 2.0 * record.floor.get(channel, 0.0) * factor
    ax.axhspan(-floor, floor, color=style.SKY, alpha=0.3, lw=0.0, zorder=0)
    for model, colour, dash in zip(models, (style.VERMILLION, style.BLUE), ("--", "-"), strict=True):
        ax.plot(record.t_s[span], record.residual(model, channel)[span] * factor, dash, color=colour, lw=1.3)
    ax.set_ylabel(f"residual [{shown(channel)[0].partition('[')[2]}")


def _words(
    axes: NDArray[np.object_],
    record: History,
    models: tuple[str, str],
    span: NDArray[np.bool_],
    channels: list[str],
) -> None:
    """Labels beside the curves, in the second panel; of pitch that of q, where the curves are farthest apart."""
    ax: Axes = axes[1, 1]
    t = record.t_s[span]
    ax.set_xlim(float(t[0]), float(t[-1]))
    entries = (
        ("measured", style.GREY_TEXT),
        (_MODELS[0], style.VERMILLION),
        (_MODELS[1], style.BLUE),
    )
    for k, (words, colour) in enumerate(entries):
        ax.text(
            0.985,
            0.97 - 0.105 * k,
            words,
            transform=ax.transAxes,
            color=colour,
            ha="right",
            va="top",
            fontsize=9.5,
            fontweight="bold",
        )
    axes[2, 0].text(
        0.985,
        0.05,
        "shaded: 2\u03c3 of gusts and noise",
        transform=axes[2, 0].transAxes,
        color=style.SKY_TEXT,
        ha="right",
        va="bottom",
        fontsize=8.5,
    )
    for below, channel in zip(axes[2], channels, strict=True):
        name, factor = shown(channel)
        unit = name.partition("[")[2].rstrip("]")
        rms = [significant(record.rms(m, channel) * factor, 2) for m in models]
        told = f"rms {rms[0]} \u2192 {rms[1]} {unit}"
        below.text(0.985, 0.96, told, transform=below.transAxes, ha="right", va="top", fontsize=8.5)


__all__ = ["columns_of", "match_figure"]
