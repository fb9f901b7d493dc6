"""`airtruth identify` and `airtruth tables`: derivatives from logs, and the paper's tables of them."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from shlex import quote
from typing import Annotated

import typer

from airtruth.cli.application import app
from airtruth.cli.arguments import (
    Condition,
    Covariance,
    Declared,
    Methods,
    OnCluster,
    Pressure,
    Quiet,
    Replace,
    Trim,
)
from airtruth.cli.compilation import compile_identification
from airtruth.cli.early import require_file, require_names
from airtruth.cli.output import notice, print_result
from airtruth.cli.progress import announced_compilation, loading, progress_bar, working


@app.command(epilog="Example: airtruth identify out/light --aircraft gtm --method iv-f1 --method ls")
def identify(
    context: typer.Context,
    logs: Annotated[
        list[Path],
        typer.Argument(metavar="DIR|LOG...", help="Campaign folders or flight logs, or URLs of these."),
    ],
    aircraft: Declared,
    method: Methods = None,
    joint: Annotated[bool, typer.Option("--joint", help="One estimate for all runs together.")] = False,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Parquet file of the estimates. Default: DIR/estimates.parquet for one DIR, none for logs."
        ),
    ] = None,
    trim: Annotated[
        Trim,
        typer.Option(help="intercept: estimate one constant per record; mean: mean of the trim window."),
    ] = "intercept",
    trim_window_s: Annotated[
        float, typer.Option(help="Window before the manoeuvre [s], for --trim mean.")
    ] = 1.0,
    condition: Annotated[
        Condition, typer.Option(help="How a record's airspeed and density are averaged, see docs/methods.md.")
    ] = "motion",
    airspeed_m_s: Annotated[
        float | None, typer.Option(help="True airspeed to use instead of the measured one [m/s].")
    ] = None,
    pressure: Annotated[
        Pressure,
        typer.Option(
            help="Dynamic pressure: constant over a record, measured at each sample, or the default of the method."
        ),
    ] = "method",
    covariance: Annotated[
        Covariance, typer.Option(help="Formula of the covariance, see docs/methods.md.")
    ] = "corrected",
    tolerance: Annotated[
        float, typer.Option(help="Relative change at which an estimator has converged.")
    ] = 0.01,
    force: Annotated[
        bool,
        typer.Option(
            "--force",
            help="Continue although a log contradicts physics; replace estimates with other options, or another file.",
        ),
    ] = False,
    cluster: OnCluster = None,
    json_: Annotated[bool, typer.Option("--json", help="Print the rows as JSON.")] = False,
    quiet: Quiet = False,
) -> None:
    """Estimate the six short-period derivatives of every run (default: iv-f1)."""
    methods = method or ["iv-f1"]
    with loading("identify", quiet):
        require_names(logs, aircraft, methods)
        compile_identification(context, methods, cluster)
        from airtruth import identification
        from airtruth.aircraft import load
        from airtruth.api.writing import aircraft_files
        from airtruth.cluster import workers
        from airtruth.logs.outputs import writing
        from airtruth.logs.remote import RemotePath, location
        from airtruth.logs.sources import log_files

    options = identification.Options(
        trim=trim,
        trim_window_s=trim_window_s,
        condition=condition,
        airspeed_m_s=airspeed_m_s,
        pressure=pressure,
        covariance=covariance,
        tolerance=tolerance,
    )
    logs = [location(log) for log in logs]
    out = None if out is None else location(out)
    if out is None and len(logs) == 1 and (logs[0] / "logs").is_dir():
        out = logs[0] / "estimates.parquet"
    declared = load(aircraft)
    with ExitStack() as kept:
        with writing("identify", [*log_files(logs), *aircraft_files(declared)], force=force) as outputs:
            if out is not None:
                outputs.require(out)
                settings = identification.settings_of(declared, options, joint)
                identification.require_mergeable(out, methods, settings, force=force)
            with (
                workers(cluster) as on,
                announced_compilation("identify", quiet),
                progress_bar("identify", "estimates", quiet) as advance,
            ):
                result = kept.enter_context(
                    identification.identified(
                        logs,
                        declared,
                        methods,
                        options,
                        joint=joint,
                        force=force,
                        advance=advance,
                        cluster=on,
                        folder=None if out is None or isinstance(out, RemotePath) else out.parent,
                    )
                )
            if out is not None:
                identification.write_estimates(out, result, force=force)
            elif not quiet and any(log.is_dir() for log in logs):
                notice("the estimates are printed and not written; --out FILE.parquet writes them")
        for sentence in (*result.forced, *result.notes) if json_ and not quiet else ():
            notice(sentence)
        for piece in identification.json_of(result.frames()) if json_ else (result.summary() + "\n",):
            print_result(piece, end="")


@app.command(epilog="Example: airtruth tables out/light out/moderate --out out/tables")
def tables(
    folders: Annotated[list[Path], typer.Argument(metavar="DIR...", help="Identified campaign folders.")],
    out: Annotated[Path, typer.Option(help="Folder of the tables (.md, .csv, .tex).")],
    force: Replace = False,
    quiet: Quiet = False,
) -> None:
    """Write the paper's tables from identified campaigns, beside the published figures."""
    for folder in folders:
        require_file(
            folder, "campaign folder", f"`airtruth fly CAMPAIGN.toml --out {quote(str(folder))}` creates it"
        )
    from airtruth.logs.outputs import writing
    from airtruth.logs.remote import location
    from airtruth.reporting import write_tables

    with working("tables", quiet), writing("tables", force=force):
        text = write_tables([location(folder) for folder in folders], location(out)).text
    print_result(text)
