"""The surface behind a pitch damper: its gain and phase by the samples, and the path between them."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from scipy.signal import cont2discrete, dlsim, lfilter

from airtruth.logs.flight_log import FlightLog
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.terms import SurfaceTerm
from airtruth.tracing.model.damper import Damper, damper_surface, find_damper
from airtruth.tracing.model.reading import MeasuredControl, read
from airtruth.tracing.model.surface import through
from airtruth.tracing.model.surface_path import read_between
from airtruth.units import DEG

DT, TAU, CELLS, SAMPLES = 0.02, 1.0 / (2.0 * np.pi * 5.0), 64, 300
NOISE = 0.01 * DEG
DECAY = np.exp(-DT / CELLS / TAU)
TIME = np.arange((SAMPLES - 1) * CELLS + 1) * (DT / CELLS)


def pitch_rate(seed):
    """(samples,) a short period of 1 Hz that gusts drive, with the noise of a gyro [rad/s]."""
    rng = np.random.default_rng(seed)
    w, z = 2.0 * np.pi * DT, 0.4
    poles = [1.0, -2.0 * np.exp(-z * w) * np.cos(w), np.exp(-2.0 * z * w)]
    q = lfilter([1.0], poles, rng.standard_normal(SAMPLES))
    return 5.0 * DEG * q / q.std() + 0.3857 * DEG * rng.standard_normal(SAMPLES)


def stepped(seed, amplitude=2.0 * DEG):
    """A 3-2-1-1 at any time between two samples."""
    first = 1.0 + DT * np.random.default_rng(100 + seed).random()
    edges = first + 0.3 * np.array([0.0, 3.0, 5.0, 6.0, 7.0])
    return amplitude * np.array([0.0, 1.0, -1.0, 1.0, -1.0, 0.0])[np.searchsorted(edges, TIME, side="right")]


def multisine(seed, amplitude=2.0 * DEG):
    phases = 2.0 * np.pi * np.random.default_rng(200 + seed).random(9)
    lines = np.array([0.4, 0.8, 1.2, 1.6, 2.0, 2.6, 3.2, 4.0, 5.0])
    return amplitude * np.sin(2.0 * np.pi * lines * TIME[:, None] + phases).sum(axis=1) / 3.0


def flown(pilot, damper, q):
    """(fine points,) surface of a servo behind the pilot's command and the damper's, which steps once a sample."""
    late = round(damper.phase * CELLS)
    fed_back = np.concatenate([np.zeros(late), np.repeat(damper.gain_s * (q - q[0]), CELLS)])[: TIME.size]
    command = pilot + fed_back
    return lfilter([0.0, 1.0 - DECAY], [1.0, -DECAY], command, zi=[DECAY * command[0]])[0]


def means(surface):
    """(samples - 1,) mean over each cell, by the trapezoidal rule."""
    middles = 0.5 * (surface[1:] + surface[:-1])
    return middles.reshape(SAMPLES - 1, -1).mean(axis=1)


@pytest.mark.parametrize("phase", [0.0, 0.25, 0.75])
def test_the_share_of_a_damper_is_that_of_its_servo(phase):
    q, damper = pitch_rate(1), Damper(0.5, phase)
    exact = flown(np.zeros(TIME.size), damper, q)
    np.testing.assert_allclose(damper_surface(damper, q, DT, TAU, CELLS), exact, rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(damper_surface(damper, q, DT, TAU), exact[::CELLS], rtol=0.0, atol=1e-14)


@pytest.mark.parametrize("pilot", [stepped, multisine])
@pytest.mark.parametrize("phase", [0.0, 0.25, 0.5, 0.75])
def test_the_samples_show_gain_and_phase(pilot, phase):
    """The gain within 10 %, the phase within 0.1: the noise of the surface is 0.01 deg."""
    for seed in range(4):
        q, damper = pitch_rate(seed), Damper(0.5, phase)
        noise = NOISE * np.random.default_rng(300 + seed).standard_normal(SAMPLES)
        seen = find_damper(flown(pilot(seed), damper, q)[::CELLS] + noise, q, DT, TAU, NOISE)
        assert seen is not None
        assert seen.gain_s == pytest.approx(damper.gain_s, rel=0.1)
        assert seen.phase == pytest.approx(phase, abs=0.1)


@pytest.mark.parametrize("pilot", [stepped, multisine])
def test_no_damper_in_open_loop(pilot):
    for seed in range(10):
        noise = NOISE * np.random.default_rng(400 + seed).standard_normal(SAMPLES)
        surface = flown(pilot(seed), Damper(0.0, 0.0), pitch_rate(seed))[::CELLS] + noise
        assert find_damper(surface, pitch_rate(seed), DT, TAU, NOISE) is None


@pytest.mark.grid
@pytest.mark.parametrize("pilot", [stepped, multisine])
@pytest.mark.parametrize("noise", [0.0, NOISE])
def test_an_ideal_gyro_in_open_loop_shows_no_damper(pilot, noise):
    """The pitch rate then responds smoothly to the surface, and a combination of its samples explains the surface."""
    a, b = np.array([[-1.2, 0.98], [-25.0, -1.5]]), np.array([[-0.1], [-30.0]])
    for seed in range(6):
        surface = flown(pilot(seed), Damper(0.0, 0.0), pitch_rate(seed))
        ad, bd, *_ = cont2discrete((a, b, np.eye(2), np.zeros((2, 1))), DT / CELLS)
        q = dlsim((ad, bd, np.array([[0.0, 1.0]]), np.zeros((1, 1)), DT / CELLS), surface)[1][::CELLS, 0]
        samples = surface[::CELLS] + noise * np.random.default_rng(700 + seed).standard_normal(SAMPLES)
        assert find_damper(samples, q, DT, TAU, noise) is None


def test_no_damper_where_nothing_moves():
    assert find_damper(np.zeros(50), pitch_rate(1)[:50], DT, TAU, NOISE) is None
    assert find_damper(pitch_rate(1)[:50], np.zeros(50), DT, TAU, NOISE) is None
    assert find_damper(pitch_rate(1)[:50], np.append(np.zeros(49), 1.0), DT, TAU, NOISE) is None
    assert find_damper(np.arange(5.0), np.arange(5.0), DT, TAU, NOISE) is None


def surface_of(samples, q):
    """The elevator of `read` for one record, on its fine grid."""
    channels = {
        name: np.zeros(SAMPLES)
        for name in ("alpha_rad", "az_m_s2", "theta_rad", "altitude_m", "airspeed_m_s")
    }
    channels |= {"elevator_rad": samples, "q_rad_s": q, "airspeed_m_s": np.full(SAMPLES, 38.0)}
    log = FlightLog({}, ("a",), np.array([0, SAMPLES]), np.arange(SAMPLES) * DT, channels)
    return read(log, LONGITUDINAL, [MeasuredControl(NOISE, TAU)])[0]


def noisy(exact, seed):
    return exact[::CELLS] + NOISE * np.random.default_rng(seed).standard_normal(SAMPLES)


@pytest.mark.parametrize("pilot", [stepped, multisine])
def test_the_path_between_samples_is_as_good_as_the_samples(pilot):
    """The mean over a cell is off by less than the noise of a sample."""
    errors = []
    for seed in range(6):
        q = pitch_rate(seed)
        exact = flown(pilot(seed), Damper(0.5, 0.75), q)
        signals = surface_of(noisy(exact, 500 + seed), q)
        assert signals.control_std_rad == 0.0
        errors.append(((means(signals.elevator_rad) - means(exact)) ** 2).mean())
    assert np.sqrt(np.mean(errors)) < NOISE


def test_the_pitch_rate_makes_the_path_better():
    """Without it the error of the mean over a cell is at least 1.5 times as large."""
    errors = []
    for seed in range(6):
        q = pitch_rate(seed)
        exact = flown(stepped(seed), Damper(0.5, 0.75), q)
        samples = noisy(exact, 500 + seed)
        made = (surface_of(samples, q).elevator_rad, read_between(samples, DT, CELLS, NOISE, TAU).surface_rad)
        errors.append([((means(path) - means(exact)) ** 2).mean() for path in made])
    seen, blind = np.sqrt(np.mean(errors, axis=0))
    assert blind > 1.5 * seen


@pytest.mark.parametrize("width_rad", [0.002, 0.0045])
def test_a_play_behind_a_damper_keeps_its_width(width_rad):
    """On average within 2 %."""
    widths = []
    for seed in range(8):
        q = pitch_rate(seed)
        exact = flown(stepped(seed), Damper(0.5, 0.75), q)
        right = means(through([SurfaceTerm("backlash", width_rad)], exact, DT / CELLS))
        signals = surface_of(noisy(exact, 600 + seed), q)
        widths.append(_width(signals.elevator_rad, right, width_rad))
    assert np.mean(widths) == pytest.approx(width_rad, rel=0.02)


def _width(path, right, width):
    """Width of the play behind ``path`` that is nearest to ``right``."""
    step = DT * (SAMPLES - 1) / (path.size - 1)

    def away(trial):
        play = through([SurfaceTerm("backlash", trial)], path, step)
        return float(((means(play) - right) ** 2).sum())

    return float(minimize_scalar(away, bounds=(0.3 * width, 1.5 * width), method="bounded").x)
