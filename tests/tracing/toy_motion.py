"""A toy motion that no module of the package knows: a pendulum in a wind, with two controls and five derivatives.

    theta' = q,   q' = 2 qbar (Cp_theta theta + Cp_q q c/(2V) + Cp_left left + Cp_right right + Cp_wind (wind + gust))

Outputs theta, q and, late, the acceleration 3 q' of an instrument three metres away.
"""

from typing import NamedTuple

import numpy as np

from airtruth.numerics.compiled import inner
from airtruth.physics.motion import Motion
from airtruth.physics.motion_parts import Coefficient, Control, Declared, Mode, Output, Signal, State
from airtruth.tracing.model.by_motion import MotionEquations, register
from airtruth.tracing.model.packing import Packing
from airtruth.tracing.model.response import register_packing

TOY = Motion(
    name="toy",
    heading="Toy motion",
    states=(State("theta", "theta_rad"), State("q", "q_rad_s")),
    controls=(
        Control("left", "left_rad", "left_command_rad", "left_actuator", "dl", "q_rad_s"),
        Control("right", "right_rad", "right_command_rad", "right_actuator", "dr", "q_rad_s"),
    ),
    known=("airspeed_m_s",),
    outputs=(
        Output("theta", "theta_rad", "attitude"),
        Output("q", "q_rad_s", "gyro"),
        Output("az", "az_m_s2", "accelerometer", late=True),
    ),
    coefficients=(Coefficient("Cp", "moment of the pendulum", "chord"),),
    signals=(
        Signal("theta", "theta", "theta_rad"),
        Signal("qhat", "q", "q_rad_s", "chord"),
        Signal("left", "dl", "left_rad"),
        Signal("right", "dr", "right_rad"),
        Signal("wind", "w", "wind"),
    ),
    implicit=("Cp", "theta"),
    gusts=("w",),
    declared=(Declared("inertia", 1.0, divides=("Cp",)),),
    modes=(Mode("pendulum_rad_s", "rad/s", "natural frequency"),),
    required=("theta_rad", "q_rad_s"),
    forces="moment",
    incidence="angle of the pendulum",
    linear="pendulum",
)


class ToyAircraft(NamedTuple):
    """Derivatives (5,) [-] and half the chord [m]."""

    derivatives: np.ndarray
    half_chord_m: float


class ToyPoint(NamedTuple):
    """Inputs at one time."""

    left: float
    right: float
    wind: float
    airspeed_m_s: float
    moment: float


class ToyGrid(NamedTuple):
    """The same along a record, (points,) each."""

    left: np.ndarray
    right: np.ndarray
    wind: np.ndarray
    airspeed_m_s: np.ndarray
    moment: np.ndarray


ARM_M = 3.0
QBAR = 50.0


@inner
def rates(x, at, model, out):
    d, v = model.aircraft.derivatives, at.airspeed_m_s
    drive = d[0] * x[0] + d[1] * x[1] * model.aircraft.half_chord_m / v + d[2] * at.left + d[3] * at.right
    out[0] = x[1]
    out[1] = 2.0 * QBAR * (drive + d[4] * (at.wind + model.gusts.level_m_s * x[3]) + at.moment)
    a = v / model.gusts.length_m
    out[2] = -a * x[2]
    out[3] = a * (x[2] - x[3])
    for i in range(4, model.states.motion):
        out[i] = 0.0
    return ARM_M * out[1]


@inner
def outputs(x, rate, force, at, model, y):
    y[0], y[1], y[2] = x[0], x[1], force
    for i in range(3):
        y[i] *= model.sensors.scale[i]


@inner
def air_at(grid, point):
    wind, moment = grid.wind[point], grid.moment[point]
    return ToyPoint(grid.left[point], grid.right[point], wind, grid.airspeed_m_s[point], moment)


@inner
def move_plays(x, at, model):
    pass


def settle(x, at, model):
    pass


@inner
def shifted(at, field, by):
    left, right, moment = (
        at.left + by * (field == 0),
        at.right + by * (field == 1),
        at.moment + by * (field == 4),
    )
    return ToyPoint(left, right, at.wind, at.airspeed_m_s, moment)


@inner
def signals_at(x, at, rate, model, out):
    pass


register(
    ToyAircraft,
    ToyGrid,
    MotionEquations(2, 2, rates, outputs, air_at, move_plays, settle, shifted, signals_at, ToyPoint, 1),
)


HALF_CHORD_M = 0.5


def packed(plant, compiled, common, entries):
    return ToyAircraft(plant.derivatives + common[entries.derivatives], HALF_CHORD_M)


def known(signals, compiled, air):
    """The wind, which a run of the toy holds in place of an angle of attack, and the airspeed."""
    return signals.alpha_rad, air.airspeed_m_s


register_packing(
    TOY, Packing(ToyGrid, known, packed, lambda gusts, span_m: gusts._replace(rolloff=0.0, rotary=0.0))
)
