"""What reproduces the paper's Tables 1-3, and what does not: each cause switched off and on.

    python -m studies.paper_study [--out DIR] [--jobs N] [--quick] [--part NAME ...]

Flies variants of data/campaigns/light-fit.toml and moderate-fit.toml, identifies them, and prints the tables of
docs/paper.md, each number with its Monte Carlo standard error. The flights stay under --out; an interrupted study
resumes there, and a second one only identifies.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from airtruth import aircraft
from airtruth.aircraft import Aircraft
from airtruth.identification import estimates_table, identify_batch
from airtruth.logs.flight_log import Batch
from airtruth.logs.store import read_table, write_table
from airtruth.physics.motion import LONGITUDINAL
from airtruth.reporting.campaign import read_campaign
from airtruth.reporting.paper.comparison import RUNS, together
from airtruth.reporting.paper.tables import TABLES, Entry, PaperTable, evaluate
from airtruth.table import Row, Table, as_markdown, flat
from airtruth.units import DEG, G0
from studies.affine_aircraft import affine_copy
from studies.paper_cases import (
    CAUSES,
    CROPPED,
    FAST,
    GTM,
    IDEAL,
    LEADS,
    MODERATE,
    SETTINGS,
    SEVERE,
    Case,
    Study,
    flown,
    records,
)

Array = NDArray[np.float64]

PRINTED_COLUMNS: Final[Mapping[str, Mapping[str, tuple[str, ...]]]] = {
    "light": {
        "table1": ("ls", "iv-lowpass", "iv-reference-regressor", "iv-actuator-regressor"),
        "table2": ("iv-f1", "iv-f2"),
    },
    "moderate": {"table3": ("ls", "iv-lowpass", "iv-f1", "iv-f2")},
}
"""Level -> table -> methods whose columns the paper prints, each once."""

SIX: Final = together(LONGITUDINAL)
"""Name in place of a parameter for statistics of all six derivatives together."""

METHODS: Final = {
    "light": (*PRINTED_COLUMNS["light"]["table1"], "iv-reference", "iv-actuator", "iv-f1", "iv-f2"),
    "moderate": PRINTED_COLUMNS["moderate"]["table3"],
}
"""Level -> methods that the study applies."""

INPUTS: Final = ("iv-reference", "iv-reference-regressor", "iv-actuator", "iv-actuator-regressor")
"""Methods that differ in the input of the auxiliary model."""

LEVELS_COMPARED: Final = ("ls", "iv-lowpass", "iv-f1", "iv-f2", "iv-kalman", "frequency", "iv-frequency")
"""Methods of the comparison of levels of turbulence."""

BREAK_ALPHA_RAD: Final = 6.0 * DEG
"""Angle of attack of the break in the GTM's Cm(alpha) [rad] (aircraft/gtm/README.md)."""


def tables_of(study: Study, case: Case, methods: Sequence[str] = ()) -> list[PaperTable]:
    """Fly, identify and evaluate a case; return the paper's tables of its level."""
    folder = flown(study, case)
    parts = [
        estimates_table(identify_batch(batch, study.gtm.constants, name, case.options))
        for batch in records(folder, case)
        for name in methods or METHODS[case.level]
    ]
    write_table(folder / "estimates.parquet", pd.concat(parts, ignore_index=True))
    campaign = read_campaign(folder)
    return [evaluate(TABLES[name], campaign) for name in PRINTED_COLUMNS[case.level]]


def entry(tables: Sequence[PaperTable], method: str, parameter: str, statistic: str) -> Entry:
    """Return a number of the first table that has it."""
    return next(t.entries[k] for t in tables if (k := (method, parameter, statistic)) in t.entries)


def misfit(tables: Sequence[PaperTable], level: str, only: Sequence[str]) -> tuple[float, float]:
    """Return the root mean square of z over the six means and over the six standard deviations of some columns.

    z is the difference from the published number over the combined Monte Carlo standard error [-]; it is about 1
    if both samples have the same distribution.
    """
    result = []
    for statistic in ("mean", "std"):
        z = [
            t.entries[method, parameter, statistic].z
            for t in tables
            for method in PRINTED_COLUMNS[level][t.spec.name]
            if method in only
            for parameter in LONGITUDINAL.parameters
        ]
        result.append(math.sqrt(np.mean(np.square(z))))
    return result[0], result[1]


