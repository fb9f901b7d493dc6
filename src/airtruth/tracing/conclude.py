"""The conclusion of a search: verdict, effects with their uncertainty, candidates and the next flight."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from airtruth.effects.increment import Increment
from airtruth.physics.atmosphere import RHO0_KG_M3
from airtruth.tracing.anomalies.families import FRICTION
from airtruth.tracing.anomalies.score_test import ScoreTable
from airtruth.tracing.answer import (
    AcceptedEffect,
    Alternative,
    CandidateScore,
    DeclaredModel,
    Derivatives,
    Evidence,
    RecordNames,
    RefinedDerivative,
    TraceAnswer,
    VerdictName,
)
from airtruth.tracing.axial_force import AxialForce
from airtruth.tracing.confirmation import confirmation
from airtruth.tracing.credit import credit
from airtruth.tracing.criterion import CRITERION
from airtruth.tracing.declared_model import (
    alike,
    alternatives,
    cause_scores,
    cause_sizes,
    declared_model,
    detectable_causes,
    explaining_effects,
    inclusion,
    refined_derivatives,
    remaining_evidence,
    separation_sigma,
    with_axial_force,
)
from airtruth.tracing.friction import imitated_lag_s, is_late_vane
from airtruth.tracing.increment_table import in_physical_terms, increment_rows, least_certain
from airtruth.tracing.inference.derivative_likelihood import DerivativeLikelihood, derivative_likelihood
from airtruth.tracing.inference.homogeneity import Homogeneity, homogeneity
from airtruth.tracing.inference.hypothesis import is_curvature
from airtruth.tracing.inference.hypothesis_test import HypothesisTest
from airtruth.tracing.inference.posterior import TraceProblem
from airtruth.tracing.inference.robust import robust_covariance
from airtruth.tracing.intervals import at_measured_alpha, estimates, widened_by_profile
from airtruth.tracing.next_flight import next_flight
from airtruth.tracing.notes import notes
from airtruth.tracing.prepare import Case
from airtruth.tracing.record_differences import differences
from airtruth.tracing.replay import worsened
from airtruth.tracing.reservations import reservations
from airtruth.tracing.selection.candidate import Candidate
from airtruth.tracing.selection.rounds import SearchRound
from airtruth.tracing.stage_errors import Replay
from airtruth.tracing.stages import Stages, accepted, stage_errors
from airtruth.tracing.tolerances import tolerances
from airtruth.units import FT, KT

Array = NDArray[np.float64]
Publish = Callable[[bool], tuple[str | None, Replay | None]]
"""From whether derivatives are refined to the folder of the updated aircraft and the records flown again, each None for none."""

_TRACEABLE: Final = 4.0
"""Root of the noncentrality from which an effect counts as traceable [-] (judgement: after Holm's correction at 5 %
over 33 candidates such an effect is significant in four of five flights, as ndtr(4 + ndtri(0.05/66)) = 0.80)."""


def conclude(
    stages: Stages,
    rounds: Sequence[SearchRound],
    publish: Publish | None = None,
    forced: Sequence[str] = (),
    axial: AxialForce | None = None,
) -> TraceAnswer:
    """State the answer of a trace.

    Parameters
    ----------
    stages, rounds : assessed stages, and rounds of the search.
    publish : writes the updated aircraft and flies it; None to write nothing.
    forced : faults of the logs that the caller overruled.
    axial : what ax shows; None where it was not compared.
    """
    case, first, last = stages.case, rounds[0], rounds[-1]
    motion = case.fitted.layout.motion
    effects = accepted(rounds)
    anomaly, remaining = first.anomaly, remaining_evidence(last)
    covariance = robust_covariance(case.fitted, last.reported)
    every = (
        *(_effect(case.fitted, rounds, number, covariance) for number in range(len(effects))),
        *explaining_effects(rounds, covariance),
    )
    stated = tuple(sorted(every, key=lambda e: -e.separation_sigma))
    along = () if axial is None else axial.increments
    declared = with_axial_force(declared_model(case.fitted, rounds, covariance, case.declared), along)
    sets = alternatives(rounds)
    likelihood = derivative_likelihood(case.fitted, first.null)
    sizes = cause_sizes(likelihood, case.declared)
    confirmed, shown = confirmation(stages), (*stated, *along)
    agreement = homogeneity(case.fitted, last.reported)
    reserved = _reserved(case.fitted, last, shown, sets, declared, agreement)
    verdict = _verdict(shown, declared, agreement)
    if verdict == "unexplained" and declared.consistent:
        anomaly = remaining = agreement
    errors = stage_errors(stages)
    refined = _refined(stages, declared) if verdict == "none" else {}
    updated, replay = (None, None) if publish is None else publish(bool(refined))
    return TraceAnswer(
        verdict=verdict,
        provisional=case.held is None
        or confirmed is False
        or bool(case.left_out)
        or bool(shown and reserved)
        or bool(worsened(replay))
        or (bool(shown) and remaining.p_value <= CRITERION.significant),
        anomaly=_evidence(anomaly),
        remaining=_evidence(remaining),
        effects=shown,
        candidates=_candidates(case, rounds, stated, sizes),
        error=errors,
        derivatives=_derivatives(case, rounds, covariance),
        updated_aircraft=updated,
        detectability=_detectability(case, rounds, likelihood, sizes),
        next_flight=next_flight(effects, verdict, remaining, list(least_certain(shown)), motion),
        model=case.model,
        records=RecordNames(
            tuple(dict.fromkeys(r.signals.record for r in case.fitted.records)),
            tuple(r.signals.record for r in case.held.records) if case.held else (),
        ),
        notes=(
            *reserved,
            *notes(stages, last, declared, errors, replay, forced),
            *_generated(case, updated),
        ),
        tolerances=tolerances(stages),
        replay=replay,
        forced=tuple(forced),
        declared_model=declared,
        confirmed=confirmed,
        alternatives=sets,
        inclusion=inclusion(sets),
        credit=credit(stated, stages),
        axial_force=None if axial is None else axial.errors,
        refined=refined,
    )


def _refined(stages: Stages, declared: DeclaredModel) -> dict[str, RefinedDerivative]:
    """The refined derivatives, none where the held-out records deny them."""
    denied = confirmation(stages, "declared", "before") is False
    return {} if denied else refined_derivatives(declared)


def _reserved(
    problem: TraceProblem,
    last: SearchRound,
    effects: Sequence[AcceptedEffect],
    sets: Sequence[Alternative],
    declared: DeclaredModel,
    agreement: Homogeneity,
) -> tuple[str, ...]:
    """Each reason against relying on the effects, and how the records differ, in words."""
    late = any(is_late_vane(e.key) for e in effects)
    lag_s = imitated_lag_s(problem, last.reported) if late else 0.0
    differ = differences(agreement, [r.signals.run_id for r in problem.records], bool(effects))
    return (*reservations(effects, sets, declared.p_value, last.p_value_of(FRICTION), lag_s), *differ)


def _generated(case: Case, updated: str | None) -> Iterator[str]:
    """How to fly the updated aircraft of one that has no JSBSim model."""
    if updated is None or case.fitted.records[0].plant.aircraft.file.jsbsim is not None:
        return
    signals = [record.signals for record in case.fitted.records]
    pressure = np.mean([0.5 * s.density_kg_m3[0] * s.airspeed_m_s[0] ** 2 for s in signals])
    eas_kt = math.sqrt(2.0 * float(pressure) / RHO0_KG_M3) / KT
    altitude_ft = float(np.mean([s.altitude_m for s in signals])) / FT
    yield (
        "the updated aircraft has a generated JSBSim model, linear about the trim of the records, with a placeholder for the "
        f"drag and a thrust line through the CG; `airtruth new campaign --aircraft {updated} --eas-kt {eas_kt:.1f} "
        f"--altitude-ft {altitude_ft:.0f} --out first.toml` and `airtruth fly first.toml --out first` fly it"
    )


def _verdict(
    effects: Sequence[AcceptedEffect], declared: DeclaredModel, agreement: Homogeneity
) -> VerdictName:
    if not effects:
        return "none" if declared.consistent and agreement.p_value >= CRITERION.certain else "unexplained"
    if any(e.acts_on is not None for e in effects):
        return "learned"
    return "one_of" if any(e.indistinguishable_from for e in effects) else "traced"


def _effect(
    problem: TraceProblem, rounds: Sequence[SearchRound], number: int, covariance: Array
) -> AcceptedEffect:
    own, final = [r for r in rounds if r.tied][number], rounds[-1].reported
    best, others = own.tied[0], own.tied[1:]
    effect = best.score.effect
    span = final.hypothesis.span(effect.key)
    own_covariance = covariance[final.layout.sizes, final.layout.sizes][span, span]
    stated = estimates(effect, final.point.sizes[span], own_covariance)
    if own.profile is not None:
        stated = widened_by_profile(effect, stated, own.profile)
    shift = problem.alpha_shift_rad
    stated = at_measured_alpha(effect, stated, shift)
    accepted = AcceptedEffect(
        name=effect.name,
        variant=effect.variant,
        parameters=stated,
        p_value=_p_value(own, best),
        separation_sigma=separation_sigma(rounds[-1], effect.label),
        indistinguishable_from=tuple(
            sorted(
                {*alike(rounds[-1], effect.label), *(c.score.effect.label for c in others)} - {effect.label}
            )
        ),
        gain_2_log_likelihood=best.gain,
        other_variants=tuple(
            sorted(c.score.effect.variant for c in others if c.score.effect.label == effect.label)
        ),
        channel=effect.variant_channel,
        about_alpha_rad=final.hypothesis.trim_flow_rad + shift
        if is_curvature(effect, final.hypothesis.motion)
        else None,
    )
    if isinstance(effect, Increment):
        return in_physical_terms(problem, final, covariance, effect, accepted)
    return accepted


def _p_value(own: SearchRound, best: Candidate) -> float:
    """Holm's p-value of the score, or Bonferroni's of the likelihood ratio where noise levels show more.

    The p-value of an increment is the inverse of its posterior odds.
    """
    if isinstance(best.score.effect, Increment):
        return best.score.p_value
    keys = [s.effect.key for s in own.table.scores]
    if best.score.effect.key not in keys:
        return len(own.adjusted) * float(chdtrc(1, max(best.gain, 0.0)))
    index = keys.index(best.score.effect.key)
    ratio = len(own.adjusted) * float(chdtrc(1, max(best.gain, 0.0)))
    return min(float(own.adjusted[index]), ratio)


def _candidates(
    case: Case,
    rounds: Sequence[SearchRound],
    stated: Sequence[AcceptedEffect],
    sizes: Mapping[str, tuple[float, float]],
) -> tuple[CandidateScore, ...]:
    first, posterior = rounds[0], rounds[-1].posterior
    named = {name for e in stated for name in (e.key, e.label, *e.indistinguishable_from)}
    rows = list(cause_scores(sizes, rounds, case.declared, stated))
    for s, p in zip(first.table.scores, first.adjusted, strict=True):
        if s.effect.key in named or s.effect.label in named:
            why = ""
        elif any(s.effect.key in step.removeprefix("refit ").split(" + ") for step in case.left_out):
            why = "the time budget ended before its refit"
        elif p > CRITERION.level:
            why = "its score is not significant"
        else:
            weight = sum(w for names, w in posterior.items() if s.effect.label in names)
            why = f"the sets of effects with it are improbable (posterior {weight:.2g})"
        rows.append(
            CandidateScore(
                name=s.effect.name,
                variant=s.effect.variant,
                score=s.z**2,
                z=s.z,
                p_value=float(p),
                p_value_alone=s.p_value,
                testable=True,
                why_not=why,
            )
        )
    rows += increment_rows(rounds)
    scored = {s.effect.key for s in first.table.scores}
    silent = "these records do not excite it, or the refitted derivatives absorb it"
    untested = [*case.untestable, *((e, silent) for e in case.effects if e.key not in scored)]
    rows += [
        CandidateScore(e.name, score=0.0, p_value=1.0, testable=False, why_not=why, variant=e.variant)
        for e, why in untested
    ]
    return tuple(sorted(rows, key=lambda r: (-r.testable, r.p_value_alone)))


def _derivatives(case: Case, rounds: Sequence[SearchRound], covariance: Array) -> Derivatives:
    """Declared and refitted derivatives at the trim, the mean over the records' flight conditions."""
    declared = case.fitted.declared_derivatives
    motion = case.fitted.layout.motion

    def named(values: Array) -> dict[str, float]:
        return dict(zip(motion.parameters, values.tolist(), strict=True))

    rows = rounds[-1].null.layout.of.common.derivatives
    return Derivatives(
        declared=named(declared),
        before=named(declared + rounds[0].null.point.common[rows]),
        after=named(declared + rounds[-1].null.point.common[rows]),
        after_std=named(np.sqrt(np.diag(covariance)[rows])),
    )


