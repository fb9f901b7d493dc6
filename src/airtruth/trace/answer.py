"""What a trace answers: verdict, effects, candidates, errors before and after (the contract's JSON as a dict)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from airtruth.effects.effect import Effect
from airtruth.physics.short_period import PARAMETERS
from airtruth.trace.fit import Fit, Hypothesis, Problem, loosened
from airtruth.trace.holdout import Assessment, assess, explained
from airtruth.trace.lower import CHANNELS, lower
from airtruth.trace.model import COLOUR, COLOUR_TIME_S, SHARED, S
from airtruth.trace.prepare import Case
from airtruth.trace.profile import Profile, place_of
from airtruth.trace.sandwich import inflation, scatter
from airtruth.trace.score import Table
from airtruth.trace.search import LEVEL, Candidate, Stage
from airtruth.trace.unnamed import Anomaly, advice

Array = NDArray[np.float64]

_Z95: Final = 1.959964
_SEEN: Final = 0.02
"""Share of slow noise that is said."""
ANOMALY: Final = 0.01
"""Level at which something counts as missing although no effect is named."""
_DETECTED: Final = 4.0
"""Square root of the noncentrality that counts as traceable."""
STAGES: Final = ("declared", "before", "after", "control", "floor")


@dataclass(frozen=True)
class Model:
    """A stage: a hypothesis with its shared parameters and sizes, and where the fitted records' own ones ended.

    ``fitted``: they ended there under these shared parameters and sizes; else they are where to begin.
    """

    hypothesis: Hypothesis
    shared: Array
    sizes: Array
    local: Array
    fitted: bool


@dataclass(frozen=True)
class Outcome:
    """Stages of the report, for the JSON and the figures.

    Attributes
    ----------
    models : stage -> model.
    fitted, held : stage -> assessment of each record.
    """

    models: dict[str, Model]
    fitted: dict[str, list[Assessment]]
    held: dict[str, list[Assessment]]


def accepted(stages: Sequence[Stage]) -> list[tuple[Candidate, tuple[Candidate, ...]]]:
    """Each accepted effect with those that cannot be told from it."""
    return [(s.tied[0], s.tied[1:]) for s in stages if s.tied]


def assessed(case: Case, stages: Sequence[Stage]) -> Outcome:
    """Every stage of the report on fitted and held-out records, with the same freedom in each."""
    null, last = stages[0].null, stages[-1].null
    nothing = np.zeros(0)
    # noise levels are those of the stage before: the declared ones would judge the declared model alone
    declared = null.point.shared.copy()
    declared[[*range(6), SHARED.index("inertia")]] = 0.0
    models = {
        "declared": Model(case.hypothesis, declared, nothing, null.point.local, False),
        "before": _model(null),
    }
    found = accepted(stages)
    if found:
        models["after"] = _model(last)
        first = stages[0]
        others = [c for c in first.candidates if c not in first.tied]
        if others:
            models["control"] = _model(others[0].found)
    fitted = {name: _all(case.fitted, m, fitted=True) for name, m in models.items()}
    held = {name: _all(case.held, m, fitted=False) for name, m in models.items()} if case.held else {}
    return Outcome(models, fitted, held)


def _model(found: Fit) -> Model:
    point = found.point
    return Model(found.hypothesis, point.shared, point.sizes, point.local, found.converged)


def _all(problem: Problem, model: Model, fitted: bool) -> list[Assessment]:
    def one(index: object) -> Assessment:
        i = int(index)  # type: ignore[call-overload]
        own = model.local[i] if fitted else None
        settled = fitted and model.fitted
        return assess(problem, i, model.hypothesis, model.shared, model.sizes, own, settled)

    return problem.each(one, range(len(problem.records)))


def answer(case: Case, stages: Sequence[Stage], outcome: Outcome) -> dict[str, Any]:
    """Contract 3 as a dict; the path of the updated aircraft is the caller's to add."""
    first, last = stages[0], stages[-1]
    found = accepted(stages)
    anomaly, remaining = first.anomaly, last.anomaly
    names = [{c.score.effect.name for c in (best, *others)} for best, others in found]
    covariance = _widened(case.fitted, reported(last))
    if not found:
        verdict = "unexplained" if anomaly.p_value <= ANOMALY else "none"
    else:
        verdict = "one_of" if any(len(n) > 1 for n in names) else "traced"
    provisional = case.held is None or (bool(found) and remaining.p_value <= ANOMALY)
    return {
        "verdict": verdict,
        "provisional": bool(provisional),
        "anomaly": {"statistic": anomaly.statistic, "p_value": anomaly.p_value},
        "remaining": {"statistic": remaining.statistic, "p_value": remaining.p_value},
        "shown_by": {"anomaly": anomaly.where, "remaining": remaining.where},
        "effects": [_effect(stages, number, covariance) for number in range(len(found))],
        "candidates": _candidates(case, stages),
        "error": errors(case, outcome),
        "derivatives": _derivatives(case, stages, covariance),
        "updated_aircraft": None,
        "detectability": detectability(first.table),
        "next_flight": _next_flight(found, verdict, remaining),
        "model": case.model,
        "records": {
            "fitted": [r.signals.run_id for r in case.fitted.records],
            "held_out": [r.signals.run_id for r in case.held.records] if case.held else [],
        },
        "notes": [*case.notes, *_slow_noise(last.null.point.shared)],
    }


