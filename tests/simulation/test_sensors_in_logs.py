"""Sensors as stated arrive in the logs of a campaign: each against the same flights with ideal sensors."""

import numpy as np
import pytest
from fly_campaigns import channel, fly
from scipy.signal import lsim
from scipy.stats import norm
from tiers import sampled

from airtruth.channels import SIGNALS

FINE = {"log_hz": 200.0, "duration_s": 3.0, "runs": 6}
DT = 1 / 200
EXACT = {"noise_std": 0.0, "bias": 0.0, "delay": 0.0, "hold": 0.0, "quantum": 0.0}


@pytest.fixture(scope="module")
def ideal(tmp_path_factory):
    return fly(tmp_path_factory.mktemp("ideal"), sensors={"ideal": True}, **FINE)


def table(name, **entries):
    """A sensor that does what is stated and nothing else; values in SI."""
    dimensions = {"lag": "s", "delay": "s", "hold": "s", "x": "m", "z": "m", "scale": ""}
    units = {"angle": "rad", "angular_rate": "rad_s", "speed": "m_s", "acceleration": "m_s2", "length": "m"}
    unit = units[SIGNALS[name].dimension]
    return {k: {"value": float(v), "unit": dimensions.get(k, unit)} for k, v in (EXACT | entries).items()}


def logged(folder, name, **entries):
    return channel(fly(folder, sensors={"channel": {name: table(name, **entries)}}, **FINE), name)


@pytest.fixture(scope="module")
def shipped(tmp_path_factory):
    return fly(tmp_path_factory.mktemp("shipped"), **FINE)


# NASA GTM_DesignSim, NoiseParams_T2: standard deviations and biases, here in SI.
DEG, G, KT, FT = np.pi / 180, 9.80665, 1852 / 3600, 0.3048
GTM = {
    "airspeed_m_s": (0.06 * KT, 0.07 * KT),
    "alpha_rad": (0.031 * DEG, 0.0),
    "q_rad_s": (0.3857 * DEG, 0.1547 * DEG),
    "ax_m_s2": (0.0016 * G, 0.0162 * G),
    "az_m_s2": (0.0082 * G, 0.0009 * G),
    "elevator_rad": (0.01 * DEG, 0.0),
    "altitude_m": (2.36 * FT, 0.0),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", GTM)
def test_noise_is_white_and_of_the_stated_size(ideal, shipped, name):
    std, bias = GTM[name]
    noise = channel(shipped, name) - channel(ideal, name)
    n = noise.size
    assert abs(noise.mean() - bias) < 4 * std / np.sqrt(n)
    assert abs(noise.std(ddof=1) / std - 1) < 4 / np.sqrt(2 * n)
    centred = noise - bias
    for lag in (1, 2, 4):
        assert abs((centred[:, lag:] * centred[:, :-lag]).mean() / std**2) < 4 / np.sqrt(n)
    # Normal: the largest deviation stays below the bound that n draws pass with probability 1e-4.
    assert np.abs(centred).max() / std < norm.isf(0.5e-4 / n)


@pytest.mark.slow
def test_noises_of_channels_and_runs_are_independent(ideal, shipped):
    noise = np.concatenate([(channel(shipped, n) - channel(ideal, n) - b) / s for n, (s, b) in GTM.items()])
    correlation = noise @ noise.T / noise.shape[1]
    np.fill_diagonal(correlation, 0.0)
    assert np.abs(correlation).max() < 5 / np.sqrt(noise.shape[1])  # 861 pairs


def test_channels_without_a_sensor_are_logged_as_they_are(ideal, shipped):
    for name in ("elevator_command_rad", "throttle", "density_kg_m3"):
        np.testing.assert_array_equal(channel(shipped, name), channel(ideal, name))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("entries", "expected"),
    sampled(
        [
            ({"bias": 0.02}, lambda q: q + 0.02),
            ({"scale": 1.1}, lambda q: 1.1 * q),
            ({"scale": 0.9, "bias": -0.1}, lambda q: 0.9 * q - 0.1),
            ({"minimum": -0.05, "maximum": 0.03}, lambda q: np.clip(q, -0.05, 0.03)),
            ({"quantum": 0.01}, lambda q: 0.01 * np.round(q / 0.01)),
            ({"delay": 0.02}, lambda q: np.concatenate([np.repeat(q[:, :1], 4, 1), q[:, :-4]], 1)),
            ({"hold": 0.05}, lambda q: np.repeat(q[:, ::10], 10, 1)[:, : q.shape[1]]),
        ],
        3,
    ),
)
def test_one_error_at_a_time(ideal, tmp_path, entries, expected):
    truth = channel(ideal, "q_rad_s")
    got = logged(tmp_path, "q_rad_s", **entries)
    different = np.abs(got - expected(truth)) > 1e-7
    # Rounding of the logged float32 decides a value that lies on the border of a step.
    assert different.mean() < (1e-3 if "quantum" in entries else 1e-12)


