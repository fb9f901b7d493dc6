"""The hypotheses that a flight has to separate: from the names of effects, or from the answer of a trace."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.design.separation import Member, clipped
from airtruth.effects.effect import Effect, Parameter
from airtruth.effects.increment import NAME as INCREMENT
from airtruth.effects.registry import EFFECTS, named
from airtruth.errors import ConfigurationError
from airtruth.physics.motion import MOTIONS, Motion
from airtruth.physics.resolution import LinearPoint
from airtruth.tracing.answer import AcceptedEffect, TraceAnswer
from airtruth.tracing.inference.causes import DERIVATIVES

Array = NDArray[np.float64]

MOST: Final = 4
"""Hypotheses that one flight is planned to separate [-] (judgement: the time grows with the square of their number)."""
_TYPICAL: Final = 4.0
"""Size of an effect of which none is stated, over its material size [-] (judgement: an effect that a first flight
shows)."""
_SPREAD: Final = 0.3
"""Relative standard deviation of a size that is stated without one [-] (judgement)."""


@dataclass(frozen=True)
class Hypothesised:
    """An effect that may be the truth.

    Attributes
    ----------
    effect : the effect.
    sizes : (parameters,) in size coordinates; None where it imitates the first of the hypotheses.
    std : (parameters,) their standard deviations, likewise.
    """

    effect: Effect
    sizes: Array | None = None
    std: Array | None = None

    def member(self, sizes: Array) -> Member:
        """The hypothesis at some sizes."""
        return Member(self.effect, clipped(self.effect, sizes))


def from_names(keys: Sequence[str], stated: Mapping[str, float]) -> tuple[Hypothesised, ...]:
    """Hypotheses from keys of effects.

    Parameters
    ----------
    keys : two or more keys; a name without a variant is each of its variants.
    stated : KEY.PARAMETER -> value [its unit]; the first effect has a typical size where it is not stated, and the
        others imitate the first.

    Raises
    ------
    ConfigurationError
        If an effect or a parameter does not exist, a value is outside its range, or there are too few or too many.
    """
    every = [e for key in keys for e in ([EFFECTS[key]] if key in EFFECTS else named(key))]
    _require(every)
    values: dict[str, dict[str, float]] = {e.key: {} for e in every}
    for name, value in stated.items():
        key, _, parameter = name.rpartition(".")
        matching = [e for e in every if key in (e.key, e.name)]
        if not matching:
            raise ConfigurationError(
                f"plan: size {name!r}: write EFFECT.PARAMETER=VALUE with an effect of --split: "
                f"{', '.join(values)}"
            )
        for e in matching:
            values[e.key][parameter] = value
    found = []
    for k, e in enumerate(every):
        if not values[e.key] and k > 0:
            found.append(Hypothesised(e))
            continue
        typical = {
            p.name: p.value(_typical_size(p))
            for p in e.parameters
            if not values[e.key].keys() & p.spellings().keys()
        }
        filled = e.read(typical | values[e.key])
        sizes = np.array([p.size(filled[p.name]) for p in e.parameters])
        found.append(Hypothesised(e, sizes, _spread(e, sizes)))
    return tuple(found)


def tied_in(answer: TraceAnswer) -> tuple[Hypothesised, ...]:
    """The first effect of an answer with those that explain its records as well; or the two by which its leading sets
    differ. Empty where there are none that an input separates."""
    for accepted in answer.effects:
        names = {accepted.name, *accepted.indistinguishable_from} - {INCREMENT}
        if accepted.key not in EFFECTS or not is_separable(EFFECTS[accepted.key]):
            continue
        if len(names) == 1 and not accepted.other_variants:
            continue
        tied = [c.key for c in answer.candidates if c.testable and not c.why_not and c.name in names]
        others = [key for key in tied if key != accepted.key and key in EFFECTS]
        missing = names - {accepted.name} - {EFFECTS[key].name for key in others}
        others += [e.key for name in sorted(missing) for e in named(name)[:1]]
        others = [key for key in others if is_separable(EFFECTS[key])]
        if not others:
            continue
        every = (estimated(accepted), *(Hypothesised(EFFECTS[key]) for key in others[: MOST - 1]))
        _require([h.effect for h in every])
        return every
    sets = [a.effects for a in answer.alternatives[:2]]
    if len(sets) == 2 and len(set(sets[0]) ^ set(sets[1])) == 2:
        names = {name for i in range(2) for name in set(sets[i]) - set(sets[1 - i])}
        keys = [key for name in sets[0] + sets[1] if name in names for key in _one_of(answer, name)]
        if len(keys) == 2 and all(is_separable(EFFECTS[key]) for key in keys):
            return from_names(keys, {})
    return ()


def _one_of(answer: TraceAnswer, name: str) -> list[str]:
    """The key of a name or key: that of the answer's effects, or the first that exists."""
    accepted = [e.key for e in answer.effects if name in (e.name, e.key) and e.key in EFFECTS]
    return (accepted or [key for key, e in EFFECTS.items() if name in (key, e.name)])[:1]


