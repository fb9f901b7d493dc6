"""Free runs and innovations of the filter: integration, states of effects, sensors, the steady Kalman filter."""

import math
from dataclasses import replace

import numpy as np
import pytest
import trace_records as tr
from added_signals import Added, flown_with
from scipy.linalg import block_diag

from airtruth.effects.registry import EFFECTS
from airtruth.physics.terms import AeroTerm, Change, ReadingTerm, SensorTerm, StateTerm, SurfaceTerm
from airtruth.tracing.inference.optimise import initial_parameters
from airtruth.tracing.model.linearise import gain
from airtruth.tracing.model.parameters import SHORT_PERIOD
from airtruth.tracing.model.response import LOST, filter_inputs, respond
from airtruth.units import DEG, G0


def test_free_run_is_the_exact_discretisation():
    a, b, c, d = tr.motion()
    expected, _ = tr.run(a, b, c, d, tr.U, tr.DT)
    tr.close(tr.free(), expected, 1e-6)


def test_free_run_converges_with_the_fourth_order_of_runge_kutta():
    expected, _ = tr.run(*tr.motion(), tr.U, tr.DT)
    errors = [np.abs(tr.free(sub=sub) - expected)[:, 0].max() for sub in (2, 4, 8)]
    assert errors[0] < 1e-4 * np.abs(expected[:, 0]).max()
    assert errors[0] / errors[1] == pytest.approx(16.0, rel=0.3)
    assert errors[1] / errors[2] == pytest.approx(16.0, rel=0.3)


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
        drive[1] = tr.HALF
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
        gain = tr.FORCE * tr.C.chord_m / tr.C.inertia_yy_kg_m2 * amplitude
        big[1] += gain * late
        bb[1] += gain * ahead
    else:
        gain = -tr.FORCE / tr.C.mass_kg * amplitude
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
    expected, _ = tr.run(
        *augmented("own", kind, signal, time_s, damping, coefficient, amplitude), tr.U, tr.DT
    )
    tr.close(tr.free(change), expected, 3e-6)
    plain, _ = tr.run(*tr.motion(), tr.U, tr.DT)
    assert np.abs(expected - plain)[:, 1].max() > 3e-4 * np.abs(plain[:, 1]).max()


def test_two_states_do_not_take_each_other_s_place():
    """A mode has two places; a lag that follows it is found behind both."""
    mode, lag = EFFECTS["elastic_mode"], EFFECTS["lift_lag"]
    first = mode.change({"dCmalpha": 0.4, "frequency_hz": 3.0, "damping": 0.1})
    second = lag.change({"dCLalpha": 1.0, "tau_s": 0.2})
    np.testing.assert_allclose(tr.free(first + second), tr.free(second + first), rtol=0.0, atol=1e-14)
    assert np.abs(tr.free(first + second) - tr.free(first)).max() > 1e-9


def play_of(alpha_rad, half_width_rad):
    """The play's definition, sample by sample."""
    x = [alpha_rad[0]]
    for s in alpha_rad[1:]:
        x.append(min(max(x[-1], s - half_width_rad), s + half_width_rad))
    return np.array(x)


@pytest.mark.parametrize("share", [0.05, 0.3])
def test_friction_of_the_vane_is_a_play_of_the_angle_of_attack(share):
    """The motion does not feel the vane, so that its reading is the play of the reading without friction."""
    plain = tr.free()
    swing = np.ptp(plain[:, 0])
    state = StateTerm("own", "play", "alpha", half_width=share * swing)
    pieces = (
        ReadingTerm("alpha_rad", "own", "linear", 1.0),
        ReadingTerm("alpha_rad", "alpha", "linear", -1.0),
    )
    rubbing = tr.free(Change(states=(state,), readings=pieces))
    np.testing.assert_allclose(rubbing[:, 1:], plain[:, 1:], rtol=0.0, atol=1e-14 * swing)
    # it turns between samples, and the play of the samples turns at one of them
    expected = play_of(plain[:, 0], share * swing)
    np.testing.assert_allclose(rubbing[:, 0], expected, rtol=0.0, atol=0.01 * swing)


