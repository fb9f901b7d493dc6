"""Gusts and wind as the aircraft meets them."""

import numpy as np
import pandas as pd
import pytest
from fly_campaigns import channel, fly, read

from airtruth.simulation.flight import Flight, Inputs
from airtruth.simulation.linearise import linearise

DT = 1 / 200
ZERO = np.zeros(101)
STEP = np.where(np.arange(101) >= 50, 1.0, 0.0)
CALM = {
    "sensors": {"ideal": True},
    "manoeuvre": [{"kind": "doublet", "amplitude_deg": 0.0, "start_s": 0.5, "step_s": 0.25}],
}


@pytest.fixture(scope="module")
def flight(gtm, paper_trim):
    return Flight(gtm, paper_trim, DT)


def test_constant_downward_gust_lowers_alpha_at_once(flight, paper_trim):
    flown = flight.fly(Inputs(ZERO, ZERO, ZERO + 1.0))
    v, a = paper_trim.airspeed_m_s, paper_trim.alpha_rad
    # Exact triangle in earth axes, level flight: the air meets at -atan(w/V) from the flight path.
    assert flown["alpha_rad"][0] - a == pytest.approx(-np.arctan(1.0 / v), rel=1e-6)
    assert flown["airspeed_m_s"][0] == pytest.approx(np.hypot(v, 1.0), rel=1e-6)
    assert flown["theta_rad"][0] == pytest.approx(a, abs=1e-12)
    assert flown["az_m_s2"][0] > -9.7  # less lift


def test_gust_along_the_flight_direction_takes_airspeed(flight, paper_trim):
    flown = flight.fly(Inputs(ZERO, ZERO + 1.0, ZERO))
    assert flown["airspeed_m_s"][0] == pytest.approx(paper_trim.airspeed_m_s - 1.0, abs=1e-6)
    assert flown["alpha_rad"][0] == pytest.approx(paper_trim.alpha_rad, abs=1e-9)


@pytest.mark.parametrize(("u", "w", "name"), [(0.0, 1.0, "alpha_rad"), (1.0, 0.0, "airspeed_m_s")])
def test_a_gust_is_met_in_the_sample_that_it_is_stated_for(flight, paper_trim, u, w, name):
    change = flight.fly(Inputs(ZERO, u * STEP, w * STEP))[name] - getattr(paper_trim, name)
    expected = -np.arctan(1.0 / paper_trim.airspeed_m_s) if w else -1.0
    np.testing.assert_allclose(change[:50], 0.0, atol=1e-8)
    assert change[50] == pytest.approx(expected, rel=1e-3)


def test_gusts_superpose_on_the_flight_path_not_on_the_inertial_state(flight):
    """In the first instant the ground does not notice: theta, altitude and q are those of calm air."""
    calm, gusty = flight.fly(Inputs(ZERO, ZERO, ZERO)), flight.fly(Inputs(ZERO, ZERO + 3.0, ZERO - 2.0))
    for name in ("theta_rad", "altitude_m", "q_rad_s"):
        assert gusty[name][0] == pytest.approx(calm[name][0], abs=1e-9)


def test_air_that_turns_nose_up_acts_as_turning_nose_down(flight, gtm, paper_trim):
    """A rotary gust of -0.01 rad/s is a pitch rate of 0.01 rad/s in the air: q_dot through the declared Cmq."""
    linear = linearise(gtm, paper_trim)
    flown = flight.fly(Inputs(ZERO, ZERO, ZERO, rotation_rad_s={"q_rad_s": ZERO - 0.01}))
    v = paper_trim.airspeed_m_s
    force = 0.5 * paper_trim.density_kg_m3 * v**2 * gtm.wing_area_m2 * gtm.chord_m
    expected = force * linear.plus[4] * (0.01 * gtm.chord_m / (2.0 * v)) / gtm.inertia_yy_kg_m2
    assert flown["q_dot_rad_s2"][0] == pytest.approx(expected, rel=0.01)
    assert flown["alpha_rad"][0] == pytest.approx(paper_trim.alpha_rad, abs=1e-12)


