"""What reproduces the paper's Tables 1-3, and what does not: each cause switched off and on.

Flies variants of data/campaigns/light-fit.toml and moderate-fit.toml, identifies them, and prints the
tables of docs/paper.md, each figure with its Monte Carlo standard error. Flights are kept under --out;
an interrupted study resumes there, and a second one only identifies.
"""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pandas as pd
from closed_loop_study import affine_copy
from numpy.typing import NDArray

from airtruth import aircraft
from airtruth.aircraft import Aircraft
from airtruth.fly import campaign as flying
from airtruth.fly import plan as planning
from airtruth.identify import Options, estimates_table, identify_batch
from airtruth.logs.flight_log import Batch, batches
from airtruth.logs.store import log_paths, read_log, read_table, write_table
from airtruth.physics.short_period import PARAMETERS
from airtruth.report.campaign import read_campaign
from airtruth.report.comparison import RUNS, SIX
from airtruth.report.tables import TABLES, Entry, Table, evaluate
from airtruth.units import DEG

Array = NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[1]
CAMPAIGNS = ROOT / "data" / "campaigns"
GTM = ROOT / "aircraft" / "gtm"
QUICK_DIVISOR = 10
TRIM_AIRSPEED_M_S = 42.852
"""True airspeed of the trim at 75 kt EAS, 7000 ft: the paper's dynamic pressure is that of the trim."""
PAPER = Options(airspeed_m_s=TRIM_AIRSPEED_M_S, covariance="none")
IDEAL = "\n[sensors]\nideal = true\n"
PRINTED_COLUMNS: dict[str, dict[str, tuple[str, ...]]] = {
    "light": {
        "table1": ("ls", "iv-lowpass", "iv-reference-regressor", "iv-actuator-regressor"),
        "table2": ("iv-f1", "iv-f2"),
    },
    "moderate": {"table3": ("ls", "iv-lowpass", "iv-f1", "iv-f2")},
}
"""Columns of the paper, each once, by the method that reads it as the printed figures do."""
METHODS = {
    "light": (*PRINTED_COLUMNS["light"]["table1"], "iv-reference", "iv-actuator", "iv-f1", "iv-f2"),
    "moderate": PRINTED_COLUMNS["moderate"]["table3"],
}
INPUTS = ("iv-reference", "iv-reference-regressor", "iv-actuator", "iv-actuator-regressor")
BREAK_ALPHA_RAD = 6.0 * DEG


@dataclass(frozen=True)
class Case:
    """A variant of a campaign.

    Attributes
    ----------
    label : the cause that is switched.
    level : "light" or "moderate": which campaign it is a variant of.
    settings : key of the campaign file -> value in its place, as TOML.
    extra : text appended to the file.
    u, w : factors of the gust components, besides the file's own.
    options : of the identification.
    from_s : time at which the identified part of the record begins [s].
    lead_s : if set, the command is replaced by the measured elevator this much ahead of time [s].
    """

    label: str
    level: str = "light"
    settings: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    extra: str = ""
    u: float = 1.0
    w: float = 1.0
    options: Options = PAPER
    from_s: float = 0.0
    lead_s: float | None = None


