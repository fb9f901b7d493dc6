"""The one table of the package and its writers: text, Markdown, HTML, LaTeX, CSV, JSON and pandas."""

from airtruth.table.data import as_csv, as_json, from_frame, to_frame
from airtruth.table.html import as_html, escaped
from airtruth.table.latex import as_latex
from airtruth.table.model import (
    MISSING,
    Cell,
    Group,
    Interval,
    Number,
    Pair,
    Row,
    Table,
    Uncertain,
    fixed,
    flat,
    significant,
)
from airtruth.table.text import WIDTH, as_markdown, as_text
from airtruth.table.write import write_table

__all__ = [
    "MISSING",
    "WIDTH",
    "Cell",
    "Group",
    "Interval",
    "Number",
    "Pair",
    "Row",
    "Table",
    "Uncertain",
    "as_csv",
    "as_html",
    "as_json",
    "as_latex",
    "as_markdown",
    "as_text",
    "escaped",
    "fixed",
    "flat",
    "from_frame",
    "significant",
    "to_frame",
    "write_table",
]
