"""The library of effects: a plain dict, with the effects of other packages.

A package adds effects by an entry point in the group `GROUP` whose object is an `Effect` or an iterable of
them; in its pyproject.toml:

    [project.entry-points."airtruth.effects"]
    ice_shape = "my_package.ice_shape:EFFECTS"

`tests/effects/test_conformance.py` tests them like the effects of airtruth.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Final

from airtruth.channels import SIGNALS
from airtruth.effects import aerodynamics, air, composite, mass, sensors, surface
from airtruth.effects.effect import Effect
from airtruth.errors import ConfigurationError, choices

GROUP: Final = "airtruth.effects"
"""Group of the entry points by which other packages add effects."""

OWN: Final = (
    *surface.EFFECTS,
    *aerodynamics.EFFECTS,
    *mass.EFFECTS,
    *composite.EFFECTS,
    *sensors.EFFECTS,
    *air.EFFECTS,
)
"""Effects of airtruth itself."""


def merged(own: Iterable[Effect], others: Iterable[EntryPoint]) -> dict[str, Effect]:
    """Return effects by key, those of entry points last.

    Raises
    ------
    ConfigurationError
        If an entry point provides anything but effects, or an effect whose key exists.
    """
    result = {effect.key: effect for effect in own}
    for point in others:
        loaded = point.load()
        for effect in (loaded,) if isinstance(loaded, Effect) else loaded:
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


def listed(name: str) -> list[Effect]:
    """Return the effect of a key, or the variants of a name.

    Raises
    ------
    ConfigurationError
        If no effect has this key or name.
    """
    return [EFFECTS[name]] if name in EFFECTS else named(name)


def named(name: str) -> list[Effect]:
    """Return the variants of an effect.

    Raises
    ------
    ConfigurationError
        If no effect has this name.
    """
    variants = [effect for effect in EFFECTS.values() if effect.name == name]
    if not variants:
        raise ConfigurationError(
            f"effect {name!r} is not known; {choices(name, {e.name for e in EFFECTS.values()})}"
        )
    return variants


def chosen(name: str, variant: str = "", keys: Iterable[str] = ()) -> Effect:
    """Return one effect by name and variant.

    The variant may be omitted if there is only one, if a single variant has a parameter for each of ``keys``, or if one has no
    name: that of the elevator, of the pitch plane or of the left side.

    Parameters
    ----------
    name, variant : of the effect.
    keys : its parameters, in any of their spellings.

    Raises
    ------
    ConfigurationError
        If there is none, or if neither the variant nor the keys select one of several.
    """
    effects = named(name)
    if len(effects) == 1 and not variant:
        return effects[0]
    given = set(keys)
    fitting = [e for e in effects if given <= {key for p in e.parameters for key in p.spellings()}]
    for effect in effects if variant else fitting or effects:
        if variant == effect.variant or (not effect.variant and (variant,) == effect.channels):
            return effect
    variants = [e.variant for e in effects if e.variant]
    if not variants:
        raise ConfigurationError(f"effect {name!r} has no variants; leave variant out")
    if variant:
        raise ConfigurationError(f"effect {name!r}: variant {variant!r}: {choices(variant, variants)}")
    if len(fitting) != 1:
        raise ConfigurationError(
            f"effect {name!r}: state its variant; allowed: {', '.join(sorted(variants))}"
        )
    return fitting[0]


def stated(table: Mapping[str, Any]) -> tuple[Effect, dict[str, float]]:
    """Read an effect from a table of a file, with the values of its parameters in their own units.

    Parameters
    ----------
    table : ``name``; ``variant`` if there are several (or ``channel``, if the variants are channels of a log); and the
        parameters as `Effect.read` takes them.

    Raises
    ------
    ConfigurationError
        If the effect, its variant or a parameter cannot be used as written.
    """
    name, raw = str(table["name"]), {key: value for key, value in table.items() if key != "name"}
    variant = str(raw.pop("variant", ""))
    variants = {effect.variant for effect in named(name)} - {""}
    if "channel" in raw and variants and variants <= SIGNALS.keys():
        channel = str(raw.pop("channel"))
        if variant not in ("", channel):
            raise ConfigurationError(
                f"effect {name!r}: variant {variant!r} and channel {channel!r} name two variants; state one"
            )
        variant = channel
    effect = chosen(name, variant, raw)
    return effect, effect.read(raw)
