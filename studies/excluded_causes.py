"""How often `airtruth check` excludes the true error of a sensor.

Flies the trial of `data/undeclared/b.parquet`, a vane 1.6 m ahead of its declared location in light turbulence, with fresh seeds:
manoeuvres, noise, gusts and the errors of the declared derivatives differ. The check sees all six records, and the four that a
trace would fit. It has excluded the cause if no possible set of errors contains it or an error that moves alpha alike; by its
level `EQUAL`, noise alone should do so in 0.5 % of the flights for each set that is compared with it.

    python -m studies.excluded_causes [--flights N] [--seed S]
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from scipy.stats import beta

from airtruth import aircraft as planes
from airtruth.aircraft import Aircraft
from airtruth.checks.kinematics import check_kinematics
from airtruth.checks.kinematics_model import LONGITUDINAL
from airtruth.checks.kinematics_record import declared_biases, declared_errors
from airtruth.checks.kinematics_search import EQUAL
from airtruth.checks.result import CheckResult
from airtruth.logs.flight_log import FlightLog
from validation.blind import draw
from validation.blind.draw import Trial
from validation.blind.truths import Added

CAUSE: Final = "vane_arm"
"""The true error."""
ARM_M: Final = 1.6
"""Its size [m]; that of `data/undeclared/b.parquet`."""
FLIGHTS: Final = 20
"""Number of flights [-]."""
SEED: Final = 900
"""First seed [-]; no trial of the validation has one of these."""
WORDS: Final = ("possible", "one that moves alpha alike is possible", "excluded")
"""Outcomes for the true error."""


def trial(seed: int) -> Trial:
    """Return the trial of one seed."""
    drawn = draw.draw(seed, 0, "null")
    return replace(
        drawn, composition="single", air="light", effects=(Added(CAUSE, {"x_m": ARM_M}),), duration_s=6.0
    )


def checked(log: FlightLog, aircraft: Aircraft, runs: Sequence[str]) -> CheckResult:
    """Check some runs of a log."""
    return check_kinematics(
        log.select(list(runs)),
        declared_errors(aircraft, LONGITUDINAL),
        aircraft.chord_m,
        declared_biases(aircraft, LONGITUDINAL),
    )


def outcome(result: CheckResult) -> str:
    """One of `WORDS`."""
    alike = {name for pair in LONGITUDINAL.same if CAUSE in pair for name in pair}
    names = {f.name for c in result.possible for f in c.errors}
    return WORDS[0] if CAUSE in names else WORDS[1] if names & alike else WORDS[2]


def main() -> None:
    """Fly, check and print one row for each flight, and the totals."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--flights", type=int, default=FLIGHTS)
    parser.add_argument("--seed", type=int, default=SEED)
    arguments = parser.parse_args()
    gtm = planes.load("gtm")
    counts: dict[str, Counter[str]] = {"six records": Counter(), "four records": Counter()}
    for seed in range(arguments.seed, arguments.seed + arguments.flights):
        log = draw.fly(trial(seed))
        fitted = [run_id for k, run_id in enumerate(log.run_ids) if k % 3 != 2]
        row = []
        for words, runs in (("six records", log.run_ids), ("four records", fitted)):
            result = checked(log, gtm, runs)
            counts[words][outcome(result)] += 1
            possible = " | ".join(c.name for c in result.possible)
            own = next((c for c in result.causes if c.name == CAUSE), None)
            distance = "not compared" if own is None else f"distance {own.distance:.1f}"
            row.append(f"{words}: {outcome(result)} ({distance}; possible: {possible})")
        print(f"seed {seed}  " + "\n          ".join(row), flush=True)
    for words, count in counts.items():
        k, n = count[WORDS[2]], arguments.flights
        upper = float(beta.ppf(0.975, k + 1, n - k)) if k < n else 1.0
        print(
            f"{words}: "
            + ", ".join(f"{count[w]} {w}" for w in WORDS)
            + f"; excluded in at most {100 * upper:.0f} % (95 %)"
        )
    print(f"level of the check for each set: {100 * EQUAL:g} %")


if __name__ == "__main__":
    main()
