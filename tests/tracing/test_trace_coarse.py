"""The surface between the samples of a coarse log: that of the declared servo, or a spline."""

import numpy as np
import pytest

from airtruth.tracing.model.elevator import held_command, smooth
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
