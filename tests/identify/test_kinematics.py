"""Kinematic consistency: equations against closed forms, known errors found, what is absent said."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from airtruth.errors import LogError
from airtruth.identify.kinematics import check_kinematics, declared_errors
from airtruth.identify.kinematics_fit import fit, instruments
from airtruth.identify.kinematics_model import ERRORS, Record, integral, neutral, predicted
from airtruth.identify.kinematics_report import tables
from airtruth.logs.flight_log import FlightLog
from airtruth.physics import sensors
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
    return Record(
        "r", DT, c["airspeed_m_s"], c["alpha_rad"], c["q_rad_s"], c["az_m_s2"], c["elevator_rad"],
        c["ax_m_s2"], c["theta_rad"],
    )  # fmt: skip


def measured(true, errors):
    """Readings with instrument errors, made by the sensor equations of physics."""
    e = {n: errors.get(n, neutral(n)) for n in ERRORS}
    alpha = sensors.vane_alpha(true["alpha_rad"], true["q_rad_s"], e["vane_arm"], true["airspeed_m_s"])
    az = sensors.accelerometer_az(true["az_m_s2"], true["q_dot"], e["accelerometer_arm"])

    def late(x, delay, scale, lag=0.0):
        model = sensors.SensorModel(delay_s=delay, scale=scale, lag_s=lag)
        return sensors.measure(model, x[None], DT, np.zeros((1, len(x))))[0]

    return {
        **true,
        "alpha_rad": late(alpha, e["alpha_delay"], e["alpha_scale"], e["vane_lag"]),
        "az_m_s2": late(az, e["az_delay"], e["az_scale"]),
        "q_rad_s": late(true["q_rad_s"], e["gyro_delay"], e["gyro_scale"]),
        "theta_rad": late(true["theta_rad"], e["theta_delay"], 1.0),
        "airspeed_m_s": late(true["airspeed_m_s"], e["airspeed_delay"], e["airspeed_scale"]),
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
    reading, prediction = predicted(equation, record(true), {})
    left = reading - prediction
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


def test_the_integral_is_that_of_the_cubic():
    t = np.arange(101) * DT
    np.testing.assert_allclose(integral(t**3 - t, DT), t**4 / 4.0 - t**2 / 2.0, atol=1e-14)


@pytest.mark.parametrize(
    ("equation", "errors", "tolerance"),
    [
        ("alpha", {"alpha_scale": 1.08, "vane_arm": 1.5}, {"alpha_scale": 2e-3, "vane_arm": 0.03}),
        (
            "alpha",
            {"alpha_scale": 0.95, "accelerometer_arm": -0.8},
            {"alpha_scale": 2e-3, "accelerometer_arm": 0.03},
        ),
        ("alpha", {"alpha_scale": 1.0, "alpha_delay": 0.06}, {"alpha_scale": 2e-3, "alpha_delay": 5e-4}),
        ("alpha", {"alpha_scale": 1.0, "vane_lag": 0.05}, {"alpha_scale": 2e-3, "vane_lag": 5e-4}),
        ("alpha", {"gyro_scale": 1.04, "az_scale": 0.97}, {"gyro_scale": 4e-3, "az_scale": 4e-3}),
        ("theta", {"gyro_scale": 1.03, "theta_delay": 0.04}, {"gyro_scale": 1e-3, "theta_delay": 5e-4}),
        ("theta", {"gyro_scale": 0.98, "gyro_delay": 0.03}, {"gyro_scale": 1e-3, "gyro_delay": 5e-4}),
        ("airspeed", {"airspeed_delay": 0.2}, {"airspeed_delay": 0.01}),
    ],
)
def test_errors_of_a_quiet_record_are_found(equation, errors, tolerance, true):
    found = fit(equation, [record(noisy(measured(true, errors), 5, 0.1))], tuple(errors))
    assert found.converged
    for name, value in zip(found.names, found.value, strict=True):
        assert value == pytest.approx(errors[name], abs=tolerance[name]), name


def test_an_accelerometer_ahead_is_a_vane_behind(true):
    """int (x q_dot/V) dt = x q/V at constant V: the same motion of alpha."""
    part = record(measured(true, {"accelerometer_arm": 1.0}))
    one = fit("alpha", [part], ("alpha_scale", "vane_arm"))
    assert one.value[1] == pytest.approx(-1.0, abs=0.05)


def test_instruments_know_nothing_of_noise(true):
    quiet, loud = instruments(record(true)), instruments(record(noisy(true, 0, 1.0)))
    assert quiet.shape == loud.shape
    np.testing.assert_allclose(np.linalg.norm(quiet, axis=1), 1.0)
    # the same motions up to small changes of the transfer function: principal angles near zero
    a, b = (np.linalg.qr(x[:4].T)[0] for x in (quiet, loud))
    assert np.linalg.svd(a.T @ b)[1].min() > 0.98


def test_a_consistent_log_is_called_so(true):
    result = check_kinematics(as_log(noisy(true, 1)))
    assert "alpha agrees with q and az in time" in " ".join(result.sentences)
    found = {f.name: f for f in result.findings}
    for name in ("gyro_scale", "theta_delay"):
        assert found[name].lower < neutral(name) < found[name].upper
    assert set(result.residual_rms) == {"theta_rad", "alpha_rad", "airspeed_m_s"}


def test_biases(true):
    shifted = {n: v.copy() for n, v in measured(true, {"vane_arm": 2.0}).items()}
    shifted["q_rad_s"] += 0.004
    shifted["az_m_s2"] += 0.2
    shifted["ax_m_s2"] += 0.1
    found = {f.name: f for f in check_kinematics(as_log(*(noisy(shifted, i) for i in range(3)))).findings}
    for name, value, most in (
        ("gyro_bias", 0.004, 4e-4),
        ("az_bias", 0.2, 0.05),
        ("forward_bias", 0.1 + 0.2 * 0.06, 0.05),
    ):
        assert found[name].lower < value < found[name].upper, name
        assert found[name].upper - found[name].lower < 2.0 * most, name


def test_an_arm_is_found_and_its_twin_named(true):
    result = check_kinematics(as_log(noisy(measured(true, {"vane_arm": 4.0}), 2)))
    causes = {c.name: c for c in result.causes}
    assert causes["vane_arm"].possible
    assert causes["accelerometer_arm"].possible  # the same motion, see above
    assert not causes["none"].possible
    assert causes["vane_arm"].cause.lower < 4.0 < causes["vane_arm"].cause.upper
    assert "these records do not tell them apart" in " ".join(result.sentences)


def test_what_is_declared_is_not_found_again(true):
    log = as_log(noisy(measured(true, {"vane_arm": 4.0, "theta_delay": 0.04}), 2))
    result = check_kinematics(log, {"vane_arm": 4.0, "theta_delay": 0.04})
    assert "alpha agrees with q and az in time" in " ".join(result.sentences)
    delay = next(f for f in result.findings if f.name == "theta_delay")
    assert delay.declared == 0.04
    assert delay.lower < 0.04 < delay.upper


def test_channels_that_are_absent_are_said_so(true):
    log = as_log(noisy(measured(true, {"vane_arm": 4.0}), 2), leave_out=("theta_rad", "ax_m_s2"))
    result = check_kinematics(log)
    words = " ".join(result.sentences)
    assert "theta_rad is absent" in words
    assert "ax_m_s2 is absent" in words
    assert [f.name for f in result.findings] == ["gyro_bias + az_bias/V"]
    arm = next(c for c in result.causes if c.name == "vane_arm").cause
    assert arm.value == pytest.approx(4.0, abs=3.0 * arm.std)


def test_records_without_a_manoeuvre_are_refused(true):
    still = {n: np.full_like(v, v[0]) for n, v in true.items()}
    with pytest.raises(LogError, match="no run can be judged"):
        check_kinematics(as_log(still))


def test_tables_and_json(true):
    import json

    from airtruth.identify import as_text

    result = check_kinematics(as_log(noisy(true, 1), noisy(true, 2)))
    text = "\n".join(as_text(t) for t in tables(result))
    assert "gyro_scale" in text
    assert "2 runs" in text
    assert json.loads(json.dumps(result.as_dict()))["run_ids"] == ["r0", "r1"]


def test_declared_sensors_of_the_gtm(gtm):
    assert declared_errors(gtm) == {"theta_delay": pytest.approx(0.04)}