@pytest.mark.slow
def test_delay_between_samples_is_linear(ideal, tmp_path):
    q, t = channel(ideal, "q_rad_s"), np.arange(601) * DT
    got = logged(tmp_path, "q_rad_s", delay=0.012)
    expected = np.stack([np.interp(t - 0.012, t, run) for run in q])
    np.testing.assert_allclose(got, expected, atol=1e-6)


@pytest.mark.slow
def test_lag_is_first_order(ideal, tmp_path):
    alpha, t = channel(ideal, "alpha_rad"), np.arange(601) * DT
    got = logged(tmp_path, "alpha_rad", lag=0.04)
    expected = np.stack([a[0] + lsim(([1.0], [0.04, 1.0]), a - a[0], t)[1] for a in alpha])
    np.testing.assert_allclose(got, expected, atol=1e-7)


@pytest.mark.long
@pytest.mark.slow
def test_lag_in_coarse_logs_is_that_of_the_simulation(tmp_path):
    """A lag is computed at 200 Hz whatever the rate of the log."""
    fine = logged(tmp_path / "fine", "alpha_rad", lag=0.013)
    coarse = FINE | {"log_hz": 50.0}
    slow = channel(
        fly(tmp_path / "slow", sensors={"channel": {"alpha_rad": table("alpha_rad", lag=0.013)}}, **coarse),
        "alpha_rad",
    )
    np.testing.assert_array_equal(slow, fine[:, ::4])


@pytest.mark.slow
def test_vane_ahead_of_the_cg(ideal, tmp_path):
    got = logged(tmp_path, "alpha_rad", x=0.5)
    expected = channel(ideal, "alpha_rad") - channel(ideal, "q_rad_s") * 0.5 / channel(ideal, "airspeed_m_s")
    np.testing.assert_allclose(got, expected, atol=2e-8)


@pytest.mark.slow
def test_accelerometer_ahead_of_the_cg(ideal, tmp_path):
    """az - az_cg = -x q_dot; its integral is -x (q - q0), by the trapezoidal rule over 5 ms."""
    got = logged(tmp_path, "az_m_s2", x=0.5) - channel(ideal, "az_m_s2")
    q = channel(ideal, "q_rad_s")
    integral = np.cumsum(0.5 * (got[:, 1:] + got[:, :-1]), axis=1) * DT
    np.testing.assert_allclose(integral, -0.5 * (q[:, 1:] - q[:, :1]), atol=0.02 * 0.5 * np.ptp(q))


@pytest.mark.slow
def test_elevator_noise_does_not_move_the_aircraft(ideal, tmp_path):
    loud = fly(tmp_path, sensors={"channel": {"elevator_rad": table("elevator_rad", noise_std=0.1)}}, **FINE)
    np.testing.assert_array_equal(channel(loud, "throttle"), channel(ideal, "throttle"))
    assert np.std(channel(loud, "elevator_rad") - channel(ideal, "elevator_rad")) > 0.09
    q = channel(loud, "q_rad_s") - channel(ideal, "q_rad_s")
    assert abs(q.std() / GTM["q_rad_s"][0] - 1) < 4 / np.sqrt(2 * q.size)
