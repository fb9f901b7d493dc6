"""Trials in parallel: fly, trace, measure; each stage's file appears whole, and a killed run goes on.

Flying and measuring, and tracing, use processes of their own, so that no process that flies a truth knows the
tracer. A trial depends on seed, number and mode alone.
"""

from __future__ import annotations

import json
import multiprocessing
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from airtruth.cluster import Cluster, LostWorkError
from airtruth.errors import StoreError
from airtruth.logs.store import read_log, write_text
from validation.blind import draw, information, refit, tracing
from validation.blind.figures import CHANNELS, LEAVE_ONE_OUT, STRONG
from validation.blind.flight import LeftRangeError
from validation.blind.scoring import base, beyond
from validation.blind.set_scoring import strong

_ATTEMPTS: Final = 3
_NEXT: Final = 1_000_000


@dataclass(frozen=True)
class Plan:
    """What to do: trials 0 to ``count`` - 1 of a seed and mode, into ``out``, by the tracer MODULE:NAME.

    ``only_counted``: trace only what a score counts, the trials without an effect and those above the noncentrality.
    ``effects``: only the trials with one of these effects, variants included; empty for all.
    ``noise``: only the trials with this noise of the sensors; empty for any.
    """

    count: int
    seed: int
    mode: str
    out: Path
    tracer: str = "validation.blind.tracing:answer"
    only_counted: bool = False
    effects: tuple[str, ...] = ()
    noise: str = ""

    @property
    def numbers(self) -> list[int]:
        """The trials that are flown."""
        return [k for k in range(self.count) if self._is_flown(draw.draw(self.seed, k, self.mode))]

    def _is_flown(self, trial: draw.Trial) -> bool:
        has_effect = not self.effects or any(base(e.key) in self.effects for e in trial.effects)
        return has_effect and self.noise in ("", trial.noise)

    def file(self, stage: str, number: int) -> Path:
        """JSON file of one trial and stage, "truth" or "answer"."""
        return self.out / stage / f"{self.mode}-{self.seed}-{number:05d}.json"

    def log(self, number: int) -> Path:
        """Folder that a tracer is shown."""
        return self.out / "logs" / f"{self.mode}-{self.seed}-{number:05d}"


def fly(plan: Plan, number: int) -> dict[str, Any]:
    """Fly one trial, write its log, and say what the truth was.

    A trial whose aircraft leaves its range (an upset) is replaced by another number's.
    """
    for attempt in range(_ATTEMPTS):
        try:
            return _flown(plan, number, draw.draw(plan.seed, number + attempt * _NEXT, plan.mode))
        except LeftRangeError:
            if attempt == _ATTEMPTS - 1:
                raise
    raise AssertionError


def _flown(plan: Plan, number: int, trial: draw.Trial) -> dict[str, Any]:
    path = draw.write(trial, plan.log(number))
    log = read_log(path, CHANNELS)
    records = [
        np.column_stack([log.channels[name][log.rows(k)] for name in CHANNELS])
        for k in range(len(log.run_ids))
    ]
    return {
        "trial": draw.plain(trial),
        "lambda": refit.lambdas(trial),
        "increments": draw.derivative_increments(trial),
        "oracle": information.oracle(draw.open_loop(trial, noisy=True), records),
    }


def trace(plan: Plan, number: int) -> dict[str, Any]:
    """Have one trial traced."""
    return tracing.call(plan.tracer, plan.log(number) / "log.parquet")


def run(plan: Plan, jobs: int, cluster: Cluster | None = None) -> list[dict[str, Any]]:
    """All trials that are traced, in order: {"truth": .., "answer": ..} each.

    Parameters
    ----------
    plan : what to do.
    jobs : number of processes of this machine.
    cluster : whose workers do the work instead; they see the folder ``plan.out`` and this package under the same names.
    """
    for folder in ("truth", "answer", "logs"):
        (plan.out / folder).mkdir(parents=True, exist_ok=True)
    numbers = plan.numbers
    _stage(plan, "truth", fly, [k for k in numbers if not plan.file("truth", k).exists()], jobs, cluster)
    if plan.only_counted:
        numbers = [k for k in numbers if _counts(json.loads(plan.file("truth", k).read_text()))]
    _stage(plan, "answer", trace, [k for k in numbers if not _answered(plan, k)], jobs, cluster)
    return [
        {stage: json.loads(plan.file(stage, k).read_text()) for stage in ("truth", "answer")} for k in numbers
    ]


def _counts(truth: dict[str, Any]) -> bool:
    if truth["trial"]["composition"] in ("off-library", LEAVE_ONE_OUT):
        return beyond({"truth": truth}) > STRONG
    return not truth["trial"]["effects"] or strong({"truth": truth})


def frozen(seed: int, numbers: Sequence[int], mode: str, out: Path) -> list[Path]:
    """Fly some trials again in a process of its own; the folders that a tracer is shown, in order."""
    plan = Plan(len(numbers), seed, mode, out)
    return flown_apart([draw.draw(seed, k, mode) for k in numbers], [plan.log(k) for k in numbers])


def flown_apart(trials: Sequence[draw.Trial], folders: Sequence[Path]) -> list[Path]:
    """Fly trials into folders, in a process that does not know the tracer; the folders."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=context) as pool:
        return list(pool.map(_write, trials, folders))


def _write(trial: draw.Trial, folder: Path) -> Path:
    return draw.write(trial, folder).parent


def _answered(plan: Plan, number: int) -> bool:
    path = plan.file("answer", number)
    return path.exists() and "failed" not in json.loads(path.read_text())


Work = Callable[[Plan, int], dict[str, Any]]
"""Stage of a trial: plan and number in, the content of the stage's file out."""


def _stage(
    plan: Plan, stage: str, work: Work, numbers: Sequence[int], jobs: int, cluster: Cluster | None
) -> None:
    results = _pooled(plan, work, numbers, jobs) if cluster is None else _on(cluster, plan, work, numbers)
    for done, (number, content) in enumerate(results, 1):
        write_text(plan.file(stage, number), json.dumps(content, default=_simple))
        end = "\n" if done == len(numbers) else ""
        print(f"\r{stage}: {done} of {len(numbers)}", end=end, file=sys.stderr, flush=True)


def _pooled(
    plan: Plan, work: Work, numbers: Sequence[int], jobs: int
) -> Iterator[tuple[int, dict[str, Any]]]:
    if not numbers:
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, mp_context=context) as pool:
        futures = {pool.submit(work, plan, k): k for k in numbers}
        for future in as_completed(futures):
            yield futures[future], future.result()


def _on(
    cluster: Cluster, plan: Plan, work: Work, numbers: Sequence[int]
) -> Iterator[tuple[int, dict[str, Any]]]:
    plan = replace(plan, out=plan.out.absolute())
    for (_, _, number), content in cluster.completed(_apart, [(work, plan, k) for k in numbers]):
        if isinstance(content, LostWorkError):
            raise StoreError(f"trial {number}: the workers of the cluster ended each time ({content})")
        yield number, content


def _apart(task: tuple[Work, Plan, int]) -> dict[str, Any]:
    """One stage of a trial in a process of its own, since a worker has flown truths and traced before."""
    work, plan, number = task
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        return pool.submit(work, plan, number).result()


def _simple(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else str(value)
