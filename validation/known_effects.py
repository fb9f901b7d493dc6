"""What remains in blind trials once their true effects are in the model: a test of the filter, apart from the search.

    python -m validation.blind --mode loop --seed 1 --trials 20 --out out/blind
    python -m validation.known_effects --out out/blind 'loop-1-*'

Each trial is fitted with its effects, from their true sizes on. A filter that is right leaves an anomaly whose p-value is
uniform, and sizes that are off by their standard deviation. A trial whose effects move the derivatives alone is fitted with
wide priors of the derivatives; one whose effect the library does not hold is left out.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from airtruth import aircraft as planes
from airtruth.effects.effect import Effect
from airtruth.effects.registry import EFFECTS
from airtruth.errors import AirtruthError
from airtruth.logs.sources import named_logs
from airtruth.logs.store import read_log
from airtruth.tracing.calibration.corner_share import with_corner_share
from airtruth.tracing.inference.hypothesis import Hypothesis
from airtruth.tracing.inference.optimise import initial_parameters
from airtruth.tracing.model.parameters import SHORT_PERIOD
from airtruth.tracing.options import TraceOptions
from airtruth.tracing.prepare import Case, prepare
from airtruth.tracing.selection.rounds import scored
from airtruth.tracing.selection.set_table import SetTable
from validation.blind.figures import DECLARED

Array = NDArray[np.float64]

_ITERATIONS: Final = 6
"""Iterations of the first parameters of the records [-]."""
_WIDER: Final = 24.0
"""Variance of the derivatives beside an effect that moves them, over the declared one, added [-]: five standard deviations."""
_SLOW_SHARE: Final = 0.4
"""Share of correlated noise from which the fit of correlated noise begins [-]."""
_IN_DERIVATIVES: Final = ("cg_shift", "mass_error", "inertia_error", "elevator_effectiveness")
"""Effects of the filter that move the derivatives."""


@dataclass(frozen=True)
class Known:
    """A trial fitted with its effects.

    Attributes
    ----------
    name, air, noise, effects : of the trial.
    p_value, where : of the remaining anomaly.
    z : effect.parameter -> error of its size over its standard deviation [-].
    scores : the largest scores of further effects [-].
    """

    name: str
    air: str
    noise: str
    effects: tuple[str, ...]
    p_value: float
    where: str
    z: dict[str, float]
    scores: tuple[tuple[str, float], ...]


def known(folder: Path, name: str) -> Known | None:
    """Fit one trial of a folder of `validation.blind` with its effects; None where the library does not hold one."""
    trial = json.loads((folder / "truth" / f"{name}.json").read_text(encoding="utf-8"))["trial"]
    drawn = {e["key"]: e["values"] for e in trial["effects"]}
    if not drawn.keys() <= EFFECTS.keys():
        return None
    candidates = [e for e in EFFECTS.values() if not e.in_derivatives]
    case = prepared(folder / "logs" / name / "log.parquet", candidates)
    effects = [e for e in candidates if e.key in drawn]
    hypothesis = case.hypothesis
    for effect in effects:
        hypothesis = hypothesis.plus(effect)
    if any(EFFECTS[key].in_derivatives or key in _IN_DERIVATIVES for key in drawn):
        spread = _WIDER * np.diag(np.diag(case.fitted.declared_covariance))
        hypothesis = replace(hypothesis, spread=spread)
    true = np.array([p.size(drawn[e.key][p.name]) for e in effects for p in e.parameters])
    return _fitted(case, hypothesis, true, trial, name)


def prepared(log: Path, candidates: Sequence[Effect]) -> Case:
    """The case of a trace with its default options; of two records the second is held out."""
    runs = read_log(log, ()).run_ids
    options = TraceOptions(hold_out=runs[1:]) if len(runs) == 2 else TraceOptions()
    return prepare([next(iter(named_logs(log)))[1]], planes.load(DECLARED), list(candidates), options)


def _fitted(case: Case, hypothesis: Hypothesis, true: Array, trial: dict[str, Any], name: str) -> Known:
    problem, coloured = case.fitted, trial["noise"] == "coloured"
    if coloured:
        problem = replace(problem, settings=replace(problem.settings, coloured=True))
    start = initial_parameters(problem, hypothesis, true, _ITERATIONS)
    common = start.common.copy()
    if coloured:
        common[SHORT_PERIOD.common.colour_shares] = _SLOW_SHARE
    best = SetTable(problem).converged(hypothesis, replace(start, common=common, sizes=true))
    if best is None:
        raise AirtruthError(f"{name}: the motion is lost at the true sizes")
    case = with_corner_share(replace(case, fitted=problem, hypothesis=hypothesis), best.point)
    others = tuple(e for e in case.effects if e not in hypothesis.effects)
    refitted = SetTable(case.fitted).fit(hypothesis, best.point)
    if refitted is None:
        raise AirtruthError(f"{name}: the motion is lost at the fitted sizes")
    found = scored(case.fitted, refitted, others, 0)
    fit = found.null
    keys = [f"{e.key}.{p.name}" for e in hypothesis.effects for p in e.parameters]
    z = {
        key: float((fit.point.sizes[k] - size) / fit.size_std(k))
        for k, (key, size) in enumerate(zip(keys, true, strict=True))
    }
    scores = sorted(((s.effect.key, s.z) for s in found.table.scores), key=lambda item: -abs(item[1]))
    return Known(
        name=name,
        air=trial["air"],
        noise=trial["noise"],
        effects=tuple(e["key"] for e in trial["effects"]),
        p_value=found.anomaly.p_value,
        where=found.anomaly.null,
        z=z,
        scores=tuple(scores[:3]),
    )


def main() -> int:
    """Print one line for each trial."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=Path("out/blind"), help="folder of validation.blind")
    parser.add_argument("names", nargs="*", default=["*"], help="names of trials, with wildcards")
    arguments = parser.parse_args()
    for pattern in arguments.names:
        for log in sorted((arguments.out / "logs").glob(pattern)):
            print(_line(arguments.out, log.name), flush=True)
    return 0


def _line(folder: Path, name: str) -> str:
    try:
        one = known(folder, name)
    except AirtruthError as error:
        return f"{name}: {error}"
    if one is None:
        return f"{name}: beyond the library"
    sizes = ", ".join(f"{key} {value:+.1f}" for key, value in one.z.items())
    scores = ", ".join(f"{key} {value:+.1f}" for key, value in one.scores)
    return (
        f"{name}: {one.air}, {one.noise}, {' + '.join(one.effects) or 'none'}: p {one.p_value:.2g} in {one.where}; "
        f"z of sizes: {sizes or 'none'}; scores: {scores}"
    )


if __name__ == "__main__":
    sys.exit(main())
