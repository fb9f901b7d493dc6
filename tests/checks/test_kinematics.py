"""Kinematic consistency: equations against closed forms, known errors found, what is absent said."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from airtruth.checks.kinematics import check_kinematics
from airtruth.checks.kinematics_fit import Fit, fit, limits_of, problem_of
from airtruth.checks.kinematics_lines import lines_of
from airtruth.checks.kinematics_model import ERRORS, LONGITUDINAL, LongitudinalSamples, compare, stacked
from airtruth.checks.kinematics_record import declared_biases, declared_errors
from airtruth.checks.kinematics_search import ErrorSet
from airtruth.checks.kinematics_words import _factors
from airtruth.checks.result import CheckResult, Finding, PossibleCause, tables, undetermined
from airtruth.checks.samples import derivative, earlier, integral, lagged
from airtruth.errors import LogError
from airtruth.logs.flight_log import FlightLog
from airtruth.physics import sensors
from airtruth.physics.sensor_errors import SensorErrors
from airtruth.units import G0

DT = 0.02


def motion(duration_s=10.0, steps=20, gust=None, step_s=0.4):
    """Exact flight of a point with chosen pitch and lift: u, w by the body-axis equations (DOP853).

    u' = ax - g sin(theta) - q w, w' = az + g cos(theta) + q u; q and the specific forces follow an
    elevator through a short period, so that they are smooth and no aerodynamic model is shared.
    """
    fine = DT / steps
    t = np.arange(round(duration_s / fine) + 1) * fine
    elevator = np.zeros_like(t)
    edges = np.cumsum([1.0, 3 * step_s, 2 * step_s, step_s, step_s])
    for i, (a, b) in enumerate(pairwise(edges)):
        elevator[(t >= a - 1e-9) & (t < b - 1e-9)] = 0.03 * (-1.0) ** i
    servo = sensors.lag(elevator, fine, 0.05)
    speed, trim = 60.0, 0.06
    alpha_gust = np.zeros_like(t) if gust is None else gust(t)

    def rates(k, s):
        theta, q, u, w, _ = s
        alpha = np.arctan2(w, u) + alpha_gust[k]
        lift = 0.9 * G0 * (alpha - trim) / 0.06
        az = -G0 * np.cos(trim) - lift
        ax = G0 * np.sin(trim) - 0.3 * (u - speed * np.cos(trim)) * 0.1
        return np.array([
            q,
            -9.0 * (alpha - trim) - 2.5 * q - 14.0 * servo[k],
            ax - G0 * np.sin(theta) - q * w,
            az + G0 * np.cos(theta) + q * u,
            0.0,
        ]), ax, az, alpha  # fmt: skip

    state = np.empty((len(t), 5))
    state[0] = trim, 0.0, speed * np.cos(trim), speed * np.sin(trim), 0.0
    for k in range(len(t) - 1):
        one = rates(k, state[k])[0]
        two = rates(k, state[k] + 0.5 * fine * one)[0]
        three = rates(k, state[k] + 0.5 * fine * two)[0]
        four = rates(min(k + 1, len(t) - 1), state[k] + fine * three)[0]
        state[k + 1] = state[k] + fine / 6.0 * (one + 2.0 * two + 2.0 * three + four)
    out = [rates(k, state[k]) for k in range(0, len(t), steps)]
    keep = slice(None, None, steps)
    theta, q, u, w, _ = state[keep].T
    return {
        "theta_rad": theta,
        "q_rad_s": q,
        "q_dot": np.array([o[0][1] for o in out]),
        "ax_m_s2": np.array([o[1] for o in out]),
        "az_m_s2": np.array([o[2] for o in out]),
        "alpha_rad": np.array([o[3] for o in out]),
        "airspeed_m_s": np.hypot(u, w),
        "elevator_rad": servo[keep],
    }


@pytest.fixture(scope="module")
def true():
    return motion()


def as_log(*parts, leave_out=()):
    names = [n for n in parts[0] if n not in ("q_dot", *leave_out)]
    lengths = [len(p["q_rad_s"]) for p in parts]
    channels = {n: np.concatenate([p[n] for p in parts]) for n in names}
    channels["density_kg_m3"] = np.full(sum(lengths), 1.0)
    return FlightLog(
        metadata={},
        run_ids=tuple(f"r{i}" for i in range(len(parts))),
        offsets=np.cumsum([0, *lengths]).astype(np.int64),
        t_s=np.concatenate([np.arange(n) * DT for n in lengths]),
        channels=channels,
    )


def record(c):
    return LongitudinalSamples(
        "r", DT, c["airspeed_m_s"], c["alpha_rad"], c["q_rad_s"], c["az_m_s2"], c["elevator_rad"],
        c["ax_m_s2"], c["theta_rad"],
    )  # fmt: skip


def measured(true, errors):
    """Readings with instrument errors, made by the sensor equations of physics."""
    e = {n: errors.get(n, error.neutral) for n, error in ERRORS.items()}
    alpha = sensors.vane_equation(true["alpha_rad"], true["q_rad_s"], e["vane_arm"], true["airspeed_m_s"])
    az = sensors.accelerometer_az(true["az_m_s2"], true["q_dot"], e["accelerometer_arm"])

    def late(x, delay, scale, lag=0.0):
        model = SensorErrors(delay_s=delay, scale=scale, lag_s=lag)
        return sensors.measure(model, x[None], DT, np.zeros((1, len(x))))[0]

    return {
        **true,
        "alpha_rad": late(alpha, e["sensor_delay:alpha_rad"], e["vane_scale"], e["vane_lag"]),
        "az_m_s2": late(az, e["sensor_delay:az_m_s2"], e["accelerometer_scale"]),
        "q_rad_s": late(true["q_rad_s"], e["sensor_delay:q_rad_s"], e["gyro_scale"]),
        "theta_rad": late(true["theta_rad"], e["sensor_delay:theta_rad"], 1.0, e["attitude_lag"]),
        "airspeed_m_s": late(
            sensors.at_instrument(
                "airspeed_m_s", true, SensorErrors(alpha_slope_per_rad=e["airspeed_alpha_slope"])
            ),
            e["sensor_delay:airspeed_m_s"],
            e["airspeed_scale"],
        ),
    }


def noisy(channels, seed, size=1.0):
    rng = np.random.default_rng(seed)
    sigma = {
        "alpha_rad": 5e-4,
        "q_rad_s": 2e-3,
        "az_m_s2": 0.05,
        "ax_m_s2": 0.01,
        "theta_rad": 3e-4,
        "airspeed_m_s": 0.03,
    }
    return {n: v + size * sigma.get(n, 0.0) * rng.normal(size=len(v)) for n, v in channels.items()}


@pytest.mark.parametrize("equation", ["theta", "alpha", "airspeed"])
def test_an_exact_flight_obeys_the_equations(equation, true):
    left = compare(record(true), {})[equation]
    reading = true[{"theta": "theta_rad", "alpha": "alpha_rad", "airspeed": "airspeed_m_s"}[equation]]
    # 50 Hz samples of forces with kinks where the servo's command steps: a cubic misses them a little
    assert np.ptp(left) < 2e-3 * np.ptp(reading)


def test_the_motion_itself_agrees_with_an_independent_integration(true):
    t = np.arange(len(true["q_rad_s"])) * DT
    pick = {n: (lambda x, v=v: np.interp(x, t, v)) for n, v in true.items()}

    def rates(x, s):
        theta, u, w = s
        q = pick["q_rad_s"](x)
        return [
            q,
            pick["ax_m_s2"](x) - G0 * np.sin(theta) - q * w,
            pick["az_m_s2"](x) + G0 * np.cos(theta) + q * u,
        ]

    a, v = true["alpha_rad"][0], true["airspeed_m_s"][0]
    out = solve_ivp(
        rates, (0.0, t[-1]), [true["theta_rad"][0], v * np.cos(a), v * np.sin(a)], "DOP853", t, max_step=DT
    )
    np.testing.assert_allclose(out.y[0], true["theta_rad"], atol=2e-4)
    np.testing.assert_allclose(np.arctan2(out.y[2], out.y[1]), true["alpha_rad"], atol=5e-4)
    np.testing.assert_allclose(np.hypot(out.y[1], out.y[2]), true["airspeed_m_s"], atol=0.02)


def test_records_of_one_length_are_compared_as_one(true):
    """Every equation with errors of each kind, to rounding; a longer record and one without theta are apart."""
    one = record(true)
    other = record({n: x[::-1].copy() for n, x in true.items()})
    longer = record({n: np.concatenate([x, x]) for n, x in true.items()})
    lacking = LongitudinalSamples("r", DT, one.airspeed, one.alpha, one.q, one.az, one.elevator, one.ax)
    records = [one, longer, other, lacking]
    every = stacked(records)
    assert [numbers for numbers, _ in every] == [(0, 2), (1,), (3,)]
    errors = {n: error.neutral + 2.5 * error.step for n, error in ERRORS.items()}
    for numbers, stack in every:
        together = compare(stack, errors)
        for row, i in enumerate(numbers):
            alone = compare(records[i], errors)
            assert together.keys() == alone.keys()
            for equation, x in alone.items():
                np.testing.assert_allclose(together[equation][row], x, rtol=1e-12, atol=1e-14)


def test_the_integral_is_that_of_the_cubic():
    t = np.arange(101) * DT
    np.testing.assert_allclose(integral(t**3 - t, DT), t**4 / 4.0 - t**2 / 2.0, atol=1e-14)


def test_derivative_shift_and_lag_of_a_sine():
    """Closed forms at a tenth of the sample rate; the lag of sin(w t) from its steady state."""
    w, tau, dt = 2.0 * np.pi * 2.5, 0.13, 0.04
    t = np.arange(400) * dt
    inside = slice(100, -20)
    x = np.sin(w * t)
    np.testing.assert_allclose(derivative(x, dt)[inside], w * np.cos(w * t)[inside], atol=2e-3 * w)
    np.testing.assert_allclose(earlier(x, dt, 0.101)[inside], np.sin(w * (t + 0.101))[inside], atol=2e-3)
    np.testing.assert_allclose(earlier(x, dt, -0.017)[inside], np.sin(w * (t - 0.017))[inside], atol=2e-3)
    late = (np.sin(w * t) - w * tau * np.cos(w * t)) / (1.0 + (w * tau) ** 2)
    np.testing.assert_allclose(lagged(x, dt, tau)[inside], late[inside], atol=2e-3)


def problem(channels, equations=("theta", "alpha"), errors=None):
    records = [record(channels)]
    return problem_of(records, equations, {}, limits_of(records, 40.0), errors)


@pytest.mark.parametrize(
    ("equation", "errors", "tolerance"),
    [
        ("alpha", {"vane_scale": 1.08, "vane_arm": 1.5}, {"vane_scale": 2e-3, "vane_arm": 0.03}),
        (
            "alpha",
            {"vane_scale": 0.95, "accelerometer_arm": -0.8},
            {"vane_scale": 2e-3, "accelerometer_arm": 0.03},
        ),
        (
            "alpha",
            {"vane_scale": 1.0, "sensor_delay:alpha_rad": 0.06},
            {"vane_scale": 2e-3, "sensor_delay:alpha_rad": 1e-3},
        ),
        ("alpha", {"vane_scale": 1.0, "vane_lag": 0.05}, {"vane_scale": 2e-3, "vane_lag": 5e-4}),
        (
            "alpha",
            {"gyro_scale": 1.04, "accelerometer_scale": 0.97},
            {"gyro_scale": 5e-3, "accelerometer_scale": 5e-3},
        ),
        (
            "theta",
            {"gyro_scale": 1.03, "sensor_delay:theta_rad": 0.04},
            {"gyro_scale": 2e-3, "sensor_delay:theta_rad": 1e-3},
        ),
        (
            "theta",
            {"gyro_scale": 0.98, "sensor_delay:q_rad_s": 0.03},
            {"gyro_scale": 2e-3, "sensor_delay:q_rad_s": 1e-3},
        ),
        ("airspeed", {"sensor_delay:airspeed_m_s": 0.2}, {"sensor_delay:airspeed_m_s": 0.02}),
        ("airspeed", {"airspeed_alpha_slope": -0.4}, {"airspeed_alpha_slope": 5e-3}),
    ],
)
def test_errors_of_a_quiet_record_are_found(equation, errors, tolerance, true):
    found = fit(problem(noisy(measured(true, errors), 5, 0.1), (equation,), errors), tuple(errors))
    assert found.sound
    for name, value in zip(found.names, found.value, strict=True):
        assert value == pytest.approx(errors[name], abs=tolerance[name]), name


def test_an_accelerometer_ahead_is_a_vane_behind(true):
    """int (x q_dot/V) dt = x q/V at constant V: the same motion of alpha."""
    one = fit(problem(measured(true, {"accelerometer_arm": 1.0}), ("alpha",)), ("vane_scale", "vane_arm"))
    assert one.value[1] == pytest.approx(-1.0, abs=0.05)


def test_a_lag_far_beyond_half_a_second_is_reached_from_zero(true):
    """The lag may last an eighth of the record: 1.25 s in 10 s."""
    start = {"vane_lag": 0.25}
    found = fit(problem(noisy(measured(true, {"vane_lag": 0.9}), 4, 0.3)), ("vane_lag",), start)
    assert found.value[0] == pytest.approx(0.9, abs=0.05)


def test_a_lag_at_zero_leaves_the_others_at_their_least(true):
    """A late accelerometer makes alpha lead, and no lag is negative: the arm is that of a fit without the lag."""
    late = problem(noisy(measured(true, {"sensor_delay:az_m_s2": 0.04}), 6, 0.3))
    alone = fit(late, ("vane_arm",))
    found = fit(late, ("vane_lag", "vane_arm"), {"vane_lag": 0.1})
    assert found.converged
    assert found.value[0] == 0.0
    assert found.value[1] == pytest.approx(alone.value[0], abs=0.05 * float(alone.std[0]))
    assert found.statistic == pytest.approx(alone.statistic, rel=1e-3)


def test_derivatives_from_nearby_lead_to_the_same_fit(true):
    """A start with the derivatives of another point ends where one with its own does, within a fraction of the standard error."""
    given = problem(noisy(measured(true, {"vane_arm": 1.5, "vane_lag": 0.05}), 7, 0.3))
    base = given.moments({})
    near = [given.slope(name, {}, base) for name in ("vane_lag", "vane_arm")]
    own, other = (fit(given, ("vane_lag", "vane_arm"), {"vane_lag": 0.1}, n) for n in (None, near))
    assert own.converged
    assert other.converged
    assert (np.abs(own.value - other.value) < 0.05 * own.std).all()
    np.testing.assert_allclose(other.std, own.std, rtol=0.01)


def test_motions_of_the_elevator_know_nothing_of_noise(true):
    """Principal angles between the spans of a quiet and of a noisy record near zero."""
    quiet, loud = (lines_of(record(x)).basis for x in (true, noisy(true, 0, 1.0)))
    assert quiet.shape == loud.shape
    a, b = (np.linalg.qr(x[:4].T)[0] for x in (quiet, loud))
    assert np.linalg.svd(a.T @ b)[1].min() > 0.98


def test_a_consistent_log_is_called_so(true):
    result = check_kinematics(as_log(noisy(true, 1)))
    assert result.verdict == "agrees"
    assert "The channels agree" in result.sentences[0]
    assert "friction" not in " ".join(result.sentences)
    assert result.p_value > 0.05
    for name in ("gyro_scale", "sensor_delay:theta_rad"):
        one = result.finding(name)
        assert one.state == "not needed"
        assert one.lower <= ERRORS[name].neutral <= one.upper
    assert set(result.residual_rms) == {"theta_rad", "alpha_rad", "airspeed_m_s"}


@pytest.mark.slow
def test_biases(true):
    shifted = {n: v.copy() for n, v in measured(true, {"vane_arm": 2.0}).items()}
    shifted["q_rad_s"] += 0.004
    shifted["az_m_s2"] += 0.2
    shifted["ax_m_s2"] += 0.1
    found = {f.name: f for f in check_kinematics(as_log(*(noisy(shifted, i) for i in range(3)))).findings}
    for name, value, most in (
        ("gyro_bias", 0.004, 4e-4),
        ("accelerometer_bias", 0.2, 0.05),
        ("forward_bias", 0.1 + 0.2 * 0.06, 0.05),
    ):
        assert found[name].lower < value < found[name].upper, name
        assert found[name].upper - found[name].lower < 2.0 * most, name


@pytest.mark.slow
def test_declared_biases_are_not_found_again(true):
    """Biases of every channel: each row states the sum that they make there, and only a further one is named."""
    biases = {"q_rad_s": 0.004, "az_m_s2": 0.2, "ax_m_s2": 0.3, "theta_rad": -0.02, "airspeed_m_s": 0.5}
    shifted = {n: v + biases.get(n, 0.0) for n, v in true.items()}
    log = as_log(*(noisy(shifted, i) for i in range(3)))
    result = check_kinematics(log, biases=biases)
    assert result.verdict == "agrees"
    names = ("gyro_bias", "accelerometer_bias", "forward_bias")
    assert [result.finding(n).state for n in names] == ["not needed"] * 3
    # to first order at 0.06 rad: az less the share of ax; ax with the shares of az and theta
    sums = (0.004, 0.2 - 0.3 * 0.06, 0.3 + 0.2 * 0.06 + G0 * 0.02)
    assert [result.finding(n).declared for n in names] == pytest.approx(sums, abs=0.02)
    further = check_kinematics(log, biases={**biases, "q_rad_s": 0.01})
    assert further.verdict == "errors"
    assert [f.name for f in further.findings if f.state == "present"] == ["gyro_bias"]
    assert ", where 0.01 rad/s is declared" in further.sentences[0]
    plain = check_kinematics(log)
    assert [plain.finding(n).state for n in names if n != "accelerometer_bias"] == ["present"] * 2
    assert [plain.finding(n).declared for n in names] == [0.0] * 3
    assert [plain.finding(n).value for n in names] == [result.finding(n).value for n in names]


@pytest.mark.slow
def test_an_arm_is_found_and_its_twin_named(true):
    result = check_kinematics(as_log(noisy(measured(true, {"vane_arm": 4.0}), 2)))
    names = {c.name for c in result.possible}
    assert names >= {"vane_arm", "accelerometer_arm"}  # the same motion, see above
    assert "none" not in names
    assert result.verdict == "one_of"
    arm = result.finding("vane_arm")
    assert arm.lower < 4.0 < arm.upper
    assert "do not tell them apart" in " ".join(result.sentences)


@pytest.mark.slow
def test_an_arm_longer_than_the_aircraft_is_no_cause(true):
    """A lag of 0.25 s at 60 m/s resembles an arm of 15 m, which an aircraft of 0.5 m chord has no place for."""
    log = as_log(noisy(measured(true, {"vane_lag": 0.25}), 2))
    result = check_kinematics(log, None, 0.5)
    assert {c.name for c in result.possible} == {"vane_lag"}
    assert "A friction of the vane" in result.sentences[1]
    assert not any("arm" in f.name and f.state in ("present", "one of") for f in result.findings)


@pytest.mark.slow
def test_an_attitude_that_lags_is_not_a_scale_of_the_gyro(true):
    """The gain of the lag falls with frequency; a scale's does not."""
    result = check_kinematics(as_log(*(noisy(measured(true, {"attitude_lag": 0.1}), i) for i in range(2))))
    assert [f.name for f in result.findings if f.state == "present"] == ["attitude_lag"]
    one = result.finding("attitude_lag")
    assert one.lower < 0.1 < one.upper
    scale = result.finding("gyro_scale")
    assert scale.lower < 1.0 < scale.upper


