"""The gate names every physical fault of a lateral log, and lets every faultless flight in six axes through."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from lateral_faults import LATERAL_FAULTS
from tiers import sampled

from airtruth.checks.fault import CODES
from airtruth.checks.gate import admit, inspect
from airtruth.checks.lateral_model import fitted, simulated
from airtruth.checks.rotation import (
    alpha_coupling,
    bank_coupling,
    heading_rate,
    pitch_coupling,
    side_gravity,
    sideslip_turn,
)
from airtruth.errors import LogError
from airtruth.logs.sources import log_files
from airtruth.logs.store import read_log
from airtruth.simulation.campaign import plan, run
from validation.lateral_truth import PLANES, Flight, fly, log_of, modes_of, multisine, record_pair, steps


def all_axes(flight: Flight) -> Flight:
    """The flight with a manoeuvre of the elevator behind those of aileron and rudder."""
    return replace(flight, elevator=steps(8.0, 0.5, 1, -1, 1), amplitudes=(*flight.amplitudes[:2], 0.02))


@pytest.fixture(scope="module")
def log():
    return log_of(*(all_axes(f) for f in [*record_pair(), *record_pair(seed=5)]))


def certain(faults):
    return [fault for fault in faults if fault.certain]


def test_the_independent_truth_has_the_modes_of_the_tables():
    """Dutch roll 5.985 rad/s of damping .120, roll -5.434 1/s, spiral -.0366 1/s: an integration of NASA's tables."""
    roots = modes_of(PLANES["gtm"])
    pair = roots[roots.imag > 0.1][0]
    assert abs(pair) == pytest.approx(5.985, rel=1e-3)
    assert -pair.real / abs(pair) == pytest.approx(0.120, abs=1e-3)
    assert sorted(roots[np.abs(roots.imag) < 0.1].real) == pytest.approx([-5.434, -0.0366], rel=5e-3)


def test_general_kinematics_against_an_exact_flight():
    """Differences of the angles of an integrated flight, at rates of 60 deg/s and banks of 20 deg."""
    c, dt = fly(all_axes(Flight()).quiet()), 1.0 / 200.0
    p, q, r, phi, theta = (c[n] for n in ("p_rad_s", "q_rad_s", "r_rad_s", "phi_rad", "theta_rad"))
    a, b, v = c["alpha_rad"], c["beta_rad"], c["airspeed_m_s"]

    def close(angle, rate):
        np.testing.assert_allclose(np.gradient(angle, dt)[2:-2], rate[2:-2], atol=2e-3 * np.ptp(rate))

    close(phi, p + bank_coupling(q, r, phi, theta))
    close(theta, q + pitch_coupling(q, r, phi))
    close(c["psi_rad"], heading_rate(q, r, phi, theta))
    g = 9.80665
    heave = c["az_m_s2"] * np.cos(a) - c["ax_m_s2"] * np.sin(a)
    weight = g * (np.cos(a) * np.cos(theta) * np.cos(phi) + np.sin(a) * np.sin(theta))
    close(a, q + alpha_coupling(p, r, a, b) + (heave + weight) / (v * np.cos(b)))
    push = c["ay_m_s2"] + side_gravity(theta, phi) - np.gradient(v, dt) * np.sin(b)
    close(b, sideslip_turn(p, r, a) + push / (v * np.cos(b)))


def test_the_simulated_motion_is_that_of_the_linear_model():
    """A second-order system of known A and B, against scipy's simulation at the samples."""
    from scipy.signal import lsim

    a, b, dt = np.array([[-0.5, -6.0], [6.0, -0.8]]), np.array([[1.0], [-2.0]]), 0.02
    t = np.arange(500) * dt
    u = np.interp(t, [0.0, 1.0, 1.02, 2.0, 2.02], [0.0, 0.0, 1.0, 1.0, 0.0])
    _, _, x = lsim((a, b, np.eye(2), np.zeros((2, 1))), u, t)
    mine = simulated(a, b, u[None, None], dt)[0]
    np.testing.assert_allclose(mine, x.T, atol=1e-10)
    channels = {"p_rad_s": mine[None, 0], "r_rad_s": mine[None, 1], "aileron_rad": u[None]}
    a_found, b_found = fitted(channels, dt, ("p_rad_s", "r_rad_s"), ("aileron_rad",))
    np.testing.assert_allclose(a_found, a, atol=0.05)
    np.testing.assert_allclose(b_found, b, atol=0.05)


def test_a_flight_in_six_axes_passes(log):
    assert inspect(log) == ()


def test_a_manoeuvre_of_roll_and_yaw_alone_passes():
    """The elevator is still, theta hardly moves, and a noiseless elevator is no dead sensor."""
    for plane in ("gtm", "transport"):
        assert certain(inspect(log_of(*record_pair(plane=PLANES[plane])))) == []
    assert inspect(log_of(*(f.quiet() for f in record_pair()))) == ()


