"""Elevator, surface, units, aileron and rudder of a model, from what moves when a command moves."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final

import numpy as np

from airtruth.aircraft.model import ElevatorProperties, LateralProperties
from airtruth.errors import AircraftError
from airtruth.simulation.survey.bench import Bench, read
from airtruth.simulation.survey.names import ModelNames
from airtruth.units import DEG

STANDARD: Final = "fcs/elevator-cmd-norm"
"""Elevator command of JSBSim's own flight controls."""
_REACH: Final = 0.1
"""Command for which responses are measured, to both sides [units of the command] (judgement: a tenth of the stick)."""
_MOVES: Final = 1e-6
"""Least change of a property by the command that counts as motion [its unit] (judgement: far above rounding)."""
_PITCHES: Final = 1e-4
"""Least change of the pitch acceleration that counts as an effect [rad/s2] (judgement)."""
_FEEDBACK_RAD: Final = 1e-6
"""Motion of the surface at a held command that counts as feedback [rad] (as in `airtruth.simulation.probe`)."""
_HELD_S: Final = (1.0, 3.0)
"""Times for which a state is held to see an integrator move a surface [s] (judgement: servos have settled)."""
_INTEGRATES: Final = 1e-3
"""Motion of a surface between these times that shows an integrator [its unit] (judgement)."""
_STRAIGHT: Final = 1e-6
"""Lateral acceleration that counts as an asymmetry [m/s2], [rad/s2]: the tolerance of a trim."""
_COMMAND: Final = re.compile(r"elev.*cmd|cmd.*elev|pitch.*cmd|stick|stabilator.*cmd", re.IGNORECASE)
"""Other names of elevator commands (judgement)."""
_SURFACE: Final = re.compile(r"elev|stab|htail|canard|pitch", re.IGNORECASE)
"""Names of elevator surfaces (judgement)."""
_UNITS: Final = (("-rad", 1.0), ("-deg", DEG), ("-norm", 0.0))
"""Ends of the names of surfaces in the order of preference, and radians per unit; 0 for unknown."""


@dataclass(frozen=True)
class Found:
    """The elevator of a model.

    Attributes
    ----------
    elevator : its properties.
    notes : what was found out; decisions : what the user has to decide.
    """

    elevator: ElevatorProperties
    notes: tuple[str, ...]
    decisions: tuple[str, ...]


def elevator_of(bench: Bench, names: ModelNames) -> Found:
    """Find the command that pitches the aircraft and the surface that moves with it.

    Raises
    ------
    AircraftError
        If no command pitches the aircraft, or no property of a surface moves with it.
    """
    tried = [STANDARD, *(n for n in names.read if _COMMAND.search(n) and n != STANDARD)]
    command, pitch = "", 0.0
    start = bench.at()
    for name in [n for n in tried if start.fdm.get_property_manager().hasNode(n)]:
        pitch = _pitch(bench, name)
        if abs(pitch) > _PITCHES:
            command = name
            break
    if not command:
        raise AircraftError(
            f"no elevator: none of the commands {', '.join(tried[:6])} changes the pitching moment of the model"
        )
    surface, per_unit, decisions = _surface(bench, names, command)
    low, high = (float(read(bench.at({command: s * _REACH}), [surface])[0]) * per_unit for s in (-1.0, 1.0))
    slope = (high - low) / (2.0 * _REACH)
    sign = -1.0 if pitch / slope > 0.0 else 1.0
    notes = [
        f"elevator: command {command}, surface {surface}, {abs(slope) / DEG:.3g} deg per unit of the command about zero"
    ]
    if sign < 0.0:
        notes.append(
            "elevator: the model counts the surface positive when it pitches the nose up; logs have the other sign"
        )
    found = ElevatorProperties(
        command=command, command_per_rad=sign / slope, surface=surface, surface_rad=sign * per_unit
    )
    return Found(found, tuple(notes), tuple(decisions))


def _pitch(bench: Bench, command: str) -> float:
    """Change of the pitch acceleration by a unit of a command [rad/s2]."""
    low, high = (bench.at({command: s * _REACH}).respond().q_dot_rad_s2 for s in (-1.0, 1.0))
    return (high - low) / (2.0 * _REACH)


