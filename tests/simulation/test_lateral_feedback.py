"""Yaw damper and bank hold: the commands of their law."""

import numpy as np
import pytest

from airtruth.simulation.lateral_feedback import LateralFeedback, Loop

STEPS = 4001


def feedback(errors: float = 0.0, **gains) -> LateralFeedback:
    return LateralFeedback(*(np.full(STEPS, e) for e in (errors, 2 * errors, 3 * errors)), every=4, **gains)


def loop(given: LateralFeedback, bank_rad: float = 0.0) -> tuple[Loop, dict[str, float]]:
    motion = dict.fromkeys(("p", "r", "phi"), 0.0)
    return Loop(given, 0.005, bank_rad, [lambda n=name: motion[n] for name in motion]), motion


def test_commands_are_the_gains_times_the_readings_and_are_held():
    own, motion = loop(feedback(0.01, yaw_damper_gain_s=0.5, roll_damper_gain_s=0.2, bank_gain=0.4), 0.1)
    motion |= {"p": 0.3, "r": -0.2, "phi": 0.25}
    aileron, rudder = own.at(8)
    assert rudder == pytest.approx(0.5 * (-0.2 + 0.02), abs=1e-15)
    assert aileron == pytest.approx(0.4 * (0.25 + 0.03 - 0.1) + 0.2 * (0.3 + 0.01), abs=1e-15)
    motion["p"] = 9.0
    assert own.at(9) == own.at(11) == (aileron, rudder)
    assert own.at(12) != (aileron, rudder)


def test_the_command_of_a_control_is_added_in_the_units_of_its_property():
    own, motion = loop(feedback(bank_gain=0.4))
    sent = []
    send = own.added("aileron", sent.append, 2.0)
    motion["phi"] = 0.25
    own.at(0)
    send(0.3)
    assert sent == [pytest.approx(0.3 + 2.0 * 0.1)]


def test_washout_forgets_a_constant_yaw_rate():
    """High pass of a step from zero at the samples: exp(-t/T) of it, with t counted from the sample before the step."""
    own, motion = loop(feedback(yaw_damper_gain_s=1.0, washout_s=2.0))
    motion["r"] = 0.3
    found = [own.at(step)[1] for step in range(0, 800, 4)]
    t = 0.02 * np.arange(1, len(found) + 1)
    np.testing.assert_allclose(found, 0.3 * np.exp(-t / 2.0), rtol=1e-12)


def test_washout_has_the_gain_of_its_high_pass():
    """Gain and phase of j w T/(j w T + 1) at .5 rad/s; the sampled form differs by half a period, w dt/2 = .005."""
    w, tau = 0.5, 2.0
    own, motion = loop(feedback(yaw_damper_gain_s=1.0, washout_s=tau))
    t = 0.02 * np.arange(1000)
    found = []
    for k, time in enumerate(t):
        motion["r"] = np.sin(w * time)
        found.append(own.at(4 * k)[1])
    late = t > 8.0
    basis = np.stack([np.sin(w * t[late]), np.cos(w * t[late])], axis=1)
    response = np.linalg.lstsq(basis, np.array(found)[late], rcond=None)[0] @ [1, 1j]
    assert response == pytest.approx(1j * w * tau / (1j * w * tau + 1), abs=8e-3)
