"""Intervals hold their word on simulated flights with known instrument errors, gusts included."""

import numpy as np
import pytest

from airtruth.fly import campaign, plan
from airtruth.identify.kinematics import check_kinematics
from airtruth.identify.kinematics_fit import fit, instruments
from airtruth.identify.kinematics_model import Record, predicted
from airtruth.logs.store import iter_logs

RUNS = 40
CAMPAIGN = """
schema = 1
name = "coverage"
title = "known instrument errors"
aircraft = "gtm"
runs = {runs}
seed = 11
duration_s = 8.0

[condition]
eas_kt = 75.0
altitude_ft = 7000.0

[[manoeuvre]]
kind = "3211"
amplitude_deg = 2.0
start_s = 1.0
step_s = 0.4

[gust]
figures = "gtm"
level = "light"
factor = {gust}

[sensors.channel.alpha_rad]
x = {{ value = {arm}, unit = "m" }}
scale = {{ value = 1.05 }}
delay = {{ value = {delay_ms}, unit = "ms" }}
"""
# aircraft/gtm/aircraft.toml
THETA_DELAY_S, GYRO_BIAS_RAD_S, AZ_BIAS_M_S2 = 0.040, 0.1547 * np.pi / 180.0, 0.0009 * 9.80665


def flown(folder, **settings):
    file = folder / "coverage.toml"
    file.write_text(CAMPAIGN.format(**{"runs": RUNS, "gust": 1.0, "arm": 0.0, "delay_ms": 0.0, **settings}))
    campaign.fly(plan.make(file, None, None), folder / "out", 1, lambda *_: None)
    return list(iter_logs(folder / "out"))


def records(logs):
    names = ("airspeed_m_s", "alpha_rad", "q_rad_s", "az_m_s2", "elevator_rad", "ax_m_s2", "theta_rad")
    return [
        Record(run_id, 0.02, *(log.channels[n][log.rows(run)] for n in names))
        for log in logs
        for run, run_id in enumerate(log.run_ids)
    ]


def covered(equation, parts, errors):
    fits = [fit(equation, [r], tuple(errors)) for r in parts]
    truth = np.array(list(errors.values()))
    return np.mean([np.abs(f.value - truth) <= f.quantile * f.std for f in fits], axis=0), fits


# 40 intervals of 95 %: fewer than 33 hits have a probability of 0.0007 (binomial)
LEAST = 33 / RUNS


@pytest.mark.parametrize(
    ("settings", "errors"),
    [
        ({"arm": 0.3}, {"alpha_scale": 1.05, "vane_arm": 0.3}),
        ({"delay_ms": 20.0, "gust": 0.3}, {"alpha_scale": 1.05, "alpha_delay": 0.020}),
    ],
)
def test_alpha(settings, errors, tmp_path):
    hits, fits = covered("alpha", records(flown(tmp_path, **settings)), errors)
    assert (hits >= LEAST).all(), hits
    # nor are they wide for nothing: the standard errors are the scatter
    scatter = np.std([f.value for f in fits], axis=0)
    stated = np.median([f.std for f in fits], axis=0)
    assert (stated < 1.4 * scatter).all()
    assert (stated > 0.7 * scatter).all()
    # the unexplained motion is chi-square where nothing is unexplained: 5 % beyond the 95 % point
    assert np.mean([f.p_value < 0.05 for f in fits]) < 0.2


def test_least_squares_would_not_hold(tmp_path):
    """What the instruments are for: with the derivatives in their place, gusts bend the arm."""
    truth = {"alpha_scale": 1.05, "vane_arm": 0.3}
    good, bad = [], []
    for r in records(flown(tmp_path, arm=0.3, gust=3.0, runs=40)):
        good.append(fit("alpha", [r], tuple(truth)).value[1])
        rows = [
            predicted("alpha", r, {**truth, name: truth[name] + 0.01})[1] - predicted("alpha", r, truth)[1]
            for name in truth
        ]
        bad.append(fit("alpha", [r], tuple(truth), basis=[np.array(rows)]).value[1])
    error = (np.mean([good, bad], axis=1) - 0.3) / (np.std([good, bad], axis=1) / np.sqrt(40.0))
    assert abs(error[0]) < 3.0
    assert error[1] > 5.0


def test_theta_and_biases(tmp_path):
    parts = records(flown(tmp_path))
    hits, fits = covered("theta", parts, {"gyro_scale": 1.0, "theta_delay": THETA_DELAY_S})
    assert (hits >= LEAST).all(), hits
    slopes = np.array([-f.slope[0] for f in fits])
    half = np.array([f.quantile * f.inflation * f.slope_std[0] for f in fits])
    assert np.mean(np.abs(slopes - GYRO_BIAS_RAD_S) <= half) >= LEAST
    assert np.mean(slopes) == pytest.approx(GYRO_BIAS_RAD_S, abs=4.0 * slopes.std() / np.sqrt(RUNS))


def test_records_together_are_better_than_one(tmp_path):
    logs = flown(tmp_path, arm=0.3, runs=20)
    parts = records(logs)
    basis = [instruments(r) for r in parts]
    names = ("alpha_scale", "vane_arm")
    one, ten = (
        fit("alpha", parts[:1], names, basis=basis[:1]),
        fit("alpha", parts[:10], names, basis=basis[:10]),
    )
    assert (ten.std < 0.6 * one.std).all()
    assert np.abs(ten.value - [1.05, 0.3]) == pytest.approx(np.zeros(2), abs=3.0 * float(ten.std.max()))
    result = check_kinematics(logs[0], {"theta_delay": THETA_DELAY_S})
    found = {f.name: f for f in result.findings}
    assert found["az_bias"].lower < AZ_BIAS_M_S2 < found["az_bias"].upper
    # gusts of a short record leave causes of the same motion together, and the scale visible
    assert {c.name for c in result.causes if c.possible} >= {"vane_arm"}
