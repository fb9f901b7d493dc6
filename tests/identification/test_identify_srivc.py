"""SRIVC on systems that are known, from the first order to the fourth."""

import numpy as np
import pytest
from scipy.signal import TransferFunction, lsim

from airtruth.errors import ConfigurationError
from airtruth.identification import identify_actuator
from airtruth.identification.regression.lowpass import estimated_elevator
from airtruth.numerics.srivc import filter_states, simulate, srivc
from validation.linear_flight import DEG, SERVO_RAD_S, fly

# b, a of B/A: a servo; a second-order actuator; a numerator zero; the Rao-Garnier system of the SRIVC
# literature, B = -6400 p + 1600, A = p^4 + 5 p^3 + 408 p^2 + 416 p + 1600 (Garnier and Young).
SYSTEMS = {
    "servo": ([31.4], [1.0, 31.4]),
    "second order": ([400.0], [1.0, 28.0, 400.0]),
    "with a zero": ([3.0, 12.0], [1.0, 2.8, 16.0]),
    "Rao-Garnier": ([-6400.0, 1600.0], [1.0, 5.0, 408.0, 416.0, 1600.0]),
}


def prbs(samples, hold, seed):
    """A held random binary sequence that starts at rest."""
    levels = np.random.default_rng(seed).choice([-1.0, 1.0], size=samples // hold + 1)
    levels[: 1 + 50 // hold] = 0.0
    return np.repeat(levels, hold)[:samples]


def response(system, u, dt):
    """Output for an input held between samples, by scipy on a grid 20 times finer."""
    fine = np.repeat(u, 20)[: 20 * (u.size - 1) + 1]
    t = np.arange(fine.size) * dt / 20
    y = lsim(TransferFunction(*system), fine, t, interp=False)[1]
    return y[::20]


@pytest.mark.parametrize("name", list(SYSTEMS))
def test_known_systems_without_noise(name):
    b, a = SYSTEMS[name]
    dt = 0.01
    u = prbs(3000, 13, seed=2)
    y = response((b, a), u, dt)
    start = abs(a[-1]) ** (1.0 / (len(a) - 1))
    found = srivc(u[None], y[None] + 0.7, dt, len(a) - 1, len(b), start, tolerance=1e-8)
    assert found.converged.all()
    np.testing.assert_allclose(found.a[0], a[1:], rtol=1e-5)
    np.testing.assert_allclose(found.b[0], b, rtol=1e-5)


@pytest.mark.parametrize("name", ["servo", "second order"])
def test_known_systems_with_noise_are_consistent(name):
    """Output noise of 10 %: the mean of 100 runs is right within four of its standard errors."""
    b, a = SYSTEMS[name]
    dt, runs = 0.01, 100
    u = prbs(600, 17, seed=3)
    y = response((b, a), u, dt)
    noise = 0.1 * np.std(y) * np.random.default_rng(4).normal(size=(runs, y.size))
    found = srivc(np.tile(u, (runs, 1)), y + noise, dt, len(a) - 1, len(b), 20.0)
    assert found.converged.all()
    every = np.concatenate([found.a, found.b], axis=1)
    truth = np.concatenate([a[1:], b])
    error = every.mean(axis=0) - truth
    assert (np.abs(error) < 4.0 * every.std(axis=0, ddof=1) / np.sqrt(runs)).all()
    assert (every.std(axis=0) < 0.05 * np.abs(truth)).all()


def test_the_servo_of_a_flight_log():
    """The 5 Hz servo from a doublet at 50 Hz: to 1e-6 without noise."""
    batch = fly()
    found = identify_actuator(
        batch.channels["elevator_command_rad"], batch.channels["elevator_rad"], batch.dt_s
    )
    assert found.a[0, 0] == pytest.approx(SERVO_RAD_S, rel=1e-5)
    assert found.b[0, 0] == pytest.approx(SERVO_RAD_S, rel=1e-5)


@pytest.mark.grid
@pytest.mark.parametrize("late", [0, 15])
def test_a_step_between_slow_samples_has_a_servo(late):
    """Steps 10 ms after a sample at 20 Hz: the surface leads any servo behind a command that is held from the next sample."""
    fine, every = 0.001, 50
    t = np.arange(8000) * fine
    command = 3.0 * DEG * np.sign((t >= 1.01) * 1.0 - 2.0 * (t >= 1.51) + (t >= 2.01))
    reached = np.concatenate([np.zeros(late), command[: command.size - late]])
    surface = response(([SERVO_RAD_S], [1.0, SERVO_RAD_S]), reached, fine)[::every]
    logged = command[::every]
    assert not identify_actuator(logged[None], surface[None], 0.05).converged.any()
    found, failed = estimated_elevator(logged[None], surface[None], 0.05)
    assert not failed.any()
    assert np.abs(found[0] - surface).max() < 0.1 * np.abs(surface).max()


def test_a_linear_input_hold():
    """u rising linearly over each step, stated as such, against a ramp response in closed form."""
    dt, rate = 0.05, 6.0
    t = np.arange(80) * dt
    u = np.where(t < 2.0, t, 4.0 - t)
    states = filter_states(np.array([[rate]]), u[None], dt, "foh")
    ramp = (t - (1.0 - np.exp(-rate * t)) / rate) / rate
    np.testing.assert_allclose(states[0, 0, t <= 2.0], ramp[t <= 2.0], atol=1e-14)


def test_simulation_of_the_estimate_is_its_output():
    b, a = SYSTEMS["second order"]
    u = prbs(500, 11, seed=5)
    y = response((b, a), u, 0.01)
    found = srivc(u[None], y[None], 0.01, 2, 1, 20.0, tolerance=1e-9)
    np.testing.assert_allclose(simulate(found, u[None], 0.01)[0], y, atol=1e-6)


def test_what_cannot_be_identified_is_not_a_number():
    rng = np.random.default_rng(6)
    u = np.stack([np.zeros(300), prbs(300, 9, seed=7)])
    y = np.stack([rng.normal(size=300), response(SYSTEMS["servo"], u[1], 0.01)])
    found = srivc(u, y, 0.01, 1, 1, 30.0)
    assert found.converged.tolist() == [False, True]
    assert np.isnan(found.a[0]).all()


@pytest.mark.parametrize(("na", "nb", "hold"), [(1, 2, "zoh"), (1, 0, "zoh"), (1, 1, "linear")])
def test_orders_and_hold_are_checked(na, nb, hold):
    with pytest.raises(ConfigurationError, match="allowed"):
        srivc(np.zeros((1, 50)), np.zeros((1, 50)), 0.01, na, nb, 10.0, hold=hold)


def test_actuator_of_a_noisy_log_is_close():
    """Elevator noise 0.01 deg in 2 deg: the bandwidth within 2 % in each of 20 runs."""
    batch = fly(runs=20, noise=1.0, seed=3, amplitude_rad=2.0 * DEG)
    found = identify_actuator(
        batch.channels["elevator_command_rad"], batch.channels["elevator_rad"], batch.dt_s
    )
    assert found.converged.all()
    assert np.abs(found.a[:, 0] / SERVO_RAD_S - 1.0).max() < 0.02
