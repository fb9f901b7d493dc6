"""Twenty tasks of a newcomer, each with the commands that the documents show, in an empty folder.

A task is done if every command succeeds and leaves what the task asks for. Candidates of the traces are few, so that all tasks
take about two minutes of CPU.

    python -m studies.newcomer_tasks [--only N ...]

The exit code is 1 if a task fails. Later tasks use files of earlier ones, so that ``--only`` needs those of the numbers before.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parents[1]
"""Root of the repository."""
DATA: Final = ROOT / "data"
"""Shipped data; the folder of the tasks has them under the same name."""
LOG: Final = "data/undeclared/b.parquet"
"""Six records of a vane ahead of its declared location."""
FEW: Final = "--effect vane_arm --effect vane_lag --effect elevator_delay"
"""Candidates of a quick trace."""


@dataclass(frozen=True)
class Task:
    """What a newcomer wants.

    Attributes
    ----------
    title : the task.
    commands : lines of `airtruth`; a line that begins with "python:" is Python; "code N:" is the exit code to expect.
    files : what the task leaves.
    """

    title: str
    commands: tuple[str, ...]
    files: tuple[str, ...] = ()


OWN_CSV: Final = """
import airtruth as at
log = at.read_log("data/undeclared/b.parquet")
first = log.select(log.run_ids[0]).to_frame().drop(columns="run_id")
first.to_csv("flight.csv", index=False)
"""
REPLAY: Final = """
from pathlib import Path
text = Path("first.toml").read_text()
head, _, rest = text.partition("[[manoeuvre]]")
tail = rest[rest.index("[gust]"):]
manoeuvre = '[[manoeuvre]]\\nkind = "replay"\\nfile = "data/undeclared/b.parquet"\\nrun_id = "r1"\\n'
Path("replay.toml").write_text(head.replace("first", "replay").replace("duration_s = 5.0", "duration_s = 8.0") + manoeuvre + tail)
"""
OWN_EFFECT: Final = """
from pathlib import Path
Path("stall.py").write_text('''
from airtruth.effects.effect import Effect, Parameter
from airtruth.physics.terms import AeroTerm, Change
TIP_STALL = Effect(
    name="tip_stall", where="dynamics",
    parameters=(
        Parameter("dCLalpha", "-", "loss of lift slope above the break [1/rad]", -5.0, 0.0, material=0.25),
        Parameter("at_alpha_rad", "rad", "where it begins", 0.0, 0.3, material=0.0, is_location=True),
    ),
    describe=lambda v: Change(aero=(AeroTerm("CL", "alpha", "above", v["dCLalpha"], v["at_alpha_rad"]),)),
    explanation="The wing tips stall first: lift flattens early.", source="docs/effects.md",
)
''')
package = Path("stall-1.0.dist-info")
package.mkdir()
(package / "METADATA").write_text("Metadata-Version: 2.1\\nName: stall\\nVersion: 1.0\\n")
(package / "entry_points.txt").write_text("[airtruth.effects]\\ntip_stall = stall:TIP_STALL\\n")
"""
OWN_ESTIMATOR: Final = """
from dataclasses import replace
import airtruth as at
from airtruth.identification import METHODS
own = replace(METHODS["ls"], name="own")
assert at.identify("data/undeclared/b.parquet", "gtm", [own, "ls"]).methods == ("own", "ls")
"""
INTERVALS: Final = """
import airtruth as at
table = at.identify("data/undeclared/b.parquet", "gtm", ["ls", "iv-f1", "output-error"]).tidy()
assert {"lower", "upper"} <= set(table.columns) and table["method"].nunique() == 3
"""
DUCKDB: Final = """
import duckdb
rows = duckdb.sql("SELECT method, avg(Cmalpha) FROM 'out/first/estimates.parquet' GROUP BY method").fetchall()
assert len(rows) == 2
"""
PANDAS: Final = """
import pandas as pd
assert len(pd.read_parquet("out/first/estimates.parquet")) == 12
"""
NOTEBOOK: Final = """
import airtruth as at
assert "<table" in at.check("data/undeclared/b.parquet", "gtm")._repr_html_()
"""
GUESS: Final = "map.toml"
"""File into which the first task writes the proposed mapping."""

TASKS: Final = (
    Task(
        "trace my own CSV",
        (
            f"python:{OWN_CSV}",
            f"import --guess flight.csv > {GUESS}",
            f"import flight.csv --mapping {GUESS} --out flight.parquet",
            f"trace flight.parquet --aircraft gtm --out out/csv {FEW}",
        ),
        ("out/csv/trace.json",),
    ),
    Task(
        "aircraft.toml for a UAV of 3 kg",
        (
            "new aircraft --out uav --mass-kg 3 --length-m 1.2 --span-m 1.6 --wing-area-m2 0.4 --tail-area-m2 0.07 "
            "--tail-arm-m 0.75",
        ),
        ("uav/aircraft.toml",),
    ),
    Task(
        "is the vane ahead of the CG?",
        (f"check {LOG} --aircraft gtm", f"trace {LOG} --aircraft gtm --out out/vane {FEW}"),
        ("out/vane/trace.json",),
    ),
    Task("how many manoeuvres do I need?", ("new campaign --out first.toml", "plan first.toml")),
    Task("three estimators with intervals in pandas", (f"python:{INTERVALS}",)),
    Task(
        "tables in LaTeX",
        (
            "fly first.toml --out out/first",
            "identify out/first --aircraft gtm --method ls --method iv-f1",
            "report out/first --out first.html",
        ),
        ("first.html", "first.tex", "first.csv"),
    ),
    Task(
        "an effect of my own",
        (
            f"python:{OWN_EFFECT}",
            "effects tip_stall",
            f"trace {LOG} --aircraft gtm --out out/own {FEW} --effect tip_stall",
        ),
    ),
    Task("an estimator of my own", (f"python:{OWN_ESTIMATOR}",)),
    Task(
        "many runs of a JSBSim aircraft",
        ("fly first.toml --out out/many --runs 200", "identify out/many --aircraft gtm --method ls"),
        ("out/many/estimates.parquet",),
    ),
    Task("query a campaign with DuckDB", (f"python:{DUCKDB}",)),
    Task(
        "plan the next flight",
        (
            "trace data/undeclared/a.parquet --aircraft gtm --out out/a --effect elevator_delay --effect actuator_lag",
            "plan --from out/a --out next.toml",
        ),
        ("next.toml",),
    ),
    Task(
        "the same campaign with another seed",
        ("fly first.toml --out out/seven --seed 7",),
        ("out/seven/logs",),
    ),
    Task(
        "replay a measured elevator",
        (f"python:{REPLAY}", "fly replay.toml --out out/replay --runs 2"),
        ("out/replay/logs",),
    ),
    Task(
        "lateral-directional derivatives",
        ("fly data/campaigns/lateral.toml --out out/lateral --runs 4", "identify out/lateral --aircraft gtm"),
        ("out/lateral/estimates-lateral.parquet",),
    ),
    Task(
        "remove the effect and identify again",
        (f"loop {LOG} --aircraft gtm --out out/loop {FEW}", "report out/loop --out loop.html"),
        ("out/loop/loop.json", "loop.html", "loop.tex"),
    ),
    Task("update my JSBSim model", (), ("out/vane/aircraft/gtm/aircraft.toml",)),
    Task("use it in Jupyter", (f"python:{NOTEBOOK}",)),
    Task(
        "use it in continuous integration",
        (
            "verify out/first",
            "code 2:identify none.parquet --aircraft gtm",
            f"check {LOG} --aircraft gtm --json",
        ),
    ),
    Task(
        "export the state-space model",
        (
            f"identify {LOG} --aircraft gtm --method ls --out estimates.parquet",
            "export estimates.parquet --method ls --out short_period.mat",
            "export gtm --airspeed-m-s 43 --altitude-m 2134 --out gtm.json",
        ),
        ("short_period.mat", "gtm.json"),
    ),
    Task("read the estimates with pandas", (f"python:{PANDAS}",)),
)
"""The tasks, in an order in which each finds the files of those before."""


def outcome(task: Task, folder: Path) -> str:
    """Return what went wrong with a task; empty if nothing did."""
    for line in task.commands:
        code = 0
        if line.startswith("code "):
            number, _, line = line.removeprefix("code ").partition(":")
            code = int(number)
        words, _, target = line.partition(" > ")
        python = line.startswith("python:")
        command = ["-c", line.removeprefix("python:")] if python else ["-m", "airtruth", *words.split()]
        done = subprocess.run(
            [sys.executable, *command],
            cwd=folder,
            check=False,
            capture_output=True,
            text=True,
            env={**os.environ, "PYTHONPATH": os.pathsep.join((str(ROOT / "src"), str(folder)))},
        )
        if done.returncode != code:
            last = (done.stderr.strip().splitlines() or ["no message"])[-1]
            return f"{'Python' if python else 'airtruth ' + line}: exit code {done.returncode}; {last}"
        if target and not python:
            (folder / target).write_text(done.stdout, encoding="utf-8")
    missing = [name for name in task.files if not (folder / name).exists()]
    return f"does not leave {', '.join(missing)}" if missing else ""


def main() -> int:
    """Perform the tasks, print one line for each, and return the number of failed ones, at most 1."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", type=int, nargs="*")
    only = parser.parse_args().only
    failed = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "data").symlink_to(DATA)
        for number, task in enumerate(TASKS, start=1):
            if only and number not in only:
                continue
            wrong = outcome(task, folder)
            failed += bool(wrong)
            print(
                f"{number:2d} {'FAILED' if wrong else 'done  '} {task.title}{': ' + wrong if wrong else ''}",
                flush=True,
            )
    print(f"{failed} failed")
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