def test_a_lag_beyond_the_range_is_a_failed_check(true):
    """A lag of 3 s in a record of 10 s: the fit ends at its limit of 1.25 s, and no size may be used."""
    result = check_kinematics(as_log(noisy(measured(true, {"vane_lag": 3.0}), 2, 0.3)), None, 0.5)
    assert result.verdict != "agrees"
    assert result.verdict == "failed"
    assert "The check failed" in result.sentences[0]


@pytest.mark.slow
def test_a_failed_check_names_no_error(true):
    """A lag of 2 s: the best set holds another error, of which nothing may be said."""
    result = check_kinematics(as_log(noisy(measured(true, {"vane_lag": 2.0}), 2, 0.3)), None, 0.5)
    assert result.verdict == "failed"
    assert result.possible[0].errors
    states = {f.name: f.state for f in result.findings}
    assert not {"present", "one of"} & set(states.values())
    assert {states[f.name] for f in result.possible[0].errors} == {"not assessed"}


def test_a_weak_manoeuvre_cannot_tell(true):
    small = {n: v[:1] + 0.02 * (v - v[:1]) for n, v in true.items()}
    result = check_kinematics(as_log(noisy(small, 3)))
    assert result.verdict == "cannot_tell"
    assert "cannot tell" in result.sentences[0]
    assert "agree (" not in " ".join(result.sentences)


