"""The command line: thin; scientific imports happen inside the commands, so --help is quick."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from airtruth.errors import AirtruthError

app = typer.Typer(
    name="airtruth",
    help="Fly a flight test in JSBSim, identify the aircraft from its logs, close the loop with measured data.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)

aircraft_app = typer.Typer(help="Write aircraft.", no_args_is_help=True, rich_markup_mode=None)
app.add_typer(aircraft_app, name="aircraft")

INTERRUPTED = 130
FAILED_RUNS = 1

Quiet = Annotated[bool, typer.Option("--quiet", help="No progress and no summary on stderr.")]


def main() -> None:
    """Entry point: known errors become one message on stderr and an exit code."""
    try:
        app()
    except AirtruthError as error:
        print(f"airtruth: {error}", file=sys.stderr)
        sys.exit(error.exit_code)
    except SystemExit as end:  # typer turns Ctrl-C into this
        if end.code == INTERRUPTED:
            resumes = sys.argv[1:2] == ["fly"]
            step = "resumes" if resumes else "starts again from the beginning"
            print(f"airtruth: interrupted; the same command {step}", file=sys.stderr)
        raise
    except BrokenPipeError:
        _close_stdout()
        sys.exit(1)


def _print(text: str, end: str = "\n") -> None:
    """Write a result to stdout, now, so that a full disk is found while it can be said.

    Raises
    ------
    StoreError
        If it cannot be written.
    """
    try:
        print(text, end=end, flush=True)
    except BrokenPipeError:
        raise
    except OSError as error:
        from airtruth.logs.atomic import write_error

        _close_stdout()
        raise write_error(Path("standard output"), error) from None


def _close_stdout() -> None:
    """Send what is left in stdout's buffer nowhere: the interpreter flushes it once more at its end."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


@app.callback(invoke_without_command=True)
def _root(version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False) -> None:
    if version:
        from airtruth import __version__

        _print(__version__)
        raise typer.Exit


