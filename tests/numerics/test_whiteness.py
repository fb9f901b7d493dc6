"""Von Neumann's ratio of white noise, of correlated noise and of a line."""

import numpy as np

from airtruth.numerics.whiteness import is_white


def test_the_ratio_of_von_neumann():
    """White noise has a ratio of 1, coloured one 1 less its first correlation, a line 6/n^2."""
    rng = np.random.default_rng(4)
    white = rng.standard_normal((400, 100))
    assert is_white(white).mean() > 0.99
    coloured = np.array([np.convolve(row, np.exp(-np.arange(30) / 8.0), "valid") for row in white])
    assert is_white(coloured).mean() < 0.01
    assert not is_white(np.arange(12.0))
    assert is_white(np.ones(12))
