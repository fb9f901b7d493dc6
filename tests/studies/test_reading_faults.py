"""Faults that `validation.reading_faults` puts into logs, by hand, and how it scores answers."""

import numpy as np
import pytest

from airtruth.logs.flight_log import FlightLog
from validation.blind.figures import ALPHA_TRIM_RAD
from validation.reading_faults import Fault, drawn, outcome, with_fault


def log():
    """Two records of five samples at 50 Hz; each channel counts up from its own start."""
    t = np.tile(np.arange(5) * 0.02, 2)
    channels = {name: np.arange(10.0) for name in ("elevator_rad", "q_rad_s")}
    channels |= {"airspeed_m_s": np.full(10, 40.0), "alpha_rad": ALPHA_TRIM_RAD + 0.01 * np.arange(10.0)}
    return FlightLog({}, ("r1", "r2"), np.array([0, 5, 10]), t, channels)


def test_faults_by_hand():
    late = with_fault(log(), Fault("surface", 0.04)).channels
    assert late["elevator_rad"].tolist() == [0, 0, 0, 1, 2, 5, 5, 5, 6, 7]
    one = with_fault(log(), Fault("record", 0.02, 1)).channels
    assert one["q_rad_s"].tolist() == [0, 1, 2, 3, 4, 5, 5, 6, 7, 8]
    read = with_fault(log(), Fault("airspeed", 0.5)).channels["airspeed_m_s"]
    np.testing.assert_allclose(read, 40.0 * (1.0 + 0.005 * np.arange(10)), rtol=1e-12)


def test_a_fault_depends_on_seed_and_number_alone():
    assert [drawn(7, k) for k in range(6)] == [drawn(7, k) for k in range(6)]
    assert [drawn(7, k).kind for k in range(3)] == ["airspeed", "surface", "record"]


@pytest.mark.parametrize(
    ("key", "provisional", "first", "wrong"),
    [("airspeed_alpha_slope", False, True, False), ("cl_alpha_nonlinear", False, False, True)],
)
def test_scores(key, provisional, first, wrong):
    effect = {
        "name": key,
        "indistinguishable_from": [],
        "parameters": {"slope_per_rad": {"ci95": [0.4, 0.6]}},
    }
    found = outcome(Fault("airspeed", 0.5), {"effects": [effect], "provisional": provisional})
    assert (found.first, found.reported, found.wrong) == (first, first, wrong)
    assert found.inside is (True if first else None)
