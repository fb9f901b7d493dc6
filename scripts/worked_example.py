"""The worked example of docs/measured.md: flies the records, exports them as a test centre would, runs every
command of the page and writes what they print into it.

    python scripts/worked_example.py [--docs FILE] [--out DIR] [--check]
"""

from __future__ import annotations

import argparse
import contextlib
import os
import re
import subprocess
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.io import savemat

from airtruth.fly import campaign, plan
from airtruth.logs.importers import guess_mapping, import_log
from airtruth.logs.store import iter_logs, write_log
from airtruth.units import DEG, FT, G0, SLUG

Array = NDArray[np.float64]

ROOT: Final = Path(__file__).resolve().parents[1]
PAGE: Final = ROOT / "docs" / "measured.md"
LATE_S: Final = 0.007
"""Air data are sampled so much after the rest, on a clock of their own."""

CAMPAIGN: Final = """schema = 1
name = "flight7"
title = "Worked example: a vane ahead of the CG that nobody mentions"
aircraft = "gtm"
runs = 6
seed = 7
duration_s = 10.0
[condition]
eas_kt = 75.0
altitude_ft = 7000.0
[[manoeuvre]]
kind = "3211"
amplitude_deg = 1.5
start_s = 1.0
step_s = 0.35
[gust]
figures = "gtm"
level = "light"
factor = 0.3
[[effect]]
name = "vane_arm"
x_m = 0.8
"""
MAP_EDITS: Final = (
    # what a reader of the guess has to settle: the sign it complains of, the second clock, the runs
    ("[channels.elevator_rad]", "[channels.elevator_rad]\nsign = -1"),
)
AIR_DATA: Final = ("airspeed_m_s", "altitude_m", "density_kg_m3")
TAIL: Final = '\n[resample]\nrate_hz = 50.0\nmethod = "cubic"\n'
_BLOCK: Final = r"(<!-- example: {name} -->\n```[a-z]*\n)(?:.*?\n)??(```)"


def fly(folder: Path) -> list[dict[str, Array]]:
    """Columns of each record as the test centre writes them: nz positive up, elevator trailing edge up positive."""
    file = folder / "campaign.toml"
    file.write_text(CAMPAIGN, encoding="utf-8")
    campaign.fly(plan.make(file), folder / "flown", 1)
    found = []
    for log in iter_logs(folder / "flown"):
        for run in range(len(log.run_ids)):
            rows = log.rows(run)
            c = {name: values[rows] for name, values in log.channels.items()}
            t = log.t_s[rows] + 36.0 + 60.0 * len(found)
            late = t + LATE_S
            air = {name: np.interp(late, t, c[name]) for name in AIR_DATA}
            found.append(
                {
                    "Time (s)": t,
                    "ADC time (s)": late,
                    "TAS [ft/s]": air["airspeed_m_s"] / FT,
                    "AOA (deg)": c["alpha_rad"] / DEG,
                    "Pitch (deg)": c["theta_rad"] / DEG,
                    "Pitch rate (deg/s)": c["q_rad_s"] / DEG,
                    "Ax (g)": c["ax_m_s2"] / G0,
                    "Nz (g)": -c["az_m_s2"] / G0,
                    "Elevator (deg)": -c["elevator_rad"] / DEG,
                    "Alt (ft)": air["altitude_m"] / FT,
                    "Rho (slug/ft3)": air["density_kg_m3"] / (SLUG / FT**3),
                }
            )
    return found


def export(records: list[dict[str, Array]], folder: Path) -> None:
    """The first record as CSV, and every record as .mat (a matrix and its labels)."""
    first = records[0]
    lines = [",".join(f"{x:.6f}" for x in row) for row in zip(*first.values(), strict=True)]
    (folder / "flight7.csv").write_text("\n".join([",".join(first), *lines]) + "\n", encoding="utf-8")
    for number, record in enumerate(records, start=1):
        columns = {re.sub(r"\W+", "_", name).strip("_"): values for name, values in record.items()}
        savemat(folder / f"tp{number}.mat", columns)


