"""Best-first evidence of sets beside the search that a trace uses, on the same blind trials.

Each trial of `validation.blind` is flown in a process that does not know the tracer. The evidence of every set of effects
(`airtruth.tracing.selection.best_first`) then sees the same case as a trace: the gate, the declared aircraft, the
calibrated noise. A set is "named" if it has the fewest names against which the odds are not strong, and "reported" if its
posterior weight is at least 0.001, the limit of the alternatives of a trace.

    python -m studies.shadow --mode single --seed 20262224 --count 20 [--old]
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from threadpoolctl import threadpool_limits

from validation.blind import draw, tracing
from validation.blind.figures import DECLARED
from validation.blind.trials import frozen

if TYPE_CHECKING:
    from airtruth.tracing.selection.best_first import Posterior

Names = tuple[str, ...]
"""Names of a set, sorted."""

LEAST_WEIGHT: Final = 1e-3
"""Posterior weight from which a set is reported [-], as of `airtruth.tracing.declared_model`."""
ANOMALY: Final = 0.01
"""P-value of the omnibus tests from which an answer is provisional [-], as of `airtruth.tracing.answer`."""


def base(names: Names) -> Names:
    """Names without their variants."""
    return tuple(sorted({name.partition(":")[0] for name in names}))


def evidence_of(log: Path) -> tuple[Posterior, float]:
    """Posterior of the sets of effects of one log, and the p-value of the omnibus tests beside the best one [-].

    Raises
    ------
    ValueError
        If the declared aircraft does not fly like the log.
    """
    # the process that flies the truths imports this module, and must not know the tracer
    from airtruth import aircraft as planes
    from airtruth.checks import gate
    from airtruth.effects.registry import EFFECTS
    from airtruth.logs.sources import named_logs
    from airtruth.tracing.calibration.calibrated import calibrated
    from airtruth.tracing.inference.whitening import autoregression
    from airtruth.tracing.options import TraceOptions
    from airtruth.tracing.prepare import prepare
    from airtruth.tracing.selection.best_first import best_first
    from airtruth.tracing.selection.omnibus import anomalies
    from airtruth.tracing.selection.set_table import SetTable

    declared, options = planes.load(DECLARED), TraceOptions()
    logs = [gate.admit(one, declared, source=name, force=False).log for name, one in named_logs(log)]
    library = [e for e in EFFECTS.values() if "longitudinal" in e.motions and not e.in_derivatives]
    case, start = calibrated(prepare(logs, declared, library, options))
    found = best_first(SetTable(case.fitted), case.hypothesis, start, case.effects, case.declared.causes)
    if found is None:
        raise ValueError(f"{log}: the declared aircraft does not fly like these records")
    tests = anomalies(found.best, case.fitted, autoregression(found.best.innovations))
    return found, min(1.0, len(tests) * min(test.p_value for test in tests))


def by_base(found: Posterior) -> dict[Names, float]:
    """Weights of the sets by their names without variants, the most probable first."""
    total: dict[Names, float] = {}
    for names, weight in found.weights.items():
        total[base(names)] = total.get(base(names), 0.0) + weight
    return dict(sorted(total.items(), key=lambda pair: -pair[1]))


def old_words(answer: dict[str, Any], truth: Names) -> str:
    """Verdict and names of a trace, and whether it reports the truth."""
    named = base(tuple(e["name"] for e in answer["effects"]))
    others = [base(tuple(a["effects"])) for a in answer.get("alternatives", ())]
    what = "first" if named == truth else "reported" if truth in others else "not reported"
    provisional = ", provisional" if answer["provisional"] else ""
    return f"{answer['verdict']}{provisional}: {' + '.join(named) or 'none'} ({what})"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--mode", choices=draw.MODES, required=True)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--count", type=int, default=10)
    parser.add_argument("--old", action="store_true", help="trace each log too, some tens of seconds each")
    chosen = parser.parse_args()
    score: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder, threadpool_limits(limits=1, user_api="blas"):
        logs = frozen(chosen.seed, range(chosen.count), chosen.mode, Path(folder))
        for number, log in enumerate(logs):
            trial = draw.draw(chosen.seed, number, chosen.mode)
            truth = base(tuple(e.key for e in trial.effects))
            before = time.process_time()
            found, remains = evidence_of(log / "log.parquet")
            spent = time.process_time() - before
            weights, named = by_base(found), base(found.simplest)
            reported = weights.get(truth, 0.0) >= LEAST_WEIGHT
            score["named right"] += named == truth
            score["reported"] += reported
            wrong = bool(named) and not set(named) & set(truth)
            score["no true name"] += wrong
            score["of these with an anomaly or three names"] += wrong and (
                remains < ANOMALY or len(named) > 2
            )
            leading = "; ".join(f"{' + '.join(n) or 'none'} {w:.3f}" for n, w in list(weights.items())[:4])
            print(
                f"{chosen.mode} {number} {trial.air}: {' + '.join(truth) or 'none'} -> {' + '.join(named) or 'none'} "
                f"(truth {weights.get(truth, 0.0):.2g}) | {leading} | anomaly p {remains:.2g}, {found.refits} refits, "
                f"ratio {found.temper:.2f}, {spent:.1f} s of CPU",
                flush=True,
            )
            if chosen.old:
                before = time.process_time()
                answer = tracing.answer(log / "log.parquet")
                print(
                    f"    trace: {old_words(answer, truth)}, {time.process_time() - before:.1f} s of CPU",
                    flush=True,
                )
    print(", ".join(f"{what}: {count} of {chosen.count}" for what, count in score.items()))


if __name__ == "__main__":
    main()
