"""Charts as data, and their writers: SVG for pages, Matplotlib for papers."""

from airtruth.charts.figure import as_figure
from airtruth.charts.model import (
    Area,
    Band,
    Bar,
    Cells,
    Chart,
    Colour,
    Line,
    Mark,
    Panel,
    Rule,
    Stroke,
    colours_of,
)
from airtruth.charts.svg import as_html

__all__ = [
    "Area",
    "Band",
    "Bar",
    "Cells",
    "Chart",
    "Colour",
    "Line",
    "Mark",
    "Panel",
    "Rule",
    "Stroke",
    "as_figure",
    "as_html",
    "colours_of",
]
