"""Truth against answer: counts with exact binomial intervals."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from scipy.stats import beta, chi2, ncx2, norm

from validation.blind import declaration
from validation.blind.figures import APART, BEYOND, LEAVE_ONE_OUT, STRONG

Case = Mapping[str, Any]

CLASSES: Final = (
    (0.0, 4.0),
    (4.0, 8.0),
    (8.0, 16.0),
    (16.0, 30.0),
    (30.0, 60.0),
    (60.0, 150.0),
    (150.0, np.inf),
)
LEVEL: Final = 0.01
"""Level of the score test whose power is compared with the bound."""
HOLM: Final = 0.05 / 33
"""The same where the smallest of the library's p-values starts Holm's procedure."""
INCREMENT: Final = "increment"
"""Name of every learned increment in an answer (trace.json)."""
CURVES: Final = ("elevator_asymmetry", "cm_alpha_nonlinear", "cl_alpha_nonlinear", "downwash_lag")
"""Effects of the library that increments can express: a coefficient over a signal."""
WORSE: Final = 1.02
"""A held-out error counts as worse above this ratio."""
_NOTE_OF_WORSE: Final = "on the held-out records, the error of "
"""Start of the note (notes.worse_held_out) by which an answer states a larger held-out error."""


@dataclass(frozen=True)
class Share:
    """``hits`` of ``count``, with the Clopper-Pearson interval of 95 % (Biometrika 26, 1934)."""

    hits: int
    count: int

    @property
    def value(self) -> float:
        """hits/count, NaN of none."""
        return self.hits / self.count if self.count else float("nan")

    @property
    def interval(self) -> tuple[float, float]:
        """Lower and upper end."""
        k, n = self.hits, self.count
        low = float(beta.ppf(0.025, k, n - k + 1)) if k else 0.0
        high = float(beta.ppf(0.975, k + 1, n - k)) if k < n else 1.0
        return low, high

    def __str__(self) -> str:
        if not self.count:
            return "none"
        low, high = self.interval
        return f"{self.hits} of {self.count} = {self.value:.2f} ({low:.2f} to {high:.2f})"


def share(flags: Iterable[bool]) -> Share:
    """How many of some are true."""
    listed = list(flags)
    return Share(sum(listed), len(listed))


def bound(noncentrality: float, level: float = LEVEL, degrees: int = 1) -> float:
    """Power of a chi-square test at a level; of one degree of freedom no score does better."""
    critical = chi2.isf(level, degrees)
    return float(ncx2.sf(critical, degrees, noncentrality)) if noncentrality > 0.0 else level


def effects(case: Case) -> list[Mapping[str, Any]]:
    """The truth's effects, clutter left out."""
    return list(case["truth"]["trial"]["effects"])


def of(cases: Sequence[Case], *compositions: str) -> list[Case]:
    """The answered cases of some compositions."""
    return [
        c for c in cases if c["truth"]["trial"]["composition"] in compositions and "failed" not in c["answer"]
    ]


def base(key: str) -> str:
    """Public name of an effect, its variant left out."""
    return key.split(":")[0]


def noncentrality(case: Case) -> float:
    """Of the case's strongest effect; 0 without effects."""
    return max(case["truth"]["lambda"].values(), default=0.0)


def beyond(case: Case) -> float:
    """What of an effect outside the library its best member leaves; 0 if that was not worth measuring."""
    return float(case["truth"]["lambda"].get(BEYOND, 0.0))


def first_bound(case: Case) -> float | None:
    """Probability that the likelier of two names is the right one, were the effect and its nearest rival all there is.

    Two means d apart in units of their noise: Phi(d/2) (R. A. Fisher's discriminant). None if it was not measured.
    """
    left = case["truth"]["lambda"].get(APART)
    return None if left is None else float(norm.cdf(0.5 * np.sqrt(max(float(left), 0.0))))


def dominant(case: Case) -> str:
    """Key of the strongest effect, "" without effects."""
    table = case["truth"]["lambda"]
    return max(table, key=table.__getitem__) if table else ""


def accepted(case: Case) -> list[Mapping[str, Any]]:
    """The effects that an answer names; learned increments have no name."""
    answer = case["answer"]
    if answer["verdict"] not in ("traced", "one_of", "learned"):
        return []
    return [e for e in answer["effects"] if e["name"] != INCREMENT]


