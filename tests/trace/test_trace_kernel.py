"""The filter's motion, sensors, gain and linearisation against independent calculations."""

import math

import numpy as np
import pytest
import trace_records as tr
from scipy.integrate import solve_ivp
from scipy.linalg import block_diag, expm, solve_discrete_are

from airtruth.effects.change import AeroTerm, Change, DeclaredTerm, SensorTerm, StateTerm
from airtruth.effects.library import EFFECTS
from airtruth.trace import kernel
from airtruth.trace.lower import lower
from airtruth.trace.model import COLOUR, SHARED, respond, shared_prior
from airtruth.trace.plant import Plant
from airtruth.units import DEG, G0

SMALL = 1e-6 * DEG
"""Elevator so small that the filter's sines and cosines are straight to 1e-9."""
SUB = 8
T = np.arange(151) * tr.DT
U = tr.doublet(T, SMALL)
ARMS, ONES = np.zeros(3), np.ones(3)


def free(change=None, sub=SUB, amplitude=SMALL):
    """Outputs of a free run from the trim, deviations from its first sample."""
    made = tr.record(np.zeros((len(T), 3)), lambda t: tr.doublet(t, amplitude), sub=sub)
    shared, local = tr.still()
    y = -respond(made, tr.SETTINGS, change or Change(), shared, local, free_run=True).e
    return y - y[0]


def close(found, expected, tolerance):
    """Largest difference of a channel over its largest value."""
    error = np.abs(found - expected).max(axis=0) / np.abs(expected).max(axis=0)
    assert (error < tolerance).all(), error


def test_free_run_is_the_exact_discretisation():
    a, b, c, d = tr.motion()
    expected, _ = tr.run(a, b, c, d, U, tr.DT)
    close(free(), expected, 1e-6)


def test_free_run_converges_with_the_fourth_order_of_runge_kutta():
    expected, _ = tr.run(*tr.motion(), U, tr.DT)
    errors = [np.abs(free(sub=sub) - expected)[:, 0].max() for sub in (2, 4, 8)]
    assert errors[0] < 1e-4 * np.abs(expected[:, 0]).max()
    assert errors[0] / errors[1] == pytest.approx(16.0, rel=0.3)
    assert errors[1] / errors[2] == pytest.approx(16.0, rel=0.3)


# -- nonlinear motion


def curved():
    """A plant whose tables are one cell, so that forces are smooth products of the three signals."""
    rng = np.random.default_rng(3)
    base = tr.plant().values
    values = base * (1.0 + 0.2 * rng.standard_normal(base.shape))
    values[..., 0] = -0.05 + 0.02 * rng.standard_normal((2, 2, 2))
    values[..., 1] = base[..., 1] + 0.3 * rng.standard_normal((2, 2, 2))
    values[..., 2] = base[..., 2] + 0.02 * rng.standard_normal((2, 2, 2))
    axis = np.array([-1.0, 1.0])
    return Plant(
        tr.GTM,
        axis,
        axis,
        axis,
        values,
        np.array([30.0, -4.0, 1.5]),
        0.02,
        -0.01,
        -0.004,
        0.0,
        np.array([25.0, 0.02]),
        tr.TRUTH,
        tr.plant().derivative_cov,
        None,
    )


def forces(plant, alpha, surface, qhat):
    """Trilinear products over axes of -1 and 1."""
    share = [0.5 * (1.0 + s) for s in (alpha, surface, qhat)]
    f = np.zeros(3)
    for i in (0, 1):
        for j in (0, 1):
            for n in (0, 1):
                weights = [s if k else 1.0 - s for s, k in zip(share, (i, j, n), strict=True)]
                f += math.prod(weights) * plant.values[i, j, n]
    return f


