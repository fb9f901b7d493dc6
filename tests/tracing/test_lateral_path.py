"""The angle of attack over ground of a lateral record follows from specific forces and attitude, not from a gust on the vane."""

from dataclasses import replace

import lateral_records as lr
import numpy as np
import pytest

from airtruth import aircraft
from airtruth.physics.motion import LATERAL
from airtruth.physics.terms import Change
from airtruth.tracing import TraceOptions
from airtruth.tracing.inference.assess import assess
from airtruth.tracing.model.reading import read
from airtruth.tracing.model.records import TraceRecord
from airtruth.tracing.model.response import filter_inputs, kernel_input
from airtruth.tracing.prepare import prepare
from airtruth.units import DEG
from validation import damage, lateral_truth
from validation.lateral_declared import lateral_aircraft
from validation.lateral_truth import GTM, Flight, log_of

FLIGHT = Flight(duration_s=10.0, seed=3).quiet()
GUST = 0.6 * DEG


def record_in_gusts(leave_out=()):
    """A calm flight whose vane reads a gust besides, and the angle of attack over ground."""
    log = log_of(FLIGHT, leave_out=leave_out)
    alpha = log.channels["alpha_rad"]
    read_angle = alpha + GUST * np.sin(2.0 * log.t_s)
    log = replace(log, channels=log.channels | {"alpha_rad": read_angle})
    return TraceRecord(read(log, LATERAL)[0], lr.plant(), lr.LENGTH), alpha, read_angle


def test_the_path_has_the_mean_of_the_vane_and_none_of_its_gusts():
    record, alpha, read_angle = record_in_gusts()
    found = filter_inputs(record, Change()).grid.ground_attack_rad[:: record.signals.sub]
    np.testing.assert_allclose(found - alpha, (read_angle - alpha).mean(), atol=0.02 * DEG)


def test_without_attitude_the_path_is_that_of_the_air():
    record, _, _ = record_in_gusts(leave_out=("theta_rad",))
    grid = filter_inputs(record, Change()).grid
    np.testing.assert_array_equal(grid.ground_attack_rad, grid.alpha_rad)


def test_the_upwash_of_a_record_turns_its_path():
    record, _, _ = record_in_gusts()
    given = filter_inputs(record, Change())
    own = lr.per_record(upwash=0.01)
    turned = kernel_input(given, lr.SETTINGS, lr.common(), own).grid.ground_attack_rad
    np.testing.assert_allclose(turned - given.grid.ground_attack_rad, 0.01)


def test_a_gust_along_the_body_is_a_tailwind_of_the_record(monkeypatch):
    """Behind a gust of 2 % of the speed that turns with the aircraft, the yaw rate turns the air by 2 % less than over ground."""
    share, gusts = 0.02, iter((1.0, 0.0, 0.0))

    def constant(_rng, samples, *_):
        return np.full(samples, share * GTM.speed * next(gusts))

    monkeypatch.setattr(lateral_truth, "dryden", constant)
    log = log_of(Flight(duration_s=5.0).quiet())
    record = TraceRecord(read(log, LATERAL)[0], lr.plant(), lr.LENGTH)
    start = [log.channels[name][0] for name in ("beta_rad", "p_rad_s", "r_rad_s", "phi_rad")]
    error = {
        tailwind: np.sqrt(
            (lr.responded(record, own=lr.per_record(start, tailwind=tailwind)).e[:, 0] ** 2).mean()
        )
        for tailwind in (0.0, share / (1.0 - share))
    }
    assert error[share / (1.0 - share)] < 0.3 * error[0.0]


@pytest.mark.slow
@pytest.mark.parametrize("seed", [6401701, 6401703])
def test_a_record_that_no_fit_has_seen_has_white_innovations(tmp_path, seed):
    """Its own parameters are known as little as in a held-out record; a weak fin makes the motion large."""
    case = damage.CASES["fin-30"]
    plane = aircraft.load(lateral_aircraft(tmp_path / "gtm", case.plane))
    made = prepare([log_of(*damage.flights(case, seed)[:4])], plane, [], TraceOptions(motion="lateral"))
    entries = made.fitted.layout.common
    common = np.zeros(entries.size)
    common[[entries.rotary, entries.rolloff]] = -0.5  # Dryden gusts without rotary parts
    for problem in (made.fitted, made.held):
        for i in range(len(problem.records)):
            white = assess(problem, i, made.hypothesis, common, np.zeros(0)).whitened
            assert (white**2).mean() == pytest.approx(1.0, abs=0.1)
