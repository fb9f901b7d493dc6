"""The effective terms of a change, and sensors with the errors of a change."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace

from airtruth.aircraft import Sensor
from airtruth.aircraft.origin import UNKNOWN, Origin
from airtruth.errors import ConfigurationError
from airtruth.physics.composition import CAUSES
from airtruth.physics.sensor_errors import KINDS
from airtruth.physics.terms import DECLARED, Change, SensorTerm, SurfaceTerm


def effective(change: Change) -> Change:
    """Return the change without neutral terms, and without states that no term reads.

    A bend without a slope remains beside other bends over its signal: it is an end of their table.
    """
    curves = {term.curve for term in change.aero if term.amplitude != 0.0} - {None}
    aero = tuple(term for term in change.aero if term.amplitude != 0.0 or term.curve in curves)
    readings = tuple(term for term in change.readings if term.amplitude != 0.0)
    signals = {term.signal for term in aero} | {
        name for term in readings for name in (term.signal, term.behind)
    }
    return replace(
        change,
        surface=tuple(term for term in change.surface if not _neutral_surface(term)),
        states=tuple(state for state in change.states if state.name in signals),
        aero=aero,
        declared=tuple(term for term in change.declared if term.value != DECLARED[term.quantity]),
        derivatives=tuple(term for term in change.derivatives if term.value != CAUSES[term.cause]),
        sensors=tuple(term for term in change.sensors if term.value != KINDS[term.kind].neutral),
        readings=readings,
        air=tuple(term for term in change.air if term.factor != 1.0),
    )


def _neutral_surface(term: SurfaceTerm) -> bool:
    return math.isinf(term.value) if term.kind == "rate_limit" else term.value == 0.0


def fitted(
    sensors: Mapping[str, Sensor], terms: Iterable[SensorTerm], origin: Origin = UNKNOWN
) -> dict[str, Sensor]:
    """Return the declared sensors with the errors of terms added, see `airtruth.physics.sensor_errors.ErrorKind`.

    A channel without a sensor gets one with these errors alone. The standard deviation of a sum is that of the term, of
    a product that of the term times the declared factor: the declared error counts as known, as in a trace.

    Parameters
    ----------
    sensors : declared sensors by channel.
    terms : errors to add.
    origin : source and standard deviations of the terms.

    Raises
    ------
    ConfigurationError
        If a lag or delay becomes negative.
    """
    result = dict(sensors)
    for term in terms:
        sensor = result.get(term.channel, Sensor())
        kind = KINDS[term.kind]
        declared = getattr(sensor, kind.key)
        value = kind.combined(declared.value, term.value)
        if value < 0.0 and not kind.may_be_negative:
            raise ConfigurationError(
                f"{term.channel}: the total {term.kind} would be {value:g} s and cannot be negative; "
                f"{declared.value:g} s is declared, so the effect can reduce it by {declared.value:g} s at most"
            )
        std = origin.std.get(term)
        if std is not None and kind.is_factor:
            std *= abs(declared.value)
        changed = origin.stated(declared, value, std)
        result[term.channel] = sensor.model_copy(update={kind.key: changed})
    return result
