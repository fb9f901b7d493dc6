"""Trim and declared derivatives of the GTM against the paper and an independent set of equations."""

from dataclasses import replace

import numpy as np
import oracle
import pytest

from airtruth.errors import TrimError
from airtruth.physics import short_period
from airtruth.simulation.linearise import linearise
from airtruth.simulation.simulator import Condition, Executive
from airtruth.simulation.trim import trim
from airtruth.units import DEG, FT, KT

# M. Brunot's paper, Table 1: true values, in the order of LONGITUDINAL.parameters.
PAPER = np.array([4.793, 30.79, 0.480, -1.789, -41.41, -1.787])
PAPER_WN, PAPER_ZETA = 6.632, 0.388


def test_trim_at_the_paper_condition(paper_trim):
    assert paper_trim.alpha_rad / DEG == pytest.approx(5.56, abs=0.02)  # paper, section IV.A
    # Pitch plane, without the aileron trim that gives the paper's 0.10 deg: aircraft/gtm/README.md.
    assert paper_trim.elevator_rad / DEG == pytest.approx(0.176, abs=0.001)
    assert paper_trim.airspeed_m_s == pytest.approx(42.852, abs=0.001)
    assert paper_trim.density_kg_m3 == pytest.approx(0.99311, rel=2e-5)  # US Standard Atmosphere 1976


def test_a_held_throttle_is_balanced_by_the_flight_path(gtm, paper_trim):
    """At the throttle of level flight the path is level; the excess of thrust over drag climbs, sin(gamma) = X/(m g), but for the
    angle of attack and the elevator, which are trimmed again."""
    level = trim(gtm, paper_trim.condition, throttle=paper_trim.controls.throttle)
    assert level.condition.gamma_rad == pytest.approx(0.0, abs=1e-9)
    assert level.alpha_rad == pytest.approx(paper_trim.alpha_rad, abs=1e-9)
    more = paper_trim.controls.throttle + 0.02
    climbing = trim(gtm, paper_trim.condition, near=paper_trim, throttle=more)
    assert climbing.controls.throttle == more
    assert climbing.residual < 1e-6
    held = replace(paper_trim, controls=replace(paper_trim.controls, throttle=more))
    executive = Executive(gtm, 1.0 / 200.0)
    executive.initialise(held.condition, held.controls)
    r = executive.respond()
    along = r.u_dot_m_s2 * np.cos(held.alpha_rad) + r.w_dot_m_s2 * np.sin(held.alpha_rad)
    assert np.sin(climbing.condition.gamma_rad) == pytest.approx(along / 9.80665, rel=0.05)


def test_declared_derivatives_are_the_paper_truth(gtm, paper_trim):
    linear = linearise(gtm, paper_trim)
    np.testing.assert_allclose(linear.plus, PAPER, rtol=5e-3)
    assert linear.modes["wn_rad_s"] == pytest.approx(PAPER_WN, rel=0.01)
    assert linear.modes["zeta"] == pytest.approx(PAPER_ZETA, rel=0.01)


def test_derivatives_agree_with_differences_of_independent_equations(gtm, paper_trim):
    tables, v = oracle.tables(), paper_trim.airspeed_m_s

    def rates(d_alpha, d_elevator, d_q):
        a = paper_trim.alpha_rad + d_alpha
        x = oracle.accelerations(
            tables, v * np.cos(a), v * np.sin(a), d_q, a, paper_trim.condition.altitude_m,
            paper_trim.elevator_rad + d_elevator, paper_trim.controls.throttle,
        )  # fmt: skip
        return np.array([(x[1] * np.cos(a) - x[0] * np.sin(a)) / v, x[2]])

    origin, h = rates(0, 0, 0), 1e-5
    for side, name in ((1.0, "plus"), (-1.0, "minus")):
        da, de, dq = ((rates(*(side * h * e)) - origin) / (side * h) for e in np.eye(3))
        linear = linearise(gtm, paper_trim)
        expected = short_period.derivatives(np.column_stack([da, dq]), de, linear.scale)
        # 1e-4: JSBSim's density differs by 1e-5, and the differences are over 1e-5 and 2e-4 rad.
        np.testing.assert_allclose(getattr(linear, name), expected, rtol=2e-4)


def test_sides_differ_where_the_tables_break(gtm, paper_trim):
    linear = linearise(gtm, paper_trim)
    step = trim(gtm, Condition(paper_trim.condition.eas_m_s * 0.962, paper_trim.condition.altitude_m))
    assert step.alpha_rad / DEG > 6.0
    beyond = linearise(gtm, step)
    assert linear.central == pytest.approx(0.5 * (linear.plus + linear.minus))
    assert beyond.plus[3] == pytest.approx(-1.27, abs=0.03)  # local slope above 6 deg: the tables' 6 to 8 deg


@pytest.mark.parametrize("eas_kt", range(55, 111, 11))
@pytest.mark.parametrize("altitude_ft", [0, 5000, 10000, 15000])
def test_trim_residual_over_the_envelope(gtm, eas_kt, altitude_ft):
    assert trim(gtm, Condition(eas_kt * KT, altitude_ft * FT)).residual < 1e-8


@pytest.mark.parametrize("path_deg", [-5.0, 3.0])
def test_trim_on_a_slope(gtm, paper_condition, path_deg):
    steep = trim(gtm, Condition(paper_condition.eas_m_s, paper_condition.altitude_m, path_deg * DEG))
    level = trim(gtm, paper_condition)
    assert steep.residual < 1e-8
    assert np.sign(steep.controls.throttle - level.controls.throttle) == np.sign(path_deg)


@pytest.mark.parametrize("eas_kt", [15.0, 400.0])
def test_untrimmable_condition_says_what_and_where(gtm, eas_kt):
    with pytest.raises(
        TrimError, match=rf"gtm cannot be trimmed at EAS {eas_kt:.1f} kt.*residual.*Choose another speed"
    ):
        trim(gtm, Condition(eas_kt * KT, 7000 * FT))


def test_trim_does_not_depend_on_what_ran_before(gtm, paper_condition):
    first = trim(gtm, paper_condition)
    trim(gtm, Condition(50.0, 1000.0))
    assert trim(gtm, paper_condition) == first
