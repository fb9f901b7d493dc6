"""Aircraft of the JSBSim package in six axes: surveyed, and flown with doublets of aileron and rudder in light turbulence.
Prints the lateral table of docs/foreign_aircraft.md. Folders are kept: a second call surveys and flies what is missing.

    python -m studies.foreign_lateral --out out/lateral-fleet [--aircraft NAME...]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import pandas as pd

from airtruth.errors import AirtruthError
from airtruth.logs.store import read_log, read_table
from airtruth.simulation.campaign import plan
from airtruth.simulation.campaign import run as campaign
from airtruth.simulation.foreign_aircraft import LATERAL_CAMPAIGN, REPORT, new_from_jsbsim
from airtruth.units import DEG
from studies.foreign_fleet import AIRCRAFT

COLUMNS = (
    ("sideslip, aileron, rudder of the trim [deg]", ("trim_beta_rad", "trim_aileron_rad", "trim_rudder_rad")),
    ("Dutch roll [rad/s], damping", ("dutch_roll_wn_rad_s", "dutch_roll_zeta")),
    ("roll, spiral [1/s]", ("roll_1_s", "spiral_1_s")),
)
RANGES = ("beta_rad", "phi_rad", "aileron_rad", "rudder_rad")
MOVES = "sideslip, bank, aileron and rudder move by [deg]"


def row(name: str, out: Path) -> str:
    """Survey and fly one aircraft unless that was done; its line of the table."""
    folder, logs = out / "aircraft" / name, out / "flights" / name
    if not folder.exists():
        folder.parent.mkdir(parents=True, exist_ok=True)
        new_from_jsbsim(name, folder)
    if not (folder / LATERAL_CAMPAIGN).exists():
        report = (folder / REPORT).read_text().splitlines()
        return f"| {name} | {next((x.strip() for x in report if 'six axes' in x or 'lateral' in x), 'not found')} |"
    flown = campaign.fly(plan.make(folder / LATERAL_CAMPAIGN), logs)
    if flown.failures:
        return f"| {name} | {flown.failures[0].reason} |"
    truth: pd.DataFrame = read_table(logs / "truth.parquet")
    first = truth.iloc[0]
    channels = [read_log(path).channels for path in sorted((logs / "logs").glob("*.parquet"))]
    ranges = [max(float(np.ptp(c[n])) for c in channels) / DEG for n in RANGES]
    cells = [", ".join(shown(name, float(first[name])) for name in names) for _, names in COLUMNS]
    return f"| {' | '.join([name, *cells, ', '.join(f'{x:.1f}' for x in ranges)])} |"


def shown(name: str, value: float) -> str:
    """A value of truth.parquet in the table; angles in degrees."""
    if name.endswith("_rad"):
        return f"{round(value / DEG, 2) + 0.0:.2f}"
    return f"{value:.3g}"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--aircraft", nargs="+", default=AIRCRAFT)
    options = parser.parse_args()
    print("| aircraft | " + " | ".join((*(title for title, _ in COLUMNS), MOVES)) + " |")
    print("|---" * (2 + len(COLUMNS)) + "|")
    for name in options.aircraft:
        try:
            print(row(name, options.out), flush=True)
        except AirtruthError as error:
            print(f"| {name} | {error} |", flush=True)


if __name__ == "__main__":
    main()