@pytest.mark.slow
def test_runs_of_unequal_noise_are_weighed_by_their_own(true):
    """A loud run beside a quiet one leaves the interval that the quiet one has alone."""
    with_arm = measured(true, {"vane_lag": 0.1})
    alone = check_kinematics(as_log(noisy(with_arm, 1, 0.3)), None, 1.0).finding("vane_lag")
    both = check_kinematics([as_log(noisy(with_arm, 1, 0.3)), as_log(noisy(with_arm, 2, 10.0))], None, 1.0)
    assert both.run_ids == ("r0", "r0")
    lag = both.finding("vane_lag")
    assert lag.upper - lag.lower < 1.2 * (alone.upper - alone.lower)
    assert lag.lower < 0.1 < lag.upper


def test_what_is_declared_is_not_found_again(true):
    log = as_log(noisy(measured(true, {"vane_arm": 4.0, "sensor_delay:theta_rad": 0.04}), 2))
    result = check_kinematics(log, {"vane_arm": 4.0, "sensor_delay:theta_rad": 0.04})
    assert result.verdict == "agrees"
    delay = result.finding("sensor_delay:theta_rad")
    assert delay.declared == 0.04
    assert delay.lower < 0.04 < delay.upper


@pytest.mark.slow
def test_a_declared_delay_that_is_absent_is_found(true):
    """The delay ends at zero, which no search limits."""
    result = check_kinematics(as_log(noisy(true, 2)), {"sensor_delay:theta_rad": 0.04})
    assert result.verdict == "errors"
    delay = result.finding("sensor_delay:theta_rad")
    assert (delay.state, delay.declared, delay.lower) == ("present", 0.04, 0.0)
    assert delay.upper < 0.005
    assert ", where 0.04 s is declared" in result.sentences[0]


