"""`airtruth export`: the identified motion as a state-space model for MATLAB, Simulink and python-control."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from airtruth.cli.application import app
from airtruth.cli.arguments import Json, Quiet, Replace
from airtruth.cli.completion import complete_method
from airtruth.cli.output import print_result
from airtruth.cli.progress import working


@app.command(epilog="Example: airtruth export out/light --method iv-f1 --out out/short_period.mat")
def export(
    source: Annotated[
        str,
        typer.Argument(
            metavar="ESTIMATES|A",
            help="File of estimates or its folder; or an aircraft: a folder with aircraft.toml, or a shipped name.",
        ),
    ],
    out: Annotated[Path, typer.Option(help="File to write: .mat (MATLAB), .json, or .py (python-control).")],
    method: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Method of the estimates.", autocompletion=complete_method),
    ] = None,
    run: Annotated[
        str | None,
        typer.Option(metavar="RUN_ID", help="Run of the estimates; default: the mean of the converged runs."),
    ] = None,
    airspeed_m_s: Annotated[
        float | None, typer.Option("--airspeed-m-s", metavar="V", help="True airspeed, for an aircraft.")
    ] = None,
    altitude_m: Annotated[
        float | None, typer.Option("--altitude-m", metavar="H", help="Altitude, for an aircraft.")
    ] = None,
    json_: Json = False,
    force: Replace = False,
    quiet: Quiet = False,
) -> None:
    """Write A, B, C and D of the identified motion with names, units, operating point and covariance."""
    import json

    from airtruth.exporting.write import require_suffix

    require_suffix(out)
    with working("export", quiet):
        from airtruth.api import export as write_export

        model = write_export(
            source,
            out,
            method=method,
            run_id=run,
            airspeed_m_s=airspeed_m_s,
            altitude_m=altitude_m,
            force=force,
        )
    print_result(json.dumps(model.to_dict(), indent=1) if json_ else f"{model.summary()}\n{out}")
