"""Derivatives from geometry, against published values."""

import math

import numpy as np
import pytest

from airtruth.errors import ConfigurationError
from airtruth.physics import handbook
from airtruth.physics.handbook import Planform

WING = Planform(10.9, 16.2, 1.49, 3.4, 2.0, 4.6, 0.4)


def test_lift_slopes_have_their_limits():
    """pi A/2 of a slender wing (R. T. Jones, NACA Report 835), and 2 pi of an aerofoil (thin-aerofoil theory)."""
    assert handbook.lift_slope(1e-3) == pytest.approx(math.pi / 2 * 1e-3, rel=1e-6)
    assert handbook.lift_slope(1e6) == pytest.approx(2.0 * math.pi, rel=1e-5)


def test_the_flap_is_that_of_thin_aerofoil_theory():
    """The integral of Glauert, (1/pi) int_{theta_h}^{pi} (1 - cos theta) d theta with x = (1 - cos theta)/2, in 1e5 steps."""
    for share in (0.2, 0.4, 0.8):
        hinge = math.acos(1.0 - 2.0 * (1.0 - share))
        theta = np.linspace(hinge, math.pi, 100_001)
        integral = np.trapezoid(1.0 - np.cos(theta), theta) / math.pi
        assert handbook.flap_effectiveness(share) == pytest.approx(integral, rel=1e-8)


def test_a_light_aircraft_is_within_the_stated_scatter():
    """A Cessna 172 as measured: the values of the template of `airtruth new aircraft`, within two standard deviations."""
    measured = {"CLalpha": 5.1, "CLq": 3.9, "CLde": 0.43, "Cmalpha": -0.89, "Cmq": -12.4, "Cmde": -1.28}
    values, stds = handbook.derivatives(WING), handbook.standard_deviations(WING)
    for name, value in measured.items():
        assert abs(values[name] - value) < 2.0 * stds[name], name


def test_a_shift_of_the_centre_of_gravity_is_a_transfer_of_moments():
    """Cmalpha + CLalpha dx for a tail that stays in its place: eq. (4) with the arm shorter by dx c."""
    dx = 0.05
    aft = Planform(10.9, 16.2, 1.49, 3.4, 2.0, 4.6 - dx * 1.49, 0.4, cg=0.25 + dx)
    before, after = handbook.derivatives(WING), handbook.derivatives(aft)
    assert after["Cmalpha"] == pytest.approx(before["Cmalpha"] + before["CLalpha"] * dx, rel=1e-12)
    assert after["Cmde"] == pytest.approx(before["Cmde"] + before["CLde"] * dx, rel=1e-12)


@pytest.mark.parametrize(
    ("change", "message"), [({"span_m": 0.0}, "span_m"), ({"elevator_share": 1.2}, "at most 1")]
)
def test_values_without_meaning_are_refused(change, message):
    stated = {"span_m": 10.9, "wing_area_m2": 16.2, "chord_m": 1.49} | {
        "tail_span_m": 3.4, "tail_area_m2": 2.0, "tail_arm_m": 4.6
    }  # fmt: skip
    with pytest.raises(ConfigurationError, match=message):
        Planform(**stated | change)