def test_nonlinear_free_run_against_dop853():
    """Varying airspeed, density, attitude and speed over ground, declared changes, increments, offsets, biases."""
    plant = curved()
    mass, inertia, factor, cg, arm = 1.1, 0.9, 1.2, 0.03, 0.1
    change = Change(
        declared=(
            DeclaredTerm("mass", mass),
            DeclaredTerm("inertia", inertia),
            DeclaredTerm("elevator", factor),
            DeclaredTerm("cg", cg),
            DeclaredTerm("thrust_arm", arm),
        )
    )

    def elevator(t):
        return 0.03 * np.sin(6.0 * t)

    def theta(t):
        return 0.05 + 0.04 * np.sin(2.0 * t)

    def speed(t):
        return 42.0 + 1.5 * np.sin(1.3 * t)

    def ground(t):
        return 41.0 + 0.5 * t

    def density(t):
        return 1.0 - 0.01 * t

    shared, local = tr.still()
    shared[:6] = [0.1, 2.0, -0.05, 0.03, -3.0, 0.1]
    shared[10] = 0.04
    local[:2] = [0.06, -0.1]
    local[4:9] = [0.001, -0.002, 0.05, 0.01, -0.004]
    c = tr.C

    def rates(t, x):
        alpha_ground, q = x
        v, vg = speed(t), ground(t)
        qbar = 0.5 * density(t) * v * v
        alpha = theta(t) - math.asin(vg * math.sin(theta(t) - alpha_ground) / v)
        surface = plant.neutral_elevator_rad + factor * (elevator(t) - plant.neutral_elevator_rad)
        qhat = q * c.chord_m / (2.0 * v)
        fx, fz, fm = qbar * forces(plant, alpha, surface, qhat) + plant.constant * 1.04
        states = np.array([alpha - plant.trim_alpha_rad, qhat, surface - plant.trim_elevator_rad])
        lift = local[7] + shared[:3] @ states
        moment = local[8] + shared[3:6] @ states
        fz -= qbar * c.wing_area_m2 * lift
        fm += (
            qbar * c.wing_area_m2 * c.chord_m * moment
            - cg * c.chord_m * fz  # a CG aft of the forces' old point: nose-up for an upward force
            + (plant.thrust[0] + plant.thrust[1] * qbar) * arm
        )
        m = c.mass_kg * mass
        turn = (fz * math.cos(alpha) - fx * math.sin(alpha)) / (m * vg)
        slope = [q + turn + G0 * math.cos(theta(t) - alpha_ground) / vg, fm / (c.inertia_yy_kg_m2 * inertia)]
        return slope, (alpha, q, fz / m)

    end = 2.0
    t = np.arange(round(end / tr.DT) + 1) * tr.DT
    solved = solve_ivp(
        lambda t, x: rates(t, x)[0], (0.0, end), local[:2], "DOP853", t, rtol=1e-12, atol=1e-14
    )
    expected = np.array([rates(s, x)[1] for s, x in zip(t, solved.y.T, strict=True)]) + local[4:7]
    made = tr.record(
        np.zeros((len(t), 3)), elevator, theta, 16, v=speed, density=density, ground=ground, plant_=plant
    )
    found = -respond(made, tr.SETTINGS, change, shared, local, free_run=True).e
    close(found, expected, 1e-7)


# -- terms of effects, by the rates at one state


def rates_at(change, x=(0.04, 0.3), de=0.05, shared=None):
    low = lower(change)
    states = sum(1 if k == 0 else 2 for k in low.state_index[:, 0])
    state = np.zeros(kernel.CORE + states)
    state[:2] = x
    out = np.zeros(state.size)
    qbar = 0.5 * tr.DENSITY * tr.V**2
    az = kernel.rates(state, de, tr.V, tr.V, qbar, 0.04, 0.0, 0.0, tr.plane(change, shared), out)
    return out, az


FORCE = 0.5 * tr.DENSITY * tr.V**2 * tr.C.wing_area_m2
HALF = 0.5 * tr.C.chord_m / tr.V
VALUES = {"alpha": 0.04, "elevator": 0.05, "qhat": 0.3 * HALF}


