"""Charts as HTML: one SVG per panel, so that a narrow screen stacks them at full size.

Colours are variables of the page's style sheet (``--blue`` ... ``--ink``), so that a chart follows the theme.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from airtruth.charts.model import (
    SHAPES,
    Area,
    Band,
    Bar,
    Cells,
    Chart,
    Colour,
    Item,
    Line,
    Mark,
    Panel,
    Rule,
    Shape,
    drawable,
)
from airtruth.charts.ticks import label, log_ticks, ticks
from airtruth.table import escaped

_WIDTH: Final = 340.0
"""Width of a panel [px]; judgement: three side by side on a page, one on a telephone."""
_WIDE: Final = 480.0
"""Width of the only panel of a row [px] (judgement)."""
_HEIGHT: Final = 190.0
"""Height of a panel without rows [px] (judgement)."""
_ROW: Final = 19.0
"""Height of a row [px]; judgement: a line of type."""
_CELL: Final = 26.0
"""Height of a row of a matrix [px] (judgement: its numbers keep their distance)."""
_CHARACTER: Final = 6.3
"""Width of a character of the labels [px]; judgement: 11 px type, on the safe side."""
_LEAST_PLOT: Final = 120.0
"""Least width that the labels of rows leave to the data [px] (judgement)."""
_DASHES: Final = {"solid": "", "dashed": ' stroke-dasharray="6 3"', "dotted": ' stroke-dasharray="1.5 3"'}
"""Attribute of each stroke."""
_CORNERS: Final[dict[Shape, tuple[tuple[float, float], ...]]] = {
    "circle": (),
    "square": ((-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)),
    "triangle": ((0.0, -1.2), (1.2, 0.9), (-1.2, 0.9)),
    "diamond": ((0.0, -1.3), (1.3, 0.0), (0.0, 1.3), (-1.3, 0.0)),
    "wedge": ((0.0, 1.2), (1.2, -0.9), (-1.2, -0.9)),
}
"""Corners of each shape over the radius of a circle of the same weight [-] (judgement)."""
_RADIUS: Final = 3.5
"""Radius of a mark [px] (judgement: wider than the line of its interval)."""


@dataclass(frozen=True)
class _Frame:
    """Position of the data in a panel [px] and the scales [data]."""

    left: float
    top: float
    width: float
    height: float
    x: tuple[float, float]
    y: tuple[float, float]

    def px(self, value: float) -> float:
        return self.left + self.width * (value - self.x[0]) / (self.x[1] - self.x[0])

    def py(self, value: float) -> float:
        return self.top + self.height * (1.0 - (value - self.y[0]) / (self.y[1] - self.y[0]))


def as_html(chart: Chart) -> str:
    """Return a figure element: legend, panels and caption."""
    width = _WIDE if chart.columns == 1 else _WIDTH
    legend = _legend(chart) if chart.legend else ""
    panels = "".join(_panel(panel, width, own_legend=not chart.legend) for panel in chart.panels)
    caption = f"<figcaption>{escaped(chart.caption)}</figcaption>" if chart.caption else ""
    title = escaped(chart.title)
    return (
        f'<figure class="chart" aria-label="{title}"><div class="charttitle">{title}</div>{legend}'
        f'<div class="panels c{chart.columns}">{panels}</div>{caption}</figure>\n'
    )


def _legend(chart: Chart) -> str:
    entries = "".join(_entry(words, item) for words, item in chart.entries())
    return f'<div class="legend">{entries}</div>' if entries else ""


def _entry(words: str, item: Item) -> str:
    if isinstance(item, Band):
        key = '<rect x="0" y="1" width="22" height="10" class="band"/>'
    elif isinstance(item, Area):
        key = f'<rect x="0" y="1" width="22" height="10" class="area" fill="var(--{item.colour})"/>'
    elif isinstance(item, Bar):
        key = f'<rect x="4" y="2" width="14" height="8" fill="var(--{item.colour})"/>'
    elif isinstance(item, Mark):
        key = _interval(item, 1.0, 21.0, 6.0) + _dot(item.colour, 11.0, 6.0, SHAPES[item.colour])
    elif isinstance(item, Line) and item.stroke == "points":
        key = _dot(item.colour, 11.0, 6.0, "circle", 2.0)
    else:
        dash = _DASHES[item.stroke] if isinstance(item, Line) else ""
        key = f'<line x1="0" x2="22" y1="6" y2="6" stroke="var(--{item.colour})" stroke-width="2"{dash}/>'
    svg = f'<svg width="22" height="12" viewBox="0 0 22 12" aria-hidden="true">{key}</svg>'
    return f"<span>{svg}{escaped(words)}</span>"


def _panel(panel: Panel, width: float, own_legend: bool) -> str:
    frame = _frame(panel, width)
    height = frame.top + frame.height + (34.0 if panel.x_label else 20.0)
    parts = [*_axes(panel, frame), *_items(panel, frame), *_words(panel, frame)]
    name = escaped(panel.title or panel.y_label or panel.x_label)
    legend = ""
    if own_legend:
        entries = "".join(_entry(words, item) for words, item in panel.legend())
        legend = f'<div class="legend">{entries}</div>' if entries else ""
    return (
        f'<div class="panel"><svg viewBox="0 0 {width:g} {height:.0f}" role="img" aria-label="{name}">'
        f"{''.join(parts)}</svg>{legend}</div>"
    )


def _frame(panel: Panel, width: float) -> _Frame:
    top = 20.0 if panel.title else 8.0
    right = 12.0
    if panel.rows:
        longest = max(len(row) for row in panel.rows)
        left = min(16.0 + _CHARACTER * longest, width - right - _LEAST_PLOT)
        return _Frame(
            left=left,
            top=top,
            width=width - left - right,
            height=(_ROW if panel.cells is None else _CELL) * len(panel.rows) + 6.0,
            x=panel.x_range(),
            y=(len(panel.rows) - 0.4, -0.6) if panel.cells is None else (len(panel.rows) - 0.5, -0.5),
        )
    left = 58.0 if panel.y_label else 46.0
    height = _HEIGHT - top - 34.0
    return _Frame(left, top, width - left - right, height, panel.x_range(), panel.y_range())


def _axes(panel: Panel, f: _Frame) -> Iterator[str]:
    bottom = f.top + f.height
    for value, words in _x_ticks(panel, f):
        x = f.px(value)
        if panel.cells is None:
            yield f'<line class="grid" x1="{x:.1f}" x2="{x:.1f}" y1="{f.top:.1f}" y2="{bottom:.1f}"/>'
        yield f'<text x="{x:.1f}" y="{bottom + 13:.1f}" text-anchor="middle">{escaped(words)}</text>'
    yield f'<line class="axis" x1="{f.left:.1f}" x2="{f.left + f.width:.1f}" y1="{bottom:.1f}" y2="{bottom:.1f}"/>'
    for row, words in enumerate(panel.rows):
        y = f.py(row) + 4.0
        shown = _shortened(words, f.left - 8.0)
        yield f'<text x="{f.left - 6:.1f}" y="{y:.1f}" text-anchor="end">{escaped(shown)}</text>'
    if not panel.rows and not panel.words:
        at = ticks(*f.y, most=4)
        step = at[1] - at[0] if len(at) > 1 else f.y[1] - f.y[0]
        for value in at:
            y = f.py(value)
            yield f'<line class="grid" x1="{f.left:.1f}" x2="{f.left + f.width:.1f}" y1="{y:.1f}" y2="{y:.1f}"/>'
            yield f'<text x="{f.left - 5:.1f}" y="{y + 4:.1f}" text-anchor="end">{label(value, step)}</text>'


def _x_ticks(panel: Panel, f: _Frame) -> Iterator[tuple[float, str]]:
    if panel.cells is not None:
        yield from ((float(k), name) for k, name in enumerate(panel.cells.columns))
    elif panel.x_log:
        yield from ((at, f"{10.0**at:g}") for at in log_ticks(*f.x))
    else:
        at = ticks(*f.x)
        step = at[1] - at[0] if len(at) > 1 else f.x[1] - f.x[0]
        yield from ((value, label(value, step)) for value in at)


def _shortened(words: str, width: float) -> str:
    most = int(width / (_CHARACTER - 0.4))
    return words if len(words) <= most else words[: most - 1] + "…"


def _items(panel: Panel, f: _Frame) -> Iterator[str]:
    for band in panel.bands:
        yield _band(band, f)
    for area in panel.areas:
        yield _area(area, f)
    if panel.cells is not None:
        yield from _cells(panel.cells, f)
    for rule in panel.rules:
        if drawable(rule.at):
            yield _rule(rule, f)
    for bar in panel.bars:
        if drawable(bar.value):
            yield from _bar(bar, f)
    for line in panel.lines:
        yield from _line(line, f)
    for mark in panel.marks:
        if drawable(mark.value):
            yield from _mark(mark, f)


def _band(band: Band, f: _Frame) -> str:
    if not (drawable(band.low) and drawable(band.high)):
        return ""
    if band.axis == "x":
        low, high = (min(max(f.px(v), f.left), f.left + f.width) for v in (band.low, band.high))
        return f'<rect class="band" x="{low:.1f}" y="{f.top:.1f}" width="{high - low:.1f}" height="{f.height:.1f}"/>'
    low, high = (min(max(f.py(v), f.top), f.top + f.height) for v in (band.low, band.high))
    return f'<rect class="band" x="{f.left:.1f}" y="{high:.1f}" width="{f.width:.1f}" height="{low - high:.1f}"/>'


def _area(area: Area, f: _Frame) -> str:
    path = ""
    for piece in area.pieces():
        there = "L".join(f"{f.px(x):.1f} {f.py(low):.1f}" for x, low, _ in piece)
        back = "L".join(f"{f.px(x):.1f} {f.py(high):.1f}" for x, _, high in reversed(piece))
        path += f"M{there}L{back}Z"
    return f'<path d="{path}" class="area" fill="var(--{area.colour})"/>'


def _cells(cells: Cells, f: _Frame) -> Iterator[str]:
    """Squares whose opacity is the size of the number, blue if it is positive, vermillion if negative."""
    width, height = f.width / len(cells.columns), f.height / len(cells.values)
    for row, column, value in cells.each():
        x, y = f.left + column * width, f.top + row * height
        colour = "blue" if value >= 0.0 else "vermillion"
        words = f"{value:.2f}".replace("-", "\u2212")
        yield (
            f'<rect x="{x:.1f}" y="{y:.1f}" width="{width - 1.0:.1f}" height="{height - 1.0:.1f}" '
            f'fill="var(--{colour})" fill-opacity="{min(0.75, 0.75 * abs(value)):.2f}"/>'
            f'<text class="cell" x="{x + 0.5 * width:.1f}" y="{y + 0.5 * height + 4.0:.1f}" '
            f'text-anchor="middle">{words}</text>'
        )


def _rule(rule: Rule, f: _Frame) -> str:
    colour = f'stroke="var(--{rule.colour})"'
    if rule.axis == "x":
        x = f.px(rule.at)
        return f'<line {colour} x1="{x:.1f}" x2="{x:.1f}" y1="{f.top:.1f}" y2="{f.top + f.height:.1f}"/>'
    y = f.py(rule.at)
    return f'<line {colour} x1="{f.left:.1f}" x2="{f.left + f.width:.1f}" y1="{y:.1f}" y2="{y:.1f}"/>'


def _bar(bar: Bar, f: _Frame) -> Iterator[str]:
    ends = sorted((f.px(0.0), f.px(bar.value)))
    y = f.py(bar.row)
    yield (
        f'<rect x="{ends[0]:.1f}" y="{y - 6:.1f}" width="{ends[1] - ends[0]:.1f}" height="12" '
        f'fill="var(--{bar.colour})"><title>{bar.value:.4g}</title></rect>'
    )
    if bar.words:
        inside = ends[1] + _CHARACTER * len(bar.words) > f.left + f.width
        anchor, x = ("end", ends[1] - 4.0) if inside else ("start", ends[1] + 4.0)
        kind = ' class="onbar"' if inside else ""
        yield f'<text{kind} x="{x:.1f}" y="{y + 4:.1f}" text-anchor="{anchor}">{escaped(bar.words)}</text>'


def _line(line: Line, f: _Frame) -> Iterator[str]:
    points = [
        (f.px(x), f.py(y)) if drawable(x) and drawable(y) else None
        for x, y in zip(line.x, line.y, strict=True)
    ]
    if line.stroke == "points":
        path = "".join(f"M{p[0]:.1f} {p[1]:.1f}h0" for p in points if p)
        yield f'<path d="{path}" class="dots" stroke="var(--{line.colour})"/>'
        return
    steps: list[str] = []
    pen = "M"
    for p in points:
        if p is None:
            pen = "M"
            continue
        steps.append(f"{pen}{p[0]:.1f} {p[1]:.1f}")
        pen = "L"
    yield f'<path d="{"".join(steps)}" class="line" stroke="var(--{line.colour})"{_DASHES[line.stroke]}/>'


def _mark(mark: Mark, f: _Frame) -> Iterator[str]:
    y = f.py(mark.row)
    if mark.widest is not None and all(map(drawable, mark.widest)):
        low, high = (f.px(v) for v in mark.widest)
        yield (
            f'<line stroke="var(--{mark.colour})" stroke-width="1" x1="{low:.1f}" x2="{high:.1f}" '
            f'y1="{y:.1f}" y2="{y:.1f}"/>'
        )
    words = f"{mark.value:.4g}"
    if drawable(mark.lower) and drawable(mark.upper):
        yield _interval(mark, f.px(mark.lower), f.px(mark.upper), y)
        words += f" [{mark.lower:.4g}, {mark.upper:.4g}]"
    radius = 0.5 * _RADIUS if mark.small else _RADIUS
    yield _dot(mark.colour, f.px(mark.value), y, SHAPES[mark.colour], radius, words)


def _interval(mark: Mark, low: float, high: float, y: float) -> str:
    return (
        f'<line stroke="var(--{mark.colour})" stroke-width="3" x1="{low:.1f}" x2="{high:.1f}" y1="{y:.1f}" '
        f'y2="{y:.1f}"/>'
    )


def _dot(colour: Colour, x: float, y: float, shape: Shape, radius: float = _RADIUS, title: str = "") -> str:
    words = f"<title>{title}</title>" if title else ""
    corners = " ".join(f"{x + radius * a:.1f},{y + radius * b:.1f}" for a, b in _CORNERS[shape])
    if corners:
        return f'<polygon class="dot" points="{corners}" fill="var(--{colour})">{words}</polygon>'
    return f'<circle class="dot" cx="{x:.1f}" cy="{y:.1f}" r="{radius:g}" fill="var(--{colour})">{words}</circle>'


def _words(panel: Panel, f: _Frame) -> Iterator[str]:
    middle = f.left + 0.5 * f.width
    if panel.title:
        yield f'<text class="title" x="{middle:.1f}" y="13" text-anchor="middle">{escaped(panel.title)}</text>'
    if panel.x_label:
        y = f.top + f.height + 29.0
        yield f'<text x="{middle:.1f}" y="{y:.1f}" text-anchor="middle">{escaped(panel.x_label)}</text>'
    if panel.y_label and not panel.rows:
        y = f.top + 0.5 * f.height
        yield (
            f'<text transform="translate(12 {y:.1f}) rotate(-90)" text-anchor="middle">'
            f"{escaped(panel.y_label)}</text>"
        )
    if panel.words:
        y = f.top + 0.5 * f.height
        yield f'<text class="quiet" x="{middle:.1f}" y="{y:.1f}" text-anchor="middle">{escaped(panel.words)}</text>'


__all__ = ["as_html"]
