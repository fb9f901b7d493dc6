"""make blind: trials against a truth that the tracer does not know, and their scores.

    python -m validation.blind --trials 200 --seed 1 --jobs 2

Draws effects, sizes, air, sensors and manoeuvres, flies them in JSBSim at 1 kHz, hands the logs and the declared
aircraft to the tracer, and scores its answers; see docs/blind.md. A run that is interrupted resumes.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

from airtruth.cluster import workers
from airtruth.logs.store import write_text
from validation.blind import bands, results, scoring, set_scoring
from validation.blind.draw import MODES
from validation.blind.sensors import NOISE_KINDS
from validation.blind.trials import Plan, run


def main() -> int:
    """Run, print the tables, write scores.json, scores.md and the figures."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--trials", type=int, required=True)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--cluster", metavar="ADDRESS", help="work on a Dask cluster, see docs/cluster.md")
    parser.add_argument("--out", type=Path, default=Path("out/blind"))
    parser.add_argument("--mode", choices=MODES, default="mixed")
    parser.add_argument(
        "--tracer",
        default="validation.blind.tracing:answer",
        help="MODULE:FUNCTION, a log's path in, an answer out",
    )
    parser.add_argument(
        "--only-counted",
        action="store_true",
        help="trace only the trials without an effect and those above the noncentrality that the scores count",
    )
    parser.add_argument(
        "--effect",
        action="append",
        default=[],
        metavar="NAME",
        help="fly only the trials with this effect, any variant of it; repeat it for several",
    )
    parser.add_argument(
        "--noise", choices=NOISE_KINDS, default="", help="fly only the trials with this noise of the sensors"
    )
    arguments = parser.parse_args()
    if arguments.trials < 1 or arguments.jobs < 1:
        parser.error("--trials and --jobs must be at least 1")
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ.setdefault(name, "1")  # of the workers
    plan = Plan(
        arguments.trials,
        arguments.seed,
        arguments.mode,
        arguments.out,
        arguments.tracer,
        arguments.only_counted,
        tuple(arguments.effect),
        arguments.noise,
    )
    if not plan.numbers:
        parser.error("no trial has such an effect and such noise; `airtruth effects` lists the effects")
    with workers(arguments.cluster) as cluster:
        cases = run(plan, arguments.jobs, cluster)
    scores = scoring.score(cases)
    sets = set_scoring.set_scores(cases)
    of_bands = bands.score(cases)
    text = results.markdown(scores, sets, of_bands)
    folder = arguments.out / f"{plan.mode}-{plan.seed}"
    folder.mkdir(parents=True, exist_ok=True)
    write_text(folder / "scores.md", text)
    write_text(folder / "scores.json", results.as_json({**scores, "sets": sets, "bands": of_bands}))
    results.figures(scores, cases, folder)
    print(text)
    for failure in sorted(set(scores["failed"])):
        print(f"blind_trials: the tracer failed: {failure}", file=sys.stderr)
    return 1 if scores["failed"] else 0


if __name__ == "__main__":
    sys.exit(main())