@pytest.mark.parametrize("signal", sorted(VALUES))
@pytest.mark.parametrize("shape", ["linear", "quadratic", "above", "below"])
@pytest.mark.parametrize("side", [-0.5, 0.5])
def test_shapes_of_aerodynamic_terms(signal, shape, side):
    at = VALUES[signal] * (1.0 + side)
    s = VALUES[signal] - at
    f = {"linear": s, "quadratic": s * s, "above": max(0.0, s), "below": min(0.0, s)}[shape]
    (plain, az), amplitude = rates_at(Change()), 0.7
    moment, az_moment = rates_at(Change(aero=(AeroTerm("Cm", signal, shape, amplitude, at),)))
    assert moment[1] - plain[1] == pytest.approx(
        FORCE * tr.C.chord_m * amplitude * f / tr.C.inertia_yy_kg_m2, rel=1e-9, abs=1e-12
    )
    assert az_moment == az
    lift, az_lift = rates_at(Change(aero=(AeroTerm("CL", signal, shape, amplitude, at),)))
    assert az_lift - az == pytest.approx(-FORCE * amplitude * f / tr.C.mass_kg, rel=1e-9, abs=1e-12)
    assert lift[0] - plain[0] == pytest.approx(
        -FORCE * amplitude * f * math.cos(0.04) / (tr.C.mass_kg * tr.V), rel=1e-9, abs=1e-13
    )
    assert lift[1] == plain[1]


def test_lift_in_alpha_dot_is_in_proportion_to_the_alpha_dot_that_it_changes():
    amplitude = 12.0
    _, az = rates_at(Change())
    out, az_more = rates_at(Change(aero=(AeroTerm("CL", "alpha_dot_hat", "linear", amplitude),)))
    lift = -(az_more - az) * tr.C.mass_kg / FORCE
    assert lift == pytest.approx(amplitude * out[0] * HALF, rel=1e-9)


def test_moment_in_alpha_dot_takes_the_motion_over_ground():
    plain, _ = rates_at(Change())
    out, _ = rates_at(Change(aero=(AeroTerm("Cm", "alpha_dot_hat", "linear", -9.0),)))
    assert out[0] == plain[0]
    assert (out[1] - plain[1]) * tr.C.inertia_yy_kg_m2 / (FORCE * tr.C.chord_m) == pytest.approx(
        -9.0 * plain[0] * HALF, rel=1e-9
    )


def test_declared_terms_at_one_state():
    plain, az = rates_at(Change())
    heavy, az_heavy = rates_at(Change(declared=(DeclaredTerm("mass", 1.25),)))
    assert az_heavy == pytest.approx(az / 1.25, rel=1e-12)
    assert heavy[1] == plain[1]
    inert, _ = rates_at(Change(declared=(DeclaredTerm("inertia", 0.8),)))
    assert inert[1] == pytest.approx(plain[1] / 0.8, rel=1e-12)
    twice, _ = rates_at(Change(declared=(DeclaredTerm("mass", 1.25), DeclaredTerm("mass", 0.8))))
    np.testing.assert_allclose(twice, plain, rtol=1e-12)


# -- effects with states, exactly


def augmented(name, kind, signal, time_s, damping, coefficient, amplitude):
    """Linear system with an effect's state: coefficient += amplitude (x - signal)."""
    a, b, c, d = tr.motion()
    extra = 1 if kind == "lag" else 2
    n = 8 + extra
    big, bb, cc = np.zeros((n, n)), np.zeros(n), np.zeros((3, n))
    big[:8, :8], bb[:8], cc[:, :8] = a, b, c
    drive, direct = np.zeros(n), 0.0
    if signal == "alpha":
        drive[0] = 1.0
    elif signal == "elevator":
        direct = 1.0
    elif signal == "qhat":
        drive[1] = HALF
    if kind == "lag":
        big[8] = drive / time_s
        big[8, 8], bb[8] = -1.0 / time_s, direct / time_s
    else:
        wn = 1.0 / time_s
        big[8, 9], big[9] = 1.0, wn * wn * drive
        big[9, 8], big[9, 9], bb[9] = -wn * wn, -2.0 * damping * wn, wn * wn * direct
    late, ahead = -drive, -direct
    late[8] = 1.0
    if coefficient == "Cm":
        gain = FORCE * tr.C.chord_m / tr.C.inertia_yy_kg_m2 * amplitude
        big[1] += gain * late
        bb[1] += gain * ahead
    else:
        gain = -FORCE / tr.C.mass_kg * amplitude
        big[0] += gain / tr.V * late
        bb[0] += gain / tr.V * ahead
        cc[2] += gain * late
        d = d + np.array([0.0, 0.0, gain * ahead])
    return big, bb, cc, d