@pytest.mark.long
@pytest.mark.slow
def test_gusts_of_a_campaign_start_stationary_or_from_rest(tmp_path):
    condition = {"eas_kt": 75.0, "altitude_ft": 7000.0}
    first = {}
    for start in ("stationary", "rest"):
        gust = {"level": "moderate", "start": start}
        out = fly(tmp_path / start, runs=60, duration_s=0.1, condition=condition, gust=gust, **short())
        first[start] = (
            channel(out, "alpha_rad")[:, 0],
            channel(out, "airspeed_m_s")[:, 0],
            pd.read_parquet(out / "plan.parquet"),
        )
    alpha, speed, plan = first["stationary"]
    v = np.median(first["rest"][1])
    for values, sigma in ((speed, plan["sigma_u_m_s"][0]), (alpha, plan["sigma_w_m_s"][0] / v)):
        assert abs(values.std(ddof=1) / sigma - 1) < 4 / np.sqrt(2 * 59)
    assert abs(np.corrcoef(speed, alpha)[0, 1]) < 4 / np.sqrt(60)  # u and w are independent (MIL-F-8785C)
    assert np.ptp(first["rest"][0]) == 0.0
    assert np.ptp(first["rest"][1]) == 0.0


def short():
    step = [{"kind": "doublet", "amplitude_deg": 0.0, "start_s": 0.02, "step_s": 0.02}]
    return CALM | {"manoeuvre": step}


@pytest.mark.long
@pytest.mark.slow
def test_level_and_factor_scale_the_gusts_of_the_same_draw(tmp_path):
    one = fly(tmp_path / "one", runs=2, gust={"level": "light", "factor": 0.01}, **CALM)
    two = fly(tmp_path / "two", runs=2, gust={"level": "light", "factor": 0.02}, **CALM)
    calm = fly(tmp_path / "calm", runs=2, gust=None, **CALM)
    a, b = (channel(x, "alpha_rad") - channel(calm, "alpha_rad") for x in (one, two))
    # float32 of alpha 0.1 resolves 7e-9 rad; small gusts act linearly.
    np.testing.assert_allclose(b, 2 * a, atol=0.03 * np.abs(a).max())


@pytest.mark.slow
def test_wind_that_keeps_the_airspeed_leaves_the_logs_as_they_are(tmp_path):
    calm = fly(tmp_path / "calm", runs=2)
    windy = fly(tmp_path / "windy", runs=2, wind={"along_track_m_s": {"choose": [8.0, -8.0]}})
    for a, b in zip(sorted((calm / "logs").iterdir()), sorted((windy / "logs").iterdir()), strict=True):
        assert a.read_bytes() == b.read_bytes()
    assert set(pd.read_parquet(windy / "truth.parquet")["wind_m_s"].abs()) == {8.0}


@pytest.mark.slow
def test_wind_that_keeps_the_ground_speed_takes_airspeed(tmp_path):
    calm = fly(tmp_path / "calm", runs=1, gust=None, **CALM)
    windy = fly(
        tmp_path / "windy", runs=1, gust=None, wind={"along_track_m_s": 3.0, "keeps": "ground_speed"}, **CALM
    )
    # 3 m/s tailwind: the same ground speed, 3 m/s less through the air.
    assert channel(windy, "airspeed_m_s")[0, 0] == pytest.approx(
        channel(calm, "airspeed_m_s")[0, 0] - 3.0, abs=1e-4
    )


@pytest.mark.slow
def test_calm_air_stays_in_trim(tmp_path):
    log = read(fly(tmp_path, runs=1, gust=None, duration_s=5.0, **CALM))
    assert np.ptp(log["alpha_rad"]) < 1e-7
    assert log["q_rad_s"].abs().max() < 1e-7
    assert np.ptp(log["airspeed_m_s"]) < 1e-4
