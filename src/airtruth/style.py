"""Theme of all figures: readable type, colours that colour-blind readers can tell apart, files written whole.

Matplotlib takes half a second to import; the first figure imports it. A ``plot()`` method draws in this way, without pyplot
and its global state::

    @style.themed
    def plot(self) -> Figure:
        figure, axes = style.panels(2, 1, width_in=7.0, height_in=4.0, sharex=True)
        axes[0, 0].plot(t_s, alpha_rad, color=style.BLUE, label="measured")
        style.legend_above(figure, axes.flat)
        return figure
"""

from __future__ import annotations

import base64
import functools
import html
import io
from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Final, Literal, ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import StoreError, choices
from airtruth.logs.atomic import atomic_file

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BLUE: Final = "#0072B2"
"""Blue of Okabe and Ito, Color Universal Design (2008)."""

VERMILLION: Final = "#D55E00"
"""Vermillion of Okabe and Ito (2008)."""

GREEN: Final = "#009E73"
"""Bluish green of Okabe and Ito (2008)."""

PURPLE: Final = "#CC79A7"
"""Reddish purple of Okabe and Ito (2008)."""

ORANGE: Final = "#E69F00"
"""Orange of Okabe and Ito (2008)."""

SKY: Final = "#56B4E9"
"""Sky blue of Okabe and Ito (2008)."""

BLACK: Final = "#222222"
"""Black, lightened for the contrast with thin lines (judgement)."""

GREY: Final = "#9A9A9A"
"""Grey of measured points behind a model's line (judgement)."""

GREY_TEXT: Final = "#6A6A6A"
"""Grey of words beside grey points: 5.4 to 1 against white (WCAG asks for 4.5)."""

SKY_TEXT: Final = "#1F6FA0"
"""Blue of words in a sky-blue band: 5.1 to 1 against white."""

PALETTE: Final = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY)
"""Colours of several curves, in this order."""

FORMATS: Final[dict[str, dict[str, str | None]]] = {
    "png": {},
    "svg": {"Date": None},
    "pdf": {"CreationDate": None},
}
"""Formats that `save` writes, with the metadata that keeps the bytes the same from day to day."""

DPI: Final = 150
"""Resolution of PNG files [1/inch]; judgement: sharp at the width of a page, 100 to 200 kB a figure."""

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
    "pdf.fonttype": 42,  # TrueType, which journals ask for
    "svg.fonttype": "none",
    "svg.hashsalt": "airtruth",  # the same figure gives the same bytes
}
"""Settings of matplotlib; lengths in points (judgement: legible at the width of a page)."""

P = ParamSpec("P")
T = TypeVar("T")


def applied() -> AbstractContextManager[None]:
    """Return a context in which figures have this theme; matplotlib's settings are restored after it."""
    import matplotlib

    return matplotlib.rc_context(_RC)


def themed(draw: Callable[P, T]) -> Callable[P, T]:
    """Decorate a function that draws: it runs in the context of `applied`."""

    @functools.wraps(draw)
    def drawn(*args: P.args, **kwargs: P.kwargs) -> T:
        with applied():
            return draw(*args, **kwargs)

    return drawn


def new_figure(width_in: float, height_in: float) -> Figure:
    """Return an empty figure of this size [inch] with constrained layout, outside pyplot's state."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width_in, height_in), layout="constrained", facecolor="white")


def panels(
    rows: int,
    columns: int,
    *,
    width_in: float,
    height_in: float,
    sharex: bool | Literal["row", "col"] = False,
    sharey: bool | Literal["row", "col"] = False,
) -> tuple[Figure, NDArray[np.object_]]:
    """Return a figure of this size [inch] and its (rows, columns) array of axes."""
    figure = new_figure(width_in, height_in)
    return figure, figure.subplots(rows, columns, sharex=sharex, sharey=sharey, squeeze=False)


def legend_above(figure: Figure, axes: Iterable[Axes], title: str = "", columns: int = 4) -> None:
    """Put one legend of all ``axes`` above the panels, under the figure's heading, where it hides no data.

    Parameters
    ----------
    columns : most entries side by side; fewer for long entries or a narrow figure.
    """
    entries: dict[str, Artist] = {}
    for ax in axes:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    legend = figure.legend(
        list(entries.values()),
        list(entries),
        loc="outside upper center",
        ncols=min(len(entries), columns),
        title=title or None,
        title_fontproperties={"weight": "bold", "size": 10.0},
    )
    legend.get_title().set_multialignment("center")


def save(figure: Figure, path: Path) -> None:
    """Write a figure whole or not at all; the suffix, .png, .svg or .pdf, states the format.

    Raises
    ------
    StoreError
        If the suffix is another, or the file cannot be written.
    """
    kind = path.suffix.removeprefix(".")
    if kind not in FORMATS:
        raise StoreError(f"{path}: no figure format {kind!r}; {choices(kind, FORMATS)}")
    with atomic_file(path) as file:
        _write(figure, file, kind)


def as_png(figure: Figure) -> bytes:
    """Return the figure as the bytes of a PNG file."""
    out = io.BytesIO()
    _write(figure, out, "png")
    return out.getvalue()


def _write(figure: Figure, file: IO[bytes], kind: str) -> None:
    with applied():
        figure.draw_without_rendering()  # the first layout changes the ticks, which the second one has to fit
        figure.savefig(file, format=kind, dpi=DPI, metadata=FORMATS[kind])


def as_html(png: bytes, caption: str) -> str:
    """Return an HTML figure that holds the picture itself, with its caption.

    Parameters
    ----------
    png : bytes of a PNG file, such as those of `as_png`.
    """
    words, data = html.escape(caption), base64.b64encode(png).decode("ascii")
    picture = f'<img alt="{words}" src="data:image/png;base64,{data}">'
    return f"<figure>{picture}<figcaption>{words}</figcaption></figure>"


__all__ = [
    "BLACK",
    "BLUE",
    "DPI",
    "FORMATS",
    "GREEN",
    "GREY",
    "GREY_TEXT",
    "ORANGE",
    "PALETTE",
    "PURPLE",
    "SKY",
    "SKY_TEXT",
    "VERMILLION",
    "applied",
    "as_html",
    "as_png",
    "legend_above",
    "new_figure",
    "panels",
    "save",
    "themed",
]
