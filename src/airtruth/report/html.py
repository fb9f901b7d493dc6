"""One self-contained page of a trace, a campaign or a file of estimates, with its tables as CSV and LaTeX beside."""

from __future__ import annotations

import base64
import html
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from airtruth.errors import StoreError
from airtruth.logs.atomic import make_folder, write_text
from airtruth.report import layout, render, tables
from airtruth.report.campaign import ESTIMATES, TRUTH, Campaign, read_campaign
from airtruth.report.layout import Grid
from airtruth.report.trace_table import error_csv, error_grid, figures
from airtruth.report.trace_text import (
    derivative_lines,
    detectable,
    effect_details,
    effect_line,
    key,
    verdict,
    why_not,
)
from airtruth.report.trace_tolerances import tolerance_grid

ANSWER: Final = "trace.json"
PICTURES: Final = {
    "trace.png": "Residual of the free run before, the effect, residual after",
    "scores.png": "How significant each candidate is alone, and what Holm's rule asks of it",
    "innovations.png": "Whitened innovations and their autocorrelation",
}
_STYLE: Final = """
body { font: 15px/1.5 system-ui, sans-serif; color: #222; max-width: 72em; margin: 2em auto; padding: 0 1em; }
h1 { font-size: 1.5em; } h2 { font-size: 1.15em; margin-top: 2em; border-bottom: 1px solid #ddd; }
table { border-collapse: collapse; font-size: .92em; font-variant-numeric: tabular-nums; margin: .6em 0; }
th, td { padding: .15em .8em; text-align: right; } th:first-child, td:first-child { text-align: left; }
thead th { border-bottom: 1px solid #555; } tr.group td { font-weight: 600; border-top: 1px solid #ccc; }
td.words { text-align: left; } pre { background: #f6f6f6; padding: .8em; overflow-x: auto; }
img { max-width: 100%; } .verdict { font-size: 1.2em; padding: .6em .9em; background: #eef5fb; border-left: 4px solid #0072b2; }
.note { color: #555; font-size: .9em; } figcaption { color: #555; font-size: .9em; }
@media print { body { max-width: none; } h2 { break-after: avoid; } figure { break-inside: avoid; } }
"""


@dataclass(frozen=True)
class Report:
    """A page and the same tables in other formats."""

    page: str
    csv: str
    latex: str


def write_report(folder: Path, out: Path) -> tuple[Path, ...]:
    """Write one HTML page about a folder, its tables as CSV and LaTeX beside it under the same name.

    Parameters
    ----------
    folder : what `airtruth trace`, or `airtruth fly` and `airtruth identify`, wrote; or a file of estimates.
    out : the page; its suffix is replaced by .csv and .tex for the tables.

    Returns
    -------
    The files, the page first.

    Raises
    ------
    StoreError, LogError
        If there is nothing to report, or a file cannot be read or written.
    """
    if out.suffix.lower() not in (".html", ".htm"):
        raise StoreError(f"--out {out}: the report is a page; name it {out.with_suffix('.html').name}")
    report = _report(folder)
    make_folder(out.parent)
    paths = (out, out.with_suffix(".csv"), out.with_suffix(".tex"))
    for path, content in zip(paths, (report.page, report.csv, report.latex), strict=True):
        write_text(path, content)
    return paths


def _report(folder: Path) -> Report:
    if (folder / ANSWER).is_file():
        return trace_report(_answer(folder / ANSWER), folder)
    if (folder / TRUTH).is_file():
        return campaign_report(read_campaign(folder))
    estimates = folder if folder.is_file() else folder / ESTIMATES
    if estimates.is_file():
        return _estimates_report(estimates)
    raise StoreError(
        f"{folder}: nothing to report; expected {ANSWER} (`airtruth trace ... --out {folder}`) or {ESTIMATES} "
        f"(`airtruth identify {folder} --aircraft A`)"
    )


def _answer(path: Path) -> dict[str, Any]:
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
        raise StoreError(f"{path}: cannot be read ({error}); `airtruth trace` writes it anew") from None
    if not isinstance(found, dict) or "verdict" not in found:
        raise StoreError(f"{path}: is not the answer of a trace; `airtruth trace` writes it anew")
    return found