def shown(e: Entry) -> str:
    """Return value ± standard error with two digits of the error; the value alone where there is no error."""
    if not math.isfinite(e.se) or e.se <= 0.0:
        return f"{e.value:.4g}"
    digits = max(0, 1 - math.floor(math.log10(e.se)))
    return f"{e.value:.{digits}f} ± {e.se:.{digits}f}"


def settings_table(study: Study, cases: Sequence[Case]) -> Table:
    """One row per setting: misfit of LS and of the IV methods, and the numbers that change most."""
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
    columns = ("setting", "z LS: mean, std", "z IV: mean, std", *heads)
    rows: list[Row] = []
    for number, case in enumerate(cases):
        tables = tables_of(study, case)
        if number == 0:
            printed = [entry(tables, *q).published for q in quantities]
            rows.append(("printed", "", "", *(f"{p.value:g}" if p else "" for p in printed)))
        own, others = misfit(tables, level, ["ls"]), misfit(tables, level, ivs)
        rows.append(
            (
                case.label,
                f"{own[0]:.1f}, {own[1]:.1f}",
                f"{others[0]:.1f}, {others[1]:.1f}",
                *(shown(entry(tables, *q)) for q in quantities),
            )
        )
    return flat("Settings: rms of z, and the numbers that change most", columns, rows)


def comparison_table(study: Study, case: Case) -> Table:
    """Every column of the paper beside ours: means, standard deviations, RelErr, its ratio and iterations."""
    columns = ("", *LONGITUDINAL.parameters, "RelErr %", "ratio", "iterations")
    rows: list[Row] = []
    for table in tables_of(study, case):
        for method in PRINTED_COLUMNS[case.level][table.spec.name]:
            keys = [(p, "mean") for p in LONGITUDINAL.parameters] + [
                (SIX, "relerr_pct"),
                (SIX, "relerr_ratio"),
            ]
            found = [table.entries.get((method, *key)) for key in [*keys, (RUNS, "iterations")]]
            stds = [table.entries[method, p, "std"] for p in LONGITUDINAL.parameters]
            count = table.statistics[method].counts
            rows.append(
                (f"{method}, {count.used} of {count.total} runs", *(shown(e) if e else "" for e in found))
            )
            printed = [f"{e.published.value:.4g}" if e and e.published else "" for e in found]
            rows.append(("printed", *printed))
            rows.append(("std", *(shown(e) for e in stds), "", "", ""))
            rows.append(
                ("printed", *(f"{e.published.value:g}" if e.published else "" for e in stds), "", "", "")
            )
            worst = [f"{e.z:+.1f}" if e and math.isfinite(e.z) else "" for e in found]
            rows.append(("z of mean", *worst))
    return flat("Means, standard deviations and iterations beside the paper's", columns, rows)


def methods_table(study: Study, cases: Sequence[Case], methods: Sequence[str]) -> Table:
    """Means of the six derivatives and RelErr, one row per case and method."""
    columns = ("", "method", *LONGITUDINAL.parameters, "RelErr %")
    rows: list[Row] = []
    for case in cases:
        tables = tables_of(study, case)
        for method in methods:
            keys = [(p, "mean") for p in LONGITUDINAL.parameters] + [(SIX, "relerr_pct")]
            rows.append((case.label, method, *(shown(entry(tables, method, *key)) for key in keys)))
    return flat("Means by case and method", columns, rows)


def further_table(study: Study) -> Table:
    """Runs used, means, standard deviations and RelErr of methods beside the paper's, at three levels of turbulence."""
    columns = ("turbulence", "method", "runs", *LONGITUDINAL.parameters, "RelErr %")
    rows: list[Row] = []
    for case in (SETTINGS[0], MODERATE[0], SEVERE):
        tables = tables_of(study, case, LEVELS_COMPARED)
        level = SEVERE.label if case is SEVERE else case.level
        for method in LEVELS_COMPARED:
            table = next(t for t in tables if method in t.statistics)
            count = table.statistics[method].counts
            means = [table.entries[method, p, "mean"] for p in LONGITUDINAL.parameters]
            relative = table.entries[method, SIX, "relerr_pct"]
            used = f"{count.used} of {count.total}"
            rows.append((level, method, used, *(shown(e) for e in (*means, relative))))
            stds = [table.entries[method, p, "std"] for p in LONGITUDINAL.parameters]
            rows.append(("", "", "std", *(shown(e) for e in stds), ""))
    return flat("Light, moderate and severe turbulence", columns, rows)


