"""The measured dynamic pressure in the predictor: how it multiplies the motion, as known inputs.

With v = V(t)/V0 and p = q_bar(t)/q_bar0 the ratios to the reference condition of a record, lift and moment
of eqs (2), (3) act on alpha and the elevator p times, on the rate p/v times; the lift turns the path by
1/v of that. The surplus over the reference, such as (p - 1) alpha, is made of measured signals and enters
like the elevator; its noise is that of the sensors times a few percent. Filter and gain stay those of the
reference condition. Gravity across a path that turns, (g/V) cos(gamma), is a known input as well, and in records of both
motions the lateral one (`airtruth.identification.lateral_inputs`). Left out is
gamma V'/V, by which a changing airspeed turns a path that is not level.

Source: M. Brunot, "An Instrumental Variable Approach for Aircraft Identification", eqs (2), (3).
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.identification.condition import AircraftConstants, across_path, ratios_of
from airtruth.identification.lateral_inputs import lateral_inputs
from airtruth.identification.likelihood.predictor import Predictor, Term, extended
from airtruth.logs.flight_log import Batch
from airtruth.physics.short_period import Scale
from airtruth.units import G0

Array = NDArray[np.float64]

TRIM_MOMENT: Final = "Cmtrim"
"""Name of the parameter: aerodynamic moment coefficient of the trim [-]."""
INPUTS: Final = (
    "lift_alpha",
    "lift_q",
    "lift_elevator",
    "lift_trim",
    "moment_alpha",
    "moment_q",
    "moment_elevator",
    "normal_trim",
    "gravity",
)
"""Measured alpha, q and elevator times the surplus: in alpha_dot, in q_dot and az; the surplus itself,
by which the lift of the trimmed aircraft grows; and the change of gravity across the path."""
LATERAL_INPUTS: Final = ("lateral_alpha", "lateral_q")
"""Parts of alpha_dot and q_dot that the lateral motion causes, in records of both motions."""


def products(batch: Batch, constants: AircraftConstants, scale: Scale) -> Array:
    """Inputs `INPUTS`, and `LATERAL_INPUTS` where a run has lateral motion, (runs, samples, inputs).

    alpha, q and the elevator are taken relative to their means over the record, to which the lift at
    p = 1 in `with_pressure` belongs.

    Parameters
    ----------
    batch, constants : runs with airspeed, and density or altitude; aircraft.
    scale : factors (runs,) of the reference condition.
    """
    v, p = ratios_of(batch, constants, scale)
    alpha, q, elevator = (
        batch.channels[name] - batch.channels[name].mean(axis=1, keepdims=True)
        for name in ("alpha_rad", "q_rad_s", "elevator_rad")
    )
    path, rate, force = p / v - 1.0, p / v**2 - 1.0, p - 1.0
    lift = (path * alpha, rate * q, path * elevator, force / v)  # the weight turns the path by 1/v too
    moment = (force * alpha, path * q, force * elevator, force)
    across = across_path(batch)
    gravity = (across - across.mean(axis=1, keepdims=True)) / v
    lateral = lateral_inputs(batch, constants)
    return np.stack([*lift, *moment, gravity, *(lateral if lateral[1].any() else ())], axis=2)


def with_pressure(
    predictor: Predictor, scale: Scale, batch: Batch, constants: AircraftConstants, count: int
) -> Predictor:
    """The predictor of the short period with the inputs that `products` makes.

    Parameters
    ----------
    predictor : of `airtruth.identification.likelihood.predictor.short_period`. With airspeed among its outputs the lift of
        the trim follows the gust u; without, it follows the measured airspeed, and u is the part that this does not show.
    scale, batch, constants : as in `products`; count : number of inputs that it made.
    """
    lift, moment, half, normal = scale.lift, scale.moment, scale.half_chord_time, scale.normal
    terms = [Term("B", "alpha", "gravity", G0 / scale.airspeed_m_s)]
    for source, factor, cl, cm in (
        ("alpha", 1.0, "CLalpha", "Cmalpha"),
        ("q", half, "CLq", "Cmq"),
        ("elevator", 1.0, "CLde", "Cmde"),
    ):
        terms += [
            Term("B", "alpha", f"lift_{source}", -lift * factor, (cl,)),
            Term("B", "q", f"moment_{source}", moment * factor, (cm,)),
            Term("D", "az", f"moment_{source}", -normal * factor, (cl,)),
        ]
    if "airspeed" not in predictor.outputs:
        _, p = ratios_of(batch, constants, scale)
        az = (batch.channels["az_m_s2"] / p).mean(axis=1)
        terms += [
            Term("B", "alpha", "lift_trim", az / scale.airspeed_m_s),
            Term("D", "az", "normal_trim", az),
        ]
    names = (*INPUTS, *LATERAL_INPUTS)[:count]
    terms += [
        Term("B", row, name, 1.0) for row, name in zip(("alpha", "q"), names[len(INPUTS) :], strict=False)
    ]
    return extended(predictor, terms, inputs=names)


def with_trim_moment(predictor: Predictor, scale: Scale) -> Predictor:
    """The predictor in which the trim's aerodynamic moment, balanced by thrust, follows the dynamic pressure.

    Adds the parameter `TRIM_MOMENT`, a moment coefficient [-].

    Parameters
    ----------
    predictor : of the short period, with or without `with_pressure`; scale : its factors (runs,).
    """
    by_gust = 2.0 * scale.moment / scale.airspeed_m_s
    terms = [Term("A", "q", "u", by_gust, (TRIM_MOMENT, "sigma_u"))]
    if "normal_trim" in predictor.inputs and "airspeed" not in predictor.outputs:
        terms.append(Term("B", "q", "normal_trim", scale.moment, (TRIM_MOMENT,)))
    return extended(predictor, terms, parameters=(TRIM_MOMENT,))
