"""First and second run of commands with an empty cache of kernels; plain `python -m benchmarks.bench_first_run`.

Six simulated records with five methods, and the trace of data/undeclared/b.parquet. Each command is a process of its own. The
bars: the first identification takes at most twice the second, the first trace at most 10 s longer than the second.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

DATA = Path(__file__).resolve().parents[1] / "data"
METHODS = ("ls", "iv-lowpass", "iv-actuator", "iv-f1", "iv-f2")


def times_s(*words: str, cache: str) -> tuple[float, float]:
    """Wall and CPU time [s] of a command with a cache of kernels."""
    start, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(
        [sys.executable, "-m", "airtruth", *words],
        check=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "NUMBA_CACHE_DIR": cache},
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return time.perf_counter() - start, cpu


def main() -> None:
    """Print the table."""
    with tempfile.TemporaryDirectory() as folder:
        campaign, six = f"{folder}/first.toml", f"{folder}/six"
        times_s("new", "campaign", "--out", campaign, cache=f"{folder}/fly")
        times_s("fly", campaign, "--out", six, "--runs", "6", cache=f"{folder}/fly")
        named = [word for name in METHODS for word in ("--method", name)]
        identify = ("identify", six, "--aircraft", "gtm", *named, "--force", "--out", f"{folder}/e.parquet")
        traced = str(DATA / "undeclared" / "b.parquet")
        trace = ("trace", traced, "--aircraft", "gtm", "--force", "--out", f"{folder}/b")
        print(f"{'command':10}{'first [s] (CPU)':>18}{'second [s] (CPU)':>18}  bar")
        for words in (identify, trace):
            (first, first_cpu), (second, second_cpu) = (
                times_s(*words, cache=f"{folder}/{words[0]}") for _ in range(2)
            )
            bar = 2.0 * second if words[0] == "identify" else second + 10.0
            met = "met" if first <= bar else "MISSED"
            line = f"{first:10.1f} ({first_cpu:.1f}){second:11.1f} ({second_cpu:.1f})"
            print(f"{words[0]:10}{line}  {bar:.1f} s: {met}", flush=True)


if __name__ == "__main__":
    main()
