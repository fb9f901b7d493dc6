"""Steps behind a filter against aliasing are told from steps, lags and noise, and their samples determine them."""

import numpy as np
import pytest
from scipy.signal import firwin, kaiserord

from airtruth.numerics.band_limited import band_limited, is_band_limited

FINE = 16
"""Points of the truth in a sample [-]."""


def steps(width, at=100.3, count=400):
    """A doublet on the fine grid; its steps are ``width`` samples apart."""
    t = np.arange((count - 1) * FINE + 1) / FINE
    return np.where((t >= at) & (t < at + width), 1.0, 0.0) - np.where(
        (t >= at + width) & (t < at + 2 * width), 1.0, 0.0
    )


def filtered(x, edges):
    """Without lag, with the pass band and the stop band of a recorder as shares of its rate."""
    taps, beta = kaiserord(70.0, 2.0 * (edges[1] - edges[0]) / FINE)
    low_pass = firwin(taps | 1, np.mean(edges), window=("kaiser", beta), fs=FINE)
    return np.convolve(np.pad(x, low_pass.size // 2, mode="edge"), low_pass, mode="valid")


@pytest.mark.parametrize("edges", [(0.3, 0.45), (0.4, 0.48), (0.4, 0.5)])
@pytest.mark.parametrize("width", [4.0, 10.0, 12.7])
def test_a_recorder_that_takes_out_the_upper_band_is_recognised(edges, width):
    truth = filtered(steps(width), edges)
    assert is_band_limited(truth[::FINE])
    np.testing.assert_allclose(band_limited(truth[::FINE], FINE), truth, atol=2e-3)


@pytest.mark.parametrize("width", [2.0, 4.0, 6.0, 10.0, 12.7])
@pytest.mark.parametrize("decay", [0.0, 0.3, 0.8])
def test_steps_and_servos_are_not(width, decay):
    x = steps(width)[::FINE]
    for _ in range(2):
        assert not is_band_limited(x)
        y = np.zeros_like(x)
        for k in range(1, x.size):
            y[k] = decay * y[k - 1] + (1.0 - decay) * x[k]
        x = y
    assert not is_band_limited(x)


def test_noise_of_the_samples_is_not():
    noise = 0.02 * np.random.default_rng(1).standard_normal(400)
    assert not is_band_limited(filtered(steps(10.0), (0.4, 0.5))[::FINE] + noise)
    assert not is_band_limited(noise)
    assert not is_band_limited(np.zeros(400))