def test_channels_that_are_absent_are_said_so(true):
    log = as_log(noisy(measured(true, {"vane_arm": 4.0}), 2), leave_out=("theta_rad", "ax_m_s2"))
    result = check_kinematics(log)
    words = " ".join(result.sentences)
    assert "theta_rad is absent" in words
    assert "ax_m_s2 is absent" in words
    assert result.findings[-1].name == "gyro_bias + accelerometer_bias/V"
    assert not {"gyro_scale", "sensor_delay:theta_rad", "airspeed_m_s"} & {f.name for f in result.findings}
    arm = result.finding("vane_arm")
    assert arm.lower < 4.0 < arm.upper


def test_records_without_a_manoeuvre_are_refused(true):
    still = {n: np.full_like(v, v[0]) for n, v in true.items()}
    with pytest.raises(LogError, match="no run can be assessed"):
        check_kinematics(as_log(still))


def test_tables_and_json(true):
    import json

    from airtruth.table import as_text

    result = check_kinematics(as_log(noisy(true, 1), noisy(true, 2)))
    text = "\n".join(as_text(t) for t in tables(result))
    assert "gyro_scale" in text
    assert "2 runs" in text
    assert json.loads(json.dumps(result.to_dict()))["run_ids"] == ["r0", "r1"]


