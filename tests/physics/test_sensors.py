"""Each step of a sensor against its analytic effect."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import quad

from airtruth.physics import sensors
from airtruth.physics.sensor_errors import SensorErrors
from airtruth.physics.sensors import measure

Array = NDArray[np.float64]
DT = 0.005
T = np.arange(1000) * DT


def reading(model: SensorErrors, truth: Array, dt: float = DT) -> Array:
    return measure(model, truth[None, :], dt, np.zeros((1, truth.size)))[0]


def test_the_default_sensor_copies() -> None:
    truth = np.random.default_rng(0).standard_normal((3, 50))
    seen = measure(SensorErrors(), truth, DT, np.ones_like(truth))
    np.testing.assert_array_equal(seen, truth)
    assert not np.shares_memory(seen, truth)


def test_the_truth_is_left_alone() -> None:
    truth = np.random.default_rng(0).standard_normal((3, 50))
    before = truth.copy()
    model = SensorErrors(0.1, 0.2, 1.1, 0.01, 0.007, 0.05, -1.0, 1.0, 0.02)
    measure(model, truth, DT, np.ones_like(truth))
    np.testing.assert_array_equal(truth, before)


def test_scale_bias_and_noise() -> None:
    truth = np.random.default_rng(0).standard_normal((2, 50))
    normals = np.random.default_rng(1).standard_normal((2, 50))
    seen = measure(SensorErrors(noise_std=0.3, bias=-0.5, scale=1.1), truth, DT, normals)
    np.testing.assert_allclose(seen, 1.1 * truth - 0.5 + 0.3 * normals, rtol=0, atol=1e-15)


def test_lag_of_a_ramp() -> None:
    """A ramp from rest is linear between samples: x = t gives y = t - tau (1 - exp(-t/tau)), exactly."""
    tau = 0.04
    np.testing.assert_allclose(sensors.lag(T, DT, tau), T + tau * np.expm1(-T / tau), rtol=0, atol=1e-13)


@given(st.floats(1e-4, 10.0))
def test_lag_has_unit_gain_and_starts_in_equilibrium(tau: float) -> None:
    np.testing.assert_allclose(sensors.lag(np.full(300, 3.7), DT, tau), 3.7, rtol=1e-12)


def test_lag_of_a_sinusoid() -> None:
    """Gain 1/sqrt(1 + (w tau)^2) and phase -atan(w tau), times that of interpolation, sinc^2(w dt/2)."""
    tau, omega = 0.1, 2 * np.pi * 3.0
    y = sensors.lag(np.sin(omega * T), DT, tau)
    late = 20 * tau < T
    basis = np.stack([np.sin(omega * T[late]), np.cos(omega * T[late])], axis=1)
    found = np.linalg.lstsq(basis, y[late], rcond=None)[0] @ [1, 1j]
    expected = 1 / (1 + 1j * omega * tau)
    # linear interpolation passes (sin(x)/x)^2, x = omega dt/2, and images at the sampling frequency
    # multiples k, which fold onto the samples: sum of sinc^2 (1/(1 + j (omega + k omega_s) tau))
    k = np.arange(-20000, 20001)
    w = omega + k * 2 * np.pi / DT
    folded = np.sum((np.sin(omega * DT / 2) / (w * DT / 2)) ** 2 / (1 + 1j * w * tau))
    assert found == pytest.approx(folded, abs=1e-8)
    assert abs(found) == pytest.approx(abs(expected), rel=1e-3)
    assert np.angle(found) == pytest.approx(np.angle(expected), abs=1e-3)


def test_delay_of_whole_samples_is_exact() -> None:
    x = np.random.default_rng(0).standard_normal((2, 40))
    for whole in (1, 3, 39, 40, 100):
        y = sensors.delay(x, DT, whole * DT)
        np.testing.assert_array_equal(y[:, whole:], x[:, : max(40 - whole, 0)])
        np.testing.assert_array_equal(y[:, :whole], np.broadcast_to(x[:, :1], (2, min(whole, 40))))
    np.testing.assert_array_equal(
        sensors.delay(x, 0.02, 0.06), sensors.delay(x, 1.0, 3.0)
    )  # 0.06/0.02 < 3 in binary


@given(st.floats(0.0, 0.1), st.floats(0.5, 20.0))
def test_fractional_delay_error_bound(delay: float, omega: float) -> None:
    """Linear interpolation of a sinusoid errs by at most (omega dt)^2/8."""
    y = sensors.delay(np.sin(omega * T), DT, delay)
    late = delay + DT < T
    assert np.abs(y - np.sin(omega * (T - delay)))[late].max() <= (omega * DT) ** 2 / 8 + 1e-8


def test_delay_of_a_ramp_is_exact() -> None:
    y = sensors.delay(1.0 + T, DT, 0.0123)
    np.testing.assert_allclose(y, 1.0 + np.maximum(T - 0.0123, 0.0), rtol=0, atol=1e-12)


def test_hold_at_a_divisor_of_the_rate() -> None:
    """theta of the GTM: 50 Hz held on 200 Hz samples."""
    x = np.arange(12.0)
    np.testing.assert_array_equal(sensors.hold(x, 0.005, 0.02), [0, 0, 0, 0, 4, 4, 4, 4, 8, 8, 8, 8])


def test_hold_between_samples_takes_the_last_one() -> None:
    """Updates at 0, 2.5, 5, 7.5 samples: the sample at or before."""
    x = np.arange(10.0)
    np.testing.assert_array_equal(sensors.hold(x, 1.0, 2.5), [0, 0, 0, 2, 2, 5, 5, 5, 7, 7])


def test_hold_shorter_than_a_sample_does_nothing() -> None:
    np.testing.assert_array_equal(reading(SensorErrors(hold_s=0.004), np.sin(T)), np.sin(T))


@given(st.floats(1e-3, 1.0))
def test_quantisation(quantum: float) -> None:
    x = np.linspace(-3, 3, 501)
    y = reading(SensorErrors(quantum=quantum), x)
    assert np.abs(y - x).max() <= quantum / 2 * (1 + 1e-9)
    np.testing.assert_allclose(y / quantum, np.round(y / quantum), rtol=0, atol=1e-9)


def test_saturation() -> None:
    np.testing.assert_array_equal(
        reading(SensorErrors(minimum=-1.0, maximum=0.5), np.array([-2.0, -1.0, 0.2, 0.9])),
        [-1.0, -1.0, 0.2, 0.5],
    )


def test_order_of_the_steps() -> None:
    """Lag, delay, scale, bias, noise, hold, quantum, saturation, written out by hand."""
    rng = np.random.default_rng(4)
    truth, normals = np.cumsum(rng.standard_normal((2, 200)), axis=1), rng.standard_normal((2, 200))
    model = SensorErrors(
        noise_std=0.2,
        bias=0.7,
        scale=0.9,
        lag_s=0.02,
        delay_s=0.012,
        quantum=0.1,
        minimum=-2.0,
        maximum=3.0,
        hold_s=0.02,
    )
    y = 0.9 * sensors.delay(sensors.lag(truth, DT, 0.02), DT, 0.012) + 0.7 + 0.2 * normals
    y = np.clip(np.round(sensors.hold(y, DT, 0.02) / 0.1) * 0.1, -2.0, 3.0)
    np.testing.assert_array_equal(measure(model, truth, DT, normals), y)


def test_noise_statistics() -> None:
    """Standard deviation within 4 standard errors, std/sqrt(2 n), and no correlation between samples."""
    n = 200_000
    y = measure(
        SensorErrors(noise_std=0.3857), np.zeros((1, n)), DT, np.random.default_rng(0).standard_normal((1, n))
    )
    assert y.std() == pytest.approx(0.3857, rel=4 / np.sqrt(2 * n))
    assert abs(np.corrcoef(y[0, 1:], y[0, :-1])[0, 1]) < 4 / np.sqrt(n)


def test_arms_against_rotated_frames() -> None:
    """Position of a sensor r = p + R(theta) (x, z), differentiated twice numerically, against the arms.

    Earth axes x forward, z down; pitch nose-up turns body x towards -z: R = [[c, s], [-s, c]].
    """
    x, z = 0.7, -0.2

    def theta(t: float) -> float:
        return 0.1 + 0.3 * np.sin(2.0 * t) + 0.05 * t

    def position(t: float) -> Array:
        c, s = np.cos(theta(t)), np.sin(theta(t))
        centre = np.array([40 * t + 0.5 * np.sin(t), 0.3 * np.cos(3 * t)])
        return centre + np.array([[c, s], [-s, c]]) @ [x, z]

    def centre_acceleration(t: float) -> Array:
        return np.array([-0.5 * np.sin(t), -2.7 * np.cos(3 * t)])

    t, h = 0.83, 1e-3
    weights = np.array([-1, 16, -30, 16, -1]) / (12 * h * h)  # fourth order
    sensor = sum(w * position(t + k * h) for w, k in zip(weights, range(-2, 3), strict=True))
    c, s = np.cos(theta(t)), np.sin(theta(t))
    to_body = np.array([[c, -s], [s, c]])
    ax, az = to_body @ centre_acceleration(t)
    q = 0.6 * np.cos(2.0 * t) + 0.05
    q_dot = -1.2 * np.sin(2.0 * t)
    at_sensor = to_body @ sensor
    assert sensors.accelerometer_ax(ax, q, q_dot, x, z) == pytest.approx(at_sensor[0], abs=1e-7)
    assert sensors.accelerometer_az(az, q_dot, x, q, z) == pytest.approx(at_sensor[1], abs=1e-7)


def test_vane_arm() -> None:
    """Hand value: q 0.2 rad/s, 13 m ahead, V 100 m/s lowers alpha by 0.026 rad; exact: atan((w - q x)/u)."""
    assert sensors.vane_equation(0.05, 0.2, 13.0, 100.0) == pytest.approx(0.05 - 0.026, abs=1e-15)
    exact = np.arctan2(100 * np.sin(0.05) - 0.02 * 13.0, 100 * np.cos(0.05))
    assert sensors.vane_equation(0.05, 0.02, 13.0, 100.0) == pytest.approx(exact, abs=1e-5)


def test_lag_against_the_convolution_integral() -> None:
    """y(t) of a random piecewise linear input by quadrature over each interval."""
    rng = np.random.default_rng(8)
    x, tau = rng.standard_normal(6), 0.011
    t = np.arange(6) * DT

    def exact(end: int) -> float:
        total = x[0] * np.exp(-t[end] / tau)  # equilibrium before
        for i in range(end):
            total += quad(
                lambda s, i=i: np.interp(s, t, x) * np.exp(-(t[end] - s) / tau) / tau,
                t[i],
                t[i + 1],
                epsabs=1e-14,
            )[0]
        return float(total)

    np.testing.assert_allclose(sensors.lag(x, DT, tau), [exact(i) for i in range(6)], rtol=0, atol=1e-12)


@pytest.mark.parametrize(("x", "z"), [(0.0, 0.0), (2.0, 0.0), (0.0, -1.5), (2.0, -1.5), (-2.0, 1.5)])
def test_each_channel_is_moved_to_its_instrument(x: float, z: float) -> None:
    """Rigid-body kinematics written out: alpha - q x/V, az - q_dot x - q^2 z, ax + q_dot z - q^2 x."""
    rng = np.random.default_rng(5)
    names = ("airspeed_m_s", "alpha_rad", "theta_rad", "q_rad_s", "q_dot_rad_s2", "ax_m_s2", "az_m_s2")
    truth = {name: rng.standard_normal((2, 7)) + 3.0 for name in names}
    v, alpha, _, q, q_dot, ax, az = truth.values()
    expected = truth | {
        "alpha_rad": alpha - q * x / v,
        "ax_m_s2": ax + q_dot * z - q**2 * x,
        "az_m_s2": az - q_dot * x - q**2 * z,
    }
    for name in ("airspeed_m_s", "alpha_rad", "theta_rad", "q_rad_s", "ax_m_s2", "az_m_s2"):
        moved = sensors.at_instrument(name, truth, SensorErrors(x_m=x, z_m=z))
        np.testing.assert_allclose(moved, expected[name], rtol=1e-14)


def test_a_position_error_follows_the_angle_of_attack_about_its_mean() -> None:
    """By hand: alpha of 0.02, 0.06, 0.10 about its mean 0.06, slope -0.5: 2 % too much, right, 2 % too little."""
    truth = {
        "airspeed_m_s": np.full((2, 3), 50.0),
        "alpha_rad": np.array([[0.02, 0.06, 0.10], [0.1, 0.1, 0.1]]),
    }
    read = sensors.at_instrument("airspeed_m_s", truth, SensorErrors(alpha_slope_per_rad=-0.5))
    np.testing.assert_allclose(read, [[51.0, 50.0, 49.0], [50.0, 50.0, 50.0]], rtol=1e-15)


def test_an_instrument_at_the_centre_of_gravity_needs_no_rates() -> None:
    truth = {"alpha_rad": np.zeros((1, 3))}
    assert sensors.at_instrument("alpha_rad", truth, SensorErrors()) is truth["alpha_rad"]


def test_an_accelerometer_on_the_x_axis_needs_no_pitch_rate() -> None:
    assert sensors.accelerometer_az(-9.0, 2.0, 0.5) == pytest.approx(-10.0, abs=1e-15)
    assert sensors.accelerometer_az(-9.0, 2.0, 0.5, 3.0) == pytest.approx(-10.0, abs=1e-15)


@pytest.mark.parametrize(
    ("errors", "expected"),
    [
        (SensorErrors(minimum=-1.0), [-1.0, 0.2, 0.9]),
        (SensorErrors(maximum=0.5), [-2.0, 0.2, 0.5]),
    ],
)
def test_one_end_of_a_range_may_be_open(errors: SensorErrors, expected: list[float]) -> None:
    np.testing.assert_array_equal(reading(errors, np.array([-2.0, 0.2, 0.9])), expected)


def test_arms_of_a_rolling_and_yawing_aircraft_against_rotated_frames() -> None:
    """The path of a fixed point in an attitude that changes in three axes, differentiated twice numerically.

    Rotation matrix and rates from the Euler angles (Etkin and Reid, Dynamics of Flight, 3rd ed., eqs (4.4,3), (4.4,7)).
    """
    arm = np.array([0.7, -0.4, 0.3])

    def angles(t: float) -> Array:
        return np.array([0.3 * np.sin(2.0 * t), 0.1 + 0.2 * np.cos(1.5 * t), 0.4 * np.sin(1.1 * t) + 0.2 * t])

    def to_earth(t: float) -> Array:
        phi, theta, psi = angles(t)
        roll = np.array([[1, 0, 0], [0, np.cos(phi), -np.sin(phi)], [0, np.sin(phi), np.cos(phi)]])
        pitch = np.array([[np.cos(theta), 0, np.sin(theta)], [0, 1, 0], [-np.sin(theta), 0, np.cos(theta)]])
        yaw = np.array([[np.cos(psi), -np.sin(psi), 0], [np.sin(psi), np.cos(psi), 0], [0, 0, 1]])
        return yaw @ pitch @ roll

    def rates(t: float) -> Array:
        phi, theta, _ = angles(t)
        phi_dot = 0.6 * np.cos(2.0 * t)
        theta_dot, psi_dot = -0.3 * np.sin(1.5 * t), 0.44 * np.cos(1.1 * t) + 0.2
        return np.array(
            [
                phi_dot - psi_dot * np.sin(theta),
                theta_dot * np.cos(phi) + psi_dot * np.cos(theta) * np.sin(phi),
                -theta_dot * np.sin(phi) + psi_dot * np.cos(theta) * np.cos(phi),
            ]
        )

    t, h = 0.83, 1e-3
    steps = range(-2, 3)
    second = np.array([-1, 16, -30, 16, -1]) / (12 * h * h)  # fourth order
    first = np.array([1, -8, 0, 8, -1]) / (12 * h)
    path = sum(w * to_earth(t + k * h) @ arm for w, k in zip(second, steps, strict=True))
    changes = sum(w * rates(t + k * h) for w, k in zip(first, steps, strict=True))
    found = sensors.rotation_acceleration(rates(t), changes, (0.7, -0.4, 0.3))
    np.testing.assert_allclose(found, to_earth(t).T @ path, rtol=0, atol=1e-8)
    truth = {"airspeed_m_s": np.array([40.0]), "alpha_rad": np.array([0.1]), "beta_rad": np.array([0.05])}
    truth |= {f"{a}_rad_s": np.array([v]) for a, v in zip("pqr", rates(t), strict=True)}
    truth |= {f"{a}_dot_rad_s2": np.array([v]) for a, v in zip("pqr", changes, strict=True)}
    truth |= {f"a{a}_m_s2": np.array([v]) for a, v in zip("xyz", (0.3, 1.0, -9.8), strict=True)}
    errors = SensorErrors(x_m=0.7, y_m=-0.4, z_m=0.3)
    for k, (axis, own) in enumerate(zip("xyz", (0.3, 1.0, -9.8), strict=True)):
        moved = sensors.at_instrument(f"a{axis}_m_s2", truth, errors)
        assert moved[0] == pytest.approx(own + found[k], abs=1e-14)
    p, q, r = rates(t)
    assert sensors.at_instrument("alpha_rad", truth, errors)[0] == pytest.approx(
        0.1 - q * 0.7 / 40 + p * -0.4 / 40, abs=1e-15
    )
    assert sensors.at_instrument("beta_rad", truth, errors)[0] == pytest.approx(
        0.05 + 0.7 * r / 40 - 0.3 * p / 40, abs=1e-15
    )


def test_vanes_off_the_plane_of_symmetry_against_the_flow_at_the_vane() -> None:
    """Flow at the vane, V + omega x r: alpha = atan(w/u), beta = asin(v/V); slow rates, so that first order suffices."""
    v, alpha, beta = 42.85, 0.09, 0.02
    omega, arm = np.array([2e-3, -1e-3, 1.5e-3]), np.array([0.5, 1.07, -0.2])
    own = v * np.array([np.cos(alpha) * np.cos(beta), np.sin(beta), np.sin(alpha) * np.cos(beta)])
    flow = own + np.cross(omega, arm)
    p, q, r = omega
    alpha_vane = sensors.vane_equation(alpha, q, 0.5, v) + p * 1.07 / v
    # the change of the flow is turned by alpha against the vane's axis: cos(alpha), and a forward part
    expected = np.arctan2(flow[2], flow[0])
    assert alpha_vane == pytest.approx(expected, abs=2e-2 * abs(alpha_vane - alpha) + 1e-5)
    assert sensors.side_vane_equation(beta, p, r, 0.5, -0.2, v) == pytest.approx(
        np.arcsin(flow[1] / np.linalg.norm(flow)), abs=2e-6
    )


@given(st.floats(-2, 2), st.floats(-2, 2), st.floats(-2, 2))
def test_a_flight_without_roll_and_yaw_reads_as_one_in_the_pitch_plane(x: float, y: float, z: float) -> None:
    """The general terms reduce to those of the pitch plane; y then has no effect on the channels of this plane."""
    rng = np.random.default_rng(3)
    names = ("airspeed_m_s", "alpha_rad", "q_rad_s", "q_dot_rad_s2", "ax_m_s2", "az_m_s2")
    plane = {name: rng.standard_normal(5) + 3.0 for name in names}
    still = {f"{axis}_{unit}": np.zeros(5) for axis in "pr" for unit in ("rad_s", "dot_rad_s2")}
    errors = SensorErrors(x_m=x, y_m=y, z_m=z)
    for name in ("alpha_rad", "ax_m_s2", "az_m_s2"):
        np.testing.assert_allclose(
            sensors.at_instrument(name, plane | still, errors),
            sensors.at_instrument(name, plane, errors),
            rtol=1e-13,
            atol=1e-13,
        )
