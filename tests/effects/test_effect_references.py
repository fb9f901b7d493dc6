"""What a written effect does in JSBSim, against references that share nothing with how it is written."""

import effect_flights as flights
import numpy as np
import oracle
import pytest

from airtruth.aircraft.write import Corrections
from airtruth.effects.registry import EFFECTS
from airtruth.physics import sensors
from airtruth.physics.terms import AeroTerm, Change, StateTerm, SurfaceTerm
from airtruth.simulation.linearise import linearise
from airtruth.simulation.trim import trim
from airtruth.units import DEG

pytestmark = pytest.mark.slow

HZ = 200.0


def rate_limited(x, dt, rate):
    y = x.copy()
    for k in range(1, len(x)):
        y[k] = y[k - 1] + np.clip(x[k] - y[k - 1], -rate * dt, rate * dt)
    return y


def with_play(x, width):
    y = x.copy()
    for k in range(1, len(x)):
        y[k] = min(max(y[k - 1], x[k] - width / 2), x[k] + width / 2)
    return y


SURFACES = {
    "whole delay": (SurfaceTerm("delay", 0.06), lambda x, dt: sensors.delay(x, dt, 0.06)),
    "part of a step": (SurfaceTerm("delay", 0.0113), lambda x, dt: sensors.delay(x, dt, 0.0113)),
    "lag": (SurfaceTerm("lag", 0.08), lambda x, dt: sensors.lag(x, dt, 0.08)),
    "rate limit": (SurfaceTerm("rate_limit", 0.5), lambda x, dt: rate_limited(x, dt, 0.5)),
    "backlash": (SurfaceTerm("backlash", 0.5 * DEG), lambda x, dt: with_play(x, 0.5 * DEG)),
}


@pytest.mark.parametrize("name", SURFACES)
@pytest.mark.parametrize("hz", [200.0, 400.0])
def test_surface_term_is_a_replay_of_the_surface_that_the_air_sees(gtm, paper_condition, tmp_path, name, hz):
    term, shape = SURFACES[name]
    plane = flights.changed(gtm, Change(surface=(term,)), tmp_path)
    _, flown = flights.fly(plane, paper_condition, hz)
    air = shape(flown["elevator_rad"], 1.0 / hz)
    _, replayed = flights.fly(gtm, paper_condition, hz, surface=air - air[0])
    # The aircraft without the effect, flown with the surface that physics.sensors or a loop above makes.
    for channel, tolerance in (("alpha_rad", 1e-13), ("q_rad_s", 1e-13), ("az_m_s2", 1e-11)):
        np.testing.assert_allclose(flown[channel], replayed[channel], rtol=0, atol=tolerance)
    # The effect also acts when the measured surface itself is replayed past the actuator.
    own = flown["elevator_rad"]
    _, again = flights.fly(plane, paper_condition, hz, surface=own - own[0])
    np.testing.assert_allclose(again["q_rad_s"], flown["q_rad_s"], rtol=0, atol=1e-13)


def test_terms_of_the_surface_act_in_sequence(gtm, paper_condition, tmp_path):
    terms = (SurfaceTerm("rate_limit", 0.5), SurfaceTerm("delay", 0.05))
    plane = flights.changed(gtm, Change(surface=terms), tmp_path)
    _, flown = flights.fly(plane, paper_condition)
    air = sensors.delay(rate_limited(flown["elevator_rad"], 1 / HZ, 0.5), 1 / HZ, 0.05)
    _, replayed = flights.fly(gtm, paper_condition, surface=air - air[0])
    np.testing.assert_allclose(flown["q_rad_s"], replayed["q_rad_s"], rtol=0, atol=1e-13)


