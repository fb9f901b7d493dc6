"""Methods beyond the paper's against IV(f1) on the GTM: RMSE of the six derivatives over that of iv-f1.

Light gusts of data/campaigns/light.toml, flown with the GTM's tables and with the affine planes that touch
them at the trim: where a method is beaten with the tables and not with the planes, the break in Cm(alpha)
is why (docs/filter_error.md). Flights are kept under --out.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from closed_loop_study import affine_copy

from airtruth import aircraft
from airtruth.fly import campaign as flying
from airtruth.fly import plan as planning
from airtruth.identify import identify_files
from airtruth.logs.store import read_table
from airtruth.physics.short_period import PARAMETERS
from airtruth.report.tables import FURTHER

ROOT = Path(__file__).resolve().parents[1]
CAMPAIGN = ROOT / "data" / "campaigns" / "light.toml"
GTM = ROOT / "aircraft" / "gtm"


def flown(campaign: Path, out: Path, runs: int) -> Path:
    """The folder of a flown campaign; an interrupted one resumes."""
    flying.fly(planning.make(campaign, None, runs), out, 1, lambda done, total, failed: None)
    return out


def report(title: str, folder: Path) -> None:
    """RMSE of iv-f1, and ratios to it."""
    truth = read_table(folder / "truth.parquet").set_index("run_id")
    names = list(PARAMETERS)
    estimates = identify_files([folder], aircraft.load(GTM), ("iv-f1", *FURTHER))
    print(f"\n{title}, {len(truth)} runs".ljust(34) + "".join(f"{n:>9s}" for n in names))
    reference = np.ones(len(names))
    for method, rows in estimates.groupby("method", sort=False):
        good = rows[rows["converged"]]
        error = good[names].to_numpy() - truth.loc[good["run_id"], names].to_numpy()
        rmse = np.sqrt((error**2).mean(axis=0))
        if method == "iv-f1":
            reference = rmse
            print("iv-f1, RMSE".ljust(33) + "".join(f"{v:9.4f}" for v in rmse))
        else:
            told = f"{method} / iv-f1 ({len(rows) - len(good)} failed)"
            print(told.ljust(33) + "".join(f"{v:9.2f}" for v in rmse / reference))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out/further"))
    parser.add_argument("--runs", type=int, default=300)
    chosen = parser.parse_args()
    chosen.out.mkdir(parents=True, exist_ok=True)
    tables = flown(CAMPAIGN, chosen.out / "tables", chosen.runs)
    at = read_table(tables / "truth.parquet").iloc[0]
    target = (chosen.out / "affine-gtm" / "gtm").resolve()
    if not target.exists():
        target.parent.mkdir(parents=True, exist_ok=True)
        affine_copy(GTM, target, float(at["trim_alpha_rad"]), float(at["trim_elevator_rad"]))
    changed = chosen.out / "affine.toml"
    changed.write_text(CAMPAIGN.read_text().replace('aircraft = "gtm"', f'aircraft = "{target}"'))
    report("GTM's tables", tables)
    report("Affine planes", flown(changed, chosen.out / "affine", chosen.runs))


if __name__ == "__main__":
    main()
