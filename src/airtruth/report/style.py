"""Looks that all figures share: readable type, and colours that the colour-blind tell apart."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, Final

import matplotlib
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from airtruth.errors import StoreError, choices
from airtruth.logs.atomic import atomic_file

BLUE: Final = "#0072B2"
VERMILLION: Final = "#D55E00"
GREEN: Final = "#009E73"
PURPLE: Final = "#CC79A7"
ORANGE: Final = "#E69F00"
SKY: Final = "#56B4E9"
BLACK: Final = "#222222"
GREY: Final = "#9A9A9A"
"""Okabe and Ito, Color Universal Design (2008); black and grey softened."""

PALETTE: Final = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY)

FORMATS: Final[dict[str, dict[str, str | None]]] = {"png": {}, "svg": {"Date": None}}
"""Formats that `save` writes, with the metadata that keeps the bytes the same from day to day."""

_RC: Final[dict[Any, Any]] = {
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.labelsize": 9.5,
    "axes.titlesize": 10.0,
    "axes.titleweight": "bold",
    "axes.edgecolor": "#555555",
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#DDDDDD",
    "grid.linewidth": 0.6,
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "legend.fontsize": 8.5,
    "legend.frameon": False,
    "lines.linewidth": 1.4,
    "lines.solid_capstyle": "round",
    "svg.fonttype": "none",
    "svg.hashsalt": "airtruth",  # the same figure gives the same bytes
}


def applied() -> AbstractContextManager[None]:
    """Context in which figures are drawn and saved; matplotlib's own settings are untouched after it."""
    return matplotlib.rc_context(_RC)


def new_figure(width_in: float, height_in: float) -> Figure:
    """An empty figure with constrained layout, outside pyplot's state [inch]."""
    return Figure(figsize=(width_in, height_in), layout="constrained", facecolor="white")


def legend_above(figure: Figure, axes: Iterable[Axes], title: str = "") -> None:
    """Put one legend of all ``axes`` above the panels, under the figure's heading, where it hides no data."""
    entries: dict[str, Artist] = {}
    for ax in axes:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    figure.legend(
        list(entries.values()),
        list(entries),
        loc="outside upper center",
        ncols=min(len(entries), 4),
        title=title or None,
        title_fontproperties={"weight": "bold", "size": 10.0},
    )


def save(figure: Figure, path: Path) -> None:
    """Write a figure whole or not at all; the suffix, .png (150 dpi) or .svg, states the format.

    Raises
    ------
    StoreError
        If the suffix is another, or the file cannot be written.
    """
    kind = path.suffix.removeprefix(".")
    if kind not in FORMATS:
        raise StoreError(f"{path}: no figure format {kind!r}; {choices(kind, FORMATS)}")
    with applied(), atomic_file(path) as file:
        figure.savefig(file, format=kind, dpi=150, metadata=FORMATS[kind])
