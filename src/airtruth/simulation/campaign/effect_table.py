"""The [[effect]] table of a campaign file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

from pydantic import ConfigDict, Field, field_serializer, model_validator

from airtruth.errors import ConfigurationError
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.terms import Change
from airtruth.quantity import Strict

_INFINITE: Final = ("inf", "-inf")
"""Infinite values as `EffectTable` writes them to JSON."""


class EffectTable(Strict):
    """An effect that is flown: name, variant and the values of its parameters, in the effect's own units."""

    model_config = ConfigDict(
        allow_inf_nan=True, ser_json_inf_nan="strings"
    )  # a neutral bandwidth is infinite
    name: str
    variant: str = ""
    parameters: dict[str, float] = Field(default_factory=dict)

    @model_validator(mode="before")
    @classmethod
    def _gather(cls, raw: Any) -> Any:
        if not isinstance(raw, Mapping) or not isinstance(raw.get("name"), str):
            return raw
        from airtruth.effects import registry as library

        stated = dict(raw)
        if "parameters" in raw:
            gathered = stated.pop("parameters")
            if not isinstance(gathered, Mapping):
                return raw
            # campaign.json has infinity as text
            stated |= {k: float(v) if v in _INFINITE else v for k, v in gathered.items()}
        try:
            effect, values = library.stated(stated)
        except ConfigurationError as error:
            raise ValueError(str(error)) from None
        return {"name": effect.name, "variant": effect.variant, "parameters": values}

    @field_serializer("parameters", when_used="json")
    def _finite(self, values: dict[str, float]) -> dict[str, float | str]:
        """JSON has no infinity."""
        return {name: value if math.isfinite(value) else str(value) for name, value in values.items()}

    @property
    def lateral(self) -> bool:
        """Whether it concerns no motion in the pitch plane."""
        from airtruth.effects import registry as library

        return not library.chosen(self.name, self.variant).applies_to(LONGITUDINAL)

    def change(self) -> Change:
        """Return the terms that it changes."""
        from airtruth.effects import registry as library

        return library.chosen(self.name, self.variant).change(self.parameters)


__all__ = ["EffectTable"]
