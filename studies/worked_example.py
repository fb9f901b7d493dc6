"""The worked example of docs/measured.md: fly records, export them as a test centre does, run every command of the page
and write the output into the page.

    python -m studies.worked_example [--docs FILE] [--out DIR] [--check]
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
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.io import savemat

from airtruth.importers import guess_mapping, import_log
from airtruth.logs.store import iter_logs, write_log
from airtruth.simulation.campaign import plan
from airtruth.simulation.campaign import run as campaign
from airtruth.units import DEG, FT, G0, SLUG

Array = NDArray[np.float64]

ROOT: Final = Path(__file__).resolve().parents[1]
"""Root of the repository."""

PAGE: Final = ROOT / "docs" / "measured.md"
"""Page of the example."""

LATE_S: Final = 0.007
"""Delay of the air data, which have a clock of their own [s]."""

CAMPAIGN: Final = """schema = 1
name = "flight7"
title = "Worked example: a vane ahead of the CG that the aircraft file does not state"
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
"""Campaign of the example."""

SIGN: Final = ('unit = "deg"\nsign = -1\n', 'unit = "deg"\n')
"""Lines of the elevator in the guess, and the same without its sign."""

AIR_DATA: Final = ("airspeed_m_s", "altitude_m", "density_kg_m3")
"""Channels with the clock of the air data."""

TAIL: Final = '\n[resample]\nrate_hz = 50.0\nmethod = "cubic"\n'
"""End of the corrected mapping: one rate for all channels."""

_BLOCK: Final = r"(<!-- example: {name} -->\n```[a-z]*\n)(?:.*?\n)??(```)"
"""Pattern of a marked block of the page, its content without the marks."""


def fly(folder: Path) -> list[dict[str, Array]]:
    """Return the columns of each record as a test centre writes them: nz positive up, elevator trailing edge up positive."""
    file = folder / "campaign.toml"
    file.write_text(CAMPAIGN, encoding="utf-8")
    campaign.fly(plan.make(file), folder / "flown", 1)
    exported = []
    for log in iter_logs(folder / "flown"):
        for run in range(len(log.run_ids)):
            rows = log.rows(run)
            c = {name: values[rows] for name, values in log.channels.items()}
            t = log.t_s[rows] + 36.0 + 60.0 * len(exported)
            late = t + LATE_S
            air = {name: np.interp(late, t, c[name]) for name in AIR_DATA}
            exported.append(
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
    return exported


def export(records: list[dict[str, Array]], folder: Path) -> None:
    """Write the first record as CSV, and every record as .mat with one variable per column."""
    first = records[0]
    lines = [",".join(f"{x:.6f}" for x in row) for row in zip(*first.values(), strict=True)]
    (folder / "flight7.csv").write_text("\n".join([",".join(first), *lines]) + "\n", encoding="utf-8")
    for number, record in enumerate(records, start=1):
        columns = {re.sub(r"\W+", "_", name).strip("_"): values for name, values in record.items()}
        savemat(folder / f"tp{number}.mat", columns)


def mapping(guess: str, channels: tuple[str, ...], clock: str) -> str:
    """Return the guessed mapping with a reader's addition, the clock of the air data."""
    text = guess
    for name in channels:
        text = re.sub(
            rf"(\n\[channels\.{name}\][^\n]*\n)",
            rf'\1clock = {{ column = "{clock}", unit = "s" }}\n',
            text,
            count=1,
        )
    return text + TAIL


@dataclass
class Page:
    """Output and exit code of each command, by the name of its block."""

    folder: Path
    blocks: dict[str, str] = field(default_factory=dict)
    codes: dict[str, int] = field(default_factory=dict)

    def run(self, name: str, *arguments: str, keep: tuple[slice, ...] = (slice(None),)) -> str:
        """Run a command in the folder; keep its output, or parts of its lines."""
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
    """Run the example in a folder and return the blocks of the page."""
    records = fly(folder)
    export(records, folder)
    page = Page(folder)
    head = (folder / "flight7.csv").read_text(encoding="utf-8").splitlines()[:2]
    page.blocks["file"] = "\n".join(head)
    guess = page.run("guess", "import", "--guess", "flight7.csv", keep=(slice(0, 13), slice(35, 46))) + "\n"
    assert SIGN[0] in guess, guess
    (folder / "flight7.toml").write_text(guess.replace(*SIGN), encoding="utf-8")
    page.run("refused", "import", "flight7.csv", "--mapping", "flight7.toml", "--out", "flight7.parquet")
    (folder / "flight7.toml").write_text(mapping(guess, AIR_DATA, "ADC time (s)"), encoding="utf-8")
    page.run("imported", "import", "flight7.csv", "--mapping", "flight7.toml", "--out", "flight7.parquet")
    page.run("checked", "check", "flight7.parquet", keep=(slice(0, 9), slice(12, 35), slice(55, 67)))
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
        keep=(slice(0, 16),),
    )
    return page


def write(page: Page, path: Path) -> str:
    """Return the text of the page with each marked block replaced."""
    text = path.read_text(encoding="utf-8")
    for name, block in page.blocks.items():
        pattern = re.compile(_BLOCK.format(name=re.escape(name)), re.DOTALL)
        text = pattern.sub(partial(_replaced, block), text)
    return text


def _replaced(block: str, match: re.Match[str]) -> str:
    return f"{match[1]}{block}\n{match[2]}"


def main() -> None:
    """Run the example and rewrite the page; with --check, exit 1 if the page differs."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--docs", type=Path, default=PAGE)
    parser.add_argument("--out", type=Path, help="folder to keep the files in")
    parser.add_argument("--check", action="store_true", help="write nothing; exit 1 if the page differs")
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
