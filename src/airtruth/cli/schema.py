"""`airtruth schema`: JSON schemas of the TOML files, for editors."""

from __future__ import annotations

from typing import Annotated, Literal

import typer

from airtruth.cli.application import app
from airtruth.cli.output import print_result

Kind = Literal["campaign", "aircraft", "mapping"]
"""Choices of `airtruth schema`, those of `airtruth.schemas.FILES`."""


@app.command(epilog="Example: airtruth schema campaign > campaign.schema.json")
def schema(
    kind: Annotated[Kind, typer.Argument(help="Kind of TOML file.", show_default=False)],
) -> None:
    """Print the JSON schema of a kind of TOML file; editors complete and check files with it."""
    from airtruth.schemas import schema as generated

    print_result(generated(kind))
