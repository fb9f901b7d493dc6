"""Gains that a refit has to reach, against the quantiles of chi-square."""

import math

import pytest

from airtruth.tracing.selection.anomaly import Anomaly
from airtruth.tracing.selection.significance import (
    FAMILY_LEVEL,
    LATER_FAMILY_LEVEL,
    MISFIT_FAMILY_LEVEL,
    later_gain,
    significant_gain,
)


@pytest.mark.parametrize(
    ("level", "gain"), [(FAMILY_LEVEL, 10.0), (LATER_FAMILY_LEVEL, 16.0), (MISFIT_FAMILY_LEVEL, 25.0)]
)
def test_the_gains_of_33_candidates_are_round(level, gain):
    """The survival function of chi-square with one degree of freedom is erfc(sqrt(x / 2))."""
    assert significant_gain(33, level) == pytest.approx(gain, abs=1e-8)
    assert level == pytest.approx(33 * math.erfc(math.sqrt(0.5 * gain)), rel=1e-9)


@pytest.mark.parametrize(("p_value", "gain"), [(1.0, 16.0), (1e-6, 16.0), (9e-7, 25.0), (0.0, 25.0)])
def test_beside_an_anomaly_beyond_doubt_a_later_effect_needs_more(p_value, gain):
    assert later_gain(33, Anomaly("alpha_rad", 50.0, 1, p_value)) == pytest.approx(gain, abs=1e-8)
