"""Random damages of a finished campaign: verify names each one, and the same command restores every file."""

from __future__ import annotations

import random
import shutil
from collections import Counter
from collections.abc import Callable
from pathlib import Path

from airtruth.logs.verify import verify
from airtruth.simulation.campaign.plan import Plan
from airtruth.simulation.campaign.run import fly
from validation.robustness.trees import digests


def flip(path: Path, rng: random.Random) -> None:
    """Change one bit."""
    content = bytearray(path.read_bytes())
    content[rng.randrange(len(content))] ^= 1 << rng.randrange(8)
    path.write_bytes(content)


def truncate(path: Path, rng: random.Random) -> None:
    """Cut the file anywhere."""
    path.write_bytes(path.read_bytes()[: rng.randrange(path.stat().st_size)])


def lengthen(path: Path, rng: random.Random) -> None:
    """Append random bytes."""
    path.write_bytes(path.read_bytes() + rng.randbytes(rng.randint(1, 50)))


def delete(path: Path, rng: random.Random) -> None:
    """Remove the file."""
    path.unlink()


def repeat(path: Path, rng: random.Random) -> None:
    """Append the file to itself."""
    path.write_bytes(path.read_bytes() * 2)


DAMAGES: tuple[Callable[[Path, random.Random], None], ...] = (flip, truncate, lengthen, delete, repeat)
"""Kinds of damage."""


def damage_trial(whole: Path, plan: Plan, folder: Path, seed: int) -> tuple[str, str, str]:
    """Damage one file of a copy of a campaign, and return the kind, the file and the fault ("" if there is none).

    Parameters
    ----------
    whole : folder of the finished campaign.
    plan : its plan.
    folder : folder of the copy; it is removed unless there is a fault.
    seed : seed of the damage.
    """
    rng = random.Random(seed)
    shutil.copytree(whole, folder)
    name = rng.choice([n for n in sorted(digests(whole)) if n != ".lock"])
    kind = DAMAGES[seed % len(DAMAGES)]
    kind(folder / name, rng)
    named = {finding.file for finding in verify(folder).findings}
    fault = "" if named == {name} else f"verify names {sorted(named)}"
    repaired = fly(plan, folder).repaired
    if not fault and not any(sentence.startswith(f"{name}: ") for sentence in repaired):
        fault = f"the resume reports {list(repaired)}"
    if not fault and not verify(folder).intact:
        fault = f"verify after the resume: {verify(folder).summary()}"
    if not fault and digests(folder) != digests(whole):
        fault = "the files after the resume differ"
    if not fault:
        shutil.rmtree(folder)
    return kind.__name__, name, fault


def run_damages(whole: Path, plan: Plan, scratch: Path, trials: int, seed: int) -> int:
    """Run trials, print a table by kind, and return the number of faults."""
    counts: Counter[str] = Counter()
    faults = 0
    for number in range(trials):
        kind, name, fault = damage_trial(whole, plan, scratch / f"damage-{number}", seed + number)
        counts[kind] += 1
        if fault:
            faults += 1
            print(f"damage {number}: {kind} {name}: {fault}", flush=True)
    for kind, count in sorted(counts.items()):
        print(f"{kind:<12}{count:>6}")
    print(f"{trials} damages, {faults} unnoticed or not restored", flush=True)
    return faults
