"""Blind trials of faults in readings that the modes of `validation.blind` do not draw.

    python -m validation.reading_faults --seed 1 --trials 30 --jobs 2 --out out/reading-faults

A trial is a null trial of `validation.blind`, flown by the same independent truth. Its log then has one fault, drawn from the
seed: the airspeed follows the angle of attack about the trim (1/rad: 0.2 to 0.8, either sign), the surface is recorded late by
one to three samples, or the gyro of one fitted record alone is late by two to four samples. The tracer sees the log and the
declared aircraft. The files of a trial appear whole, so that an interrupted run resumes.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from airtruth.logs.flight_log import FlightLog
from airtruth.logs.store import read_log, write_log, write_text
from validation.blind import tracing
from validation.blind.draw import draw
from validation.blind.figures import ALPHA_TRIM_RAD
from validation.blind.scoring import Share
from validation.blind.trials import Plan, flown_apart

Array = NDArray[np.float64]

KINDS: Final = ("airspeed", "surface", "record")
_STREAM: Final = 900
_FITTED: Final = (0, 1, 3, 4)  # every third record is held out
NAMES: Final = {"airspeed": "airspeed_alpha_slope", "surface": "sensor_delay:elevator_rad"}


@dataclass(frozen=True)
class Fault:
    """One fault: its kind of `KINDS`, its size [1/rad or s], and the number of its record, -1 for all."""

    kind: str
    size: float
    record: int = -1


def drawn(seed: int, number: int) -> Fault:
    """The fault of a trial."""
    rng = np.random.default_rng([seed, number, _STREAM])
    kind = KINDS[number % len(KINDS)]
    if kind == "airspeed":
        return Fault(kind, float(rng.uniform(0.2, 0.8) * rng.choice([-1.0, 1.0])))
    samples = int(rng.integers(1, 4)) if kind == "surface" else int(rng.integers(2, 5))
    return Fault(kind, 0.02 * samples, int(rng.choice(_FITTED)) if kind == "record" else -1)


def with_fault(log: FlightLog, fault: Fault) -> FlightLog:
    """The log with a fault; late channels keep their first sample."""
    channels = {name: values.copy() for name, values in log.channels.items()}
    if fault.kind == "airspeed":
        channels["airspeed_m_s"] *= 1.0 + fault.size * (channels["alpha_rad"] - ALPHA_TRIM_RAD)
        return replace(log, channels=channels)
    name = "elevator_rad" if fault.kind == "surface" else "q_rad_s"
    for run in range(len(log.run_ids)) if fault.record < 0 else [fault.record]:
        rows = log.rows(run)
        late = round(fault.size / float(np.diff(log.t_s[rows]).mean()))
        values = log.channels[name][rows]
        channels[name][rows] = np.concatenate([np.full(late, values[0]), values[: len(values) - late]])
    return replace(log, channels=channels)


def answered(plan: Plan, number: int) -> dict[str, Any]:
    """Fly, damage and trace one trial; what the tracer answers."""
    file = plan.file("answer", number)
    if not file.exists():
        folder = plan.log(number)
        (flown,) = flown_apart([draw(plan.seed, number, "null")], [folder])
        clean = flown / "log.parquet"
        write_log(folder / "readings.parquet", with_fault(read_log(clean), drawn(plan.seed, number)))
        write_text(file, json.dumps(tracing.call(plan.tracer, folder / "readings.parquet")))
    return dict(json.loads(file.read_text()))


@dataclass(frozen=True)
class Outcome:
    """How one fault was answered: named first, reported, its size in the 95 % interval, and a wrong name without reservation.

    For a fault of one record, the record is named instead, and there is no size.
    """

    first: bool
    reported: bool
    inside: bool | None
    wrong: bool


def outcome(fault: Fault, answer: dict[str, Any]) -> Outcome:
    """Score one answer; a fault of one record is no effect of the aircraft, so that each name without reservation is wrong."""
    keys = [_key(e) for e in answer["effects"]]
    sure = bool(keys) and not answer["provisional"]
    if fault.kind == "record":
        odd = answer["records"]["fitted"][_FITTED.index(fault.record)]
        named = any(f"without {odd} the others agree" in note for note in answer["notes"])
        flagged = answer["verdict"] == "unexplained" or (bool(keys) and not sure)
        return Outcome(named, flagged, None, sure)
    name = NAMES[fault.kind]
    alike = {other for e in answer["effects"] for other in e["indistinguishable_from"]}
    inside = None
    if name in keys:
        own = answer["effects"][keys.index(name)]
        low, high = next(iter(own["parameters"].values()))["ci95"]
        inside = (low is None or low <= fault.size) and (high is None or fault.size <= high)
    reported = name in keys or name.partition(":")[0] in alike
    return Outcome(keys == [name], reported, inside, sure and not reported)


def _key(effect: dict[str, Any]) -> str:
    return f"{effect['name']}:{effect['channel']}" if effect.get("channel") else str(effect["name"])


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the trials and print the scores."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--trials", type=int, required=True)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("out/reading-faults"))
    stated = parser.parse_args(arguments)
    plan = Plan(stated.trials, stated.seed, "readings", stated.out)
    plan.file("answer", 0).parent.mkdir(parents=True, exist_ok=True)
    results: dict[str, list[Outcome]] = {kind: [] for kind in KINDS}
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(stated.jobs, mp_context=context) as pool:
        futures = {pool.submit(answered, plan, k): k for k in range(plan.count)}
        for done, future in enumerate(as_completed(futures), 1):
            fault = drawn(plan.seed, futures[future])
            results[fault.kind].append(outcome(fault, future.result()))
            print(f"\rtrials: {done} of {plan.count}", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    for kind, found in results.items():
        inside = [o.inside for o in found if o.inside is not None]
        shares = {
            "first" if kind != "record" else "record named": [o.first for o in found],
            "reported" if kind != "record" else "unexplained or provisional": [o.reported for o in found],
            "inside the 95 % interval": inside,
            "wrong without reservation": [o.wrong for o in found],
        }
        for words, values in shares.items():
            if values:
                print(f"{kind:10} {words:28} {Share(sum(values), len(values))}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
