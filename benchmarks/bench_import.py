"""What an hour of flight at 100 Hz costs: searched for manoeuvres, imported and identified by the commands of a user.

python -m benchmarks.bench_import [--formats csv dataflash mdf hdf5] [--hours 1.0]

Prints time and peak memory of each command, and their sums against the bars: 120 s and 1 GB on two cores. The memory is
the proportional share (PSS) of the command and its child processes together, sampled.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Final

import numpy as np

from airtruth.units import DEG
from validation import recorders
from validation.linear_flight import fly
from validation.recorders import Topic

SECONDS: Final = 120.0
"""Bar of the three commands together [s]."""
BYTES: Final = 1e9
"""Bar of the largest memory [byte]."""
EVERY_S: Final = 60.0
"""Time between manoeuvres [s]."""
UNITS: Final = {
    "TAS": ("airspeed_m_s", "m/s"), "AOA": ("alpha_rad", "deg"), "GyrY": ("q_rad_s", "deg/s"),
    "AccZ": ("az_m_s2", "m/s/s"), "Elev": ("elevator_rad", "deg"), "Rho": ("density_kg_m3", "kg/m3"),
}  # fmt: skip
"""Field -> channel and unit."""
SUFFIX: Final = {"csv": ".csv", "dataflash": ".bin", "mdf": ".mf4", "hdf5": ".h5"}
"""Format -> suffix."""


def topics(hours: float) -> list[Topic]:
    """The linear GTM in light gusts with a 3-2-1-1 every minute, recorded at 100 Hz."""

    def inputs(t: np.ndarray) -> np.ndarray:
        phase = np.mod(t, EVERY_S) - 20.0 + 1e-9
        edges = 0.4 * np.cumsum([0, 3, 2, 1, 1])
        return sum(
            np.where((phase >= a) & (phase < b), sign, 0.0)
            for a, b, sign in zip(edges[:-1], edges[1:], (1.0, -1.0, 1.0, -1.0), strict=True)
        )

    batch = fly(rate_hz=100, duration_s=3600.0 * hours, gust=0.3, noise=0.5, shape=inputs, seed=1)
    factor = {"deg": 1.0 / DEG, "deg/s": 1.0 / DEG}
    c = {f: batch.channels[n][0] * factor.get(u, 1.0) for f, (n, u) in UNITS.items()}
    fast = ("GyrY", "AccZ", "Elev")
    others = {f"Other{i}": np.sin(batch.t_s[0] * (i + 1.0)) for i in range(6)}  # what a log holds besides
    t = batch.t_s[0] + 10.0
    return [
        Topic("IMU", t, {f: c[f] for f in fast} | others, {f: UNITS[f][1] for f in fast}),
        Topic("AIR", t, {f: c[f] for f in UNITS if f not in fast}, {f: UNITS[f][1] for f in UNITS}),
    ]


def written(form: str, made: list[Topic], folder: Path) -> Path:
    """The flight as a file of a format."""
    path = folder / f"flight{SUFFIX[form]}"
    if form == "dataflash":
        path.write_bytes(recorders.dataflash(made))
    elif form == "mdf":
        recorders.mdf4(path, made)
    elif form == "hdf5":
        recorders.hdf5(path, made)
    else:
        import pandas as pd

        both = {"time (s)": made[0].t_s}
        both |= {f"{n} ({t.units.get(n, '-')})": v for t in made for n, v in t.fields.items()}
        pd.DataFrame(both).to_csv(path, index=False, float_format="%.9g")
    return path


def memory(process: int) -> int:
    """Proportional memory of a process and its descendants [byte]."""
    total, waiting = 0, [process]
    while waiting:
        number = waiting.pop()
        try:
            lines = Path(f"/proc/{number}/smaps_rollup").read_text().splitlines()
            total += next(1024 * int(x.split()[1]) for x in lines if x.startswith("Pss:"))
            for task in Path(f"/proc/{number}/task").iterdir():
                waiting += [int(x) for x in (task / "children").read_text().split()]
        except (OSError, StopIteration):
            continue
    return total


def run(*arguments: object) -> tuple[float, int, str]:
    """Time [s], peak memory [byte] and output of a command."""
    start = time.monotonic()
    command = [sys.executable, "-m", "airtruth", *map(str, arguments)]
    child = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    peak, done = [0], threading.Event()

    def watch() -> None:
        while not done.wait(0.05):
            peak[0] = max(peak[0], memory(child.pid))

    thread = threading.Thread(target=watch)
    thread.start()
    out, error = child.communicate()
    done.set()
    thread.join()
    if child.returncode:
        raise SystemExit(f"{' '.join(command[2:])}: {error}")
    return time.monotonic() - start, peak[0], out


def measure(form: str, made: list[Topic]) -> bool:
    """Print a line for each command; whether the bars are met."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        path = written(form, made, folder)
        table, log = folder / "m.csv", folder / "log.parquet"
        guessed = run("import", "--guess", path)
        mapping = folder / "m.toml"
        mapping.write_text(guessed[2].replace("rate_hz = 50", "rate_hz = 100"))
        steps = {
            "find": run("import", path, "--mapping", mapping, "--find-manoeuvres", "--out", table, "--quiet"),
            "import": run(
                "import", path, "--mapping", mapping, "--manoeuvres", table, "--out", log, "--quiet"
            ),
            "identify": run("identify", log, "--aircraft", "gtm", "--method", "iv-f1", "--quiet"),
        }
        size = path.stat().st_size / 1e6
    seconds, peak = sum(s[0] for s in steps.values()), max(s[1] for s in steps.values())
    each = ", ".join(f"{name} {s[0]:.1f} s {s[1] / 1e6:.0f} MB" for name, s in steps.items())
    found = steps["find"][2].splitlines()[0]
    met = seconds <= SECONDS and peak <= BYTES
    print(
        f"{form} ({size:.0f} MB, {found}): {each}; together {seconds:.1f} s, peak {peak / 1e6:.0f} MB: "
        f"{'met' if met else 'MISSED'}",
        flush=True,
    )
    return met


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--formats", nargs="+", default=list(SUFFIX), choices=list(SUFFIX))
    parser.add_argument("--hours", type=float, default=1.0)
    options = parser.parse_args()
    made = topics(options.hours)
    missed = [form for form in options.formats if not measure(form, made)]
    raise SystemExit(1 if missed else 0)


if __name__ == "__main__":
    main()
