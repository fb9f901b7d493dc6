"""The measured dynamic pressure in the predictor: how it multiplies the motion, as known inputs.

With v = V(t)/V0 and p = q_bar(t)/q_bar0 the ratios to the reference condition of a record, lift and moment
of eqs (2), (3) act on alpha and the elevator p times, on the rate p/v times; the lift turns the path by
1/v of that. The surplus over the reference, such as (p - 1) alpha, is made of measured signals and enters
like the elevator; its noise is that of the sensors times a few percent. Filter and gain stay those of the
reference condition. Gravity across a path that turns, (g/V) cos(gamma), is a known input as well, and in records of both
motions the rates that the lateral one causes (`with_known_rates`). Left out is
gamma V'/V, by which a changing airspeed turns a path that is not level.

Source: M. Brunot, "An Instrumental Variable Approach for Aircraft Identification", eqs (2), (3).
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.identification.condition import AircraftConstants, across_path, ratios_of
from airtruth.identification.likelihood.predictor import AIRSPEED, Predictor, Term, actions, extended
from airtruth.logs.flight_log import Batch
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.short_period import Scale, structure
from airtruth.units import G0

Array = NDArray[np.float64]

TRIM_MOMENT: Final = "Cmtrim"
"""Name of the parameter: aerodynamic moment coefficient of the trim [-]."""
TURNING: Final = tuple(f"turning_{signal.name}" for signal in LONGITUDINAL.signals)
"""Each signal times the surplus with which its lift turns the path."""
SURPLUS: Final = tuple(f"surplus_{signal.name}" for signal in LONGITUDINAL.signals)
"""Each signal times the surplus of its forces and moments."""
TRIM: Final = ("turning_trim", "surplus_trim")
"""The surplus itself, by which the lift of the trimmed aircraft grows, where it turns the path and where az shows it."""
GRAVITY: Final = "gravity"
"""Change of gravity across the path."""
INPUTS: Final = (*TURNING, TRIM[0], *SURPLUS, TRIM[1], GRAVITY)
"""Inputs of every record."""
KNOWN: Final = tuple(f"known_{state.name}" for state in LONGITUDINAL.states)
"""Parts of the rates of the states that another motion causes."""


def products(batch: Batch, constants: AircraftConstants, scale: Scale) -> Array:
    """Inputs `INPUTS`, (runs, samples, inputs).

    The signals are taken relative to their means over the record, to which the lift at
    p = 1 in `with_pressure` belongs.

    Parameters
    ----------
    batch, constants : runs with airspeed, and density or altitude; aircraft.
    scale : factors (runs,) of the reference condition.
    """
    v, p = ratios_of(batch, constants, scale)
    path, force = p / v - 1.0, p - 1.0
    turning, surplus = [], []
    for signal in LONGITUDINAL.signals:
        moved = batch.channels[signal.channel] - batch.channels[signal.channel].mean(axis=1, keepdims=True)
        turning.append((path if signal.length is None else p / v**2 - 1.0) * moved)
        surplus.append((force if signal.length is None else path) * moved)
    across = across_path(batch)
    gravity = (across - across.mean(axis=1, keepdims=True)) / v
    trim = force / v  # the weight turns the path by 1/v too
    return np.stack([*turning, trim, *surplus, force, gravity], axis=2)


def with_pressure(
    predictor: Predictor, scale: Scale, batch: Batch, constants: AircraftConstants
) -> Predictor:
    """The predictor of the short period with the inputs that `products` makes.

    Parameters
    ----------
    predictor : of `airtruth.identification.likelihood.predictor.short_period`. With airspeed among its outputs the lift of
        the trim follows the gust u; without, it follows the measured airspeed, and u is the part that this does not show.
    scale, batch, constants : as in `products`.
    """
    flow, normal = LONGITUDINAL.flow, LONGITUDINAL.outputs[-1]
    terms = [Term("B", flow, GRAVITY, G0 / scale.airspeed_m_s)]
    for matrices, row, derivative, factor in actions(LONGITUDINAL, structure(scale), predictor.outputs):
        source = (TURNING if row == flow else SURPLUS)[derivative.column]
        terms.append(Term(matrices[1], row, source, factor, (derivative.name,)))
    if AIRSPEED not in predictor.outputs:
        _, p = ratios_of(batch, constants, scale)
        steady = (batch.channels[normal.channel] / p).mean(axis=1)
        terms += [
            Term("B", flow, TRIM[0], steady / scale.airspeed_m_s),
            Term("D", normal.name, TRIM[1], steady),
        ]
    return extended(predictor, terms, inputs=INPUTS)


def with_known_rates(predictor: Predictor) -> Predictor:
    """The predictor with the inputs `KNOWN`, the rates of `airtruth.logs.flight_log.Batch`."""
    terms = [Term("B", state.name, name, 1.0) for state, name in zip(LONGITUDINAL.states, KNOWN, strict=True)]
    return extended(predictor, terms, inputs=KNOWN)


def with_trim_moment(predictor: Predictor, scale: Scale) -> Predictor:
    """The predictor in which the trim's aerodynamic moment, balanced by thrust, follows the dynamic pressure.

    Adds the parameter `TRIM_MOMENT`, a moment coefficient [-].

    Parameters
    ----------
    predictor : of the short period, with or without `with_pressure`; scale : its factors (runs,).
    """
    by_gust = 2.0 * scale.moment / scale.airspeed_m_s
    terms = [Term("A", "q", "u", by_gust, (TRIM_MOMENT, "sigma_u"))]
    if TRIM[1] in predictor.inputs and AIRSPEED not in predictor.outputs:
        terms.append(Term("B", "q", TRIM[1], scale.moment, (TRIM_MOMENT,)))
    return extended(predictor, terms, parameters=(TRIM_MOMENT,))
