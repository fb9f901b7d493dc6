"""Whether the elevator responds to the innovations of a filter, on records whose feedback is stated."""

import numpy as np
import pytest
from scipy.signal import lfilter

from airtruth.tracing.inference.feedback import responds_to_motion

SAMPLES = 300
DT_S = 0.02
SERVO = np.exp(-DT_S * 2.0 * np.pi * 5.0)
"""Pole of a servo of 5 Hz [-]."""


def record(seed, gain, kind="step", noise_rad=2e-4):
    """Elevator [rad], (1, samples), and white innovations (samples, 3), one of which moves the next command by ``gain``."""
    rng = np.random.default_rng(seed)
    e = rng.standard_normal((SAMPLES, 3))
    t = DT_S * np.arange(SAMPLES)
    if kind == "step":
        command = 0.03 * ((t > 1.0) & (t < 1.5)) - 0.03 * ((t > 1.5) & (t < 2.0))
    else:
        command = 0.01 * sum(
            np.sin(2.0 * np.pi * f * t + rng.uniform(0.0, 6.0)) for f in (0.4, 0.8, 1.2, 1.6, 2.6)
        )
    command = command + gain * np.append(0.0, e[:-1, 1])
    surface = lfilter([1.0 - SERVO], [1.0, -SERVO], command) + noise_rad * rng.standard_normal(SAMPLES)
    return surface[None, :], e


@pytest.mark.parametrize("kind", ["step", "multisine"])
@pytest.mark.parametrize(("gain", "answer"), [(0.0, False), (2e-3, True)])
def test_a_damper_is_told_from_a_pilot_who_looks_away(kind, gain, answer):
    records = [record(seed, gain, kind) for seed in range(6)]
    assert responds_to_motion(*zip(*records, strict=True)) is answer


def test_innovations_that_the_elevator_causes_are_no_feedback():
    """A model that lacks a part of the response leaves innovations that follow the elevator, and not the other way round."""
    elevators, innovations = zip(*(record(seed, 0.0) for seed in range(6)), strict=True)
    wrong = [
        e + 300.0 * np.stack([lfilter([0.0, 1.0], [1.0, -0.8], de[0])] * 3, axis=1)
        for de, e in zip(elevators, innovations, strict=True)
    ]
    assert responds_to_motion(elevators, wrong) is False


@pytest.mark.parametrize(
    ("samples", "noise_rad"), [(SAMPLES, 0.0), (20, 2e-4)], ids=["nothing but a command", "too few samples"]
)
def test_records_that_tell_nothing_are_no_feedback(samples, noise_rad):
    de, e = record(1, 0.0, noise_rad=noise_rad)
    assert responds_to_motion([de[:, :samples]], [e[:samples]]) is False


def test_a_record_whose_motion_is_lost_is_left_out():
    de, e = record(1, 2e-3)
    assert responds_to_motion([de, de], [e, np.full_like(e, np.nan)]) is True
    assert responds_to_motion([de], [np.full_like(e, np.nan)]) is False


def test_one_of_two_controls_that_responds_is_feedback():
    calm, alive = ([record(seed, gain) for seed in range(6)] for gain in (0.0, 2e-3))
    both = [np.concatenate([a, b]) for (a, _), (b, _) in zip(calm, alive, strict=True)]
    assert responds_to_motion(both, [e for _, e in alive]) is True
