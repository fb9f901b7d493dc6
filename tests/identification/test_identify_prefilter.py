"""The zero-phase low-pass against scipy, and against what a Butterworth filter is."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import butter, sosfiltfilt

from airtruth.numerics.prefilter import butterworth, edge_samples, zero_phase


@pytest.mark.parametrize("order", [1, 2, 3, 4, 5, 6])
@pytest.mark.parametrize("rows", [1, 3, 4, 9])
def test_equals_scipy_sosfiltfilt(order, rows):
    x = np.random.default_rng(order).normal(size=(rows, 120))
    sos = butterworth(5.0, order, 0.02)
    expected = sosfiltfilt(butter(order, 5.0, fs=50.0, output="sos"), x, axis=-1)
    np.testing.assert_allclose(zero_phase(x, sos), expected, rtol=0.0, atol=1e-12)


def test_edge_of_the_papers_filter_is_scipys_default():
    """filtfilt's default: three times the five coefficients of a fourth-order filter."""
    assert edge_samples(butterworth(5.0, 4, 0.02)) == 15


@pytest.mark.parametrize("rate", [50, 100, 200, 400, 800])
def test_an_extension_is_a_time_at_any_rate(rate):
    """The slowest mode of the fourth order decays at the rate 2 pi 5 sin(pi/8) = 12.0 1/s: to 0.04 in 0.27 s."""
    seconds = edge_samples(butterworth(5.0, 4, 1.0 / rate)) / rate
    assert 0.26 < seconds <= 0.3


def test_gain_is_the_square_of_one_pass_without_lag():
    """A sinusoid at f comes out times 1/(1 + (tan(pi f/fs)/tan(pi fc/fs))^8), in phase (order 4)."""
    dt, cutoff = 0.02, 5.0
    t = np.arange(3000) * dt
    for frequency in (1.0, 5.0, 9.0):
        x = np.sin(2.0 * np.pi * frequency * t)[None]
        ratio = np.tan(np.pi * frequency * dt) / np.tan(np.pi * cutoff * dt)
        y = zero_phase(x, butterworth(cutoff, 4, dt))
        np.testing.assert_allclose(y[0, 500:-500], x[0, 500:-500] / (1.0 + ratio**8), atol=1e-9)


@settings(max_examples=30, deadline=None)
@given(st.floats(-100.0, 100.0), st.floats(-10.0, 10.0))
def test_a_ramp_passes_unchanged(level, slope):
    """Odd extension continues a straight line; a zero-phase filter of unit gain leaves it alone."""
    x = (level + slope * np.arange(200) * 0.02)[None]
    y = zero_phase(x, butterworth(5.0, 4, 0.02))
    # the equilibrium that each pass starts in is that of a constant: the slope shows near the ends only
    np.testing.assert_allclose(y[0, 80:-80], x[0, 80:-80], atol=1e-6 * (1.0 + abs(level) + abs(slope)))


def test_a_row_does_not_depend_on_its_neighbours():
    x = np.random.default_rng(1).normal(size=(20, 90))
    sos = butterworth(5.0, 4, 0.02)
    together = zero_phase(x, sos)
    for row in range(20):
        assert (zero_phase(x[row : row + 1], sos)[0] == together[row]).all()
    zero_phase(x, sos, in_place=True)
    assert (x == together).all()
