"""`airtruth trace` and `airtruth loop`: the effect that a declared aircraft lacks, and the derivatives without it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from airtruth.cli.application import app
from airtruth.cli.arguments import (
    PROCESSORS,
    Candidates,
    Declared,
    ForceAndReplace,
    HeldOut,
    Increments,
    LogFiles,
    Methods,
    Model,
    Quiet,
    Threads,
    TimeBudget,
    TraceSeed,
)
from airtruth.cli.output import print_result
from airtruth.cli.progress import TRACE_STEPS, status

if TYPE_CHECKING:
    from airtruth.tracing import TraceOptions


@app.command(epilog="Example: airtruth trace data/undeclared/a.parquet --aircraft gtm --out out/trace")
def trace(
    logs: LogFiles,
    aircraft: Declared,
    out: Annotated[Path, typer.Option(help="Folder of trace.json, figures and the updated aircraft.")],
    model: Model = "aircraft",
    hold_out: HeldOut = None,
    jobs: Threads = PROCESSORS,
    seed: TraceSeed = 0,
    effect: Candidates = None,
    time_budget: TimeBudget = None,
    increments: Increments = None,
    force: ForceAndReplace = False,
    json_: Annotated[bool, typer.Option("--json", help="Print trace.json.")] = False,
    quiet: Quiet = False,
) -> None:
    """Name the effect that a declared aircraft lacks, add it, and report the error before and after."""
    from airtruth import tracing
    from airtruth.api.writing import trace_outputs

    options = _options(model, hold_out, jobs, seed, effect, time_budget, increments)
    with (
        trace_outputs("trace", logs, aircraft, out, force=force) as declared,
        status("trace", quiet, TRACE_STEPS) as advance,
    ):
        result = tracing.trace(logs, declared, options, out, force, advance)
    print_result(result.answer.to_json().rstrip() if json_ else result.summary())


@app.command(
    epilog="Example: airtruth loop out/twelve --aircraft gtm --out out/loop --method ls --method iv-f1"
)
def loop(
    logs: LogFiles,
    aircraft: Declared,
    out: Annotated[Path, typer.Option(help="Folder of the trace, the estimates, loop.json and the table.")],
    method: Methods = None,
    model: Model = "aircraft",
    hold_out: HeldOut = None,
    jobs: Threads = PROCESSORS,
    seed: TraceSeed = 0,
    effect: Candidates = None,
    time_budget: TimeBudget = None,
    increments: Increments = None,
    force: ForceAndReplace = False,
    json_: Annotated[bool, typer.Option("--json", help="Print loop.json.")] = False,
    quiet: Quiet = False,
) -> None:
    """Trace, remove the traced effects from the logs, and identify before and after (default: ls and iv-f1)."""
    import json

    from airtruth.api.writing import trace_outputs
    from airtruth.loop import METHODS, close_loop

    options = _options(model, hold_out, jobs, seed, effect, time_budget, increments)
    with (
        trace_outputs("loop", logs, aircraft, out, force=force) as declared,
        status("loop", quiet, TRACE_STEPS) as advance,
    ):
        result = close_loop(
            logs, declared, out, method or METHODS, trace_options=options, force=force, advance=advance
        )
    print_result(json.dumps(result.to_dict(), indent=1) if json_ else result.summary().rstrip())


def _options(
    model: str,
    hold_out: Sequence[str] | None,
    jobs: int,
    seed: int,
    effect: Sequence[str] | None,
    time_budget: float | None,
    increments: bool | None,
) -> TraceOptions:
    from airtruth.tracing import TraceOptions

    return TraceOptions(
        model=model,
        hold_out=None if hold_out is None else tuple(hold_out),
        threads=jobs,
        seed=seed,
        effects=None if effect is None else tuple(effect),
        time_budget_s=time_budget,
        increments=increments,
    )
