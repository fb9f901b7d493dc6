"""Effects between the measured elevator surface and the surface that causes the forces."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

from airtruth.effects.effect import Effect, Parameter
from airtruth.physics.terms import Change, SurfaceTerm
from airtruth.units import DEG

Values = Mapping[str, float]


def _delay(values: Values) -> Change:
    return Change(surface=(SurfaceTerm("delay", values["delay_s"]),))


def _lag(values: Values) -> Change:
    bandwidth = values["bandwidth_hz"]
    time_s = 0.0 if math.isinf(bandwidth) else 1.0 / (2.0 * math.pi * bandwidth)
    return Change(surface=(SurfaceTerm("lag", time_s),))


def _rate_limit(values: Values) -> Change:
    return Change(surface=(SurfaceTerm("rate_limit", values["rate_rad_s"]),))


def _backlash(values: Values) -> Change:
    return Change(surface=(SurfaceTerm("backlash", values["width_rad"]),))


EFFECTS: Final = (
    Effect(
        name="elevator_delay",
        where="surface",
        parameters=(
            Parameter(
                "delay_s",
                "s",
                "time from the measured deflection to the forces that it causes",
                low=0.0,
                high=0.2,
                material=0.002,
                one_sided=True,
                step=1e-3,
            ),
        ),
        describe=_delay,
        explanation="The forces follow the measured surface with a delay: a wrong time stamp, a data bus, or a position "
        "transducer ahead of the linkage.",
        source="y(t) = x(t - delay). Material: 2 ms, a tenth of a sample at 50 Hz and 2 deg of phase at 3 Hz.",
        distinguished_by="A measured surface and a multisine up to 5 Hz distinguish it from a lag. If the surface is not "
        "measured, an equal delay of every sensor looks the same.",
    ),
    Effect(
        name="actuator_lag",
        where="surface",
        parameters=(
            Parameter(
                "bandwidth_hz",
                "hz",
                "-3 dB frequency from the measured deflection to the deflection that causes the forces",
                low=0.5,
                high=200.0,
                material=0.002,
                neutral=math.inf,
                reciprocal=True,
                time_constant=True,
                one_sided=True,
                step=1e-3,
            ),
        ),
        describe=_lag,
        explanation="The surface follows its measurement with a first-order lag: a soft linkage, or a position measured "
        "at the servo instead of the surface.",
        source="tau y' = x - y, tau = 1/(2 pi bandwidth). Material: tau of 2 ms, a bandwidth of 80 Hz.",
        distinguished_by="High frequencies in the elevator (multisine, doublets of short steps) distinguish it from a "
        "delay.",
    ),
    Effect(
        name="rate_limit",
        where="surface",
        parameters=(
            Parameter(
                "rate_rad_s",
                "rad_s",
                "largest rate of the surface that causes the forces",
                low=0.1,
                high=20.0,
                material=0.5,
                neutral=math.inf,
                reciprocal=True,
                one_sided=True,
                step=0.3,
            ),
        ),
        describe=_rate_limit,
        explanation="The surface moves no faster than a limit that its measurement does not show.",
        source="|y'| <= rate. Material: a limit below 2 rad/s (115 deg/s), which a doublet of 2 deg through a servo of "
        "5 Hz reaches.",
        distinguished_by="Two amplitudes: only the larger one reaches the limit.",
    ),
    Effect(
        name="backlash",
        where="surface",
        parameters=(
            Parameter(
                "width_rad",
                "rad",
                "full width of the play",
                low=0.0,
                high=4.0 * DEG,
                material=0.03 * DEG,
                one_sided=True,
                step=0.1 * DEG,
            ),
        ),
        describe=_backlash,
        explanation="Play in the linkage: the surface rests until the measured position has crossed the play.",
        source="y stays within width/2 of x and moves only when pushed; it starts in the middle. Material: 3 % of a "
        "doublet of 1 deg.",
        distinguished_by="A small multisine: play removes a larger share of a smaller motion.",
    ),
)
"""Effects of this module."""
