"""Increments of readings in sampled signals: states against an integration of their equations, and terms by hand."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from airtruth.physics.readings import reading_increments, state_of
from airtruth.physics.terms import ReadingTerm, StateTerm

DT = 0.02
BODY = SimpleNamespace(chord_m=0.3, span_m=2.0)
T = np.arange(200) * DT
SIGNAL = np.interp(T, [0.5, 0.7, 1.1, 1.5], [0.0, 0.03, 0.03, -0.01])


def integrated(term):
    """The state by the equations in the docstring of `StateTerm`, its input linear between the samples."""

    def rates(t, x):
        s = np.interp(t, T, SIGNAL)
        if term.kind == "lag":
            return [(s - x[0]) / term.time_s]
        wn = 1.0 / term.time_s
        return [x[1], wn**2 * (s - x[0]) - 2.0 * term.damping * wn * x[1]]

    start = [SIGNAL[0]] if term.kind == "lag" else [SIGNAL[0], 0.0]
    return solve_ivp(rates, (0.0, T[-1]), start, t_eval=T, rtol=1e-10, atol=1e-13, max_step=DT / 2).y[0]


@pytest.mark.parametrize(
    "term", [StateTerm("x", "lag", "alpha", 0.3), StateTerm("x", "mode", "alpha", 0.05, 0.04)]
)
def test_a_state_obeys_its_equation(term):
    np.testing.assert_allclose(state_of(term, SIGNAL[None, :], DT)[0], integrated(term), atol=2e-9)


def test_terms_add_by_channel_each_over_its_signal():
    truth = {
        "alpha_rad": SIGNAL[None, :] + 0.05,
        "elevator_rad": -SIGNAL[None, :],
        "q_rad_s": 4.0 * SIGNAL[None, :],
        "airspeed_m_s": np.full((1, 200), 40.0),
    }
    state = StateTerm("bending", "lag", "elevator", 0.3)
    terms = (
        ReadingTerm("alpha_rad", "alpha", "above", 0.2, 0.06),
        ReadingTerm("q_rad_s", "qhat", "linear", 3.0),
        ReadingTerm("q_rad_s", "bending", "linear", -0.5),
    )
    more = reading_increments(terms, (state,), truth, BODY, dt_s=DT)
    assert set(more) == {"alpha_rad", "q_rad_s"}
    np.testing.assert_allclose(more["alpha_rad"][0], 0.2 * np.maximum(SIGNAL + 0.05 - 0.06, 0.0), atol=1e-15)
    # q c/(2V) = 4 s 0.3/80
    expected = 3.0 * 0.015 * SIGNAL + 0.5 * integrated(StateTerm("x", "lag", "alpha", 0.3))
    np.testing.assert_allclose(more["q_rad_s"][0], expected, atol=2e-9)


def test_a_lag_that_depends_on_the_dynamic_pressure_is_what_a_state_is_behind_its_signal():
    """To first order in the change of the time constant: y' = (s - y)/(tau + dtau), against an integration of it."""
    speed = np.linspace(38.0, 42.0, 200)
    truth = {
        "alpha_rad": SIGNAL[None, :],
        "elevator_rad": np.zeros((1, 200)),
        "q_rad_s": np.zeros((1, 200)),
        "airspeed_m_s": speed[None, :],
        "density_kg_m3": np.full((1, 200), 1.2),
    }
    tau, middle, slope = 0.1, 0.5 * 1.2 * 40.0**2, -2e-5  # [s], [Pa], [s/Pa]: 2 ms of 100 at either end

    def late(t, y):
        qbar = 0.6 * np.interp(t, T, speed) ** 2
        return [(np.interp(t, T, SIGNAL) - y[0]) / (tau + slope * (qbar - middle))]

    exact = solve_ivp(late, (0.0, T[-1]), [SIGNAL[0]], t_eval=T, rtol=1e-10, atol=1e-13, max_step=DT / 2).y[0]
    # behind the lag itself, the increment is that of the lag: L_(tau + d) s = L_tau (s + d/tau (L_tau s - s)) + O(d^2)
    lag = StateTerm("lag", "lag", "alpha", tau)
    term = ReadingTerm("alpha_rad", "qbar", "linear", slope / tau, middle, behind="lag")
    more = reading_increments((term,), (lag,), truth, BODY, dt_s=DT)["alpha_rad"]
    read = state_of(StateTerm("y", "lag", "alpha", tau), SIGNAL[None, :] + more, DT)[0]
    constant = state_of(StateTerm("y", "lag", "alpha", tau), SIGNAL[None, :], DT)[0]
    assert np.abs(exact - constant).max() > 1e-4
    np.testing.assert_allclose(read, exact, atol=0.04 * np.abs(exact - constant).max())


def test_sensors_without_terms_read_nothing_else():
    assert reading_increments((), (), {}, BODY, DT) == {}


def test_a_play_rests_until_its_signal_has_moved_by_half_a_width():
    """By hand: up by 0.3 with a half width of 0.1 moves it by 0.2; the way back takes 0.2 before it moves again."""
    signal = np.array([[0.0, 0.05, 0.3, 0.2, 0.1, -0.1, -0.05]])
    expected = [[0.0, 0.0, 0.2, 0.2, 0.2, 0.0, 0.0]]
    found = state_of(StateTerm("x", "play", "alpha", half_width=0.1), signal, DT)
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-15)


def test_a_lateral_reading_is_over_its_own_signals():
    """Sidewash at the vane: a share of p b/(2V); the channels of the other motion are not needed."""
    p, v = np.linspace(-0.4, 0.4, 5)[None], np.full((1, 5), 40.0)
    term = ReadingTerm("beta_rad", "phat", "above", 0.3, at=0.002)
    more = reading_increments((term,), (), {"p_rad_s": p, "airspeed_m_s": v}, BODY, DT)
    np.testing.assert_allclose(more["beta_rad"], 0.3 * np.maximum(p / 40.0 - 0.002, 0.0), rtol=1e-12)
