"""make campaign: fly data/campaigns, identify, print the paper's tables, draw the figures, close the loop.

    python -m scripts.campaign [--out DIR] [--store URL] [--jobs N] [--quick] [--further] [--undeclared]

The loop traces the first runs of light-fit and identifies the others before and after (studies/paper_loop.py). An
interrupted campaign resumes. `make campaign-further` also identifies by the six methods that the paper does not have,
and traces each flight test of data/undeclared.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Final

from airtruth import aircraft, style
from airtruth.errors import AirtruthError
from airtruth.identification import Options, identify, write_estimates
from airtruth.logs.remote import location
from airtruth.logs.store import read_table
from airtruth.reporting import write_tables
from airtruth.reporting.paper.tables import FURTHER, methods_of
from airtruth.simulation.campaign import plan
from airtruth.tracing import TraceOptions, trace
from studies import paper_loop
from studies.campaign_figures import CAMPAIGN_FILES, PAPER, write_figures
from studies.loop_figures import traces_page
from studies.traces_overview import write_traces

CAMPAIGNS: Final = ("light", "light-fit", "moderate", "moderate-fit")
"""Campaigns of data/campaigns that the paper's tables show."""

LOOP_CAMPAIGN: Final = "light-fit"
"""Campaign in which the loop is closed."""

QUICK_DIVISOR: Final = 10
"""Factor by which --quick reduces the number of runs [-]."""

QUICK_LOGS: Final = ("d",)
"""Flight tests of data/undeclared that --quick traces."""

TRACED: Final = 6
"""Runs in which the effects of the loop are traced [-]; the paper_loop study takes twice as many."""

QUICK_TRACED: Final = 4
"""Runs in which --quick traces the effects of the loop [-]."""

ROOT: Final = Path(__file__).resolve().parents[1]
"""Root of the repository."""

GTM: Final = ROOT / "aircraft" / "gtm"
"""Declared aircraft."""


def main() -> int:
    """Run all steps; return 0, or the exit code of the step that failed."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=Path("out"))
    parser.add_argument(
        "--store", help="folder of an object store for campaigns, tables and figures; default: --out"
    )
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--quick", action="store_true", help="a tenth of the runs")
    parser.add_argument(
        "--further", action="store_true", help="also the methods that the paper does not have"
    )
    parser.add_argument("--undeclared", action="store_true", help="also trace the logs of data/undeclared")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    store = location(arguments.store or arguments.out)
    for name in CAMPAIGNS:
        code = fly(name, store / name, arguments.jobs, arguments.quick)
        if code:
            return code
    try:
        identify_campaigns(store, arguments.jobs, arguments.further)
        close_loop(store, arguments.out, arguments.jobs, QUICK_TRACED if arguments.quick else TRACED)
        if arguments.undeclared:
            logs = QUICK_LOGS if arguments.quick else None
            trace_undeclared(arguments.out / "trace", arguments.jobs, logs)
    except AirtruthError as error:
        print(f"campaign: {error}", file=sys.stderr)
        return error.exit_code
    return 0


def fly(name: str, out: Path, jobs: int, quick: bool) -> int:
    """Fly one campaign with the command line, as a user does; return its exit code."""
    path = CAMPAIGN_FILES / f"{name}.toml"
    command = [sys.executable, "-m", "airtruth", "fly", str(path), "--out", str(out), "--jobs", str(jobs)]
    if quick:
        command += ["--runs", str(plan.make(path).campaign.runs // QUICK_DIVISOR)]
    return subprocess.run(command, check=False).returncode


def identify_campaigns(out: Path, jobs: int, further: bool) -> None:
    """Identify the flown campaigns, one process for each; print and write their tables and figures."""
    print(f"identify {', '.join(CAMPAIGNS)}", file=sys.stderr)
    work = partial(_identify, out=out, further=further)
    with ProcessPoolExecutor(min(jobs, len(CAMPAIGNS)), get_context("spawn")) as pool:
        list(pool.map(work, reversed(CAMPAIGNS)))  # the largest first
    gtm = aircraft.load(GTM)
    tables = write_tables([out / name for name in CAMPAIGNS], out / "tables")
    print(tables.text)
    print("Written: " + ", ".join(map(str, [*tables.paths, *write_figures(out, CAMPAIGNS, gtm)])))


def _identify(name: str, out: Path, further: bool) -> None:
    """Write the estimates of one campaign: the paper's methods at the airspeed of the trim, further ones as they are."""
    gtm = aircraft.load(GTM)
    for methods, options in ((methods_of(name), PAPER), (FURTHER if further else (), Options())):
        if methods:
            estimates = identify(out / name, gtm, methods, options)
            write_estimates(out / name / "estimates.parquet", estimates, force=True)


def close_loop(flown: Path, out: Path, jobs: int, traced: int) -> None:
    """Trace the first runs of a campaign in ``flown``, put the effects into the model, identify the other runs again."""
    print("close the loop", file=sys.stderr)
    before = read_table(flown / LOOP_CAMPAIGN / "estimates.parquet")
    closed = paper_loop.close(flown / LOOP_CAMPAIGN, out / "loop", jobs, before, traced)
    print(closed.text)
    print("Written: " + ", ".join(map(str, closed.paths)))


def trace_undeclared(out: Path, jobs: int, names: tuple[str, ...] | None) -> None:
    """Trace the flight tests of data/undeclared, all of them if ``names`` is None; print and write their table."""
    results = {}
    for path in sorted((ROOT / "data" / "undeclared").glob("*.parquet")):
        if names is None or path.stem in names:
            print(f"trace {path.stem}", file=sys.stderr)
            results[path.stem] = trace(path, GTM, TraceOptions(threads=jobs), out / path.stem)
    text, paths = write_traces({name: result.answer for name, result in results.items()}, out)
    style.save(traces_page(results), out / "traces.png")
    print(text)
    print("Written: " + ", ".join(map(str, [*paths, out / "traces.png"])))


if __name__ == "__main__":
    raise SystemExit(main())
