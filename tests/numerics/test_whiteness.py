"""Von Neumann's ratio of white noise, of correlated noise and of a line; the noise of a signal at rest."""

import numpy as np
import pytest

from airtruth.numerics.whiteness import is_white, noise_at_rest


def test_the_ratio_of_von_neumann():
    """White noise has a ratio of 1, coloured one 1 less its first correlation, a line 6/n^2."""
    rng = np.random.default_rng(4)
    white = rng.standard_normal((400, 100))
    assert is_white(white).mean() > 0.99
    coloured = np.array([np.convolve(row, np.exp(-np.arange(30) / 8.0), "valid") for row in white])
    assert is_white(coloured).mean() < 0.01
    assert not is_white(np.arange(12.0))
    assert is_white(np.ones(12))


@pytest.mark.parametrize("samples", [10, 50])
def test_noise_at_rest_is_that_before_and_after_a_manoeuvre(samples):
    """24 s, of which the signal moves for 6 s with 100 times the noise; 18 s at 10 Hz know it to 5 %, and windows are chosen."""
    t = np.arange(24 * samples) / samples
    motion = np.where((t > 4.0) & (t < 10.0), np.sin(2.0 * np.pi * 0.7 * (t - 4.0)), 0.0)
    found = []
    for seed in range(20):
        noise = 0.01 * np.random.default_rng(seed).standard_normal(t.size)
        found.append(noise_at_rest(motion + noise, samples))
    assert np.mean(found) == pytest.approx(0.01, rel=0.1)
    assert np.std(found) < 0.1 * 0.01


def test_a_signal_without_noise_or_without_rest_shows_none():
    t = np.arange(240) / 10.0
    step = np.where(t > 4.0, 1.0, 0.0)
    assert noise_at_rest(step, 10) == 0.0
    assert noise_at_rest(np.sin(0.9 * t) + 0.3 * np.sin(2.3 * t), 10) == 0.0
    assert noise_at_rest(step[:5], 10) == 0.0
