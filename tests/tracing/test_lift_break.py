"""Breaks of the declared lift curve that records in gusts cross; the lift curves are stated here."""

from dataclasses import replace

import numpy as np
import pytest
import trace_records as tr

from airtruth import aircraft as planes
from airtruth.tracing.lift_break import break_note, breaks_of, crossed_breaks
from airtruth.tracing.model.parameters import PerRecord
from airtruth.tracing.model.plant import probed, trim_of
from airtruth.units import DEG

ALPHA = np.arange(-4.0, 13.0) * DEG


def broken(at_deg, slope):
    """Slope 5 up to an angle, another one beyond."""
    return 5.0 * ALPHA + (slope - 5.0) * np.maximum(ALPHA - at_deg * DEG, 0.0)


@pytest.mark.parametrize(
    ("slope", "expected"), [(3.7, [4.0 * DEG]), (3.8, []), (6.6, []), (6.7, [4.0 * DEG])]
)
def test_a_break_changes_the_slope_by_a_quarter_of_the_steepest(slope, expected):
    """5 to 3.75 and 5 to 6.667 change by a quarter of the larger slope."""
    assert breaks_of(ALPHA, broken(4.0, slope)) == pytest.approx(expected)


def crossed(gust_rad, reach_deg, shift_deg=0.0):
    """Crossed breaks of a record whose alpha moves by a sine of that amplitude; the lift curve breaks at 4 deg."""
    plant = tr.plant()
    values = np.zeros((ALPHA.size, 2, 2, 3))
    values[..., 1] = -(broken(4.0, 2.0) / np.cos(ALPHA))[:, None, None]
    plant = replace(plant, alpha_rad=ALPHA, values=values, alpha_shift_rad=shift_deg * DEG)
    y = np.zeros((400, 3))
    y[:, 0] = (reach_deg * np.sin(np.arange(400) / 20.0) + shift_deg) * DEG
    record = tr.record(y, 0.0, plant_=plant)
    fitted = tr.point([record])
    fitted.per_record[0, PerRecord.log_gust] = np.log(gust_rad * tr.V)
    return crossed_breaks(tr.problem([record]), fitted)


@pytest.mark.parametrize(
    ("gust_deg", "reach_deg", "shift_deg", "expected"),
    [
        (0.3, 6.0, 0.0, [4.0 * DEG]),
        (0.3, 6.0, 2.0, [4.0 * DEG]),
        (0.2, 6.0, 0.0, []),
        (0.3, 3.9, 0.0, []),
    ],
)
def test_a_break_counts_in_gusts_within_the_flown_range(gust_deg, reach_deg, shift_deg, expected):
    """Gusts count from 0.25 deg; a sine of 3.9 deg stays below the break."""
    assert crossed(gust_deg * DEG, reach_deg, shift_deg) == pytest.approx(expected)


def test_the_note_states_the_angles_in_degrees():
    note = break_note([4.0 * DEG, 7.5 * DEG])
    assert "at an angle of attack of 4.0, 7.5 deg" in note
    assert "provisional; trace records in calm air" in note


def test_the_lift_curve_of_the_gtm_has_no_break_in_the_range_of_a_flight_test():
    """Lift of the declared aircraft, probed in JSBSim over -2 to 10 deg."""
    gtm = planes.load("gtm")
    at = trim_of(gtm, 42.852, 0.993, 2133.6, 0.0)
    plant = probed(gtm, at, (-2.0 * DEG, 10.0 * DEG), (at.elevator_rad - DEG, at.elevator_rad + DEG), 0.1)
    assert breaks_of(plant.alpha_rad, -plant.over_alpha[:, 1]) == ()
