"""make fuzz: damage every kind of input, use it, and count how each case ends.

    python -m validation.fuzz --budget 1 --seed 1

A case ends well with a result or with one error of airtruth; a traceback, a crash of the process or more than 20 s is
a failure. The same seed draws the same cases.
"""

from __future__ import annotations

import argparse
import sys
import time

from validation.fuzz import files, foreign, logs, results
from validation.fuzz.harness import ENDINGS, Case, Tally, run_cases

CASES = (
    Case("log bytes", 10_000, logs.bytes_case, logs.warm),
    Case("log contents", 5_000, logs.contents_case, logs.warm),
    *(
        Case(f"import {name}", count, foreign.importing(name), foreign.warm)
        for name, count in (
            ("csv", 2_500), ("table", 500), ("mat 5", 2_500), ("mat 7.3", 2_000), ("parquet", 1_000), ("ulg", 1_500),
            ("dataflash", 1_000), ("mdf", 1_000), ("hdf5", 1_000), ("dialects", 3_000), ("structs", 1_000),
        )
    ),
    Case("source words", 1_000, foreign.words_case, foreign.warm),
    Case("campaign", 1_500, files.campaign_case, files.warm),
    Case("mapping", 1_300, files.mapping_case, files.warm),
    Case("aircraft", 1_200, files.aircraft_case, files.warm),
    Case("trace.json", 700, results.trace_case, results.warm),
    Case("loop.json", 300, results.loop_case, results.warm),
    Case("estimates", 600, results.estimates_case, results.warm),
    Case("campaign.json", 200, results.description_case, results.warm),
    Case("manifest", 200, results.manifest_case, results.warm),
)  # fmt: skip
"""The classes with their number of cases at budget 1, which is that of issue 16."""


def main() -> int:
    """Run the classes, print the table; the exit code is 1 if a case ended badly."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--budget", type=float, default=1.0, help="factor on the number of cases")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", action="append", metavar="CLASS", help="only classes whose name begins so")
    parser.add_argument("--case", type=int, help="run this case alone and show its ending")
    arguments = parser.parse_args()
    if arguments.budget <= 0.0:
        parser.error("--budget must be above 0")
    chosen = [c for c in CASES if not arguments.only or any(c.name.startswith(o) for o in arguments.only)]
    if not chosen:
        parser.error(f"no class {arguments.only}; allowed: {', '.join(c.name for c in CASES)}")
    bad = 0
    print(
        f"{'class':<16}{'cases':>8}"
        + "".join(f"{e:>11}" for e in ENDINGS)
        + f"{'slowest s':>11}{'time s':>8}"
    )
    for case in chosen:
        start = time.monotonic()
        single = arguments.case is not None
        numbers = (
            range(arguments.case, arguments.case + 1)
            if single
            else range(max(1, round(arguments.budget * case.count)))
        )
        tally = run_cases(case, numbers, arguments.seed, show=single)
        bad += _print(case, tally, time.monotonic() - start)
    return 1 if bad else 0


def _print(case: Case, tally: Tally, seconds: float) -> int:
    counts = [tally.endings[e] for e in ENDINGS]
    print(
        f"{case.name:<16}{sum(counts):>8}"
        + "".join(f"{n:>11}" for n in counts)
        + f"{tally.slowest_s:>11.1f}{seconds:>8.0f}",
        flush=True,
    )
    for reason, (first, count) in sorted(tally.bad.items(), key=_often):
        print(f"    {count} times, first case {first}: {reason}")
    for words, count in tally.warned.most_common(3):
        print(f"    (warning, {count} times: {words})")
    if tally.slowest_s > 5.0:
        print(f"    (slowest case {tally.slowest})", flush=True)
    return sum(counts[2:])


def _often(item: tuple[str, tuple[int, int]]) -> int:
    return -item[1][1]


if __name__ == "__main__":
    sys.exit(main())