@pytest.mark.parametrize("coefficient", ["CL", "Cm"])
@pytest.mark.parametrize("signal", ["alpha", "elevator", "qhat"])
@pytest.mark.parametrize(("kind", "time_s", "damping"), [("lag", 0.15, 0.0), ("mode", 0.05, 0.1)])
def test_states_of_effects(coefficient, signal, kind, time_s, damping):
    amplitude = 3.0 if signal == "qhat" else 0.4
    change = Change(
        states=(StateTerm("own", kind, signal, time_s, damping),),
        aero=(
            AeroTerm(coefficient, "own", "linear", amplitude),
            AeroTerm(coefficient, signal, "linear", -amplitude),
        ),
    )
    expected, _ = tr.run(*augmented("own", kind, signal, time_s, damping, coefficient, amplitude), U, tr.DT)
    close(free(change), expected, 3e-6)
    plain, _ = tr.run(*tr.motion(), U, tr.DT)
    assert np.abs(expected - plain)[:, 1].max() > 3e-4 * np.abs(plain[:, 1]).max()


def test_two_states_do_not_take_each_other_s_place():
    """A mode has two places; a lag that follows it is found behind both."""
    mode, lag = EFFECTS["elastic_mode"], EFFECTS["lift_lag"]
    first = mode.change({"dCmalpha": 0.4, "frequency_hz": 3.0, "damping": 0.1})
    second = lag.change({"dCLalpha": 1.0, "tau_s": 0.2})
    np.testing.assert_allclose(free(first + second), free(second + first), rtol=0.0, atol=1e-14)
    assert np.abs(free(first + second) - free(first)).max() > 1e-9


# -- sensors of a known motion

FINE_STEPS = 20


def known():
    """The exact motion every DT/FINE_STEPS from half a second before the record."""
    t = np.arange(-25 * FINE_STEPS, 150 * FINE_STEPS + 1) * tr.DT / FINE_STEPS
    y, x = tr.run(*tr.motion(), tr.doublet(t, SMALL), tr.DT / FINE_STEPS)
    return t, y, x


def sampled(t, y):
    return y[25 * FINE_STEPS :: FINE_STEPS]


def test_scales_and_arms():
    """alpha - q x/V, az - x q_dot with q_dot of the equation of motion; then the scale."""
    change = Change(
        sensors=(
            SensorTerm("alpha_rad", "arm", 0.8),
            SensorTerm("az_m_s2", "arm", -0.3),
            SensorTerm("alpha_rad", "scale", 1.1),
            SensorTerm("q_rad_s", "scale", 0.9),
            SensorTerm("az_m_s2", "scale", 1.05),
        )
    )
    a, b, c, d = tr.motion()
    y, x = tr.run(a, b, c, d, U, tr.DT)
    q_dot = x @ a[1] + b[1] * U
    expected = np.column_stack(
        [1.1 * (y[:, 0] - 0.8 / tr.V * y[:, 1]), 0.9 * y[:, 1], 1.05 * (y[:, 2] + 0.3 * q_dot)]
    )
    close(free(change), expected, 1e-6)


def test_bias_adds_after_all():
    made = tr.record(np.zeros((5, 3)), 0.0)
    change = Change(sensors=(SensorTerm("alpha_rad", "bias", 0.01), SensorTerm("alpha_rad", "scale", 2.0)))
    shared, local = tr.still()
    y = -respond(made, tr.SETTINGS, change, shared, local, free_run=True).e
    np.testing.assert_allclose(y[:, 0], 0.01, atol=1e-12)


@pytest.mark.parametrize("delay", [0.004, 0.013, 0.02, 0.051])
def test_delayed_sensors(delay):
    """The motion so much earlier, from its own fine grid.

    The filter takes the signal as linear over half a step: at the corners of the doublet, which az has from the
    elevator, that is 0.1 %.
    """
    change = Change(sensors=tuple(SensorTerm(c, "delay", delay) for c in ("alpha_rad", "q_rad_s", "az_m_s2")))
    t, y, _ = known()
    shift = round(delay / tr.DT * FINE_STEPS)
    assert shift * tr.DT / FINE_STEPS == pytest.approx(delay)
    expected = sampled(t, np.roll(y, shift, axis=0))
    close(free(change)[:, :2], expected[:, :2], 3e-4)
    close(free(change), expected, 2e-3)


