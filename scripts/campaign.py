"""make campaign: fly data/campaigns, identify, print the paper's tables, draw the figures, close the loop.

The loop ends it: effects traced in the first runs of light-fit and every method before and after
(scripts/paper_loop.py), and a trace of each flight test in data/undeclared. Every step is a command of
airtruth or a call into it; a run that is interrupted resumes.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import paper_loop
from numpy.typing import NDArray

from airtruth import aircraft
from airtruth.errors import AirtruthError
from airtruth.fly import manoeuvres, plan
from airtruth.fly.flight import Flight, Inputs
from airtruth.fly.linearise import linearise
from airtruth.fly.measure import LOGGED
from airtruth.fly.trim import trim
from airtruth.identify import Options, identify_batch, identify_files, residuals
from airtruth.logs.flight_log import Batch, batches
from airtruth.logs.store import log_paths, read_log, read_table, write_table
from airtruth.physics import short_period
from airtruth.report import (
    TABLES,
    distribution,
    figures,
    published,
    read_campaign,
    style,
    write_tables,
    write_trace_figures,
)
from airtruth.report.loop_figures import traces_page
from airtruth.report.tables import FURTHER
from airtruth.report.traces import write_traces
from airtruth.trace import TraceOptions, run

CAMPAIGNS = ("light", "light-fit", "moderate", "moderate-fit")
PAPER = Options(airspeed_m_s=42.852)
"""As the paper: the dynamic pressure is that of the trim. The trim itself is a free constant (docs/paper.md)."""
LOOP_CAMPAIGN = "light-fit"
QUICK_DIVISOR = 10
QUICK_LOGS = ("d",)
QUICK_TRACED = 4
FIGURE_4_S = (1.0, 7.0)
ROOT = Path(__file__).resolve().parents[1]
GTM = ROOT / "aircraft" / "gtm"


def main() -> int:
    """Run it all; 0, or the exit code of the step that failed."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=Path("out"))
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--quick", action="store_true", help="a tenth of the runs")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    for name in CAMPAIGNS:
        code = fly(name, arguments.out / name, arguments.jobs, arguments.quick)
        if code:
            return code
    try:
        report(arguments.out)
        close_loop(arguments.out, arguments.jobs, arguments.quick)
    except AirtruthError as error:
        print(f"campaign: {error}", file=sys.stderr)
        return error.exit_code
    return 0


