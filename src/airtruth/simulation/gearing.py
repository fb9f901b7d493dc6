"""Commands that put a surface of a JSBSim model where a record has it."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft.model import SurfaceProperties
from airtruth.simulation.simulator import Executive
from airtruth.simulation.trim import Trim

Array = NDArray[np.float64]

_BEYOND_RAD: Final = 0.02
"""Range of the gearing beyond the surface of a record [rad] (judgement: a gearing differs by some percent)."""
_GEARING: Final = 24
"""Points of the gearing [-] (judgement: fewer than a degree apart in a record)."""
_SAME_RAD: Final = 1e-9
"""Difference of a surface that counts as rounding [rad] (judgement)."""


def commands_for(executive: Executive, at: Trim, control: str, surface: Array) -> Array:
    """Commands that put a surface where it was measured; the gearing of a model is not the same up and down.

    Parameters
    ----------
    at : trim about which the record starts.
    control : "elevator", "aileron" or "rudder", which the model has.
    surface : wanted (steps,) [rad].
    """
    held = at.controls.command(control)
    offset = held - at.surfaces_rad[control]
    if getattr(executive.model, control).feedback:
        return np.asarray(surface + offset)
    low, high = float(surface.min()) + offset, float(surface.max()) + offset
    commands = np.union1d(np.linspace(low - _BEYOND_RAD, high + _BEYOND_RAD, _GEARING), [held, 0.0])
    reached = []
    for command in commands:
        controls = at.controls.moved({control: float(command)})
        executive.initialise(at.condition, controls, engines_s=0.0)
        reached.append(executive.respond().surfaces_rad[control])
    rising = np.maximum.accumulate(reached)
    kept = np.append(True, np.diff(rising) > _SAME_RAD)
    if kept.sum() < 2:
        return np.asarray(surface + offset)
    found = np.interp(surface, rising[kept], commands[kept])
    linear = np.abs(np.asarray(reached) - commands + offset).max() < _SAME_RAD
    return np.asarray(surface + offset if linear else found)


class FollowedSurface:
    """A surface that follows a record; augmentation of the model that moves it is compensated by the integral of its error.

    Parameters
    ----------
    executive : at the start of the record; surface : properties.
    commands, wanted : (steps,) command that puts the surface where it was measured, and the measured surface [rad].
    """

    def __init__(
        self, executive: Executive, surface: SurfaceProperties, commands: Array, wanted: Array
    ) -> None:
        self._command = executive.node(surface.command).set_double_value
        self._position = executive.node(surface.surface).get_double_value
        self._commands: list[float] = (commands * surface.command_per_rad).tolist()
        self._wanted: list[float] = (wanted / surface.surface_rad).tolist()
        self._gain = surface.surface_rad * surface.command_per_rad if surface.feedback else 0.0
        self._error = 0.0

    def move(self, step: int) -> None:
        """Write the command of a step."""
        if self._gain:
            self._error += self._gain * (self._wanted[step - 1] - self._position())
        self._command(self._commands[step] + self._error)


__all__ = ["FollowedSurface", "commands_for"]
