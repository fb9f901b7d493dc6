"""Yaw damper and bank hold: the commands of their law."""

import numpy as np
import pytest

from airtruth.simulation.lateral_feedback import LateralFeedback, Loop

STEPS = 4001


def feedback(errors: float = 0.0, **gains) -> LateralFeedback:
    return LateralFeedback(
        tuple(np.full(STEPS, e) for e in (errors, 2 * errors, 3 * errors)), every=4, **gains
    )


def loop(given: LateralFeedback, bank_rad: float = 0.0) -> tuple[Loop, dict[str, float]]:
    motion = dict.fromkeys(("p", "r", "phi"), 0.0)
    return Loop(given, 0.005, bank_rad, [lambda n=name: motion[n] for name in motion]), motion


def test_feedback_is_the_gains_times_the_readings_and_is_held():
    own, motion = loop(feedback(0.01, yaw_damper_gain_s=0.5, roll_damper_gain_s=0.2, bank_gain=0.4), 0.1)
    motion |= {"p": 0.3, "r": -0.2, "phi": 0.25}
    own.sample(8)
    assert own.angles_rad[1] == pytest.approx(0.5 * (-0.2 + 0.02), abs=1e-15)
    assert own.angles_rad[0] == pytest.approx(0.4 * (0.25 + 0.03 - 0.1) + 0.2 * (0.3 + 0.01), abs=1e-15)
    before = own.angles_rad[0]
    motion["p"] = 9.0
    own.sample(11)
    assert own.angles_rad[0] == before
    own.sample(12)
    assert own.angles_rad[0] != before


def test_feedback_is_added_to_the_commands_in_the_units_of_their_properties():
    own, motion = loop(feedback(bank_gain=0.4, yaw_damper_gain_s=0.1))
    sent = []
    aileron, rudder = own.added([sent.append, sent.append], [2.0, -1.0])
    motion |= {"phi": 0.25, "r": 1.0}
    own.sample(0)
    aileron(0.3)
    rudder(0.3)
    assert sent == [pytest.approx(0.3 + 2.0 * 0.1), pytest.approx(0.3 - 0.1)]


def test_washout_forgets_a_constant_yaw_rate():
    """High pass of a step from zero at the samples: exp(-t/T) of it, with t counted from the sample before the step."""
    own, motion = loop(feedback(yaw_damper_gain_s=1.0, washout_s=2.0))
    motion["r"] = 0.3
    found = []
    for step in range(0, 800, 4):
        own.sample(step)
        found.append(own.angles_rad[1])
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
        own.sample(4 * k)
        found.append(own.angles_rad[1])
    late = t > 8.0
    basis = np.stack([np.sin(w * t[late]), np.cos(w * t[late])], axis=1)
    response = np.linalg.lstsq(basis, np.array(found)[late], rcond=None)[0] @ [1, 1j]
    assert response == pytest.approx(1j * w * tau / (1j * w * tau + 1), abs=8e-3)
