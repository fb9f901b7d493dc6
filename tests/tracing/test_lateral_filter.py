"""The compiled filter of the lateral-directional motion against an integration and a Kalman filter that share no code with it."""

from __future__ import annotations

import lateral_records as lr
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.linalg import expm, solve_discrete_are

from airtruth.physics.lateral_gusts import roll_deviation_rad_s
from airtruth.physics.motion import LATERAL
from airtruth.physics.terms import (
    AeroTerm,
    Change,
    DeclaredTerm,
    ReadingTerm,
    SensorTerm,
    StateTerm,
    SurfaceTerm,
    signals_of,
)
from airtruth.tracing.model.lateral.equations import LateralSignals
from airtruth.tracing.model.linearise import process_intensity
from airtruth.tracing.model.steady import linearise_at_reference, steady_filter
from airtruth.units import DEG, G0

SAMPLES = 250
START = (0.02, 0.1, -0.05, 0.1)
SMOOTH = {
    "v": lambda t: lr.V + 1.5 * np.sin(0.4 * t),
    "alpha": lambda t: lr.ALPHA + 0.02 * np.sin(1.1 * t),
    "theta": lambda t: lr.ALPHA + 0.05 * np.sin(0.7 * t),
    "q": lambda t: 0.1 * np.cos(1.3 * t),
    "ax": lambda t: 1.0 + 0.5 * np.sin(0.9 * t),
    "az": lambda t: -G0 + 2.0 * np.sin(1.7 * t),
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
    loaded=0.0,
    yaw_n_m=0.0,
    surfaces=(aileron, rudder),
    more=lambda s: np.zeros(3),
    states=(),
    cy_beta_dot=0.0,
    cn_beta_dot=0.0,
):
    """y (samples, 5) and the effects' states by scipy's DOP853: the equations of Stevens and Lewis, table 2.5-1.

    ``more``: signals -> increments of CY, Cl, Cn; ``states``: (start, rate by signals and states) of the effects' states;
    ``moved``: CG aft and to the right [m]; ``loaded``: normal force to the left [m].
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
        cn += cn_beta_dot * rate * half
        roll = force * c.span_m * cl - (moved[1] + loaded) * m * SMOOTH["az"](t)
        yaw = force * c.span_m * cn + moved[0] * force * cy + moved[1] * m * SMOOTH["ax"](t) + yaw_n_m
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
    "load_y": (DeclaredTerm("load_y", 0.02), {"loaded": 0.02}),
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


# -- effects


def test_terms_of_every_coefficient():
    """A break over beta, a product of beta and the rudder, a square of the yaw rate, a slope over alpha."""
    terms = (
        AeroTerm("Cn", "beta", "above", -0.1, at=0.01),
        AeroTerm("Cl", "beta", "linear", 0.4, at=0.01, factor="rudder", factor_at=0.02),
        AeroTerm("CY", "rhat", "quadratic", 30.0),
        AeroTerm("Cl", "alpha", "linear", 0.02, at=0.09),
    )

    def more(s):
        cn = -0.1 * max(s["beta"] - 0.01, 0.0)
        cl = 0.4 * (s["beta"] - 0.01) * (s["rudder"] - 0.02) + 0.02 * (s["alpha"] - 0.09)
        return np.array([30.0 * s["rhat"] ** 2, cl, cn])

    # a step of integration over the break is of the second order
    close(free(Change(aero=terms)), flown(more=more)[0], 3e-5)


def test_terms_in_beta_dot():
    """A side force in beta' is part of the beta' that drives it."""
    terms = (AeroTerm("CY", "beta_dot_hat", "linear", 2.0), AeroTerm("Cn", "beta_dot_hat", "linear", 0.5))
    close(free(Change(aero=terms[:1])), flown(cy_beta_dot=2.0)[0])
    close(free(Change(aero=terms[1:])), flown(cn_beta_dot=0.5)[0])


def test_a_lag_and_a_mode_of_effects():
    tau, wn, zeta = 0.2, 8.0, 0.4
    lag = StateTerm("late", "lag", "beta", tau)
    mode = StateTerm("bend", "mode", "aileron", 1.0 / wn, zeta)
    change = Change(
        states=(lag, mode),
        aero=(AeroTerm("Cn", "late", "linear", 0.1), AeroTerm("Cl", "bend", "linear", -0.03)),
    )
    states = (
        (START[0], lambda s: (s["beta"] - s["x"][0]) / tau),
        (aileron(0.0), lambda s: s["x"][2]),
        (0.0, lambda s: wn**2 * (s["aileron"] - s["x"][1]) - 2.0 * zeta * wn * s["x"][2]),
    )
    expected, *_ = flown(states=states, more=lambda s: np.array([0.0, -0.03 * s["x"][1], 0.1 * s["x"][0]]))
    close(free(change), expected)


def test_a_delay_and_a_lag_of_each_surface():
    late, tau = 0.06, 0.05
    change = Change(surface=(SurfaceTerm("delay", late, "aileron"), SurfaceTerm("lag", tau, "rudder")))
    gain, phase = 1.0 / np.hypot(1.0, 2.0 * tau), np.arctan(2.0 * tau)

    def rudder_behind(
        t,
    ):  # steady answer to 3 deg sin(2 t + 1), and what decays from equilibrium at the start
        steady = 3.0 * DEG * gain * np.sin(2.0 * t + 1.0 - phase)
        return steady + (rudder(0.0) - 3.0 * DEG * gain * np.sin(1.0 - phase)) * np.exp(-t / tau)

    expected, *_ = flown(surfaces=(lambda t: aileron(max(t - late, 0.0)), rudder_behind))
    close(free(change), expected, 1e-5)


# -- sensors


def test_position_scale_and_bias_of_the_sensors():
    x, path, dots = flown()
    q = SMOOTH["q"](np.arange(SAMPLES) * lr.DT)
    v = SMOOTH["v"](np.arange(SAMPLES) * lr.DT)
    p, r = path[:, 1], path[:, 2]
    expected = x.copy()
    expected[:, 0] += (0.6 * r - 0.2 * p) / v
    expected[:, 1] *= 1.1
    expected[:, 4] += 0.4 * (dots[:, 2] + p * q) - 0.3 * (dots[:, 1] - q * r)
    expected[:, 3] += 0.01
    terms = (
        *(SensorTerm("beta_rad", "arm", 0.6), SensorTerm("beta_rad", "arm_down", 0.2)),
        *(SensorTerm("p_rad_s", "scale", 1.1), SensorTerm("phi_rad", "bias", 0.01)),
        *(SensorTerm("ay_m_s2", "arm", 0.4), SensorTerm("ay_m_s2", "arm_down", 0.3)),
    )
    close(free(Change(sensors=terms)), expected)


def test_a_lag_and_a_delay_of_sensors():
    tau, late = 0.05, 0.04
    fine = 20
    t = np.arange((SAMPLES - 1) * fine + 1) * lr.DT / fine
    x, *_ = flown()
    spline = CubicSpline(np.arange(SAMPLES) * lr.DT, x)
    behind = [x[0, 0]]
    for one in range(1, t.size):
        step = t[one] - t[one - 1]
        middle = spline(0.5 * (t[one] + t[one - 1]))[0]
        behind.append(middle + (behind[-1] - middle) * np.exp(-step / tau))
    found = free(Change(sensors=(SensorTerm("beta_rad", "lag", tau), SensorTerm("r_rad_s", "delay", late))))
    scale = np.abs(x).max(axis=0)
    assert np.abs(found[:, 0] - np.array(behind)[::fine]).max() < 1e-4 * scale[0]
    # from rest on: the delay starts in equilibrium
    later = np.arange(30, SAMPLES)
    delayed = spline(later * lr.DT - late)[:, 2]
    assert np.abs(found[later, 2] - delayed).max() < 1e-3 * scale[2]


def test_readings_and_the_roll_arm_of_the_alpha_vane():
    reading = Change(readings=(ReadingTerm("beta_rad", "rudder", "linear", 0.05),))
    assert free(reading)[:, 0] - free()[:, 0] == pytest.approx(
        0.05 * rudder(np.arange(SAMPLES) * lr.DT), abs=1e-9
    )
    rate = 0.3
    one = lr.record(np.tile([0.0, rate, 0.0, 0.0, 0.0], (SAMPLES, 1)), 0.0, 0.0)
    given = lr.filter_inputs(one, Change(sensors=(SensorTerm("alpha_rad", "arm_right", 0.8),)))
    assert given.grid.alpha_rad == pytest.approx(lr.ALPHA - rate * 0.8 / lr.V, rel=1e-12)


# -- gusts and gains


def dense(level, rotary, noise=lr.NOISE):
    """Transition, process noise, C and the columns of the surfaces of [beta p r phi, v1 v2, late, p_gust], by hand."""
    c, table = lr.C, lr.TRUTH.reshape(3, 5)
    force, half = 0.5 * lr.DENSITY * lr.V**2 * c.wing_area_m2, 0.5 * c.span_m / lr.V
    ixx, izz, cross = c.inertia_xx_kg_m2, c.inertia_zz_kg_m2, c.inertia_xz_kg_m2
    turn = np.linalg.inv([[ixx, -cross], [-cross, izz]])
    tau, slow = 3.0 * c.span_m / (np.pi * lr.V), 4.0 * c.span_m / (np.pi * lr.V)
    w = np.sqrt(1.5) * np.array([0, 0, 0, 0, 1.0, 1.0 / np.sqrt(3.0) - 1.0, 0, 0])
    side = -level / lr.V * w
    side[0] += 1.0
    p, r = np.zeros(8), np.zeros(8)
    p[1], p[7] = half, -half * rotary * level * roll_deviation_rad_s(1.0, lr.LENGTH, c.span_m)
    r = -half * rotary * level / (lr.V * tau) * (w - np.eye(8)[6])
    r[2] += half
    rows = table[:, :3] @ np.stack([side, p, r])
    a, b = np.zeros((8, 8)), np.zeros((8, 2))
    a[0] = force / (c.mass_kg * lr.V) * rows[0]
    a[0, 1] += np.sin(lr.ALPHA)
    a[0, 2] -= np.cos(lr.ALPHA)
    a[0, 3] = G0 / lr.V * np.cos(lr.ALPHA)
    a[1:3] = force * c.span_m * turn @ rows[1:]
    a[3, 1], a[3, 2] = 1.0, np.tan(lr.ALPHA)
    rate = lr.V / lr.LENGTH
    a[4, 4], a[5, 4], a[5, 5] = -rate, rate, -rate
    a[6] = (w - np.eye(8)[6]) / tau
    a[7, 7] = -1.0 / slow
    b[0] = force / (c.mass_kg * lr.V) * table[0, 3:]
    b[1:3] = force * c.span_m * turn @ table[1:, 3:]
    out, direct = np.zeros((5, 8)), np.zeros((5, 2))
    out[0], out[1:4, 1:4] = side, np.eye(3)
    out[4], direct[4] = force / c.mass_kg * rows[0], force / c.mass_kg * table[0, 3:]
    drive = np.zeros(8)
    drive[4], drive[7] = 2.0 * rate, 2.0 / slow
    return a, b, out, direct, drive


def stepped(a, b, drive, dt):
    """Exact step with straight inputs, and the covariance of its noise (Van Loan)."""
    n, m = b.shape
    whole = np.zeros((n + 2 * m, n + 2 * m))
    whole[:n, :n], whole[:n, n : n + m], whole[n : n + m, n + m :] = a, b, np.eye(m) / dt
    step = expm(whole * dt)
    loan = expm(np.block([[-a, np.diag(drive)], [np.zeros((n, n)), a.T]]) * dt)
    late = step[:n, n + m :]
    return step[:n, :n], step[:n, n : n + m] - late, late, step[:n, :n] @ loan[:n, n:]


def gusty(seed, level=0.8, rotary=1.0):
    """A record of the linear model in gusts, small enough for the nonlinear equations."""
    rng = np.random.default_rng(seed)
    a, b, out, direct, drive = dense(level, rotary)
    phi, early, late, noise = stepped(a, b, drive, lr.DT)
    root = np.linalg.cholesky(noise + 1e-20 * np.eye(8))
    u = 0.02 * np.column_stack([f(np.arange(SAMPLES) * lr.DT) for f in (aileron, rudder)])
    x, y = np.zeros(8), []
    x[4:6] = np.linalg.cholesky([[1.0, 0.5], [0.5, 0.5]]) @ rng.standard_normal(2)
    x[6], x[7] = np.sqrt(1.5) * (x[4] + (1.0 / np.sqrt(3.0) - 1.0) * x[5]), rng.standard_normal()
    first = x.copy()
    for k in range(SAMPLES):
        y.append(out @ x + direct @ u[k] + lr.NOISE * rng.standard_normal(5))
        if k + 1 < SAMPLES:
            x = phi @ x + early @ u[k] + late @ u[k + 1] + root @ rng.standard_normal(8)
    times = np.arange(SAMPLES) * lr.DT
    made_ = lr.record(np.array(y), *(lambda t, i=i: np.interp(t, times, u[:, i]) for i in range(2)), sub=4)
    return made_, u, first


def test_innovations_are_those_of_a_textbook_filter():
    level = 0.8
    record, u, _ = gusty(3, level)
    own = lr.per_record(level=level)
    found = lr.responded(record, common_=lr.common(rotary=0.5), own=own)
    a, b, out, direct, drive = dense(level, 1.0)
    phi, early, late, noise = stepped(a, b, drive, lr.DT)
    p = solve_discrete_are(phi.T, out.T, noise, np.diag(lr.NOISE**2))
    s = out @ p @ out.T + np.diag(lr.NOISE**2)
    gain = p @ out.T @ np.linalg.inv(s)
    x, expected = np.zeros(8), []
    for k in range(SAMPLES):
        e = record.signals.y[k] - out @ x - direct @ u[k]
        expected.append(e)
        if k + 1 < SAMPLES:
            x = phi @ (x + gain @ e) + early @ u[k] + late @ u[k + 1]
    deviation = np.sqrt(np.diag(s))
    assert np.abs((found.covariance - s) / np.outer(deviation, deviation)).max() < 2e-3
    # the equations bend: angles of some degrees in gusts, products of rates
    spread = np.abs(found.e - np.array(expected)).max(axis=0) / np.sqrt(np.diag(s))
    assert spread.max() < 0.05


@pytest.mark.parametrize("rotary", [0.0, 1.0])
def test_innovations_of_a_true_model_are_white_and_of_the_stated_covariance(rotary):
    """20 records of 250 samples: the mean square of 25,000 whitened values is 1 within 4 sqrt(2/25000)."""
    total, lagged = [], []
    for seed in range(20):
        record, _, first = gusty(seed, 0.8, rotary)
        own = lr.per_record(level=0.8, v1=first[4], v2=first[5])
        found = lr.responded(record, common_=lr.common(rotary=rotary - 0.5), own=own)
        white = found.e @ found.white.T
        total.append(white[20:])
        lagged.append(white[21:].T @ white[20:-1])
    values = np.concatenate(total)
    assert (values**2).mean() == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / values.size))
    correlation = np.sum(lagged, axis=0) / len(values)
    assert np.abs(correlation).max() < 5.0 / np.sqrt(len(values))


def test_the_share_of_the_roll_gust_begins_at_a_twentieth():
    """The variance of p is even in the share, so that shares below none are those above it a second time."""
    record = lr.record(np.zeros((50, 5)), 0.0, 0.0)
    own = lr.per_record(level=0.8)
    shares = (-0.2, 0.0, 0.2)
    below, none, above = (
        lr.responded(record, common_=lr.common(rotary=s - 0.5), own=own).covariance[1, 1] for s in shares
    )
    assert below - none == pytest.approx(above - none, rel=0.1)
    assert above > 1.05 * none
    common = lr.LAYOUT.common
    assert common.bounds[common.rotary][0] == -0.45


def test_the_roll_gust_is_driven_and_scaled_as_it_is_flown():
    given, kernel = lr.kernel(made(), common_=lr.common(rotary=0.5), own=lr.per_record(level=0.8))
    process = process_intensity(lr.V, kernel.model)
    slow = 4.0 * lr.C.span_m / (np.pi * given.reference.airspeed_m_s)
    assert process[10] == pytest.approx(2.0 / slow)
    assert process[4] == pytest.approx(2.0 * lr.V / lr.LENGTH)
    assert np.count_nonzero(process) == 2
    assert steady_filter(kernel, given.along) is not None
    n = kernel.model.states.size
    a, c = np.empty((n, n)), np.empty((5, n))
    linearise_at_reference(kernel, a, c)
    assert a[10, 10] == pytest.approx(-1.0 / slow)
