"""Effects in the air: gusts of another level than declared; a module of its own, as the aircraft has no part in them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from airtruth.effects.effect import Effect, Parameter
from airtruth.physics.terms import AirTerm, Change

Values = Mapping[str, float]


def _horizontal(values: Values) -> Change:
    return Change(air=(AirTerm("sigma_u", values["factor"]),))


def _level(values: Values) -> Change:
    return Change(air=(AirTerm("sigma_u", values["factor"]), AirTerm("sigma_w", values["factor"])))


def _side(values: Values) -> Change:
    return Change(air=(AirTerm("sigma_v", values["factor"]),))


def _factor(meaning: str, material: float) -> Parameter:
    return Parameter("factor", "-", meaning, low=0.0, high=5.0, material=material, neutral=1.0, step=0.05)


EFFECTS: Final = (
    Effect(
        name="horizontal_gust",
        where="air",
        parameters=(_factor("on the standard deviation of the gust along the flight path", 0.5),),
        describe=_horizontal,
        explanation="Horizontal gusts are stronger or weaker than declared.",
        source="Dryden spectra, `airtruth.physics.dryden`: sigma_u times factor.",
        distinguished_by="Airspeed and ax.",
    ),
    Effect(
        name="gust_level",
        where="air",
        parameters=(_factor("on the standard deviations of both gust components", 0.3),),
        describe=_level,
        explanation="The air is rougher or smoother than declared.",
        source="Dryden spectra, `airtruth.physics.dryden`: sigma_u and sigma_w times factor.",
        distinguished_by="Longer records: it changes the scatter of the residuals and not their mean.",
    ),
    Effect(
        name="gust_level",
        variant="v",
        where="air",
        parameters=(_factor("on the standard deviation of the side gust", 0.3),),
        describe=_side,
        explanation="The side gusts are stronger or weaker than declared.",
        source="Dryden spectra, `airtruth.physics.lateral_gusts`: sigma_v times factor.",
        distinguished_by="Longer records: it changes the scatter of the residuals and not their mean.",
    ),
)
"""Effects of this module."""