@app.command(epilog="Example: airtruth fly data/campaigns/light.toml --out out/light --jobs 2")
def fly(
    campaign: Annotated[
        Path, typer.Argument(metavar="CAMPAIGN.toml", help="Campaign file, see docs/campaigns.md.")
    ],
    out: Annotated[
        Path, typer.Option(help="Folder of the campaign; the same command resumes what is there.")
    ],
    jobs: Annotated[
        int, typer.Option(min=1, help="Processes; the logs do not depend on it.")
    ] = os.cpu_count() or 1,
    seed: Annotated[int | None, typer.Option(min=0, help="In place of the file's seed.")] = None,
    runs: Annotated[int | None, typer.Option(min=1, help="In place of the file's number of runs.")] = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Check and print the plan, fly nothing.")
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Fly a campaign in JSBSim and write its flight logs."""
    from airtruth.fly import campaign as flying
    from airtruth.fly import plan as planning

    plan = planning.make(campaign, seed, runs)
    if dry_run:
        _print(planning.describe(plan))
        return
    with _progress("fly", "runs", quiet) as advance:
        summary = flying.fly(plan, out, jobs, advance)
    _print(f"{summary.runs} runs in {out} ({summary.flown_now} flown now, {len(summary.failures)} failed)")
    if summary.failures:
        for failure in summary.failures[:5]:
            print(f"airtruth: {failure.run_id} failed: {failure.reason}", file=sys.stderr)
        if len(summary.failures) > 5:
            print(
                f"airtruth: and {len(summary.failures) - 5} more, see {out / flying.MANIFEST}",
                file=sys.stderr,
            )
        raise typer.Exit(FAILED_RUNS)


@app.command(epilog="Example: airtruth plan data/campaigns/light.toml --pressure measured")
def plan(
    campaign: Annotated[
        Path, typer.Argument(metavar="CAMPAIGN.toml", help="Campaign file, see docs/campaigns.md.")
    ],
    records: Annotated[
        int | None, typer.Option(min=1, help="Number of records, in place of the file's number of runs.")
    ] = None,
    pressure: Annotated[
        str, typer.Option(help="constant: nothing is taken from the airspeed; measured: it is used.")
    ] = "constant",
    json_: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Say how well a campaign can tell the six derivatives, before it is flown."""
    from airtruth.fly import plan as planning
    from airtruth.identify import as_text
    from airtruth.report import forecast as forecasts

    made = forecasts.forecast(planning.make(campaign), records, pressure)
    _print(forecasts.as_json(made) if json_ else as_text(forecasts.as_table(made)))


@app.command(epilog="Example: airtruth identify out/light --aircraft gtm --method iv-f1 --method ls")
def identify(
    logs: Annotated[
        list[Path], typer.Argument(metavar="DIR|LOG...", help="Campaign folders or flight logs.")
    ],
    aircraft: Annotated[str, typer.Option(metavar="A", help="Folder with aircraft.toml, or a shipped name.")],
    method: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Estimator, may be repeated; see docs/methods.md."),
    ] = None,
    joint: Annotated[bool, typer.Option("--joint", help="One estimate for all runs together.")] = False,
    out: Annotated[
        Path | None, typer.Option(help="Parquet file of the estimates; DIR/estimates.parquet for one DIR.")
    ] = None,
    trim: Annotated[
        str, typer.Option(help="intercept: a free constant; mean: of the first --trim-window-s.")
    ] = "intercept",
    trim_window_s: Annotated[
        float, typer.Option(help="Window before the manoeuvre [s], for --trim mean.")
    ] = 1.0,
    condition: Annotated[
        str,
        typer.Option(help="Airspeed and density of a record: motion, record or window, see docs/methods.md."),
    ] = "motion",
    airspeed_m_s: Annotated[
        float | None, typer.Option(help="True airspeed to use in place of the measured one [m/s].")
    ] = None,
    pressure: Annotated[
        str,
        typer.Option(
            help="Dynamic pressure: constant over a record, measured at each sample, or the method's own."
        ),
    ] = "method",
    covariance: Annotated[
        str, typer.Option(help="printed, white, coloured, corrected or none.")
    ] = "corrected",
    tolerance: Annotated[
        float, typer.Option(help="Relative change at which an estimator has converged.")
    ] = 0.01,
    json_: Annotated[bool, typer.Option("--json", help="Print the rows as JSON.")] = False,
    quiet: Quiet = False,
) -> None:
    """Estimate the six short-period derivatives of every run."""
    from airtruth import aircraft as planes
    from airtruth.identify import Options, as_text, identify_files, overview
    from airtruth.logs.store import write_table

    options = Options(
        trim=trim,
        trim_window_s=trim_window_s,
        condition=condition,
        airspeed_m_s=airspeed_m_s,
        pressure=pressure,
        covariance=covariance,
        tolerance=tolerance,
    )
    if out is None and len(logs) == 1 and (logs[0] / "logs").is_dir():
        out = logs[0] / "estimates.parquet"
    plane = planes.load(aircraft)
    notes: list[str] = []
    with _progress("identify", "files", quiet) as advance:
        estimates = identify_files(logs, plane, method or ["iv-f1"], options, joint, advance, notes.append)
    for sentence in [] if quiet else notes:
        print(f"airtruth: {sentence}", file=sys.stderr)
    if out is not None:
        write_table(out, estimates)
    _print(estimates.to_json(orient="records", indent=1) if json_ else as_text(overview(estimates)))


