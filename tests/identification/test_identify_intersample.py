"""What is rebuilt between samples, against exact areas of a servo's motion."""

import numpy as np
import pytest

from airtruth.numerics.intersample import servo_bend, servo_decay
from validation.linear_flight import DEG, SERVO_RAD_S, doublet, fly


def servo(t_s, steps):
    """Response of a first-order servo to steps (time, size) and its integral, in closed form."""
    value = np.zeros_like(t_s)
    area = np.zeros_like(t_s)
    for at, size in steps:
        since = np.maximum(t_s - at, 0.0)
        gone = -np.expm1(-SERVO_RAD_S * since)
        value += size * gone
        area += size * (since - gone / SERVO_RAD_S)
    return value, area


def smooth_mean(x):
    """Mean of each cell by the cubic through four samples; beyond the ends the end sample repeats."""
    wide = np.concatenate([x[:1], x, x[-1:]])
    return (13.0 * (wide[1:-2] + wide[2:-1]) - wide[:-3] - wide[3:]) / 24.0


@pytest.mark.parametrize("late_s", [0.0, 0.004, 0.011, 0.019])
@pytest.mark.parametrize("dt", [0.01, 0.02])
def test_rebuilds_the_area_of_every_cell(late_s, dt):
    """Steps on and between the samples: to 1e-6 of the amplitude from three cells after a corner on."""
    t = np.arange(round(5.0 / dt)) * dt
    steps = [(1.0 + late_s, 2 * DEG), (1.5 + late_s, -4 * DEG), (2.0 + late_s, 2 * DEG)]
    de, area = servo(t, steps)
    exact = np.diff(area) / dt - smooth_mean(de)
    bend = servo_bend(de[None])[0]
    assert bend[0] == 0.0
    # against what a smooth interpolation misses, 0.6e-3 to 3e-3 rad
    np.testing.assert_allclose(bend[1:], exact, atol=2e-2 * np.abs(exact).max())
    assert np.sum(bend) * dt == pytest.approx(np.sum(exact) * dt, abs=1e-3 * np.abs(exact).max() * dt)


@pytest.mark.parametrize("frequency", [0.5, 1.5, 3.0])
def test_leaves_a_smooth_elevator_alone(frequency):
    t = np.arange(500) * 0.02
    de = 0.03 * np.sin(2 * np.pi * frequency * t) + 0.01 * np.sin(2 * np.pi * 0.37 * t)
    assert (servo_bend(de[None]) == 0.0).all()


