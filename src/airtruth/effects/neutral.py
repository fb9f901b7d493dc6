"""Which terms of a change do something, and what a change does to sensors."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Final

from airtruth.aircraft import Sensor
from airtruth.effects.change import Change, DeclaredTerm, SensorTerm, SurfaceTerm
from airtruth.errors import ConfigurationError

_FACTORS: Final = ("mass", "inertia", "elevator")


def effective(change: Change) -> Change:
    """The change without the terms that are neutral, and without states that nothing reads."""
    aero = tuple(term for term in change.aero if term.amplitude != 0.0)
    signals = {term.signal for term in aero}
    return replace(
        change,
        surface=tuple(term for term in change.surface if not _neutral_surface(term)),
        states=tuple(state for state in change.states if state.name in signals),
        aero=aero,
        declared=tuple(term for term in change.declared if not _neutral_declared(term)),
        sensors=tuple(
            term for term in change.sensors if term.value != (1.0 if term.kind == "scale" else 0.0)
        ),
        air=tuple(term for term in change.air if term.factor != 1.0),
    )


def _neutral_surface(term: SurfaceTerm) -> bool:
    return math.isinf(term.value) if term.kind == "rate_limit" else term.value == 0.0


def _neutral_declared(term: DeclaredTerm) -> bool:
    return term.value == (1.0 if term.quantity in _FACTORS else 0.0)


def fitted(sensors: Mapping[str, Sensor], terms: Iterable[SensorTerm]) -> dict[str, Sensor]:
    """Sensors with the terms on top of what is declared.

    Biases, delays, arms and lags add (two lags in series as one of their sum, to first order), scales
    multiply. A channel without a sensor gets one that does nothing else.

    Raises
    ------
    ConfigurationError
        If a lag or delay becomes negative.
    """
    result = dict(sensors)
    for term in terms:
        sensor = result.get(term.channel, Sensor())
        field = "x" if term.kind == "arm" else term.kind
        declared = getattr(sensor, field)
        value = declared.value * term.value if term.kind == "scale" else declared.value + term.value
        if term.kind in ("lag", "delay") and value < 0.0:
            raise ConfigurationError(
                f"{term.channel}: a {term.kind} of {value:g} s in all is not possible; "
                f"{declared.value:g} s is declared, so the effect may take off no more than that"
            )
        changed = declared.model_copy(update={"value": value})
        result[term.channel] = sensor.model_copy(update={field: changed})
    return result