def test_a_delay_comes_after_a_lag():
    """Both in one sensor: the lagged signal, late."""
    lag, delay = SensorTerm("q_rad_s", "lag", 0.05), SensorTerm("q_rad_s", "delay", 0.03)
    a, b, _, _ = tr.motion()
    big, bb, cc = np.zeros((9, 9)), np.append(b, 0.0), np.zeros((1, 9))
    big[:8, :8], big[8, 1], big[8, 8], cc[0, 8] = a, 20.0, -20.0, 1.0
    t = known()[0]
    lagged, _ = tr.run(big, bb, cc, np.zeros(1), tr.doublet(t, SMALL), tr.DT / FINE_STEPS)
    expected = sampled(t, np.roll(lagged, round(0.03 / tr.DT * FINE_STEPS), axis=0))
    for terms in ((lag, delay), (delay, lag)):
        close(free(Change(sensors=terms))[:, 1:2], expected, 3e-4)


@pytest.mark.parametrize("lag", [0.005, 0.03, 0.2])
def test_lagging_sensors(lag):
    """tau y' = x - y as further states of the exact discretisation.

    The filter takes the signal as linear over half a step h: w^2 h^2/48 of it at 7 rad/s and 5 ms is 3e-5.
    """
    change = Change(sensors=tuple(SensorTerm(c, "lag", lag) for c in ("alpha_rad", "q_rad_s", "az_m_s2")))
    a, b, c, d = tr.motion()
    big, bb, cc = np.zeros((11, 11)), np.concatenate([b, d / lag]), np.zeros((3, 11))
    big[:8, :8], big[8:, :8], big[8:, 8:], cc[:, 8:] = a, c / lag, -np.eye(3) / lag, np.eye(3)
    expected, _ = tr.run(big, bb, cc, np.zeros(3), U, tr.DT)
    close(free(change), expected, 1.2e-4)


# -- gain and linearisation


WHITE = np.array([0.0, 0.0, 0.0, 0.1])
SLOW = np.array([0.7 * tr.SETTINGS.noise[0], 0.0, 0.5 * tr.SETTINGS.noise[2], 0.08])
"""Standard deviations of the sensors' slow noise, and its correlation time [s]."""


def linearised(change=None, lags=None, sigma_w=0.3, delays=None, colour=WHITE):
    low = lower(change or Change())
    motion = kernel.CORE + sum(1 if k == 0 else 2 for k in low.state_index[:, 0])
    lags = np.zeros(3) if lags is None else lags
    delays = np.zeros(3) if delays is None else delays
    n = motion + int((lags > 0.0).sum()) + kernel.DELAY * int((delays > 0.0).sum())
    n += 3 if colour[:3].any() else 0
    a, c = np.empty((n, n)), np.empty((3, n))
    shared, local = tr.still()
    local[9] = np.log(sigma_w)
    plane = tr.plane(change, shared, local)
    kernel.linear(
        np.zeros(n),
        0.0,
        tr.V,
        0.5 * tr.DENSITY * tr.V**2,
        0.0,
        motion,
        lags,
        delays,
        colour,
        plane,
        low.arms,
        low.scales,
        a,
        c,
    )
    return a, c, plane


def test_linearisation_is_the_linear_model_s():
    """Central differences over 0.01 rad: cosines cost h^2/6 of the slope."""
    a, c, _ = linearised()
    expected_a, _, expected_c, _ = tr.motion(sigma_w=0.3)
    scale = np.abs(expected_a).max(axis=1, keepdims=True)
    np.testing.assert_allclose(a / scale, expected_a / scale, atol=1e-4)
    np.testing.assert_allclose(c, expected_c, rtol=1e-4, atol=1e-6)


