"""Small campaigns for tests, and what their folders hold."""

from __future__ import annotations

import contextlib
import io
import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from airtruth import cli
from airtruth.logs import manifest, store
from airtruth.simulation.campaign import plan
from airtruth.simulation.campaign import run as campaign

GUST = {"level": "light", "figures": "gtm"}


def toml(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{k} = {toml(v)}" for k, v in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(toml(v) for v in value) + "]"
    return f'"{value}"' if isinstance(value, str | Path) else repr(value)


def write(path: Path, **changes: Any) -> Path:
    """A campaign file; ``changes`` replace its top-level entries, None removes one."""
    content: dict[str, Any] = {
        "schema": 1,
        "name": "small",
        "aircraft": "gtm",
        "runs": 4,
        "seed": 3,
        "duration_s": 2.0,
        "condition": {"eas_kt": 75.0, "altitude_ft": 7000.0},
        "manoeuvre": [{"kind": "doublet", "amplitude_deg": 2.0, "start_s": 0.5, "step_s": 0.25}],
        "gust": GUST,
    }
    content |= changes
    path.write_text("".join(f"{k} = {toml(v)}\n" for k, v in content.items() if v is not None))
    return path


def fly(folder: Path, jobs: int = 1, **changes: Any) -> Path:
    """Fly a campaign in this process and return its folder."""
    folder.mkdir(parents=True, exist_ok=True)
    out = folder / "out"
    campaign.fly(plan.make(write(folder / "campaign.toml", **changes)), out, jobs)
    return out


def read(out: Path) -> pd.DataFrame:
    """All samples of a campaign, in the order of its files."""
    return pd.concat([pd.read_parquet(p) for p in store.log_paths(out)], ignore_index=True)


def channel(out: Path, name: str) -> np.ndarray:
    """(runs, samples) of one channel."""
    log = read(out)
    return log[name].to_numpy(dtype=float).reshape(log["run_id"].nunique(), -1)


def results(out: Path) -> dict[str, bytes]:
    """Every file that must not depend on how a campaign was flown, with its bytes."""
    assert not leftovers(out)
    files = [
        *sorted((out / "logs").iterdir()),
        out / "plan.parquet",
        out / "truth.parquet",
        out / "campaign.json",
        out / "manifest.jsonl",
    ]
    return {p.relative_to(out).as_posix(): p.read_bytes() for p in files}


def runs_recorded(out: Path) -> list[dict[str, Any]]:
    """Name, status and reason of each run whose chunk is in a manifest."""
    chunks: dict[int, Any] = {
        r["chunk"]: r for r in manifest.scan(out / "manifest.jsonl").records if "chunk" in r
    }
    if not chunks:
        return []
    table = pd.read_parquet(out / "plan.parquet", columns=["run_id", "chunk"])
    ended = []
    for number, record in chunks.items():
        states = {
            run: (status, reason)
            for status in ("failed", "interrupted")
            for run, reason in record.get(status, {}).items()
        }
        for run in table.loc[table["chunk"] == number, "run_id"]:
            status, reason = states.get(run, ("ok", ""))
            ended.append({"run_id": run, "status": status, "reason": reason})
    return ended


def leftovers(out: Path) -> list[Path]:
    """Temporary files and parts that a finished campaign must not hold."""
    return [*out.rglob("*.tmp"), *out.glob("truth-parts*")]


@dataclass(frozen=True)
class Ended:
    """How a command ended."""

    code: int
    out: str
    err: str


def command(*arguments: object) -> Ended:
    """Run the command line in this process."""
    out, err, argv = io.StringIO(), io.StringIO(), sys.argv
    code = 0
    sys.argv = ["airtruth", *map(str, arguments)]
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            cli.main()
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
    finally:
        sys.argv = argv
    return Ended(code, out.getvalue(), err.getvalue())


def children(pid: int) -> list[int]:
    """Worker processes of a process (Linux)."""
    found = []
    for entry in Path("/proc").iterdir():
        with contextlib.suppress(OSError, IndexError, ValueError):
            number = int(entry.name)
            parent = int((entry / "stat").read_text().rsplit(")", 1)[1].split()[1])
            if parent == pid and b"airtruth.simulation.campaign.worker" in (entry / "cmdline").read_bytes():
                found.append(number)
    return found


def alive(pid: int) -> bool:
    """Whether a process still runs (a zombie does not)."""
    try:
        os.kill(pid, 0)
        return (Path("/proc") / str(pid) / "stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except (OSError, IndexError):
        return False
