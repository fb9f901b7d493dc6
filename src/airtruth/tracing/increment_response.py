"""The response of the linear aircraft to increments of its coefficients.

An effect adds known increments dCL(t), dCm(t) to the coefficients: functions of the measured angle of attack,
elevator and pitch rate, or of states that these drive. The equations of motion are linear in the rest,
so the motion is the sum of two: that of the linear aircraft under its elevator, and the response d of the same
aircraft to the increments,

    d_alpha' = d_q - lift (CLalpha d_alpha + CLq hat d_q + dCL),   d_q' = moment (Cmalpha d_alpha + Cmq hat d_q + dCm),
    d_az = -normal (CLalpha d_alpha + CLq hat d_q + dCL),

with hat = c/(2V) and the factors of eqs (2)-(4) of M. Brunot, "An Instrumental Variable Approach for Aircraft
Identification", in the pitch plane, and likewise with the matrices of `airtruth.physics.lateral`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from airtruth.identification import AircraftConstants
from airtruth.identification.record_constants import LateralValues, values_of
from airtruth.physics import short_period
from airtruth.physics.atmosphere import air_density
from airtruth.physics.lateral import LateralScale, lateral_scale, lateral_system, structure
from airtruth.physics.linear_model import Linear, Structure
from airtruth.physics.motion import LONGITUDINAL, Motion
from airtruth.physics.terms import AeroTerm, term_value

Array = NDArray[np.float64]


def increments(
    aero: Sequence[AeroTerm], signals: Mapping[str, Array], motion: Motion = LONGITUDINAL
) -> Array:
    """(coefficients, ...) increments of the coefficients of a motion by terms [-]; an axial force is none of them.

    Parameters
    ----------
    signals : name -> values of one shape: those of the motion as the terms count them [rad, -], qbar [Pa], states.
    """
    rows = [c.name for c in motion.coefficients]
    total = np.zeros((len(rows), *next(iter(signals.values())).shape))
    for term in (t for t in aero if t.coefficient in rows):
        total[rows.index(term.coefficient)] += term_value(term, signals)
    return total


def linear_scale(
    motion: Motion, constants: AircraftConstants, channels: Mapping[str, Array]
) -> short_period.Scale | LateralScale:
    """Factors (runs,) of the linear model at the mean condition of each run.

    Parameters
    ----------
    channels : (runs, samples) of a log.
    """
    airspeed = channels["airspeed_m_s"].mean(axis=1)
    density = np.asarray(air_density(channels)).mean(axis=1)
    if motion is LONGITUDINAL:
        return short_period.scale_of(constants, airspeed, density)
    values = values_of(constants, motion)
    assert isinstance(values, LateralValues)
    level = np.zeros_like(airspeed)
    alpha = channels[LONGITUDINAL.vane].mean(axis=1) if LONGITUDINAL.vane in channels else level
    theta = channels["theta_rad"].mean(axis=1) if "theta_rad" in channels else alpha
    return lateral_scale(values, airspeed, density, alpha, theta)


def linear_motion(derivatives: Array, scale: short_period.Scale | LateralScale) -> tuple[Linear, Structure]:
    """The linear model of derivatives (..., derivatives) and its structure, at a scale (...) whose type decides the motion."""
    if isinstance(scale, LateralScale):
        return lateral_system(derivatives, scale), structure(scale)
    return short_period.linear_system(derivatives, scale), short_period.structure(scale)


def response(
    derivatives: Array, scale: short_period.Scale | LateralScale, coefficients: Array, dt_s: float
) -> Array:
    """Response of the linear aircraft to increments of its coefficients, from rest, increments linear between samples.

    Parameters
    ----------
    derivatives : (derivatives,) or (runs, derivatives) in the order of the motion [-].
    scale : factors (runs,), whose type decides the motion.
    coefficients : (coefficients, runs, samples) increments [-].
    dt_s : sample period [s].

    Returns
    -------
    (outputs, runs, samples) in the order of the motion [units of the outputs].
    """
    runs = coefficients.shape[1]
    every = np.broadcast_to(derivatives, (runs, derivatives.shape[-1]))
    system, own = linear_motion(every, scale)
    u = np.einsum("rij,jrn->rni", own.forces, coefficients)
    x = _driven(system.a, u, dt_s)
    read = np.einsum("rij,rnj->irn", system.c, x)
    return np.asarray(read + np.einsum("rij,jrn->irn", own.accelerations, coefficients))


def _driven(a: Array, u: Array, dt_s: float) -> Array:
    """(runs, samples, n) states of x' = a x + u from rest, for u (runs, samples, n) linear between samples.

    With u' = (u1 - u0)/dt one exponential gives the exact step (Franklin, Powell and Workman, Digital Control of Dynamic
    Systems, 3rd ed., 1998, 6.3.2, triangle hold).
    """
    runs, samples, n = u.shape
    whole = np.zeros((runs, 3 * n, 3 * n))  # states, u and u'
    whole[:, :n, :n] = a * dt_s
    whole[:, :n, n : 2 * n] = np.eye(n) * dt_s
    whole[:, n : 2 * n, 2 * n :] = np.eye(n)
    step = expm(whole)
    driven = np.einsum("rij,rnj->rni", step[:, :n, n : 2 * n], u[:, :-1])
    driven += np.einsum("rij,rnj->rni", step[:, :n, 2 * n :], np.diff(u, axis=1))
    x = np.zeros((runs, samples, n))
    for k in range(samples - 1):
        x[:, k + 1] = np.einsum("rij,rj->ri", step[:, :n, :n], x[:, k]) + driven[:, k]
    return x


__all__ = ["increments", "linear_motion", "linear_scale", "response"]
