"""The lateral estimators on flights of the GTM's tables in JSBSim: tables as the paper's, coverage, nonlinear terms.

Variants of data/campaigns/lateral.toml are flown: surfaces at 3 deg in light and moderate turbulence, and at 3 to 4 deg in
light turbulence; and data/campaigns/lateral_multisine.toml. The campaign in moderate turbulence has twice the runs of the others,
as in the paper. Every method estimates each run with the measured dynamic pressure, in the first two campaigns with the constant
one as well, and joint sets of four runs, of the multisine of one. The Cramer-Rao bound of a set is that of a linear aircraft
(`studies.lateral_study`); a table divides the errors of filter error by their causes. `airtruth tables` shows the single runs:
files lateral-NAME.* of OUT/tables, in short in OUT/page.md. An interrupted study continues.

    python -m studies.lateral_flights --out DIR [--runs N] [--jobs J] [--single] [--only NAME] [METHOD ...]
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from airtruth.aircraft import Aircraft, load
from airtruth.identification import (
    FILES,
    LATERAL_METHODS,
    Estimates,
    Options,
    identify,
    identify_batch,
    identify_joint,
    write_estimates,
)
from airtruth.identification.lateral.methods import lateral_values
from airtruth.identification.lateral.observation import steady_flight
from airtruth.logs.flight_log import Batch, batches
from airtruth.logs.sources import log_files
from airtruth.logs.store import read_log, read_table
from airtruth.physics.motion import LATERAL
from airtruth.reporting import write_tables
from airtruth.simulation.campaign import plan
from airtruth.simulation.campaign import run as campaign
from airtruth.table import Table, as_markdown, flat
from studies.lateral_study import least_covariance

ROOT = Path(__file__).resolve().parents[1]
CAMPAIGNS = ROOT / "data" / "campaigns"
FLOWN = {
    "light-3": ((3.0, 3.0), "light", 1, 4),
    "moderate-3": ((3.0, 3.0), "moderate", 2, 4),
    "light": ((3.0, 4.0), "light", 1, 4),
    "multisine": (None, "light", 1, 1),
}
"""Name -> least and largest deflection [deg], None for the multisine; level of the turbulence, runs over those asked for, runs of
a joint estimate."""
CONSTANT = ("light-3", "moderate-3")
"""Campaigns that are identified with a constant dynamic pressure as well."""
GUSTS = {"light": 1.0, "moderate": 2.0}
"""Level of the turbulence -> its gusts over the light ones."""
BOUND_RUNS = 8
"""Runs whose mean information makes the bound: they differ by the sign and size of their surfaces alone."""
TERMS = ((), ("beta",), ("alpha",), ("alpha", "beta"))
WITH_TERMS = ("ls", "filter-error")
"""Methods in the table of nonlinear terms."""
WORST = ("Clbeta", "Clr", "Cldr", "Cnp")
"""Derivatives in that table: those with the largest bias."""
SCORED = [LATERAL.index(name) for name in LATERAL.scored]


def fly(name: str, out: Path, runs: int, jobs: int) -> Path:
    """Fly a campaign into OUT/NAME; return its folder."""
    deflections, level, share, _ = FLOWN[name]
    file = CAMPAIGNS / ("lateral_multisine.toml" if deflections is None else "lateral.toml")
    text = file.read_text(encoding="utf-8")
    if deflections is not None:
        low, high = deflections
        text = re.sub(
            r"\{ low = 3.0, high = 4.0 \}",
            f"{{ low = {low}, high = {high} }}" if low < high else f"{low}",
            text,
        )
        text = re.sub(
            r"\{ low = -4.0, high = -3.0 \}",
            f"{{ low = {-high}, high = {-low} }}" if low < high else f"{-low}",
            text,
        )
    text = re.sub(r'(?m)^name = "\w+"$', f'name = "{name}"', text).replace(
        'level = "light"', f'level = "{level}"'
    )
    out.mkdir(parents=True, exist_ok=True)
    file = out / f"{name}.toml"
    file.write_text(text, encoding="utf-8")
    campaign.fly(plan.make(file, runs=share * runs), out / name, jobs)
    return out / name


def estimate(folder: Path, gtm: Aircraft, methods: Sequence[str]) -> list[Path]:
    """Write the estimates of a campaign; return the folders that `airtruth tables` reads, that of the constant pressure last."""
    made = [folder]
    if folder.name in CONSTANT:
        other = folder.with_name(f"{folder.name}-constant")
        other.mkdir(exist_ok=True)
        shutil.copy(folder / "truth.parquet", other)
        stated = json.loads((folder / "campaign.json").read_text(encoding="utf-8"))
        stated |= {"name": other.name, "title": f"{stated['title']}, constant dynamic pressure"}
        (other / "campaign.json").write_text(json.dumps(stated), encoding="utf-8")
        made.append(other)
    for target, options in zip(made, (Options(), Options(pressure="constant")), strict=False):
        result = identify(folder, gtm, methods, options, motion=LATERAL)
        write_estimates(target / FILES[LATERAL.name], result, force=True)
    return made


def records(folder: Path) -> list[Batch]:
    """The runs of a campaign, one batch each."""
    own = [batch for file in log_files(folder) for batch in batches(read_log(file))]
    return [
        Batch((run,), b.dt_s, b.t_s[k : k + 1], {name: x[k : k + 1] for name, x in b.channels.items()})
        for b in own
        for k, run in enumerate(b.run_ids)
    ]


def errors(made: Sequence[Estimates], truth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Errors (estimates, 15) [% of the truth] of converged estimates, and whether their 95 % intervals hold the truth."""
    theta = np.concatenate([e.theta[e.converged] for e in made])
    covariance = np.concatenate([e.covariance[e.converged] for e in made])
    std = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    off = theta - truth
    return 100.0 * off / np.abs(truth), np.abs(off) <= 1.96 * std


