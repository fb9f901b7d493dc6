"""Effects between the measured surface of a control and the surface that causes the forces, for each control."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Final

from airtruth.effects.effect import Effect, Parameter
from airtruth.physics.motion import LONGITUDINAL, MOTIONS, Motion
from airtruth.physics.motion_parts import Control
from airtruth.physics.terms import Change, SurfaceTerm
from airtruth.units import DEG

Values = Mapping[str, float]


def _variant(motion: Motion, control: Control) -> str:
    """The channel of a control, by which its effects differ from those of the elevator."""
    return "" if motion is LONGITUDINAL else control.channel


def _delay(motion: Motion, control: Control) -> Effect:
    def describe(values: Values) -> Change:
        return Change(surface=(SurfaceTerm("delay", values["delay_s"], control.name),))

    return Effect(
        name=f"{control.name}_delay",
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
        describe=describe,
        explanation="The forces follow the measured surface with a delay: a wrong time stamp, a data bus, or a position "
        "transducer ahead of the linkage.",
        source="y(t) = x(t - delay). Material: 2 ms, a tenth of a sample at 50 Hz and 2 deg of phase at 3 Hz.",
        distinguished_by="A measured surface and a multisine up to 5 Hz distinguish it from a lag. If the surface is not "
        "measured, an equal delay of every sensor looks the same.",
    )


def _lag(motion: Motion, control: Control) -> Effect:
    def describe(values: Values) -> Change:
        bandwidth = values["bandwidth_hz"]
        time_s = 0.0 if math.isinf(bandwidth) else 1.0 / (2.0 * math.pi * bandwidth)
        return Change(surface=(SurfaceTerm("lag", time_s, control.name),))

    return Effect(
        name="actuator_lag",
        variant=_variant(motion, control),
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
        describe=describe,
        explanation="The surface follows its measurement with a first-order lag: a soft linkage, or a position measured "
        "at the servo instead of the surface.",
        source="tau y' = x - y, tau = 1/(2 pi bandwidth). Material: tau of 2 ms, a bandwidth of 80 Hz.",
        distinguished_by=f"High frequencies in the {control.name} (multisine, doublets of short steps) distinguish it from a "
        "delay.",
    )


def _rate_limit(motion: Motion, control: Control) -> Effect:
    def describe(values: Values) -> Change:
        return Change(surface=(SurfaceTerm("rate_limit", values["rate_rad_s"], control.name),))

    return Effect(
        name="rate_limit",
        variant=_variant(motion, control),
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
        describe=describe,
        explanation="The surface moves no faster than a limit that its measurement does not show.",
        source="|y'| <= rate. Material: a limit below 2 rad/s (115 deg/s), which a doublet of 2 deg through a servo of "
        "5 Hz reaches.",
        distinguished_by="Two amplitudes: only the larger one reaches the limit.",
    )


def _backlash(motion: Motion, control: Control) -> Effect:
    def describe(values: Values) -> Change:
        return Change(surface=(SurfaceTerm("backlash", values["width_rad"], control.name),))

    return Effect(
        name="backlash",
        variant=_variant(motion, control),
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
        describe=describe,
        explanation="Play in the linkage: the surface rests until the measured position has crossed the play.",
        source="y stays within width/2 of x and moves only when pushed; it starts in the middle. Material: 3 % of a "
        "doublet of 1 deg.",
        distinguished_by="A small multisine: play removes a larger share of a smaller motion.",
    )


def surface_effects() -> Iterator[Effect]:
    """Each element between measured and effective surface, for the controls of every motion."""
    every = [(motion, control) for motion in MOTIONS.values() for control in motion.controls]
    for make in (_delay, _lag, _rate_limit, _backlash):
        yield from (make(*of) for of in every)


EFFECTS: Final = tuple(surface_effects())
"""Effects of this module."""
