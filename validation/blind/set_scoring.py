"""Scores of trials whose truth is a set of effects: contradiction, the set named, intervals, confirmation.

The modes of `figures.CONDITIONS` have sets of one effect or none, and two scores more.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any, Final

import numpy as np

from validation.blind import declaration
from validation.blind.causes import COMPOSITIONS, TIME_CONSTANT_S
from validation.blind.figures import (
    ALPHA_TRIM_RAD,
    APART,
    CONDITIONS,
    DERIVATIVES,
    LOG_STEP_S,
    STRONG,
    TOGETHER,
    held_out,
)
from validation.blind.scoring import (
    Case,
    accepted,
    actual,
    base,
    bound,
    contradicted,
    effects,
    first_bound,
    is_outside_declaration,
    mean,
    median,
    named_set,
    noncentrality,
    of,
    ratio,
    share,
    states_worse,
)

_OWN_FORMULA: Final = ("tail_effectiveness", "wing_effectiveness", "icing")
"""Effects whose parameter in the truth is not that of the library."""
_LOADING: Final = ("cg_shift", "mass_error", "inertia_error")
_CURVED: Final = {"CLalpha2": "CLalpha", "Cmalpha2": "Cmalpha"}
_QUANTILE: Final = 1.96
_ERRORS: Final = 2.0


def contradiction_power(case: Case) -> float | None:
    """Power of the chi-square test of the six derivatives; None where the truth has effects that they do not show."""
    if any(effect["key"] not in ("derivatives", *_OWN_FORMULA) for effect in effects(case)):
        return None
    return bound(noncentrality(case), declaration.LEVEL, len(DERIVATIVES))


def strong(case: Case) -> bool:
    """Whether a case counts: a triple if each of its effects is strong, another set if all effects together are."""
    if case["truth"]["trial"]["composition"] == "triple":
        return min(_single(case).values()) > STRONG
    return noncentrality(case) > STRONG


def _single(case: Case) -> dict[str, float]:
    """Noncentrality of each effect, the others being there."""
    return {key: value for key, value in case["truth"]["lambda"].items() if key not in (APART, TOGETHER)}


def matches(case: Case, names: set[str]) -> bool:
    """Whether names are those of the truth; an effect that is weak beside the others may be missing."""
    lambdas = _single(case)
    needed = {base(key) for key, value in lambdas.items() if value > STRONG} or {base(k) for k in lambdas}
    return needed <= names <= {base(key) for key in lambdas}


def first(case: Case) -> bool:
    """Whether the accepted effects are the truth's."""
    return matches(case, {base(e["name"]) for e in case["answer"]["effects"]})


def reported(case: Case) -> bool:
    """Whether the truth's set is among those reported: accepted, as look-alikes of these, or as an alternative."""
    answer = case["answer"]
    alike = product(*(sorted(named_set(effect)) for effect in answer["effects"]))
    others = ({base(key) for key in a["effects"]} for a in answer.get("alternatives", ()))
    return any(matches(case, set(names)) for names in alike) or any(matches(case, names) for names in others)


def true_derivatives(case: Case) -> dict[str, float]:
    """Derivatives of the truth as a tracer sees them in the motion: on the declared mass, inertia and CG.

    A curvature of the truth counts from `ALPHA_TRIM_RAD`, and adds its slope where the answer counts it from.
    """
    truth, declared = case["truth"], case["answer"]["derivatives"]["declared"]
    total = {name: value + truth["increments"][name] for name, value in declared.items()}
    for effect in effects(case):
        stated = (e for e in case["answer"]["effects"] if e["name"] == base(effect["key"]))
        about = next((e.get("about_alpha_rad") for e in stated), None)
        for name, slope in _CURVED.items():
            if about is not None and name in effect["values"]:
                total[slope] += 2.0 * effect["values"][name] * (about - ALPHA_TRIM_RAD)
    return declaration.on_declared_body(total, truth["trial"]["body"])


def derivatives_covered(case: Case) -> list[bool]:
    """For each derivative, whether its 95 % interval holds the truth; of trials without another mass or CG."""
    keys = {e["key"] for e in effects(case)}
    stated = case["answer"].get("derivatives", {})
    if case["truth"]["trial"]["composition"] == "triple" or keys & set(_LOADING) or "after_std" not in stated:
        return []
    truth = true_derivatives(case)
    return [
        abs(stated["after"][name] - value) <= _QUANTILE * stated["after_std"][name]
        for name, value in truth.items()
    ]


def parameters_covered(case: Case) -> list[bool]:
    """For each parameter of an effect that is named and means the same in truth and library."""
    flags = []
    for effect in effects(case):
        if effect["key"] in _OWN_FORMULA:
            continue
        stated = next(
            (e for e in case["answer"]["effects"] if base(e["name"]) == base(effect["key"])),
            {"parameters": {}},
        )
        for name, value in _values(case, effect).items():
            interval = stated["parameters"].get(name, {}).get("ci95")
            if interval:
                low, high = interval  # an end that is None is open
                flags.append((low is None or low <= value) and (high is None or value <= high))
    return flags


