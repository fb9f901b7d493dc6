"""Blind trials of the lateral-directional tracer: flights of `validation.lateral_truth`, an independent integration.

Each trial draws air, effects and sizes from its seed; the tracer gets the logs and the declared aircraft alone. Every answer is
printed, with its effects, sizes and standard deviations, and the truth.

    python -m studies.lateral_trials --mode lateral-none --seed S [--count N]
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

from airtruth.errors import LogError
from airtruth.tracing import TraceOptions
from airtruth.tracing.answer import TraceAnswer
from airtruth.tracing.criterion import CRITERION
from airtruth.tracing.run import trace
from validation.lateral_declared import lateral_aircraft
from validation.lateral_truth import MODES, log_of, trial


def described(answer: TraceAnswer) -> str:
    """Verdict, effects with their sizes and rivals, and whether the answer is provisional."""
    effects = []
    for effect in answer.effects:
        sizes = ", ".join(f"{name} {p.value:.4g} +- {p.std:.2g}" for name, p in effect.parameters.items())
        rivals = f" or {', '.join(effect.indistinguishable_from)}" if effect.indistinguishable_from else ""
        effects.append(f"{effect.key} ({sizes}){rivals}")
    words = f"{answer.verdict}{', provisional' if answer.provisional else ''}"
    return f"{words}: {'; '.join(effects)}" if effects else words


def is_reported(answer: TraceAnswer, key: str) -> bool:
    """Whether a cause is among the effects of the answer, their look-alikes, and the sets within odds of one in twenty."""
    names = {key, key.partition(":")[0]}
    sets = [{e.key, e.name, *e.indistinguishable_from} for e in answer.effects]
    least = CRITERION.level * max((a.weight for a in answer.alternatives), default=0.0)
    weighed = [set(a.effects) for a in answer.alternatives if a.weight > least]
    return any(names & one for one in (*sets, *weighed))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--mode", choices=MODES, required=True)
    parser.add_argument("--seed", type=int, required=True, help="of the first trial; the others follow")
    parser.add_argument("--count", type=int, default=10)
    chosen = parser.parse_args()
    named = reported = first = sure = refused = 0
    with tempfile.TemporaryDirectory() as folder:
        plane = lateral_aircraft(Path(folder) / "declared")
        for seed in range(chosen.seed, chosen.seed + chosen.count):
            hidden, before = trial(chosen.mode, seed), time.process_time()
            truth = ", ".join(f"{key} {size:.4g}" for key, size in hidden.effects.items()) or "none"
            try:
                answer = trace([log_of(*hidden.flights)], plane, TraceOptions(motion="lateral")).answer
            except LogError as error:
                print(f"{seed} {truth} -> refused: {error}", flush=True)
                refused += 1
                continue
            spent = time.process_time() - before
            print(f"{seed} {truth} -> {described(answer)} [{spent:.0f} s of CPU]", flush=True)
            named += bool(answer.effects)
            reported += all(is_reported(answer, key) for key in hidden.effects)
            right = {e.key for e in answer.effects} == set(hidden.effects)
            first += right
            sure += bool(answer.effects) and not right and not answer.provisional
    print(
        f"{chosen.mode}, {chosen.count} trials from seed {chosen.seed}: {named} with a name, {reported} with every cause in "
        f"the reported sets, {first} with exactly the causes first, {sure} with other names and no reservation, "
        f"{refused} refused by the gate"
    )


if __name__ == "__main__":
    main()
