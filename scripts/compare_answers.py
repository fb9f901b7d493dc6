"""Record the answers of a version, and compare those of two versions.

    python -m scripts.compare_answers record OUT [--campaign DIR] [--measured DIR] [--jobs N]
    python -m scripts.compare_answers compare A B [--partial]

``record`` traces each flight test of data/undeclared, 24 frozen blind trials (seed 9) and, where the measured flights
are there, ATTAS both ways, all through the command line; it copies the tables of a finished `make campaign` too.
Another version of airtruth is recorded by putting its src first on PYTHONPATH. ``compare`` holds every number of
trace.json and of every CSV file of A against B within 1e-6 of its size (`LOOSER` lists the files with another bound,
and why), and every word exactly; exit 1 where they differ. Intended differences are listed in `EXCEPTIONS` and
`SEVERAL_CONDITIONS`, with the reason.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, Final

ROOT: Final = Path(__file__).resolve().parents[1]
TOLERANCE: Final = 1e-6
"""Relative difference of two numbers that counts as agreement [-]."""
LOOSER: Final[dict[str, tuple[float, str]]] = {
    r"^(undeclared|attas)/": (
        1e-4,
        "rounding in a rearranged kernel changes where an optimiser stops, within its tolerance in log likelihood; the "
        "earlier version with gravity changed by 1 part in 1e15 differs from itself by as much",
    ),
}
"""Pattern of a file -> relative difference of its numbers that is allowed [-], and why; the first match counts. Words,
and with them every verdict and name, agree exactly in each case."""
SEVERAL_CONDITIONS: Final = r"^(undeclared/[be]|frozen/[0-9]+)/"
"""Traces whose records may have several flight conditions: each record now has the declared derivatives, trim and gust
length of its own condition, where those of the first record served all. Verdict and effects agree exactly, sizes and
errors within `COARSE`; figures of candidates that explain nothing are passed over."""
COARSE: Final = 3e-2
"""Relative difference of sizes and errors for `SEVERAL_CONDITIONS` [-]."""
SMALL: Final = 1e-2
"""Absolute difference over the relative one that is allowed [SI]: for residuals and scores that cross zero."""
SEED: Final = 9
TRIALS: Final = 24
EXCEPTIONS: Final[dict[str, str]] = {
    r"notes(\[|$)": "sentences for people were rewritten",
    r"next_flight$": "sentences for people were rewritten",
    r"\.why_not$": "sentences for people were rewritten",
    r"updated_aircraft$": "a path of this machine",
}
"""Pattern of a path in an answer -> why it may differ."""


def trace(log: Path, aircraft: str, out: Path, *more: str) -> None:
    """One trace by the command line."""
    if (out / "trace.json").exists():
        return
    command = [
        sys.executable,
        "-m",
        "airtruth",
        "trace",
        str(log),
        "--aircraft",
        aircraft,
        "--out",
        str(out),
        *more,
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(f"{' '.join(command)}: exit {done.returncode}\n{done.stderr}")


def record(out: Path, campaign: Path | None, measured: Path, jobs: int) -> None:
    """Write the answers of the installed version to a folder."""
    work: list[tuple[Any, ...]] = []
    for log in sorted((ROOT / "data" / "undeclared").glob("*.parquet")):
        work.append((log, "gtm", out / "undeclared" / log.stem))
    work += [(log, "gtm", out / "frozen" / log.parent.name) for log in _frozen(out / "flights")]
    if (measured / "fAttasElv1.mat").exists():
        logs = _attas(measured, out / "attas-logs")
        for held in logs:
            both = out / "attas" / held.stem
            work.append(
                (logs[0].parent, str(ROOT / "tests" / "measured" / "attas"), both, "--hold-out", held.stem)
            )
    with ThreadPoolExecutor(jobs) as pool:
        for number, _ in enumerate(pool.map(lambda w: trace(*w), work), 1):
            print(f"\r{number} of {len(work)} traces", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    if campaign is not None:
        for path in [*campaign.glob("tables/*.csv"), *campaign.glob("loop/*.csv")]:
            target = out / "campaign" / path.relative_to(campaign)
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(path, target)


def _frozen(folder: Path) -> list[Path]:
    """Logs of the frozen trials, flown once."""
    from validation.blind.trials import frozen

    logs = [folder / f"{k:02d}" / "log.parquet" for k in range(TRIALS)]
    missing = [k for k, log in enumerate(logs) if not log.exists()]
    if missing:
        flown = frozen(SEED, missing, "mixed", folder / "flown")
        for k, place in zip(missing, flown, strict=True):
            logs[k].parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(place / "log.parquet" if place.is_dir() else place, logs[k])
    return logs


def _attas(measured: Path, folder: Path) -> list[Path]:
    folder.mkdir(parents=True, exist_ok=True)
    found = []
    for name in ("fAttasElv1", "fAttasElv2"):
        text = (ROOT / "tests" / "measured" / "attas.toml").read_text(encoding="utf-8")
        mapping = folder / f"{name}.toml"
        mapping.write_text(text + f'\n[source]\nvariable = "{name}"\n' if "[source]" not in text else text)
        log = folder / f"{name}.parquet"
        command = [sys.executable, "-m", "airtruth", "import", str(measured / f"{name}.mat")]
        subprocess.run(
            [*command, "--mapping", str(mapping), "--out", str(log)], check=True, capture_output=True
        )
        mapping.unlink()
        found.append(log)
    return found


def _essence(answer: Any) -> Any:
    """Verdict, effects with their sizes, and held-out errors of an answer."""
    return {
        "verdict": answer["verdict"],
        "provisional": answer["provisional"],
        "effects": [
            {"name": e["name"], "sizes": {k: p["value"] for k, p in e["parameters"].items()}}
            for e in answer["effects"]
        ],
        "error": {stage: answer["error"].get(stage, {}).get("held_out") for stage in ("before", "after")},
    }


def _differences_of(name: Path, a: Any, b: Any) -> list[str]:
    if re.search(SEVERAL_CONDITIONS, name.as_posix()):
        return list(differences(_essence(a), _essence(b), COARSE)) if name.suffix == ".json" else []
    return list(differences(a, b, tolerance_of(name)))


def tolerance_of(file: Path) -> float:
    """Relative difference that is allowed between the numbers of two versions of a file [-]."""
    matching = (
        tolerance for pattern, (tolerance, _) in LOOSER.items() if re.search(pattern, file.as_posix())
    )
    return next(matching, TOLERANCE)


def differences(a: Any, b: Any, tolerance: float, where: str = "") -> Iterator[str]:
    """Paths at which two answers differ, each with both values."""
    if any(re.search(pattern, where) for pattern in EXCEPTIONS):
        return
    if isinstance(a, dict) and isinstance(b, dict):
        for key in a:
            if key not in b:
                yield f"{where}.{key}: missing in the second"
            else:
                yield from differences(a[key], b[key], tolerance, f"{where}.{key}")
    elif isinstance(a, list) and isinstance(b, list):
        if len(a) != len(b):
            yield f"{where}: {len(a)} entries, {len(b)} in the second"
        for i, (x, y) in enumerate(zip(a, b, strict=False)):
            yield from differences(x, y, tolerance, f"{where}[{i}]")
    elif _is_number(a) and _is_number(b):
        if not math.isclose(float(a), float(b), rel_tol=tolerance, abs_tol=tolerance * SMALL):
            yield f"{where}: {a}, {b} in the second"
    elif a != b:
        yield f"{where}: {a!r}, {b!r} in the second"


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _read(path: Path) -> Any:
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".json":
        return json.loads(text)
    return [[_cell(c) for c in row] for row in csv.reader(text.splitlines())]


def _cell(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text


def compare(a: Path, b: Path, partial: bool = False) -> int:
    """Print what differs; the number of files that differ. ``partial`` passes over files that B lacks."""
    files = [p for p in sorted(a.rglob("*")) if p.name == "trace.json" or p.suffix == ".csv"]
    if partial:
        files = [p for p in files if (b / p.relative_to(a)).exists()]
    if not files:
        raise SystemExit(f"{a}: no answers; record them first")
    different = 0
    for path in files:
        name = path.relative_to(a)
        other = b / name
        found = (
            _differences_of(name, _read(path), _read(other)) if other.exists() else ["missing in the second"]
        )
        if found:
            different += 1
            print(f"{name}: {len(found)} differences")
            for line in found[:8]:
                print(f"  {line}")
    print(
        f"{len(files) - different} of {len(files)} files agree (numbers within {TOLERANCE:g}, or as listed in LOOSER)"
    )
    return different


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    verbs = parser.add_subparsers(dest="verb", required=True)
    recorder = verbs.add_parser("record")
    recorder.add_argument("out", type=Path)
    recorder.add_argument("--campaign", type=Path)
    recorder.add_argument("--measured", type=Path, default=ROOT.parent / "shared" / "measured")
    recorder.add_argument("--jobs", type=int, default=2)
    comparer = verbs.add_parser("compare")
    comparer.add_argument("a", type=Path)
    comparer.add_argument("b", type=Path)
    comparer.add_argument("--partial", action="store_true", help="pass over files that B lacks")
    options = parser.parse_args()
    if options.verb == "record":
        record(options.out, options.campaign, options.measured, options.jobs)
    else:
        sys.exit(1 if compare(options.a, options.b, options.partial) else 0)


if __name__ == "__main__":
    main()
