"""The declared model against the records: test, shifts of the derivatives, and what explains them, with its weight."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc, chdtri, chndtrinc, ndtri

from airtruth.effects.registry import EFFECTS
from airtruth.tracing.answer import (
    Z95,
    AcceptedEffect,
    Alternative,
    CandidateScore,
    DeclaredModel,
    DerivativeShift,
    ParameterEstimate,
    RefinedDerivative,
)
from airtruth.tracing.criterion import CRITERION
from airtruth.tracing.inference.causes import (
    DERIVATIVES,
    DeclaredCauses,
    size_in_derivatives,
    size_in_filter,
)
from airtruth.tracing.inference.derivative_likelihood import (
    DERIVATIVES_MOVED,
    Contradiction,
    DerivativeLikelihood,
    size_along,
)
from airtruth.tracing.inference.hypothesis_test import HypothesisTest
from airtruth.tracing.inference.posterior import TraceProblem
from airtruth.tracing.selection.explanation import ExplainedDerivatives, shares
from airtruth.tracing.selection.rounds import SearchRound

Array = NDArray[np.float64]

_POWER: Final = 0.8
"""Share of flights in which a traceable cause is traced [-] (convention)."""
_LEAST_POSTERIOR: Final = 1e-300
"""Least posterior weight whose logarithm is taken [-]: smaller ones underflow."""
_LEAST_WEIGHT: Final = 1e-3
"""Posterior weight below which a set of causes is not listed [-] (judgement: one in a thousand)."""


def declared_model(
    problem: TraceProblem, rounds: Sequence[SearchRound], covariance: Array, causes: DeclaredCauses
) -> DeclaredModel:
    """Test the declared model: its derivatives with their uncertainty, and everything else by the strongest anomaly.

    The shifts are those of the derivatives as they appear in the records. They include what an accepted shift of the CG,
    mass, inertia or elevator brings.

    Parameters
    ----------
    problem : fitted records; rounds : of the search; covariance : of the last fit's common parameters and sizes.
    causes : the candidates, with the directions in which they move the derivatives.
    """
    first, last = rounds[0], rounds[-1]
    test, anomaly = first.declared_test, first.anomaly
    by_derivatives = test.p_value <= anomaly.p_value
    statistic = test.statistic if by_derivatives else anomaly.statistic
    p_value = declared_p_value(rounds)
    declared = problem.declared_derivatives
    declared_std = np.sqrt(np.diag(problem.declared_covariance))
    shift, std = _apparent_shift(last, covariance, causes)
    return DeclaredModel(
        consistent=p_value > CRITERION.declared,
        statistic=statistic,
        degrees=test.degrees if by_derivatives else anomaly.degrees,
        p_value=p_value,
        shifts={
            name: DerivativeShift(
                declared=float(declared[i]),
                declared_std=float(declared_std[i]),
                estimate=float(declared[i] + shift[i]),
                std=float(std[i]),
                ci95=(
                    float(declared[i] + shift[i] - Z95 * std[i]),
                    float(declared[i] + shift[i] + Z95 * std[i]),
                ),
                sigma=float(shift[i] / declared_std[i]),
            )
            for i, name in enumerate(problem.layout.motion.parameters)
        },
        where=DERIVATIVES_MOVED if by_derivatives else anomaly.null,
    )


def refined_derivatives(declared: DeclaredModel) -> dict[str, RefinedDerivative]:
    """Derivatives about which the records alone know more than the declaration.

    The precision of an estimate is that of the declaration plus that of the records; the latter is the larger one where the
    variance of the estimate is below half the declared variance.

    Examples
    --------
    >>> shift = DerivativeShift(-1.79, 0.09, -1.97, 0.02, (-2.01, -1.93), -2.0)
    >>> vague = DerivativeShift(4.8, 0.24, 4.7, 0.2, (4.3, 5.1), -0.4)
    >>> refined_derivatives(DeclaredModel(True, 4.0, 6, 0.68, {"Cmalpha": shift, "CLalpha": vague}))
    {'Cmalpha': RefinedDerivative(declared=-1.79, estimate=-1.97, std=0.02)}
    """
    return {
        name: RefinedDerivative(s.declared, s.estimate, s.std)
        for name, s in declared.shifts.items()
        if 2.0 * s.std**2 < s.declared_std**2
    }


def with_axial_force(declared: DeclaredModel, along: Sequence[AcceptedEffect]) -> DeclaredModel:
    """The test of the declared model with the axial force, which the derivatives and the anomaly do not contain.

    Parameters
    ----------
    along : accepted increments of CX.
    """
    p_value = min((e.p_value for e in along), default=1.0)
    if 2.0 * p_value >= declared.p_value:
        return declared
    gain = next(e.gain_2_log_likelihood or 0.0 for e in along if e.p_value == p_value)
    return replace(
        declared,
        consistent=2.0 * p_value > CRITERION.declared,
        statistic=gain,
        degrees=1,
        p_value=2.0 * p_value,
        where="the axial force",
    )


def remaining_evidence(last: SearchRound) -> HypothesisTest:
    """The strongest evidence of what the answer lacks: the last round's anomaly, or derivatives that nothing of it explains."""
    test = last.declared_test
    if 2.0 * test.p_value >= last.anomaly.p_value:
        return last.anomaly
    return HypothesisTest(DERIVATIVES_MOVED, test.statistic, test.degrees, 2.0 * test.p_value)


