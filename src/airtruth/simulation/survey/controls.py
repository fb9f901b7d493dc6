"""Elevator, surface, units, aileron and rudder of a model, from what moves when a command moves."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from airtruth.aircraft.model import LateralProperties, SurfaceProperties
from airtruth.errors import AircraftError
from airtruth.physics.motion import LATERAL, LONGITUDINAL, Motion
from airtruth.simulation.survey.bench import ModelBench, read
from airtruth.simulation.survey.names import ModelNames
from airtruth.units import DEG

_REACH: Final = 0.1
"""Command for which responses are measured, to both sides [units of the command] (judgement: a tenth of the stick)."""
_MOVES: Final = 1e-6
"""Least change of a property by the command that counts as motion [its unit] (judgement: far above rounding)."""
_TURNS: Final = 1e-4
"""Least change of an angular acceleration that counts as an effect [rad/s2] (judgement)."""
FEEDBACK_RAD: Final = 1e-6
"""Motion of the surface at a held command that counts as feedback [rad] (as in `airtruth.simulation.probe`)."""
_HELD_S: Final = (1.0, 3.0)
"""Times for which a state is held to see an integrator move a surface [s] (judgement: servos have settled)."""
_INTEGRATES: Final = 1e-3
"""Motion of a surface between these times that shows an integrator [its unit] (judgement)."""
_STRAIGHT: Final = 1e-6
"""Lateral acceleration that counts as an asymmetry [m/s2], [rad/s2]: the tolerance of a trim."""
_MOVED: Final = {"vane": 1.0 * DEG, "gyro": 5.0 * DEG, "attitude": 5.0 * DEG}
"""Instrument of an output -> motion under which a surface has to stand still [rad], [rad/s] (judgement: those of a small
manoeuvre)."""
_FASTER: Final = 1.03
"""The same of the airspeed in the pitch plane, over that of the condition [-] (judgement)."""
_UNITS: Final = (("-rad", 1.0), ("-deg", DEG), ("-norm", 0.0))
"""Ends of the names of surfaces in the order of preference, and radians per unit; 0 for unknown."""


@dataclass(frozen=True)
class SurveyedControl:
    """Knowledge of a control before a model is examined.

    Attributes
    ----------
    name : of the control.
    command, surface : names of other commands, and of surfaces (judgement).
    acceleration : attribute of `airtruth.simulation.simulator.SimulatorResponse` that it changes; a positive surface lowers it.
    moment, against : the moment, and the sense of motion for which a model may count its surface positive, in words.
    axis : of the aerodynamics whose surfaces come first; "" for any.
    """

    name: str
    command: re.Pattern[str]
    surface: re.Pattern[str]
    acceleration: str
    moment: str
    against: str
    axis: str = ""

    @property
    def standard(self) -> str:
        """Its command in JSBSim's own flight controls."""
        return f"fcs/{self.name}-cmd-norm"


SURVEYED: Final = {
    control.name: control
    for control in (
        SurveyedControl(
            "elevator",
            re.compile(r"elev.*cmd|cmd.*elev|pitch.*cmd|stick|stabilator.*cmd", re.IGNORECASE),
            re.compile(r"elev|stab|htail|canard|pitch", re.IGNORECASE),
            "q_dot_rad_s2",
            "pitching",
            "pitches the nose up",
        ),
        SurveyedControl(
            "aileron",
            re.compile(r"ail.*cmd|cmd.*ail|roll.*cmd|elevon.*cmd|stick", re.IGNORECASE),
            re.compile(r"ail|elevon|flaperon|roll|wing-warp|spoiler|taileron", re.IGNORECASE),
            "p_dot_rad_s2",
            "rolling",
            "rolls the right wing down",
            "ROLL",
        ),
        SurveyedControl(
            "rudder",
            re.compile(r"rud.*cmd|cmd.*rud|yaw.*cmd|pedal", re.IGNORECASE),
            re.compile(r"rud|yaw", re.IGNORECASE),
            "r_dot_rad_s2",
            "yawing",
            "yaws the nose right",
            "YAW",
        ),
    )
}
"""Name of a control -> what is known of it; their positive senses are those of `airtruth.channels`."""


@dataclass(frozen=True)
class Found:
    """A control of a model.

    Attributes
    ----------
    surface : its properties.
    notes : what was found out; decisions : what the user has to decide.
    """

    surface: SurfaceProperties
    notes: tuple[str, ...]
    decisions: tuple[str, ...]


