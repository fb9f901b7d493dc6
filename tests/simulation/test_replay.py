"""A flight flown again through its own surface is the same flight."""

import numpy as np
import pytest

from airtruth import aircraft
from airtruth.simulation.flight import Flight, Inputs
from airtruth.simulation.manoeuvres import Manoeuvre, sample
from airtruth.simulation.replay import each_flown_through, flown_through, replay
from airtruth.simulation.simulator import Condition
from airtruth.simulation.tracks import Track, substeps
from airtruth.simulation.trim import trim
from airtruth.units import DEG

DT_S, EVERY = 0.02, 4
CHANNELS = ("alpha_rad", "q_rad_s", "az_m_s2")


@pytest.fixture(scope="module")
def flown(gtm, paper_trim):
    """Truth at every step of the simulation: a doublet in a gust along the flight path."""
    t = np.arange(1001) * DT_S / EVERY
    command = sample(Manoeuvre("doublet", amplitude_rad=2.0 * DEG, start_s=1.0, step_s=0.5), t)
    gust = 0.5 * np.sin(2.0 * np.pi * 0.4 * t)
    return Flight(gtm, paper_trim, DT_S / EVERY).fly(Inputs(command, gust, np.zeros_like(t)))


def track(flown, **changes):
    outputs = {c: flown[c][::EVERY] for c in CHANNELS}
    entries = {
        "dt_s": DT_S,
        "substeps": EVERY,
        "outputs": outputs,
        "weight": {c: float(outputs[c].std()) for c in CHANNELS},
        "controls_rad": {"elevator": flown["elevator_rad"]},
        "airspeed_m_s": flown["airspeed_m_s"],
    }
    return Track(**(entries | changes))


def test_a_gearing_that_differs_up_and_down_is_inverted(paper_trim):
    """The command of each surface is that of the gearing: 28 deg up and 23 deg down per unit in the Cessna 172."""
    cessna = aircraft.load("c172x")
    at = trim(cessna, Condition(50.0, 1200.0))
    t = np.arange(601) * DT_S / EVERY
    surface = at.elevator_rad + np.interp(t, [0.5, 1.0, 1.5, 2.0], [0.0, 6.0 * DEG, -6.0 * DEG, 0.0])
    flown = flown_through(
        cessna, at, Track(DT_S, EVERY, {}, {}, {"elevator": surface}, np.full(t.size, at.airspeed_m_s))
    )
    assert np.ptp(surface) > 11.9 * DEG
    np.testing.assert_allclose(flown["elevator_rad"], surface, atol=0.05 * DEG)


def test_a_flight_through_its_own_surface_comes_back(gtm, paper_trim, flown):
    """Up to the airspeed, which the air of the replay follows one step late."""
    again = replay(gtm, paper_trim, track(flown))
    for channel in CHANNELS:
        measured = flown[channel][::EVERY]
        assert np.sqrt(np.mean((again[channel] - measured) ** 2)) < 3e-3 * measured.std(), channel


def test_a_record_that_departs_costs_the_others_nothing(gtm, paper_trim, flown):
    """A surface of 25 deg down leaves the range after a second; the other records have the bits of a flight alone."""
    sound = track(flown)
    steps = np.arange(sound.airspeed_m_s.size) > 5 * EVERY
    departs = track(flown, controls_rad={"elevator": paper_trim.elevator_rad + 25.0 * DEG * steps})
    first, lost, last = each_flown_through(gtm, [(paper_trim, t) for t in (sound, departs, sound)])
    assert lost is None
    alone = flown_through(gtm, paper_trim, sound)
    for channel in CHANNELS:
        assert np.array_equal(first[channel], alone[channel]), channel
        assert np.array_equal(last[channel], alone[channel]), channel


def test_biases_initial_state_and_surface_offset_are_free(gtm, paper_trim, flown):
    """A constant on each output and on the surface costs nothing of the agreement."""
    biases = {"alpha_rad": 0.01, "q_rad_s": -0.005, "az_m_s2": 0.2}
    outputs = {c: flown[c][::EVERY] + biases[c] for c in CHANNELS}
    surface = flown["elevator_rad"] + 0.004
    again = replay(gtm, paper_trim, track(flown, outputs=outputs, controls_rad={"elevator": surface}))
    for channel in CHANNELS:
        assert np.sqrt(np.mean((again[channel] - outputs[channel]) ** 2)) < 0.01 * outputs[channel].std(), (
            channel
        )


def test_a_late_surface_is_seen(gtm, paper_trim, flown):
    """60 ms late: the pitch rate of a 2 deg doublet is off by more than a tenth of itself."""
    late = np.concatenate([np.repeat(flown["elevator_rad"][:1], 12), flown["elevator_rad"][:-12]])
    again = replay(gtm, paper_trim, track(flown, controls_rad={"elevator": late}))
    measured = flown["q_rad_s"][::EVERY]
    assert np.sqrt(np.mean((again["q_rad_s"] - measured) ** 2)) > 0.1 * measured.std()


@pytest.mark.parametrize(
    ("dt_s", "steps"), [(0.02, 4), (0.01, 2), (0.005, 1), (0.04, 8), (1.0 / 60.0, 4), (0.001, 1)]
)
def test_substeps(dt_s, steps):
    """The fewest steps of at most 5 ms."""
    assert substeps(dt_s) == steps
