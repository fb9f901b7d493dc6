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
    force: Force = False,
    json_: Json = False,
    quiet: Quiet = False,
) -> None:
    """Check the channels of logs against each other: biases, scales, arms, lags, delays."""
    import json

    with loading("check", quiet):
        require_names(log, aircraft)
        from airtruth import aircraft as planes
        from airtruth.checks.kinematics import check_logs
        from airtruth.logs.sources import named_logs

    declared = planes.load(aircraft) if aircraft else None
    named = list(named_logs(log, run_ids=run))
    groups = [[one] for one in named] if each else [named]
    answers = []
    with progress_bar("check", "files" if each else "checks", quiet) as advance:
        for number, group in enumerate(groups, start=1):
            answers.append(([name for name, _ in group], check_logs(group, declared, force=force)))
            advance(number, len(groups), 0)
    if json_:
        documents = [{"file": files[0], "files": files, **result.to_dict()} for files, result in answers]
        print_result(json.dumps(documents[0] if len(documents) == 1 else documents, indent=1))
        return
    for _, result in answers:
        for sentence in result.forced:
            notice(sentence)
        print_result(result.summary())
