"""Commands that are killed at random moments: the same command again writes the files of an undisturbed one."""

from __future__ import annotations

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from airtruth.logs.store import read_log, write_log
from validation.robustness.trees import digests

ROOT = Path(__file__).resolve().parents[2]
"""Root of the project."""
MODES = ("KILL process", "KILL worker", "KILL group", "TERM process", "INT group")
"""Ways of killing: signal and target."""
MOST_KILLS = 3
"""Kills in one trial, each of the same command again."""
PATIENCE_S = 600.0
"""Time for a command [s] (judgement: many times that of each)."""
EFFECT = '\n[[effect]]\nname = "elevator_delay"\ndelay_s = 0.03\n'
"""Effect of the flown campaign, so that a copy of the aircraft is in the temporary folder."""


@dataclass(frozen=True)
class Verb:
    """A command that is killed.

    Attributes
    ----------
    name : its name.
    arguments : of airtruth, paths relative to the trial's folder.
    inputs : files and folders that a trial starts with.
    seconds : duration of the undisturbed command.
    files : its files by name, with their digests.
    """

    name: str
    arguments: tuple[str, ...]
    inputs: tuple[Path, ...]
    seconds: float = 0.0
    files: tuple[tuple[str, str], ...] = ()


def prepared_verbs(folder: Path, names: Sequence[str] | None = None) -> list[Verb]:
    """Write the inputs of each command, run it undisturbed, and return the commands."""
    inputs = folder / "inputs"
    inputs.mkdir(parents=True)
    text = (ROOT / "data" / "campaigns" / "light.toml").read_text(encoding="utf-8")
    (inputs / "c.toml").write_text(text + EFFECT, encoding="utf-8")
    log = read_log(ROOT / "data" / "undeclared" / "a.parquet")
    write_log(inputs / "a.parquet", log.select(run_ids=log.run_ids[:2]))
    linear = (
        "a.parquet",
        "--aircraft",
        "gtm",
        "--model",
        "linear",
        "--effect",
        "elevator_delay",
        "--jobs",
        "1",
    )
    given = (inputs / "a.parquet",)
    fly = Verb("fly", ("fly", "c.toml", "--out", "out", "--runs", "40", "--jobs", "2"), (inputs / "c.toml",))
    trace = Verb("trace", ("trace", *linear, "--out", "out"), given)
    flown, traced = folder / "flown", folder / "traced"
    identify = Verb("identify", ("identify", "out", "--aircraft", "gtm", "--method", "ls"), (flown / "out",))
    loop = Verb("loop", ("loop", *linear, "--out", "out"), given)
    report = Verb("report", ("report", "out", "--out", "page.html"), (traced / "out",))
    chosen = [v for v in (fly, identify, trace, loop, report) if not names or v.name in names]
    sources = {
        v: folder
        for v, folder, users in ((fly, flown, {"fly", "identify"}), (trace, traced, {"trace", "report"}))
        if users & {c.name for c in chosen}
    }
    whole = {v.name: undisturbed(v, folder) for v, folder in sources.items()}
    return [whole.get(v.name) or undisturbed(v, folder / f"whole-{v.name}") for v in chosen]


def undisturbed(verb: Verb, folder: Path) -> Verb:
    """Run a command and return it with its duration and its files."""
    start(verb, folder)
    before = time.monotonic()
    code, err = ended(command(verb, folder))
    if code:
        raise RuntimeError(f"{verb.name} ended with {code}: {err}")
    seconds = time.monotonic() - before
    return Verb(verb.name, verb.arguments, verb.inputs, seconds, tuple(digests(folder).items()))


def start(verb: Verb, folder: Path) -> None:
    """Create the folder of a trial with the inputs and an empty temporary folder."""
    (folder / "tmp").mkdir(parents=True)
    for source in verb.inputs:
        if source.is_dir():
            shutil.copytree(source, folder / source.name)
        else:
            shutil.copy(source, folder)