def test_a_play_without_a_width_is_its_signal():
    """It moves once in a step of integration, so that its error falls with the step."""
    amplitude, plain = 0.3, tr.free(sub=16)
    terms = (AeroTerm("Cm", "own", "linear", amplitude), AeroTerm("Cm", "alpha", "linear", -amplitude))
    none = Change(states=(StateTerm("own", "play", "alpha", half_width=1e-15),), aero=terms)
    errors = [np.abs(tr.free(none, sub=sub) - plain)[:, 1].max() for sub in (2, 4, 8)]
    assert errors[0] < 0.05 * np.abs(plain[:, 1]).max()
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.2)
    assert errors[1] / errors[2] == pytest.approx(2.0, rel=0.2)


def test_a_play_wider_than_the_motion_rests_at_the_start():
    amplitude = 0.3
    terms = (AeroTerm("Cm", "own", "linear", amplitude), AeroTerm("Cm", "alpha", "linear", -amplitude))
    wide = tr.free(Change(states=(StateTerm("own", "play", "alpha", half_width=1.0),), aero=terms))
    trim = tr.record(np.zeros((len(tr.T), 3)), np.zeros_like).plant.trim_alpha_rad
    start = AeroTerm("Cm", "alpha", "linear", -amplitude, at=trim)
    np.testing.assert_allclose(wide, tr.free(Change(aero=(start,))), rtol=0.0, atol=1e-12)


# -- sensors of a known motion

FINE_STEPS = 20


def known():
    """The exact motion every DT/FINE_STEPS from half a second before the record."""
    t = np.arange(-25 * FINE_STEPS, 150 * FINE_STEPS + 1) * tr.DT / FINE_STEPS
    y, x = tr.run(*tr.motion(), tr.doublet(t, tr.SMALL), tr.DT / FINE_STEPS)
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
    y, x = tr.run(a, b, c, d, tr.U, tr.DT)
    q_dot = x @ a[1] + b[1] * tr.U
    expected = np.column_stack(
        [1.1 * (y[:, 0] - 0.8 / tr.V * y[:, 1]), 0.9 * y[:, 1], 1.05 * (y[:, 2] + 0.3 * q_dot)]
    )
    tr.close(tr.free(change), expected, 1e-6)


def test_a_late_reading_of_the_surface_is_an_early_surface():
    """An elevator that is recorded 40 ms late and acts 40 ms late is the recorded one; the reading alone is 40 ms ahead."""
    sensor, surface = SensorTerm("elevator_rad", "delay", 0.04), SurfaceTerm("delay", 0.04)
    np.testing.assert_allclose(
        tr.free(Change(sensors=(sensor,), surface=(surface,))), tr.free(Change()), atol=1e-12
    )
    early = tr.free(Change(surface=(SurfaceTerm("delay", -0.04),)))
    np.testing.assert_array_equal(tr.free(Change(sensors=(sensor,))), early)


def test_the_position_error_of_the_airspeed_is_taken_out_of_the_dynamic_pressure():
    """By hand: alpha of -0.1, 0, 0.1 rad about its mean and a slope of 0.5: readings of 0.95, 1, 1.05 V are V."""
    y = np.zeros((3, 3))
    y[:, 0] = 0.02 + np.array([-0.1, 0.0, 0.1])
    speed = np.interp(np.arange(5) / 2, np.arange(3), tr.V * np.array([0.95, 1.0, 1.05]))
    made = tr.record(y, 0.0)
    made = replace(made, signals=replace(made.signals, airspeed_m_s=speed))
    change = Change(sensors=(SensorTerm("airspeed_m_s", "alpha_slope", 0.5),))
    grid = filter_inputs(made, change).grid
    np.testing.assert_allclose(grid.airspeed_m_s, tr.V, rtol=1e-14)
    np.testing.assert_allclose(grid.qbar_pa, 0.5 * tr.DENSITY * tr.V**2, rtol=1e-14)


def test_bias_adds_after_all():
    made = tr.record(np.zeros((5, 3)), 0.0)
    change = Change(sensors=(SensorTerm("alpha_rad", "bias", 0.01), SensorTerm("alpha_rad", "scale", 2.0)))
    common, per_record = tr.still()
    y = -respond(made, tr.SETTINGS, change, common, per_record, free_run=True).e
    np.testing.assert_allclose(y[:, 0], 0.01, atol=1e-12)