@app.command(epilog="Example: airtruth trace data/undeclared/a.parquet --aircraft gtm --out out/trace")
def trace(
    logs: Annotated[
        list[Path], typer.Argument(metavar="LOG...", help="Flight logs of one aircraft, or folders of them.")
    ],
    aircraft: Annotated[
        str, typer.Option(metavar="A", help="The declared aircraft: a folder, or a shipped name.")
    ],
    out: Annotated[Path, typer.Option(help="Folder of trace.json, figures and the updated aircraft.")],
    model: Annotated[
        str, typer.Option(help="aircraft: forces probed in JSBSim; linear: the linear short-period model.")
    ] = "aircraft",
    hold_out: Annotated[
        list[str] | None,
        typer.Option(
            metavar="RUN_ID", help="Run kept for the report alone; may be repeated. Default: every third."
        ),
    ] = None,
    jobs: Annotated[
        int, typer.Option(min=1, help="Threads; the answer does not depend on it.")
    ] = os.cpu_count() or 1,
    seed: Annotated[int, typer.Option(min=0, help="Of the draws behind p-values.")] = 0,
    effect: Annotated[
        list[str] | None,
        typer.Option(metavar="KEY", help="Candidate, may be repeated; default: all of `airtruth effects`."),
    ] = None,
    json_: Annotated[bool, typer.Option("--json", help="Print trace.json.")] = False,
    quiet: Quiet = False,
) -> None:
    """Name the effect that a declared aircraft lacks, add it, and report the error before and after."""
    import json

    from airtruth.report import as_trace_text, write_trace_figures
    from airtruth.trace import TraceOptions, run

    options = TraceOptions(
        model=model,
        hold_out=None if hold_out is None else tuple(hold_out),
        threads=jobs,
        seed=seed,
        effects=None if effect is None else tuple(effect),
    )
    with _status("trace", quiet) as advance:
        found = run(logs, aircraft, options, out, advance)
        write_trace_figures(found, out)
    _print(json.dumps(found.answer, indent=1) if json_ else as_trace_text(found.answer))


@app.command(epilog="Example: airtruth tables out/light out/moderate --out out/tables")
def tables(
    folders: Annotated[list[Path], typer.Argument(metavar="DIR...", help="Identified campaign folders.")],
    out: Annotated[Path, typer.Option(help="Folder of the tables (.md, .csv, .tex).")],
) -> None:
    """Write the paper's tables from identified campaigns, beside the printed figures."""
    from airtruth.report import write_tables

    _print(write_tables(folders, out).text)


@app.command(epilog="Example: airtruth report out/trace --out out/trace/report.html")
def report(
    folder: Annotated[
        Path,
        typer.Argument(metavar="DIR", help="Folder of a trace or of an identified campaign, or estimates."),
    ],
    out: Annotated[Path, typer.Option(help="The page; its tables stand beside it as .csv and .tex.")],
) -> None:
    """Write one self-contained HTML page, and its tables as CSV and LaTeX."""
    from airtruth.report import write_report

    _print("\n".join(str(path) for path in write_report(folder, out)))