def command(verb: Verb, folder: Path) -> subprocess.Popen[str]:
    """Start a command in a session of its own."""
    return subprocess.Popen(
        [sys.executable, "-P", "-m", "airtruth", *verb.arguments],
        cwd=folder,
        env=os.environ | {"TMPDIR": str(folder.resolve() / "tmp")},
        start_new_session=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=_default_interrupt,
    )


def _default_interrupt() -> None:
    signal.signal(signal.SIGINT, signal.default_int_handler)  # background jobs of a shell ignore it


def ended(process: subprocess.Popen[str]) -> tuple[int, str]:
    """Wait for a command; return its exit code and what it printed on stderr."""
    _, err = process.communicate(timeout=PATIENCE_S)
    return process.returncode, err


def kill_trial(verb: Verb, folder: Path, seed: int) -> tuple[str, int, str]:
    """Kill a command once or more and run it again; return the mode, the number of kills and the fault.

    Parameters
    ----------
    verb : the command.
    folder : folder of the trial, removed unless there is a fault.
    seed : seed of the moments.
    """
    rng = random.Random(seed)
    mode = MODES[seed % len(MODES)]
    start(verb, folder)
    kills = 0
    for _ in range(rng.randint(1, MOST_KILLS)):
        process = command(verb, folder)
        try:
            process.wait(rng.uniform(0.0, 1.1) * verb.seconds)
        except subprocess.TimeoutExpired:
            _kill(process, mode, rng)
            kills += 1
        code, err = ended(process)
        if "Traceback" in err or "unexpected error" in err or code == 70:
            return mode, kills, f"exit {code}: {err}"
    code, err = ended(command(verb, folder))
    if code:
        return mode, kills, f"the same command again: exit {code}: {err}"
    here, whole = digests(folder), dict(verb.files)
    if here != whole:
        wrong = sorted(name for name in here.keys() | whole.keys() if here.get(name) != whole.get(name))
        return mode, kills, f"differ or are left: {wrong}"
    left = [p.relative_to(folder).as_posix() for p in folder.rglob("*.tmp") if p.is_dir()]
    if left:
        return mode, kills, f"folders are left: {left}"
    shutil.rmtree(folder)
    return mode, kills, ""


def _kill(process: subprocess.Popen[str], mode: str, rng: random.Random) -> None:
    name, target = mode.split()
    number = getattr(signal, f"SIG{name}")
    if target == "group":
        os.killpg(process.pid, number)
        return
    children = _children(process.pid) if target == "worker" else []
    try:
        os.kill(rng.choice(children) if children else process.pid, number)
    except ProcessLookupError:  # the worker ended first
        process.send_signal(number)


def _children(pid: int) -> list[int]:
    tasks = Path(f"/proc/{pid}/task/{pid}/children")
    try:
        return [int(child) for child in tasks.read_text().split()]
    except OSError:
        return []


def run_kills(verbs: Sequence[Verb], scratch: Path, trials: int, seed: int) -> int:
    """Run trials, print a table by command and mode, and return the number of faults."""
    kills: Counter[tuple[str, str]] = Counter()
    faults = number = 0
    while kills.total() < trials:
        verb = verbs[number // len(MODES) % len(verbs)]
        folder = scratch / f"kill-{number}"
        mode, count, fault = kill_trial(verb, folder, seed + number)
        kills[verb.name, mode] += count
        if fault:
            faults += 1
            print(f"trial {number} (seed {seed + number}), {verb.name}, {mode}: {fault}", flush=True)
        number += 1
    print(f"{'':<12}" + "".join(f"{mode:>14}" for mode in MODES))
    for verb in verbs:
        print(f"{verb.name:<12}" + "".join(f"{kills[verb.name, mode]:>14}" for mode in MODES))
    print(f"{kills.total()} kills in {number} trials, {faults} bad", flush=True)
    return faults
