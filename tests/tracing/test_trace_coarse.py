"""The surface between the samples of a coarse log: that of the declared servo, or a spline."""

import numpy as np
import pytest

from airtruth.physics.terms import SurfaceTerm
from airtruth.tracing.model.servo_surface import held_command, is_held, shaped, smooth, with_steps
from airtruth.tracing.model.surface import through
from airtruth.tracing.model.surface_path import read_between
from airtruth.units import DEG

TAU = 1.0 / (2.0 * np.pi * 5.0)
FINE = 64


def servo(t, edges, levels, tau=TAU):
    """Exact motion of a first-order servo from rest, its command stepping to each level at its edge."""
    value, last, before = np.zeros_like(t), 0.0, 0.0
    for edge, level in zip(edges, levels, strict=True):
        after = t >= edge
        value[after] += (level - before) * (1.0 - np.exp(-(t[after] - edge) / tau))
        last, before = level, level
    assert last == levels[-1]
    return value


@pytest.mark.parametrize("dt", [0.04, 0.064, 0.1])
@pytest.mark.parametrize("first", [1.0, 1.013, 1.037])
def test_a_held_command_is_restored(dt, first):
    """A 3-2-1-1 of 0.3 s; without noise to a thousandth of its range, wherever its edges lie between the samples."""
    edges = first + 0.3 * np.array([0.0, 3.0, 5.0, 6.0, 7.0])
    levels = DEG * np.array([1.0, -1.0, 1.0, -1.0, 0.0])
    samples = round(6.0 / dt)
    t = np.arange(samples * FINE + 1) * dt / FINE
    exact = servo(t, edges, levels)
    path = held_command(exact[::FINE], dt, TAU, FINE)
    assert path is not None
    assert np.abs(path - exact).max() < 1e-3 * np.ptp(exact)
    linear = np.interp(t, t[::FINE], exact[::FINE])
    assert np.abs(linear - exact).max() > 0.05 * np.ptp(exact)


def test_noise_of_the_sensor_moves_the_mean_of_a_cell_by_its_own_size():
    dt, noise = 0.1, 0.01 * DEG
    t = np.arange(60 * FINE + 1) * dt / FINE
    exact = servo(t, [1.037, 1.54, 2.061], DEG * np.array([2.0, -2.0, 0.0]))
    rng = np.random.default_rng(1)
    path = held_command(exact[::FINE] + noise * rng.standard_normal(61), dt, TAU, FINE)
    error = (path - exact)[:-1].reshape(-1, FINE).mean(axis=1)
    assert error.std() < 2.0 * noise


def test_a_surface_that_moves_otherwise_is_none():
    t = np.arange(80) * 0.1
    assert held_command(np.sin(2.0 * np.pi * 1.3 * t), 0.1, TAU, FINE) is None
    assert held_command(np.zeros(80), 0.1, TAU, FINE) is None


def test_a_spline_follows_a_line_of_the_multisine():
    """A quarter of the sample rate: half the largest error of the mean over a cell that straight lines have, or less."""
    t = np.arange(40 * FINE + 1) * 0.1 / FINE
    exact = np.sin(2.0 * np.pi * 2.5 * t + 0.4)
    inner = slice(10 * FINE, 30 * FINE)
    mean = [
        np.abs((made - exact)[inner].reshape(-1, FINE).mean(axis=1)).max()
        for made in (smooth(exact[::FINE], FINE), np.interp(t, t[::FINE], exact[::FINE]))
    ]
    assert mean[0] < 0.5 * mean[1]
    np.testing.assert_allclose(smooth(exact[::FINE], FINE)[::FINE], exact[::FINE], atol=1e-14)


# -- a log of 50 Hz

DT_50, CELLS = 0.02, 64


def damped(noise=0.0, first=1.007):
    """A 3-2-1-1 on top of a damper that commands a sine of 1 Hz every sample period, 15 ms late: fine time and surface."""
    t = np.arange(300 * CELLS + 1) * DT_50 / CELLS
    pilot = servo(
        t, first + 0.3 * np.array([0.0, 3.0, 5.0, 6.0, 7.0]), DEG * np.array([3.0, -3.0, 3.0, -3.0, 0.0])
    )
    times = DT_50 * np.arange(300) + 0.015
    command = 0.5 * DEG * np.sin(2.0 * np.pi * times)
    command += noise * np.random.default_rng(2).standard_normal(300)
    return t, pilot + servo(t, times, command)


def means(x):
    return x[:-1].reshape(-1, CELLS).mean(axis=1)


def test_steps_of_a_damped_surface_follow_the_servo():
    """The error of the mean over a cell is at most a fifth of that of a spline through the samples."""
    _, exact = damped()
    samples = exact[::CELLS]
    assert not is_held(samples, DT_50, TAU)
    cubic = smooth(samples, CELLS)
    path, steps = with_steps(samples, cubic, DT_50, TAU, CELLS)
    worst = [np.abs(means(made - exact)).max() for made in (path, cubic)]
    assert worst[0] < 0.2 * worst[1]
    assert 5 <= steps.sum() <= 15
    np.testing.assert_allclose(path[::CELLS], samples, rtol=1e-14)


def test_a_held_command_rests_between_its_steps():
    t = np.arange(300 * CELLS + 1) * DT_50 / CELLS
    samples = servo(t, [1.007, 2.013], DEG * np.array([2.0, 0.0]))[::CELLS]
    assert is_held(samples, DT_50, TAU)


def test_a_path_takes_the_means_of_another():
    rng = np.random.default_rng(3)
    path = np.cumsum(rng.standard_normal(5 * CELLS + 1))
    mean = path.copy()
    mean[np.arange(mean.size) % CELLS > 0] += 0.3
    made = shaped(mean, path, CELLS)
    np.testing.assert_allclose(means(made), means(mean), rtol=0.0, atol=1e-12)
    np.testing.assert_array_equal(made[::CELLS], path[::CELLS])


@pytest.mark.parametrize("rate_rad_s", [0.28, 0.43, 0.8])
def test_a_rate_limit_sees_when_the_surface_begins_to_move(rate_rad_s):
    """The limited surface from samples of 50 Hz is on average as far off as 0.3 ms of its motion; straight lines begin up to a
    period early, and leave four times as much or more."""
    t = np.arange(300 * CELLS + 1) * DT_50 / CELLS
    exact = servo(t, [1.013, 2.011], DEG * np.array([4.0, -4.0]))
    limit = [SurfaceTerm("rate_limit", rate_rad_s)]
    right = through(limit, exact, DT_50 / CELLS)
    path = read_between(exact[::CELLS], DT_50, CELLS, 0.0, 0.0).surface_rad
    straight = np.interp(t, t[::CELLS], exact[::CELLS])
    late = [
        np.abs(through(limit, made, DT_50 / CELLS) - right).sum()
        / (np.abs(np.diff(right)) > 0.0).sum()
        / rate_rad_s
        for made in (path, straight)
    ]
    assert late[0] < 3e-4
    assert late[1] > 4.0 * late[0]