def control_of(bench: ModelBench, names: ModelNames, control: SurveyedControl) -> Found:
    """Find the command that moves the aircraft about an axis and the surface that moves with it.

    Raises
    ------
    AircraftError
        If no command does, or no property of a surface moves with it.
    """
    tried = [
        control.standard,
        *(n for n in names.read if control.command.search(n) and n != control.standard),
    ]
    command, turn = "", 0.0
    start = bench.at()
    for name in [n for n in tried if start.fdm.get_property_manager().hasNode(n)]:
        turn = effect_of(bench, name, control)
        if abs(turn) > _TURNS:
            command = name
            break
    if not command:
        raise AircraftError(
            f"no {control.name}: none of the commands {', '.join(tried[:6])} changes the {control.moment} moment of the model"
        )
    surface, per_unit, decisions = _surface(bench, names, command, control)
    low, high = (float(read(bench.at({command: s * _REACH}), [surface])[0]) * per_unit for s in (-1.0, 1.0))
    slope = (high - low) / (2.0 * _REACH)
    sign = -1.0 if turn / slope > 0.0 else 1.0
    notes = [
        f"{control.name}: command {command}, surface {surface}, {abs(slope) / DEG:.3g} deg per unit of the command about zero"
    ]
    if sign < 0.0:
        notes.append(
            f"{control.name}: the model counts the surface positive when it {control.against}; logs have the other sign"
        )
    found = SurfaceProperties(
        command=command, command_per_rad=sign / slope, surface=surface, surface_rad=sign * per_unit
    )
    return Found(found, tuple(notes), tuple(decisions))


def effect_of(bench: ModelBench, command: str, control: SurveyedControl) -> float:
    """Change of a control's angular acceleration by a unit of a command [rad/s2]."""
    low, high = (
        float(getattr(bench.at({command: s * _REACH}).respond(), control.acceleration)) for s in (-1.0, 1.0)
    )
    return (high - low) / (2.0 * _REACH)


def turns(bench: ModelBench, command: str, control: SurveyedControl) -> bool:
    """Whether a command changes the angular acceleration of a control."""
    return abs(effect_of(bench, command, control)) > _TURNS


def _surface(
    bench: ModelBench, names: ModelNames, command: str, control: SurveyedControl
) -> tuple[str, float, list[str]]:
    """Property of the surface, radians per unit, and what the user has to decide."""
    low, high = bench.at({command: -_REACH}), bench.at({command: _REACH})
    catalogue = [line.split(" ")[0] for line in low.fdm.get_property_catalog()]
    candidates = [
        n
        for n in dict.fromkeys((*names.aerodynamic, *catalogue))
        if control.surface.search(n) and n in catalogue
    ]
    change = read(high, candidates) - read(low, candidates)
    moved = [
        n
        for n, d in zip(candidates, change, strict=True)
        if abs(d) > _MOVES and "mag-" not in n and "cmd" not in n
    ]
    used = [n for n in moved if n in names.aerodynamic]
    first = [n for n in moved if n in names.by_axis.get(control.axis, ())]
    for group in (first, used, moved):
        for end, radians in _UNITS[:2]:
            for name in group:
                if name.endswith(end):
                    return name, radians, []
    if not used:
        raise AircraftError(
            f"no surface: no property of an {control.name} moves with {command}; state jsbsim.{control.name}.surface yourself"
        )
    name = used[0]
    return (
        name,
        1.0,
        [
            f"jsbsim.{control.name}.surface_rad: {name} has no unit and no property of the same surface has one; a unit is "
            "taken as one radian, so that derivatives are per unit of it"
        ],
    )


def with_controls(
    bench: ModelBench, names: ModelNames, motion: Motion
) -> tuple[ModelBench, list[str], list[str]]:
    """Find the controls of a motion, and switch their feedback off where a property does it, or carry it.

    Returns
    -------
    The bench, notes, and decisions for the user. A model without one of the lateral controls flies in the pitch plane alone.

    Raises
    ------
    AircraftError
        If it has no control of the pitch plane.
    """
    notes: list[str] = []
    decisions: list[str] = []
    for control in motion.controls:
        try:
            found = control_of(bench, names, SURVEYED[control.name])
        except AircraftError as error:
            if motion is LONGITUDINAL:
                raise
            notes.append(f"lateral flights are not possible: {error}")
            return bench.known(**dict.fromkeys(c.name for c in motion.controls)), notes, decisions
        notes += found.notes
        decisions += found.decisions
        known = bench.model.surfaces(motion).get(control.name, found.surface)
        bench = bench.known(**{control.name: known.model_copy(update=found.surface.model_dump())})
    bench, more, to_decide = _without_feedback(bench, names, motion)
    return bench, notes + more, decisions + to_decide


