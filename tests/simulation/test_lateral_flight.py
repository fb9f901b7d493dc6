"""Flights of the GTM in six axes in JSBSim against an independent integration of its figures (validation/lateral_flight.py)."""

from dataclasses import replace

import numpy as np
import pytest

from airtruth.physics.motion import LATERAL
from airtruth.simulation.flight import Flight, Inputs, LateralInputs
from airtruth.simulation.linearise import STEPS, linearise
from airtruth.simulation.manoeuvres import Manoeuvre, sample
from airtruth.simulation.simulator import Executive
from airtruth.simulation.trim import trim
from validation import lateral_flight

AMPLITUDE_RAD = np.deg2rad(3.0)
CHANNELS = ("beta_rad", "p_rad_s", "r_rad_s", "phi_rad", "ay_m_s2")


@pytest.fixture(scope="module")
def level(gtm, paper_condition):
    return trim(gtm, replace(paper_condition, straight="wings-level"))


@pytest.fixture(scope="module")
def own(level):
    return lateral_flight.trim(level.airspeed_m_s, level.condition.altitude_m)


def test_both_have_the_same_equilibrium(level, own):
    found = [
        level.alpha_rad,
        level.controls.of("beta_rad"),
        level.elevator_rad,
        level.surfaces_rad["aileron"],
        level.surfaces_rad["rudder"],
    ]
    # JSBSim's gas constant differs from the 1976 standard's by 1e-5.
    np.testing.assert_allclose(found, [own.alpha, own.beta, *own.surfaces], atol=2e-6)
    assert level.controls.throttle == pytest.approx(own.lever, abs=1e-5)


def test_both_have_the_same_accelerations_off_the_trim(gtm, level, own):
    """Roll and yaw couple through Ixz, whose sign JSBSim takes the other way unless the model says so."""
    executive = Executive(gtm, 1.0 / 200.0)
    moved = level.controls.moved({"aileron": 0.1, "rudder": 0.1}, p_rad_s=0.3, r_rad_s=-0.2)
    executive.initialise(level.condition, moved)
    found = executive.respond()
    state = own.state
    state[3], state[5] = 0.3, -0.2
    expected, _ = lateral_flight.motion(state, np.array([own.surfaces[0], 0.1, 0.1]), own.lever)
    accelerations = [found.v_dot_m_s2, found.p_dot_rad_s2, found.q_dot_rad_s2, found.r_dot_rad_s2]
    np.testing.assert_allclose(accelerations, expected[[1, 3, 4, 5]], rtol=2e-4)


def test_derivatives_are_differences_of_the_independent_equations(gtm, level, own):
    """Moments from the accelerations: rates about one axis at a time add no gyroscopic moment in roll and yaw."""
    density, _ = lateral_flight.standard_atmosphere(own.height)
    force = 0.5 * density * own.airspeed**2 * lateral_flight.S
    half = lateral_flight.B / (2.0 * own.airspeed)

    def coefficients(change):
        beta, p, r, aileron, rudder = change
        at = replace(own, beta=own.beta + beta, surfaces=own.surfaces + np.array([0.0, aileron, rudder]))
        state = at.state
        state[3], state[5] = p, r
        rates, specific = lateral_flight.motion(state, at.surfaces, at.lever)
        roll, _, yaw = lateral_flight.INERTIA @ rates[3:6]
        side = lateral_flight.MASS * specific[1]
        return np.array([side, roll / lateral_flight.B, yaw / lateral_flight.B]) / force

    steps = list(STEPS[LATERAL.name].values())
    slopes = [
        (coefficients(h) - coefficients(-h)) / (2.0 * s) for h, s in zip(np.diag(steps), steps, strict=True)
    ]
    expected = np.column_stack(slopes) / np.array([1.0, half, half, 1.0, 1.0])
    found = linearise(gtm, level, motion=LATERAL).central.reshape(3, 5)
    np.testing.assert_allclose(found, expected, rtol=2e-4, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("control", ["rudder", "aileron"])
def test_a_doublet_matches_the_independent_integration(gtm, level, own, control):
    """Peak error over the peak of the response, at the 200 Hz of the campaigns: 0.19 % for ay, where a doublet's edges stand
    between two samples of the servo, and 0.08 % elsewhere."""
    hz, samples = 200, 1601
    t = np.arange(samples) / hz
    zero = np.zeros(samples)
    command = AMPLITUDE_RAD * sample(Manoeuvre("doublet", 1.0, start_s=1.0, step_s=0.5), t)
    lateral = LateralInputs({control: command})
    flown = Flight(gtm, level, 1.0 / hz, hz // 50).fly(Inputs(zero, zero, zero, lateral=lateral))
    expected = lateral_flight.doublet(own, control, AMPLITUDE_RAD, 1.0, 0.5, t[:: hz // 50])
    for name in CHANNELS:
        peak = np.abs(expected[name] - expected[name][0]).max()
        error = np.abs(flown[name] - expected[name]).max() / peak
        print(f"{control} {name}: {100 * error:.4f} %")
        assert error < 5e-3, name