def _detectability(
    case: Case,
    rounds: Sequence[SearchRound],
    likelihood: DerivativeLikelihood,
    sizes: Mapping[str, tuple[float, float]],
) -> dict[str, float]:
    """Smallest traceable sizes at a null that is probable; none where no round has one."""
    if rounds[0].declared_test.p_value > CRITERION.significant:
        test = rounds[0].declared_test
        return detectability(rounds[0].table) | detectable_causes(likelihood, sizes, case.declared, test)
    return detectability(rounds[-1].table) if rounds[-1].anomaly.p_value > CRITERION.significant else {}


def detectability(table: ScoreTable) -> dict[str, float]:
    """Smallest size of each effect that the records can trace (noncentrality 16) and that is material, in its own unit.

    A bandwidth or a rate limit is stated as its value. An effect with several variants is listed under its name with
    the size of the variant that the records show best, and under the key of each variant.
    """
    found: dict[str, float] = {}
    for s in table.scores:
        p = s.effect.parameters[0]
        size = max(_TRACEABLE / math.sqrt(s.information), p.material)
        value = p.value(size) if p.reciprocal else size
        if s.effect.variant:
            found[s.effect.key] = value
        kept = found.get(s.effect.name)
        found[s.effect.name] = value if kept is None else (max if p.reciprocal else min)(kept, value)
    return found


def _evidence(test: HypothesisTest) -> Evidence:
    return Evidence(test.statistic, test.p_value, test.null)


__all__ = ["conclude", "detectability", "estimates"]
