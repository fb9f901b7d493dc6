"""The paper's own experiment through the loop: trace, then every method without and with the effects.

    python scripts/paper_loop.py [--runs 2000] [--affine 300] [--out out/loop] [--jobs N]

Flies data/campaigns/light-fit.toml, traces the first 12 runs against the linear short-period model of the
declared GTM, and identifies every other run before and after. Prints the table, writes it (.md .csv .tex)
and a figure. Flights are kept under --out; an interrupted run resumes. With --affine the same methods on
records of a GTM whose aerodynamics are planes: what each does where nothing is missing.
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
from closed_loop_study import affine_copy

from airtruth import aircraft
from airtruth.errors import ConfigurationError
from airtruth.fly import campaign as flying
from airtruth.fly import plan as planning
from airtruth.identify import METHODS, Options, identify_log
from airtruth.logs.flight_log import FlightLog
from airtruth.logs.store import log_paths, read_log, read_table, write_table
from airtruth.physics.short_period import PARAMETERS
from airtruth.report import read_campaign, style
from airtruth.report.loop import WITH_EFFECTS, LoopTable, evaluate, without, write_loop
from airtruth.report.loop_figures import bias_figure
from airtruth.report.tables import FURTHER
from airtruth.report.trace_text import effect_line, verdict
from airtruth.trace import Trace, TraceOptions, run
from airtruth.trace.corrected import Correction, correction, identify_corrected

ROOT = Path(__file__).resolve().parents[1]
CAMPAIGN = ROOT / "data" / "campaigns" / "light-fit.toml"
GTM = ROOT / "aircraft" / "gtm"
TRACED = 12
"""Runs that the effects are traced in; the estimates are judged on the others."""
PAPER = Options(airspeed_m_s=42.852)
NAME = "loop"


@dataclass(frozen=True)
class Loop:
    """A closed loop: the trace and its sentences, the table, the files."""

    found: Trace
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
    flying.fly(planning.make(campaign, None, runs), out, jobs, lambda done, total, failed: None)


def close(
    flights: Path, out: Path, jobs: int, before: pd.DataFrame | None = None, count: int = TRACED
) -> Loop:
    """Trace the first runs of a flown campaign, estimate before and after, and write table and figure.

    Parameters
    ----------
    flights : campaign folder.
    out : folder of the result.
    jobs : processes.
    before : estimates without effects, made here if None.
    count : runs that are traced.
    """
    paths = log_paths(flights)
    found = run(leading(paths, count), GTM, TraceOptions(model="linear", threads=jobs), out / "trace")
    traced = [r.signals.run_id for r in found.case.fitted.records]
    traced += [r.signals.run_id for r in found.case.held.records] if found.case.held else []
    traced.sort()
    notes = [f"Effects traced in {traced[0]} to {traced[-1]}, which are not judged. {verdict(found.answer)}"]
    notes += [effect_line(e) for e in found.answer["effects"]]
    try:
        taken = correction(found)
    except ConfigurationError as error:
        taken = None
        notes.append(f"After is before: {error}.")
    if before is None:
        before = estimates(paths, None, jobs)
    after = before if taken is None else estimates(paths, taken, jobs, tuple(before["method"].unique()))
    after = after.assign(method=after["method"] + WITH_EFFECTS)
    folder = out / "estimates"
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("truth.parquet", "campaign.json"):
        shutil.copyfile(flights / name, folder / name)
    write_table(folder / "estimates.parquet", pd.concat([before, after], ignore_index=True))
    table = evaluate(
        without(read_campaign(folder), traced), NAME, "The loop: effects traced, then in the model", notes
    )
    text, written = write_loop(table, out)
    style.save(bias_figure(table), out / f"{NAME}.png")
    return Loop(found, table, text, (*written, out / f"{NAME}.png", out / "trace" / "trace.json"))


def leading(paths: Sequence[Path], count: int) -> FlightLog:
    """The first runs of a campaign as one log."""
    logs: list[FlightLog] = []
    for path in paths:
        logs.append(read_log(path))
        if sum(len(log.run_ids) for log in logs) >= count:
            break
    names = set.intersection(*(set(log.channels) for log in logs))
    spans = [(log, log.rows(i)) for log in logs for i in range(len(log.run_ids))][:count]
    return FlightLog(
        metadata=logs[0].metadata,
        run_ids=tuple(r for log in logs for r in log.run_ids)[:count],
        offsets=np.concatenate([[0], np.cumsum([s.stop - s.start for _, s in spans])]).astype(np.int64),
        t_s=np.concatenate([log.t_s[s] for log, s in spans]),
        channels={n: np.concatenate([log.channels[n][s] for log, s in spans]) for n in sorted(names)},
    )


def estimates(
    paths: Sequence[Path], taken: Correction | None, jobs: int, methods: tuple[str, ...] = tuple(METHODS)
) -> pd.DataFrame:
    """Estimates of every run by every method, with effects in the model if ``taken`` is given."""
    work = partial(estimates_of, taken=taken, methods=methods)
    if min(jobs, len(paths)) == 1:
        parts = list(map(work, paths))
    else:
        with ProcessPoolExecutor(jobs, get_context("spawn")) as pool:
            parts = list(pool.map(work, paths))
    return pd.concat(parts, ignore_index=True)


def estimates_of(path: Path, taken: Correction | None, methods: tuple[str, ...]) -> pd.DataFrame:
    """Estimates of one log: the paper's methods at the airspeed of the trim, those beyond it as they are."""
    gtm, log = aircraft.load(GTM), read_log(path)
    parts = []
    for names, options in _groups(methods):
        if taken is None:
            parts.append(identify_log(log, gtm, names, options))
        else:
            parts.append(identify_corrected(log, gtm, names, taken, options))
    return pd.concat(parts, ignore_index=True)


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
    found = estimates(log_paths(out / "affine"), None, jobs)
    names = list(PARAMETERS)
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
