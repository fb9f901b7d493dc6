"""What flying costs: ratios measured side by side, so that the machine cancels out.

python benchmarks/bench_fly.py [--full]    --full: 3000 runs for the two processes, 10,000 for the memory
"""

from __future__ import annotations

import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd

CAMPAIGN = Path(__file__).resolve().parents[1] / "data" / "campaigns" / "light.toml"
LATERAL = CAMPAIGN.with_name("lateral.toml")
BARS = {"overhead": 1.5, "six axes": 1.25, "speed-up": 1.8, "help": 0.5, "import": 0.1, "memory": 1.1}
RUNS_PER_CHUNK = 100
CHUNKS = 6


def overhead() -> float:
    """CPU per step of campaign chunks (gusts, sensors, Parquet, all) over that of a bare run() loop."""
    from airtruth.simulation.campaign import plan
    from airtruth.simulation.campaign.chunk import Pilot
    from airtruth.simulation.campaign.workers import orders_of
    from airtruth.simulation.simulator import Executive
    from airtruth.simulation.trim import trim

    made = plan.make(CAMPAIGN, runs=RUNS_PER_CHUNK * 32)
    first, *numbers = _whole_chunks(made.table["chunk"].value_counts())
    steps = RUNS_PER_CHUNK * (made.samples - 1)
    pilot = Pilot(made)
    at = trim(made.aircraft, plan.planned_runs(made.table.head(1))[0].condition, made.dt_s)
    bare = Executive(made.aircraft, made.dt_s)
    bare.initialise(at.condition, at.controls)
    bare.fdm.set_trim_status(False)
    run = bare.fdm.run

    with tempfile.TemporaryDirectory() as folder:

        def chunk(number: int) -> float:
            start = time.process_time()
            (order,) = orders_of(made, [number])
            flown = pilot.fly_chunk(order, Path(folder), truths)
            assert flown.runs == RUNS_PER_CHUNK
            assert not flown.unflown
            return time.process_time() - start

        def loop() -> float:
            start = time.process_time()
            for _ in range(steps):
                run()
            return time.process_time() - start

        truths = Path(folder) / "truth"
        truths.mkdir()
        chunk(first)
        loop()
        pairs = []
        for number in numbers[:CHUNKS]:
            pairs.append((chunk(number), loop()) if number % 2 else (loop(), chunk(number))[::-1])
    ratios = sorted(a / b for a, b in pairs)
    medians = [1e6 * statistics.median(p) / steps for p in zip(*pairs, strict=True)]
    print(
        f"  campaign {medians[0]:.2f} us, bare run() {medians[1]:.2f} us CPU a step; ratio {ratios[0]:.2f} to {ratios[-1]:.2f}"
    )
    return statistics.median(ratios)


def six_axes() -> float:
    """CPU per step of a lateral campaign over that of one in the pitch plane with records of the same length."""
    from airtruth.simulation.campaign import file as campaign_file
    from airtruth.simulation.campaign import plan
    from airtruth.simulation.campaign.chunk import Pilot
    from airtruth.simulation.campaign.workers import orders_of

    lateral = plan.make(LATERAL, runs=RUNS_PER_CHUNK * 32)
    same_length = {"duration_s": lateral.campaign.duration}
    plane = plan.make(campaign_file.read(CAMPAIGN, same_length), runs=RUNS_PER_CHUNK * 32)
    pilots = [(made, Pilot(made)) for made in (plane, lateral)]
    numbers = _whole_chunks(plane.table["chunk"].value_counts())[: CHUNKS + 1]

    with tempfile.TemporaryDirectory() as folder:
        truths = Path(folder) / "truth"
        truths.mkdir()

        def chunk(number: int, made: plan.Plan, pilot: Pilot) -> float:
            start = time.process_time()
            (order,) = orders_of(made, [number])
            assert not pilot.fly_chunk(order, Path(folder), truths).unflown
            return 1e6 * (time.process_time() - start) / (RUNS_PER_CHUNK * (made.samples - 1))

        pairs = [[chunk(number, *pilot) for pilot in pilots] for number in numbers][1:]
    medians = [statistics.median(p) for p in zip(*pairs, strict=True)]
    print(f"  pitch plane {medians[0]:.2f} us, six axes {medians[1]:.2f} us CPU a step")
    return statistics.median(b / a for a, b in pairs)


def machine() -> float:
    """How much more two processes get done than one when they share nothing: 2 on an idle machine."""
    spin = "import time; t = time.perf_counter(); sum(range(60_000_000)); print(time.perf_counter() - t)"

    def seconds(count: int) -> float:
        command = [sys.executable, "-c", spin]
        running = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(count)]
        return max(float(process.communicate()[0]) for process in running)

    return (
        2.0
        * statistics.median(seconds(1) for _ in range(3))
        / statistics.median(seconds(2) for _ in range(3))
    )


