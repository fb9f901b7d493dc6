"""Methods beyond the paper against IV(f1) on the GTM: RMSE of the six derivatives over that of iv-f1.

    python -m studies.further_methods [--out DIR] [--runs N]

Flies data/campaigns/light.toml with the GTM's tables and with the planes that touch them at the trim. A method that
is worse with the tables and not with the planes suffers from the break in Cm(alpha) (docs/filter_error.md). The flights
stay under --out.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Final

import numpy as np

from airtruth import aircraft
from airtruth.identification import identify
from airtruth.logs.store import read_table
from airtruth.physics.motion import LONGITUDINAL
from airtruth.reporting.paper.tables import FURTHER
from airtruth.simulation.campaign import plan as planning
from airtruth.simulation.campaign import run as flying
from studies.affine_aircraft import affine_copy

ROOT: Final = Path(__file__).resolve().parents[1]
"""Root of the repository."""

CAMPAIGN: Final = ROOT / "data" / "campaigns" / "light.toml"
"""Campaign of the study."""

GTM: Final = ROOT / "aircraft" / "gtm"
"""Declared aircraft."""


def flown(campaign: Path, out: Path, runs: int) -> Path:
    """Fly a campaign, or resume it; return its folder."""
    flying.fly(planning.make(campaign, None, runs), out)
    return out


def report(title: str, folder: Path) -> None:
    """Print the RMSE of iv-f1, and the ratios of the other methods to it."""
    truth = read_table(folder / "truth.parquet").set_index("run_id")
    names = list(LONGITUDINAL.parameters)
    estimates = identify(folder, aircraft.load(GTM), ("iv-f1", *FURTHER)).to_frame()
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
            label = f"{method} / iv-f1 ({len(rows) - len(good)} failed)"
            print(label.ljust(33) + "".join(f"{v:9.2f}" for v in rmse / reference))


def main() -> None:
    """Fly both campaigns and print their tables."""
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