def feedback_rad(bench: ModelBench, motion: Motion) -> dict[str, float]:
    """Largest motion of each surface of a motion at held commands, by the outputs of the motion and the airspeed [rad]."""
    states = [bench.at()]
    for output in motion.outputs:
        if not output.late:
            states.append(bench.at(off={output.channel: _MOVED[output.instrument]}))
    if motion is LONGITUDINAL:
        states.append(bench.at(speed=_FASTER))
    result = {}
    for name, surface in bench.model.surfaces(motion).items():
        angles = [float(s.fdm[surface.surface]) * surface.surface_rad for s in states]
        result[name] = max(angles) - min(angles)
    return result


def switched_over(bench: ModelBench, names: ModelNames) -> Iterator[tuple[ModelBench, str]]:
    """The bench with each switch of the model in its other position, and the setting as NAME = VALUE."""
    start = bench.at()
    manager = start.fdm.get_property_manager()
    for name in names.switches:
        if manager.hasNode(name):
            value = 0.0 if start.fdm[name] else 1.0
            yield bench.known(set={**bench.model.set, name: value}), f"{name} = {value:g}"


def _without_feedback(
    bench: ModelBench, names: ModelNames, motion: Motion
) -> tuple[ModelBench, list[str], list[str]]:
    moves, surfaces = feedback_rad(bench, motion), bench.model.surfaces(motion)
    if max(moves.values()) <= FEEDBACK_RAD:
        return bench, [], []
    for switched, setting in switched_over(bench, names):
        if max(feedback_rad(switched, motion).values()) <= FEEDBACK_RAD and all(
            turns(switched, surface.command, SURVEYED[name]) for name, surface in surfaces.items()
        ):
            off = f"augmentation: {setting} switches the feedback to the {' and '.join(surfaces)} off"
            return switched, [off], []
    notes, carried = [], {}
    for name, surface in surfaces.items():
        if moves[name] > FEEDBACK_RAD:
            carried[name] = surface.model_copy(update={"feedback": True})
            notes.append(
                f"augmentation: the {name} moves by {moves[name] / DEG:.2g} deg with the motion at a held command; it is carried"
            )
    decision = (
        f"augmentation: fly with the feedback to the {' and '.join(carried)}, or write into jsbsim.set the property that "
        "switches it off"
    )
    return bench.known(**carried), notes, [decision]


def integrated(bench: ModelBench, names: ModelNames) -> list[str]:
    """Surfaces that go on moving at a held pitch rate and command: a fly-by-wire integrates the error."""
    manager = bench.at().fdm.get_property_manager()
    surfaces = [n for n in names.aerodynamic if n.startswith("fcs/") and "-pos" in n and manager.hasNode(n)]
    pitching = {LONGITUDINAL.gyros[0]: _MOVED["gyro"]}
    early, late = (read(bench.known(engine_start_s=s).at(off=pitching), surfaces) for s in _HELD_S)
    return [n for n, a, b in zip(surfaces, early, late, strict=True) if abs(b - a) > _INTEGRATES]


def lateral_of(bench: ModelBench) -> tuple[LateralProperties | None, list[str]]:
    """Aileron and rudder, where the symmetric state is not in lateral equilibrium."""
    r = bench.at().respond()
    off = max(abs(r.v_dot_m_s2), abs(r.p_dot_rad_s2), abs(r.r_dot_rad_s2))
    if off <= _STRAIGHT:
        return None, []
    commands = {name: surface.command for name, surface in bench.model.surfaces(LATERAL).items()}
    found = LateralProperties(**commands)
    effects = [
        np.array(
            [
                getattr(bench.at({name: _REACH}).respond(), key) - getattr(r, key)
                for key in (SURVEYED[control].acceleration for control in commands)
            ]
        )
        for _, name in found
    ]
    if min(float(np.abs(e).max()) for e in effects) < _TURNS:
        return None, [f"asymmetric by {off:.2g} (SI) at zero sideslip, and aileron or rudder have no effect"]
    return found, ["asymmetric (torque, slipstream or shape): trimmed with aileron, rudder and a bank"]


__all__ = [
    "FEEDBACK_RAD",
    "SURVEYED",
    "Found",
    "SurveyedControl",
    "control_of",
    "feedback_rad",
    "integrated",
    "lateral_of",
    "switched_over",
    "turns",
    "with_controls",
]