@pytest.mark.parametrize("sub", [2, 8])
@pytest.mark.parametrize("delay", [0.004, 0.013, 0.02, 0.051])
def test_delayed_sensors(delay, sub):
    """The motion so much earlier, from its own fine grid.

    The filter takes the signal as linear over a quarter of a step of 20 or 5 ms: at the corners of the doublet, which az has
    from the elevator, that is 0.2 %. With half a step the pitch rate is off by 6e-4 at 20 ms.
    """
    change = Change(sensors=tuple(SensorTerm(c, "delay", delay) for c in ("alpha_rad", "q_rad_s", "az_m_s2")))
    t, y, _ = known()
    shift = round(delay / tr.DT * FINE_STEPS)
    assert shift * tr.DT / FINE_STEPS == pytest.approx(delay)
    expected = sampled(t, np.roll(y, shift, axis=0))
    tr.close(tr.free(change, sub=sub)[:, :2], expected[:, :2], 2e-4)
    tr.close(tr.free(change, sub=sub), expected, 3e-3 if sub == 2 else 5e-4)


def test_a_delay_comes_after_a_lag():
    """Both in one sensor: the lagged signal, late."""
    lag, delay = SensorTerm("q_rad_s", "lag", 0.05), SensorTerm("q_rad_s", "delay", 0.03)
    a, b, _, _ = tr.motion()
    big, bb, cc = np.zeros((9, 9)), np.append(b, 0.0), np.zeros((1, 9))
    big[:8, :8], big[8, 1], big[8, 8], cc[0, 8] = a, 20.0, -20.0, 1.0
    t = known()[0]
    lagged, _ = tr.run(big, bb, cc, np.zeros(1), tr.doublet(t, tr.SMALL), tr.DT / FINE_STEPS)
    expected = sampled(t, np.roll(lagged, round(0.03 / tr.DT * FINE_STEPS), axis=0))
    for terms in ((lag, delay), (delay, lag)):
        tr.close(tr.free(Change(sensors=terms))[:, 1:2], expected, 3e-4)


@pytest.mark.parametrize("lag", [0.005, 0.03, 0.2])
def test_lagging_sensors(lag):
    """tau y' = x - y as further states of the exact discretisation.

    The filter takes the signal as linear over a quarter of a step h: w^2 h^2/192 of it at 7 rad/s and 5 ms is 6e-6.
    """
    change = Change(sensors=tuple(SensorTerm(c, "lag", lag) for c in ("alpha_rad", "q_rad_s", "az_m_s2")))
    a, b, c, d = tr.motion()
    big, bb, cc = np.zeros((11, 11)), np.concatenate([b, d / lag]), np.zeros((3, 11))
    big[:8, :8], big[8:, :8], big[8:, 8:], cc[:, 8:] = a, c / lag, -np.eye(3) / lag, np.eye(3)
    expected, _ = tr.run(big, bb, cc, np.zeros(3), tr.U, tr.DT)
    tr.close(tr.free(change)[:, :2], expected[:, :2], 1e-5)
    tr.close(tr.free(change), expected, 1e-4)


# -- innovations


@pytest.mark.parametrize("shares", [(0.0, 0.0, 0.0), (0.5, 0.0, 0.3)])
def test_innovations_are_those_of_the_steady_kalman_filter(shares):
    """A noisy record through x+ = phi x + ..., x <- x + K e with the DARE's gain, correlated noise among the states."""
    rng = np.random.default_rng(5)
    made = tr.fly(rng, sigma_w=0.3, amplitude=0.5 * DEG)
    common, per_record = tr.still()
    per_record[SHORT_PERIOD.per_record.log_gust] = np.log(0.3)
    common[SHORT_PERIOD.common.colour] = [*shares, np.log(0.08 / 0.1)]
    found = respond(made, tr.SETTINGS, Change(), common, per_record)
    a, b, c, d = tr.motion(sigma_w=0.3)
    variance = tr.SETTINGS.noise**2
    colour = np.array([*np.sqrt(variance * shares), 0.08])
    if any(shares):
        a, b = block_diag(a, -np.eye(3) / 0.08), np.append(b, np.zeros(3))
        c = np.hstack([c, np.diag(colour[:3])])
    drive = np.zeros(len(a))
    drive[2] = 2.0 * tr.V / tr.LENGTH_W
    drive[8:] = 2.0 / 0.08
    k_gain, _, _, _ = gain(a, c, drive, variance * (1.0 - np.array(shares)), tr.DT)
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


