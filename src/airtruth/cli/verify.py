"""`airtruth verify`: the files of a folder against the digests that were recorded when they were written."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from airtruth.cli.application import app
from airtruth.cli.arguments import Json
from airtruth.cli.output import print_result
from airtruth.errors import FAILED_RUNS


@app.command(epilog="Example: airtruth verify out/light")
def verify(
    folder: Annotated[
        Path,
        typer.Argument(metavar="DIR", help="Folder into which a command wrote, or a parent of such folders."),
    ],
    json_: Json = False,
) -> None:
    """List each damaged, missing or extra file of a folder; exit code 1 if there is one."""
    import json

    from airtruth.logs.verify import verify

    result = verify(folder)
    print_result(json.dumps(result.to_dict(), indent=1) if json_ else result.summary())
    if not result.intact:
        raise typer.Exit(FAILED_RUNS)