def test_a_delay_above_its_highest_rate_is_that_many_steps(gtm, paper_condition, tmp_path):
    plane = flights.changed(gtm, Change(surface=(SurfaceTerm("delay", 0.05),)), tmp_path, highest_hz=100.0)
    _, flown = flights.fly(plane, paper_condition, 200.0)
    air = sensors.delay(flown["elevator_rad"], 1 / 200.0, 5 / 200.0)
    _, replayed = flights.fly(gtm, paper_condition, 200.0, surface=air - air[0])
    np.testing.assert_allclose(flown["q_rad_s"], replayed["q_rad_s"], rtol=0, atol=1e-13)


def late_lift(share):
    return lambda s, x: (share * (x[0] - s["alpha"]), 0.0)


def late_moment(share):
    return lambda s, x: (0.0, share * (x[0] - s["alpha"]))


WN, ZETA = 2 * np.pi * 2.0, 0.1
AERODYNAMICS = {
    "elevator_asymmetry": ({"dCmde": 0.5}, lambda s, x: (0.0, 0.5 * min(0.0, s["elevator"])), None, None),
    "cm_alpha_nonlinear:break": (
        {"dCmalpha": 0.5, "at_alpha_rad": 0.11},
        lambda s, x: (0.0, 0.5 * max(0.0, s["alpha"] - 0.11)),
        None,
        None,
    ),
    "cm_alpha_nonlinear:quadratic": (
        {"Cmalpha2": 2.0},
        lambda s, x: (0.0, 2.0 * s["alpha"] ** 2),
        None,
        None,
    ),
    "cl_alpha_nonlinear:break": (
        {"dCLalpha": 2.0, "at_alpha_rad": 0.11},
        lambda s, x: (2.0 * max(0.0, s["alpha"] - 0.11), 0.0),
        None,
        None,
    ),
    "cl_alpha_nonlinear:quadratic": (
        {"CLalpha2": 5.0},
        lambda s, x: (5.0 * s["alpha"] ** 2, 0.0),
        None,
        None,
    ),
    "downwash_lag": ({"Cmalphadot": -20.0}, lambda s, x: (0.0, -20.0 * s["alpha_dot_hat"]), None, None),
    "lift_alpha_dot": ({"CLalphadot": 20.0}, lambda s, x: (20.0 * s["alpha_dot_hat"], 0.0), None, None),
    "lift_lag": (
        {"dCLalpha": 2.0, "tau_s": 0.15},
        late_lift(2.0),
        lambda s, x: ((s["alpha"] - x[0]) / 0.15,),
        lambda alpha: (alpha,),
    ),
    "elastic_mode": (
        {"dCmalpha": 0.5, "frequency_hz": 2.0, "damping": 0.1},
        late_moment(0.5),
        lambda s, x: (x[1], WN**2 * (s["alpha"] - x[0]) - 2 * ZETA * WN * x[1]),
        lambda alpha: (alpha, 0.0),
    ),
}


def compare(before, after, reference_before, reference_after, share):
    """Change that the effect makes, JSBSim against the integration; error over the change's peak."""
    worst = {}
    for name in ("alpha_rad", "q_rad_s", "az_m_s2"):
        flown = (after[name] - after[name][0]) - (before[name] - before[name][0])
        expected = reference_after[name] - reference_after[name][0]
        expected = expected - (reference_before[name] - reference_before[name][0])
        worst[name] = np.abs(flown - expected).max() / np.abs(expected).max()
    print({k: f"{100 * v:.2f} %" for k, v in worst.items()})
    assert max(worst.values()) < share, worst


@pytest.fixture(scope="module")
def plain(gtm, paper_condition):
    start, flown = flights.fly(gtm, paper_condition)
    return flown, flights.integrate(start, flown["elevator_rad"], HZ)


@pytest.mark.parametrize("key", AERODYNAMICS)
def test_aerodynamic_term_against_an_independent_integration(gtm, paper_condition, plain, tmp_path, key):
    values, more, states, settled = AERODYNAMICS[key]
    plane = flights.changed(gtm, EFFECTS[key].change(values), tmp_path)
    start, flown = flights.fly(plane, paper_condition)
    extra = {} if states is None else {"states": states, "settled": settled}
    reference = flights.integrate(start, flown["elevator_rad"], HZ, more, **extra)
    compare(plain[0], flown, plain[1], reference, 0.015 if key == "lift_alpha_dot" else 0.005)


