"""Airspeed that changes within a record, and records of two flight conditions: what the tracer reads and what it finds."""

from dataclasses import replace

import numpy as np
import pytest
import trace_flights

from airtruth.checks.airspeed import gust_cutoff_hz, low_passed, without_noise
from airtruth.logs.flight_log import FlightLog
from airtruth.logs.store import read_log
from airtruth.tracing import TraceOptions, trace
from airtruth.tracing.model.reading import read
from airtruth.units import G0
from validation.blind import draw, trials
from validation.blind.truths import Added

DT, SAMPLES = 0.02, 301
T = DT * np.arange(SAMPLES)
RATE = 0.8
"""Change of the airspeed [m/s2]."""
NAMES = ("elevator_delay", "actuator_lag", "vane_lag", "vane_arm", "inertia_error")
"""Candidates of the traces: the delay, its look-alike, and others."""


def log(airspeed, ax):
    """A level flight in which nothing but the airspeed changes; ``ax`` None leaves it out."""
    alpha = np.full(SAMPLES, 0.1)
    channels = {
        "airspeed_m_s": airspeed,
        "alpha_rad": alpha,
        "theta_rad": alpha,
        "q_rad_s": np.zeros(SAMPLES),
        "az_m_s2": np.full(SAMPLES, -G0 * np.cos(0.1)),
        "elevator_rad": 0.01 * np.sin(T),
        "density_kg_m3": np.ones(SAMPLES),
    }
    if ax is not None:  # along and across the path: specific force of a level flight with an acceleration
        channels["ax_m_s2"] = G0 * np.sin(alpha) + ax * np.cos(alpha)
        channels["az_m_s2"] = -G0 * np.cos(alpha) + ax * np.sin(alpha)
    return FlightLog({"sample_rate_hz": 50}, ("a",), np.array([0, SAMPLES]), T, channels)


def ground(airspeed, ax):
    """Speed without the wind at the samples."""
    signals = read(log(airspeed, ax))[0]
    return signals.ground_m_s[:: signals.sub]


@pytest.mark.parametrize("bias", [0.0, 0.2])
def test_an_aircraft_that_accelerates_has_its_airspeed_over_ground(bias):
    """A bias of the accelerometer is not taken for wind."""
    airspeed = 40.0 + RATE * T
    np.testing.assert_allclose(ground(airspeed, np.full(SAMPLES, RATE + bias)), airspeed, atol=1e-9)


def test_a_wind_that_grows_does_not_accelerate_the_aircraft():
    """The accelerometer feels nothing: of 0.8 m/s2 it may miss 0.3."""
    found = ground(40.0 + RATE * T, np.zeros(SAMPLES))
    assert np.ptp(found) == pytest.approx(0.3 * T[-1])
    assert found.mean() == pytest.approx(40.0 + RATE * T.mean())


def test_without_an_accelerometer_along_the_body_the_airspeed_counts():
    airspeed = 40.0 + RATE * T
    np.testing.assert_allclose(ground(airspeed, None), airspeed, atol=1e-9)


def found_delay(logs, truth_s):
    """The trace of a late surface: named, alone, its interval holds the truth, and nothing is left."""
    answer = trace(logs, "gtm", TraceOptions(effects=NAMES)).to_dict()
    assert answer["verdict"] in ("traced", "one_of")
    (effect,) = answer["effects"]
    assert "elevator_delay" in {effect["name"], *effect["indistinguishable_from"]}
    (size,) = effect["parameters"].values()
    seconds = size["value"] if effect["name"] == "elevator_delay" else 1.0 / (2.0 * np.pi * size["value"])
    assert seconds == pytest.approx(truth_s, rel=0.2)
    assert answer["remaining"]["p_value"] > 0.01
    return answer


@pytest.mark.long
@pytest.mark.slow
def test_a_late_surface_in_records_of_two_flight_conditions(tmp_path):
    """75 and 90 kt: the declared derivatives, trims and gusts of each; one delay."""
    effect = [("elevator_delay", {"delay_s": 0.02})]
    flown = [
        trace_flights.fly(tmp_path / str(eas), effect, name=f"at-{eas}", eas=float(eas), runs=2, seed=eas)
        for eas in (75, 90)
    ]
    answer = found_delay([trace_flights.log_of(place) for place in flown], 0.02)
    assert answer["declared_model"]["consistent"] is False


