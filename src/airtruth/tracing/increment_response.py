"""The response of the linear aircraft to increments of its coefficients.

An effect adds known increments dCL(t), dCm(t) to the coefficients: functions of the measured angle of attack,
elevator and pitch rate, or of states that these drive. The equations of motion are linear in the rest,
so the motion is the sum of two: that of the linear aircraft under its elevator, and the response d of the same
aircraft to the increments,

    d_alpha' = d_q - lift (CLalpha d_alpha + CLq hat d_q + dCL),   d_q' = moment (Cmalpha d_alpha + Cmq hat d_q + dCm),
    d_az = -normal (CLalpha d_alpha + CLq hat d_q + dCL),

with hat = c/(2V) and the factors of eqs (2)-(4) of M. Brunot, "An Instrumental Variable Approach for Aircraft
Identification".
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from airtruth.physics import short_period
from airtruth.physics.terms import AeroTerm, term_value

Array = NDArray[np.float64]


def increments(aero: Sequence[AeroTerm], signals: Mapping[str, Array]) -> Array:
    """(2, ...) increments dCL and dCm [-] of terms.

    Parameters
    ----------
    signals : name -> values of one shape: alpha as the terms count it [rad], elevator [rad], qhat = q c/(2V), qbar [Pa], states.
    """
    total = np.zeros((2, *next(iter(signals.values())).shape))
    for term in (t for t in aero if t.coefficient != "CX"):
        total[0 if term.coefficient == "CL" else 1] += term_value(term, signals)
    return total


def response(derivatives: Array, scale: short_period.Scale, lift: Array, moment: Array, dt_s: float) -> Array:
    """Response of the linear aircraft to increments of CL and Cm, from rest, increments linear between samples.

    Parameters
    ----------
    derivatives : (6,) or (runs, 6) in the order of `short_period.PARAMETERS` [-].
    scale : factors (runs,).
    lift, moment : (runs, samples) dCL, dCm [-].
    dt_s : sample period [s].

    Returns
    -------
    (3, runs, samples) alpha [rad], q [rad/s], az [m/s2].
    """
    runs, samples = lift.shape
    every = np.broadcast_to(derivatives, (runs, derivatives.shape[-1]))
    a, _ = short_period.system(every, scale)
    u = np.stack([-scale.lift[:, None] * lift, scale.moment[:, None] * moment], axis=2)
    # x' = A x + u, u' = (u1 - u0)/dt: one exponential gives the exact step (Franklin, Powell and Workman,
    # Digital Control of Dynamic Systems, 3rd ed., 1998, 6.3.2, triangle hold)
    whole = np.zeros((runs, 3 * 2, 3 * 2))  # states, u and u'
    whole[:, :2, :2] = a * dt_s
    whole[:, :2, 2:4] = np.eye(2) * dt_s
    whole[:, 2:4, 4:] = np.eye(2)
    step = expm(whole)
    driven = np.einsum("rij,rnj->rni", step[:, :2, 2:4], u[:, :-1])
    driven += np.einsum("rij,rnj->rni", step[:, :2, 4:], np.diff(u, axis=1))
    x = np.zeros((runs, samples, 2))
    for k in range(samples - 1):
        x[:, k + 1] = np.einsum("rij,rj->ri", step[:, :2, :2], x[:, k]) + driven[:, k]
    row = short_period.normal_force_row(every, scale)[:, :2]
    az = np.einsum("rj,rnj->rn", row, x) - scale.normal[:, None] * lift
    return np.stack([x[..., 0], x[..., 1], az])


__all__ = ["increments", "response"]
