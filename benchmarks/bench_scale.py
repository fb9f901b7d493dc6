"""Time and memory of the bookkeeping of a large campaign: each command but the flights and the estimators.

    python -m benchmarks.bench_scale [--runs 1000000] [--methods 2] [--keep DIR]

Flights and estimators are replaced: a chunk is a log of 0.1 s flights and a truth in the real formats, and estimates are
drawn at random. Everything else is what the commands do. Each step is a process of its own; its memory is the largest
resident set of that process. The aim is at most 10 minutes and 2 GB for each step at a million runs.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Generator, Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

CAMPAIGN: Final = Path(__file__).resolve().parents[1] / "data" / "campaigns" / "light.toml"
"""Campaign whose run table is used."""
SAMPLES: Final = 6
"""Samples of a log's run [-]: 0.1 s at 50 Hz."""
METHODS: Final = ("ls", "iv-f1", "iv-lowpass", "iv-reference", "iv-actuator", "iv-f2")
"""Methods of the estimates, the first ``--methods`` of them."""
STEPS: Final = ("plan", "fly", "resume", "verify", "identify", "merge", "tables", "report", "grow")
"""Steps in the order in which they are measured."""
LIMIT_S: Final = 600.0
"""Aim for the time of a step at a million runs [s]."""
LIMIT_BYTES: Final = 2e9
"""Aim for the memory of a step at a million runs [byte]."""