def mapping(guess: str, channels: tuple[str, ...], clock: str) -> str:
    """The guess as a reader settles it: the elevator's sign, and the clock of the air data."""
    text = guess
    for old, new in MAP_EDITS:
        assert old in text, text
        text = text.replace(old, new, 1)
    for name in channels:
        text = re.sub(
            rf"(\[channels\.{name}\][^\n]*\n)",
            rf'\1clock = {{ column = "{clock}", unit = "s" }}\n',
            text,
            count=1,
        )
    return text + TAIL


@dataclass
class Page:
    """What the commands printed, and their exit codes, by the name of the block."""

    folder: Path
    blocks: dict[str, str] = field(default_factory=dict)
    codes: dict[str, int] = field(default_factory=dict)

    def run(self, name: str, *arguments: str, keep: tuple[slice, ...] = (slice(None),)) -> str:
        """Run a command in the folder and keep what it prints, or parts of its lines."""
        environment = os.environ | {"COLUMNS": "200"}
        command = [sys.executable, "-m", "airtruth", *arguments]
        done = subprocess.run(
            command, cwd=self.folder, capture_output=True, text=True, check=False, env=environment
        )
        printed = (done.stderr if done.returncode else done.stdout).rstrip("\n")
        self.codes[name] = done.returncode
        lines = [line.rstrip() for line in printed.splitlines()]
        shown = [f"$ airtruth {' '.join(arguments)}"]
        for part in keep:
            shown += lines[part]
            if part.stop is not None:
                shown.append("...")
        self.blocks[name] = "\n".join(shown)
        return printed


def make(folder: Path) -> Page:
    """Everything that the page shows, made in a folder."""
    records = fly(folder)
    export(records, folder)
    page = Page(folder)
    head = (folder / "flight7.csv").read_text(encoding="utf-8").splitlines()[:2]
    page.blocks["file"] = "\n".join(head)
    guess = page.run("guess", "import", "--guess", "flight7.csv", keep=(slice(0, 12), slice(28, 38))) + "\n"
    (folder / "flight7.toml").write_text(guess, encoding="utf-8")
    page.run("refused", "import", "flight7.csv", "--mapping", "flight7.toml", "--out", "flight7.parquet")
    (folder / "flight7.toml").write_text(mapping(guess, AIR_DATA, "ADC time (s)"), encoding="utf-8")
    page.run("imported", "import", "flight7.csv", "--mapping", "flight7.toml", "--out", "flight7.parquet")
    page.run("checked", "check", "flight7.parquet", keep=(slice(0, 8), slice(16, 26)))
    page.run("identified", "identify", "flight7.parquet", "--aircraft", "gtm", "--method", "ls")
    (folder / "logs").mkdir(exist_ok=True)
    for number in range(1, len(records) + 1):
        file = folder / f"tp{number}.mat"
        own = folder / f"tp{number}.toml"
        own.write_text(mapping(guess_mapping(file), AIR_DATA, "ADC_time_s"), encoding="utf-8")
        write_log(folder / "logs" / f"tp{number}.parquet", import_log(file, own).log, dtype="float64")
    page.run(
        "traced",
        *("trace", "logs", "--aircraft", "gtm", "--jobs", "1", "--out", "traced", "--quiet"),
        keep=(slice(0, 15),),
    )
    return page


def write(page: Page, path: Path) -> str:
    """The page with every block that carries a mark made anew."""
    text = path.read_text(encoding="utf-8")
    for name, block in page.blocks.items():
        pattern = re.compile(_BLOCK.format(name=re.escape(name)), re.DOTALL)
        text = pattern.sub(lambda m, block=block: f"{m[1]}{block}\n{m[2]}", text)  # type: ignore[misc]
    return text


def main() -> None:
    """Make the example and rewrite the page, or with --check say whether the page is what comes out."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--docs", type=Path, default=PAGE)
    parser.add_argument("--out", type=Path, help="folder to keep the files in")
    parser.add_argument("--check", action="store_true", help="write nothing; exit 1 if the page is another")
    given = parser.parse_args()
    with contextlib.ExitStack() as stack:
        folder = given.out or Path(stack.enter_context(tempfile.TemporaryDirectory()))
        folder.mkdir(parents=True, exist_ok=True)
        text = write(make(folder), given.docs)
    if given.check:
        sys.exit(0 if text == given.docs.read_text(encoding="utf-8") else 1)
    given.docs.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
