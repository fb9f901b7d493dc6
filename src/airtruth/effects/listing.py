"""The library of effects as text and as JSON."""

from __future__ import annotations

import json
import math
import textwrap
from collections.abc import Iterable
from dataclasses import asdict
from typing import Any, Final

from airtruth.effects.effect import Effect, Parameter
from airtruth.units import printed

_WIDTH: Final = 100
"""Width of a line of text [characters]."""


def as_text(effects: Iterable[Effect]) -> str:
    """One paragraph per effect: parameters, explanation, source, and the means to distinguish it from similar ones."""
    return "\n\n".join(_paragraph(effect) for effect in effects)


def as_json(effects: Iterable[Effect]) -> str:
    """A list of effects with all their entries; an infinite number is null."""
    return json.dumps([_entry(effect) for effect in effects], indent=1)


def as_markdown(effects: Iterable[Effect]) -> str:
    """A table with one row per parameter: meaning, range, and the smallest material value."""
    rows = ["| effect | motion | parameter | meaning | range | material from |", "|---|---|---|---|---|---|"]
    for effect in effects:
        for number, p in enumerate(effect.parameters):
            cells = (
                "" if number else f"`{effect.key}`",
                "" if number else ", ".join(effect.motions),
                f"`{p.name}`",
                p.meaning,
                f"{p.low:g} to {p.high:g}{_unit(p)}",
                "" if p.is_location else _material(p),
            )
            rows.append(f"| {' | '.join(cells)} |")
    return "\n".join(rows)


def _paragraph(effect: Effect) -> str:
    lines = [f"{effect.key}  ({', '.join((effect.where, *effect.motions))})"]
    lines += [f"  {_parameter(p)}" for p in effect.parameters]
    paragraphs = (
        ("", effect.explanation),
        ("source: ", effect.source),
        ("distinguished by: ", effect.distinguished_by),
    )
    for label, text in paragraphs:
        if text:
            lines += textwrap.wrap(label + text, _WIDTH, initial_indent="  ", subsequent_indent="  ")
    return "\n".join(lines)


def _parameter(p: Parameter) -> str:
    unit = _unit(p)
    parts = [f"{p.low:g} to {p.high:g}{unit}"]
    if not p.is_location:
        parts += [f"neutral {p.neutral:g}", f"material from {_material(p)}"]
    if p.sign:
        parts.append(f"{'above' if p.sign > 0 else 'below'} zero on every real aircraft")
    if math.isfinite(p.spans):
        parts.append(f"at most {p.spans:g} wing spans on a real aircraft")
    if p.default is not None:
        parts.append(f"{p.default:g} if omitted")
    return f"{p.name}: {p.meaning}; {', '.join(parts)}"


def _unit(p: Parameter) -> str:
    """A space and the printed unit, or nothing."""
    unit = printed(p.unit)
    return f" {unit}" if unit else ""


def _material(p: Parameter) -> str:
    """The smallest material value in the parameter's unit: below a limit, or away from neutral."""
    unit = _unit(p)
    if p.reciprocal:
        return f"{p.value(p.material):.3g}{unit} down"
    return f"{'' if p.one_sided else '+-'}{p.material:.3g}{unit}"


def _entry(effect: Effect) -> dict[str, Any]:
    return {
        "key": effect.key,
        "name": effect.name,
        "variant": effect.variant,
        "where": effect.where,
        "in_derivatives": effect.in_derivatives,
        "parameters": [
            {k: None if isinstance(v, float) and math.isinf(v) else v for k, v in asdict(p).items()}
            for p in effect.parameters
        ],
        "channels": list(effect.channels),
        "explanation": effect.explanation,
        "source": effect.source,
        "distinguished_by": effect.distinguished_by,
    }
