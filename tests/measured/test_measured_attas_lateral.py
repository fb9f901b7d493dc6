"""ATTAS: the sideslip is declared at the CG and was measured 13.08 m ahead of it, the accelerometer is 1.01 m behind (R. V.
Jategaonkar, *Flight Vehicle System Identification*, 2006, companion code), which kinematics alone must show, and a trace.
"""

import itertools
from pathlib import Path

import numpy as np
import pytest

from airtruth import aircraft
from airtruth.aircraft import Sensor
from airtruth.checks.gate import inspect
from airtruth.checks.kinematics_lateral import check_lateral
from airtruth.importers.sources import open_source
from airtruth.logs.flight_log import FlightLog
from airtruth.quantity import Quantity
from airtruth.tracing import TraceOptions, trace
from airtruth.units import DEG, FT

pytestmark = pytest.mark.slow

HERE = Path(__file__).resolve().parent
CNR = -0.159
"""Published Cnr with the sideslip moved to the CG (N_r = -0.294, L_r = 0.660 1/s) [-]."""
SPLIT_S = 20.0
"""Time at which each record is divided in a part that is fitted and one that is held out [s]."""
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
    return record(measured, (0.0,))


@pytest.fixture(scope="module")
def parts(measured):
    """The same records, each in two parts."""
    return record(measured, (0.0, SPLIT_S))


def record(measured, starts_s):
    """The record in runs that start at these times of each manoeuvre [s]."""
    data = next(iter(open_source(measured("fAttasAilRud1.mat")).arrays.values()))
    channels = {n: data[:, k - 1] for n, k in PLAIN.items()}
    channels |= {n: DEG * data[:, k - 1] for n, k in DEGREES.items()}
    channels["aileron_rad"] = 0.5 * DEG * (data[:, 28] - data[:, 27])
    channels["altitude_m"] = FT * data[:, 15]
    t = data[:, 0]
    first = [0, *(np.flatnonzero(np.diff(t) > 0.1) + 1)]
    ends = [*(a + round(s / 0.04) for a in first for s in starts_s), len(t)]
    times = np.concatenate([t[a:b] - t[a] for a, b in itertools.pairwise(ends)])
    names = tuple(f"{n}-{k}" for n in ("aileron", "rudder") for k in range(len(starts_s)))
    return FlightLog({}, names, np.array(ends), np.round(times, 6), channels)


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


@pytest.mark.study
def test_a_trace_names_the_arm(parts):
    """Each interval holds 13.08 m; Cnr, which had absorbed the arm, moves to the published one without it."""
    options = TraceOptions(motion="lateral", hold_out=("aileron-1", "rudder-1"), increments=False)
    answer = trace([parts], HERE / "attas", options).to_dict()
    print(answer["effects"], answer["derivatives"], answer["error"])
    (arm,) = (e for e in answer["effects"] if (e["name"], e["channel"]) == ("vane_arm", "beta_rad"))
    low, high = arm["parameters"]["x_m"]["ci95"]
    assert low < ARM_M < high
    derivatives = answer["derivatives"]
    assert abs(derivatives["after"]["Cnr"] - CNR) < abs(derivatives["declared"]["Cnr"] - CNR)
    before, after = (answer["error"][stage]["held_out"]["free_run"] for stage in ("before", "after"))
    assert after["beta_rad"] < before["beta_rad"]
    assert after["r_rad_s"] < before["r_rad_s"]


@pytest.mark.study
def test_declared_the_arm_is_not_traced_again(parts):
    plane = aircraft.load(HERE / "attas")
    vane = plane.file.sensors["beta_rad"].model_dump() | {"x": Quantity(value=ARM_M)}
    sensors = plane.file.sensors | {"beta_rad": Sensor.model_validate(vane)}
    declared = plane.model_copy(update={"file": plane.file.model_copy(update={"sensors": sensors})})
    options = TraceOptions(motion="lateral", hold_out=("aileron-1", "rudder-1"), increments=False)
    answer = trace([parts], declared, options).to_dict()
    print(answer["effects"])
    assert all(e["name"] != "vane_arm" for e in answer["effects"])
    assert all("vane_arm:beta_rad" not in e["indistinguishable_from"] for e in answer["effects"])
