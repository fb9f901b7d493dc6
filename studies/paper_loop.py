"""The paper's own experiment through the loop: trace, then every method without and with the effects.

    python -m studies.paper_loop [--runs 2000] [--affine 300] [--out out/loop] [--jobs N]

Flies data/campaigns/light-fit.toml, traces the first 12 runs against the linear short-period model of the
declared GTM, and identifies every other run before and after. Prints the table, writes it (.md .csv .tex)
and a figure. Flights are kept under --out; an interrupted run resumes. With --affine the same methods on
records of a GTM with affine aerodynamics, where no effect is missing.
"""

from __future__ import annotations

import argparse
import shutil
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pandas as pd

from airtruth import aircraft, style
from airtruth.identification import METHODS, Options, identify
from airtruth.logs.flight_log import FlightLog
from airtruth.logs.store import log_paths, read_log, read_table, write_table
from airtruth.loop import identify_without_effects
from airtruth.physics.motion import LONGITUDINAL
from airtruth.reporting import read_campaign
from airtruth.reporting.loop import WITH_EFFECTS, LoopTable, evaluate, without, write_loop
from airtruth.reporting.loop_figures import bias_figure
from airtruth.reporting.paper.tables import FURTHER
from airtruth.simulation.campaign import plan as planning
from airtruth.simulation.campaign import run as flying
from airtruth.tracing import TraceOptions, TraceResult, trace
from airtruth.tracing.compensate import Compensation, compensation_of
from airtruth.tracing.presentation.text import effect_line, verdict
from studies.affine_aircraft import affine_copy

ROOT = Path(__file__).resolve().parents[1]
CAMPAIGN = ROOT / "data" / "campaigns" / "light-fit.toml"
GTM = ROOT / "aircraft" / "gtm"
TRACED = 12
"""Number of runs that the effects are traced in; the table holds the others."""
PAPER = Options(airspeed_m_s=42.852)
NAME = "loop"


@dataclass(frozen=True)
class PaperLoop:
    """A closed loop over a campaign: the trace, the table with the truth, its text and the files."""

    trace: TraceResult
    table: LoopTable
    text: str
    paths: tuple[Path, ...]