def learned(case: Case) -> list[Mapping[str, Any]]:
    """The increments that an answer has learned."""
    return [e for e in case["answer"]["effects"] if e["name"] == INCREMENT]


def named_set(effect: Mapping[str, Any]) -> set[str]:
    """Names that an accepted effect stands for."""
    return {base(effect["name"]), *(base(name) for name in effect.get("indistinguishable_from", ()))}


def in_set(case: Case, key: str) -> bool:
    """Whether an answer's accepted effects, or their look-alikes, hold a name."""
    return any(base(key) in named_set(effect) for effect in accepted(case))


def named_first(case: Case, key: str) -> bool:
    """Whether the first accepted effect bears a name itself."""
    found = accepted(case)
    return bool(found) and base(found[0]["name"]) == base(key)


def p_value(case: Case, key: str) -> float | None:
    """The score's p-value of an effect before any correction for their number: that of its variant if it is
    listed, else the smallest of its name.
    """
    listed: dict[str, float] = {}
    for c in case["answer"]["candidates"]:
        p = c.get("p_value_alone", c.get("p_value"))
        if p is None:
            continue
        variant = c.get("variant", "")
        listed[f"{c['name']}:{variant}" if variant else c["name"]] = float(p)
    if key in listed:
        return listed[key]
    return min((p for name, p in listed.items() if base(name) == base(key)), default=None)


def held_out(case: Case, stage: str) -> dict[str, float] | None:
    """Free-run error by channel on held-out records."""
    part = case["answer"].get("error", {}).get(stage, {}).get("held_out")
    return None if not part or not part.get("free_run") else dict(part["free_run"])


def relative(case: Case, error: Mapping[str, float] | None) -> float | None:
    """Root mean square over channels of error over signal."""
    if error is None:
        return None
    signal = case["truth"]["oracle"]["signal"]
    common = [name for name in signal if error.get(name) is not None]
    return float(np.sqrt(np.mean([(error[n] / signal[n]) ** 2 for n in common]))) if common else None


def ratio(case: Case, stage: str, to: str) -> float | None:
    """Held-out error of a stage over that of another, or over the truth's own ("oracle")."""
    top = relative(case, held_out(case, stage))
    below = relative(case, case["truth"]["oracle"]["free_run"] if to == "oracle" else held_out(case, to))
    return None if top is None or below is None or below <= 0.0 else top / below


def median(values: Iterable[float | None]) -> tuple[float, int]:
    """Median of what there is, and how many there are."""
    return _over_known(np.median, values)


def mean(values: Iterable[float | None]) -> tuple[float, int]:
    """Mean of what there is, and how many there are."""
    return _over_known(np.mean, values)


def _over_known(average: Callable[[list[float]], Any], values: Iterable[float | None]) -> tuple[float, int]:
    listed = [v for v in values if v is not None]
    return (float(average(listed)) if listed else float("nan")), len(listed)


def actual(case: Case, effect: Mapping[str, Any] | None = None) -> dict[str, float]:
    """Parameters of an effect, the first by default, against the declared aircraft: the truth's own draw is part of them."""
    effect = effect or effects(case)[0]
    values = {name: float(value) for name, value in effect["values"].items()}
    body = case["truth"]["trial"]["body"]
    if effect["key"] in ("mass_error", "inertia_error"):
        values["factor"] *= body[effect["key"].removesuffix("_error")]
    if effect["key"] == "cg_shift":
        values["dx_mac"] += body["cg"]
    return values


def covered(case: Case) -> list[bool]:
    """For each parameter of a single effect that is named first: whether its interval holds the truth."""
    if not named_first(case, effects(case)[0]["key"]):
        return []
    stated = accepted(case)[0]["parameters"]
    flags = []
    for name, value in actual(case).items():
        interval = stated.get(name, {}).get("ci95")
        if interval:
            low, high = interval  # an end that is None is open
            flags.append((low is None or low <= value) and (high is None or value <= high))
    return flags


def column(case: Case) -> str:
    """Where a case falls in the confusion matrix: the name given first, or the verdict."""
    found = accepted(case)
    return base(found[0]["name"]) if found else f"({case['answer']['verdict']})"