def _slow_noise(shared: Array) -> Iterator[str]:
    shares = {channel: shared[i] for channel, i in zip(CHANNELS, COLOUR, strict=False)}
    seen = [f"{100.0 * share:.0f} % of {channel}'s" for channel, share in shares.items() if share > _SEEN]
    if seen:
        time_s = COLOUR_TIME_S * math.exp(shared[COLOUR[-1]])
        yield f"part of the sensors' noise is slow: {', '.join(seen)} variance is correlated over {time_s:.2g} s"


def parameters(effect: Effect, sizes: Array, covariance: Array) -> dict[str, dict[str, Any]]:
    """Value, standard deviation and 95 % interval of each parameter, from its size coordinate."""
    result = {}
    for i, p in enumerate(effect.parameters):
        size, std = float(sizes[i]), float(np.sqrt(max(covariance[i, i], 0.0)))
        value = p.value(size)
        ends = sorted((p.value(size - _Z95 * std), p.value(size + _Z95 * std)))
        slope = abs(p.value(size + 0.01 * std) - value) / 0.01 if math.isfinite(value) else math.inf
        result[p.name] = {
            "value": value,
            "std": slope,
            "ci95": [max(e, -1e300) if math.isfinite(e) else None for e in ends],
        }
    return result


def reported(stage: Stage) -> Fit:
    """The fit whose sizes are stated: under the autoregression, or without where that was not followed."""
    stayed = np.array_equal(stage.gls.point.shared, stage.null.point.shared)
    return stage.null if stayed else stage.gls


def _widened(problem: Problem, found: Fit) -> Array:
    """Covariance with what the innovations owe to one another in it, and what the records disagree by."""
    ratio = np.maximum(inflation(problem, found), scatter(problem, found))
    return np.asarray(found.covariance * np.outer(ratio, ratio))


