"""Side force, rolling and yawing moment of a generated JSBSim model, linear about symmetric flight.

In body axes about the CG, with phat = p b/(2V) and rhat = r b/(2V) of the air:

    Y = q_bar S (CYbeta beta + CYp phat + CYr rhat + CYda da + CYdr dr),   L, N = q_bar S b (Cl..., Cn...)

Source: V. Klein and E. A. Morelli, Aircraft System Identification, AIAA, 2006, 3.2.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from airtruth.aircraft.file import AircraftFile
from airtruth.aircraft.jsbsim.linear_parts import axis, product, rate, servo, total
from airtruth.physics.motion import LATERAL
from airtruth.physics.motion_parts import Signal

_AXES: Final = {"CY": "Y", "Cl": "ROLL", "Cn": "YAW"}
"""Coefficient -> axis of JSBSim."""
_SURFACES: Final = {c.name: f"fcs/{c.name}-pos-rad" for c in LATERAL.controls}
"""Control -> property of its surface."""


def lateral_channels(file: AircraftFile) -> str:
    """Properties of the commands and channels of the servos."""
    parts = [
        f"""
    <property value="0">fcs/{control.name}-cmd-rad</property>
    <channel name="{control.name.capitalize()}">
{servo(control.name, getattr(file, control.actuator))}
    </channel>"""
        for control in LATERAL.controls
    ]
    return "".join(parts)


def lateral_axes(values: Mapping[str, float]) -> str:
    """Functions of the rates and the three axes.

    Parameters
    ----------
    values : all derivatives of the motion [1/rad, -].
    """
    gusts = "".join(f'\n    <property value="0">aero/gust/{x}-rad_sec</property>' for x in "pr")
    rates = "".join(f"\n    {rate(f'{x}hat', x, 'bi2vel')}" for x in "pr")
    axes = (
        axis(
            _AXES[c.name],
            c.name,
            total(*(product(values[c.name + s.symbol], _property(s)) for s in LATERAL.signals)),
            c.length,
        )
        for c in LATERAL.coefficients
    )
    return gusts + rates + "".join(axes)


def _property(signal: Signal) -> str:
    if signal.length is not None:
        return f"aero/function/{signal.name}"
    return _SURFACES.get(signal.name, f"aero/{signal.name}-rad")


__all__ = ["lateral_axes", "lateral_channels"]
