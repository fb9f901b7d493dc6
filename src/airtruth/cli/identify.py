"""`airtruth identify` and `airtruth tables`: derivatives from logs, and the paper's tables of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated

import typer

from airtruth.cli.application import app
from airtruth.cli.arguments import (
    Condition,
    Covariance,
    Declared,
    Methods,
    OfMotion,
    OnCluster,
    Pressure,
    Quiet,
    Replace,
    Terms,
    Trim,
)
from airtruth.cli.compilation import compile_identification
from airtruth.cli.early import require_file, require_names
from airtruth.cli.output import notice, print_result
from airtruth.cli.progress import announced_compilation, loading, progress_bar, working

if TYPE_CHECKING:
    from airtruth.identification import Answer, IdentificationResult, SpooledResult


@app.command(epilog="Example: airtruth identify out/light --aircraft gtm --method iv-f1 --method ls")
def identify(
    context: typer.Context,
    logs: Annotated[
        list[Path],
        typer.Argument(metavar="DIR|LOG...", help="Campaign folders or flight logs, or URLs of these."),
    ],
    aircraft: Declared,
    method: Methods = None,
    motion: OfMotion = None,
    joint: Annotated[bool, typer.Option("--joint", help="One estimate for all runs together.")] = False,
    out: Annotated[
        Path | None,
        typer.Option(
            help="File of the estimates, FILE.parquet. Default: DIR/estimates.parquet for one DIR, none for logs. Of two "
            "motions the lateral one is written beside it, with -lateral in the name."
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
    term: Terms = None,
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
    """Estimate the derivatives of every run (default: iv-f1, of the lateral motion iv-lowpass)."""
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
        terms=tuple(term or ()),
    )
    logs = [location(log) for log in logs]
    declared = load(aircraft)
    asked, left_out = identification.answers(logs, declared, method, motion)
    targets = _targets(logs, None if out is None else location(out), asked)
    with ExitStack() as kept:
        results = []
        with writing("identify", [*log_files(logs), *aircraft_files(declared)], force=force) as outputs:
            for one, to in zip(asked, targets, strict=True):
                if to is not None:
                    outputs.require(to)
                    settings = identification.settings_of(declared, options, joint, one.motion)
                    names = [m if isinstance(m, str) else m.name for m in one.methods]
                    identification.require_mergeable(to, names, settings, force=force)
            for one, to in zip(asked, targets, strict=True):
                with (
                    workers(cluster) as on,
                    announced_compilation("identify", quiet),
                    progress_bar("identify", "estimates", quiet) as advance,
                ):
                    result = kept.enter_context(
                        identification.identified(
                            logs,
                            declared,
                            one.methods,
                            options,
                            joint=joint,
                            force=force,
                            advance=advance,
                            cluster=on,
                            folder=None if to is None or isinstance(to, RemotePath) else to.parent,
                            motion=one.motion,
                            excited=one.excited,
                        )
                    )
                results.append(result)
                if to is not None:
                    identification.write_estimates(to, result, force=force)
            if targets[0] is None and not quiet and any(log.is_dir() for log in logs):
                notice("the estimates are printed and not written; --out FILE.parquet writes them")
        for sentence in left_out if not quiet else ():
            notice(sentence)
        for result in results:
            for sentence in (*result.forced, *result.notes) if json_ and not quiet else ():
                notice(sentence)
        for piece in _json(results) if json_ else _text(results):
            print_result(piece, end="")


def _targets(logs: list[Path], out: Path | None, asked: Sequence[Answer]) -> list[Path | None]:
    """Files of the estimates of each motion; none where they are printed alone."""
    from airtruth.identification import FILES, beside

    if out is not None:
        return [out if len(asked) == 1 else beside(out, one.motion) for one in asked]
    if len(logs) == 1 and (logs[0] / "logs").is_dir():
        return [logs[0] / FILES[one.motion.name] for one in asked]
    return [None] * len(asked)


def _json(results: Sequence[IdentificationResult | SpooledResult]) -> Iterator[str]:
    """The rows of a motion, or an object with the rows of each motion under its name."""
    from airtruth.identification import json_of

    if len(results) == 1:
        yield from json_of(results[0].frames())
        return
    before = "{\n"
    for result in results:
        yield f'{before}"{result.settings.motion.name}":\n'
        yield from json_of(result.frames())
        before = ",\n"
    yield "}\n"


def _text(results: Sequence[IdentificationResult | SpooledResult]) -> Iterator[str]:
    """The summaries, each under the heading of its motion where there are several."""
    for number, result in enumerate(results):
        heading = f"{result.settings.motion.heading}\n" if len(results) > 1 else ""
        yield ("\n" if number else "") + heading + result.summary() + "\n"


@app.command(epilog="Example: airtruth tables out/light out/moderate --out out/tables")
def tables(
    folders: Annotated[list[Path], typer.Argument(metavar="DIR...", help="Identified campaign folders.")],
    out: Annotated[Path, typer.Option(help="Folder of the tables (.md, .csv, .tex).")],
    force: Replace = False,
    quiet: Quiet = False,
) -> None:
    """Write the paper's tables from identified campaigns, beside the published figures, and a table of lateral estimates."""
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