def test_linearisation_of_lagging_sensors():
    lags = np.array([0.05, 0.0, 0.02])
    a, c, _ = linearised(lags=lags)
    plain_a, plain_c, _ = linearised()
    np.testing.assert_array_equal(a[:8, :8], plain_a)
    np.testing.assert_allclose(a[8], [*plain_c[0] / 0.05, -20.0, 0.0])
    np.testing.assert_allclose(a[9], [*plain_c[2] / 0.02, 0.0, -50.0])
    np.testing.assert_array_equal(c, [[*np.zeros(8), 1, 0], [*plain_c[1], 0, 0], [*np.zeros(8), 0, 1]])


@pytest.mark.parametrize("sigma_w", [0.05, 0.3, 2.0])
@pytest.mark.parametrize("colour", [WHITE, SLOW])
@pytest.mark.parametrize("delays", [np.zeros(3), np.array([0.01, 0.03, 0.0])])
def test_steady_gain_solves_the_riccati_equation(sigma_w, delays, colour):
    """K, S and the whitener against scipy's DARE with Van Loan's noise covariance; delays and slow noise are states of
    their own.
    """
    a, c, plane = linearised(sigma_w=sigma_w, delays=delays, colour=colour)
    variance = tr.SETTINGS.noise**2
    k_gain, white, s, logdet = kernel.gain(a, c, tr.V, plane[0], variance, colour, tr.DT)
    drive = np.zeros(len(a))
    drive[2] = 2.0 * tr.V / tr.LENGTH_W
    if colour is SLOW:
        drive[-3:] = 2.0 / 0.08
    q = tr.noise_step(a, tr.DT, drive)
    p = solve_discrete_are(expm(a * tr.DT).T, c.T, q + 1e-18 * np.eye(len(a)), np.diag(variance))
    expected = c @ p @ c.T + np.diag(variance)
    spread = np.sqrt(np.diag(expected))
    unit = np.outer(spread, spread)
    np.testing.assert_allclose(s / unit, expected / unit, atol=1e-6)
    scale = np.sqrt(np.diag(p))[:, None] / spread
    expected_gain = p @ np.linalg.solve(expected, c).T
    np.testing.assert_allclose(k_gain / scale, expected_gain / scale, atol=1e-5)
    np.testing.assert_allclose(white @ s @ white.T, np.eye(3), atol=1e-12)
    assert logdet == pytest.approx(np.linalg.slogdet(s)[1], rel=1e-12)


def test_linearisation_of_slow_noise():
    """Three states of their own behind the motion's and the sensors'."""
    lags = np.array([0.05, 0.0, 0.0])
    a, c, _ = linearised(lags=lags, colour=SLOW)
    plain_a, plain_c, _ = linearised(lags=lags)
    np.testing.assert_array_equal(a, block_diag(plain_a, -12.5 * np.eye(3)))
    np.testing.assert_array_equal(c, np.hstack([plain_c, np.diag(SLOW[:3])]))


def test_linearisation_of_late_sensors():
    """Transfer functions with and without the delay: their ratio is exp(-s d)."""
    delays = np.array([0.03, 0.0, 0.0])
    a, c, _ = linearised(delays=delays)
    plain_a, plain_c, _ = linearised()
    n = len(a)
    for w in (0.5, 5.0, 20.0):
        s = 1j * w
        late = c[0] @ np.linalg.inv(s * np.eye(n) - a)[:, 1]
        plain = plain_c[0] @ np.linalg.inv(s * np.eye(kernel.CORE) - plain_a)[:, 1]
        assert late / plain == pytest.approx(np.exp(-0.03 * s), abs=1e-9)


@pytest.mark.parametrize(("phase_rad", "error"), [(1.0, 1e-12), (5.0, 1e-6), (8.0, 1e-3), (11.0, 0.02)])
def test_a_delay_is_one_up_to_many_samples(phase_rad, error):
    """exp(-s) itself; and 60 ms at 25 Hz is a phase of 9.4 rad."""
    system = kernel.delayed(0.02)
    taken = np.zeros(kernel.DELAY)
    taken[1::2] = -2.0
    s = 1j * phase_rad / 0.02
    ratio = 1.0 + taken @ np.linalg.solve(s * np.eye(kernel.DELAY) - system[:, :-1], system[:, -1])
    assert abs(ratio) == pytest.approx(1.0, abs=1e-12)
    assert ratio == pytest.approx(np.exp(-1j * phase_rad), abs=error)


