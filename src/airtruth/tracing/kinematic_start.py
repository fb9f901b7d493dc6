"""Evidence of the kinematics of the fitted records, before aerodynamics: starts, ranges and priors of sensor errors.

A refit of the derivatives can absorb a slow vane. The kinematic check needs no aerodynamics and knows it, so that the search
begins at its sets of errors too. Where it needs no error of a sensor, it limits the errors that a trace may name. What
it tells of an error of the airspeed, which no output of the filter shows, is a prior of the size.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from airtruth.aircraft import Aircraft
from airtruth.checks import kinematics_model, kinematics_side
from airtruth.checks.kinematics import AIRSPEED, check_kinematics
from airtruth.checks.kinematics_lateral import check_lateral
from airtruth.checks.kinematics_record import declared_errors
from airtruth.checks.kinematics_words import NAMED
from airtruth.checks.result import CheckResult, Finding, PossibleCause
from airtruth.effects.effect import Effect
from airtruth.effects.registry import EFFECTS
from airtruth.errors import LogError
from airtruth.logs.flight_log import FlightLog
from airtruth.physics.motion import LONGITUDINAL, Motion
from airtruth.physics.motion_parts import reference_length_m
from airtruth.tracing.answer import Evidence, TraceAnswer
from airtruth.tracing.criterion import CRITERION
from airtruth.tracing.inference.kinematic_likelihood import KinematicLikelihood

ERRORS: Final = kinematics_model.ERRORS | kinematics_side.ERRORS
"""Errors that the kinematics of a motion can show, by name."""
_ERRORS: Final = 5.0
"""Standard errors of the kinematic check beyond which it excludes an error of a sensor [-] (judgement: its noise is not
quite white)."""
_MOST_ERRORS: Final = 6.0
"""Standard errors at most by which the check's estimate differs from none where it is a prior [-] (judgement: more than this is
certain, and less than the errors of a kinematic model that knows neither lags of the pneumatics nor bending)."""
_SAMPLES: Final = 0.5
"""Time over the sample period up to which the check does not contradict a trace [-] (judgement: between two samples it follows
the motion by a polynomial, and a surface that steps bends it; ideal sensors logged at 20 Hz show a gyro late by a quarter of a
sample)."""


def kinematic_check(
    logs: Sequence[FlightLog], aircraft: Aircraft, held: Collection[str], motion: Motion = LONGITUDINAL
) -> CheckResult | None:
    """Kinematic check of the records that are not held out; None where they do not allow one.

    Parameters
    ----------
    logs : logs that passed the gate; held : names of the held-out records.
    motion : whose channels are compared.
    """
    parts = []
    for log in logs:
        fitted = [run_id for run_id in log.run_ids if run_id not in held]
        if fitted:
            parts.append(log.select(run_ids=fitted))
    try:
        check, kinematics = _CHECKS[motion.name]
        length_m = reference_length_m(aircraft.constants, kinematics.reference)
        return check(parts, declared_errors(aircraft, kinematics), length_m or None)
    except LogError:
        return None


_CHECKS: Final = {
    "longitudinal": (check_kinematics, kinematics_model.LONGITUDINAL),
    "lateral": (check_lateral, kinematics_side.LATERAL),
}
"""Name of a motion -> its kinematic check and what the check depends on."""


def starts_of(check: CheckResult | None, dt_s: float) -> tuple[dict[str, float], ...]:
    """Sets of effects of the library that a check allows, the cheapest first, as key -> value [SI]; none where it names no error.

    Parameters
    ----------
    dt_s : longest sample period of the fitted records [s]; a time of up to half of it is no error.
    """
    if check is None or check.verdict not in ("errors", "one_of"):
        return ()
    values = {f.name: _beyond_declared(f) for f in check.findings}
    airspeed = {f.name for f in _of_airspeed(check)}
    sets = dict.fromkeys(frozenset(_effects_of(cause, dt_s) | airspeed) for cause in check.possible)
    return tuple({name: values[name] for name in sorted(one)} for one in sets if one)


def likelihood_of(check: CheckResult | None) -> KinematicLikelihood | None:
    """The likelihood of the errors of sensors that a check compares; None where it cannot judge them.

    The airspeed is left out: `within_kinematics` has what its equation tells.
    """
    if check is None or check.search is None or check.verdict == "failed":
        return None
    names = {f.name for f in check.findings if f.name in ERRORS and f.name in EFFECTS}
    return KinematicLikelihood(check.search, frozenset(names - {*AIRSPEED}))


def _effects_of(cause: PossibleCause, dt_s: float) -> set[str]:
    """Effects of the library that a set of errors names; a share of a sample period is none."""
    return {
        f.name for f in cause.errors if f.name in EFFECTS and abs(f.value - f.declared) > _margin(f, dt_s)
    }


def within_kinematics(effects: Sequence[Effect], check: CheckResult | None) -> tuple[Effect, ...]:
    """The effects; errors of sensors have the range that a check allows, if the check needs none of them.

    A range ends `_ERRORS` standard errors from the estimate of the check, and contains the neutral value. A refit that ends at
    an end of its range is not accepted. Errors that the records do not show keep their range. An error of the airspeed that the
    check names has its estimate as a prior besides: the filter takes the airspeed as it is, and no output of it shows its error.
    """
    if check is None:
        return tuple(effects)
    fits = check.p_value >= CRITERION.level and [c.errors for c in check.possible] == [()]
    shown = {
        f.name: f
        for f in check.findings
        if f.name in ERRORS and f.state not in ("not shown", "not assessed") and (fits or f.name in AIRSPEED)
    }
    return tuple(_limited(e, shown[e.key]) if e.key in shown else e for e in effects)


def _limited(effect: Effect, found: Finding) -> Effect:
    only, reach = effect.parameters[0], _ERRORS * found.std
    low, high = (
        _beyond_declared(replace(found, value=x)) for x in (found.value - reach, found.value + reach)
    )
    low, high = max(only.low, min(low, only.neutral)), min(only.high, max(high, only.neutral))
    limited = replace(only, low=low, high=high)
    if found.name in AIRSPEED and found.state in NAMED:
        size = only.size(_beyond_declared(found))
        limited = replace(limited, prior_mean=size, prior_std=float(np.hypot(found.std, size / _MOST_ERRORS)))
    return replace(effect, parameters=(limited,))


def _of_airspeed(check: CheckResult) -> list[Finding]:
    """Errors of the airspeed that its own equation shows and the library holds; no set of the other errors has them."""
    return [f for f in check.findings if f.name in AIRSPEED and f.name in EFFECTS and f.state in NAMED]


def _beyond_declared(one: Finding) -> float:
    """Error in addition to the declared one; an effect adds to the declaration.

    A bias is no error of `ERRORS`: the check estimates it beside them.
    """
    is_factor = one.name in ERRORS and ERRORS[one.name].is_factor
    return one.value / one.declared if is_factor else one.value - one.declared


def disagreement(check: CheckResult | None, answer: TraceAnswer, dt_s: float) -> list[str]:
    """Sentences about contradictions between a check and an answer, without a final period.

    Parameters
    ----------
    dt_s : longest sample period of the fitted records [s].
    """
    if check is None or check.verdict not in ("errors", "one_of"):
        return []
    traced = {name for e in answer.effects for name in (_key(e.name, e.channel), *e.indistinguishable_from)}
    sets = [_effects_of(cause, dt_s) for cause in check.possible]
    result = [
        f"the airspeed contradicts ax, az and theta unless its reading changes with the angle of attack ({f.name} "
        f"{f.lower:.2g} to {f.upper:.2g} {f.unit}), and the trace does not accept that error, so the answer is "
        "provisional; inspect `airtruth check`"
        for f in _of_airspeed(check)
        if f.name not in traced
    ]
    if sets and all(sets) and not any(one & traced for one in sets):
        words = " or ".join(sorted({" with ".join(sorted(one)) for one in sets}))
        result.append(
            f"the kinematic check of the fitted records names {words}, and the trace accepts none of these, so "
            "the answer is provisional; inspect `airtruth check`"
        )
    for effect in answer.effects:
        found = next((f for f in check.findings if f.name == _key(effect.name, effect.channel)), None)
        first = next(iter(effect.parameters.values()), None)
        if found is None or first is None or found.state == "not shown":
            continue
        low, high = (_beyond_declared(replace(found, value=x)) for x in (found.lower, found.upper))
        bottom, top = first.ci95
        margin = _margin(found, dt_s)
        if (top is not None and top < low - margin) or (bottom is not None and bottom > high + margin):
            result.append(
                f"{found.name}: the trace estimates {first.value:.4g}, the kinematic check {low:.4g} to {high:.4g}"
            )
    return result


def _margin(one: Finding, dt_s: float) -> float:
    """Difference that is none: for a time, a share of the sample period [s]."""
    return _SAMPLES * dt_s if one.unit == "s" else 0.0


def with_contradictions(answer: TraceAnswer, check: CheckResult | None, dt_s: float) -> TraceAnswer:
    """The answer with its contradictions to a check, which make its effects provisional.

    Parameters
    ----------
    check : of the fitted records.
    dt_s : as of `disagreement`.

    Notes
    -----
    Where the channels contradict each other beyond doubt, something is missing, although the whole of the records fits the
    declared aircraft: a sensor that was late in one record, for example.
    """
    found = disagreement(check, answer, dt_s)
    provisional = answer.provisional or bool(found and answer.effects)
    if answer.verdict == "none" and check is not None and check.p_value < CRITERION.certain:
        left = Evidence(check.statistic, check.p_value, "the kinematics of the fitted records")
        found.append(
            f"the channels of the fitted records contradict each other (p = {check.p_value:.2g} of the kinematic check), and no "
            "missing effect explains it; run `airtruth check` on single records, because an error may be in one of them alone"
        )
        answer = replace(answer, verdict="unexplained", anomaly=left, remaining=left)
    return replace(answer, provisional=provisional, notes=(*answer.notes, *found))


def _key(name: str, channel: str | None) -> str:
    return f"{name}:{channel}" if channel else name


__all__ = [
    "disagreement",
    "kinematic_check",
    "likelihood_of",
    "starts_of",
    "with_contradictions",
    "within_kinematics",
]
