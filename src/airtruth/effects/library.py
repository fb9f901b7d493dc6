"""The library of effects: a plain dict, with those that other packages bring.

A package adds effects by an entry point in the group `GROUP` whose object is an `Effect` or an iterable of
them; in its pyproject.toml:

    [project.entry-points."airtruth.effects"]
    icing = "my_package.icing:EFFECTS"

`tests/effects/test_conformance.py` then tests them like our own.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Final

from airtruth.effects import aerodynamics, air, declared, sensors, surface
from airtruth.effects.effect import Effect
from airtruth.errors import ConfigurationError, choices
from airtruth.signals import SIGNALS

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


def chosen(name: str, variant: str = "", keys: Iterable[str] = ()) -> Effect:
    """One effect by name and variant.

    The variant may be left out where there is only one, or where one alone has a parameter for each of ``keys``.

    Parameters
    ----------
    name, variant : of the effect.
    keys : parameters that are stated of it, in any of their spellings.

    Raises
    ------
    ConfigurationError
        If there is none, or several and neither a variant nor the keys tell which.
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
    if variant:
        raise ConfigurationError(f"effect {name!r}: variant {variant!r}: {choices(variant, variants)}")
    given = set(keys)
    fitting = [e for e in found if given <= {key for p in e.parameters for key in p.spellings()}]
    if len(fitting) != 1:
        raise ConfigurationError(
            f"effect {name!r}: state its variant; allowed: {', '.join(sorted(variants))}"
        )
    return fitting[0]


def stated(table: Mapping[str, Any]) -> tuple[Effect, dict[str, float]]:
    """The effect that a table of a file states, and the values of its parameters in their own units.

    Parameters
    ----------
    table : ``name``, ``variant`` where it is needed (or ``channel``, where the variants are channels of a log),
        and the parameters as `Effect.read` takes them.

    Raises
    ------
    ConfigurationError
        If the effect, its variant or a parameter cannot be used as written.
    """
    name, raw = str(table["name"]), {key: value for key, value in table.items() if key != "name"}
    variant = str(raw.pop("variant", ""))
    if "channel" in raw and all(effect.variant in SIGNALS for effect in named(name)):
        channel = str(raw.pop("channel"))
        if variant not in ("", channel):
            raise ConfigurationError(
                f"effect {name!r}: variant {variant!r} and channel {channel!r} name two variants; state one"
            )
        variant = channel
    effect = chosen(name, variant, raw)
    return effect, effect.read(raw)