MEASURED = replace(PAPER, airspeed_m_s=None)
WINDOW = replace(PAPER, trim="mean", trim_window_s=1.9)
TIGHT = replace(PAPER, tolerance=1e-3)
CROPPED = Case("record begins with the doublet", from_s=2.0)
SETTINGS = (
    Case("the best setting"),
    Case("doublet of +-2 deg", settings={"amplitude_deg": "2.0"}),
    Case("+-2 deg, gusts 1.75", settings={"amplitude_deg": "2.0", "factor": "1.75"}),
    Case("+-2 deg, gusts 2", settings={"amplitude_deg": "2.0", "factor": "2.0"}),
    Case("first pulse nose-up", settings={"amplitude_deg": "-1.0"}),
    Case("gusts 0.75", settings={"factor": "0.75"}),
    Case("gusts 1.25", settings={"factor": "1.25"}),
    Case("gusts stationary", settings={"start": '"stationary"'}),
    Case("record of 5 s", settings={"duration_s": "5.0"}),
    Case("record of 10 s", settings={"duration_s": "10.0"}),
    Case("record of 20 s", settings={"duration_s": "20.0"}),
    Case(
        "5 s, +-2 deg, gusts 1.75", settings={"duration_s": "5.0", "amplitude_deg": "2.0", "factor": "1.75"}
    ),
    Case("doublet at 1 s", settings={"start_s": "1.0"}),
    CROPPED,
    Case("airspeed measured", options=MEASURED),
    Case("trim: mean of the first 1.9 s", options=WINDOW),
    Case("tolerance 0.1 %", options=TIGHT),
)
MODERATE = (
    Case("the best setting", level="moderate"),
    Case("record of 5 s", level="moderate", settings={"duration_s": "5.0"}),
    Case("+-2 deg, gusts 1.75", level="moderate", settings={"amplitude_deg": "2.0", "factor": "1.75"}),
    Case("trim: mean of the first 1.9 s", level="moderate", options=WINDOW),
    Case("tolerance 0.1 %", level="moderate", options=TIGHT),
)
CAUSES = (
    Case("sensor noise alone", u=0.0, w=0.0),
    Case("w gust alone", u=0.0, extra=IDEAL),
    Case("u gust alone", w=0.0, extra=IDEAL),
    Case("u and w gust", extra=IDEAL),
    Case("noise and w gust", u=0.0),
    Case("noise and u gust", w=0.0),
    Case("all"),
)
LEADS = (
    Case("command as flown"),
    Case("elevator, 0 ms ahead", lead_s=0.0),
    Case("elevator, 10 ms ahead", lead_s=0.010),
    Case("elevator, 15 ms ahead", lead_s=0.015),
    Case("elevator, 20 ms ahead", lead_s=0.020),
)


@dataclass(frozen=True)
class Study:
    """Where flights are kept and how many are flown."""

    out: Path
    jobs: int
    quick: bool
    gtm: Aircraft


def with_settings(text: str, settings: Mapping[str, str], extra: str = "") -> str:
    """Text of a campaign file with the values of some keys replaced, and more text at its end.

    Raises
    ------
    KeyError
        If a key does not stand in the file exactly once.
    """
    for key, value in settings.items():
        text, count = re.subn(rf"(?m)^{key} = .*$", f"{key} = {value}", text)
        if count != 1:
            raise KeyError(f"{key} stands {count} times in the campaign file")
    return text + extra