def _effect(stages: Sequence[Stage], number: int, covariance: Array) -> dict[str, Any]:
    with_effects = [s for s in stages if s.tied]
    stage, final = with_effects[number], reported(stages[-1])
    best, others = stage.tied[0], stage.tied[1:]
    effect = best.score.effect
    at = sum(len(e.parameters) for e in final.hypothesis.effects[:number])
    span = slice(at, at + len(effect.parameters))
    block = covariance[S:, S:][span, span]
    rest = [
        c
        for c in stage.candidates
        if c is not best and c.score.effect.name != effect.name and c.gain <= best.gain
    ]
    runner = max([c.gain for c in rest], default=0.0)
    separation = math.sqrt(max(0.0, best.gain - max(0.0, runner)))
    stated = parameters(effect, final.point.sizes[span], block)
    if stage.profile is not None:
        _widen(effect, stated, stage.profile)
    row = {
        "name": effect.name,
        "variant": effect.variant,
        "parameters": stated,
        "p_value": _p_value(stage, best),
        "separation_sigma": separation,
        "indistinguishable_from": sorted({c.score.effect.name for c in others} - {effect.name}),
        "gain_2_log_likelihood": best.gain,
    }
    variants = sorted(c.score.effect.variant for c in others if c.score.effect.name == effect.name)
    if variants:
        row["other_variants"] = variants
    if effect.name == "sensor_delay":
        row["channel"] = effect.variant
    if loosened(effect, final.hypothesis.trim_alpha_rad):
        row["about_alpha_rad"] = final.hypothesis.trim_alpha_rad
    return row


def _widen(effect: Effect, stated: dict[str, dict[str, Any]], profile: Profile) -> None:
    """Intervals of size and place made to hold those of the profile, in place."""
    at = place_of(effect) or 0
    for j, ends in ((0, profile.size_interval()), (at, profile.place_interval())):
        p = effect.parameters[j]
        row = stated[p.name]
        known = [e for e in row["ci95"] if e is not None]
        row["ci95"] = [min(*known, *map(p.value, ends)), max(*known, *map(p.value, ends))]


def _p_value(stage: Stage, best: Candidate) -> float:
    """Holm's p-value of the score, or, where levels tell more, Bonferroni's of the likelihood ratio."""
    index = [s.effect.key for s in stage.table.scores].index(best.score.effect.key)
    ratio = len(stage.adjusted) * float(chi2.sf(max(best.gain, 0.0), 1))
    return min(float(stage.adjusted[index]), ratio)


def _candidates(case: Case, stages: Sequence[Stage]) -> list[dict[str, Any]]:
    first = stages[0]
    judged = {c.score.effect.key: c for c in first.candidates}
    tied = {c.score.effect.key for s in stages for c in s.tied}
    rows = []
    for s, p in zip(first.table.scores, first.adjusted, strict=True):
        known = judged.get(s.effect.key)
        why = ""
        if s.effect.key in tied:
            why = ""
        elif known is not None:
            why = "; ".join(known.reasons)
        elif p > LEVEL:
            why = "not significant"
        else:
            why = "others score higher"
        rows.append(
            {
                "name": s.effect.name,
                "variant": s.effect.variant,
                "score": s.z**2,
                "z": s.z,
                "p_value": float(p),
                "p_value_alone": s.p_value,
                "testable": True,
                "why_not": why,
            }
        )
    seen = {s.effect.key for s in first.table.scores}
    silent = [
        (e, "these records do not excite it, or refitting the rest absorbs it")
        for e in case.effects
        if e.key not in seen
    ]
    for effect, why in (*case.untestable, *silent):
        rows.append(
            {
                "name": effect.name,
                "variant": effect.variant,
                "score": 0.0,
                "z": 0.0,
                "p_value": 1.0,
                "p_value_alone": 1.0,
                "testable": False,
                "why_not": why,
            }
        )
    return sorted(rows, key=lambda r: (-r["testable"], r["p_value_alone"]))


def errors(case: Case, outcome: Outcome) -> dict[str, Any]:
    """Root mean squares per channel and stage, over fitted and held-out records, and the signals' own."""
    result: dict[str, Any] = {"channels": _signals(case)}
    for name in STAGES:
        if name == "floor":
            result[name] = {"fit": _floor(case.fitted, outcome, "fit")}
            if case.held:
                result[name]["held_out"] = _floor(case.held, outcome, "held_out")
            continue
        if name not in outcome.fitted:
            continue
        result[name] = {"fit": _pooled(outcome.fitted[name])}
        if name in outcome.held:
            result[name]["held_out"] = _pooled(outcome.held[name])
    return result


