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
    MotionName,
    OnCluster,
    Quiet,
    Threads,
    TimeBudget,
    TracedMotion,
    TraceSeed,
)
from airtruth.cli.compilation import compile_filter
from airtruth.cli.early import require_names
from airtruth.cli.journal import is_verbose
from airtruth.cli.output import notice, print_result
from airtruth.cli.progress import (
    LOOP_STEPS,
    TRACE_STEPS,
    announced_compilation,
    loading,
    progress_bar,
    status,
    steps_of,
)
from airtruth.errors import FAILED_RUNS

if TYPE_CHECKING:
    from airtruth.api.trace_tasks import TraceTask
    from airtruth.tracing import TraceOptions


@app.command(epilog="Example: airtruth trace data/undeclared/a.parquet --aircraft gtm --out out/trace")
def trace(
    context: typer.Context,
    logs: LogFiles,
    aircraft: Declared,
    out: Annotated[Path, typer.Option(help="Folder of trace.json, its page and the updated aircraft.")],
    motion: TracedMotion = None,
    model: Model = "aircraft",
    hold_out: HeldOut = None,
    jobs: Threads = PROCESSORS,
    seed: TraceSeed = 0,
    effect: Candidates = None,
    time_budget: TimeBudget = None,
    increments: Increments = None,
    each: Annotated[
        bool,
        typer.Option(
            "--each", help="Trace each LOG separately, into a folder of its name, with a table of all."
        ),
    ] = False,
    cluster: OnCluster = None,
    force: ForceAndReplace = False,
    json_: Annotated[bool, typer.Option("--json", help="Print trace.json.")] = False,
    quiet: Quiet = False,
) -> None:
    """Name the effect that a declared aircraft lacks, add it, and report the error before and after."""
    with loading("trace", quiet):
        require_names(logs, aircraft, effects=effect or ())
        compile_filter(context, cluster)
        from airtruth.api.campaigns import load_aircraft
        from airtruth.api.trace_tasks import TraceTask

        options = _options(motion, model, hold_out, jobs, seed, effect, time_budget, increments)
    if each:
        _trace_each(logs, aircraft, options, out, cluster, force=force, as_json=json_, quiet=quiet)
        return
    task = TraceTask(tuple(logs), load_aircraft(aircraft), options, out, force)
    _perform(task, cluster, as_json=json_, quiet=quiet)


@app.command(
    epilog="Example: airtruth loop data/undeclared/a.parquet --aircraft gtm --out out/loop --method ls --method iv-f1"
)
def loop(
    context: typer.Context,
    logs: LogFiles,
    aircraft: Declared,
    out: Annotated[Path, typer.Option(help="Folder of the trace, the estimates, loop.json and the table.")],
    method: Methods = None,
    motion: TracedMotion = None,
    model: Model = "aircraft",
    hold_out: HeldOut = None,
    jobs: Threads = PROCESSORS,
    seed: TraceSeed = 0,
    effect: Candidates = None,
    time_budget: TimeBudget = None,
    increments: Increments = None,
    cluster: OnCluster = None,
    force: ForceAndReplace = False,
    json_: Annotated[bool, typer.Option("--json", help="Print loop.json.")] = False,
    quiet: Quiet = False,
) -> None:
    """Trace, remove the traced effects from the logs, and identify before and after (default: ls and iv-f1)."""
    with loading("loop", quiet):
        require_names(logs, aircraft, method or (), effect or ())
        compile_filter(context, cluster)
        from airtruth.api.campaigns import load_aircraft
        from airtruth.api.trace_tasks import TraceTask
        from airtruth.loop import METHODS

        options = _options(motion, model, hold_out, jobs, seed, effect, time_budget, increments)
    task = TraceTask(tuple(logs), load_aircraft(aircraft), options, out, force, tuple(method or METHODS))
    _perform(task, cluster, as_json=json_, quiet=quiet)


def _perform(task: TraceTask, cluster: str | None, *, as_json: bool, quiet: bool) -> None:
    """Perform a task here or on a cluster, and print its summary or its JSON file."""
    from airtruth.api.trace_tasks import attempted_on, perform
    from airtruth.cluster import workers

    steps = TRACE_STEPS if task.methods is None else LOOP_STEPS
    with (
        workers(cluster) as on,
        announced_compilation(task.command, quiet),
        status(task.command, quiet, steps_of(steps, task.folders)) as advance,
    ):
        if on is None:
            summary = perform(task, advance)
        else:
            advance(f"{task.command} on the cluster")
            ((_, ended),) = attempted_on(on, [task])
            if ended.error is not None:
                raise ended.error
            summary = ended.summary
    if as_json:
        summary = _json(task.answers)
    elif is_verbose() and task.methods is None:
        summary = _details(task.answers)
    print_result(summary.rstrip())


def _json(answers: Sequence[Path]) -> str:
    """The file of an answer; of several, an object with that of each motion under its name."""
    import json

    from airtruth.physics.motion import MOTIONS

    texts = [path.read_text(encoding="utf-8") for path in answers]
    if len(texts) == 1:
        return texts[0]
    named = zip(MOTIONS, map(json.loads, texts), strict=True)
    return json.dumps(dict(named), indent=1)


def _details(answers: Sequence[Path]) -> str:
    from airtruth.documents import read_json
    from airtruth.errors import StoreError
    from airtruth.tracing.answer import TraceAnswer
    from airtruth.tracing.presentation.several import under_headings
    from airtruth.tracing.presentation.text import as_trace_text

    documents = [(read_json(path, StoreError, "run the same command again"), path) for path in answers]
    return under_headings(as_trace_text, [TraceAnswer.from_dict(own, str(path)) for own, path in documents])


def _trace_each(
    sets: list[Path],
    aircraft: str,
    options: TraceOptions,
    out: Path,
    cluster: str | None,
    *,
    force: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    import json

    from airtruth.api.campaigns import load_aircraft
    from airtruth.api.trace_sets import trace_sets
    from airtruth.cluster import workers

    with (
        workers(cluster) as on,
        announced_compilation("trace", quiet),
        progress_bar("trace", "sets", quiet) as advance,
    ):
        result = trace_sets(
            sets, load_aircraft(aircraft), options, out, force=force, cluster=on, advance=advance
        )
    print_result(json.dumps(result.to_dict(), indent=1) if as_json else result.summary().rstrip())
    for one in result.failed:
        notice(f"{one.name}: {one.error}")
    if result.failed:
        raise typer.Exit(FAILED_RUNS)


def _options(
    motion: MotionName | None,
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
        motion=motion,
    )
