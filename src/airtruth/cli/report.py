"""`airtruth report`: one HTML page of a result."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from airtruth.cli.application import app
from airtruth.cli.arguments import Quiet, Replace
from airtruth.cli.completion import complete_aircraft
from airtruth.cli.early import require_file, require_names
from airtruth.cli.output import print_result
from airtruth.cli.progress import working


@app.command(
    epilog="Example: airtruth report out/trace --out out/trace/report.html; for a paper: --out figure.pdf"
)
def report(
    folder: Annotated[
        Path,
        typer.Argument(
            metavar="DIR", help="Folder of a trace, a loop or an identified campaign; or a file of estimates."
        ),
    ],
    out: Annotated[
        Path,
        typer.Option(
            help="The page, .html, with its tables beside it as .csv and .tex; or the stem of the figures."
        ),
    ],
    kind: Annotated[
        Literal["html", "png", "svg", "pdf"] | None,
        typer.Option("--format", help="The page, or its figures for papers; default: the suffix of --out."),
    ] = None,
    log: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="LOG", help="Log of the estimates that is not in their folder; may be repeated."
        ),
    ] = None,
    aircraft: Annotated[
        str | None,
        typer.Option(
            metavar="A",
            help="Declared aircraft, which a page of estimates shows beside them: a folder, or a shipped name.",
            autocompletion=complete_aircraft,
        ),
    ] = None,
    force: Replace = False,
    quiet: Quiet = False,
) -> None:
    """Write one self-contained HTML page and its tables as CSV and LaTeX, or its figures for papers."""
    require_file(
        folder,
        "folder or file",
        "give the folder of a trace, a loop or an identified campaign, or a file of estimates",
    )
    require_names(aircraft=aircraft)
    from airtruth.api import report as write_report

    with working("report", quiet):
        files = write_report(folder, out, format=kind, logs=log or None, aircraft=aircraft, force=force)
    print_result("\n".join(str(path) for path in files))