def _signals(case: Case) -> dict[str, float]:
    """Standard deviation of each measured channel, what the errors compare with."""
    y = [r.signals.y - r.signals.y.mean(axis=0) for r in case.fitted.records]
    spread = np.sqrt(np.mean(np.concatenate(y) ** 2, axis=0))
    return dict(zip(CHANNELS, spread.tolist(), strict=True))


def _pooled(found: Sequence[Assessment]) -> dict[str, dict[str, float]]:
    return {
        kind: dict(
            zip(
                CHANNELS,
                np.sqrt(np.mean([getattr(a, kind) ** 2 for a in found], axis=0)).tolist(),
                strict=True,
            )
        )
        for kind in ("free_run", "innovation")
    }


def _floor(problem: Problem, outcome: Outcome, which: str) -> dict[str, dict[str, float]]:
    name = "after" if "after" in outcome.models else "before"
    model = outcome.models[name]
    low = lower(model.hypothesis.change(model.sizes))
    found = (outcome.fitted if which == "fit" else outcome.held)[name]
    free = [
        explained(record, problem, low, model.shared, a.local, number, model.hypothesis.loose) ** 2
        for number, (record, a) in enumerate(zip(problem.records, found, strict=True))
    ]
    return {
        kind: dict(zip(CHANNELS, np.sqrt(np.mean(squares, axis=0)).tolist(), strict=True))
        for kind, squares in (("free_run", free), ("innovation", [a.expected**2 for a in found]))
    }


def _derivatives(case: Case, stages: Sequence[Stage], covariance: Array) -> dict[str, dict[str, float]]:
    """Declared and refitted derivatives at the trim."""
    declared = case.fitted.records[0].plant.derivatives
    after = stages[-1].null
    rows = {"declared": declared, "before": declared + stages[0].null.point.shared[:6]}
    rows["after"] = declared + after.point.shared[:6]
    named = {k: dict(zip(PARAMETERS, v.tolist(), strict=True)) for k, v in rows.items()}
    named["after_std"] = dict(zip(PARAMETERS, np.sqrt(np.diag(covariance)[:6]).tolist(), strict=True))
    return named


def detectability(table: Table) -> dict[str, float]:
    """Smallest size of each effect that the records could trace (noncentrality 16), in its own unit.

    A bandwidth or a rate limit is stated as its value; of several variants the one best seen counts, but each
    stands under its own key too where there are several.
    """
    result: dict[str, float] = {}
    for s in table.scores:
        p = s.effect.parameters[0]
        size = _DETECTED / math.sqrt(s.information)
        value = p.value(size) if p.reciprocal else size
        if s.effect.variant:
            result[s.effect.key] = value
        kept = result.get(s.effect.name)
        result[s.effect.name] = value if kept is None else (max if p.reciprocal else min)(kept, value)
    return result


def _next_flight(
    found: Sequence[tuple[Candidate, tuple[Candidate, ...]]], verdict: str, remaining: Anomaly
) -> str:
    if verdict == "none":
        return "Nothing is missing at the sizes listed under detectability; larger or longer manoeuvres lower them."
    lines = []
    if verdict == "unexplained":
        lines.append("Something is missing that no effect of the library explains.")
    for best, others in found:
        names = {c.score.effect.key: c.score.effect for c in (best, *others)}
        if len({e.name for e in names.values()}) > 1:
            split = " ".join(dict.fromkeys(e.splits for e in names.values() if e.splits))
            lines.append(f"To split {', '.join(names)}: {split}")
    if remaining.p_value <= ANOMALY:
        lines.append(f"What is left shows in {remaining.where}: {advice(remaining.where)}")
    return (
        " ".join(lines) or "Fly the updated aircraft's largest remaining residual again, in the other sign."
    )