@pytest.mark.parametrize("free_run", [True, False])
def test_a_part_of_a_record_remembers_what_came_before(free_run):
    """Cut in the middle of a doublet, behind a late surface and slow sensors: the residuals are those of the whole record."""
    whole = tr.fly(np.random.default_rng(7), sigma_w=0.3, amplitude=DEG)
    part = replace(whole, signals=whole.signals.part("part", 0, 45, whole.samples))
    sensors = (SensorTerm("q_rad_s", "lag", 0.3), SensorTerm("az_m_s2", "delay", 0.05))
    change = Change(sensors=sensors, surface=(SurfaceTerm("delay", 0.065), SurfaceTerm("lag", 0.05)))
    common, per_record = tr.still()
    found, expected = (
        respond(r, tr.SETTINGS, change, common, per_record, free_run=free_run).e for r in (part, whole)
    )
    assert part.samples == len(found) == whole.samples - 45
    np.testing.assert_array_equal(found, expected[45:])


def test_signals_of_a_part_act_in_the_part():
    """Increments of lift and moment and of a reading over the part alone: those of the whole record with zeros before it."""
    whole = tr.fly(np.random.default_rng(8), sigma_w=0.0, amplitude=DEG)
    part = replace(whole, signals=whole.signals.part("part", 0, 45, whole.samples))
    rng = np.random.default_rng(9)
    points, sub = (part.samples - 1) * whole.signals.sub + 1, whole.signals.sub
    more = Added(1e-3 * rng.standard_normal((2, points)), 1e-3 * rng.standard_normal((part.samples, 3)))
    padded = Added(
        np.pad(more.force, ((0, 0), (45 * sub, 0))),
        np.pad(more.output, ((45, 0), (0, 0))),
    )
    common, per_record = tr.still()
    found, expected = (
        flown_with(e, filter_inputs(r, Change()), tr.SETTINGS, common, per_record, free_run=True)
        for r, e in ((part, more), (whole, padded))
    )
    np.testing.assert_array_equal(found, expected[45:])


@pytest.mark.parametrize("share", [0.0, 0.5])
def test_innovations_of_a_true_model_are_white_and_of_the_stated_covariance(share):
    """20 records of 200 samples: the mean square of 12 000 whitened values is 1 within 4 sqrt(2/12000)."""
    rng = np.random.default_rng(6)
    common, per_record = tr.still()
    per_record[SHORT_PERIOD.per_record.log_gust] = np.log(0.3)
    common[SHORT_PERIOD.common.colour] = [share, share, share, np.log(0.08 / 0.1)]
    whitened = []
    for _ in range(20):
        made = tr.fly(rng, sigma_w=0.3, amplitude=DEG, slow_share=share)
        found = respond(made, tr.SETTINGS, Change(), common, per_record)
        whitened.append(found.e[20:] @ found.white.T)  # the filter starts at the trim, the air does not
    r = np.array(whitened)
    draws = r.size
    assert np.mean(r**2) == pytest.approx(1.0, abs=4.0 * math.sqrt(2.0 / draws))
    lagged = np.einsum("nki,nkj->ij", r[:, 1:], r[:, :-1]) / (draws / 3.0)
    assert np.abs(lagged).max() < 4.0 / math.sqrt(draws / 3.0)


def test_a_lost_motion_leaves_no_sample_undefined():
    """An aircraft that diverges: the residuals after the loss are a constant, and the same at each call."""
    one = tr.fly(np.random.default_rng(2), amplitude=2.0 * DEG, sigma_w=0.0, name="a")
    problem = tr.problem([one])
    start = initial_parameters(problem, tr.NOTHING)
    start.common[SHORT_PERIOD.common.derivatives] += [0.0, 0.0, 0.0, 0.0, 1e4, 0.0]
    runs = [
        respond(one, problem.settings, Change(), start.common, start.per_record[0], free_run=True).e
        for _ in range(2)
    ]
    assert (runs[0][-1] == LOST).all()
    np.testing.assert_array_equal(*runs)


# -- az behind a break of the lift curve


