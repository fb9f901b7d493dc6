"""A page of one or more motions: what each of them shows, one after the other."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from airtruth.charts import Chart
from airtruth.charts import as_html as chart_html
from airtruth.physics.motion import MOTIONS
from airtruth.reporting.pages.page import Report, Section, page_of
from airtruth.table import Group, Row, Table, as_csv


@dataclass(frozen=True)
class Part:
    """One motion on a page.

    Attributes
    ----------
    answer : HTML of the answer.
    picture : chart beside the answer.
    sections : the rest.
    figures : its numbers, for CSV.
    latex : its tables.
    charts : its charts, ``picture`` among them.
    """

    answer: str
    picture: Chart
    sections: tuple[Section, ...]
    figures: Table
    latex: str
    charts: tuple[Chart, ...]


def report_of(title: str, parts: Mapping[str, Part]) -> Report:
    """Return a report; of several motions, each has its answer, chart and sections under its heading.

    Parameters
    ----------
    title : plain text.
    parts : name of a motion -> what is shown of it.
    """
    if len(parts) == 1:
        (one,) = parts.values()
        page = page_of(title, one.answer, one.picture, one.sections)
        return Report(page, as_csv(one.figures), one.latex, one.charts)
    answers, sections = [], []
    charts: list[Chart] = []
    for name, part in parts.items():
        heading = MOTIONS[name].heading
        own = tuple(replace(chart, name=f"{name}-{chart.name}") for chart in part.charts)
        answers.append(f"<h2>{html.escape(heading)}</h2>\n{part.answer}\n{chart_html(part.picture)}")
        sections += [
            Section(f"{heading}: {s.heading[0].lower()}{s.heading[1:]}", f"{name}-{s.anchor}", s.body)
            for s in part.sections
        ]
        charts += own
    figures = stacked(title, {MOTIONS[name].heading: part.figures for name, part in parts.items()})
    return Report(
        page=page_of(title, "\n".join(answers), None, sections),
        csv=as_csv(figures),
        latex="\n".join(part.latex for part in parts.values()),
        charts=tuple(charts),
    )


def stacked(title: str, tables: Mapping[str, Table]) -> Table:
    """Return tables as one: the columns of all, and the heading of each before those of its groups.

    Parameters
    ----------
    title : of the whole.
    tables : heading -> table.
    """
    columns = tuple(dict.fromkeys(name for table in tables.values() for name in table.columns))
    groups = [
        Group(
            f"{heading}: {group.heading}" if group.heading else heading,
            tuple(_spread(table.columns, row, columns) for row in group.rows),
        )
        for heading, table in tables.items()
        for group in table.groups
    ]
    return Table(title, columns, tuple(groups))


def _spread(own: Sequence[str], row: Row, columns: Sequence[str]) -> Row:
    """The cells of a row under the columns of all, empty where it has none."""
    cells = dict(zip(own, row, strict=True))
    return tuple(cells.get(name, "") for name in columns)


__all__ = ["Part", "report_of", "stacked"]
