"""A chart: panels of lines, marks with intervals, bars, rules and bands, without a medium."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, Literal

Colour = Literal["blue", "vermillion", "green", "purple", "orange", "sky", "ink", "grey"]
"""Role of a colour; each medium and each theme has its own shade of it."""
Stroke = Literal["solid", "dashed", "dotted", "points"]
"""How a line is drawn."""
Shape = Literal["circle", "square", "triangle", "diamond", "wedge"]
"""Outline of a mark; a wedge is a triangle that points down."""

SHAPES: Final[Mapping[Colour, Shape]] = {
    "blue": "circle",
    "vermillion": "square",
    "green": "triangle",
    "purple": "diamond",
    "orange": "wedge",
    "sky": "circle",
    "ink": "square",
    "grey": "triangle",
}
"""Shape of the marks of each colour: print without colours, and readers who do not see them, tell marks apart."""

MODELS: Final[tuple[Colour, ...]] = ("blue", "vermillion", "green", "purple", "orange", "sky")
"""Colours of several models, the last model first: it is the answer."""


def colours_of(models: Sequence[str]) -> dict[str, Colour]:
    """Model -> its colour, the same in every chart of a page."""
    return {name: MODELS[k % len(MODELS)] for k, name in enumerate(reversed(models))}


LARGEST: Final = 1e30
"""Largest magnitude that is drawn [-]; judgement: beyond any quantity, and its square does not overflow."""


SMALLEST: Final = 1e-30
"""Width of a scale below which its ends are one value [-]; judgement: below any quantity."""


@dataclass(frozen=True)
class Line:
    """A curve, or points; a pair that is not finite is a gap.

    Attributes
    ----------
    x, y : coordinates in the units of the axes, one length.
    label : entry of the legend, "" for none.
    """

    x: tuple[float, ...]
    y: tuple[float, ...]
    label: str = ""
    colour: Colour = "blue"
    stroke: Stroke = "solid"

    def __post_init__(self) -> None:
        """Refuse coordinates of two lengths.

        Raises
        ------
        ValueError
            Stating both lengths.
        """
        if len(self.x) != len(self.y):
            raise ValueError(f"a line has {len(self.x)} values of x and {len(self.y)} of y")


@dataclass(frozen=True)
class Mark:
    """A value with an interval in a row of a panel.

    Attributes
    ----------
    row : position among the rows of the panel; fractions set marks of one row apart.
    value : the value; lower, upper : ends of its interval, NaN for none.
    widest : ends of a second, wider interval, None for none.
    small : whether its shape is half as large, for a second quantity beside the first.
    """

    row: float
    value: float
    lower: float = math.nan
    upper: float = math.nan
    widest: tuple[float, float] | None = None
    label: str = ""
    colour: Colour = "blue"
    small: bool = False


@dataclass(frozen=True)
class Bar:
    """A bar from zero in a row of a panel, with words behind its end."""

    row: float
    value: float
    label: str = ""
    colour: Colour = "blue"
    words: str = ""


@dataclass(frozen=True)
class Rule:
    """A straight line at a value of one axis over the whole panel."""

    at: float
    axis: Literal["x", "y"] = "x"
    label: str = ""
    colour: Colour = "grey"


@dataclass(frozen=True)
class Band:
    """A shaded range of one axis over the whole panel."""

    low: float
    high: float
    axis: Literal["x", "y"] = "y"
    label: str = ""


@dataclass(frozen=True)
class Area:
    """The range between two curves; a pair that is not finite is a gap.

    Attributes
    ----------
    x, low, high : coordinates in the units of the axes, one length.
    label : entry of the legend, "" for none.
    """

    x: tuple[float, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]
    label: str = ""
    colour: Colour = "blue"

    def pieces(self) -> Iterator[list[tuple[float, float, float]]]:
        """Runs of neighbours that can be drawn, as x, low and high."""
        piece: list[tuple[float, float, float]] = []
        for point in zip(self.x, self.low, self.high, strict=True):
            if all(map(drawable, point)):
                piece.append(point)
            elif piece:
                yield piece
                piece = []
        if piece:
            yield piece


Item = Line | Area | Mark | Bar | Rule | Band
"""Marks that a legend has entries of."""


@dataclass(frozen=True)
class Cells:
    """A matrix of numbers from -1 to 1 over the rows of a panel, coloured by sign and size.

    Attributes
    ----------
    columns : names of the columns.
    values : rows of numbers, NaN for an empty cell.
    """

    columns: tuple[str, ...]
    values: tuple[tuple[float, ...], ...]

    def each(self) -> Iterator[tuple[int, int, float]]:
        """Row, column and number of every cell that is not empty."""
        for row, numbers in enumerate(self.values):
            for column, number in enumerate(numbers):
                if math.isfinite(number):
                    yield row, column, number


@dataclass(frozen=True)
class Panel:
    """One pair of axes.

    Attributes
    ----------
    title, x_label, y_label : words, with units.
    lines, areas, marks, bars, rules, bands : what it shows.
    rows : names of the rows from top to bottom; a panel with rows has no scale of y.
    cells : a matrix over the rows; a panel with one has no scale of x.
    x_limits, y_limits : ends of the scales, None for those of the data.
    x_log : whether the scale of x is logarithmic; its values are then log10 of what the ticks state.
    words : text in the centre of a panel without data.
    """

    title: str = ""
    x_label: str = ""
    y_label: str = ""
    lines: tuple[Line, ...] = ()
    marks: tuple[Mark, ...] = ()
    bars: tuple[Bar, ...] = ()
    rules: tuple[Rule, ...] = ()
    bands: tuple[Band, ...] = ()
    areas: tuple[Area, ...] = ()
    rows: tuple[str, ...] = ()
    cells: Cells | None = None
    x_limits: tuple[float, float] | None = None
    y_limits: tuple[float, float] | None = None
    x_log: bool = False
    words: str = ""

    def x_range(self) -> tuple[float, float]:
        """Ends of the scale of x: as stated, or the data with a margin; zero to one if there are none."""
        if self.cells is not None:
            return -0.5, len(self.cells.columns) - 0.5
        if self.x_limits is not None and all(map(drawable, self.x_limits)):
            return _range(self.x_limits, 0.0)
        values = [x for line in self.lines for x, y in zip(line.x, line.y, strict=True) if drawable(y)]
        for mark in self.marks:
            values += [mark.value, mark.lower, mark.upper, *(mark.widest or ())]
        values += [bar.value for bar in self.bars] + ([0.0] if self.bars else [])
        values += [rule.at for rule in self.rules if rule.axis == "x"]
        values += [x for band in self.bands if band.axis == "x" for x in (band.low, band.high)]
        return _range(values, 0.0 if self.lines and not self.rows else 0.06)

    def y_range(self) -> tuple[float, float]:
        """Ends of the scale of y of a panel without rows."""
        if self.y_limits is not None and all(map(drawable, self.y_limits)):
            return _range(self.y_limits, 0.0)
        values = [y for line in self.lines for y in line.y]
        values += [y for area in self.areas for y in (*area.low, *area.high)]
        values += [rule.at for rule in self.rules if rule.axis == "y"]
        values += [y for band in self.bands if band.axis == "y" for y in (band.low, band.high)]
        return _range(values, 0.06)

    def legend(self) -> Iterator[tuple[str, Item]]:
        """Each label once, with the first item that has it."""
        seen: set[str] = set()
        items: tuple[Item, ...]
        for items in (self.lines, self.areas, self.marks, self.bars, self.rules, self.bands):
            for item in items:
                if item.label and item.label not in seen:
                    seen.add(item.label)
                    yield item.label, item


@dataclass(frozen=True)
class Chart:
    """Panels in rows and columns.

    Attributes
    ----------
    name : name of its file, without folder and suffix.
    title : heading.
    panels : from left to right and from top to bottom.
    columns : number of panels side by side, where the medium is wide enough.
    caption : sentence below the chart.
    legend : whether one legend serves all panels; else each panel has its own.
    """

    name: str
    title: str
    panels: tuple[Panel, ...]
    columns: int
    caption: str = ""
    legend: bool = field(default=True)

    def entries(self) -> list[tuple[str, Item]]:
        """Entries of the common legend: each label once."""
        found: dict[str, Item] = {}
        for panel in self.panels:
            for label, item in panel.legend():
                found.setdefault(label, item)
        return list(found.items())


def drawable(value: float) -> bool:
    """Whether a number can be drawn."""
    return math.isfinite(value) and abs(value) < LARGEST


def _range(values: Iterable[float], margin: float) -> tuple[float, float]:
    finite = [v for v in values if drawable(v)]
    if not finite:
        return 0.0, 1.0
    low, high = min(finite), max(finite)
    size = max(abs(low), abs(high))
    if high - low <= max(1e-12 * size, SMALLEST):
        half = 0.5 * size if size > SMALLEST else 0.5
        return low - half, high + half
    return low - margin * (high - low), high + margin * (high - low)


__all__ = [
    "LARGEST",
    "MODELS",
    "SHAPES",
    "SMALLEST",
    "Area",
    "Band",
    "Bar",
    "Cells",
    "Chart",
    "Colour",
    "Item",
    "Line",
    "Mark",
    "Panel",
    "Rule",
    "Shape",
    "Stroke",
    "colours_of",
    "drawable",
]