def flown(study: Study, case: Case, runs: int | None = None, folder: Path = GTM) -> Path:
    """Fly a case, or what is left of it; its campaign folder."""
    source = (CAMPAIGNS / f"{case.level}-fit.toml").read_text(encoding="utf-8")
    settings = dict(case.settings) | ({"runs": str(runs)} if runs else {})
    text = with_settings(source, settings | {"aircraft": f'"{folder}"'}, case.extra)
    parts = [case.level, *(f"{k}={v}".replace('"', "") for k, v in sorted(settings.items()))]
    parts += ["ideal"] * bool(case.extra) + [f"u={case.u:g},w={case.w:g}"] * ((case.u, case.w) != (1.0, 1.0))
    name = "_".join(parts) + ("" if folder == GTM else f"_{folder.name}") + "_quick" * study.quick
    file = study.out / f"{name}.toml"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text, encoding="utf-8")
    plan = planning.make(file)
    if study.quick and runs is None:
        plan = planning.make(file, runs=plan.campaign.runs // QUICK_DIVISOR)
    table = plan.table.assign(
        sigma_u_m_s=case.u * plan.table["sigma_u_m_s"], sigma_w_m_s=case.w * plan.table["sigma_w_m_s"]
    )
    plan = replace(plan, table=table, digest=f"{plan.digest} u {case.u:g} w {case.w:g}")
    flying.fly(plan, study.out / name, study.jobs)
    return study.out / name


def records(folder: Path, case: Case) -> Iterator[Batch]:
    """The logs of a campaign as the case reads them."""
    for path in log_paths(folder):
        for batch in batches(read_log(path)):
            keep = batch.t_s[0] >= case.from_s - 1e-9
            channels = {name: values[:, keep] for name, values in batch.channels.items()}
            if case.lead_s is not None:
                t = np.arange(np.count_nonzero(keep)) * batch.dt_s
                ahead = [np.interp(t + case.lead_s, t, row) for row in channels["elevator_rad"]]
                channels["elevator_command_rad"] = np.array(ahead)
            yield replace(batch, t_s=batch.t_s[:, keep], channels=channels)


def tables_of(study: Study, case: Case, methods: Sequence[str] = ()) -> list[Table]:
    """Fly, identify and evaluate a case: the paper's tables of its level, beside the printed figures."""
    folder = flown(study, case)
    parts = [
        estimates_table(identify_batch(batch, study.gtm.constants, name, case.options))
        for batch in records(folder, case)
        for name in methods or METHODS[case.level]
    ]
    write_table(folder / "estimates.parquet", pd.concat(parts, ignore_index=True))
    campaign = read_campaign(folder)
    return [evaluate(TABLES[name], campaign) for name in PRINTED_COLUMNS[case.level]]


def entry(tables: Sequence[Table], method: str, parameter: str, statistic: str) -> Entry:
    """A figure of the first table that holds it."""
    return next(t.entries[k] for t in tables if (k := (method, parameter, statistic)) in t.entries)


def misfit(tables: Sequence[Table], level: str, only: Sequence[str]) -> tuple[float, float]:
    """Root mean square of z over the six means, and over the six standard deviations, of some columns.

    z is the difference to the printed figure over the combined Monte Carlo standard error: about 1
    where both draw from one distribution.
    """
    result = []
    for statistic in ("mean", "std"):
        z = [
            t.entries[method, parameter, statistic].z
            for t in tables
            for method in PRINTED_COLUMNS[level][t.spec.name]
            if method in only
            for parameter in PARAMETERS
        ]
        result.append(math.sqrt(np.mean(np.square(z))))
    return result[0], result[1]


def shown(e: Entry) -> str:
    """Value ± standard error to two digits of the error; the value alone where it has none."""
    if not math.isfinite(e.se) or e.se <= 0.0:
        return f"{e.value:.4g}"
    digits = max(0, 1 - math.floor(math.log10(e.se)))
    return f"{e.value:.{digits}f} ± {e.se:.{digits}f}"


def line(*cells: str) -> str:
    """A row of a Markdown table."""
    return "| " + " | ".join(cells) + " |"


def header(*cells: str) -> list[str]:
    """Head of a Markdown table."""
    return [line(*cells), "|" + "---|" * len(cells)]


def settings_table(study: Study, cases: Sequence[Case]) -> list[str]:
    """One row per setting: misfit of LS and of the IV methods, and the figures that tell most."""
    level = cases[0].level
    ivs = [m for columns in PRINTED_COLUMNS[level].values() for m in columns if m != "ls"]
    quantities = (
        ("ls", "CLalpha", "mean"),
        ("ls", "CLq", "mean"),
        ("ls", SIX, "relerr_pct"),
        ("iv-f1", "Cmalpha", "mean"),
        ("iv-f1", "Cmalpha", "std"),
        ("iv-f1", "Cmq", "mean"),
        ("iv-f1", SIX, "relerr_pct"),
        ("iv-f1", RUNS, "iterations"),
    )
    heads = (
        "LS CLalpha",
        "LS CLq",
        "LS RelErr %",
        "f1 Cmalpha",
        "its std",
        "f1 Cmq",
        "f1 RelErr %",
        "f1 it.",
    )
    text = header("setting", "z LS: mean, std", "z IV: mean, std", *heads)
    for number, case in enumerate(cases):
        tables = tables_of(study, case)
        if number == 0:
            printed = [entry(tables, *q).published for q in quantities]
            text.append(line("printed", "", "", *(f"{p.value:g}" if p else "" for p in printed)))
        own, others = misfit(tables, level, ["ls"]), misfit(tables, level, ivs)
        text.append(
            line(
                case.label,
                f"{own[0]:.1f}, {own[1]:.1f}",
                f"{others[0]:.1f}, {others[1]:.1f}",
                *(shown(entry(tables, *q)) for q in quantities),
            )
        )
    return text


def comparison_table(study: Study, case: Case) -> list[str]:
    """Every column of the paper beside ours: means, standard deviations, RelErr, its ratio, iterations."""
    text = header("", *PARAMETERS, "RelErr %", "ratio", "iterations")
    for table in tables_of(study, case):
        for method in PRINTED_COLUMNS[case.level][table.spec.name]:
            keys = [(p, "mean") for p in PARAMETERS] + [(SIX, "relerr_pct"), (SIX, "relerr_ratio")]
            found = [table.entries.get((method, *key)) for key in [*keys, (RUNS, "iterations")]]
            stds = [table.entries[method, p, "std"] for p in PARAMETERS]
            count = table.statistics[method].counts
            text.append(
                line(f"{method}, {count.used} of {count.total} runs", *(shown(e) if e else "" for e in found))
            )
            printed = [f"{e.published.value:.4g}" if e and e.published else "" for e in found]
            text.append(line("printed", *printed))
            text.append(line("std", *(shown(e) for e in stds), "", "", ""))
            text.append(
                line("printed", *(f"{e.published.value:g}" if e.published else "" for e in stds), "", "", "")
            )
            worst = [f"{e.z:+.1f}" if e and math.isfinite(e.z) else "" for e in found]
            text.append(line("z of mean", *worst))
    return text


def methods_table(study: Study, cases: Sequence[Case], methods: Sequence[str]) -> list[str]:
    """Means of the six derivatives and RelErr, one row per case and method."""
    text = header("", "method", *PARAMETERS, "RelErr %")
    for case in cases:
        tables = tables_of(study, case)
        for method in methods:
            keys = [(p, "mean") for p in PARAMETERS] + [(SIX, "relerr_pct")]
            text.append(line(case.label, method, *(shown(entry(tables, method, *key)) for key in keys)))
    return text


def breaks_table(study: Study) -> list[str]:
    """Without noise and gusts: the GTM's tables, the planes that touch them at the trim, extra regressors."""
    text = header("aircraft", "doublet", "method", *PARAMETERS)
    for amplitude in ("1.0", "-1.0", "2.0"):
        case = Case("", settings={"amplitude_deg": amplitude}, u=0.0, w=0.0, extra=IDEAL)
        folder = flown(study, case, runs=1)
        truth = read_table(folder / "truth.parquet").iloc[0]
        target = study.out / "aircraft" / "gtm"
        if not target.exists():
            affine_copy(GTM, target, float(truth["trim_alpha_rad"]), float(truth["trim_elevator_rad"]))
        if amplitude == "1.0":
            text.append(line("truth", "", "", *(f"{truth[name]:.4g}" for name in PARAMETERS)))
        for label, where in (("tables", folder), ("affine", flown(study, case, runs=1, folder=target))):
            batch = next(records(where, case))
            for method in ("ls", "iv-lowpass", "iv-f1", "iv-f2"):
                theta = identify_batch(batch, study.gtm.constants, method, case.options).theta[0]
                text.append(line(label, amplitude, method, *(f"{value:.4g}" for value in theta)))
            for extra in (False, True):
                name = "q_dot, both breaks free" if extra else "q_dot, no filter"
                cm = moment_fit(batch, truth, study.gtm, extra)
                text.append(line(label, amplitude, name, "", "", "", *(f"{value:.4g}" for value in cm)))
    return text


def moment_fit(batch: Batch, truth: pd.Series, gtm: Aircraft, breaks: bool) -> Array:
    """Cmalpha, Cmq, Cmde of the first run by least squares on q_dot, without a filter.

    Parameters
    ----------
    batch : a record without noise.
    truth : row of truth.parquet: the dynamic pressure and the airspeed of the trim.
    gtm : the aircraft.
    breaks : whether max(alpha - 6 deg, 0) and max(-de, 0) are regressors too.
    """
    alpha, q, elevator = (batch.channels[n][0] for n in ("alpha_rad", "q_rad_s", "elevator_rad"))
    columns = [alpha, q, elevator, np.ones_like(q)]
    if breaks:
        columns += [np.maximum(alpha - BREAK_ALPHA_RAD, 0.0), np.maximum(-elevator, 0.0)]
    x = np.stack(columns, axis=1)[1:-1]
    rate = (q[2:] - q[:-2]) / (2.0 * batch.dt_s)
    slopes = np.linalg.lstsq(x, rate, rcond=None)[0][:3]
    c = gtm.constants
    moment = float(truth["dynamic_pressure_pa"]) * c.wing_area_m2 * c.chord_m / c.inertia_yy_kg_m2
    half = c.chord_m / (2.0 * float(truth["airspeed_m_s"]))
    return np.asarray(slopes / moment / np.array([1.0, half, 1.0]))


def outputs_table(study: Study) -> list[str]:
    """Peaks of the outputs without noise, to be held against the axes of the paper's figure 4."""
    text = header("doublet", "alpha' - q [deg/s]", "q' [deg/s2]", "az [g]")
    for amplitude in ("1.0", "2.0"):
        case = Case("", settings={"amplitude_deg": amplitude}, u=0.0, w=0.0, extra=IDEAL)
        batch = next(records(flown(study, case, runs=1), case))
        alpha, q = batch.channels["alpha_rad"][0], batch.channels["q_rad_s"][0]
        az = batch.channels["az_m_s2"][0]
        signals = (
            np.gradient(alpha, batch.dt_s) / DEG - q / DEG,
            np.gradient(q, batch.dt_s) / DEG,
            (az - az[0]) / 9.80665,
        )
        text.append(line(f"+-{amplitude} deg", *(f"{s.min():.2f} to {s.max():.2f}" for s in signals)))
    return text


PARTS: Mapping[str, Callable[[Study], list[str]]] = {
    "light": lambda study: comparison_table(study, SETTINGS[0]),
    "moderate": lambda study: comparison_table(study, MODERATE[0]),
    "cropped": lambda study: comparison_table(study, CROPPED),
    "settings-light": lambda study: settings_table(study, SETTINGS),
    "settings-moderate": lambda study: settings_table(study, MODERATE),
    "outputs": outputs_table,
    "lift-bias": lambda study: methods_table(study, CAUSES, ("ls", "iv-f1")),
    "breaks": breaks_table,
    "inputs": lambda study: methods_table(study, LEADS[:1], INPUTS),
    "leads": lambda study: methods_table(study, LEADS[1:], ("iv-reference-regressor",)),
}
"""Tables of docs/paper.md, in its order."""


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=Path("out/paper-study"))
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--quick", action="store_true", help="a tenth of the runs")
    parser.add_argument("--part", choices=PARTS, action="append", help="only this table; may be repeated")
    arguments = parser.parse_args()
    study = Study(arguments.out.resolve(), arguments.jobs, arguments.quick, aircraft.load(GTM))
    for name in arguments.part or PARTS:
        text = "\n".join([f"## {name}", "", *PARTS[name](study), ""])
        (study.out / f"{name}.md").write_text(text, encoding="utf-8")
        print(text, flush=True)


if __name__ == "__main__":
    main()