def is_separable(effect: Effect) -> bool:
    """Whether an input can separate an effect from others: no effect of the air, and not `derivatives`."""
    return effect.where != "air" and effect.name != DERIVATIVES


def _require(effects: Sequence[Effect]) -> None:
    keys = [e.key for e in effects]
    if len(set(keys)) < 2:
        raise ConfigurationError(
            f"plan: {len(set(keys))} effect(s) to separate ({', '.join(keys) or 'none'}); state two with --split A,B"
        )
    if len(keys) > MOST:
        raise ConfigurationError(
            f"plan: {len(keys)} effects ({', '.join(keys)}); state at most {MOST}, a variant as NAME:VARIANT"
        )
    motion_of(effects)
    air = [e.key for e in effects if e.where == "air"]
    if air:
        raise ConfigurationError(
            f"plan: no input shows {', '.join(air)}, which act on the gusts alone; state other effects"
        )
    if any(e.name == DERIVATIVES for e in effects):
        raise ConfigurationError(
            "plan: `derivatives` cannot be separated, because every hypothesis refits them; state another effect"
        )


def motion_of(effects: Sequence[Effect]) -> Motion:
    """The first motion on which all effects act.

    Raises
    ------
    ConfigurationError
        If none has all of them.
    """
    found = next((m for m in MOTIONS.values() if all(m.name in e.motions for e in effects)), None)
    if found is None:
        acting = "; ".join(f"{e.key} on the {' and '.join(e.motions)} motion" for e in effects)
        raise ConfigurationError(
            f"plan: no flight of one motion shows all effects ({acting}); state effects of one motion"
        )
    return found


def estimated(accepted: AcceptedEffect) -> Hypothesised:
    """An accepted effect of the library with its estimates."""
    effect, parameters = EFFECTS[accepted.key], accepted.parameters
    sizes, std = np.zeros(len(effect.parameters)), np.zeros(len(effect.parameters))
    for i, p in enumerate(effect.parameters):
        estimate = parameters[p.name]
        sizes[i] = p.size(estimate.value)
        ends = [p.size(end) for end in estimate.ci95 if end is not None]
        std[i] = (max(ends) - min(ends)) / 4.0 if len(ends) == 2 else _SPREAD * abs(sizes[i])
    return Hypothesised(effect, clipped(effect, sizes), std)


def typical_sizes(effect: Effect) -> Array:
    """(parameters,) sizes of an effect that a first flight shows, in size coordinates."""
    return np.array([_typical_size(p) for p in effect.parameters])


def _typical_size(p: Parameter) -> float:
    low, high = p.reach
    if p.is_location:
        return math.sqrt(low * high) if low > 0.0 else 0.5 * (low + high)
    size = _TYPICAL * p.material * (p.sign or 1)
    return min(max(size, low), high)


def _spread(effect: Effect, sizes: Array) -> Array:
    """Standard deviations of sizes that are stated without one; a location is known as far as a break is."""
    return np.array(
        [0.0 if p.is_location else _SPREAD * abs(s) for p, s in zip(effect.parameters, sizes, strict=True)]
    )


def at_point(hypothesised: Hypothesised, point: LinearPoint) -> Hypothesised:
    """The hypothesis with a cause of changed derivatives resolved into terms about a trim."""
    return replace(hypothesised, effect=hypothesised.effect.at_point(point))


__all__ = [
    "MOST",
    "Hypothesised",
    "at_point",
    "estimated",
    "from_names",
    "is_separable",
    "motion_of",
    "tied_in",
    "typical_sizes",
]