def confusion(cases: Sequence[Case], at_least: float = STRONG) -> dict[str, dict[str, int]]:
    """Truth -> name given first -> count; nulls, and single or off-library effects above a noncentrality."""
    table: dict[str, dict[str, int]] = {}
    for case in of(cases, "null", "single", "off-library"):
        if effects(case) and noncentrality(case) < at_least:
            continue
        row = table.setdefault(base(dominant(case)) or "(null)", {})
        row[column(case)] = row.get(column(case), 0) + 1
    return dict(sorted(table.items()))


def contradicted(case: Case) -> bool:
    """Whether an answer calls the declared model contradicted; one without this statement does not."""
    return not case["answer"].get("declared_model", {}).get("consistent", True)


def is_outside_declaration(case: Case) -> bool:
    """Whether the derivatives as flown lie outside their declared uncertainty, at the level of the tracer's test."""
    truth, declared = case["truth"], case["answer"].get("derivatives", {}).get("declared")
    if declared is None:
        return False
    total = {name: value + truth["increments"][name] for name, value in declared.items()}
    flown = declaration.on_declared_body(total, truth["trial"]["body"])
    return declaration.p_value(flown, declared) <= declaration.LEVEL


def detection(cases: Sequence[Case]) -> list[dict[str, Any]]:
    """Per class of noncentrality: score detections, their bound, acceptances; single effects."""
    rows = []
    for low, high in CLASSES:
        some = [c for c in of(cases, "single") if low <= noncentrality(c) < high]
        found = [p for c in some if (p := p_value(c, dominant(c))) is not None]
        tested = [c for c in some if p_value(c, dominant(c)) is not None]
        rows.append(
            {
                "from": low,
                "to": high,
                "bound": float(np.mean([bound(noncentrality(c)) for c in tested])) if tested else None,
                "score": share(p < LEVEL for p in found),
                "named": share(in_set(c, dominant(c)) for c in some),
                "something": share(bool(accepted(c)) for c in some),
            }
        )
    return rows


def by_effect(cases: Sequence[Case]) -> list[dict[str, Any]]:
    """The same per effect, over all sizes."""
    rows = []
    for key in sorted({dominant(c) for c in of(cases, "single")}):
        some = [c for c in of(cases, "single") if dominant(c) == key]
        tested = [c for c in some if p_value(c, key) is not None]
        rows.append(
            {
                "effect": key,
                "bound": float(np.mean([bound(noncentrality(c)) for c in tested])) if tested else None,
                "score": share(float(p_value(c, key) or 0.0) < LEVEL for c in tested),
                "bound_holm": float(np.mean([bound(noncentrality(c), HOLM) for c in tested]))
                if tested
                else None,
                "score_holm": share(float(p_value(c, key) or 0.0) < HOLM for c in tested),
                "named": share(in_set(c, key) for c in some),
                "strong": share(in_set(c, key) for c in some if noncentrality(c) > STRONG),
                "curve": [
                    {
                        "lambda": noncentrality(c),
                        "p_value": p_value(c, key),
                        "named": in_set(c, key),
                    }
                    for c in some
                ],
            }
        )
    return rows


def lacking(cases: Sequence[Case]) -> dict[str, Any]:
    """Figures of cases whose effect the tracer's library lacks."""
    curves = [c for c in cases if base(effects(c)[0]["key"]) in CURVES]
    groups = {"": [c for c in cases if learned(c)], "_of_all": cases, "_of_curves": curves}
    return {
        "flagged": share(
            c["answer"]["verdict"] in ("unexplained", "learned")
            or bool(accepted(c) and c["answer"]["provisional"])
            for c in cases
        ),
        "learned": share(bool(learned(c)) for c in cases),
        **{
            f"{stage}_over_oracle{key}": median(ratio(c, stage, "oracle") for c in some)
            for key, some in groups.items()
            for stage in ("after", "before")
        },
        "named_without_reservation": share(
            bool(accepted(c)) and not c["answer"]["provisional"] for c in cases
        ),
        "passed_as_none": share(c["answer"]["verdict"] == "none" for c in cases),
        "worse_not_denied": share(
            (ratio(c, "after", "before") or 0.0) > WORSE and c["answer"].get("confirmed") is not False
            for c in cases
        ),
        "worse_unstated": share(
            (ratio(c, "after", "before") or 0.0) > WORSE and not states_worse(c) for c in cases
        ),
    }


