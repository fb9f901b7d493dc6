"""A report: one self-contained HTML page, its charts for papers, and its tables as CSV and LaTeX."""

from __future__ import annotations

import html
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Final

from airtruth.charts import Chart, as_figure
from airtruth.charts import as_html as chart_html
from airtruth.errors import StoreError, choices
from airtruth.logs.atomic import make_folder, write_text
from airtruth.physics.motion import MOTIONS
from airtruth.reporting.pages.assets import own, uplot
from airtruth.table import Table, as_csv, escaped
from airtruth.table import as_html as table_html

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAGE: Final = "html"
"""Format of the page."""
FORMATS: Final = (PAGE, "png", "svg", "pdf")
"""Formats of a report: the page, or its charts for papers."""
_SUFFIXES: Final = {".htm": PAGE, **{f".{name}": name for name in FORMATS}}
"""Suffix of a file -> format."""


@dataclass(frozen=True)
class Section:
    """A part of a page: heading, anchor and HTML."""

    heading: str
    anchor: str
    body: str


@dataclass(frozen=True)
class Report:
    """A report in every format.

    Attributes
    ----------
    page : HTML page, which needs no other file.
    csv, latex : its tables.
    charts : its charts.
    figures : name -> figure of a result that draws itself.
    beside : name of a motion that the same result answers -> its report, a page beside this one.
    """

    page: str
    csv: str
    latex: str
    charts: tuple[Chart, ...] = ()
    figures: Mapping[str, Figure] = field(default_factory=dict)
    beside: Mapping[str, Report] = field(default_factory=dict)

    @property
    def drawn(self) -> list[str]:
        """Names of the figures for papers."""
        return [*(chart.name for chart in self.charts), *self.figures]


_LANGUAGE: Final = (
    "try { new Intl.NumberFormat(navigator.language); } "
    "catch { Object.defineProperty(navigator, 'language', { value: 'en' }); }"
)
"""Script before uPlot, which formats numbers in the browser's language and draws nothing where that has no valid tag."""


def page_of(title: str, answer: str, picture: Chart | None, sections: Iterable[Section]) -> str:
    """Return an HTML page: the answer, one picture, and the sections with links to them.

    Parameters
    ----------
    title : plain text.
    answer : HTML of the answer.
    picture : chart beside the answer.
    sections : the rest; a section without a body is left out.
    """
    name = html.escape(title)
    shown = [section for section in sections if section.body]
    links = "".join(f'<a href="#{s.anchor}">{html.escape(s.heading)}</a>' for s in shown)
    parts = [f'<section id="{s.anchor}"><h2>{html.escape(s.heading)}</h2>\n{s.body}</section>' for s in shown]
    drawn = "" if picture is None else chart_html(picture)
    licence = uplot("LICENSE").replace("*/", "")
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta name="viewport" content="width=device-width, initial-scale=1"><title>{name}</title>\n'
        f"<style>{uplot('uPlot.min.css')}\n{own('page.css')}</style></head><body>\n"
        f'<header><h1>{name}</h1><button type="button" id="theme" title="light or dark">theme</button></header>\n'
        f"{answer}\n{drawn}<nav>{links}</nav>\n" + "\n".join(parts) + "\n"
        "<noscript><p class='note'>Sorting, downloads and the plots of the records need JavaScript.</p></noscript>\n"
        f"<script>{_LANGUAGE}</script>\n<script>/* {licence} */\n{uplot('uPlot.iife.min.js')}</script>\n"
        f"<script>{own('page.js')}</script>\n"
        "</body></html>\n"
    )


def data_table(table: Table, name: str) -> str:
    """Return a table that downloads, and that sorts where a row does not belong to the row above it.

    Parameters
    ----------
    name : name of its CSV file, without suffix.
    """
    label, content = html.escape(name), as_json(as_csv(table))
    rows, _, notes = table_html(table).partition("</table>")
    script = f'<script type="application/json" class="csv" data-name="{label}">{content}</script>'
    kind = "tablebox sorts" if _sorts(table) else "tablebox"
    return f'<div class="{kind}"><div class="scroll">{rows}</table></div>{notes}{script}</div>\n'


