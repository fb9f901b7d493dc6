"""Compile the numba kernels into their cache: one identification and one trace of each motion side by side.

    python -m scripts.compile_kernels

With a full cache this takes a few seconds. Without it, every process that meets a kernel first compiles it. numba compares
a cached kernel with its own file alone, and not with the files of the functions that it calls, so that a kernel that is older
than any file with kernels is removed first.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parents[1]
"""Root of the repository."""
LOG: Final = ROOT / "data" / "undeclared" / "a.parquet"
"""A short log that every kernel accepts."""
SIDE: Final = ROOT / "data" / "campaigns" / "lateral_late_rudder.toml"
"""A short campaign of aileron and rudder, of which the kernels of the lateral-directional motion take the records."""
METHODS: Final = (
    "ls",
    "iv-lowpass",
    "iv-actuator",
    "iv-f1",
    "iv-f2",
    "iv-refined",
    "frequency",
    "filter-error",
    "output-error",
)
"""Methods that together run every kernel of the identification."""


def remove_stale(package: Path) -> int:
    """Remove cached kernels older than the newest file with kernels; the number of removed files."""
    texts = ((path, path.read_text(encoding="utf-8")) for path in package.rglob("*.py"))
    sources = (path for path, text in texts if "njit" in text or "numerics.compiled" in text)
    newest = max((path.stat().st_mtime for path in sources), default=0.0)
    stale = [p for p in package.rglob("*.nb[ic]") if p.stat().st_mtime < newest]
    for path in stale:
        path.unlink()
    return len(stale)


def main() -> None:
    """Fly the campaign, then run the commands; exit with the first failure."""
    remove_stale(ROOT / "src" / "airtruth")
    with tempfile.TemporaryDirectory() as folder:
        shared = [sys.executable, "-m", "airtruth"]
        identify = [
            *shared,
            "identify",
            str(LOG),
            "--aircraft",
            "gtm",
            "--quiet",
            "--out",
            f"{folder}/estimates.parquet",
        ]
        identify += [word for name in METHODS for word in ("--method", name)]
        trace = [
            *shared,
            "trace",
            str(LOG),
            "--aircraft",
            "gtm",
            "--quiet",
            "--out",
            folder,
            "--effect",
            "vane_lag",
        ]
        flown, side = f"{folder}/flown", ["--aircraft", "gtm", "--quiet", "--motion", "lateral"]
        fly = subprocess.run(
            [*shared, "fly", str(SIDE), "--quiet", "--out", flown], stdout=subprocess.DEVNULL
        )
        if fly.returncode:
            sys.exit(fly.returncode)
        lateral = [
            [
                *shared,
                "identify",
                flown,
                *side,
                "--method",
                "filter-error",
                "--out",
                f"{folder}/lateral.parquet",
            ],
            [
                *shared,
                "trace",
                flown,
                *side,
                "--effect",
                "rudder_delay",
                "--increments",
                "--out",
                f"{folder}/lateral",
            ],
        ]
        commands = (identify, trace, *lateral)
        running = [subprocess.Popen(command, stdout=subprocess.DEVNULL) for command in commands]
        sys.exit(max(process.wait() for process in running))


if __name__ == "__main__":
    main()
