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


@pytest.mark.parametrize("part", ["wing_tip_loss", "fin_effectiveness"])
def test_the_direction_of_a_cause_is_known_to_a_share_of_its_size(part):
    """Where the records leave no other uncertainty, the interval of a size of 0.2 is 1.96 of its share."""
    effect = EFFECTS[part]
    (stated,) = estimates(effect, np.array([0.2]), np.zeros((1, 1))).values()
    value = effect.parameters[0].value(0.2)
    assert stated.std == pytest.approx(0.2 * effect.prior.shape, rel=1e-9)
    assert stated.ci95[1] - value == pytest.approx(1.959964 * 0.2 * effect.prior.shape, rel=1e-6)
    (wider,) = estimates(effect, np.array([0.2]), np.array([[0.04]])).values()
    assert wider.std == pytest.approx(np.hypot(0.2, 0.2 * effect.prior.shape), rel=1e-9)
