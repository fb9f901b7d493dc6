"""A flight in six axes flown again through its own surfaces is the same flight."""

import numpy as np
import pytest

from airtruth.simulation.flight import Flight, Inputs, LateralInputs
from airtruth.simulation.replay import replay
from airtruth.simulation.simulator import Condition
from airtruth.simulation.tracks import Track
from airtruth.simulation.trim import trim
from airtruth.units import DEG, FT, KT

DT_S, EVERY = 0.02, 4
CHANNELS = ("beta_rad", "p_rad_s", "r_rad_s", "phi_rad", "ay_m_s2")


@pytest.fixture(scope="module")
def level(gtm):
    return trim(gtm, Condition(75.0 * KT, 7000.0 * FT, straight="wings-level"))


@pytest.fixture(scope="module")
def flown(gtm, level):
    """Truth at every step of the simulation: aileron 1-2-1, then rudder, in a gust along the flight path."""
    t = np.arange(8 * 200 + 1) * DT_S / EVERY
    aileron = (
        3.0
        * DEG
        * np.select([(t > 1.0) & (t < 1.4), (t >= 1.4) & (t < 2.2), (t >= 2.2) & (t < 2.6)], [1.0, -1.0, 1.0])
    )
    rudder = 3.0 * DEG * np.select([(t > 3.5) & (t < 4.2), (t >= 4.2) & (t < 4.7)], [1.0, -1.0])
    gust = 0.5 * np.sin(2.0 * np.pi * 0.4 * t)
    still = np.zeros_like(t)
    return Flight(gtm, level, DT_S / EVERY).fly(
        Inputs(still, gust, still, lateral=LateralInputs({"aileron": aileron, "rudder": rudder}))
    )


def track(flown, **changes):
    outputs = {c: flown[c][::EVERY] for c in CHANNELS}
    entries = {
        "dt_s": DT_S,
        "substeps": EVERY,
        "outputs": outputs,
        "weight": {c: float(outputs[c].std()) for c in CHANNELS},
        "controls_rad": {c: flown[f"{c}_rad"] for c in ("aileron", "rudder")},
        "airspeed_m_s": flown["airspeed_m_s"],
    }
    return Track(**(entries | changes))


def errors(again, measured):
    return {c: float(np.sqrt(np.mean((again[c] - measured[c]) ** 2)) / measured[c].std()) for c in CHANNELS}


def test_a_flight_through_its_own_surfaces_comes_back(gtm, level, flown):
    """Up to the airspeed, which the air of the replay follows one step late."""
    own = track(flown)
    assert max(errors(replay(gtm, level, own), own.outputs).values()) < 0.01


def test_biases_and_offsets_of_the_surfaces_are_free(gtm, level, flown):
    biases = dict(zip(CHANNELS, (0.01, -0.005, 0.004, 0.02, 0.2), strict=True))
    outputs = {c: flown[c][::EVERY] + biases[c] for c in CHANNELS}
    controls = {"aileron": flown["aileron_rad"] + 0.004, "rudder": flown["rudder_rad"] - 0.004}
    moved = track(flown, outputs=outputs, controls_rad=controls)
    assert max(errors(replay(gtm, level, moved), outputs).values()) < 0.03


def test_a_late_rudder_is_seen(gtm, level, flown):
    """80 ms late: the yaw rate is off by more than a tenth of itself."""
    late = np.concatenate([np.repeat(flown["rudder_rad"][:1], 16), flown["rudder_rad"][:-16]])
    own = track(flown, controls_rad={"aileron": flown["aileron_rad"], "rudder": late})
    assert errors(replay(gtm, level, own), own.outputs)["r_rad_s"] > 0.1
