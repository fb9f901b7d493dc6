"""CPU time until a command answers, beside a bare interpreter; plain `python -m benchmarks.bench_startup [--repeats N]`.

Wrong names and missing files are refused before any import of seconds: the bar is 0.5 s. The identification of six records by two
methods, with warm caches, has a bar of 2 s. Each command is a process of its own. The least CPU time of N counts, because other
processes only add to it, and the ratio to `python -c pass` in the same minute does not depend on the machine.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Final

DATA: Final = Path(__file__).resolve().parents[1] / "data"
"""Shipped data."""
EARLY_S: Final = 0.5
"""Bar of a refusal and of --help [s]."""
IDENTIFY_S: Final = 2.0
"""Bar of the identification of six records [s]."""
LOG: Final = str(DATA / "undeclared" / "b.parquet")
"""Six records."""
REFUSED: Final = (
    ("--help",),
    ("fly", "none.toml", "--out", "x"),
    ("plan", "none.toml"),
    ("identify", "none.parquet", "--aircraft", "gtm"),
    ("identify", LOG, "--aircraft", "gtm", "--method", "iv-f3"),
    ("check", "none.parquet"),
    ("trace", LOG, "--aircraft", "gtmm", "--out", "x"),
    ("trace", LOG, "--aircraft", "gtm", "--out", "x", "--effect", "vane_ram"),
    ("loop", LOG, "--aircraft", "gtm", "--out", "x", "--method", "iv"),
    ("import", "none.csv", "--mapping", "none.toml", "--out", "x.parquet"),
    ("tables", "none", "--out", "x"),
    ("report", "none", "--out", "x.html"),
    ("verify", "none"),
)
"""Commands that end before they work."""


def cpu_s(words: Sequence[str], folder: str, repeats: int) -> float:
    """Least CPU time of a process [s]."""
    found = []
    for _ in range(repeats):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(
            [sys.executable, *words],
            check=False,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            cwd=folder,
            env={k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"},
        )
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        found.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return min(found)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--repeats", type=int, default=5)
    repeats = parser.parse_args().repeats
    with tempfile.TemporaryDirectory() as folder:
        bare = cpu_s(("-c", "pass"), folder, repeats)
        print(f"{'CPU [s]':>8}{'/bare':>7}  bar  command")
        print(f"{bare:8.2f}{1.0:7.1f}       python -c pass")
        identify = ("identify", LOG, "--aircraft", "gtm", "--method", "ls", "--method", "iv-f1")
        cpu_s(("-m", "airtruth", *identify), folder, 1)  # fills the caches
        bars = [(words, EARLY_S) for words in REFUSED] + [(identify, IDENTIFY_S)]
        for words, bar in bars:
            own = cpu_s(("-m", "airtruth", *words), folder, repeats)
            met = "met" if own <= bar else "MISSED"
            shown = " ".join(word.replace(str(DATA), "data") for word in words)
            print(f"{own:8.2f}{own / bare:7.1f}  {bar:g} s: {met}  airtruth {shown}", flush=True)


if __name__ == "__main__":
    main()
