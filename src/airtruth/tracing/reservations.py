"""Reservations: what makes the names of an answer provisional although they leave no anomaly.

An effect outside the library can look like several named ones together. Each further name fits more of it, so that a good fit by
many names is weaker evidence for each of them than a good fit by one.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from airtruth.effects.effect import Parameter
from airtruth.effects.increment import NAME
from airtruth.effects.registry import EFFECTS
from airtruth.physics.motion import VANES
from airtruth.tracing.accepted import AcceptedEffect, ParameterEstimate
from airtruth.tracing.answer import DECLARED_LEVEL, Alternative
from airtruth.tracing.friction import PLAUSIBLE_RAD, is_late_vane
from airtruth.tracing.inference.causes import DERIVATIVES
from airtruth.tracing.selection.explanation import events
from airtruth.units import DEG

MANY: Final = 3
"""Number of separate causes from which their names are provisional [-] (judgement: in the blind trials an effect outside
the library is answered by three or more names about as often as three true causes are)."""
LEAST_INCLUSION: Final = 0.5
"""Posterior probability of a named cause below which the names are provisional [-]: the sets without it are more probable."""
WEAK: Final = 0.01
"""P-value of a name over all candidates from which it is provisional [-]: that of an unexplained verdict. Of the answers without
a reservation in the trials of leave-one-out, slow, triple and unmodelled, two names exceeded it, and both were wrong."""
WEAK_OF_SEVERAL: Final = 2e-5
"""The same of each of several names [-]: a gain of 25 in 2 log L, because one effect that the library lacks can look like several
of unequal evidence (judgement)."""
UNNAMED: Final = 0.05
"""Posterior weight of increments without any name from which the names are provisional [-] (convention)."""
UNSHOWN: Final = 0.05
"""P-value of the declared model above which an increment without a name is provisional [-] (convention): without a missing
effect, a mode was learned in one of 40 flights of a small aircraft."""
DOUBT: Final = 0.05
"""Probability of the test of a friction of the vane below which a named error of the vane is provisional [-] (convention)."""
UNUSUAL: Final = 3.0
"""Size of a named cause over the standard deviation of its prior from which the names are provisional [-] (convention)."""
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

    Parameters
    ----------
    effects : those of the answer, the explanation of its derivatives among them.
    sets : sets of causes with their posterior weights, the leading one first.
    declared_p_value : of the test of the declared model [-].
    friction_p_value : of the test of a friction of the vane where the effects have been added [-].
    friction_lag_s : lag of the vane that a plausible friction imitates in these records, see `friction.imitated_lag_s` [s].
    """
    named = [e for e in effects if e.acts_on is None]
    listed = ", ".join(e.key for e in named)
    found = [*_beside_derivatives(named)]
    beside = [e for e in effects if e.acts_on != _AXIAL]
    if beside and len(beside) < len(effects):
        found.append(
            f"ax contradicts the declared axial force; a wrong name instead of {', '.join(e.key for e in beside)} "
            "would contradict it as well, so both are provisional"
        )
    if named and len(named) < len(beside):
        found.append(
            f"the library lacks an effect of these records, which may also have caused what {listed} explain"
            f"{'' if len(named) > 1 else 's'}: the names are provisional until a flight of their own confirms them"
        )
    if causes(named) >= MANY:
        found.append(
            f"{listed} are {MANY} causes or more, and one effect that the library lacks can look like as many: the names are "
            "provisional until a flight of their own confirms each"
        )
    found += _weak(named, bool(beside), declared_p_value)
    unsure = [e.key for e in named if _contains_neutral(e)]
    if unsure:
        found.append(
            f"the 95 % interval{'s' if len(unsure) > 1 else ''} of {', '.join(unsure)} "
            f"contain{'' if len(unsure) > 1 else 's'} the value without any effect: the names are provisional"
        )
    large = [e.key for e in named if _deviation(e) > UNUSUAL]
    if large:
        found.append(
            f"{', '.join(large)} of such a size {'are' if len(large) > 1 else 'is'} improbable a priori, and a cause "
            "that the library lacks can look the same: the names are provisional until a measurement on the ground confirms them"
        )
    doubtful = [e.key for e in named if _probability(e, sets) < LEAST_INCLUSION]
    if sets and doubtful:
        found.append(
            f"the sets of causes without {', '.join(doubtful)} are together more probable than those with: the names are "
            "provisional"
        )
    unnamed = sum(s.weight for s in sets if s.effects == (NAME,))
    if named and len(named) == len(effects) and unnamed > UNNAMED:
        found.append(
            f"learned increments explain the records without {listed}, with a posterior weight of {100.0 * unnamed:.0f} %: the "
            "names are provisional"
        )
    of_vane = [
        e.key
        for e in named
        if e.key in EFFECTS and set(EFFECTS[e.key].channels) <= VANES and EFFECTS[e.key].channels
    ]
    late = [e.key for e in named if is_late_vane(e.key) and 0.0 < _value(e) <= friction_lag_s]
    if of_vane and friction_p_value <= DOUBT:
        found.append(
            f"the vane moves less than gyro and accelerometer show where the motion turns (p = {friction_p_value:.2g} beside "
            f"{', '.join(of_vane)}), and in gusts a friction of the vane looks like a lag: the name is provisional until the "
            "vane has been moved by hand on the ground with the log running"
        )
    elif late:
        found.append(
            f"in the gusts of these records, a friction of the vane of {PLAUSIBLE_RAD / DEG:.1g} deg looks like a lag of "
            f"{1e3 * friction_lag_s:.0f} ms, and {', '.join(late)} is not larger: the name is provisional until a flight in "
            "calm air shows it again, or until the vane has been moved by hand on the ground with the log running"
        )
    return tuple(found)


def _beside_derivatives(named: Sequence[AcceptedEffect]) -> Iterator[str]:
    others = [e.key for e in named if e.name != DERIVATIVES]
    if 0 < len(others) < len(named):
        yield (
            f"no cause is named for the changed derivatives, and it may also have caused what {', '.join(others)} "
            f"explain{'' if len(others) > 1 else 's'}: the names are provisional until a flight of their own confirms them"
        )


def _weak(named: Sequence[AcceptedEffect], has_effects: bool, declared_p_value: float) -> Iterator[str]:
    if has_effects and declared_p_value > (DECLARED_LEVEL if named else UNSHOWN):
        meant = "the names are" if named else "what is learned is"
        yield (
            f"the evidence against the declared model is weak (p = {declared_p_value:.2g}): {meant} provisional until "
            "another flight shows it again"
        )
    level = WEAK if len(named) < 2 else WEAK_OF_SEVERAL
    weak = [e.key for e in named if e.p_value > level]
    if weak:
        yield (
            f"the evidence for {', '.join(weak)} alone is weak among all candidates (p above {level:g}), and a cause that the "
            "library lacks can look the same: the names are provisional until another flight shows them again"
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


__all__ = [
    "DOUBT",
    "LEAST_INCLUSION",
    "MANY",
    "UNNAMED",
    "UNSHOWN",
    "UNUSUAL",
    "WEAK",
    "WEAK_OF_SEVERAL",
    "causes",
    "reservations",
]