def _values(case: Case, effect: Mapping[str, Any]) -> dict[str, float]:
    if effect["key"] != "derivatives":
        return actual(case, effect)
    declared = case["answer"]["derivatives"]["declared"]
    return {f"d{name}": value - declared[name] for name, value in true_derivatives(case).items()}


def worse(case: Case, kind: str) -> bool:
    """Whether a held-out error ("innovation" or "free_run") of *after* exceeds that of *before* by two standard errors.

    Of the mean over channels of the logarithm of the ratio, as of independent errors: 1/sqrt(n) each, n the samples;
    of a free run one per time constant of the short period.
    """
    stages = case["answer"].get("error", {})
    after, before = (stages.get(s, {}).get("held_out", {}).get(kind) for s in ("after", "before"))
    if not after or not before:
        return False
    names = [n for n in after if after[n] and before.get(n)]
    if not names:
        return False
    trial = case["truth"]["trial"]
    seconds = trial["duration_s"] * len(held_out(len(trial["manoeuvres"])))
    step = trial["manoeuvres"][0].get("log_step_s", LOG_STEP_S)
    count = seconds / (step if kind == "innovation" else TIME_CONSTANT_S)
    rise = float(np.mean([np.log(after[n] / before[n]) for n in names]))
    return rise > _ERRORS / np.sqrt(len(names) * count)


def worse_unstated(case: Case) -> bool:
    """Whether an effect is accepted that makes a held-out error worse, and the answer does not state it."""
    return not states_worse(case) and any(worse(case, k) for k in ("innovation", "free_run"))


def wrong_without_reservation(case: Case) -> bool:
    """Whether an answer names effects, none of them or of their look-alikes the truth's, and is not provisional."""
    named = set().union(*(named_set(effect) for effect in accepted(case)))
    true = {base(e["key"]) for e in effects(case)}
    return bool(named) and not named & true and not case["answer"]["provisional"]


def set_scores(cases: Sequence[Case]) -> dict[str, dict[str, Any]]:
    """Per mode, of the trials that count; `Share` where there is a count."""
    result = {}
    for mode in (*COMPOSITIONS, *CONDITIONS):
        every = of(cases, mode)
        some = [c for c in every if strong(c)]
        named = [c for c in some if c["answer"]["effects"]]
        right = [c for c in some if first(c)]
        if every:
            result[mode] = {
                "trials": len(every),
                "strong": len(some),
                "contradicted": share(contradicted(c) for c in some),
                "contradiction_power": mean(contradiction_power(c) for c in some),
                "contradicted_outside": share(
                    contradicted(c)
                    for c in some
                    if contradiction_power(c) is not None and is_outside_declaration(c)
                ),
                "first": share(first(c) for c in some),
                "first_bound": mean(first_bound(c) for c in some),
                "reported": share(reported(c) for c in some),
                "derivative_coverage": share(flag for c in some for flag in derivatives_covered(c)),
                "derivative_coverage_right": share(flag for c in right for flag in derivatives_covered(c)),
                "parameter_coverage": share(flag for c in some for flag in parameters_covered(c)),
                "after_over_oracle": median(ratio(c, "after", "oracle") for c in named),
                "worse_unstated": share(worse_unstated(c) for c in named),
                "by_set": by_set(some),
            }
        if every and mode in CONDITIONS:
            nulls = [c for c in every if not effects(c)]
            result[mode] |= {
                "wrong_without_reservation": share(wrong_without_reservation(c) for c in some),
                "false_trace": share(bool(accepted(c)) for c in nulls),
                "null_anomaly": share(c["answer"]["verdict"] == "unexplained" for c in nulls),
            }
    return result


def by_set(cases: Sequence[Case]) -> list[dict[str, Any]]:
    """The set named, per set of the truth; triples in one row."""
    rows = []
    for names in sorted({_label(c) for c in cases}):
        some = [c for c in cases if _label(c) == names]
        others: dict[str, int] = {}
        for case in some:
            answered = ", ".join(sorted({base(e["name"]) for e in case["answer"]["effects"]}))
            if not first(case):
                key = answered or f"({case['answer']['verdict']})"
                others[key] = others.get(key, 0) + 1
        rows.append(
            {
                "truth": names,
                "contradicted": share(contradicted(c) for c in some),
                "first": share(first(c) for c in some),
                "reported": share(reported(c) for c in some),
                "otherwise": dict(sorted(others.items(), key=lambda item: -item[1])),
            }
        )
    return rows


def _label(case: Case) -> str:
    if case["truth"]["trial"]["composition"] == "triple":
        return "three effects"
    if any(e["key"] == "derivatives" for e in effects(case)):
        return f"{len(effects(case)[0]['values'])} derivatives"
    return ", ".join(sorted(base(e["key"]) for e in effects(case)))