def table_at(x, points, values):
    return float(np.interp(x, points, values))


PAIRS = {
    "CLde over a break in alpha": (
        (AeroTerm("CL", "alpha", "above", 8.0, 0.08, "elevator", 0.02),),
        lambda s: (8.0 * max(0.0, s["alpha"] - 0.08) * (s["elevator"] - 0.02), 0.0),
    ),
    "Cmq over the dynamic pressure": (
        (AeroTerm("Cm", "qbar", "linear", -0.5, 850.0, "qhat"),),
        lambda s: (0.0, -0.5 * (s["qbar"] - 850.0) * s["qhat"]),
    ),
    "Cm over the dynamic pressure": (
        (AeroTerm("Cm", "qbar", "linear", 2e-4, 900.0),),
        lambda s: (0.0, 2e-4 * (s["qbar"] - 900.0)),
    ),
    "Cmde over a table in alpha": (
        tuple(
            AeroTerm("Cm", "alpha", "above", slope, at, "elevator", 0.01)
            for at, slope in ((0.06, 10.0), (0.08, -4.0), (0.12, -6.0))
        ),
        lambda s: (0.0, table_at(s["alpha"], [0.06, 0.08, 0.12], [0.0, 0.2, 0.44]) * (s["elevator"] - 0.01)),
    ),
}


@pytest.mark.parametrize("name", PAIRS)
def test_pair_of_signals_against_an_independent_integration(gtm, paper_condition, plain, tmp_path, name):
    terms, more = PAIRS[name]
    plane = flights.changed(gtm, Change(aero=terms), tmp_path)
    start, flown = flights.fly(plane, paper_condition)
    reference = flights.integrate(start, flown["elevator_rad"], HZ, lambda s, x: more(s))
    compare(plain[0], flown, plain[1], reference, 0.005)


def test_corrected_derivatives_against_an_independent_integration(gtm, paper_condition, plain, tmp_path):
    start, _ = flights.fly(gtm, paper_condition)
    amounts = {"CLalpha": 0.5, "CLq": 10.0, "CLde": 0.2, "Cmalpha": -0.4, "Cmq": 8.0, "Cmde": 0.3}
    corrections = Corrections(amounts, {"alpha": start.alpha_rad, "elevator": start.elevator_rad})
    plane = flights.changed(gtm, Change(), tmp_path, derivatives=corrections)
    after, flown = flights.fly(plane, paper_condition)
    assert after.alpha_rad == pytest.approx(start.alpha_rad, abs=1e-10)  # the trim stays
    assert after.elevator_rad == pytest.approx(start.elevator_rad, abs=1e-10)

    def more(s, x):
        d = (s["alpha"] - start.alpha_rad, s["qhat"], s["elevator"] - start.elevator_rad)
        lift = 0.5 * d[0] + 10.0 * d[1] + 0.2 * d[2]
        return lift, -0.4 * d[0] + 8.0 * d[1] + 0.3 * d[2]

    compare(plain[0], flown, plain[1], flights.integrate(after, flown["elevator_rad"], HZ, more), 0.005)


def heavier(monkeypatch):
    monkeypatch.setattr(oracle, "MASS", 1.1 * oracle.MASS)


def stiffer(monkeypatch):
    monkeypatch.setattr(oracle, "IYY", 1.2 * oracle.IYY)


def aft(monkeypatch):
    monkeypatch.setattr(oracle, "CG", (oracle.CG[0] + 0.03 * oracle.C / oracle.IN, oracle.CG[1]))


def lower_thrust(monkeypatch):
    monkeypatch.setattr(oracle, "ENGINE", (oracle.ENGINE[0], oracle.ENGINE[1] - 0.1 / oracle.IN))


