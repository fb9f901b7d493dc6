"""A small aircraft whose truth is simulated apart from JSBSim and from the model of the tracer."""

import numpy as np
import pytest

from airtruth.tracing import TraceOptions, trace
from validation import small_aircraft as small

G0 = 9.80665


@pytest.mark.grid
@pytest.mark.parametrize("truth", [small.Truth(), small.drawn(3)])
def test_least_squares_gives_its_coefficients_back(truth):
    """Every step of a flight without noise; pitch acceleration by central differences of 2.5 ms."""
    log = small.flight_log(3, truth=truth, noise=0.0, every=1)
    rows = log.rows(0)
    c = {name: values[rows] for name, values in log.channels.items()}
    q_dot = np.gradient(c["q_rad_s"], small.STEP_S)
    ax = c["ax_m_s2"] + c["q_rad_s"] ** 2 * small.ACCELEROMETER_M
    az = c["az_m_s2"] + q_dot * small.ACCELEROMETER_M
    alpha, speed = c["alpha_rad"], c["airspeed_m_s"]
    pressure = 0.5 * small.DENSITY_KG_M3 * speed**2 * small.AREA_M2
    *_, thrust = small.trimmed(truth)
    lift = (truth.mass_kg * (ax * np.sin(alpha) - az * np.cos(alpha)) - thrust * np.sin(alpha)) / pressure
    moment = truth.inertia_kg_m2 * q_dot / (pressure * small.CHORD_M)
    given = np.column_stack(
        [
            np.ones_like(alpha),
            alpha,
            c["q_rad_s"] * small.CHORD_M / (2.0 * speed),
            c["elevator_rad"],
        ]
    )
    inner = slice(2, -2)
    for coefficient, expected, rtol in ((lift, truth.lift, 1e-3), (moment, truth.moment, 3e-3)):
        found = np.linalg.lstsq(given[inner], coefficient[inner], rcond=None)[0]
        np.testing.assert_allclose(found, expected, rtol=rtol)


@pytest.mark.slow
def test_sensors_and_surface_have_the_stated_effects():
    """A lagged ramp is late by the time constant; the trims of a weak elevator are those of the others over its share."""
    plain, late, weak = (
        small.flight_log(3, truth=small.Truth(effect=effect), noise=0.0)
        for effect in (None, "vane_lag", "elevator_effectiveness")
    )
    rows = plain.rows(0)
    alpha, behind = (log.channels["alpha_rad"][rows] for log in (plain, late))
    rate = np.gradient(behind, small.EVERY * small.STEP_S)
    np.testing.assert_allclose(behind + small.EFFECTS["vane_lag"] * rate, alpha, atol=3e-4)
    trims = [log.channels["elevator_rad"][rows][0] for log in (plain, weak)]
    assert trims[1] * small.EFFECTS["elevator_effectiveness"] == pytest.approx(trims[0], rel=1e-9)


@pytest.mark.slow
def test_it_begins_in_level_flight():
    log = small.flight_log(3, noise=0.0)
    for run in range(small.RECORDS):
        start = log.rows(run).start
        assert log.channels["az_m_s2"][start] == pytest.approx(
            -G0 * np.cos(log.channels["alpha_rad"][start]), rel=1e-9
        )
        assert log.channels["airspeed_m_s"][start] == pytest.approx(small.AIRSPEED_M_S, rel=1e-12)


@pytest.mark.slow
def test_nothing_is_named_where_nothing_is_missing(tmp_path):
    answer = trace([small.flight_log(1)], small.declared(tmp_path), TraceOptions()).to_dict()
    assert answer["verdict"] == "none"


@pytest.mark.slow
def test_a_late_elevator_is_named(tmp_path):
    options = TraceOptions(effects=("elevator_delay", "actuator_lag", "vane_arm", "gyro_scale"))
    log = small.flight_log(1, gust_m_s=0.35, truth=small.Truth(effect="elevator_delay"))
    answer = trace([log], small.declared(tmp_path), options).to_dict()
    (effect,) = answer["effects"]
    assert effect["name"] == "elevator_delay"
    low, high = effect["parameters"]["delay_s"]["ci95"]
    assert low < small.EFFECTS["elevator_delay"] < high