def joint(
    own: Sequence[Batch], gtm: Aircraft, method: str, options: Options, size: int
) -> Iterator[Estimates]:
    """Estimates of sets of runs."""
    for first in range(0, len(own) - size + 1, size):
        yield identify_joint(own[first : first + size], gtm, method, options, LATERAL)


def least_deviations(own: Sequence[Batch], gtm: Aircraft, truth: np.ndarray, level: float) -> np.ndarray:
    """(15,) Cramer-Rao bound from one run, by the mean information of a few [% of the truth]."""
    values = lateral_values(gtm)
    information = [np.linalg.inv(least_covariance(one, values, truth, level)) for one in own[:BOUND_RUNS]]
    return 100.0 * np.sqrt(np.diag(np.linalg.inv(np.mean(information, axis=0)))) / np.abs(truth)


def joint_table(
    name: str, own: Sequence[Batch], gtm: Aircraft, truth: np.ndarray, methods: Sequence[str]
) -> Table:
    """RMSE of joint estimates [% of the truth], over the bound, coverage of single runs and of joint sets."""
    rows = []
    size = FLOWN[name][-1]
    least = least_deviations(own, gtm, truth, GUSTS[FLOWN[name][1]]) / np.sqrt(size)
    for method in methods:
        for options in (Options(), Options(terms=("alpha", "beta"))):
            single = errors([identify_batch(one, gtm, method, options, LATERAL) for one in own], truth)[1]
            error, hits = errors(list(joint(own, gtm, method, options, size)), truth)
            rmse = np.sqrt((error**2).mean(axis=0))
            label = f"{method}{', terms' if options.terms else ''}"
            shares = [f"{np.exp(np.log(rmse / least).mean()):.2f}"]
            shares += [f"{100.0 * x.mean():.0f}" for x in (single, hits)]
            rows.append((label, *(f"{rmse[j]:.1f}" for j in SCORED), *shares))
    columns = (
        "method",
        *LATERAL.scored,
        "over the bound",
        "coverage, single [%]",
        f"coverage, {size} runs [%]",
    )
    return flat(f"{name}: RMSE of joint estimates of {size} runs [%]", columns, rows)


def causes_table(
    name: str, own: Sequence[Batch], gtm: Aircraft, truth: np.ndarray, attack_rad: float
) -> Table:
    """Errors of joint estimates by filter error over the bound, and what the steady angle of attack explains of them.

    The deviation that the estimator states is the bound of its own model: with the terms of unknown size, the noise of the
    moments and the unknown angle.

    Parameters
    ----------
    attack_rad : angle of attack of the trim, at which the truth holds.
    """
    size = FLOWN[name][-1]
    made = list(joint(own, gtm, "filter-error", Options(), size))
    least = least_deviations(own, gtm, truth, GUSTS[FLOWN[name][1]]) / np.sqrt(size)
    error = errors(made, truth)[0] / least
    variance = np.mean([np.diagonal(e.covariance[0]) for e in made if e.converged[0]], axis=0)
    stated = 100.0 * np.sqrt(variance) / np.abs(truth) / least
    found = np.degrees(
        [
            (
                steady_flight(one, Options()).attack[0] - attack_rad,
                one.channels["alpha_rad"].mean() - attack_rad,
            )
            for one in own[: len(error) * size]
        ]
    )
    off, whole = found.reshape(-1, size, 2).mean(axis=1).T
    bias, spread = error.mean(axis=0), error.std(axis=0, ddof=1)
    share = np.array([np.corrcoef(off, column)[0, 1] for column in error.T])
    rest = spread * np.sqrt(1.0 - share**2)
    total = np.sqrt((error**2).mean(axis=0))
    columns = (total, bias, spread, rest, np.hypot(bias, rest), stated, total / stated)
    every = (
        "error",
        "bias",
        "deviation",
        "deviation at the known angle",
        "error at the known angle",
        "stated deviation",
        "error over it",
    )
    rows = [
        (parameter, *(f"{column[j]:.1f}" for column in columns))
        for j, parameter in enumerate(LATERAL.parameters)
    ]
    means = (f"{np.exp(np.log(np.abs(column)).mean()):.2f}" for column in columns)
    return flat(
        f"{name}: filter error, {len(error)} estimates of {size} runs, over the bound; steady angle of attack off by "
        f"{off.mean():.3f} deg, deviation {off.std(ddof=1):.3f} deg; mean of the "
        f"records {whole.mean():.3f}, {whole.std(ddof=1):.3f} deg",
        ("derivative", *every),
        [*rows, ("geometric mean", *means)],
    )