def _apparent_shift(last: SearchRound, covariance: Array, causes: DeclaredCauses) -> tuple[Array, Array]:
    """(derivatives,) shift of the derivatives with what carried causes bring, to first order, and its standard deviation."""
    point, hypothesis = last.null.point, last.null.hypothesis
    shift = point.common[point.of.common.derivatives].copy()
    slopes = np.zeros((len(shift), len(covariance)))
    slopes[:, point.of.common.derivatives] = np.eye(len(shift))
    directions = {c.key: c.direction for c in causes.causes}
    for effect in (e for e in hypothesis.effects if e.key in directions):
        number = hypothesis.span(effect.key).start
        in_filter = float(point.sizes[number])
        size = size_in_derivatives(effect, in_filter)
        slope = (1.0 + in_filter) ** -2 if effect.divides else 1.0
        shift += size * directions[effect.key]
        slopes[:, last.null.layout.size(number)] = slope * directions[effect.key]
    return shift, np.sqrt(np.diag(slopes @ covariance @ slopes.T))


def declared_p_value(rounds: Sequence[SearchRound]) -> float:
    """Probability of stronger evidence against a true declaration, of the derivatives and of everything else [-]."""
    return min(1.0, 2.0 * min(rounds[0].declared_test.p_value, rounds[0].anomaly.p_value))


def explaining_effects(rounds: Sequence[SearchRound], covariance: Array) -> tuple[AcceptedEffect, ...]:
    """The effects that explain the derivatives of an answer; none where they are as declared.

    Parameters
    ----------
    covariance : of the last fit's common parameters and sizes.
    """
    first, last = rounds[0], rounds[-1]
    if last.explanation is None:
        return ()
    before = next((r.tied[0].fit for r in reversed(rounds) if r.tied), first.null)
    return tuple(
        AcceptedEffect(
            name=EFFECTS[key].name if key in EFFECTS else key,
            variant=EFFECTS[key].variant if key in EFFECTS else "",
            channel=EFFECTS[key].variant_channel if key in EFFECTS else None,
            parameters=_estimates(key, last.explanation, last, covariance),
            p_value=first.declared_test.p_value,
            separation_sigma=separation_sigma(last, key),
            indistinguishable_from=alike(last, key),
            gain_2_log_likelihood=2.0 * (before.cost - last.null.cost),
        )
        for key in last.explanation.effects
    )


def alike(last: SearchRound, name: str) -> tuple[str, ...]:
    """Names that explain the records as well in the place of one name of the answer, by the posterior of the sets."""
    names = last.names
    rest, least = set(names) - {name}, CRITERION.level * last.posterior.get(names, 0.0)
    others = (
        set(other) - rest
        for other, weight in last.posterior.items()
        if len(other) == len(names) and rest <= set(other) and weight >= least > 0.0
    )
    return tuple(sorted({other for (other,) in others} - {name}))


def separation_sigma(last: SearchRound, name: str) -> float:
    """Odds of the answer against the most probable set without one of its names, as standard deviations [-]."""
    without = max((w for names, w in last.posterior.items() if name not in names), default=0.0)
    own = last.posterior.get(last.names, 0.0)
    if not own > without:
        return 0.0
    return math.sqrt(2.0 * math.log(own / max(without, _LEAST_POSTERIOR)))


def cause_sizes(likelihood: DerivativeLikelihood, declared: DeclaredCauses) -> dict[str, tuple[float, float]]:
    """Key of each cause that the filter does not carry -> its size alone, and the standard deviation.

    Parameters
    ----------
    likelihood : at the first null; declared : the candidates.
    """
    return {
        c.key: size_along(likelihood, c.direction) for c in declared.causes if EFFECTS[c.key].in_derivatives
    }


def cause_scores(
    sizes: Mapping[str, tuple[float, float]],
    rounds: Sequence[SearchRound],
    declared: DeclaredCauses,
    accepted: Sequence[AcceptedEffect],
) -> tuple[CandidateScore, ...]:
    """Scores of the causes that move the derivatives, and of wrong declarations, at the declared aircraft.

    Parameters
    ----------
    sizes : see `cause_sizes`; declared : the candidates; accepted : effects of the answer.
    """
    first = rounds[0]
    named = {name for e in accepted for name in (e.label, *e.indistinguishable_from)}
    contradicted = first.declared_test.p_value <= CRITERION.significant
    rejected = (
        "other causes explain the derivatives better"
        if contradicted
        else "the records do not contradict the declared derivatives"
    )
    rows = []
    for key, (size, std) in sizes.items():
        z = size / std if std > 0.0 else 0.0
        alone = float(chdtrc(1, z**2))
        rows.append(_row(key, z**2, alone, len(declared.causes), named, rejected, z))
    if declared.wrong_allowed:
        test = first.declared_test
        rows.append(
            _row(DERIVATIVES, test.statistic, test.p_value, 1, named, rejected, math.sqrt(test.statistic))
        )
    return tuple(rows)


