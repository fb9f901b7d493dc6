"""Gains that a size has to reach, against the quantiles of chi-square."""

import math

import pytest

from airtruth.tracing.anomalies.significance import FAMILY_LEVEL, significant_gain


def test_the_gain_of_33_candidates_is_round():
    """The survival function of chi-square with one degree of freedom is erfc(sqrt(x / 2))."""
    assert significant_gain(33) == pytest.approx(10.0, abs=1e-8)
    assert pytest.approx(33 * math.erfc(math.sqrt(5.0)), rel=1e-9) == FAMILY_LEVEL