def test_a_delay_is_pade_s_approximant():
    """Coefficients (2n - k)! n! / ((2n)! k! (n - k)!) of the diagonal approximant of order n."""
    n = kernel.DELAY
    c = [math.comb(n, k) * math.factorial(2 * n - k) / math.factorial(2 * n) for k in range(n + 1)]
    system = kernel.delayed(1.0)
    poles = np.linalg.eigvals(system[:, :-1])
    roots = np.roots(c[::-1])
    np.testing.assert_allclose(np.sort_complex(poles), np.sort_complex(roots), rtol=1e-8)


@pytest.mark.parametrize("shares", [(0.0, 0.0, 0.0), (0.5, 0.0, 0.3)])
def test_innovations_are_those_of_the_steady_kalman_filter(shares):
    """A noisy record through x+ = phi x + ..., x <- x + K e with the DARE's gain, slow noise among the states."""
    rng = np.random.default_rng(5)
    made = tr.fly(rng, sigma_w=0.3, amplitude=0.5 * DEG)
    shared, local = tr.still()
    local[9] = np.log(0.3)
    shared[list(COLOUR)] = [*shares, np.log(0.08 / 0.1)]
    found = respond(made, tr.SETTINGS, Change(), shared, local)
    a, b, c, d = tr.motion(sigma_w=0.3)
    variance = tr.SETTINGS.noise**2
    colour = np.array([*np.sqrt(variance * shares), 0.08])
    if any(shares):
        a, b = block_diag(a, -np.eye(3) / 0.08), np.append(b, np.zeros(3))
        c = np.hstack([c, np.diag(colour[:3])])
    constants = tr.plane(None, shared, local)[0]
    k_gain, _, _, _ = kernel.gain(a, c, tr.V, constants, variance * (1.0 - np.array(shares)), colour, tr.DT)
    phi, early, late = tr.discrete(a, b, tr.DT)
    t = np.arange(made.samples) * tr.DT
    u = tr.doublet(t, 0.5 * DEG)
    x, expected = np.zeros(len(a)), []
    for k in range(len(t)):
        e = made.signals.y[k] + [0.0, 0.0, G0] - c @ x - d * u[k]
        expected.append(e)
        x = x + k_gain @ e
        if k + 1 < len(t):
            x = phi @ x + early * u[k] + late * u[k + 1]
    # curvature of the sines at half a degree, in units of the innovations' own spread
    error = np.abs(found.e - expected).max(axis=0) / np.sqrt(np.diag(found.covariance))
    assert (error < 0.05).all(), error


@pytest.mark.parametrize("share", [0.0, 0.5])
def test_innovations_of_a_true_model_are_white_and_of_the_stated_covariance(share):
    """20 records of 200 samples: the mean square of 12 000 whitened values is 1 within 4 sqrt(2/12000)."""
    rng = np.random.default_rng(6)
    shared, local = tr.still()
    local[9] = np.log(0.3)
    shared[list(COLOUR)] = [share, share, share, np.log(0.08 / 0.1)]
    whitened = []
    for _ in range(20):
        made = tr.fly(rng, sigma_w=0.3, amplitude=DEG, slow_share=share)
        found = respond(made, tr.SETTINGS, Change(), shared, local)
        whitened.append(found.e[20:] @ found.white.T)  # the filter starts at the trim, the air does not
    r = np.array(whitened)
    draws = r.size
    assert np.mean(r**2) == pytest.approx(1.0, abs=4.0 * math.sqrt(2.0 / draws))
    lagged = np.einsum("nki,nkj->ij", r[:, 1:], r[:, :-1]) / (draws / 3.0)
    assert np.abs(lagged).max() < 4.0 / math.sqrt(draws / 3.0)


# -- gusts