def test_declared_sensors_of_the_gtm(gtm):
    assert declared_errors(gtm, LONGITUDINAL) == {"sensor_delay:theta_rad": pytest.approx(0.04)}
    biases = declared_biases(gtm, LONGITUDINAL)
    assert set(biases) == {"airspeed_m_s", "theta_rad", "q_rad_s", "ax_m_s2", "az_m_s2"}
    assert (biases["q_rad_s"], biases["ax_m_s2"]) == pytest.approx((0.0027, 0.0162 * G0), abs=1e-6)


def test_no_set_of_errors_is_excluded_for_its_size_alone():
    """Distances by hand: 9.6 by the cost, of which 3.3 is the improbability of a long arm."""
    empty = np.zeros(0)
    fitted = Fit((), empty, empty, np.zeros((0, 0)), 0.0, True)
    best = ErrorSet(fitted, cost=20.0, improbability=0.1)
    long_arm = ErrorSet(fitted, cost=29.6, improbability=3.4)
    assert long_arm.behind(best) == pytest.approx(9.6 - 3.3)
    assert ErrorSet(fitted, cost=21.0, improbability=0.0).behind(best) == pytest.approx(1.0)


def test_combinations_are_two_lists():
    """Eight sets, every choice of two with every choice of four."""
    sets = [frozenset((a, b)) for a in ("t1", "t2") for b in ("v1", "v2", "v3", "v4")]
    first, second = _factors(sets) or ((), ())
    assert {one | other for one in first for other in second} == set(sets)
    assert sorted((len(first), len(second))) == [2, 4]
    assert _factors(sets[:-1]) is None
    assert _factors([frozenset("a"), frozenset("b")]) is None


def test_an_error_without_a_size_of_its_own_has_no_row_of_numbers():
    """Two arms whose difference alone is determined: 0.36 +- 1.14 m over all sets, 1.76 +- 0.19 m alone."""
    arm = Finding("vane_arm", "m", "position", 0.36, 1.14, -1.6, 1.9, 0.0, 5.2, "one of")
    lag = Finding("vane_lag", "s", "lag", 0.054, 0.012, 0.037, 0.088, 0.0, 0.021, "one of")
    causes = (
        PossibleCause((replace(lag, std=0.006),), 5.0, 0.0, True),
        PossibleCause((replace(arm, value=1.76, std=0.19),), 11.0, 6.0, True),
    )
    result = CheckResult("one_of", ("r1",), (arm, lag), causes, 60.0, 70, 0.8, 1.0, {}, ("One of several.",))
    assert undetermined(result) == ("vane_arm",)
    frame = result.to_frame().set_index("error")
    assert frame.loc["vane_arm", ["estimate", "std", "lower", "upper"]].isna().all()
    assert frame.loc["vane_lag", "estimate"] == 0.054
    assert "vane_arm: the records determine no size unless" in result.summary()
    assert "vane_arm 1.76 m" in result.summary()