def states_worse(case: Case) -> bool:
    """Whether an answer states that a held-out error is larger after: `confirmed` is false, or a note."""
    answer = case["answer"]
    return answer.get("confirmed") is False or any(
        note.startswith(_NOTE_OF_WORSE) for note in answer.get("notes", ())
    )


def score(cases: Sequence[Case]) -> dict[str, Any]:
    """All figures of some trials; `Share` where there is a count."""
    nulls, singles = of(cases, "null"), of(cases, "single")
    strong = [c for c in singles if noncentrality(c) > STRONG]
    off = [c for c in of(cases, "off-library") if beyond(c) > STRONG]
    pairs = [c for c in of(cases, "pair") if min(c["truth"]["lambda"].values()) > STRONG]
    clutter = of(cases, "clutter")
    led = [c for c in clutter if noncentrality(c) > STRONG]
    detected = [c for c in strong if accepted(c)]
    air = {
        name: [c for c in nulls if c["truth"]["trial"]["air"] == name]
        for name in ("calm", "light", "moderate")
    }
    sizes = [len(named_set(accepted(c)[0])) for c in detected]
    return {
        "trials": len(cases),
        "failed": [c["answer"]["failed"] for c in cases if "failed" in c["answer"]],
        "false_trace": {name: share(bool(accepted(c)) for c in some) for name, some in air.items()},
        "false_contradiction": {name: share(contradicted(c) for c in some) for name, some in air.items()},
        "false_contradiction_inside": {
            name: share(contradicted(c) for c in some if not is_outside_declaration(c))
            for name, some in air.items()
        },
        "false_trace_all": share(bool(accepted(c)) for c in nulls),
        "null_anomaly": share(c["answer"]["verdict"] == "unexplained" for c in nulls),
        "null_increment": share(bool(learned(c)) for c in nulls),
        "detection": detection(cases),
        "by_effect": by_effect(cases),
        "strong": {
            "detected": share(bool(accepted(c)) for c in strong),
            "in_set": share(in_set(c, dominant(c)) for c in strong),
            "first": share(named_first(c, dominant(c)) for c in strong),
            "first_bound": mean(first_bound(c) for c in strong),
            "in_set_of_detected": share(in_set(c, dominant(c)) for c in detected),
            "first_of_detected": share(named_first(c, dominant(c)) for c in detected),
            "mean_set_size": float(np.mean(sizes)) if sizes else None,
            "coverage": share(flag for c in strong for flag in covered(c)),
            "second_effect": share(len(accepted(c)) > 1 for c in detected),
        },
        "very_strong_in_set": share(in_set(c, dominant(c)) for c in strong if noncentrality(c) > 150.0),
        "off_library": lacking(off),
        "leave_one_out": lacking([c for c in of(cases, LEAVE_ONE_OUT) if beyond(c) > STRONG]),
        "pairs": {
            "both_in_sets": share(all(in_set(c, e["key"]) for e in effects(c)) for c in pairs),
            "one_in_sets": share(any(in_set(c, e["key"]) for e in effects(c)) for c in pairs),
            "first_is_one": share(any(named_first(c, e["key"]) for e in effects(c)) for c in pairs),
        },
        "clutter": {
            "dominant_first": share(named_first(c, dominant(c)) for c in led),
            "dominant_in_set": share(in_set(c, dominant(c)) for c in led),
            "named_without_dominant": share(bool(accepted(c)) for c in clutter if not effects(c)),
            "held_out_not_worse": share(
                r <= WORSE for c in clutter if accepted(c) and (r := ratio(c, "after", "before")) is not None
            ),
        },
        "after_over_oracle": median(ratio(c, "after", "oracle") for c in detected),
        "before_over_oracle": median(ratio(c, "before", "oracle") for c in detected),
        "calm_after_over_before": median(
            ratio(c, "after", "before") for c in detected if c["truth"]["trial"]["air"] == "calm"
        ),
        "confusion": confusion(cases),
    }
