"""Families of inputs: edges, lengths, signs, and the spectrum and peak of multisines."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from airtruth.design import waveforms
from airtruth.design.limits import Limits, extremes
from airtruth.errors import ConfigurationError
from airtruth.simulation.manoeuvres import Manoeuvre, end_s, sample
from airtruth.units import DEG, G0

DT = 0.005
T = np.arange(2401) * DT


def test_a_multistep_of_3_2_1_1_units_is_the_3211():
    same = Manoeuvre("3211", 1.0, start_s=waveforms.START_S, step_s=0.4)
    made = waveforms.multistep((3.0, 2.0, 1.0, 1.0), 0.4, 0.0, DT)
    np.testing.assert_allclose(sample(made, T), sample(same, T), atol=1e-12)
    assert end_s(made) == pytest.approx(end_s(same))


def test_a_ramp_has_the_area_of_its_edge_and_the_stated_rate():
    ramped = waveforms.multistep((1.0, 1.0), 0.5, 0.1, DT)
    # the first edge keeps its area; half of the middle ramp, a triangle of 0.05 s, is below what it was: 0.5 - 0.025
    assert np.trapezoid(np.maximum(sample(ramped, T), 0.0), T) == pytest.approx(0.475, abs=1e-9)
    assert np.abs(np.diff(sample(ramped, T))).max() / DT == pytest.approx(2.0 / 0.1, rel=1e-6)


@pytest.mark.parametrize(
    ("length", "shortest", "rise"), [(8.0, 0.1, 0.0), (4.0, 0.1, 1.0), (1.0, 0.2, 0.0), (2.0, 0.5, 0.3)]
)
def test_no_pattern_is_longer_than_the_input_may_be(length, shortest, rise):
    made = [m for _, m in waveforms.patterns(length, shortest, rise, DT, 6)]
    assert made
    assert all(sum(m.segments_s) <= length + len(m.segments_s) * DT for m in made)


def test_repetition_joins_segments_of_one_sign():
    assert waveforms.repeated("3-2-1-1", 2) == (3.0, 2.0, 1.0, 1.0, 3.0, 2.0, 1.0, 1.0)
    assert waveforms.repeated("1-2-1", 3) == (1.0, 2.0, 2.0, 2.0, 2.0, 2.0, 1.0)


def test_mirrored_inputs_have_the_other_sign():
    for made in (
        waveforms.multistep((1.0, 2.0, 1.0), 0.3, 0.0, DT),
        waveforms.multisine(np.zeros(5), 8.0, (0.125, 2.0)),
    ):
        np.testing.assert_allclose(
            sample(waveforms.mirrored(made), T), -sample(made, T), atol=5e-3
        )  # four decimals of the phases of some harmonics


@given(seed=st.integers(0, 10_000), spread=st.floats(0.0, 3.0))
def test_perturbed_multisteps_keep_length_and_shortest_segment(seed, spread):
    start = waveforms.multistep((3.0, 2.0, 1.0, 1.0), 0.5, 0.0, DT)
    made = waveforms.perturbed(start, spread, 8.0, 0.1, DT, np.random.default_rng(seed))
    assert min(made.segments_s) >= 0.1 - DT
    assert sum(made.segments_s) <= 8.0 + len(made.segments_s) * DT
    assert all(a == -b for a, b in zip(made.levels[:-1], made.levels[1:], strict=True))


def test_a_multisine_has_its_spectrum_and_a_low_peak():
    length, weights = 10.0, np.array([0.0, 2.0, 0.0])
    made = waveforms.multisine(weights, length, (0.1, 3.0))
    wave = sample(made, waveforms.START_S + np.arange(2000) * DT)
    assert abs(wave[0]) < 0.02
    assert np.abs(wave).max() == pytest.approx(1.0, abs=2e-3)
    assert (
        np.abs(wave).max() / (math.sqrt(2.0) * wave.std()) < 1.6
    )  # relative peak factor; random phases have 2
    amplitude = np.abs(np.fft.rfft(wave))[list(made.harmonics)]
    np.testing.assert_allclose(amplitude / amplitude.max(), made.weights, atol=2e-3)


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (Manoeuvre("multistep", segments_s=(1.0,), levels=()), "one level for each segment"),
        (Manoeuvre("multistep", segments_s=(0.001,), levels=(1.0,)), "shorter than the least"),
        (Manoeuvre("multistep", segments_s=(0.1,), levels=(1.0,), rise_s=0.2), "shorten rise_s"),
        (Manoeuvre("harmonics", harmonics=(1,), weights=(), phases_rad=(0.0,)), "one weight and one phase"),
        (Manoeuvre("harmonics", harmonics=(0,), weights=(1.0,), phases_rad=(0.0,)), "from 1 to"),
        (Manoeuvre("harmonics", harmonics=(2,), weights=(0.0,), phases_rad=(0.0,)), "all weights are zero"),
        (
            Manoeuvre("harmonics", harmonics=(2000,), weights=(1.0,), phases_rad=(0.0,)),
            "half the simulation rate",
        ),
    ],
)
def test_shapes_that_cannot_be_flown_are_refused(made, words):
    with pytest.raises(ConfigurationError, match=words):
        sample(made, T)


def test_extremes_are_those_of_the_flight():
    """A ramp of 1 deg in 0.1 s, alpha to -3 deg, load factor 1 + 0.5 sin."""
    t = np.arange(101) * 0.02
    flown = {
        "elevator_rad": 0.1 + DEG * np.clip(t / 0.1, 0.0, 1.0),
        "alpha_rad": -3.0 * DEG * np.sin(np.pi * t / 2.0),
        "az_m_s2": -G0 * (1.0 + 0.5 * np.sin(np.pi * t)),
        "airspeed_m_s": 40.0 - t,
    }
    reached = extremes(flown, 0.02)
    assert reached.elevator_rad == pytest.approx(DEG)
    assert reached.rate_rad_s == pytest.approx(10.0 * DEG)
    assert reached.alpha_rad == pytest.approx(3.0 * DEG)
    assert reached.load_factor == pytest.approx((0.5, 1.5))
    assert reached.airspeed == pytest.approx(0.05)
    assert reached.share(Limits(airspeed=0.02)) == pytest.approx(2.5)
    assert reached.share(Limits(amplitude_rad=2.0 * DEG, alpha_rad=4.0 * DEG)) == pytest.approx(0.75)
    assert reached.share(Limits(load_factor=(0.0, 1.25))) == pytest.approx(2.0)
    assert "deg/s, not limited, alpha" in reached.beside(Limits())
    assert "of 10 deg/s, alpha" in reached.beside(Limits(rate_rad_s=10.0 * DEG))


@pytest.mark.parametrize(
    "stated",
    [
        {"amplitude_rad": 0.0},
        {"amplitude_rad": math.inf},
        {"load_factor": (1.2, 2.0)},
        {"load_factor": (0.0, math.inf)},
        {"length_s": 0.1},
        {"alpha_rad": math.nan},
        {"alpha_rad": math.inf},
        {"airspeed": math.inf},
    ],
)
def test_limits_that_no_flight_keeps_are_refused(stated):
    with pytest.raises(ConfigurationError, match="plan: "):
        Limits(**stated)


def test_a_refused_limit_is_named_in_the_unit_of_its_option():
    with pytest.raises(
        ConfigurationError, match=r"deviation of the elevator \(amplitude_rad\) is -2 deg; state"
    ):
        Limits(amplitude_rad=-2.0 * DEG)