def over_break(slope):
    """A plant whose lift has another slope beyond 0.5 deg; moment and pitch rate as in the linear one."""
    base = tr.plant()
    (table,) = base.tables
    axis = np.array([-1.0, 0.5 * DEG, 1.0])
    values = np.repeat(table.values[:1], 3, axis=0)
    for i, alpha in enumerate(axis):
        share = 0.5 * (alpha + 1.0)
        values[i] = (1.0 - share) * table.values[0] + share * table.values[1]
    values[2, ..., 1] -= (slope - tr.TRUTH[0]) * (1.0 - 0.5 * DEG) * tr.C.wing_area_m2
    bent = replace(table, axes=(axis, *table.axes[1:]), values=values)
    return replace(base, tables=(bent,), constant=np.zeros((3, 3)))


def whitened_az(slope, vane_std_rad, change=None, shown=1.0):
    """Whitened innovation of az where a gust moves alpha from 0 to 1 deg, and az shows a share of the lift curve there."""
    settings = replace(tr.SETTINGS, noise=np.array([vane_std_rad, *tr.SETTINGS.noise[1:]]))
    y = np.zeros((20, 3))
    lift = -0.5 * tr.DENSITY * tr.V**2 * tr.C.wing_area_m2 / tr.C.mass_kg
    y[:, 2] = -G0
    y[-1, 0] = 1.0 * DEG
    y[-1, 2] += shown * lift * (tr.TRUTH[0] + slope) * 0.5 * DEG
    common, per_record = tr.still()
    common[SHORT_PERIOD.common.rotary] = -0.5
    per_record[SHORT_PERIOD.per_record.log_gust] = np.log(1.0)
    flown = respond(
        tr.record(y, 0.0, plant_=over_break(slope)), settings, change or Change(), common, per_record
    )
    return float((flown.e @ flown.white.T)[-1, 2])


@pytest.mark.parametrize("slope", [1.0, tr.TRUTH[0], 8.0])
def test_az_is_predicted_at_the_angle_of_attack_that_the_vane_has_measured(slope):
    """A vane of 0.001 deg: the lift curve beyond its break is the one that counts.

    Predicted from before the gust, az would be off by half a degree of the change of slope: 2.4 m/s2 or 49 standard deviations
    of the accelerometer for a slope of 1.
    """
    assert abs(whitened_az(slope, 0.001 * DEG)) < 0.25


@pytest.mark.parametrize("slope", [1.0, tr.TRUTH[0], 8.0])
@pytest.mark.parametrize("kind", ["lag", "delay"])
def test_an_accelerometer_that_is_hardly_late_is_as_one_in_time(slope, kind):
    """A lag or delay of 1 us: the innovation is continuous where the effect begins, also behind a break."""
    late = Change(sensors=(SensorTerm("az_m_s2", kind, 1e-6),))
    in_time = whitened_az(slope, 0.001 * DEG)
    assert whitened_az(slope, 0.001 * DEG, late) == pytest.approx(in_time, abs=5e-3)


@pytest.mark.parametrize("slope", [1.0, tr.TRUTH[0], 8.0])
def test_an_accelerometer_three_samples_late_does_not_show_the_last_gust(slope):
    """Its reading is still that of level flight, whatever the lift curve is where the gust has moved alpha."""
    late = Change(sensors=(SensorTerm("az_m_s2", "delay", 3.0 * tr.DT),))
    assert abs(whitened_az(slope, 0.001 * DEG, late, shown=0.0)) < 0.25


def test_a_straight_lift_curve_has_the_innovations_of_a_linear_filter():
    """The same record through the linear plant, whose filter is tested above against an independent Kalman filter."""
    straight = whitened_az(tr.TRUTH[0], tr.SETTINGS.noise[0])
    settings = tr.SETTINGS
    y = np.zeros((20, 3))
    y[:, 2] = -G0
    y[-1, 0] = 1.0 * DEG
    y[-1, 2] -= 0.5 * tr.DENSITY * tr.V**2 * tr.C.wing_area_m2 / tr.C.mass_kg * tr.TRUTH[0] * DEG
    common, per_record = tr.still()
    common[SHORT_PERIOD.common.rotary] = -0.5
    per_record[SHORT_PERIOD.per_record.log_gust] = np.log(1.0)
    linear = respond(tr.record(y, 0.0), settings, Change(), common, per_record)
    assert straight == pytest.approx(float((linear.e @ linear.white.T)[-1, 2]), abs=1e-6)
