"""Records of both motions in the pitch plane: roll, yaw, sideslip and bank are known inputs of it."""

import numpy as np
import pytest

from airtruth import aircraft, fly, trace
from airtruth.checks.airspeed import low_passed
from airtruth.logs.flight_log import FlightLog
from airtruth.physics.motion import LATERAL
from airtruth.tracing import TraceOptions
from airtruth.tracing.model.reading import read
from airtruth.tracing.model.records import fine
from airtruth.units import G0

GTM = aircraft.load("gtm")
DT = 0.02
T = np.arange(400) * DT


def log(roll=1.0):
    """A pitch rate of 2 Hz beside a roll of 1 Hz, a yaw of 0.7 Hz and a bank of 20 deg."""
    channels = {
        "airspeed_m_s": np.full_like(T, 40.0),
        "alpha_rad": 0.07 + 0.01 * np.sin(3.0 * T),
        "theta_rad": 0.07 + 0.02 * np.sin(2.0 * T),
        "q_rad_s": 0.05 * np.sin(12.6 * T),
        "az_m_s2": np.full_like(T, -G0),
        "elevator_rad": 0.02 * np.sign(np.sin(4.0 * T)),
        "density_kg_m3": np.full_like(T, 1.0),
        "beta_rad": roll * 0.05 * np.sin(2.0 * T + 0.5),
        "p_rad_s": roll * np.sin(6.3 * T),
        "r_rad_s": roll * 0.4 * np.sin(4.4 * T),
        "phi_rad": roll * 0.35 * np.sin(1.5 * T),
    }
    return FlightLog(
        metadata={}, run_ids=("a",), offsets=np.array([0, T.size]), t_s=T.copy(), channels=channels
    )


def test_the_rates_that_the_lateral_motion_causes():
    """Euler's equation of pitch and the equation of alpha (Stevens and Lewis, table 2.5-1), evaluated by hand."""
    flown, constants = log(), GTM.constants
    (made,) = read(flown, constants=constants)
    c = flown.channels
    p, r, alpha = c["p_rad_s"], c["r_rad_s"], c["alpha_rad"]
    turn = -(p * np.cos(alpha) + r * np.sin(alpha)) * np.tan(c["beta_rad"])
    turn -= G0 / 40.0 * np.cos(alpha) * np.cos(c["theta_rad"]) * (1.0 - np.cos(c["phi_rad"]))
    moment = (constants.inertia_zz_kg_m2 - constants.inertia_xx_kg_m2) * p * r
    moment -= constants.inertia_xz_kg_m2 * (p**2 - r**2)
    expected = [fine(low_passed(x, DT), made.sub) for x in (turn, moment / constants.inertia_yy_kg_m2)]
    assert made.coupling[:2] == pytest.approx(np.stack(expected), rel=1e-9, abs=1e-12)
    signals = [c.get(one.channel, np.zeros_like(T)) for one in LATERAL.signals]
    expected = [fine(low_passed(x, DT), made.sub) for x in signals]
    assert made.coupling[2:] == pytest.approx(np.stack(expected), rel=1e-9, abs=1e-12)


def test_level_wings_and_an_aircraft_without_inertias_have_none():
    assert read(log(roll=1e-3), constants=GTM.constants)[0].coupling.size == 0
    assert read(log())[0].coupling.size == 0


@pytest.mark.slow
def test_the_pitch_plane_of_records_of_both_motions_lacks_nothing(tmp_path):
    """Aileron and rudder beside the elevator: without the coupling the answer was unexplained, p = 7e-84."""
    fly("data/campaigns/combined.toml", out=tmp_path / "both", runs=6)
    options = TraceOptions(motion="longitudinal", increments=False)
    answer = trace(tmp_path / "both", "gtm", options, out=tmp_path / "traced").answer
    assert answer.verdict == "none"
    assert answer.replay.declared is None  # a flight with level wings
    assert not any("disagree" in note for note in answer.notes)