@pytest.mark.parametrize(("rolloff", "tolerance"), [(0.0, 1e-9), (1.0, 0.06)])
def test_spectrum_of_the_gust(rolloff, tolerance):
    """MIL-F-8785C, 3.7.1: Dryden's exactly; von Karman's from 0.5 to 600 rad/s but for the level."""
    shared, local = tr.still()
    shared[SHARED.index("rolloff")] = rolloff - 0.5
    length, v = 840.419, tr.V
    constants = tr.plane(None, shared, local)[0]
    rate = v / length
    a = np.zeros((8, 8))
    a[2, 2], a[3, 2], a[3, 3] = -rate, rate, -rate
    state, out = np.zeros(8), np.zeros(8)
    row = np.zeros(8)
    for i in (2, 3, 5, 6, 7):
        state[:] = 0.0
        state[i] = 1.0
        row[i] = kernel.gust(state, constants)
        kernel.rates(state, 0.0, v, v, 1.0, 0.0, 0.0, 0.0, tr.plane(None, shared, local), out)
        a[5:, i] = out[5:]
    omega = np.geomspace(0.5, 600.0, 200)
    drive = np.zeros(8)
    drive[2] = np.sqrt(2.0 * rate)
    density = np.array([abs(row @ np.linalg.solve(1j * w * np.eye(8) - a, drive)) ** 2 for w in omega])
    x2 = (omega / rate) ** 2
    expected = (1.0 + 3.0 * x2) / (1.0 + x2) ** 2
    if rolloff == 1.0:
        y2 = 1.339**2 * x2
        expected = (1.0 + 8.0 / 3.0 * y2) / (1.0 + y2) ** (11.0 / 6.0)
    off = np.log(density / expected)
    assert np.abs(off - off.mean()).max() < tolerance
    if rolloff == 0.0:  # two-sided over omega: sigma^2 L/V times Dryden's form
        np.testing.assert_allclose(density * rate, expected, rtol=1e-9)


def test_shared_inertia_leaves_the_linear_model_alone():
    """Its derivatives are those of the pitch acceleration, so that only the tables' curvature sees it."""
    shared, local = tr.still()
    shared[:6] = 0.02 * tr.TRUTH
    made = tr.record(np.zeros((len(T), 3)), lambda t: tr.doublet(t, DEG))
    plain = respond(made, tr.SETTINGS, Change(), shared, local, free_run=True).e
    shared[SHARED.index("inertia")] = 0.05
    heavy = respond(made, tr.SETTINGS, Change(), shared, local, free_run=True).e
    close(heavy - heavy[0], plain - plain[0], 1e-9)


def test_shared_inertia_is_the_declared_one_s_factor_with_other_derivatives():
    """On a curved plant: factor 1 + i and, of the moment's derivatives, i of the declared added to the increments."""
    plant = curved()
    made = tr.record(np.zeros((len(T), 3)), lambda t: tr.doublet(t, DEG), plant_=plant)
    shared, local = tr.still()
    shared[SHARED.index("inertia")] = 0.05
    found = respond(made, tr.SETTINGS, Change(), shared, local, free_run=True).e
    by_hand, _ = tr.still()
    by_hand[3:6] = 0.05 * plant.derivatives[3:]
    change = Change(declared=(DeclaredTerm("inertia", 1.05),))
    np.testing.assert_allclose(
        found, respond(made, tr.SETTINGS, change, by_hand, local, free_run=True).e, rtol=1e-12
    )


def test_shared_prior_is_what_is_declared():
    """Covariance of the derivatives as declared; of the inertia too, and between them that of 1/Iyy."""
    plant = tr.plant()
    made = tr.record(np.zeros((len(T), 3)), 0.0, plant_=plant)
    covariance = np.linalg.inv(shared_prior(made, tr.SETTINGS))
    at = SHARED.index("inertia")
    std = tr.GTM.file.mass.inertia_yy.std / tr.GTM.file.mass.inertia_yy.value
    np.testing.assert_allclose(covariance[:6, :6], plant.derivative_cov, rtol=1e-9)
    assert covariance[at, at] == pytest.approx(std**2, rel=1e-9)
    np.testing.assert_allclose(covariance[at, 3:6], -(std**2) * plant.derivatives[3:], rtol=1e-9)
