"""What a trace costs; plain `python benchmarks/bench_trace.py`.

Six records of data/undeclared against the whole library, wall and CPU time of the search itself (the bar: 10 s
on two cores), as a multiple of one refit without effects, for one and two threads; and a check that both give
the same answer.
"""

from __future__ import annotations

import json
import time
from pathlib import Path

from airtruth import aircraft
from airtruth.effects.registry import EFFECTS
from airtruth.logs.store import read_log
from airtruth.tracing import TraceOptions, trace
from airtruth.tracing.inference.optimise import fit, initial_parameters
from airtruth.tracing.prepare import prepare

DATA = Path(__file__).resolve().parents[1] / "data" / "undeclared"


def main() -> None:
    """Print the table."""
    gtm = aircraft.load("gtm")
    trace([read_log(DATA / "f.parquet")], gtm, TraceOptions())  # compiles
    print(f"{len(EFFECTS)} effects; s wall (CPU), refits without effects that would take as long")
    print(f"{'set':4} {'verdict':12} {'one thread':>18} {'two threads':>18} {'refits':>7} same answer")
    for path in sorted(DATA.glob("*.parquet")):
        log = read_log(path)
        answers, times = [], []
        for threads in (1, 2):
            wall, cpu = time.perf_counter(), time.process_time()
            answers.append(trace([log], gtm, TraceOptions(threads=threads)).to_dict())
            times.append((time.perf_counter() - wall, time.process_time() - cpu))
        case = prepare([log], gtm, list(EFFECTS.values()), TraceOptions())
        wall = time.perf_counter()
        fit(case.fitted, case.hypothesis, initial_parameters(case.fitted, case.hypothesis))
        refit = time.perf_counter() - wall
        same = json.dumps(answers[0]) == json.dumps(answers[1])
        one, two = (f"{w:.2f} ({c:.2f})" for w, c in times)
        print(
            f"{path.stem:4} {answers[0]['verdict']:12} {one:>18} {two:>18} {times[0][0] / refit:7.1f} {same}"
        )


if __name__ == "__main__":
    main()
