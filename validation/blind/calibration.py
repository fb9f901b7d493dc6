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
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from validation.blind.scoring import INCREMENT, Case, Share, effects, share
from validation.blind.set_scoring import matches, strong

Pairs = Sequence[tuple[float, bool]]
"""Weight of each set, and whether it is right."""

EDGES: Final = np.linspace(0.0, 1.0, 11)
"""Ends of the classes of weights [-]: deciles."""
LACKING: Final = ("off-library", "leave-one-out")
"""Compositions whose effect the library lacks."""
LEAST: Final = 0.01
"""Least weight of a set that counts [-]."""
LEADING: Final = 0.3
"""Weight above which the table of the modes counts a set [-]."""


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


@dataclass(frozen=True)
class Decile:
    """Sets whose weights are in one class: its ends [-], their mean weight [-], and how many are right."""

    low: float
    high: float
    weight: float
    right: Share


def reliability(pairs: Pairs) -> list[Decile]:
    """The deciles of weights that have sets.

    Parameters
    ----------
    pairs : weight of each set, and whether it is right.
    """
    found = []
    for low, high in itertools.pairwise(EDGES.tolist()):
        own = [pair for pair in pairs if low < pair[0] <= high]
        if own:
            found.append(Decile(low, high, _mean_weight(own), share(right for _, right in own)))
    return found


def _mean_weight(pairs: Pairs) -> float:
    return float(np.mean([weight for weight, _ in pairs]))


def _row(name: str, weight: float, right: Share) -> str:
    low, high = right.interval
    return f"| {name} | {right.count} | {weight:.2f} | {right.value:.2f} ({low:.2f} to {high:.2f}) |"


def markdown(modes: Mapping[str, Pairs]) -> str:
    """A table of all modes together, and one of the mean weight and the share that is right in each mode."""
    every = [pair for pairs in modes.values() for pair in pairs]
    lines = ["| weight | sets | mean weight | right (95 % interval) |", "|---|---|---|---|"]
    lines += [_row(f"{d.low:.1f} to {d.high:.1f}", d.weight, d.right) for d in reliability(every)]
    lines += ["", "| mode | sets above 0.3 | mean weight | right (95 % interval) |", "|---|---|---|---|"]
    for mode, pairs in sorted(modes.items()):
        top = [pair for pair in pairs if pair[0] > LEADING]
        if top:
            lines.append(_row(mode, _mean_weight(top), share(right for _, right in top)))
    return "\n".join(lines) + "\n"


def draw(modes: Mapping[str, Pairs], file: Path) -> None:
    """Share of right sets over their weight, with 95 % intervals."""
    from airtruth import style

    figure = style.new_figure(4.2, 3.6)
    axes = figure.subplots()
    deciles = reliability([pair for pairs in modes.values() for pair in pairs])
    weight, right = np.array([d.weight for d in deciles]), np.array([d.right.value for d in deciles])
    ends = np.array([d.right.interval for d in deciles]).T
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
