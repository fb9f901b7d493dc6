"""Traces of damaged aircraft of an independent truth: both motions, asymmetric trims, and an aircraft without its fin.

Every answer is printed: its effects, whether the cause is among the reported sets, and the error of the free runs of the held-out
records with the updated model over that with the damaged aircraft declared, the largest of the channels.

    python -m studies.damage_trials fin-30 tip-20 --seed 1
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

from airtruth.logs.flight_log import FlightLog
from airtruth.tracing import TraceOptions, trace
from airtruth.tracing.answer import TraceAnswer
from studies.lateral_trials import described, is_reported
from validation.damage import CASES, Damage, flights
from validation.lateral_declared import lateral_aircraft
from validation.lateral_truth import log_of

CHEAP = ("gyro_scale",)
"""The only candidate of the trace whose declared aircraft is the damaged one: its errors alone are wanted."""


def truth_errors(
    case: Damage, log: FlightLog, folder: Path, motion: str | None
) -> dict[str, dict[str, float]]:
    """Motion -> free-run errors of the held-out records with the damaged aircraft declared, of the runs that excite it."""
    plane = lateral_aircraft(folder / "truth", case.plane)
    found = {}
    for name, own in trace([log], plane, TraceOptions(motion=motion, effects=CHEAP)).motions.items():
        stage = own.answer.error.stages["declared"]
        held = stage.held_out or stage.fit
        assert held is not None
        found[name] = held.free_run
    return found


def ratio(answer: TraceAnswer, truth: dict[str, float]) -> float:
    """Largest ratio over the channels of the last stage's held-out free-run error to that of the truth."""
    stage = answer.error.stages["after" if "after" in answer.error.stages else "before"]
    held = stage.held_out or stage.fit
    assert held is not None
    return max(error / truth[channel] for channel, error in held.free_run.items())


def main() -> None:
    """Print a line for each case and motion."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("cases", nargs="*", metavar="CASE", help=f"of {', '.join(CASES)}; all without one")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--motion", choices=("longitudinal", "lateral"))
    parser.add_argument(
        "--increments", action="store_true", help="learn increments too, as `airtruth trace` does"
    )
    asked = parser.parse_args()
    for name in asked.cases or CASES:
        case, before = CASES[name], time.process_time()
        log = log_of(*flights(case, asked.seed))
        with tempfile.TemporaryDirectory() as text:
            folder = Path(text)
            options = TraceOptions(motion=asked.motion, increments=asked.increments)
            result = trace([log], lateral_aircraft(folder / "declared"), options)
            truth = truth_errors(case, log, folder, asked.motion)
            for motion, own in result.motions.items():
                right = any(is_reported(own.answer, cause) for cause in case.causes)
                error = ratio(own.answer, truth[motion])
                spent = time.process_time() - before
                print(
                    f"{name} {motion}: {described(own.answer)}; cause reported: {'yes' if right else 'no'}; error "
                    f"{error:.2f} of the truth's [{spent:.0f} s of CPU]",
                    flush=True,
                )
                weighed = (
                    f"{'+'.join(s.effects) or 'none'} {s.weight:.2f}" for s in own.answer.alternatives[:4]
                )
                print(f"    sets: {'; '.join(weighed)}", flush=True)


if __name__ == "__main__":
    main()
