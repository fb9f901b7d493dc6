"""How often sets are right, by the posterior weight that answers give them: a reliability diagram of the blind trials.

    python -m validation.blind.calibration FOLDER [FOLDER ...] [--figure FILE.svg]

Every set of `alternatives` with at least a hundredth of the weight counts. `set_scoring.matches` tells whether it is right.
A set is true if it holds all strong effects of the truth, and nothing else; with no effect in the truth, the empty set is true.
Sets with learned increments do not count: the library has no name for them. Of 100 sets with a weight of 0.7, 70 should be right.
"""

from __future__ import annotations

import argparse
import itertools
import json
import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest

from validation.blind.scoring import INCREMENT, Case, effects
from validation.blind.set_scoring import matches, strong

Array = NDArray[np.float64]

EDGES: Final = np.linspace(0.0, 1.0, 11)
"""Ends of the classes of weights [-]: deciles."""
LACKING: Final = ("off-library", "leave-one-out")
"""Compositions whose effect the library lacks."""
LEAST: Final = 0.01
"""Least weight of a set that counts [-]."""


def cases_of(folders: Iterable[Path]) -> Iterator[tuple[str, Case]]:
    """Mode and case of every answer in folders of `python -m validation.blind --out`."""
    for folder in folders:
        for file in sorted((folder / "answer").glob("*.json")):
            truth = json.loads((folder / "truth" / file.name).read_text(encoding="utf-8"))
            answer = json.loads(file.read_text(encoding="utf-8"))
            if "failed" not in answer:
                yield file.name.split("-")[0], {"truth": truth, "answer": answer}


def weighed_sets(case: Case) -> Iterator[tuple[float, bool]]:
    """Weight of each set of a case that counts, and whether it is true."""
    for one in case["answer"].get("alternatives", ()):
        names = set(one["effects"])
        if one["weight"] >= LEAST and INCREMENT not in names:
            yield float(one["weight"]), matches(case, names) if effects(case) else not names


def is_counted(case: Case) -> bool:
    """Whether the truth is a set that the library can name: none, or effects that are strong."""
    is_lacking = case["truth"]["trial"]["composition"] in LACKING
    return not is_lacking and (not effects(case) or strong(case))


def reliability(pairs: Sequence[tuple[float, bool]]) -> list[dict[str, Any]]:
    """Rows of the deciles that have sets: their number, their mean weight, and the share that is right with its 95 % interval.

    Parameters
    ----------
    pairs : weight of each set, and whether it is right.
    """
    weights, right = np.array([w for w, _ in pairs]), np.array([r for _, r in pairs], dtype=bool)
    rows = []
    for low, high in itertools.pairwise(EDGES):
        own = (weights > low) & (weights <= high)
        if own.any():
            hits, count = int(right[own].sum()), int(own.sum())
            interval = binomtest(hits, count).proportion_ci(method="exact")
            rows.append(
                {
                    "from": float(low),
                    "to": float(high),
                    "sets": count,
                    "weight": float(weights[own].mean()),
                    "right": hits / count,
                    "interval": (float(interval.low), float(interval.high)),
                }
            )
    return rows


def markdown(modes: dict[str, list[tuple[float, bool]]]) -> str:
    """A table of all modes together, and one of the mean weight and the share that is right in each mode."""
    every = [pair for pairs in modes.values() for pair in pairs]
    lines = ["| weight | sets | mean weight | right (95 % interval) |", "|---|---|---|---|"]
    for row in reliability(every):
        low, high = row["interval"]
        lines.append(
            f"| {row['from']:.1f} to {row['to']:.1f} | {row['sets']} | {row['weight']:.2f} | {row['right']:.2f} "
            f"({low:.2f} to {high:.2f}) |"
        )
    lines += ["", "| mode | sets above 0.3 | mean weight | right (95 % interval) |", "|---|---|---|---|"]
    for mode, pairs in sorted(modes.items()):
        top = [(w, r) for w, r in pairs if w > 0.3]
        if top:
            hits = sum(r for _, r in top)
            interval = binomtest(hits, len(top)).proportion_ci(method="exact")
            lines.append(
                f"| {mode} | {len(top)} | {np.mean([w for w, _ in top]):.2f} | {hits / len(top):.2f} "
                f"({interval.low:.2f} to {interval.high:.2f}) |"
            )
    return "\n".join(lines) + "\n"


def draw(modes: dict[str, list[tuple[float, bool]]], file: Path) -> None:
    """Share of right sets over their weight, with 95 % intervals."""
    from airtruth import style

    figure = style.new_figure(4.2, 3.6)
    axes = figure.subplots()
    rows = reliability([pair for pairs in modes.values() for pair in pairs])
    weight, right = np.array([r["weight"] for r in rows]), np.array([r["right"] for r in rows])
    ends = np.array([r["interval"] for r in rows]).T
    axes.plot([0.0, 1.0], [0.0, 1.0], linewidth=0.8, color="0.6")
    axes.errorbar(weight, right, yerr=np.abs(ends - right), fmt="o", capsize=2.0)
    axes.set_xlabel("posterior weight of a set [-]")
    axes.set_ylabel("share of sets that are right [-]")
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(0.0, 1.0)
    style.save(figure, file)


def main(argv: Sequence[str] | None = None) -> None:
    """Print the tables, and draw the figure."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folders", nargs="+", type=Path, metavar="FOLDER")
    parser.add_argument("--figure", type=Path, metavar="FILE")
    options = parser.parse_args(argv)
    modes: dict[str, list[tuple[float, bool]]] = {}
    for mode, case in cases_of(options.folders):
        if is_counted(case):
            modes.setdefault(mode, []).extend(weighed_sets(case))
    sys.stdout.write(markdown(modes))
    if options.figure:
        draw(modes, options.figure)


if __name__ == "__main__":
    main()
