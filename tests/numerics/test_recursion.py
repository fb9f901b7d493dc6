"""The recursion against scipy.signal.lfilter, an independent implementation."""

import numpy as np
import pytest
from scipy.signal import lfilter

from airtruth.numerics.recursion import low_pass, recursion


@pytest.mark.parametrize("pole", [0.9, -0.3, 0.0, 0.95 * np.exp(0.4j)])
def test_it_is_the_filter_with_a_state(pole):
    rng = np.random.default_rng(1)
    driven, before = rng.normal(size=(3, 50)), rng.normal(size=3)
    expected, _ = lfilter([1.0], [1.0, -pole], driven.astype(complex), zi=pole * before[:, None])
    np.testing.assert_allclose(recursion(pole, driven, before), expected, rtol=1e-13, atol=1e-13)


def test_a_low_pass_has_gain_one_at_rest():
    x = np.ones(400)
    np.testing.assert_allclose(low_pass(0.9, x), 1.0 - 0.9 ** np.arange(1, 401), rtol=1e-13)


def test_no_samples_are_no_samples():
    assert recursion(0.5, np.zeros((2, 0))).shape == (2, 0)
