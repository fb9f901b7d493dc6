"""Effects between the measured elevator surface and the surface that the air sees."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

from airtruth.effects.change import Change, SurfaceTerm
from airtruth.effects.effect import Effect, Parameter
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
                "time from the measured surface to the forces it causes",
                low=0.0,
                high=0.2,
                material=0.002,
                one_sided=True,
                prior_std=0.05,
                step=1e-3,
            ),
        ),
        describe=_delay,
        explanation="The air sees the surface later than it is measured: a time stamp, a bus, or a position "
        "transducer ahead of the linkage.",
        source="y(t) = x(t - delay). Material: 2 ms, a tenth of a sample at 50 Hz and 2 deg of phase at 3 Hz.",
        splits="A measured surface and a multisine up to 5 Hz tell it from a lag; a delay of every sensor looks the "
        "same if the surface is not measured.",
    ),
    Effect(
        name="actuator_lag",
        where="surface",
        parameters=(
            Parameter(
                "bandwidth_hz",
                "hz",
                "-3 dB frequency from the measured surface to the one that the air sees",
                low=0.5,
                high=200.0,
                material=0.002,
                neutral=math.inf,
                reciprocal=True,
                time_constant=True,
                one_sided=True,
                prior_std=0.05,
                step=1e-3,
            ),
        ),
        describe=_lag,
        explanation="The surface follows what is measured of it with a first-order lag: a soft linkage, or a "
        "position measured at the servo and not at the surface.",
        source="tau y' = x - y, tau = 1/(2 pi bandwidth). Material: tau of 2 ms, a bandwidth of 80 Hz.",
        splits="High-frequency content in the elevator (multisine, doublets of short steps) tells it from a delay.",
    ),
    Effect(
        name="rate_limit",
        where="surface",
        parameters=(
            Parameter(
                "rate_rad_s",
                "rad_s",
                "largest rate of the surface that the air sees",
                low=0.1,
                high=20.0,
                material=0.5,
                neutral=math.inf,
                reciprocal=True,
                one_sided=True,
                prior_std=3.0,
                step=0.3,
            ),
        ),
        describe=_rate_limit,
        explanation="The surface moves no faster than a rate that its measurement does not show.",
        source="|y'| <= rate. Material: a limit below 2 rad/s (115 deg/s), which a doublet of 2 deg through a servo of "
        "5 Hz reaches.",
        splits="Two amplitudes: a limit is seen in the larger one alone.",
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
                prior_std=1.0 * DEG,
                step=0.1 * DEG,
            ),
        ),
        describe=_backlash,
        explanation="Play in the linkage: the surface stays where it is until the measured position has crossed the play.",
        source="y stays within width/2 of x and moves only when pushed, starting in the middle. Material: 3 % of a "
        "doublet of 1 deg.",
        splits="A small multisine: the share that is lost falls with amplitude.",
    ),
)
"""Effects of this family."""
