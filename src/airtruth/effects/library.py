"""The library of effects: a plain dict, with those that other packages bring.

A package adds effects by an entry point in the group `GROUP` whose object is an `Effect` or an iterable of
them; in its pyproject.toml:

    [project.entry-points."airtruth.effects"]
    icing = "my_package.icing:EFFECTS"

`tests/effects/test_conformance.py` then tests them like our own.
"""

from __future__ import annotations

from collections.abc import Iterable
from importlib.metadata import EntryPoint, entry_points
from typing import Final

from airtruth.effects import aerodynamics, air, declared, sensors, surface
from airtruth.effects.effect import Effect
from airtruth.errors import ConfigurationError, choices

GROUP: Final = "airtruth.effects"

OWN: Final = (*surface.EFFECTS, *aerodynamics.EFFECTS, *declared.EFFECTS, *sensors.EFFECTS, *air.EFFECTS)
"""Effects that come with airtruth."""


def merged(own: Iterable[Effect], others: Iterable[EntryPoint]) -> dict[str, Effect]:
    """Effects by key, those of entry points after our own.

    Raises
    ------
    ConfigurationError
        If an entry point gives something else, or a key that is taken.
    """
    result = {effect.key: effect for effect in own}
    for point in others:
        found = point.load()
        for effect in (found,) if isinstance(found, Effect) else found:
            if not isinstance(effect, Effect):
                raise ConfigurationError(
                    f"entry point {point.name} = {point.value} in {GROUP} gives {type(effect).__name__}; "
                    "it has to be an airtruth.effects.effect.Effect or an iterable of them"
                )
            if effect.key in result:
                raise ConfigurationError(
                    f"entry point {point.name} = {point.value} in {GROUP}: an effect {effect.key!r} exists already; "
                    "choose another name or variant"
                )
            result[effect.key] = effect
    return result


EFFECTS: Final[dict[str, Effect]] = merged(OWN, entry_points(group=GROUP))
"""Every effect by its key, NAME or NAME:VARIANT."""


def named(name: str) -> list[Effect]:
    """The variants of an effect.

    Raises
    ------
    ConfigurationError
        If no effect has this name.
    """
    found = [effect for effect in EFFECTS.values() if effect.name == name]
    if not found:
        raise ConfigurationError(
            f"effect {name!r} is not known; {choices(name, {e.name for e in EFFECTS.values()})}"
        )
    return found


def chosen(name: str, variant: str = "") -> Effect:
    """One effect by name and variant; the variant may be left out where there is only one.

    Raises
    ------
    ConfigurationError
        If there is none, or several and no variant is given.
    """
    found = named(name)
    if len(found) == 1 and not variant:
        return found[0]
    for effect in found:
        if effect.variant == variant:
            return effect
    variants = [e.variant for e in found if e.variant]
    if not variants:
        raise ConfigurationError(f"effect {name!r} has no variants; leave variant out")
    if not variant:
        raise ConfigurationError(
            f"effect {name!r}: state its variant; allowed: {', '.join(sorted(variants))}"
        )
    raise ConfigurationError(f"effect {name!r}: variant {variant!r}: {choices(variant, variants)}")
