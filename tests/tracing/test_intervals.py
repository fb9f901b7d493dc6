"""Intervals of an accepted effect, and their ends at infinity."""

from types import SimpleNamespace

import numpy as np
import pytest

from airtruth.effects.registry import EFFECTS
from airtruth.tracing.intervals import estimates, widened_by_profile

ARM, LIMIT = EFFECTS["vane_arm"], EFFECTS["rate_limit"]
STD = np.array([0.1])


def test_an_end_at_infinity_stays_open():
    """A rate limit: the size is 1/rate; 0.5 ± 0.4 s/rad contains no limit at all."""
    stated = estimates(LIMIT, np.array([0.5]), np.array([[0.16]]))
    assert stated["rate_rad_s"].ci95[1] is None
    profile = SimpleNamespace(size_interval=lambda: (0.4, 2.0), location_interval=lambda: (0.4, 2.0))
    again = widened_by_profile(LIMIT, stated, profile)["rate_rad_s"]
    assert again.ci95 == (pytest.approx(min(0.5, stated["rate_rad_s"].ci95[0])), None)