def _sorts(table: Table) -> bool:
    """Whether rows may change places: their key columns tell them apart within each group."""
    keys = [[tuple(map(str, row[: table.keys])) for row in group.rows] for group in table.groups]
    return all(len(set(own)) == len(own) for own in keys)


def as_json(value: object) -> str:
    """Return JSON that can stand inside a script element."""
    return json.dumps(value, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")


def answer_html(sentence: str, *further: str) -> str:
    """Return the answer of a page, and further sentences below it, from plain text."""
    paragraphs = [f'<p class="verdict">{escaped(sentence)}</p>']
    return "\n".join([*paragraphs, *(f"<p>{escaped(words)}</p>" for words in further)])


def notes_html(sentences: Iterable[str]) -> str:
    """Return sentences as paragraphs of the class "note"."""
    return "\n".join(f'<p class="note">{escaped(sentence)}</p>' for sentence in sentences)


def preformatted(lines: Iterable[str]) -> str:
    """Return lines of plain text as an HTML block that keeps their alignment."""
    return f"<pre>{escaped(chr(10).join(lines))}</pre>"


def format_of(out: Path, wanted: str | None) -> str:
    """Return the format of a report: as wanted, or as the suffix of its file states.

    Raises
    ------
    StoreError
        If there is no such format, or the suffix states another.
    """
    stated = _SUFFIXES.get(out.suffix.lower())
    if wanted is not None and wanted not in FORMATS:
        raise StoreError(f"--format {wanted!r}: {choices(wanted, FORMATS)}")
    if stated is None or wanted not in (None, stated):
        suffix = wanted or PAGE
        kind = "an HTML page" if suffix == PAGE else f"a figure in the format {suffix}"
        raise StoreError(f"--out {out}: the report is {kind}; name it {out.stem or 'report'}.{suffix}")
    return stated


def files_of(report: Report, out: Path, kind: str) -> tuple[Path, ...]:
    """Return the files of a report in a format.

    The page has its tables beside it with the suffixes .csv and .tex; a chart is the file STEM-NAME.

    Raises
    ------
    StoreError
        If a figure is asked for and the report has none.
    """
    more = [path for name, own in report.beside.items() for path in files_of(own, beside(out, name), kind)]
    if kind == PAGE:
        return (out, out.with_suffix(".csv"), out.with_suffix(".tex"), *more)
    if not report.drawn:
        raise StoreError(f"--out {out}: this report has no figure; name a page, {out.stem}.html")
    return (*(out.with_name(f"{out.stem}-{name}{out.suffix}") for name in report.drawn), *more)


def beside(out: Path, motion: str) -> Path:
    """File of the report of another motion: STEM-MOTION."""
    return out.with_stem(f"{out.stem}-{motion}")


def write_files(report: Report, out: Path, kind: str) -> tuple[Path, ...]:
    """Write the files of `files_of`.

    Raises
    ------
    StoreError
        If a file cannot be written.
    """
    make_folder(out.parent)
    alone = replace(report, beside={})
    paths = files_of(alone, out, kind)
    if kind == PAGE:
        page = linked(report.page, {name: beside(out, name).name for name in report.beside})
        for path, content in zip(paths, (page, report.csv, report.latex), strict=True):
            write_text(path, content)
    else:
        from airtruth import style

        figures = [*map(as_figure, report.charts), *report.figures.values()]
        for path, figure in zip(paths, figures, strict=True):
            style.save(figure, path)
    more = [path for name, own in report.beside.items() for path in write_files(own, beside(out, name), kind)]
    return (*paths, *more)


def linked(page: str, files: Mapping[str, str]) -> str:
    """A page with links to those of other motions above its navigation."""
    links = "".join(
        f'<p class="note">{html.escape(MOTIONS[name].heading)}: <a href="{html.escape(file)}">{html.escape(file)}</a></p>\n'
        for name, file in files.items()
    )
    return page.replace("<nav>", f"{links}<nav>", 1)


__all__ = [
    "FORMATS",
    "PAGE",
    "Report",
    "Section",
    "answer_html",
    "as_json",
    "data_table",
    "files_of",
    "format_of",
    "linked",
    "notes_html",
    "page_of",
    "preformatted",
    "write_files",
]