def test_without_lateral_motion_its_channels_are_left_alone(log):
    """Level flight with channels of the lateral motion at zero, as a simulation in the pitch plane writes them."""
    from airtruth.checks.columns import SIDE

    level = log_of(*(replace(all_axes(f), amplitudes=(0.0, 0.0, 0.02)) for f in record_pair()))
    zeros = dict.fromkeys((*SIDE, "aileron_rad", "rudder_rad"), np.zeros_like(level.t_s))
    assert inspect(replace(level, channels={**level.channels, **zeros})) == ()


@pytest.mark.slow
@pytest.mark.parametrize("name", sampled(LATERAL_FAULTS, 8))
def test_every_lateral_fault_is_named(name, log):
    made = LATERAL_FAULTS[name]
    fault = certain(inspect(made(log)))[0]
    assert fault.channel in made.channels
    assert fault.code in made.codes
    assert fault.code in CODES
    assert fault.channel in fault.sentence
    assert "\n" not in fault.sentence


@pytest.mark.slow
def test_a_lateral_fault_refuses_the_log(log):
    with pytest.raises(LogError, match=r"aileron_rad: opposite sign .left and right mixed up. in all 4 runs"):
        admit(LATERAL_FAULTS["aileron sign, left and right mixed up"](log))


def clean(plane: str, gust: float, number: int) -> list[Flight]:
    """Flights of one clean log: doublets or multisines, with and without elevator and noise, at four rates."""
    if number % 2:
        flights = [
            Flight(
                plane=PLANES[plane], gust=gust, seed=50 + number, aileron=multisine(2, 1.0, 10.5, number),
                rudder=multisine(3, 1.0, 10.5, number + 1),
            )
        ]  # fmt: skip
    else:
        flights = record_pair(gust=gust, seed=7 * number + int(10 * gust), plane=PLANES[plane])
    if number % 3 == 1:
        flights = [all_axes(f) for f in flights]
    if number % 3 == 2:
        flights = [f.quiet() for f in flights]
    return [replace(f, rate_hz=(50.0, 25.0, 20.0, 100.0)[number // 2 % 4]) for f in flights]


CLEAN = [(plane, gust, number) for plane in PLANES for gust in (0.0, 0.5, 1.0, 2.0) for number in range(10)]
"""200 logs."""


@pytest.mark.slow
@pytest.mark.parametrize(("plane", "gust", "number"), sampled(CLEAN, 20))
def test_every_clean_lateral_log_is_accepted(plane, gust, number):
    assert certain(inspect(log_of(*clean(plane, gust, number)))) == []


@pytest.mark.slow
@pytest.mark.parametrize("share", [-0.5, 0.15, 0.3, 0.5, 0.7])
@pytest.mark.parametrize("plane", PLANES)
def test_an_arm_of_the_accelerometer_is_no_fault_of_its_sign_or_unit(plane, share):
    """ay shows the yaw acceleration times the arm, which is a multiple of beta where the rudder rests."""
    arm_m = share * PLANES[plane].span
    flights = [
        replace(f, plane=PLANES[plane], gust=0.5, seed=i).reading("ay_m_s2", x=arm_m)
        for i, f in enumerate(record_pair())
    ]
    assert certain(inspect(log_of(*flights))) == []


COMBINED = """schema = 1
name = "combined"
title = "Elevator, then aileron and rudder"
aircraft = "gtm"
runs = 1
seed = 9
duration_s = 15.0
[condition]
eas_kt = 75.0
altitude_ft = 7000.0
straight = "wings-level"
[[manoeuvre]]
kind = "3211"
amplitude_deg = 1.5
start_s = 1.0
step_s = 0.3
[[manoeuvre.also]]
control = "aileron"
kind = "121"
amplitude_deg = 3.0
start_s = 6.0
step_s = 0.4
[[manoeuvre.also]]
control = "rudder"
kind = "3211"
amplitude_deg = 3.0
start_s = 9.0
step_s = 0.25
"""


@pytest.mark.slow
def test_pitching_by_sideslip_is_no_fault_of_the_elevator(tmp_path):
    """The GTM pitches with sideslip: over a record of both motions the elevator explains a fifth of q' (Cmde -.05)."""
    (tmp_path / "combined.toml").write_text(COMBINED, encoding="utf-8")
    planned = plan.make(tmp_path / "combined.toml")
    assert not run.fly(planned, tmp_path / "out").failures
    (file,) = log_files(tmp_path / "out")
    assert not inspect(read_log(file), planned.aircraft)


@pytest.mark.parametrize("surfaces", [("rudder",), ("aileron",), ("aileron", "rudder")])
def test_a_surface_whose_command_is_reversed_with_it_has_the_opposite_sign(log, surfaces):
    """A recorder with the other sense writes surface and command alike, so that one agrees with the other."""
    channels = dict(log.channels)
    for name in ("aileron", "rudder"):
        sign = -1.0 if name in surfaces else 1.0
        surface = channels[f"{name}_rad"]
        early = np.concatenate([surface[2:], surface[-2:]])  # 40 ms ahead
        channels |= {f"{name}_rad": sign * surface, f"{name}_command_rad": sign * early}
    found = {(f.channel, f.code) for f in certain(inspect(replace(log, channels=channels)))}
    assert found == {(f"{name}{kind}_rad", "sign") for name in surfaces for kind in ("", "_command")}