def trace_report(answer: Mapping[str, Any], folder: Path | None = None) -> Report:
    """The page of a trace.

    Parameters
    ----------
    answer : what trace.json holds.
    folder : where its pictures are; those that are there are put into the page.
    """
    grid, tolerances = error_grid(answer), tolerance_grid(answer)
    body = [f'<p class="verdict">{html.escape(verdict(answer))}</p>']
    for effect in answer["effects"]:
        told = " ".join(line.strip() + "." for line in effect_details(effect))
        body.append(f"<p><strong>{html.escape(effect_line(effect))}</strong><br>{html.escape(told)}</p>")
    body += _pictures(folder, ["trace.png"])
    body += ["<h2>Error before and after</h2>", grid_html(grid)]
    latex = render.latex(grid, "trace-error")
    if tolerances is not None:
        body += [f"<h2>{html.escape(tolerances.title)}</h2>", grid_html(tolerances)]
        latex += "\n" + render.latex(tolerances, "trace-tolerances")
    body += ["<h2>Derivatives</h2>", _pre(derivative_lines(answer))]
    body += ["<h2>Candidates</h2>", *_pictures(folder, ["scores.png"]), _candidates(answer)]
    body += ["<h2>What is left</h2>", *_pictures(folder, ["innovations.png"])]
    body.append(f"<p>Next flight: {html.escape(answer['next_flight'])}</p>")
    body += ["<h2>Smallest traceable sizes</h2>", f"<p>{html.escape('; '.join(detectable(answer)))}.</p>"]
    if answer.get("updated_aircraft"):
        body.append(f"<p>Updated aircraft: <code>{html.escape(answer['updated_aircraft'])}</code></p>")
    records = answer["records"]
    said = [
        f"Fitted: {', '.join(records['fitted'])}; held out: {', '.join(records['held_out']) or 'none'}.",
        *(f"{note}." for note in answer.get("notes", ())),
    ]
    body += [f'<p class="note">{html.escape(line)}</p>' for line in said]
    return Report(_page("Trace", body), error_csv(answer), latex)


def campaign_report(campaign: Campaign) -> Report:
    """The page of an identified campaign: every table that shows it."""
    found = [
        tables.evaluate(spec, campaign)
        for spec in tables.TABLES.values()
        if tables.shows(spec, campaign) and not campaign.estimates.keys().isdisjoint(spec.columns)
    ]
    shown = {method for table in found for method in table.methods}
    if not campaign.estimates.keys() <= shown:
        found.append(tables.evaluate(tables.all_methods(campaign), campaign))
    grids = [layout.lay_out(table) for table in found]
    latex = "\n".join(render.latex(grid, table.name) for grid, table in zip(grids, found, strict=True))
    texts = [render.csv_text(table) for table in found]
    rows = texts[:1] + [text.partition("\n")[2] for text in texts[1:]]
    body = [part for grid in grids for part in (f"<h2>{html.escape(grid.title)}</h2>", grid_html(grid))]
    return Report(_page(campaign.title, body), "".join(rows), latex)


def _estimates_report(path: Path) -> Report:
    import pandas as pd

    from airtruth.identify import overview
    from airtruth.identify.summary import as_csv, as_html

    try:
        table = overview(pd.read_parquet(path))
    except (OSError, ValueError, KeyError) as error:
        raise StoreError(
            f"{path}: is not a file of estimates ({error}); `airtruth identify` writes it"
        ) from None
    grid = Grid(table.title, table.columns, (layout.Group("", _words(table.rows)),), table.notes)
    return Report(_page(path.stem, [as_html(table)]), as_csv(table), render.latex(grid, "estimates"))


def _words(rows: Iterable[Sequence[object]]) -> tuple[tuple[str, ...], ...]:
    return tuple(tuple(figures(c, 4) if isinstance(c, float) else str(c) for c in row) for row in rows)


def grid_html(grid: Grid) -> str:
    """A table in words as HTML."""
    head = "".join(f"<th>{html.escape(name)}</th>" for name in grid.header)
    lines = [f"<table><thead><tr>{head}</tr></thead><tbody>"]
    for group in grid.groups:
        if group.heading:
            lines.append(
                f'<tr class="group"><td colspan="{len(grid.header)}">{html.escape(group.heading)}</td></tr>'
            )
        for row in group.rows:
            lines.append("<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>")
    lines.append("</tbody></table>")
    lines += [f'<p class="note">{html.escape(note)}</p>' for note in grid.notes]
    return "\n".join(lines)


def _candidates(answer: Mapping[str, Any]) -> str:
    lines = [
        "<table><thead><tr><th>effect</th><th>score</th><th>p (Holm)</th><th>outcome</th></tr></thead><tbody>"
    ]
    for c in answer["candidates"]:
        cells = (figures(c["score"]), figures(c["p_value"], 2)) if c["testable"] else ("-", "-")
        numbers = "".join(f"<td>{cell}</td>" for cell in cells)
        why = html.escape(why_not(c, answer))
        lines.append(f'<tr><td>{html.escape(key(c))}</td>{numbers}<td class="words">{why}</td></tr>')
    return "\n".join([*lines, "</tbody></table>"])


def _pictures(folder: Path | None, names: Iterable[str]) -> list[str]:
    found = []
    for name in names:
        if folder is None or not (folder / name).is_file():
            continue
        data = base64.b64encode((folder / name).read_bytes()).decode("ascii")
        caption = html.escape(PICTURES[name])
        found.append(
            f'<figure><img alt="{caption}" src="data:image/png;base64,{data}"><figcaption>{caption}</figcaption></figure>'
        )
    return found


def _pre(lines: Iterable[str]) -> str:
    return f"<pre>{html.escape(chr(10).join(lines))}</pre>"


def _page(title: str, body: Iterable[str]) -> str:
    name = html.escape(title)
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{name}</title>'
        f"<style>{_STYLE}</style></head><body>\n<h1>{name}</h1>\n" + "\n".join(body) + "\n</body></html>\n"
    )


__all__ = ["Report", "campaign_report", "grid_html", "trace_report", "write_report"]