def breaks_table(study: Study) -> Table:
    """Without noise and gusts: the GTM's tables, the planes that touch them at the trim, and further regressors."""
    columns = ("aircraft", "doublet", "method", *LONGITUDINAL.parameters)
    rows: list[Row] = []
    for amplitude in ("1.0", "-1.0", "2.0"):
        case = Case("", settings={"amplitude_deg": amplitude}, u=0.0, w=0.0, extra=IDEAL)
        folder = flown(study, case, runs=1)
        truth = read_table(folder / "truth.parquet").iloc[0]
        target = study.out / "aircraft" / "gtm"
        if not target.exists():
            affine_copy(GTM, target, float(truth["trim_alpha_rad"]), float(truth["trim_elevator_rad"]))
        if amplitude == "1.0":
            rows.append(("truth", "", "", *(f"{truth[name]:.4g}" for name in LONGITUDINAL.parameters)))
        for label, where in (("tables", folder), ("affine", flown(study, case, runs=1, folder=target))):
            batch = next(records(where, case))
            for method in ("ls", "iv-lowpass", "iv-f1", "iv-f2"):
                theta = identify_batch(batch, study.gtm.constants, method, case.options).theta[0]
                rows.append((label, amplitude, method, *(f"{value:.4g}" for value in theta)))
            for extra in (False, True):
                name = "q_dot, both breaks free" if extra else "q_dot, no filter"
                cm = moment_fit(batch, truth, study.gtm, extra)
                rows.append((label, amplitude, name, "", "", "", *(f"{value:.4g}" for value in cm)))
    return flat(
        "Derivatives without noise and gusts: tables, affine planes, and further regressors", columns, rows
    )


def moment_fit(batch: Batch, truth: pd.Series, gtm: Aircraft, breaks: bool) -> Array:
    """Return Cmalpha, Cmq and Cmde of the first run by least squares on q_dot, without a filter.

    Parameters
    ----------
    batch : a record without noise.
    truth : row of truth.parquet, with the dynamic pressure [Pa] and the airspeed [m/s] of the trim.
    gtm : the aircraft.
    breaks : whether max(alpha - 6 deg, 0) and max(-de, 0) are further regressors.
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


def outputs_table(study: Study) -> Table:
    """Ranges of the outputs without noise, for comparison with the axes of the paper's Fig. 4."""
    columns = ("doublet", "alpha' - q [deg/s]", "q' [deg/s2]", "az [g]")
    rows: list[Row] = []
    for amplitude in ("1.0", "2.0"):
        case = Case("", settings={"amplitude_deg": amplitude}, u=0.0, w=0.0, extra=IDEAL)
        batch = next(records(flown(study, case, runs=1), case))
        alpha, q = batch.channels["alpha_rad"][0], batch.channels["q_rad_s"][0]
        az = batch.channels["az_m_s2"][0]
        signals = (
            np.gradient(alpha, batch.dt_s) / DEG - q / DEG,
            np.gradient(q, batch.dt_s) / DEG,
            (az - az[0]) / G0,
        )
        rows.append((f"+-{amplitude} deg", *(f"{s.min():.2f} to {s.max():.2f}" for s in signals)))
    return flat("Ranges of the outputs without noise", columns, rows)


PARTS: Final[Mapping[str, Callable[[Study], Table]]] = {
    "light": lambda study: comparison_table(study, SETTINGS[0]),
    "moderate": lambda study: comparison_table(study, MODERATE[0]),
    "cropped": lambda study: comparison_table(study, CROPPED),
    "settings-light": lambda study: settings_table(study, SETTINGS),
    "settings-moderate": lambda study: settings_table(study, MODERATE),
    "outputs": outputs_table,
    "lift-bias": lambda study: methods_table(study, CAUSES, ("ls", "iv-f1")),
    "breaks": breaks_table,
    "inputs": lambda study: methods_table(study, LEADS[:1], INPUTS),
    "rate": lambda study: methods_table(study, FAST, ("iv-lowpass", *INPUTS)),
    "levels": further_table,
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
        text = f"## {name}\n\n{as_markdown(PARTS[name](study))}\n"
        (study.out / f"{name}.md").write_text(text, encoding="utf-8")
        print(text, flush=True)


if __name__ == "__main__":
    main()