def main() -> None:
    """Run it all."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=Path("out/loop"))
    parser.add_argument("--runs", type=int, default=2000)
    parser.add_argument("--affine", type=int, default=0, metavar="RUNS")
    parser.add_argument("--jobs", type=int, default=2)
    chosen = parser.parse_args()
    chosen.out.mkdir(parents=True, exist_ok=True)
    fly(CAMPAIGN, chosen.out / "flights", chosen.runs, chosen.jobs)
    closed = close(chosen.out / "flights", chosen.out, chosen.jobs)
    print(closed.text)
    print("Written: " + ", ".join(map(str, closed.paths)))
    if chosen.affine:
        print(affine(chosen.out, chosen.affine, chosen.jobs))


def fly(campaign: Path, out: Path, runs: int, jobs: int) -> None:
    """Fly, or fly the rest of, a campaign."""
    flying.fly(planning.make(campaign, None, runs), out, jobs)


def close(
    flights: Path, out: Path, jobs: int, before: pd.DataFrame | None = None, count: int = TRACED
) -> PaperLoop:
    """Trace the first runs of a flown campaign, estimate before and after, and write table and figure.

    Parameters
    ----------
    flights : campaign folder.
    out : folder of the result.
    jobs : number of processes.
    before : estimates without effects; None estimates them here.
    count : number of traced runs; they do not enter the table.
    """
    paths = log_paths(flights)
    result = trace(leading(paths, count), GTM, TraceOptions(model="linear", threads=jobs), out / "trace")
    records = result.answer.records
    traced = sorted({*records.fitted, *records.held_out})
    taken = compensation_of(result)
    notes = [
        f"Effects traced in {traced[0]} to {traced[-1]}, which are left out here. {verdict(result.answer)}",
        *(effect_line(e) for e in result.answer.effects),
        *(f"{t.sentence}." for t in taken.treatments),
    ]
    if before is None:
        before = identify_all(paths, None, jobs)
    after = identify_all(paths, taken, jobs, tuple(before["method"].unique())) if taken.treatments else before
    after = after.assign(method=after["method"] + WITH_EFFECTS)
    folder = out / "estimates"
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("truth.parquet", "campaign.json"):
        shutil.copyfile(flights / name, folder / name)
    write_table(folder / "estimates.parquet", pd.concat([before, after], ignore_index=True))
    campaign = without(read_campaign(folder), traced)
    table = evaluate(campaign, NAME, "The loop: effects traced, then in the model", notes)
    text, written = write_loop(table, out)
    style.save(bias_figure(table), out / f"{NAME}.png")
    return PaperLoop(result, table, text, (*written, out / f"{NAME}.png", out / "trace" / "trace.json"))


def leading(paths: Sequence[Path], count: int) -> FlightLog:
    """The first runs of a campaign as one log."""
    logs: list[FlightLog] = []
    for path in paths:
        logs.append(read_log(path))
        if sum(map(len, logs)) >= count:
            break
    log = FlightLog.concat(logs)
    return log.select(run_ids=log.run_ids[:count])


def identify_all(
    paths: Sequence[Path], taken: Compensation | None, jobs: int, methods: tuple[str, ...] = tuple(METHODS)
) -> pd.DataFrame:
    """Estimates of every run by every method, with the effects taken out if ``taken`` is given."""
    work = partial(_identify_file, taken=taken, methods=methods)
    if min(jobs, len(paths)) == 1:
        parts = list(map(work, paths))
    else:
        with ProcessPoolExecutor(jobs, get_context("spawn")) as pool:
            parts = list(pool.map(work, paths))
    return pd.concat(parts, ignore_index=True)


def _identify_file(path: Path, taken: Compensation | None, methods: tuple[str, ...]) -> pd.DataFrame:
    """The paper's methods at the airspeed of the trim, the further ones with their defaults."""
    gtm, log = aircraft.load(GTM), read_log(path)
    parts = [
        identify(log, gtm, names, options)
        if taken is None
        else identify_without_effects([log], gtm, names, taken, options)
        for names, options in _groups(methods)
    ]
    return pd.concat([part.to_frame() for part in parts], ignore_index=True)


def _groups(methods: Sequence[str]) -> Iterator[tuple[list[str], Options]]:
    for further, options in ((False, PAPER), (True, Options())):
        names = [m for m in methods if (m in FURTHER) == further]
        if names:
            yield names, options


def affine(out: Path, runs: int, jobs: int) -> str:
    """Bias [%] with its standard error of every method on records of an aircraft without the nonlinearity."""
    at = read_table(out / "flights" / "truth.parquet").iloc[0]
    plane = (out / "affine-gtm" / "gtm").resolve()
    if not plane.exists():
        plane.parent.mkdir(parents=True, exist_ok=True)
        affine_copy(GTM, plane, float(at["trim_alpha_rad"]), float(at["trim_elevator_rad"]))
    changed = out / "affine.toml"
    changed.write_text(CAMPAIGN.read_text().replace('aircraft = "gtm"', f'aircraft = "{plane}"'))
    fly(changed, out / "affine", runs, jobs)
    found = identify_all(log_paths(out / "affine"), None, jobs)
    names = list(LONGITUDINAL.parameters)
    truth = read_table(out / "affine" / "truth.parquet")[names].mean().to_numpy()
    lines = [f"Affine aerodynamics, {runs} runs: bias [%] (standard error)"]
    lines.append(" " * 24 + "".join(n.rjust(16) for n in names))
    for method, rows in found.groupby("method", sort=False):
        x = rows[rows["converged"]][names].to_numpy() / truth - 1.0
        cells = (
            f"{100 * m:.1f} ({100 * s:.1f})"
            for m, s in zip(x.mean(axis=0), x.std(axis=0, ddof=1) / np.sqrt(len(x)), strict=True)
        )
        lines.append(str(method).ljust(24) + "".join(c.rjust(16) for c in cells))
    return "\n".join(lines)


if __name__ == "__main__":
    main()