@pytest.mark.long
@pytest.mark.parametrize("kind", ["swing", "shear"])
def test_a_late_surface_while_the_airspeed_changes_by_a_tenth(kind, tmp_path):
    """Dives, climbs and wind along the path, of the blind trials' own truth."""
    drawn = draw.draw(4, 0, "drift")
    signs = (1.0, -1.0, 1.0, -1.0, 1.0, -1.0)
    changed = [
        replace(m, **({"swing": 0.0, "shear": 0.0} | {kind: 0.1 * sign}))
        for m, sign in zip(drawn.manoeuvres, signs, strict=True)
    ]
    trial = replace(
        drawn,
        effects=(Added("elevator_delay", {"delay_s": 0.02}),),
        air="light",
        noise="white",
        duration_s=6.0,
        manoeuvres=tuple(changed),
    )
    (folder,) = trials.flown_apart([trial], [tmp_path / "log"])
    speed = read_log(folder / "log.parquet").channels["airspeed_m_s"]
    assert np.ptp(speed) / speed.mean() > 0.08
    found_delay(folder, 0.02)


# -- the low-pass of the airspeed


def test_an_airspeed_without_noise_is_taken_as_it_is():
    walk = np.cumsum(0.1 * np.random.default_rng(1).standard_normal(5000))
    assert gust_cutoff_hz(40.0 + walk + 0.5 * walk.size * DT, DT) > 25.0
    smooth = np.sin(2.0 * T)
    assert gust_cutoff_hz(smooth, DT) == np.inf
    np.testing.assert_array_equal(low_passed(smooth, DT, np.inf), smooth)


def test_gusts_and_noise_meet_at_the_cutoff():
    """A random walk of 0.1 m/s per sample in noise of 0.05 m/s: the ratio 2 of their spectra' roots is 16 Hz at 50 Hz."""
    rng = np.random.default_rng(2)
    x = np.cumsum(0.1 * rng.standard_normal(100_000)) + 0.05 * rng.standard_normal(100_000)
    assert gust_cutoff_hz(x, DT) == pytest.approx(2.0 / (2.0 * np.pi * DT), rel=0.05)


def test_noise_in_calm_air_is_low_passed_at_5_hz():
    noise = 0.05 * np.random.default_rng(3).standard_normal(500)
    drift = 40.0 + 0.5 * DT * np.arange(500)
    assert gust_cutoff_hz(drift + noise, DT) < 8.0
    assert gust_cutoff_hz(drift + 0.05 * np.tile([1.0, -1.0], 250), DT) == 5.0


def test_a_noisy_airspeed_follows_the_speed_over_ground():
    """Noise of 0.25 m/s at 22 m/s: 0.11 m/s remain after the low-pass at 5 Hz (a fifth of the variance), 0.02 m/s here."""
    rng = np.random.default_rng(4)
    ground = 22.0 + 1.5 * np.sin(0.7 * T)
    airspeed = ground + 0.25 * rng.standard_normal(T.size)
    assert np.std(low_passed(airspeed, DT) - ground) == pytest.approx(0.11, abs=0.03)
    assert np.sqrt(np.mean((without_noise(airspeed, ground, DT).speed_m_s - ground) ** 2)) < 0.03


def test_a_noisy_airspeed_keeps_its_gust():
    """Steps of 0.03 m/s in noise of 0.25 m/s: the smoother's error is (q r / 4)^(1/4), 0.061 m/s."""
    rng = np.random.default_rng(5)
    ground = np.full(5000, 22.0)
    gust = np.cumsum(0.03 * rng.standard_normal(5000))
    error = (
        without_noise(ground + gust + 0.25 * rng.standard_normal(5000), ground, DT).speed_m_s - ground - gust
    )
    assert np.sqrt(np.mean(error**2)) == pytest.approx(0.061, rel=0.15)


def test_a_quiet_airspeed_is_low_passed_alone():
    """The GTM's noise of 0.03 m/s is 0.0003 of its airspeed after the low-pass."""
    rng = np.random.default_rng(6)
    airspeed = 43.0 + np.sin(0.7 * T) + 0.031 * rng.standard_normal(T.size)
    cutoff = gust_cutoff_hz(airspeed, DT)
    np.testing.assert_array_equal(
        without_noise(airspeed, airspeed + 5.0, DT).speed_m_s, low_passed(airspeed, DT, cutoff)
    )