def _surface(bench: Bench, names: ModelNames, command: str) -> tuple[str, float, list[str]]:
    """Property of the surface, radians per unit, and what the user has to decide."""
    low, high = bench.at({command: -_REACH}), bench.at({command: _REACH})
    catalogue = [line.split(" ")[0] for line in low.fdm.get_property_catalog()]
    candidates = [
        n for n in dict.fromkeys((*names.aerodynamic, *catalogue)) if _SURFACE.search(n) and n in catalogue
    ]
    change = read(high, candidates) - read(low, candidates)
    moved = [
        n
        for n, d in zip(candidates, change, strict=True)
        if abs(d) > _MOVES and "mag-" not in n and "cmd" not in n
    ]
    used = [n for n in moved if n in names.aerodynamic]
    for group in (used, moved):
        for end, radians in _UNITS[:2]:
            for name in group:
                if name.endswith(end):
                    return name, radians, []
    if not used:
        raise AircraftError(
            f"no surface: no property of an elevator moves with {command}; state jsbsim.elevator.surface yourself"
        )
    name = used[0]
    return (
        name,
        1.0,
        [
            f"jsbsim.elevator.surface_rad: {name} has no unit and no property of the same surface has one; a unit is "
            "taken as one radian, so that derivatives are per unit of it"
        ],
    )


def feedback_rad(bench: Bench) -> float:
    """Largest motion of the surface at a held command, by alpha, pitch rate or airspeed [rad]."""
    surface, scale = bench.model.elevator.surface, bench.model.elevator.surface_rad
    states = (
        bench.at(),
        bench.at(alpha_rad=bench.alpha_rad + 1.0 * DEG),
        bench.at(q_rad_s=5.0 * DEG),
        bench.at(speed=1.03),
    )
    angles = [float(s.fdm[surface]) * scale for s in states]
    return max(angles) - min(angles)


def without_feedback(bench: Bench, names: ModelNames) -> tuple[Bench, list[str], list[str]]:
    """Switch feedback to the elevator off where a property does it, or carry it.

    Returns
    -------
    The bench, notes, and decisions for the user.
    """
    moves = feedback_rad(bench)
    if moves <= _FEEDBACK_RAD:
        return bench, [], []
    start = bench.at()
    manager = start.fdm.get_property_manager()
    for name in names.switches:
        if not manager.hasNode(name):
            continue
        value = 0.0 if start.fdm[name] else 1.0
        switched = bench.known(set={**bench.model.set, name: value})
        if (
            feedback_rad(switched) <= _FEEDBACK_RAD
            and abs(_pitch(switched, bench.model.elevator.command)) > _PITCHES
        ):
            return (
                switched,
                [f"augmentation: {name} = {value:g} switches the feedback to the elevator off"],
                [],
            )
    carried = bench.model.elevator.model_copy(update={"feedback": True})
    return (
        bench.known(elevator=carried),
        [
            f"augmentation: the surface moves by {moves / DEG:.2g} deg with the motion at a held command; it is carried"
        ],
        ["augmentation: fly with the feedback, or write into jsbsim.set the property that switches it off"],
    )


def integrated(bench: Bench, names: ModelNames) -> list[str]:
    """Surfaces that go on moving at a held pitch rate and command: a fly-by-wire integrates the error."""
    manager = bench.at().fdm.get_property_manager()
    surfaces = [n for n in names.aerodynamic if n.startswith("fcs/") and "-pos" in n and manager.hasNode(n)]
    early, late = (read(bench.known(engine_start_s=s).at(q_rad_s=5.0 * DEG), surfaces) for s in _HELD_S)
    return [n for n, a, b in zip(surfaces, early, late, strict=True) if abs(b - a) > _INTEGRATES]


def lateral_of(bench: Bench) -> tuple[LateralProperties | None, list[str]]:
    """Aileron and rudder, where the symmetric state is not in lateral equilibrium."""
    r = bench.at().respond()
    off = max(abs(r.v_dot_m_s2), abs(r.p_dot_rad_s2), abs(r.r_dot_rad_s2))
    if off <= _STRAIGHT:
        return None, []
    found = LateralProperties()
    effects = [
        np.array(
            [
                getattr(bench.at({name: _REACH}).respond(), key) - getattr(r, key)
                for key in ("p_dot_rad_s2", "r_dot_rad_s2")
            ]
        )
        for name in (found.aileron, found.rudder)
    ]
    if min(float(np.abs(e).max()) for e in effects) < _PITCHES:
        return None, [f"asymmetric by {off:.2g} (SI) at zero sideslip, and aileron or rudder have no effect"]
    return found, ["asymmetric (torque, slipstream or shape): trimmed with aileron, rudder and a bank"]


__all__ = [
    "STANDARD",
    "Found",
    "elevator_of",
    "feedback_rad",
    "integrated",
    "lateral_of",
    "without_feedback",
]
