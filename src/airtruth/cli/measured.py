"""`airtruth check`: whether the channels of a log agree."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from airtruth.cli.application import app
from airtruth.cli.arguments import Force, Json, Quiet
from airtruth.cli.early import require_names
from airtruth.cli.output import notice, print_result
from airtruth.cli.progress import loading, progress_bar


@app.command(epilog="Example: airtruth check data/undeclared/a.parquet --aircraft gtm")
def check(
    log: Annotated[list[Path], typer.Argument(metavar="LOG...", help="Flight logs, or folders of logs.")],
    aircraft: Annotated[
        str | None, typer.Option(metavar="A", help="Aircraft whose declared sensors are taken as known.")
    ] = None,
    run: Annotated[
        list[str] | None,
        typer.Option(metavar="RUN_ID", help="Run to check, may be repeated; without it, all."),
    ] = None,
    each: Annotated[
        bool, typer.Option("--each", help="One check for each file instead of one for all.")
    ] = False,
    motion: Annotated[
        str | None,
        typer.Option(
            metavar="longitudinal|lateral", help="Motion to check; without it, each that the logs support."
        ),
    ] = None,
    force: Force = False,
    json_: Json = False,
    quiet: Quiet = False,
) -> None:
    """Check the channels of logs against each other: biases, scales, arms, lags, delays."""
    import json

    with loading("check", quiet):
        require_names(log, aircraft)
        from airtruth import aircraft as planes
        from airtruth.checks.motions import check_motions
        from airtruth.logs.sources import named_logs
        from airtruth.physics.motion import MOTIONS

    declared = planes.load(aircraft) if aircraft else None
    named = list(named_logs(log, run_ids=run))
    groups = [[one] for one in named] if each else [named]
    answers = []
    with progress_bar("check", "files" if each else "checks", quiet) as advance:
        for number, group in enumerate(groups, start=1):
            results = check_motions(group, declared, motion=motion, force=force)
            answers.append(([name for name, _ in group], results))
            advance(number, len(groups), 0)
    if json_:
        documents = []
        for files, results in answers:
            own = {name: {"file": files[0], "files": files, **one.to_dict()} for name, one in results.items()}
            documents.append(own if len(own) > 1 else next(iter(own.values())))
        print_result(json.dumps(documents[0] if len(documents) == 1 else documents, indent=1))
        return
    for _, results in answers:
        for sentence in next(iter(results.values())).forced:
            notice(sentence)
        for name, result in results.items():
            heading = f"{MOTIONS[name].heading}\n\n" if len(results) > 1 else ""
            print_result(heading + result.summary())
