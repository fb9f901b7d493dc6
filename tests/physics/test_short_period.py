"""The short-period model against hand values, the GTM's figures, and itself backwards."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from airtruth.physics import short_period
from airtruth.physics.motion import LONGITUDINAL
from airtruth.units import G0

# GTM: S, c, m, Iyy; TAS 42.85 m/s, q_bar 911.8 Pa (EAS 75 kt at 7000 ft)
S, C, M, I = 0.54830, 0.27898, 26.195, 6.314  # noqa: E741
V, Q_BAR = 42.85, 911.8
GTM = short_period.scale(S, C, M, I, V, 2 * Q_BAR / V**2)
# CLalpha CLq CLde Cmalpha Cmq Cmde, one-sided (+) derivatives of the GTM's tables
TRUTH = np.array([4.7932, 30.77, 0.4799, -1.7899, -41.38, -1.7874])
# true values printed in the paper (table 1)
PAPER = np.array([4.793, 30.79, 0.480, -1.789, -41.41, -1.787])


def test_modal_parameters_of_the_gtm() -> None:
    """wn 6.643 rad/s and zeta 0.3846 of the GTM's figures, to what four digits of its derivatives give."""
    wn, zeta = short_period.modal(TRUTH, GTM)
    assert wn == pytest.approx(6.643, abs=6e-4)
    assert zeta == pytest.approx(0.3846, abs=1e-4)


def test_modal_parameters_of_the_paper() -> None:
    """The paper prints wn 6.632 and zeta 0.388: so do its derivatives with m 25.60 kg, Iyy 6.348."""
    wn, zeta = short_period.modal(PAPER, short_period.scale(S, C, 25.60, 6.348, V, 2 * Q_BAR / V**2))
    assert wn == pytest.approx(6.632, abs=1e-3)
    assert zeta == pytest.approx(0.388, abs=5e-4)


def test_matrices_by_hand() -> None:
    """Round numbers: q_bar = 0.5 x 1 x 20^2 = 200 Pa, S 2, c 0.5, m 10, Iyy 4; eq. (2) term by term."""
    s = short_period.scale(2.0, 0.5, 10.0, 4.0, 20.0, 1.0)
    assert s.lift == pytest.approx(200 * 2 / (10 * 20))
    assert s.moment == pytest.approx(200 * 2 * 0.5 / 4)
    assert s.normal == pytest.approx(200 * 2 / 10)
    assert s.half_chord_time == pytest.approx(0.0125)
    theta = np.array([5.0, 8.0, 0.5, -1.0, -16.0, -2.0])
    a, b = short_period.system(theta, s)
    np.testing.assert_allclose(a, [[-10.0, 1 - 2 * 0.0125 * 8], [-50.0, 50 * 0.0125 * -16]], rtol=1e-14)
    np.testing.assert_allclose(b, [-1.0, -100.0], rtol=1e-14)
    np.testing.assert_allclose(short_period.normal_force_row(theta, s), [-200.0, -4.0, -20.0], rtol=1e-14)
    whole = short_period.linear_system(theta, s)
    np.testing.assert_allclose(whole.a, a, rtol=1e-14)
    np.testing.assert_allclose(whole.b, [[-1.0], [-100.0]], rtol=1e-14)
    np.testing.assert_allclose(whole.c, [[1.0, 0.0], [0.0, 1.0], [-200.0, -4.0]], rtol=1e-14)
    np.testing.assert_allclose(whole.d, [[0.0], [0.0], [-20.0]], rtol=1e-14)
    wn, zeta = short_period.modal(theta, s)
    assert wn == pytest.approx(np.sqrt(100 + 0.8 * 50), rel=1e-14)
    assert zeta == pytest.approx(20 / (2 * np.sqrt(140)), rel=1e-14)


