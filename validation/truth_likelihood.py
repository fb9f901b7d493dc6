"""Does the tracer's likelihood prefer the answer of a blind trial to the set that was flown?

    python -m validation.truth_likelihood --blind out/blind/triple-1

Each answered trial of ``python -m validation.blind`` whose names differ from the truth is fitted again with the tracer's filter,
without a search. One fit has the effects of the answer and begins at their estimates. The other has those of the truth and begins
at the true sizes. Both are repeated from where the other ended. Where the log-posterior of the answer is larger, no search that
maximises it could name the truth first. Where that of the truth is larger, the search missed it, or its evidence is too weak to
be accepted. A truth or an answer with increments, changed derivatives or effects that the library lacks is not compared. The
ranges that the kinematic check sets do not count.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from airtruth import aircraft
from airtruth.effects.registry import EFFECTS
from airtruth.logs.store import read_log
from airtruth.tracing import TraceOptions
from airtruth.tracing.calibration.corner_share import with_corner_share
from airtruth.tracing.calibration.noise_colour import with_coloured_noise
from airtruth.tracing.inference.optimise import fit
from airtruth.tracing.inference.posterior import PosteriorFit
from airtruth.tracing.model.parameters import Parameters
from airtruth.tracing.prepare import Case, prepare
from validation.blind.scoring import Share, base

_DECLARED: Final = "gtm"

Sizes = Mapping[str, Mapping[str, float]]
"""Key of an effect -> name of a parameter -> value [SI]."""


@dataclass(frozen=True)
class Comparison:
    """One trial.

    Attributes
    ----------
    truth, answer : keys of the effects.
    lead : log-posterior of the answer less that of the truth, one less for each parameter; None where one cannot be fitted or the
        answer is not compared.
    """

    truth: tuple[str, ...]
    answer: tuple[str, ...]
    lead: float | None

    @property
    def right(self) -> bool:
        """Whether the answer has the names of the truth."""
        return sorted(map(base, self.truth)) == sorted(map(base, self.answer))


def compare(truth: Mapping[str, Any], answer: Mapping[str, Any], log: Path) -> Comparison:
    """Compare the answer of one trial with its truth.

    Parameters
    ----------
    truth, answer : contents of their files; log : the trial's log.
    """
    flown = {e["key"]: e["values"] for e in truth["trial"]["effects"]}
    named = {_key(e): {n: p["value"] for n, p in e["parameters"].items()} for e in answer["effects"]}
    found = Comparison(tuple(flown), tuple(named), None)
    keys = {*flown, *named}
    if found.right or not keys <= EFFECTS.keys() or any(EFFECTS[key].in_derivatives for key in keys):
        return found
    library = [e for e in EFFECTS.values() if not e.in_derivatives]
    case, start = with_coloured_noise(
        prepare([read_log(log)], aircraft.load(_DECLARED), library, TraceOptions())
    )
    case = with_corner_share(case, start)
    sets = flown, named
    first = [_fitted(case, sizes, start) for sizes in sets]
    second = [
        other and _fitted(case, sizes, other.point) for sizes, other in zip(sets, first[::-1], strict=True)
    ]
    costs = [
        min((f.cost + len(f.point.sizes) for f in ends if f), default=None)
        for ends in zip(first, second, strict=True)
    ]
    return found if None in costs else replace(found, lead=float(np.subtract(*costs)))


def _fitted(case: Case, sizes: Sizes, start: Parameters) -> PosteriorFit | None:
    """A set with all parameters free; the search begins at these sizes, and with all else at ``start``."""
    hypothesis, begin = case.hypothesis, []
    for key, values in sizes.items():
        hypothesis = hypothesis.plus(EFFECTS[key])
        begin += [p.size(values[p.name]) for p in EFFECTS[key].parameters]
    return fit(case.fitted, hypothesis, replace(start, sizes=np.array(begin)))


def _key(effect: Mapping[str, Any]) -> str:
    parts = (effect["name"], effect.get("variant"), effect.get("channel"))
    return ":".join(dict.fromkeys(part for part in parts if part))


def compared(folder: Path) -> dict[str, Comparison]:
    """Every answered trial of a folder of blind trials, by its name."""
    found = {}
    for file in sorted((folder / "answer").glob("*.json")):
        answer = json.loads(file.read_text())
        if "failed" not in answer:
            truth = json.loads((folder / "truth" / file.name).read_text())
            found[file.stem] = compare(truth, answer, folder / "logs" / file.stem / "log.parquet")
            print(f"\r{len(found)} trials", end="", file=sys.stderr)
    print(file=sys.stderr)
    return found


def main(arguments: Sequence[str] | None = None) -> int:
    """Print every trial that differs, and the counts."""
    parser = argparse.ArgumentParser(prog="python -m validation.truth_likelihood", description=__doc__)
    parser.add_argument("--blind", type=Path, required=True, help="folder of python -m validation.blind")
    stated = parser.parse_args(arguments)
    trials = compared(stated.blind)
    wrong = {name: c for name, c in trials.items() if not c.right}
    for name, c in wrong.items():
        lead = "not compared" if c.lead is None else f"{c.lead:+.1f}"
        print(f"{name}: {', '.join(c.truth)} flown, {', '.join(c.answer) or 'none'} named: {lead}")
    leads = [c.lead for c in wrong.values() if c.lead is not None]
    print(
        f"the likelihood prefers the answer: {Share(sum(x > 0.0 for x in leads), len(trials))} of the trials"
    )
    print(f"the likelihood prefers the truth: {Share(sum(x <= 0.0 for x in leads), len(trials))}")
    print(f"not compared: {Share(len(wrong) - len(leads), len(trials))}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
