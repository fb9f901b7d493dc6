"""The elevator at rest: its noise is no motion."""

import numpy as np
import pytest
import trace_records as tr

from airtruth.logs.flight_log import FlightLog
from airtruth.physics.motion import LONGITUDINAL
from airtruth.tracing.model.reading import MeasuredControl, read
from airtruth.units import DEG

STD = 0.02 * DEG
T = np.arange(500) * 0.02


def restored(elevator, std=STD):
    """The elevator at the samples, as the tracer reads it."""
    channels = {
        name: np.zeros(500) for name in ("alpha_rad", "q_rad_s", "az_m_s2", "theta_rad", "altitude_m")
    }
    channels |= {"airspeed_m_s": np.full(500, tr.V), "elevator_rad": elevator}
    (signals,) = read(
        FlightLog({}, ("a",), np.array([0, 500]), T, channels), LONGITUDINAL, [MeasuredControl(std)]
    )
    return signals.elevator_rad[:: (signals.elevator_rad.size - 1) // 499]


@pytest.mark.parametrize("seed", range(5))
def test_each_rest_has_the_mean_of_its_samples(seed):
    """Rests of 1 to 5 s between steps: nothing remains but the error of a mean, STD/sqrt(50) to STD/sqrt(250)."""
    exact = np.select([T < 1.0, T < 2.5, T < 5.0], [0.0, 1.5 * DEG, -1.5 * DEG], 0.0)
    found = restored(exact + STD * np.random.default_rng(seed).standard_normal(500))
    for start, end in ((0, 50), (50, 125), (125, 250), (250, 500)):
        rest = found[start + 6 : end - 6]
        assert np.ptp(rest) == 0.0
        assert abs(rest[0] - exact[start + 6]) < 4.0 * STD / np.sqrt(end - start)


def test_the_end_of_a_servo_s_motion_is_not_taken_for_rest():
    """Steps through a lag of 32 ms, 0.3 to 1 s apart: beyond three standard deviations of the noise e, e^2/A of a step A may
    be left where the rest begins, and the mean of a rest moves by less.

    A mean over the whole end would be off by two standard deviations at its start.
    """
    steps = np.diff(np.select([T < 1.0, T < 2.0, T < 2.6, T < 2.9], [0.0, 1.0, -1.0, 1.0], 0.0) * DEG)
    exact = np.zeros(500)
    for at in np.flatnonzero(steps):
        exact[at + 1 :] += steps[at] * -np.expm1(-(T[at + 1 :] - T[at]) / 0.032)
    assert np.abs(restored(exact) - exact).max() < (3.0 * STD) ** 2 / DEG
    noise = STD * np.random.default_rng(5).standard_normal(500)
    assert np.abs(restored(exact + noise) - exact - noise)[50:56].max() < 1e-12


def test_a_slow_motion_within_the_noise_is_kept():
    """A drift of three standard deviations over 10 s, with noise and without: the mean would be off by 1.5 at its ends."""
    exact = 3.0 * STD * T / T[-1]
    noisy = restored(exact + STD * np.random.default_rng(1).standard_normal(500))
    for found in (noisy, restored(exact)):
        assert np.abs(found - exact)[10:-10].max() < 1.6 * STD
        assert found[-60:].mean() - found[:60].mean() == pytest.approx(2.64 * STD, rel=0.25)


def test_a_single_outlier_is_no_motion():
    elevator = STD * np.random.default_rng(2).standard_normal(500)
    elevator[250] = 4.0 * STD
    assert np.ptp(restored(elevator)[10:-10]) == 0.0


def test_without_a_declared_noise_every_sample_is_kept():
    elevator = STD * np.random.default_rng(3).standard_normal(500)
    assert restored(elevator, 0.0) == pytest.approx(elevator, abs=1e-15)
