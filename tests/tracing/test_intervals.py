"""Intervals of an accepted effect where an anomaly remains, and their ends at infinity."""

from types import SimpleNamespace

import numpy as np
import pytest

from airtruth.effects.registry import EFFECTS
from airtruth.tracing.intervals import estimates, widened_by_profile, widened_by_rejected

ARM, LIMIT = EFFECTS["vane_arm"], EFFECTS["rate_limit"]
STD = np.array([0.1])


def a_fit(sizes, std, converged=True):
    span = slice(0, 1)
    hypothesis = SimpleNamespace(effects=(ARM,), span=lambda key: span)
    point = SimpleNamespace(sizes=np.array(sizes))
    return SimpleNamespace(
        hypothesis=hypothesis, point=point, size_std=lambda number: std, converged=converged, shortfall=1e9
    )


def rejected(gain=60.0, reasons=("it worsens the free run",), **fitted):
    return SimpleNamespace(fit=a_fit([1.2], 0.05, **fitted), gain=gain, reasons=reasons)


def a_round(p_value, *candidates):
    return SimpleNamespace(
        anomaly=SimpleNamespace(p_value=p_value),
        table=SimpleNamespace(scores=range(32)),
        null=a_fit([1.5], 0.05),
        candidates=candidates,
    )


def widened(last):
    return widened_by_rejected(ARM, estimates(ARM, np.array([1.5]), np.diag(STD**2)), last, STD)["x_m"]


def test_an_interval_contains_that_beside_a_rejected_effect():
    """1.5 ± 0.1; beside the other effect 1.2 ± 0.05, times 2 as the answer's interval is robust."""
    stated = widened(a_round(1e-5, rejected()))
    assert stated.value == 1.5
    assert stated.std == pytest.approx(0.1)
    assert stated.ci95 == pytest.approx((1.2 - 0.1 * 1.959964, 1.5 + 0.1 * 1.959964))


@pytest.mark.parametrize(
    "last",
    [
        a_round(0.2, rejected()),
        a_round(1e-5),
        a_round(1e-5, rejected(gain=20.0)),
        a_round(1e-5, rejected(reasons=())),
        a_round(1e-5, rejected(converged=False)),
    ],
)
def test_nothing_is_widened_without_a_reason(last):
    assert widened(last).ci95 == pytest.approx((1.5 - 0.1 * 1.959964, 1.5 + 0.1 * 1.959964))


def test_an_end_at_infinity_stays_open():
    """A rate limit: the size is 1/rate; 0.5 ± 0.4 s/rad contains no limit at all."""
    stated = estimates(LIMIT, np.array([0.5]), np.array([[0.16]]))
    assert stated["rate_rad_s"].ci95[1] is None
    profile = SimpleNamespace(size_interval=lambda: (0.4, 2.0), location_interval=lambda: (0.4, 2.0))
    again = widened_by_profile(LIMIT, stated, profile)["rate_rad_s"]
    assert again.ci95 == (pytest.approx(min(0.5, stated["rate_rad_s"].ci95[0])), None)
