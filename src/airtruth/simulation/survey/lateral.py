"""Aileron and rudder of a model: command, surface, sign and units, and the feedback that moves them."""

from __future__ import annotations

import re
from typing import Final

from airtruth.aircraft.model import SurfaceProperties
from airtruth.errors import AircraftError
from airtruth.physics.motion import LATERAL
from airtruth.simulation.manoeuvres import LATERAL_CONTROLS
from airtruth.simulation.survey.bench import ModelBench
from airtruth.simulation.survey.controls import (
    FEEDBACK_RAD,
    SurveyedControl,
    control_of,
    switched_over,
    turns,
)
from airtruth.simulation.survey.names import ModelNames
from airtruth.units import DEG

AILERON: Final = SurveyedControl(
    "aileron",
    "fcs/aileron-cmd-norm",
    re.compile(r"ail.*cmd|cmd.*ail|roll.*cmd|elevon.*cmd|stick", re.IGNORECASE),
    re.compile(r"ail|elevon|flaperon|roll|wing-warp|spoiler|taileron", re.IGNORECASE),
    "p_dot_rad_s2",
    "rolling",
    "rolls the right wing down",
    "ROLL",
)
"""The ailerons, (right - left)/2, each positive with the trailing edge down."""
RUDDER: Final = SurveyedControl(
    "rudder",
    "fcs/rudder-cmd-norm",
    re.compile(r"rud.*cmd|cmd.*rud|yaw.*cmd|pedal", re.IGNORECASE),
    re.compile(r"rud|yaw", re.IGNORECASE),
    "r_dot_rad_s2",
    "yawing",
    "yaws the nose right",
    "YAW",
)
"""The rudder, positive with the trailing edge left."""
_MOTION: Final = {**dict.fromkeys(LATERAL.gyros, 5.0 * DEG), LATERAL.vane: 1.0 * DEG, "phi_rad": 5.0 * DEG}
"""Motions under which a surface has to stand still [rad/s], [rad] (judgement: those of a small manoeuvre)."""


def with_lateral_controls(bench: ModelBench, names: ModelNames) -> tuple[ModelBench, list[str], list[str]]:
    """Find aileron and rudder, and switch their feedback off where a property does it, or carry it.

    Returns
    -------
    The bench, notes, and decisions for the user. A model without one of the two flies in the pitch plane alone.
    """
    notes: list[str] = []
    decisions: list[str] = []
    for control in (AILERON, RUDDER):
        try:
            found = control_of(bench, names, control)
        except AircraftError as error:
            notes.append(f"lateral flights are not possible: {error}")
            return bench.known(**dict.fromkeys(LATERAL_CONTROLS)), notes, decisions
        notes += found.notes
        decisions += found.decisions
        bench = bench.known(**{control.name: found.surface})
    bench, more, to_decide = _without_feedback(bench, names)
    return bench, notes + more, decisions + to_decide


def _controls(bench: ModelBench) -> list[tuple[SurveyedControl, SurfaceProperties]]:
    surfaces = bench.model.surfaces(LATERAL)
    return [(control, surfaces[control.name]) for control in (AILERON, RUDDER) if control.name in surfaces]


def feedback_rad(bench: ModelBench) -> dict[str, float]:
    """Largest motion of each lateral surface at held commands, by roll, yaw, sideslip or bank [rad]."""
    states = [bench.at(), *(bench.at(lateral={name: value}) for name, value in _MOTION.items())]
    result = {}
    for control, surface in _controls(bench):
        angles = [float(s.fdm[surface.surface]) * surface.surface_rad for s in states]
        result[control.name] = max(angles) - min(angles)
    return result


def _without_feedback(bench: ModelBench, names: ModelNames) -> tuple[ModelBench, list[str], list[str]]:
    moves = feedback_rad(bench)
    if max(moves.values()) <= FEEDBACK_RAD:
        return bench, [], []
    for switched, setting in switched_over(bench, names):
        if max(feedback_rad(switched).values()) <= FEEDBACK_RAD and all(
            turns(switched, surface.command, control) for control, surface in _controls(bench)
        ):
            return switched, [f"augmentation: {setting} switches the lateral feedback off"], []
    notes, carried = [], {}
    for control, surface in _controls(bench):
        if moves[control.name] > FEEDBACK_RAD:
            carried[control.name] = surface.model_copy(update={"feedback": True})
            notes.append(
                f"augmentation: the {control.name} moves by {moves[control.name] / DEG:.2g} deg with the motion at a held "
                "command; it is carried"
            )
    decision = (
        f"augmentation: fly with the feedback to {' and '.join(carried)}, or write into jsbsim.set the property that "
        "switches it off"
    )
    return bench.known(**carried), notes, [decision]


__all__ = ["AILERON", "RUDDER", "feedback_rad", "with_lateral_controls"]