@app.command(epilog="Example: airtruth effects elevator_delay")
def effects(
    name: Annotated[list[str] | None, typer.Argument(metavar="[NAME]...", help="Only these.")] = None,
    json_: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """List and explain the effects that can be flown and traced."""
    from airtruth.effects import library, listing

    chosen = [e for n in name for e in library.named(n)] if name else list(library.EFFECTS.values())
    _print(listing.as_json(chosen) if json_ else listing.as_text(chosen))


@app.command(
    name="import", epilog="Example: airtruth import flight7.mat --mapping flight7.toml --out flight7.parquet"
)
def import_(
    file: Annotated[Path, typer.Argument(metavar="FILE", help=".csv, .txt, .mat, .parquet or .ulg.")],
    mapping: Annotated[
        Path | None,
        typer.Option(metavar="MAP.toml", help="Which column is which channel, see docs/measured.md."),
    ] = None,
    out: Annotated[Path | None, typer.Option(metavar="LOG.parquet", help="Flight log to write.")] = None,
    guess: Annotated[
        bool, typer.Option("--guess", help="Print a mapping to start from, import nothing.")
    ] = False,
    force: Annotated[
        bool, typer.Option("--force", help="Write the log although its mapping contradicts physics.")
    ] = False,
) -> None:
    """Bring a measured log of another format under the log contract."""
    from airtruth.errors import ConfigurationError
    from airtruth.logs import importers

    if guess:
        _print(importers.guess_mapping(file), end="")
        return
    if mapping is None or out is None:
        raise ConfigurationError(
            "import needs --mapping MAP.toml and --out LOG.parquet; "
            f"`airtruth import --guess {file}` prints a mapping to start from"
        )
    from airtruth.logs.store import write_log

    imported = importers.import_log(file, mapping, force=force)
    write_log(out, imported.log, dtype="float64")
    for problem in imported.problems:
        print(f"airtruth: {problem.sentence}", file=sys.stderr)
    log = imported.log
    _print(f"{len(log.run_ids)} runs, {len(log.t_s)} rows in {out}: {', '.join(log.channels)}")


@app.command(epilog="Example: airtruth check flight7.parquet --aircraft totter")
def check(
    log: Annotated[Path, typer.Argument(metavar="LOG", help="Flight log, or folder of logs.")],
    aircraft: Annotated[
        str | None, typer.Option(metavar="A", help="Aircraft whose declared sensors are taken as known.")
    ] = None,
    run: Annotated[
        list[str] | None, typer.Option(metavar="RUN_ID", help="Only this run, may be repeated.")
    ] = None,
    json_: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Judge the channels of a log against each other: biases, scales, arms, delays."""
    import json

    from airtruth import aircraft as planes
    from airtruth.identify import as_text, kinematics, kinematics_report
    from airtruth.logs.store import log_paths, read_log

    declared = kinematics.declared_errors(planes.load(aircraft)) if aircraft else {}
    answers = []
    for path in log_paths(log):
        answer = kinematics.check_kinematics(read_log(path, run_ids=run), declared)
        answers.append({"file": str(path), **answer.as_dict()})
        if not json_:
            _print("\n\n".join(as_text(table) for table in kinematics_report.tables(answer)))
    if json_:
        _print(json.dumps(answers[0] if len(answers) == 1 else answers, indent=1))


@aircraft_app.command(
    "new",
    epilog="Example: airtruth aircraft new attas --estimates estimates.parquet --log a.parquet --out attas_jsb",
)
def aircraft_new(
    aircraft: Annotated[
        str, typer.Argument(metavar="A", help="Folder with aircraft.toml, or a shipped name.")
    ],
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder to write; its name is the aircraft's.")],
    estimates: Annotated[
        Path | None, typer.Option(help="Estimates of `airtruth identify`, in place of [derivatives].")
    ] = None,
    method: Annotated[str | None, typer.Option(metavar="NAME", help="Which method of the estimates.")] = None,
    derivative: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=VALUE", help="In place of a stated one; may be repeated."),
    ] = None,
    log: Annotated[
        Path | None, typer.Option(help="Flight log whose first second is the trim, in place of what follows.")
    ] = None,
    airspeed_m_s: Annotated[float | None, typer.Option(help="True airspeed of the trim [m/s].")] = None,
    altitude_m: Annotated[float | None, typer.Option(help="Pressure altitude of the trim [m].")] = None,
    alpha_deg: Annotated[float, typer.Option(help="Angle of attack of the trim [deg].")] = 3.0,
    elevator_deg: Annotated[float, typer.Option(help="Elevator of the trim [deg].")] = 0.0,
) -> None:
    """Write a JSBSim aircraft that flies six derivatives about a trim, for one that has no model."""
    from airtruth.fly.new_aircraft import make

    trim = (airspeed_m_s, altitude_m, alpha_deg, elevator_deg)
    _print(make(aircraft, out, estimates, method, derivative or [], log, trim))


@contextmanager
def _status(verb: str, quiet: bool) -> Iterator[Callable[[str], None]]:
    """A line on stderr that says what is being done; one line each where that is no terminal."""
    if quiet:
        yield lambda what: None
        return
    if not sys.stderr.isatty():
        yield lambda what: print(f"airtruth {verb}: {what}", file=sys.stderr, flush=True)
        return
    from rich.console import Console

    with Console(stderr=True).status(verb) as status:
        yield lambda what: status.update(f"{verb}: {what}")


@contextmanager
def _progress(verb: str, things: str, quiet: bool) -> Iterator[Callable[[int, int, int], None]]:
    """A bar with rate and time left on stderr, where that is a terminal."""
    if quiet or not sys.stderr.isatty():
        yield lambda done, total, failed: None
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        ProgressColumn,
        Task,
        TextColumn,
        TimeRemainingColumn,
    )
    from rich.text import Text

    class Rate(ProgressColumn):
        def render(self, task: Task) -> Text:
            return Text(f"{task.speed:.0f} {things}/s" if task.speed else "")

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        Rate(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task(verb, total=None)

        def advance(done: int, total: int, failed: int) -> None:
            bar.update(
                task, completed=done, total=total, description=f"{verb} ({failed} failed)" if failed else verb
            )

        yield advance