def fly(name: str, out: Path, jobs: int, quick: bool) -> int:
    """One campaign by the command line, as a user would."""
    path = ROOT / "data" / "campaigns" / f"{name}.toml"
    command = [sys.executable, "-m", "airtruth", "fly", str(path), "--out", str(out), "--jobs", str(jobs)]
    if quick:
        command += ["--runs", str(plan.make(path).campaign.runs // QUICK_DIVISOR)]
    return subprocess.run(command, check=False).returncode


def report(out: Path) -> None:
    """Identify, tables and figures of flown campaigns."""
    gtm = aircraft.load(GTM)
    for name in CAMPAIGNS:
        print(f"identify {name}", file=sys.stderr)
        # the paper's methods at the trim's airspeed, those beyond it as they are by themselves
        estimates = pd.concat(
            [
                identify_files([out / name], gtm, methods, options)
                for methods, options in ((shown_methods(name), PAPER), (FURTHER, Options()))
            ],
            ignore_index=True,
        )
        write_table(out / name / "estimates.parquet", estimates)
    tables = write_tables([out / name for name in CAMPAIGNS], out / "tables")
    print(tables.text)
    print("Written: " + ", ".join(str(p) for p in [*tables.paths, *draw(out, gtm)]))


def close_loop(out: Path, jobs: int, quick: bool) -> None:
    """Trace, put the effects into the model, estimate again; then the flight tests of data/undeclared."""
    print("close the loop", file=sys.stderr)
    before = read_table(out / LOOP_CAMPAIGN / "estimates.parquet")
    traced = QUICK_TRACED if quick else paper_loop.TRACED
    closed = paper_loop.close(out / LOOP_CAMPAIGN, out / "loop", jobs, before, traced)
    found = {}
    for path in sorted((ROOT / "data" / "undeclared").glob("*.parquet")):
        if quick and path.stem not in QUICK_LOGS:
            continue
        print(f"trace {path.stem}", file=sys.stderr)
        folder = out / "trace" / path.stem
        found[path.stem] = run([path], GTM, TraceOptions(threads=jobs), folder)
        write_trace_figures(found[path.stem], folder)
    text, paths = write_traces({name: trace.answer for name, trace in found.items()}, out / "trace")
    style.save(traces_page(found), out / "trace" / "traces.png")
    print(closed.text)
    print(text)
    print("Written: " + ", ".join(map(str, [*closed.paths, *paths, out / "trace" / "traces.png"])))


def shown_methods(name: str) -> list[str]:
    """Methods of the tables that a campaign, or the one that it is a variant of, appears in."""
    columns = [m for spec in TABLES.values() if spec.campaign == name.split("-")[0] for m in spec.columns]
    return list(dict.fromkeys(columns))


def draw(out: Path, gtm: aircraft.Aircraft) -> list[Path]:
    """The figures: one flight, the filters (Fig. 1), the outputs (Fig. 4), the estimates' spread."""
    folder = out / "figures"
    folder.mkdir(exist_ok=True)
    log = read_log(log_paths(out / "moderate")[0])
    batch = next(batches(log))
    drawn = {
        "flight.png": figures.flight(
            batch.t_s[0], flight_versions(batch, gtm), "One flight in moderate turbulence"
        )
    }
    at = trim(gtm, plan.condition(plan.make(ROOT / "data/campaigns/light.toml").table.loc[0].to_dict()))
    linear = linearise(gtm, at)
    a, b = short_period.system(linear.plus, linear.scale)
    drawn["figure1.png"] = figures.filters(a, b, "Dynamic filters (the paper's Fig. 1)")
    light = next(batches(read_log(log_paths(out / "light-fit")[-1])))
    t = light.t_s[0, 1:-1]
    shown = (t >= FIGURE_4_S[0]) & (t <= FIGURE_4_S[1])
    drawn["figure4.png"] = figures.outputs(
        t[shown], output_fits(light, gtm, shown), "Outputs (the paper's Fig. 4)"
    )
    printed = published.load()
    for name in CAMPAIGNS:
        tables = [
            printed.tables[t] for t in (("table1", "table2") if name.startswith("light") else ("table3",))
        ]
        campaign = read_campaign(out / name)
        drawn[f"estimates-{name}.png"] = distribution.estimates(
            campaign,
            ("ls", "iv-lowpass", "iv-f1", "iv-f2"),
            printed=tables,
            title=f"Estimates, campaign {name}",
        )
    for name, figure in drawn.items():
        style.save(figure, folder / name)
    return [folder / name for name in drawn]


def flight_versions(batch: Batch, gtm: aircraft.Aircraft) -> dict[str, dict[str, np.ndarray]]:
    """The first run of the moderate campaign: as logged, without sensor errors, and in calm air."""
    made = plan.make(ROOT / "data" / "campaigns" / "moderate.toml")
    row = made.table.loc[0].to_dict()
    from airtruth.fly.chunk import Pilot

    noise_free = Pilot(replace(made, sensors={})).channels(row)
    t = np.arange(made.samples) * made.dt_s
    command = float(row["amplitude_rad"]) * manoeuvres.sample(made.manoeuvres[int(row["manoeuvre"])], t)
    at = trim(gtm, plan.condition(row), made.dt_s)
    calm = Flight(gtm, at, made.dt_s, made.log_every).fly(Inputs(command, 0.0 * t, 0.0 * t))
    measured = {name: values[0] for name, values in batch.channels.items()}
    return {
        "measured": {name: measured[name] for name in LOGGED},
        "without sensor errors": {name: noise_free[name] for name in LOGGED},
        "calm air": {name: calm[name] for name in LOGGED},
    }


def output_fits(
    batch: Batch, gtm: aircraft.Aircraft, shown: NDArray[np.bool_]
) -> dict[str, figures.OutputFit]:
    """Low-passed outputs of the last run against those of its LS and IV(f1) estimates."""
    last = Batch(
        batch.run_ids[-1:], batch.dt_s, batch.t_s[-1:], {n: v[-1:] for n, v in batch.channels.items()}
    )
    fits = {}
    for name in ("ls", "iv-f1"):
        estimates = replace(identify_batch(last, gtm, name, PAPER), method="ls")
        nothing = replace(estimates, theta=np.zeros_like(estimates.theta))
        measured = residuals(last, gtm, nothing, PAPER)[0]
        error = residuals(last, gtm, estimates, PAPER)[0]
        bound = 3.0 * error.std(axis=1, keepdims=True)
        fits[{"ls": "LS", "iv-f1": "IV(f1)"}[name]] = figures.OutputFit(
            measured[:, shown], (measured - error)[:, shown], bound
        )
    return fits


if __name__ == "__main__":
    raise SystemExit(main())