@pytest.mark.parametrize("rate_hz", [10, 20, 50])
@pytest.mark.parametrize("seed", range(5))
def test_smooth_inputs_of_a_pilot_between_rests_show_no_servo(rate_hz, seed):
    """Doublets whose edges take 0.5 s, between rests that fill half of the record."""
    rng = np.random.default_rng(seed)
    t = np.arange(24 * 400) / 400.0
    command, start = np.zeros_like(t), 2.0
    for k in range(4):
        end = start + rng.uniform(0.5, 1.2)
        command[(t >= start) & (t < end)] = (-1.0) ** k * rng.uniform(0.5, 2.0)
        start = end + rng.choice([0.0, 2.0])
    kernel = np.convolve(np.ones(100), np.ones(100)) / 1e4
    de = np.convolve(command, kernel, "same")[:: 400 // rate_hz] * DEG
    assert (servo_bend(de[None]) == 0.0).all()


def test_leaves_noise_and_rest_alone():
    rng = np.random.default_rng(4)
    assert (servo_bend(rng.normal(size=(5, 250)) * 1e-3) == 0.0).all()
    assert (servo_bend(np.full((1, 250), 0.1)) == 0.0).all()


def test_sensor_noise_changes_it_little():
    """With the GTM's 0.01 deg on the surface, 2 deg steps: to a quarter of the correction."""
    clean = servo_bend(fly(shape=doublet).channels["elevator_rad"])
    noisy = servo_bend(
        fly(shape=doublet).channels["elevator_rad"]
        + 0.01 * DEG * np.random.default_rng(5).normal(size=(1, 250))
    )
    assert np.abs(noisy - clean).max() < 0.25 * np.abs(clean).max()


def test_leaves_steps_between_two_samples_alone():
    """Half of each step on either side of a sample, with noise: the increment after it is noise, and no decay of a servo."""
    rng = np.random.default_rng(7)
    t = np.arange(500) * 0.02
    de = np.zeros((40, 500))
    for start, level in ((1.0, 1.5), (1.6, -3.0), (2.2, 1.5), (5.0, 1.2), (5.8, -2.4), (6.4, 1.2)):
        de += np.where(t > start + 0.01, level, np.where(t > start - 0.01, 0.5 * level, 0.0)) * DEG
    bend = servo_bend(de + 0.02 * DEG * rng.standard_normal(de.shape))
    assert (bend == 0.0).all()


@pytest.mark.parametrize(("noise_deg", "is_servo"), [(0.0, True), (0.01, True), (0.02, False)])
def test_an_increment_within_the_noise_is_no_servo(noise_deg, is_servo):
    """A step of 3.3 deg in one cell, then 0.07 deg, which is 3 sqrt(2) times 0.0165 deg."""
    de = np.zeros(500)
    de[100:] = 3.3
    de[101:] += 0.07
    assert servo_bend(de[None] * DEG, noise_deg * DEG).any() == is_servo


STEPS = ((1.013, 2.0), (1.513, -4.0), (2.013, 2.0))
"""Times [s] and sizes [deg] of the command's steps."""


def increments(bandwidth_hz, rate_hz, noise_deg=0.0, runs=1):
    """Increments of a doublet through a first-order servo, in closed form."""
    t = np.arange(round(4.0 * rate_hz)) / rate_hz
    de = sum(size * -np.expm1(-2.0 * np.pi * bandwidth_hz * np.maximum(t - at, 0.0)) for at, size in STEPS)
    noise = np.random.default_rng(8).standard_normal((runs, t.size))
    return np.diff((de + noise_deg * noise) * DEG, axis=1)


@pytest.mark.parametrize(("bandwidth_hz", "rate_hz"), [(5.0, 50.0), (10.0, 50.0), (5.0, 20.0), (10.0, 40.0)])
def test_the_decay_is_that_of_a_servo_that_settles_within_two_or_three_samples(bandwidth_hz, rate_hz):
    """The ratio behind a step within a cell has the larger weight; its command moves in more cells."""
    decay = np.exp(-2.0 * np.pi * bandwidth_hz / rate_hz)
    assert servo_decay(increments(bandwidth_hz, rate_hz), 0.0) == pytest.approx([decay], rel=1e-6)


def test_a_declared_servo_is_preferred_where_it_settles_within_three_samples():
    """5 Hz at 20 Hz with 0.01 deg of noise: by the samples alone nearly twice its decay."""
    decay = np.exp(-2.0 * np.pi * 5.0 / 20.0)
    moves = increments(5.0, 20.0, noise_deg=0.01, runs=50)
    np.testing.assert_array_equal(servo_decay(moves, 0.0, decay), decay)
    slow = np.exp(-2.0 * np.pi * 5.0 / 50.0)
    moves = increments(5.0, 50.0, noise_deg=0.01, runs=50)
    np.testing.assert_array_equal(servo_decay(moves, 0.0, slow), servo_decay(moves, 0.0))


def test_a_declared_servo_that_the_samples_contradict_is_not_taken():
    """Steps at samples and rest between them: a servo of 5 Hz would need a second step after each."""
    moves = np.zeros((1, 80))
    moves[0, [20, 30, 40]] = np.array([2.0, -4.0, 2.0]) * DEG
    assert servo_decay(moves, 0.0, 0.2)[0] != 0.2
    assert not np.isfinite(servo_decay(np.zeros((1, 80)), 0.0, 0.2)).any()
