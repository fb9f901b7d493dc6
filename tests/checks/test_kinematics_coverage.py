"""Intervals hold their word on simulated flights with known instrument errors, gusts included."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import t as student

from airtruth.checks.kinematics import check_kinematics
from airtruth.checks.kinematics_bias import ramps
from airtruth.checks.kinematics_fit import fit, limits_of, problem_of
from airtruth.checks.kinematics_model import LongitudinalSamples, thinned
from airtruth.logs.store import iter_logs
from airtruth.simulation.campaign import run as campaign

pytestmark = pytest.mark.slow

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
    campaign.fly(file, folder / "out")
    return list(iter_logs(folder / "out"))


def records(logs):
    names = ("airspeed_m_s", "alpha_rad", "q_rad_s", "az_m_s2", "elevator_rad", "ax_m_s2", "theta_rad")
    return [
        thinned(LongitudinalSamples(run_id, 0.02, *(log.channels[n][log.rows(run)] for n in names)))
        for log in logs
        for run, run_id in enumerate(log.run_ids)
    ]


def fitted(equation, parts, errors, least_squares=False):
    """Fit of known errors to records together, with the weight judged at the truth."""
    problem = problem_of(
        parts, (equation,), {"sensor_delay:theta_rad": THETA_DELAY_S}, limits_of(parts, 40.0), errors
    )
    if least_squares:
        rows = len(problem.weight.span)
        problem = replace(problem, weight=replace(problem.weight, span=np.eye(rows)))
    return problem, fit(problem, tuple(errors))


def covered(equation, parts, errors):
    problems, fits = zip(*(fitted(equation, [r], errors) for r in parts), strict=True)
    truth = np.array(list(errors.values()))
    quantile = [student.ppf(0.975, p.weight.degrees) for p in problems]
    inside = [np.abs(f.value - truth) <= q * f.std for f, q in zip(fits, quantile, strict=True)]
    return np.mean(inside, axis=0), problems, fits


# 40 intervals of 95 %: fewer than 33 hits have a probability of 0.0007 (binomial)
LEAST = 33 / RUNS


@pytest.mark.parametrize(
    ("settings", "errors"),
    [
        ({"arm": 0.3}, {"vane_scale": 1.05, "vane_arm": 0.3}),
        ({"delay_ms": 20.0, "gust": 0.3}, {"vane_scale": 1.05, "sensor_delay:alpha_rad": 0.020}),
    ],
)
def test_alpha(settings, errors, tmp_path):
    hits, problems, fits = covered("alpha", records(flown(tmp_path, **settings)), errors)
    assert (hits >= LEAST).all(), hits
    # nor are they wide for nothing: the standard errors are the scatter
    scatter = np.std([f.value for f in fits], axis=0)
    stated = np.median([f.std for f in fits], axis=0)
    assert (stated < 1.4 * scatter).all()
    assert (stated > 0.6 * scatter).all()
    # the unexplained motion has the mean of an F distribution where nothing is unexplained
    left = [f.statistic / (p.weight.span.shape[1] - 2) for p, f in zip(problems, fits, strict=True)]
    assert 0.6 < np.mean(left) < 1.6


def test_least_squares_would_not_hold(tmp_path):
    """What the instruments are for: with the derivatives in their place, gusts bend the arm."""
    truth = {"vane_scale": 1.05, "vane_arm": 0.3}
    good, bad = [], []
    for r in records(flown(tmp_path, arm=0.3, gust=3.0, runs=40)):
        good.append(fitted("alpha", [r], truth)[1].value[1])
        bad.append(fitted("alpha", [r], truth, least_squares=True)[1].value[1])
    error = (np.mean([good, bad], axis=1) - 0.3) / (np.std([good, bad], axis=1) / np.sqrt(40.0))
    assert abs(error[0]) < 3.0
    assert error[1] > 5.0


def test_theta_and_biases(tmp_path):
    parts = records(flown(tmp_path))
    errors = {"gyro_scale": 1.0, "sensor_delay:theta_rad": THETA_DELAY_S}
    hits, problems, fits = covered("theta", parts, errors)
    assert (hits >= LEAST).all(), hits
    slopes, stds = np.array([ramps(p, f, "theta") for p, f in zip(problems, fits, strict=True)])[..., 0].T
    assert np.mean(np.abs(-slopes - GYRO_BIAS_RAD_S) <= 1.96 * stds) >= LEAST
    assert np.mean(-slopes) == pytest.approx(GYRO_BIAS_RAD_S, abs=4.0 * slopes.std() / np.sqrt(RUNS))


@pytest.mark.long
def test_records_together_are_better_than_one(tmp_path):
    logs = flown(tmp_path, arm=0.3, runs=20)
    parts = records(logs)
    errors = {"vane_scale": 1.05, "vane_arm": 0.3}
    (_, one), (_, ten) = (fitted("alpha", parts[:n], errors) for n in (1, 10))
    assert (ten.std < 0.6 * one.std).all()
    assert (np.abs(ten.value - [1.05, 0.3]) < 3.0 * ten.std).all()
    result = check_kinematics(logs[:6], {"sensor_delay:theta_rad": THETA_DELAY_S}, 0.28)
    bias = result.finding("accelerometer_bias")
    assert bias.lower < AZ_BIAS_M_S2 < bias.upper
    # gusts leave causes of the same motion together, and exclude the record without an error
    assert {n for c in result.possible for n in c.name.split(" + ")} >= {"vane_arm"}
    assert "none" not in {c.name for c in result.possible}
    assert result.verdict == "one_of"
