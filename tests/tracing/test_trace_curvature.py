"""A curvature of Cm about zero, flown in JSBSim: traced about the trim, written so that it flies what was fitted."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
import trace_flights as flights

from airtruth import aircraft as planes
from airtruth.effects.registry import EFFECTS
from airtruth.tracing import TraceOptions, trace
from airtruth.tracing.model.plant import declared_derivatives
from airtruth.tracing.model.probed import trim_of
from airtruth.tracing.prepare import prepare
from airtruth.tracing.update import write_update

KEY = "cm_alpha_nonlinear:quadratic"
TRUE = -8.0
GTM = planes.load("gtm")

pytestmark = [pytest.mark.long, pytest.mark.xdist_group("curvature")]


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """Four records in calm air; at the trim of 0.097 rad the slope is 1.55 steeper than declared."""
    folder = tmp_path_factory.mktemp("curvature")
    return flights.fly(folder, ((KEY, {"Cmalpha2": TRUE}),), runs=4, gust=flights.CALM)


@pytest.fixture(scope="module")
def found(place):
    some = (KEY, "cm_alpha_nonlinear:break", "cg_shift", "downwash_lag", "vane_bias", "inertia_error")
    return trace([place], GTM, TraceOptions(effects=some), place.parent / "traced")


@pytest.fixture(scope="module")
def linear(place):
    return trace([place], GTM, TraceOptions(model="linear", effects=(KEY,)), place.parent / "linear")


def slopes(folder, found):
    """CLalpha to Cmde of a written aircraft at its trim in the records' flight condition."""
    s = found.case.fitted.records[0].signals
    plane = planes.load(folder)
    at = trim_of(plane, float(s.airspeed_m_s.mean()), float(s.density_kg_m3.mean()), s.altitude_m, 0.0)
    return declared_derivatives(plane, at)


def test_it_is_found_at_its_size(found):
    """Its slope of 1.55 is 15 declared standard deviations, its constant of 0.075 two and a half."""
    (effect,) = found.to_dict()["effects"]
    assert (effect["name"], effect["variant"]) == ("cm_alpha_nonlinear", "quadratic")
    low, high = effect["parameters"]["Cmalpha2"]["ci95"]
    assert low < TRUE < high
    trim = found.case.fitted.records[0].plant.trim_alpha_rad
    assert effect["about_alpha_rad"] == trim
    after = found.to_dict()["derivatives"]
    more = after["after"]["Cmalpha"] - after["declared"]["Cmalpha"]
    assert abs(more - 2.0 * TRUE * trim) < 3.0 * after["after_std"]["Cmalpha"]


def test_the_update_flies_what_was_fitted(found):
    """JSBSim's own free run of the held-out record beside the filter's: in calm air what is not written of the fit,
    thrust and inertia, shows.
    """
    after = found.to_dict()["error"]["after"]["held_out"]["free_run"]
    assert found.to_dict()["replay"]["updated"].keys() == after.keys()
    for channel, error in found.to_dict()["replay"]["updated"].items():
        assert error < 1.2 * after[channel]
        assert error < 0.2 * found.to_dict()["replay"]["declared"][channel]


def test_the_refitted_derivatives_are_written(found, tmp_path):
    """Cmalpha and Cmq of the written aircraft, linearised in JSBSim."""
    folder = write_update(found.case, found.rounds, GTM, tmp_path)
    more = slopes(folder, found) - found.case.fitted.records[0].plant.derivatives
    fitted = found.rounds[-1].gls.point.common[:6]
    assert more[3] == pytest.approx(fitted[3], abs=0.02)
    assert more[4] == pytest.approx(fitted[4], abs=0.1)  # a trim of other alpha


def test_a_linear_model_s_curve_is_written_at_its_trim(linear, tmp_path):
    """It counts alpha from the record's trim, the aircraft from zero."""
    folder = write_update(linear.case, linear.rounds, GTM, tmp_path)
    assert folder is not None
    more = slopes(folder, linear) - linear.case.fitted.records[0].plant.derivatives
    assert more[3] == pytest.approx(linear.rounds[-1].gls.point.common[3], abs=0.05)


def test_the_trim_is_that_of_a_fitted_record(place):
    """A held-out first record of another airspeed has no say in what the curvature counts from."""
    log = flights.log_of(place)
    channels = {name: values.copy() for name, values in log.channels.items()}
    channels["airspeed_m_s"][log.rows(0)] *= 1.2
    options = TraceOptions(hold_out=(log.run_ids[0],))
    case = prepare([replace(log, channels=channels)], GTM, [EFFECTS[KEY]], options)
    plants = {record.plant.trim_alpha_rad for record in case.fitted.records}
    assert plants == {case.hypothesis.trim_alpha_rad}
    assert case.held.records[0].plant.trim_alpha_rad < 0.8 * case.hypothesis.trim_alpha_rad


def test_slow_noise_is_said(tmp_path):
    """Noise of the declared level on q, correlated over 80 ms, besides its own."""
    log = flights.log_of(flights.fly(tmp_path, runs=3))
    rng = np.random.default_rng(3)
    pole = np.exp(-0.02 / 0.08)
    slow = np.zeros(len(log.t_s))
    for k in range(1, len(slow)):
        slow[k] = pole * slow[k - 1] + np.sqrt(1.0 - pole**2) * rng.standard_normal()
    level = GTM.file.sensors["q_rad_s"].noise_std.value
    channels = dict(log.channels) | {"q_rad_s": log.channels["q_rad_s"] + level * slow}
    noisy = trace(replace(log, channels=channels), GTM, TraceOptions(effects=("elevator_delay",)))
    (note,) = [n for n in noisy.answer.notes if "slow" in n]
    share = int(re.search(r"(\d+) % of q_rad_s", note)[1])
    assert 35 < share < 60  # half of the variance