def main() -> None:
    """Measure each step and print a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--runs", type=int, default=1_000_000)
    parser.add_argument("--methods", type=int, default=2)
    parser.add_argument(
        "--keep", type=Path, help="folder of the campaign, which stays; default: a temporary one"
    )
    parser.add_argument("--step", choices=STEPS, action="append", help="a step alone; may be repeated")
    parser.add_argument("--inside", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.inside:
        (step,) = arguments.step
        _measured(lambda: _STEPS[step](arguments.keep, arguments.runs, METHODS[: arguments.methods]))
        return
    with tempfile.TemporaryDirectory() as folder:
        out = arguments.keep or Path(folder)
        print(f"{arguments.runs} runs, {arguments.methods} methods, numpy {np.__version__}")
        print(f"{'step':10s} {'time [s]':>10s} {'memory [GB]':>12s}")
        for step in arguments.step or STEPS:
            print(f"{step:10s} {_child(step, out, arguments)}", flush=True)


def _child(step: str, out: Path, arguments: argparse.Namespace) -> str:
    """Run a step in a process of its own; its time and memory as text."""
    options = [
        "--runs",
        arguments.runs,
        "--methods",
        arguments.methods,
        "--keep",
        out,
        "--step",
        step,
        "--inside",
    ]
    ended = subprocess.run(
        [sys.executable, "-m", "benchmarks.bench_scale", *map(str, options)],
        capture_output=True,
        text=True,
        check=False,
    )
    if ended.returncode:
        return "failed: " + (ended.stderr.splitlines() or ["?"])[-1]
    seconds, size = map(float, ended.stdout.split()[-2:])
    missed = [name for name, over in (("time", seconds > LIMIT_S), ("memory", size > LIMIT_BYTES)) if over]
    return f"{seconds:10.1f} {size / 1e9:12.3f}" + (
        f"   beyond the aim: {', '.join(missed)}" if missed else ""
    )


def _measured(work: Callable[[], None]) -> None:
    start = time.perf_counter()
    work()
    size = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    print(f"{time.perf_counter() - start} {size}")


def _plan(out: Path, runs: int, methods: tuple[str, ...]) -> Any:
    from airtruth.simulation.campaign import plan

    return plan.make(CAMPAIGN, runs=runs)


def _fly(out: Path, runs: int, methods: tuple[str, ...]) -> None:
    from airtruth.simulation.campaign import plan
    from airtruth.simulation.campaign import run as campaign

    made = plan.make(CAMPAIGN, runs=runs)
    campaign.fly_chunks = _copied  # type: ignore[assignment]
    flown = campaign.fly(made, out)
    assert flown.runs == runs


def _resume(out: Path, runs: int, methods: tuple[str, ...]) -> None:
    """The command on a finished campaign, which compares every file."""
    from airtruth.simulation.campaign import plan
    from airtruth.simulation.campaign import run as campaign

    assert campaign.fly(plan.make(CAMPAIGN, runs=runs), out).flown_now == 0


def _grow(out: Path, runs: int, methods: tuple[str, ...]) -> None:
    """Continue the campaign with a tenth more runs of which none is flown: the client is stopped at the first."""
    from airtruth.simulation.campaign import plan
    from airtruth.simulation.campaign import run as campaign

    def stop(*arguments: object, **named: object) -> Generator[Any, None, None]:
        raise KeyboardInterrupt
        yield

    campaign.fly_chunks = stop  # type: ignore[assignment]
    with suppress(KeyboardInterrupt):
        campaign.fly(plan.make(CAMPAIGN, runs=runs + runs // 10), out)
    campaign.fly_chunks = _copied  # type: ignore[assignment]
    campaign.fly(plan.make(CAMPAIGN, runs=runs + runs // 10), out)


def _verify(out: Path, runs: int, methods: tuple[str, ...]) -> None:
    from airtruth.logs.verify import verify

    assert verify(out).checked > 0


def _identify(out: Path, runs: int, methods: tuple[str, ...]) -> None:
    from airtruth import identification
    from airtruth.identification import from_log

    from_log.from_log = _drawn
    with identification.identified(out, "gtm", methods, folder=out) as result:
        identification.write_estimates(out / "estimates.parquet", result, merge=False)
        assert result.summary()


def _merge(out: Path, runs: int, methods: tuple[str, ...]) -> None:
    """A further method into the file of the others, and all rows of it as JSON."""
    from airtruth import identification
    from airtruth.identification import from_log

    from_log.from_log = _drawn
    with identification.identified(out, "gtm", [METHODS[-1]], folder=out) as result:
        identification.write_estimates(out / "estimates.parquet", result)
        with open(os.devnull, "w") as file:
            file.writelines(identification.json_of(result.frames()))


def _tables(out: Path, runs: int, methods: tuple[str, ...]) -> None:
    from airtruth.reporting import write_tables

    write_tables([out], out / "tables")


def _report(out: Path, runs: int, methods: tuple[str, ...]) -> None:
    """The page of the estimates, with a dozen of the records."""
    from airtruth.reporting import report

    report(out, out / "tables" / "report.html")


def _copied(made: Any, chunks: list[int], logs: Path, truths: Path, jobs: int) -> Iterator[Any]:
    """Chunks in the real formats, each run with the same samples and the same truth."""
    from airtruth.channels import SIGNALS
    from airtruth.logs import store
    from airtruth.logs.digest import sha256_of
    from airtruth.logs.flight_log import FlightLog
    from airtruth.logs.names import chunk_file
    from airtruth.simulation.campaign.chunk import FlownChunk, truth_row
    from airtruth.simulation.campaign.workers import orders_of

    names = [name for name in SIGNALS if name not in ("run_id", "t_s")][:11]
    values = np.random.default_rng(1).normal(size=(len(names), SAMPLES))
    for order in orders_of(made, chunks):
        ids = tuple(run.run_id for run in order.runs)
        log = FlightLog(
            metadata={"aircraft": "gtm", "sample_rate_hz": 50},
            run_ids=ids,
            offsets=np.arange(len(ids) + 1, dtype=np.int64) * SAMPLES,
            t_s=np.tile(np.arange(SAMPLES) / 50.0, len(ids)),
            channels={n: np.tile(v, len(ids)) for n, v in zip(names, values, strict=True)},
        )
        file = chunk_file(order.chunk)
        store.write_log(logs / file, log)
        row = {k: 0.5 if v != v else v for k, v in truth_row(order.runs[0], None).items()} | {"status": "ok"}
        store.write_table(truths / file, pd.DataFrame([row] * len(ids)).assign(run_id=list(ids)))
        yield FlownChunk(order.chunk, len(ids), (), sha256_of(logs / file), sha256_of(truths / file))


def _drawn(task: Any, estimated: Callable[[Any], None] = lambda made: None) -> Any:
    """What identify makes of a log, with estimates drawn at random."""
    from airtruth.identification.estimates import Estimates
    from airtruth.identification.from_log import FromLog
    from airtruth.identification.result import LogSource
    from airtruth.logs.digest import sha256_of
    from airtruth.logs.store import read_log
    from airtruth.physics.short_period import Scale

    ids = read_log(task.folder / task.entry, columns=[]).run_ids
    rng = np.random.default_rng(len(ids))
    found = FromLog(ids, LogSource(task.entry.name, str(sha256_of(task.entry)), len(ids)))
    scale = Scale(*(np.full(len(ids), 1.0) for _ in Scale.__dataclass_fields__))
    first = Estimates(
        method="",
        run_ids=ids,
        theta=rng.normal(0.5, 0.01, (len(ids), 6)),
        covariance=np.tile(1e-4 * np.eye(6), (len(ids), 1, 1)),
        covariance_name="corrected",
        status=np.zeros(len(ids), np.int8),
        iterations=np.full(len(ids), 3, np.int32),
        scale=scale,
        confidence=0.95,
    )
    for chosen in task.methods:
        found.estimates[chosen.name] = replace(
            first, method=chosen.name, theta=first.theta.copy(), covariance=first.covariance.copy()
        )
        estimated(found.estimates[chosen.name])
    return found


_STEPS: Final[dict[str, Callable[[Path, int, tuple[str, ...]], None]]] = {
    "plan": _plan,
    "fly": _fly,
    "resume": _resume,
    "grow": _grow,
    "verify": _verify,
    "identify": _identify,
    "merge": _merge,
    "tables": _tables,
    "report": _report,
}
"""Step -> what it does."""

if __name__ == "__main__":
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the commands do
    os.environ.setdefault("ARROW_DEFAULT_MEMORY_POOL", "system")
    main()
