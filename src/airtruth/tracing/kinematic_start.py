"""What the kinematics of the fitted records tell before aerodynamics: sizes at which refits begin, and disagreement.

A refit of the derivatives can absorb a slow vane, which then has no score and is never a candidate. The kinematic check
needs no aerodynamics and knows it. Its causes are therefore always refitted, from the declared aircraft.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

from airtruth.aircraft import Aircraft
from airtruth.checks.kinematics import check_kinematics, declared_errors
from airtruth.checks.kinematics_model import ERRORS
from airtruth.checks.result import CheckResult, Finding
from airtruth.effects.registry import EFFECTS
from airtruth.errors import LogError
from airtruth.logs.flight_log import FlightLog
from airtruth.physics.sensor_errors import KINDS
from airtruth.tracing.answer import TraceAnswer


def kinematic_check(
    logs: Sequence[FlightLog], aircraft: Aircraft, held: Collection[str]
) -> CheckResult | None:
    """Kinematic check of the records that are not held out; None where they do not allow one.

    Parameters
    ----------
    logs : logs that passed the gate; held : names of the held-out records.
    """
    parts = []
    for log in logs:
        fitted = [run_id for run_id in log.run_ids if run_id not in held]
        if fitted:
            parts.append(log.select(run_ids=fitted))
    try:
        return check_kinematics(parts, declared_errors(aircraft), aircraft.chord_m)
    except LogError:
        return None


def starts_of(check: CheckResult | None) -> dict[str, float]:
    """Effect -> value of its parameter [SI], of the causes that a check names."""
    if check is None or check.verdict not in ("errors", "one_of"):
        return {}
    named = {f.name for cause in check.possible for f in cause.errors}
    return {f.name: _beyond_declared(f) for f in check.findings if f.name in named and f.name in EFFECTS}


def _beyond_declared(one: Finding) -> float:
    """Error in addition to the declared one; an effect adds to the declaration.

    A bias is no error of `ERRORS`: the check estimates it beside them.
    """
    is_factor = one.name in ERRORS and KINDS[ERRORS[one.name].kind].is_factor
    return one.value / one.declared if is_factor else one.value - one.declared


def disagreement(check: CheckResult | None, answer: TraceAnswer) -> list[str]:
    """Sentences about contradictions between a check and an answer, without a final period."""
    if check is None or check.verdict not in ("errors", "one_of"):
        return []
    traced = {name for e in answer.effects for name in (_key(e.name, e.channel), *e.indistinguishable_from)}
    sets = [{f.name for f in cause.errors} & EFFECTS.keys() for cause in check.possible]
    result = []
    if sets and all(sets) and not any(one & traced for one in sets):
        words = " or ".join(sorted({" with ".join(sorted(one)) for one in sets}))
        result.append(
            f"the kinematic check of the fitted records names {words}, and the trace accepts none of these: it is "
            "without reservation only where both agree; inspect `airtruth check`"
        )
    for effect in answer.effects:
        found = next((f for f in check.findings if f.name == _key(effect.name, effect.channel)), None)
        first = next(iter(effect.parameters.values()), None)
        if found is None or first is None or found.state == "not shown":
            continue
        low, high = (_beyond_declared(replace(found, value=x)) for x in (found.lower, found.upper))
        bottom, top = first.ci95
        if (top is not None and top < low) or (bottom is not None and bottom > high):
            result.append(
                f"{found.name}: the trace estimates {first.value:.4g}, the kinematic check {low:.4g} to {high:.4g}"
            )
    return result


def _key(name: str, channel: str | None) -> str:
    return f"{name}:{channel}" if channel else name


__all__ = ["disagreement", "kinematic_check", "starts_of"]