def detectable_causes(
    likelihood: DerivativeLikelihood,
    sizes: Mapping[str, tuple[float, float]],
    declared: DeclaredCauses,
    test: Contradiction,
) -> dict[str, float]:
    """Smallest size of each cause that the records can trace and that is material, in the unit of its first parameter.

    Parameters
    ----------
    likelihood : at the first null; sizes : see `cause_sizes`; declared : the candidates.
    test : of the declared derivatives.
    """
    errors = traceable_errors(test.directions)
    found = {
        key: max(errors * std, EFFECTS[key].parameters[0].material)
        for key, (_, std) in sizes.items()
        if 0.0 < std < np.inf
    }
    if declared.wrong_allowed:
        own = np.linalg.inv(likelihood.information + np.linalg.inv(likelihood.declared))
        alone = traceable_errors(test.directions, test.derivatives)
        found[DERIVATIVES] = alone * float(np.sqrt(likelihood.declared[0, 0] + own[0, 0]))
    return {key: size for key, size in found.items() if size > 0.0 and np.isfinite(size)}


def traceable_errors(directions: int, derivatives: int = 0) -> float:
    """Standard deviations of a cause that contradict the declared model in four of five flights [-].

    Half of the level of the declared model (`declared_p_value`) is that of the derivatives, and half of this that of their joint
    test, whose statistic is a noncentral chi-square with ``directions`` degrees of freedom.

    Parameters
    ----------
    derivatives : number of single derivatives that are tested, for a cause that is one of them; 0 for others.
    """
    level = 0.25 * CRITERION.declared
    threshold = chdtri(directions, level)
    joint = math.sqrt(float(chndtrinc(threshold, directions, 1.0 - _POWER)))
    if not derivatives:
        return joint
    each = -math.expm1(math.log1p(-level) / derivatives)
    return min(joint, float(ndtri(_POWER) - ndtri(0.5 * each)))


def _row(
    key: str, score: float, alone: float, tests: int, named: Collection[str], rejected: str, z: float
) -> CandidateScore:
    name, _, variant = key.partition(":")
    return CandidateScore(
        name=name,
        variant=variant,
        score=score,
        p_value=min(1.0, tests * alone),
        testable=True,
        why_not="" if key in named else rejected,
        z=z,
        p_value_alone=alone,
    )


def _estimates(
    key: str, best: ExplainedDerivatives, last: SearchRound, covariance: Array
) -> dict[str, ParameterEstimate]:
    if key == DERIVATIVES:
        shift, std = last.null.point.common, np.sqrt(np.diag(covariance))
        return {
            f"d{name}": _normal(float(shift[i]), float(std[i]))
            for i, name in enumerate(last.null.point.of.motion.parameters)
            if name in best.wrong
        }
    effect = EFFECTS[key]
    first = effect.parameters[0]
    at = best.causes.index(key)
    size, std_size = best.sizes[at], best.size_std[at]
    low, value, high = (
        first.value(size_in_filter(effect, s)) for s in (size - Z95 * std_size, size, size + Z95 * std_size)
    )
    slope = value**2 if effect.divides else 1.0
    return {first.name: ParameterEstimate(value, std_size * slope, (low, high))}


def _normal(value: float, std: float) -> ParameterEstimate:
    return ParameterEstimate(value, std, (value - Z95 * std, value + Z95 * std))


def alternatives(rounds: Sequence[SearchRound]) -> tuple[Alternative, ...]:
    """Sets of effects with their posterior weights, which add up to one, the most probable first."""
    listed = {names: weight for names, weight in rounds[-1].posterior.items() if weight >= _LEAST_WEIGHT}
    ranked = sorted(shares(listed).items(), key=lambda item: (-item[1], item[0]))
    return tuple(Alternative(names, weight) for names, weight in ranked)


def inclusion(sets: Sequence[Alternative]) -> dict[str, float]:
    """Probability of each effect: the weight of the sets that contain it."""
    names = sorted({name for s in sets for name in s.effects})
    return {name: min(1.0, sum(s.weight for s in sets if name in s.effects)) for name in names}


__all__ = [
    "alike",
    "alternatives",
    "cause_scores",
    "cause_sizes",
    "declared_model",
    "declared_p_value",
    "detectable_causes",
    "explaining_effects",
    "inclusion",
    "refined_derivatives",
    "remaining_evidence",
    "separation_sigma",
    "traceable_errors",
    "with_axial_force",
]
