"""Reservations: what makes the names of an answer provisional although they leave no anomaly.

There are five: part of what the records show has no name, there are many causes, the evidence is weak, a size is unusual, and a
friction of the vane looks the same. An effect outside the library can look like several named ones together. Each further name
fits more of it, so that a good fit by many names is weaker evidence for each of them than a good fit by one.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from airtruth.effects.effect import Parameter
from airtruth.effects.increment import NAME
from airtruth.effects.registry import EFFECTS
from airtruth.physics.motion import VANES
from airtruth.tracing.accepted import AcceptedEffect, ParameterEstimate
from airtruth.tracing.answer import Alternative
from airtruth.tracing.criterion import CRITERION
from airtruth.tracing.friction import PLAUSIBLE_RAD, is_late_vane
from airtruth.tracing.inference.causes import DERIVATIVES
from airtruth.tracing.selection.explanation import events
from airtruth.units import DEG

_AXIAL: Final = "CX"
"""Coefficient whose increments a wrong angle of attack imitates: ax shows them, after the effects of the other channels."""


def reservations(
    effects: Sequence[AcceptedEffect],
    sets: Sequence[Alternative],
    declared_p_value: float = 0.0,
    friction_p_value: float = 1.0,
    friction_lag_s: float = 0.0,
) -> tuple[str, ...]:
    """Each reason against relying on the names of an answer, in words.

    The level of significance of the declared model where an increment has no name, of the posterior weight of increments without
    any name, and of the friction of the vane is `AnswerCriterion.level`.

    Parameters
    ----------
    effects : those of the answer, the explanation of its derivatives among them.
    sets : sets of causes with their posterior weights, the leading one first.
    declared_p_value : of the test of the declared model [-].
    friction_p_value : of the test of a friction of the vane where the effects have been added [-].
    friction_lag_s : lag of the vane that a plausible friction imitates in these records, see `friction.imitated_lag_s` [s].
    """
    named = [e for e in effects if e.acts_on is None]
    found = list(_unnamed(effects, named))
    if causes(named) >= CRITERION.many:
        found.append(
            f"{_keys(named)} are {CRITERION.many} causes or more, and one effect that the library lacks can look like as many: "
            "the names are provisional until a flight of their own confirms each"
        )
    reasons = [*_weak(effects, named, declared_p_value), *_improbable(effects, named, sets)]
    if reasons:
        subject = f"for {_keys(named)}" if named else "for what is learned"
        found.append(
            f"the evidence {subject} is weak: {'; '.join(reasons)}. It is provisional until another flight shows it again"
        )
    large = [e for e in named if _deviation(e) > CRITERION.far]
    if large:
        found.append(
            f"{_keys(large)} of such a size {'are' if len(large) > 1 else 'is'} improbable a priori, and a cause "
            "that the library lacks can look the same: the names are provisional until a measurement on the ground confirms them"
        )
    return (*found, *_friction(named, friction_p_value, friction_lag_s))


def _keys(effects: Sequence[AcceptedEffect]) -> str:
    return ", ".join(e.key for e in effects)


def _unnamed(effects: Sequence[AcceptedEffect], named: Sequence[AcceptedEffect]) -> Iterator[str]:
    """Part of what the records show has no name of a cause."""
    beside = [e for e in effects if e.acts_on != _AXIAL]
    others = [e for e in named if e.name != DERIVATIVES]
    parts = ["changed derivatives"] if 0 < len(others) < len(named) else []
    parts += ["a learned increment"] if 0 < len(named) < len(beside) else []
    parts += ["an axial force other than the declared one"] if 0 < len(beside) < len(effects) else []
    explained = others or beside
    if parts:
        yield (
            f"the library has no name for part of what the records show ({', '.join(parts)}), and its cause may also explain "
            f"what {_keys(explained)} explain{'' if len(explained) > 1 else 's'}: the names are provisional until a flight of "
            "their own confirms them"
        )


def _weak(
    effects: Sequence[AcceptedEffect], named: Sequence[AcceptedEffect], declared_p_value: float
) -> Iterator[str]:
    """Why the evidence of tests and intervals is weak."""
    if any(e.acts_on != _AXIAL for e in effects) and declared_p_value > (
        CRITERION.declared if named else CRITERION.level
    ):
        yield f"p = {declared_p_value:.2g} for the declared model"
    level = CRITERION.significant if len(named) < 2 else CRITERION.significant_of_several
    weak = [e for e in named if e.p_value > level]
    if weak:
        yield f"p is above {level:g} for {_keys(weak)} alone among all candidates"
    unsure = [e for e in named if _contains_neutral(e)]
    if unsure:
        many = len(unsure) > 1
        yield (
            f"the 95 % interval{'s' if many else ''} of {_keys(unsure)} contain{'' if many else 's'} the value without any effect"
        )


def _improbable(
    effects: Sequence[AcceptedEffect], named: Sequence[AcceptedEffect], sets: Sequence[Alternative]
) -> Iterator[str]:
    """Why the posterior of the names is low."""
    doubtful = [e for e in named if _probability(e, sets) < CRITERION.even]
    if sets and doubtful:
        yield f"the sets of causes without {_keys(doubtful)} are together more probable than those with"
    unnamed = sum(s.weight for s in sets if s.effects == (NAME,))
    if named and len(named) == len(effects) and unnamed > CRITERION.level:
        yield f"learned increments explain the records without any name, with a posterior weight of {100.0 * unnamed:.0f} %"


def _friction(named: Sequence[AcceptedEffect], p_value: float, lag_s: float) -> Iterator[str]:
    """A friction of the vane, which in gusts looks like a lag."""
    of_vane = [
        e
        for e in named
        if e.key in EFFECTS and set(EFFECTS[e.key].channels) <= VANES and EFFECTS[e.key].channels
    ]
    late = [e for e in named if is_late_vane(e.key) and 0.0 < _value(e) <= lag_s]
    if of_vane and p_value <= CRITERION.level:
        yield (
            f"the vane moves less than gyro and accelerometer show where the motion turns (p = {p_value:.2g} beside "
            f"{_keys(of_vane)}), and in gusts a friction of the vane looks like a lag: the name is provisional until the "
            "vane has been moved by hand on the ground with the log running"
        )
    elif late:
        yield (
            f"in the gusts of these records, a friction of the vane of {PLAUSIBLE_RAD / DEG:.1g} deg looks like a lag of "
            f"{1e3 * lag_s:.0f} ms, and {_keys(late)} is not larger: the name is provisional until a flight in "
            "calm air shows it again, or until the vane has been moved by hand on the ground with the log running"
        )


def _value(effect: AcceptedEffect) -> float:
    """Estimate of the first parameter of an effect of the library [unit of the parameter]."""
    stated = _size(effect)
    return 0.0 if stated is None else stated[1].value


def _probability(effect: AcceptedEffect, sets: Sequence[Alternative]) -> float:
    """Posterior probability of an effect or one that looks the same in the records."""
    alike = {effect.label, *effect.indistinguishable_from}
    return sum(s.weight for s in sets if alike & set(s.effects))


def _contains_neutral(effect: AcceptedEffect) -> bool:
    """Whether the interval of the size of an effect of the library contains the value at which it changes nothing."""
    stated = _size(effect)
    if stated is None:
        return False
    first, estimate = stated
    low, high = estimate.ci95
    return (low is None or low <= first.neutral) and (high is None or first.neutral <= high)


def _deviation(effect: AcceptedEffect) -> float:
    """Size of a cause that moves the derivatives, over the standard deviation of its prior; 0 for any other effect [-]."""
    stated = _size(effect)
    prior = EFFECTS[effect.key].prior if effect.key in EFFECTS else None
    if stated is None or prior is None:
        return 0.0
    first, estimate = stated
    return abs(first.size(estimate.value)) / prior.std


def _size(effect: AcceptedEffect) -> tuple[Parameter, ParameterEstimate] | None:
    """First parameter of an effect of the library, and its estimate; None of any other effect."""
    if effect.key not in EFFECTS:
        return None
    first = EFFECTS[effect.key].parameters[0]
    estimate = effect.parameters.get(first.name)
    return None if estimate is None else (first, estimate)


def causes(named: Sequence[AcceptedEffect]) -> int:
    """Number of separate causes among named effects; those of one event count as one."""
    return events([e.key for e in named])


__all__ = ["causes", "reservations"]