def speed_up(runs: int) -> float:
    """Wall time of a campaign with one process over that with two."""
    print(
        f"  two processes that share nothing get {machine():.2f} times the work of one done (2: idle machine)"
    )
    print(f"  {runs} runs; load average before: {os.getloadavg()[0]:.2f}")
    seconds = {}
    for jobs in (1, 2):
        with tempfile.TemporaryDirectory() as folder:
            command = [
                sys.executable,
                "-m",
                "airtruth",
                "fly",
                CAMPAIGN,
                "--runs",
                runs,
                "--jobs",
                jobs,
                "--out",
                folder,
            ]
            start = time.perf_counter()
            subprocess.run([str(c) for c in command], check=True, stdout=subprocess.DEVNULL)
            seconds[jobs] = time.perf_counter() - start
            print(f"  {jobs} process(es): {seconds[jobs]:.1f} s, {runs / seconds[jobs]:.0f} runs/s")
    return seconds[1] / seconds[2]


def peak_memory(runs: int) -> float:
    """Peak resident memory [MB] of a fresh process that flies all chunks of a campaign, as a worker does."""
    command = [sys.executable, __file__, "--worker", str(runs)]
    return float(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def _whole_chunks(runs: pd.Series) -> list[int]:
    """Numbers of the chunks with `RUNS_PER_CHUNK` runs; the first runs of a campaign are in smaller ones."""
    return sorted(int(chunk) for chunk, count in runs.items() if count == RUNS_PER_CHUNK)


def worker(runs: int) -> None:
    """Fly every chunk and print the peak memory [MB]."""
    from airtruth.simulation.campaign import plan
    from airtruth.simulation.campaign.chunk import Pilot

    made = plan.make(CAMPAIGN, runs=runs)
    pilot = Pilot(made)
    with tempfile.TemporaryDirectory() as logs, tempfile.TemporaryDirectory() as truths:
        for chunk in sorted(made.table["chunk"].unique()):
            pilot.fly_chunk(int(chunk), Path(logs), Path(truths))
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)


def help_s() -> float:
    """Median wall time of --help [s]."""
    seconds = []
    for _ in range(7):
        start = time.perf_counter()
        subprocess.run([sys.executable, "-m", "airtruth", "--help"], check=True, stdout=subprocess.DEVNULL)
        seconds.append(time.perf_counter() - start)
    return statistics.median(seconds)


def import_s() -> float:
    """Least of five times of `import airtruth` in a new interpreter [s]."""
    script = "import time; t = time.perf_counter(); import airtruth; print(time.perf_counter() - t)"
    command = [sys.executable, "-c", script]
    return min(float(subprocess.run(command, check=True, capture_output=True).stdout) for _ in range(5))


def report(name: str, value: float, ok: bool, bar: str) -> None:
    """One line of the result."""
    print(f"{name:<44} {value:8.2f}   bar: {bar:<14} {'met' if ok else 'MISSED'}")


def main(full: bool) -> None:
    """Print every figure beside its bar."""
    seconds = help_s()
    report("--help [s]", seconds, seconds < BARS["help"], f"under {BARS['help']}")
    seconds = import_s()
    report("import airtruth [s]", seconds, seconds < BARS["import"], f"under {BARS['import']}")
    ratio = overhead()
    report(
        "CPU a step over a bare run() loop", ratio, ratio <= BARS["overhead"], f"at most {BARS['overhead']}"
    )
    ratio = six_axes()
    report(
        "CPU a step in six axes over the pitch plane",
        ratio,
        ratio <= BARS["six axes"],
        f"at most {BARS['six axes']}",
    )
    sizes = (100, 1000, 10_000) if full else (100, 1000)
    peaks = [peak_memory(runs) for runs in sizes]
    print(
        "  peak of a worker: "
        + ", ".join(f"{n} runs {mb:.0f} MB" for n, mb in zip(sizes, peaks, strict=True))
    )
    growth = peaks[-1] / peaks[0]
    report(
        f"memory, {sizes[-1]} runs over 100", growth, growth <= BARS["memory"], f"at most {BARS['memory']}"
    )
    gain = speed_up(3000 if full else 1000)
    print(
        f"  two processes that share nothing, once more: {machine():.2f} times; below 1.9 the next line says nothing"
    )
    report("two processes over one", gain, gain >= BARS["speed-up"], f"at least {BARS['speed-up']}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--full", action="store_true")
    parser.add_argument("--worker", type=int, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    worker(arguments.worker) if arguments.worker else main(arguments.full)