def terms_table(name: str, own: Sequence[Batch], gtm: Aircraft, truth: np.ndarray) -> Table:
    """Bias and standard deviation of single runs [% of the truth] with nonlinear terms."""
    rows = []
    for method in WITH_TERMS:
        for terms in TERMS:
            made = [identify_batch(one, gtm, method, Options(terms=terms), LATERAL) for one in own]
            error, hits = errors(made, truth)
            chosen = error[:, [LATERAL.index(n) for n in WORST]]
            cells = [
                f"{b:.1f} ({s:.1f})"
                for b, s in zip(chosen.mean(axis=0), chosen.std(axis=0, ddof=1), strict=True)
            ]
            rows.append((method, " and ".join(terms) or "none", *cells, f"{100.0 * hits.mean():.1f}"))
    return flat(
        f"{name}: bias (standard deviation) of single runs [%]",
        ("method", "terms", *WORST, "coverage [%]"),
        rows,
    )


def page(tables: Path, names: Sequence[str]) -> str:
    """The tables of docs/lateral_tables.md: RelErr, RMSE and coverage of each campaign, then its means and deviations.

    Parameters
    ----------
    tables : folder of the tables that `airtruth tables` writes.
    names : of the campaigns.
    """
    rows, methods, parts = [], [], []
    for name in names:
        own = pd.read_csv(tables / f"lateral-{name}.csv").set_index(["statistic", "parameter"])
        truth = own.loc["true", "value"]
        every = (
            own[own["method"] != "truth"]
            .reset_index()
            .set_index(["method", "statistic", "parameter"])["value"]
        )
        methods = list(dict.fromkeys(every.index.get_level_values(0)))
        each = {
            "RelErr": [f"{every[m, 'relerr_pct', 'twelve']:.2f}" for m in methods],
            "RMSE": [
                f"{100.0 * np.exp(np.mean([np.log(every[m, 'rmse', p] / abs(truth[p])) for p in LATERAL.scored])):.1f}"
                for m in methods
            ],
            "coverage": [
                f"{np.mean([every[m, 'coverage_pct', p] for p in LATERAL.parameters]):.0f}" for m in methods
            ],
        }
        rows += [(name, figure, *cells) for figure, cells in each.items()]
        text = (tables / f"lateral-{name}.md").read_text(encoding="utf-8")
        kept = [
            line
            for line in text.partition("| **Root mean square error")[0].splitlines()
            if "&emsp;" not in line
        ]
        parts.append("\n".join(kept))
    head = flat(
        "RelErr and RMSE of twelve derivatives, coverage of fifteen [%]",
        ("campaign", "figure", *methods),
        rows,
    )
    return "\n\n".join([as_markdown(head), *parts]) + "\n"


def main() -> None:
    """Fly, estimate, print and write the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--runs", type=int, default=40)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--single", action="store_true", help="the tables of single runs alone")
    parser.add_argument("--only", choices=tuple(FLOWN), help="one campaign")
    parser.add_argument("methods", nargs="*", default=list(LATERAL_METHODS))
    asked = parser.parse_args()
    gtm = load(ROOT / "aircraft" / "gtm")
    folders: list[Path] = []
    for name in (asked.only,) if asked.only else CONSTANT if asked.single else FLOWN:
        folder = fly(name, asked.out, asked.runs, asked.jobs)
        folders += estimate(folder, gtm, asked.methods)
        if asked.single:
            continue
        truth = read_table(folder / "truth.parquet")[list(LATERAL.parameters)].iloc[0].to_numpy()
        own = records(folder)
        chosen = [m for m in asked.methods if m != "output-error"]
        print(as_markdown(joint_table(name, own, gtm, truth, chosen)), flush=True)
        if FLOWN[name][-1] > 1 and "filter-error" in chosen:
            attack = float(read_table(folder / "truth.parquet")["trim_alpha_rad"].iloc[0])
            print(as_markdown(causes_table(name, own, gtm, truth, attack)), flush=True)
        if name.startswith("light"):
            print(as_markdown(terms_table(name, own, gtm, truth)), flush=True)
    print(write_tables(folders, asked.out / "tables").text)
    (asked.out / "page.md").write_text(
        page(asked.out / "tables", [f.name for f in folders]), encoding="utf-8"
    )


if __name__ == "__main__":
    main()
