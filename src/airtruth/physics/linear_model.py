"""The linear model of a motion, and its parts that the flight condition alone decides."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from airtruth.physics.motion import Motion

Array = NDArray[np.float64]


class BodyConstants(Protocol):
    """Constants of the aircraft that every motion needs."""

    @property
    def wing_area_m2(self) -> float:
        """Reference area S [m2]."""

    @property
    def mass_kg(self) -> float:
        """Mass m [kg]."""

    @property
    def inertia_yy_kg_m2(self) -> float:
        """Pitch inertia Iyy [kg m2]."""


class Linear(NamedTuple):
    """x' = a x + b u, y = c x + d u: states, controls and outputs in the order of the motion, (..., rows, columns)."""

    a: Array
    b: Array
    c: Array
    d: Array


class Structure(NamedTuple):
    """The linear model without its derivatives: a = kinematics + forces Theta signals, c likewise.

    Attributes
    ----------
    kinematics : (..., states, states) the part of a that needs no aerodynamics.
    forces : (..., states, coefficients) rates of the states per coefficient.
    seen : (outputs, states) the part of c that needs no aerodynamics.
    accelerations : (..., outputs, coefficients) outputs per coefficient.
    rates : (..., signals) factor of each signal: 1, or l/(2V) [s].
    """

    kinematics: Array
    forces: Array
    seen: Array
    accelerations: Array
    rates: Array


def bare(motion: Motion, half_time_s: Array) -> Structure:
    """The structure of a motion whose first outputs are its states, kinematics, forces and accelerations zero.

    Parameters
    ----------
    half_time_s : (...) factor l/(2V) of the angular rates [s].
    """
    shape, states, outputs = np.shape(half_time_s), len(motion.states), len(motion.outputs)
    coefficients, one = len(motion.coefficients), np.ones_like(half_time_s)
    return Structure(
        kinematics=np.zeros((*shape, states, states)),
        forces=np.zeros((*shape, states, coefficients)),
        seen=np.eye(outputs, states),
        accelerations=np.zeros((*shape, outputs, coefficients)),
        rates=np.stack([one if x.length is None else half_time_s for x in motion.signals], axis=-1),
    )


def assembled(motion: Motion, own: Structure, theta: Array) -> Linear:
    """The linear model of derivatives.

    Parameters
    ----------
    own : the rest of the model, of shape (...).
    theta : (..., derivatives) in the order of the motion's parameters [-].
    """
    th = np.asarray(theta, dtype=np.float64).reshape(*np.shape(theta)[:-1], *motion.shape)
    by_signal = th * own.rates[..., None, :]
    of_rates, of_outputs = own.forces @ by_signal, own.accelerations @ by_signal
    shape, controls = of_rates.shape[:-2], len(motion.controls)
    a = np.zeros((*shape, *own.kinematics.shape[-2:])) + own.kinematics
    c = np.zeros((*shape, *own.seen.shape)) + own.seen
    b, d = (np.zeros((*shape, x.shape[-2], controls)) for x in (own.forces, own.accelerations))
    for column, (is_state, number) in enumerate(places(motion)):
        rows, outputs = (a, c) if is_state else (b, d)
        rows[..., number] += of_rates[..., column]
        outputs[..., number] += of_outputs[..., column]
    return Linear(a, b, c, d)


def places(motion: Motion) -> tuple[tuple[bool, int], ...]:
    """For each signal of a motion whether it is a state, and its number among the states or controls.

    Examples
    --------
    >>> from airtruth.physics.motion import LATERAL
    >>> places(LATERAL)
    ((True, 0), (True, 1), (True, 2), (False, 0), (False, 1))
    """
    states = [state.channel for state in motion.states]
    controls = [control.channel for control in motion.controls]
    return tuple(
        (True, states.index(s.channel)) if s.channel in states else (False, controls.index(s.channel))
        for s in motion.signals
    )


__all__ = ["BodyConstants", "Linear", "Structure", "assembled", "bare", "places"]
