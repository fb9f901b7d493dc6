"""The [jsbsim] table of aircraft.toml: where the model lies, and which of its properties mean what."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from airtruth.physics.motion import Motion
from airtruth.quantity import Strict


class SurfaceProperties(Strict):
    """JSBSim properties of a control surface.

    command: property that a command is added to; command_per_rad: its units per radian of command;
    surface: property of the surface; surface_rad: radians per unit of it (negative if the model
    counts the other way: an elevator is positive with the trailing edge down, ailerons, (right - left)/2, as well, a rudder
    with the trailing edge left); command_frames: frames between reading a command and acting on it,
    see aircraft/gtm/gtm.xml; feedback: augmentation of the model moves the surface at a held command.
    """

    command: str
    command_per_rad: float = 1.0
    surface: str
    surface_rad: float = 1.0
    command_frames: int = Field(default=0, ge=0, le=1)
    feedback: bool = False


class ElevatorProperties(SurfaceProperties):
    """JSBSim properties of the elevator."""

    surface: str = "fcs/elevator-pos-rad"


class ThrottleProperties(Strict):
    """JSBSim properties that hold the lever (0 to 1), all set together; trim: those that hold its trim.

    Without a command the aircraft glides: a trim solves for the flight-path angle instead of the lever.
    """

    command: tuple[str, ...] = ("fcs/throttle-cmd-norm",)
    trim: tuple[str, ...] = ()


class LateralProperties(Strict):
    """JSBSim properties of aileron and rudder, -1 to 1, that hold an asymmetric aircraft straight in longitudinal flights."""

    aileron: str = "fcs/aileron-cmd-norm"
    rudder: str = "fcs/rudder-cmd-norm"


class AugmentationProperties(Strict):
    """JSBSim properties of a pitch damper and attitude hold, and of the sensor errors in its inputs."""

    damper_gain: str
    attitude_gain: str
    theta_reference: str
    q_error: str
    theta_error: str


class JsbsimModel(Strict):
    """Where the JSBSim model lies and which of its properties mean what.

    root: "." for a model in the folder of aircraft.toml, "wheel" for one that jsbsim ships.
    set: properties written once before each run (gear up, flaps, mixture ...).
    declare: properties of a simulator around the model, created with these values before the model is loaded.
    lateral: aileron and rudder; with them a trim holds roll, yaw and side force at zero, with a small bank.
    aileron, rudder: control surfaces of flights in six axes; six_axes: property that is 1 in them and 0 in the pitch plane.
    rotary_gust, roll_gust, yaw_gust: rotation of the air about y, x and z [rad/s].
    engine_start_s: longest time for which the engines are started and run at a held state before a flight [s]; 0 for
    JSBSim's own steady state, which stalls many propellers.
    """

    model: str
    root: Literal[".", "wheel"] = "."
    elevator: ElevatorProperties
    throttle: ThrottleProperties = ThrottleProperties()
    augmentation: AugmentationProperties | None = None
    rotary_gust: str | None = None
    roll_gust: str | None = None
    yaw_gust: str | None = None
    aileron: SurfaceProperties | None = None
    rudder: SurfaceProperties | None = None
    six_axes: str | None = None
    set: dict[str, float] = Field(default_factory=dict)
    declare: dict[str, float] = Field(default_factory=dict)
    lateral: LateralProperties | None = None
    engine_start_s: float = Field(default=0.0, ge=0.0, le=300.0)

    def surfaces(self, motion: Motion) -> dict[str, SurfaceProperties]:
        """Control -> properties of its surface, of the controls of a motion that the model has."""
        every = {control.name: getattr(self, control.name) for control in motion.controls}
        return {name: surface for name, surface in every.items() if surface is not None}


__all__ = [
    "AugmentationProperties",
    "ElevatorProperties",
    "JsbsimModel",
    "LateralProperties",
    "SurfaceProperties",
    "ThrottleProperties",
]