def test_normal_force_is_the_path_curvature() -> None:
    """az - az_trim = V (alpha_dot - q): eqs (2) and (3) state one force."""
    a, b = short_period.system(TRUTH, GTM)
    row = short_period.normal_force_row(TRUTH, GTM)
    np.testing.assert_allclose(row, V * np.array([a[0, 0], a[0, 1] - 1.0, b[0]]), rtol=1e-12)
    # in g per degree of alpha, by hand: 911.8 x 0.5483 / (26.195 x 9.80665) x 4.7932 x pi/180 = 0.1628
    assert -row[0] / G0 * np.pi / 180 == pytest.approx(0.16281, abs=1e-5)


derivative = st.floats(-50.0, 50.0)


@given(st.tuples(*[derivative] * 6), st.floats(20.0, 250.0), st.floats(0.3, 1.3))
def test_round_trip(theta: tuple[float, ...], airspeed: float, density: float) -> None:
    s = short_period.scale(S, C, M, I, airspeed, density)
    back = short_period.derivatives(*short_period.system(np.array(theta), s), s)
    np.testing.assert_allclose(back, theta, rtol=0, atol=2e-10)


def test_many_runs_at_once() -> None:
    rng = np.random.default_rng(0)
    theta = TRUTH * (1 + 0.1 * rng.standard_normal((7, 6)))
    speed, density = rng.uniform(35, 55, 7), rng.uniform(0.8, 1.2, 7)
    s = short_period.scale(S, C, M, I, speed, density)
    a, b = short_period.system(theta, s)
    wn, zeta = short_period.modal(theta, s)
    row = short_period.normal_force_row(theta, s)
    assert a.shape == (7, 2, 2)
    assert b.shape == (7, 2)
    for i in range(7):
        one = short_period.scale(S, C, M, I, speed[i], density[i])
        np.testing.assert_array_equal(a[i], short_period.system(theta[i], one)[0])
        np.testing.assert_array_equal(b[i], short_period.system(theta[i], one)[1])
        np.testing.assert_array_equal(row[i], short_period.normal_force_row(theta[i], one))
        poles = np.linalg.eigvals(a[i])
        assert np.abs(poles) == pytest.approx(wn[i], rel=1e-12)
        assert -poles.real / np.abs(poles) == pytest.approx(zeta[i], rel=1e-12)


def test_divergence_has_no_frequency() -> None:
    unstable = TRUTH * [1, 1, 1, -3, 0.1, 1]
    wn, zeta = short_period.modal(unstable, GTM)
    assert np.isnan(wn)
    assert np.isnan(zeta)


def test_a_motion_without_stiffness_has_no_frequency() -> None:
    """All derivatives zero: A = [[0, 1], [0, 0]], det(A) = 0, the limit between oscillation and divergence."""
    wn, zeta = short_period.modal(np.zeros(6), GTM)
    assert np.isnan(wn)
    assert np.isnan(zeta)


def test_indices_are_the_positions_of_the_names() -> None:
    indices = {
        "CLalpha": short_period.CL_ALPHA,
        "CLq": short_period.CL_Q,
        "CLde": short_period.CL_DE,
        "Cmalpha": short_period.CM_ALPHA,
        "Cmq": short_period.CM_Q,
        "Cmde": short_period.CM_DE,
    }
    assert {name: LONGITUDINAL.parameters[i] for name, i in indices.items()} == dict(
        zip(LONGITUDINAL.parameters, LONGITUDINAL.parameters, strict=True)
    )


def test_derivatives_of_many_runs_are_those_of_each() -> None:
    """Matrices of four aircraft at once: the derivatives of each in a row of its own."""
    theta = TRUTH * np.linspace(0.7, 1.3, 4)[:, None]
    s = short_period.scale(S, C, M, I, np.full(4, V), np.full(4, 2 * Q_BAR / V**2))
    a, b = short_period.system(theta, s)
    np.testing.assert_allclose(short_period.derivatives(a, b, s), theta, rtol=1e-12)