DECLARED = {
    "mass_error": ({"factor": 1.1}, heavier, 1.0),
    "inertia_error": ({"factor": 1.2}, stiffer, 1.0),
    "cg_shift": ({"dx_mac": 0.03}, aft, 1.0),
    "thrust_moment": ({"arm_m": 0.1}, lower_thrust, 1.0),
    "elevator_effectiveness": ({"factor": 0.8}, lambda monkeypatch: None, 0.8),
}


@pytest.mark.parametrize("key", DECLARED)
def test_declared_value_against_an_independent_integration(
    gtm, paper_condition, plain, tmp_path, monkeypatch, key
):
    values, patch, gain = DECLARED[key]
    plane = flights.changed(gtm, EFFECTS[key].change(values), tmp_path)
    start, flown = flights.fly(plane, paper_condition)
    patch(monkeypatch)
    reference = flights.integrate(start, gain * flown["elevator_rad"], HZ)
    # a start in equilibrium: the trim, too, is that of the changed aircraft
    assert np.abs(reference["q_rad_s"][:50]).max() < 1e-3
    compare(plain[0], flown, plain[1], reference, 0.005)


def test_derivatives_of_the_elevator_share_its_effectiveness(gtm, paper_condition, tmp_path):
    start = trim(gtm, paper_condition)
    corrections = Corrections(
        {"CLde": 0.2, "Cmde": 0.3}, {"alpha": start.alpha_rad, "elevator": start.elevator_rad}
    )
    weak = EFFECTS["elevator_effectiveness"].change({"factor": 0.8})
    plane = flights.changed(gtm, weak, tmp_path, derivatives=corrections)
    after = trim(plane, paper_condition)
    assert after.elevator_rad == pytest.approx(start.elevator_rad / 0.8, abs=1e-9)
    before = linearise(gtm, start).central
    cosine = np.cos(start.alpha_rad)
    expected = before + np.array([0.0, 0.0, 0.2 * cosine, 0.0, 0.0, 0.3])
    expected[[2, 5]] *= 0.8
    # rtol: the tables are not quite linear over the wider step of the deflection
    np.testing.assert_allclose(linearise(plane, after).central, expected, rtol=2e-3, atol=1e-6)


def test_state_of_any_name_and_signal_can_be_read(gtm, paper_condition, plain, tmp_path):
    state = StateTerm("late-elevator", "lag", "elevator", 0.1)
    change = Change(states=(state,), aero=(AeroTerm("Cm", state.name, "linear", -0.5),))
    start, flown = flights.fly(flights.changed(gtm, change, tmp_path), paper_condition)
    reference = flights.integrate(
        start,
        flown["elevator_rad"],
        HZ,
        lambda s, x: (0.0, -0.5 * x[0]),
        lambda s, x: ((s["elevator"] - x[0]) / 0.1,),
        lambda alpha: (start.elevator_rad,),
    )
    compare(plain[0], flown, plain[1], reference, 0.005)


def test_hysteresis_of_the_moment_against_an_independent_integration(gtm, paper_condition, plain, tmp_path):
    """Cm += 0.5 x, x the play of the angle of attack with a half width of 5 mrad, by its definition."""
    half, amplitude = 5e-3, 0.5
    state = StateTerm("hysteresis", "play", "alpha", half_width=half)
    change = Change(states=(state,), aero=(AeroTerm("Cm", state.name, "linear", amplitude),))
    start, flown = flights.fly(flights.changed(gtm, change, tmp_path), paper_condition)
    x = [start.alpha_rad]

    def moment(signals, _):
        x[0] = min(max(x[0], signals["alpha"] - half), signals["alpha"] + half)
        return 0.0, amplitude * x[0]

    reference = flights.integrate(start, flown["elevator_rad"], HZ, moment)
    assert np.ptp(flown["alpha_rad"]) > 4.0 * half
    compare(plain[0], flown, plain[1], reference, 0.02)
