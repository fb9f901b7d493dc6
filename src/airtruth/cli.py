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
            print("airtruth: interrupted; the same command resumes", file=sys.stderr)
        raise
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)


@app.callback(invoke_without_command=True)
def _root(version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False) -> None:
    if version:
        from airtruth import __version__

        print(__version__)
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
        print(planning.describe(plan))
        return
    with _progress("fly", "runs", quiet) as advance:
        summary = flying.fly(plan, out, jobs, advance)
    print(f"{summary.runs} runs in {out} ({summary.flown_now} flown now, {len(summary.failures)} failed)")
    if summary.failures:
        for failure in summary.failures[:5]:
            print(f"airtruth: {failure.run_id} failed: {failure.reason}", file=sys.stderr)
        if len(summary.failures) > 5:
            print(
                f"airtruth: and {len(summary.failures) - 5} more, see {out / flying.MANIFEST}",
                file=sys.stderr,
            )
        raise typer.Exit(FAILED_RUNS)


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
        covariance=covariance,
        tolerance=tolerance,
    )
    if out is None and len(logs) == 1 and (logs[0] / "logs").is_dir():
        out = logs[0] / "estimates.parquet"
    plane = planes.load(aircraft)
    with _progress("identify", "files", quiet) as advance:
        estimates = identify_files(logs, plane, method or ["iv-f1"], options, joint, advance)
    if out is not None:
        write_table(out, estimates)
    print(estimates.to_json(orient="records", indent=1) if json_ else as_text(overview(estimates)))


@app.command(epilog="Example: airtruth tables out/light out/moderate --out out/tables")
def tables(
    folders: Annotated[list[Path], typer.Argument(metavar="DIR...", help="Identified campaign folders.")],
    out: Annotated[Path, typer.Option(help="Folder of the tables (.md, .csv, .tex).")],
) -> None:
    """Write the paper's tables from identified campaigns, beside the printed figures."""
    from airtruth.report import write_tables

    print(write_tables(folders, out).text)


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
