"""ATTAS: the sideslip is declared at the CG and was measured 13.08 m ahead of it, the accelerometer is 1.01 m behind (R. V.
Jategaonkar, *Flight Vehicle System Identification*, 2006, companion code), which kinematics alone must show.
"""

import itertools

import numpy as np
import pytest

from airtruth.checks.gate import inspect
from airtruth.checks.kinematics_lateral import check_lateral
from airtruth.importers.sources import open_source
from airtruth.logs.flight_log import FlightLog
from airtruth.units import DEG, FT

pytestmark = pytest.mark.slow

SPAN_M = 21.5
ARM_M, ACCELEROMETER_M = 13.08, -1.010
PLAIN = {"ax_m_s2": 2, "ay_m_s2": 3, "az_m_s2": 4, "airspeed_m_s": 15, "density_kg_m3": 34}
DEGREES = {
    "p_rad_s": 7, "q_rad_s": 8, "r_rad_s": 9, "phi_rad": 10, "theta_rad": 11, "alpha_rad": 13, "beta_rad": 14,
    "elevator_rad": 22, "rudder_rad": 30,
}  # fmt: skip


@pytest.fixture(scope="module")
def log(measured):
    """The aileron record and the rudder record, with the gap between them."""
    data = next(iter(open_source(measured("fAttasAilRud1.mat")).arrays.values()))
    channels = {n: data[:, k - 1] for n, k in PLAIN.items()}
    channels |= {n: DEG * data[:, k - 1] for n, k in DEGREES.items()}
    channels["aileron_rad"] = 0.5 * DEG * (data[:, 28] - data[:, 27])
    channels["altitude_m"] = FT * data[:, 15]
    t = data[:, 0]
    ends = [0, *(np.flatnonzero(np.diff(t) > 0.1) + 1), len(t)]
    times = np.concatenate([t[a:b] - t[a] for a, b in itertools.pairwise(ends)])
    return FlightLog({}, ("aileron", "rudder"), np.array(ends), np.round(times, 6), channels)


def test_the_gate_accepts_the_records(log):
    assert [f for f in inspect(log) if f.certain] == []


def test_both_records_show_the_arm(log):
    """With the place of the accelerometer declared; alpha offset and sidewash are free."""
    result = check_lateral([log], {"accelerometer_arm:ay_m_s2": ACCELEROMETER_M}, SPAN_M)
    print(*result.sentences)
    arm = result.finding("vane_arm:beta_rad")
    assert arm.lower < ARM_M < arm.upper
    assert arm.upper - arm.lower < 2.0
    assert {c.name for c in result.possible}
    assert all("vane_arm:beta_rad" in c.name for c in result.possible)


@pytest.mark.long
def test_without_it_the_arm_is_that_from_the_accelerometer(log):
    result = check_lateral([log], None, SPAN_M)
    print(*result.sentences)
    arm = result.finding("vane_arm:beta_rad")
    assert arm.lower < ARM_M - ACCELEROMETER_M < arm.upper
    assert arm.upper - arm.lower < 2.0
    assert "enter as their difference" in " ".join(result.sentences)
