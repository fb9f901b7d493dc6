"""Gravity across a path that turns: methods with measured pressure take it from the measured attitude."""

from dataclasses import replace

import numpy as np
import pytest

from airtruth.identification import identify
from airtruth.identification.condition import across_path
from airtruth.logs.flight_log import Batch
from validation import small_aircraft as small


@pytest.fixture(scope="module")
def plane(tmp_path_factory):
    return small.declared(tmp_path_factory.mktemp("small"))


@pytest.fixture
def logs(monkeypatch):
    """24 records without noise of surface and airspeed; their paths turn by up to 25 deg."""
    quiet = {**small.NOISE, "elevator_rad": 1e-6, "airspeed_m_s": 1e-3}
    monkeypatch.setattr(small, "NOISE", quiet)
    return [small.flight_log(seed) for seed in range(600, 604)]


def batch(gamma_rad):
    alpha = np.full_like(gamma_rad, 0.05)
    channels = {"alpha_rad": alpha, "theta_rad": alpha + gamma_rad}
    return Batch(("a", "b"), 0.02, np.zeros_like(gamma_rad), channels)


def test_it_is_the_cosine_of_the_path_angle_where_that_changes():
    """A path that turns by 0.3 rad, and one that turns by 0.06 rad: 1 - cos is 0.044 and 0.0018."""
    gamma = np.stack([np.linspace(0.0, 0.3, 401), np.linspace(0.0, 0.06, 401)])
    np.testing.assert_allclose(across_path(batch(gamma))[0], np.cos(gamma[0]), rtol=1e-14)
    assert np.array_equal(across_path(batch(gamma))[1], np.ones(401))


def test_it_is_one_without_an_attitude():
    gamma = np.tile(np.linspace(0.0, 0.3, 401), (2, 1))
    known = batch(gamma)
    without = replace(known, channels={"alpha_rad": known.channels["alpha_rad"]})
    assert np.array_equal(across_path(without), np.ones((2, 401)))


def without_attitude(log):
    return replace(log, channels={k: v for k, v in log.channels.items() if k != "theta_rad"})


@pytest.mark.slow
def test_errors_are_those_of_the_noise_alone(plane, logs):
    """Cmalpha of output-error in 24 records: its relative error has a root mean square of one if the intervals are true."""
    relative = []
    for edited in (logs, [without_attitude(log) for log in logs]):
        frames = [identify(log, plane, ["output-error"]).to_frame() for log in edited]
        errors = [(f["Cmalpha"] - small.MOMENT[1]) / f["Cmalpha_std"] for f in frames]
        relative.append(float(np.sqrt(np.mean(np.concatenate(errors) ** 2))))
    assert relative[0] < 1.4
    assert relative[1] > 1.8
