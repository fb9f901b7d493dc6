"""The compiled filter of the lateral-directional motion against an integration and a Kalman filter that share no code with it."""

from __future__ import annotations

import lateral_records as lr
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from airtruth.physics.motion import LATERAL
from airtruth.physics.terms import (
    Change,
    DeclaredTerm,
    signals_of,
)
from airtruth.tracing.model.lateral_equations import LateralSignals
from airtruth.units import DEG, G0

SAMPLES = 250
START = (0.02, 0.1, -0.05, 0.1)
SMOOTH = {
    "v": lambda t: lr.V + 1.5 * np.sin(0.4 * t),
    "alpha": lambda t: lr.ALPHA + 0.02 * np.sin(1.1 * t),
    "theta": lambda t: lr.ALPHA + 0.05 * np.sin(0.7 * t),
    "q": lambda t: 0.1 * np.cos(1.3 * t),
}


def aileron(t):
    return 3.0 * DEG * np.sin(3.0 * t)


def rudder(t):
    return 3.0 * DEG * np.sin(2.0 * t + 1.0)


def flown(
    derivatives=lr.TRUTH,
    *,
    slope=0.0,
    samples=SAMPLES,
    start=START,
    mass=1.0,
    xx=1.0,
    zz=1.0,
    ixz=0.0,
    moved=(0.0, 0.0),
    yaw_n_m=0.0,
    surfaces=(aileron, rudder),
    more=lambda s: np.zeros(3),
    states=(),
    cy_beta_dot=0.0,
):
    """y (samples, 5) and the effects' states by scipy's DOP853: the equations of Stevens and Lewis, table 2.5-1.

    ``more``: signals -> increments of CY, Cl, Cn; ``states``: (start, rate by signals and states) of the effects' states;
    ``moved``: CG aft and to the right [m].
    """
    c, table = lr.C, np.asarray(derivatives).reshape(3, 5)
    ixx, iyy, izz = c.inertia_xx_kg_m2 * xx, c.inertia_yy_kg_m2, c.inertia_zz_kg_m2 * zz
    cross = c.inertia_xz_kg_m2 + ixz * np.sqrt(c.inertia_xx_kg_m2 * c.inertia_zz_kg_m2)
    m, inertia = c.mass_kg * mass, np.array([[ixx, -cross], [-cross, izz]])

    def rates(t, x):
        beta, p, r, phi = x[:4]
        v, alpha, theta, q = (SMOOTH[k](t) for k in ("v", "alpha", "theta", "q"))
        h = 1e-5
        v_dot = (SMOOTH["v"](t + h) - SMOOTH["v"](t - h)) / (2.0 * h)
        force, half = 0.5 * lr.DENSITY * v**2 * c.wing_area_m2, 0.5 * c.span_m / v
        own = np.array([beta, p * half, r * half, surfaces[0](t), surfaces[1](t)])
        kinematic = np.cos(beta) * v * (p * np.sin(alpha) - r * np.cos(alpha)) + G0 * np.cos(theta) * np.sin(
            phi
        )
        signals = dict(zip(("beta", "phat", "rhat", "aileron", "rudder"), own, strict=True))
        signals |= {"x": x[4:], "alpha": alpha, "qbar": 0.5 * lr.DENSITY * v**2}
        cy, cl, cn = (1.0 + slope * (alpha - lr.ALPHA)) * table @ own + more(signals)

        def beta_dot(side):
            return (kinematic + force * side / m - v_dot * np.sin(beta)) / (v * np.cos(beta))

        if cy_beta_dot:  # CY = cy + k half beta'(CY)
            gain = cy_beta_dot * half
            cy = (cy + gain * beta_dot(0.0)) / (1.0 - gain * (beta_dot(1.0) - beta_dot(0.0)))
        rate = beta_dot(cy)
        lift = m * (v * q + G0 * np.cos(theta) * np.cos(phi))
        roll = force * c.span_m * cl + moved[1] * lift
        yaw = force * c.span_m * cn + moved[0] * force * cy + moved[1] * m * G0 * np.sin(theta) + yaw_n_m
        roll += cross * p * q - (izz - iyy) * q * r
        yaw -= cross * q * r + (iyy - ixx) * p * q
        turn = np.linalg.solve(inertia, [roll, yaw])
        bank = p + (q * np.sin(phi) + r * np.cos(phi)) * np.tan(theta)
        signals["beta_dot_hat"] = rate * half
        extra = [one(signals) for _, one in states]
        return np.array([rate, *turn, bank, *extra]), force * cy / m

    times = np.arange(samples) * lr.DT
    first = np.array([*start, *(value for value, _ in states)])
    path = solve_ivp(
        lambda t, x: rates(t, x)[0], (0.0, times[-1]), first, "DOP853", times, rtol=1e-11, atol=1e-12
    ).y.T
    dots, ay = zip(*(rates(t, x) for t, x in zip(times, path, strict=True)), strict=True)
    return np.column_stack([path[:, :4], ay]), path, np.array(dots)


def made(**own):
    return lr.record(np.zeros((SAMPLES, 5)), aileron, rudder, sub=8, **(SMOOTH | own))


def close(found, expected, tolerance=1e-6):
    scale = np.abs(expected).max(axis=0)
    assert (np.abs(found - expected).max(axis=0) < tolerance * scale).all(), (
        np.abs(found - expected).max(axis=0) / scale
    )


def free(change=None, **plant):
    own = lr.per_record(START)
    return lr.free(made(plant_=lr.plant(**plant)), change, own=own)


def test_the_order_of_the_signals_is_that_of_the_terms():
    assert LateralSignals._fields == signals_of(LATERAL)


def test_free_run_is_that_of_an_independent_integration():
    close(free(alpha_slope=2.0), flown(slope=2.0)[0])


CHANGES = {
    "mass": (DeclaredTerm("mass", 1.1), {"mass": 1.1}),
    "inertia_xx": (DeclaredTerm("inertia_xx", 1.1), {"xx": 1.1}),
    "inertia_zz": (DeclaredTerm("inertia_zz", 0.9), {"zz": 0.9}),
    "inertia_xz": (DeclaredTerm("inertia_xz", 0.05), {"ixz": 0.05}),
    "cg": (DeclaredTerm("cg", 0.1), {"moved": (0.1 * lr.C.chord_m, 0.0)}),
    "cg_y": (DeclaredTerm("cg_y", 0.02), {"moved": (0.0, 0.02)}),
    "yaw_moment": (DeclaredTerm("yaw_moment", 2.0), {"yaw_n_m": 2.0}),
    "aileron": (
        DeclaredTerm("aileron", 0.8),
        {"derivatives": lr.TRUTH * np.tile([1.0, 1.0, 1.0, 0.8, 1.0], 3)},
    ),
    "rudder": (
        DeclaredTerm("rudder", 0.7),
        {"derivatives": lr.TRUTH * np.tile([1.0, 1.0, 1.0, 1.0, 0.7], 3)},
    ),
}


@pytest.mark.parametrize("name", CHANGES)
def test_a_declared_quantity(name):
    term, own = CHANGES[name]
    close(free(Change(declared=(term,))), flown(**own)[0])


def test_increments_of_the_derivatives():
    more = 0.1 * lr.TRUTH + 0.01
    values = dict(zip(LATERAL.parameters, more, strict=True))
    found = lr.free(made(), common_=lr.common(**values), own=lr.per_record(START))
    close(found, flown(lr.TRUTH + more)[0])
