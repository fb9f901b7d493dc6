"""The page of any result: its summary, its figure and its main table."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator, Sequence

from airtruth import style
from airtruth.reporting.pages.page import Report, Section, data_table, page_of, preformatted
from airtruth.result import Result
from airtruth.table import WIDTH, as_csv, as_latex, escaped, from_frame


def result_report(result: Result) -> Report:
    """Return the report of a result, titled with the name of its type."""
    title = " ".join(re.findall(r"[A-Z][a-z]*|[a-z]+", type(result).__name__)).capitalize()
    table = from_frame(result.to_frame(), title)
    first, *rest = result.summary().splitlines() or [""]
    figure = result.plot()
    picture = style.as_html(style.as_png(figure), title)
    text = preformatted(_wrapped(rest)) if rest else ""
    answer = f'<p class="verdict">{escaped(first)}</p>\n{picture}\n{text}'
    sections = [Section("Table", "table", data_table(table, "result"))]
    return Report(
        page=page_of(title, answer, None, sections),
        csv=as_csv(table),
        latex=as_latex(table, "result"),
        figures={"result": figure},
    )


def _wrapped(lines: Sequence[str]) -> Iterator[str]:
    """Lines of text without the rule under the first heading; long sentences are wrapped, rows of a table are not."""
    for number, line in enumerate(lines):
        if number == 0 and set(line) == {"="}:
            continue
        if len(line) > WIDTH and "  " not in line.strip():
            yield from textwrap.wrap(line, WIDTH)
        else:
            yield line
