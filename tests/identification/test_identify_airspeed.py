"""The measured dynamic pressure in the regression: `pressure = "measured"`."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from airtruth.errors import ConfigurationError
from airtruth.identification import METHODS, Options, identify_batch, identify_joint
from airtruth.identification.condition import divide, ratios
from validation.linear_flight import AIRSPEED_M_S, DENSITY_KG_M3, G0, GTM, THETA, fly, gtm_scale, with_channel

MEASURED = Options(pressure="measured", covariance="none", tolerance=1e-9)
CONSTANT = replace(MEASURED, pressure="constant")
REGRESSIONS = [name for name, m in METHODS.items() if m.pose]
OWN = ["iv-refined", "frequency"]
RUNS = 500
GUSTS = fly(runs=RUNS, gust=2.0, noise=1.0, seed=91, acting=True, airspeed_std_m_s=0.0309)


def test_ratios_by_hand():
    v, p = ratios(
        np.array([[AIRSPEED_M_S * 1.1]]), np.array([[DENSITY_KG_M3 * 0.9]]), 0.5483, 26.195, gtm_scale((1,))
    )
    assert v[0, 0] == pytest.approx(1.1, rel=1e-12)
    assert p[0, 0] == pytest.approx(1.1**2 * 0.9, rel=1e-12)


def test_divided_equations_are_the_equations_at_the_measured_pressure():
    """Motion made up in closed form at 1 kHz: both left sides are -lift0 CL and moment0 Cm of the sample."""
    dt = 1e-3
    t = np.arange(2000) * dt
    v = 1.0 + 0.05 * np.sin(1.3 * t)
    p = v**2 * (1.0 + 0.01 * np.cos(0.7 * t))
    alpha, q = 0.03 * np.sin(3.0 * t), 0.1 * np.cos(2.0 * t)
    alpha_rate, q_rate = 0.09 * np.cos(3.0 * t), -0.2 * np.sin(2.0 * t)
    signals = np.stack([alpha, q, np.full_like(t, -1.0), np.zeros_like(t)])[None]
    across = np.cos(0.2 * np.sin(0.9 * t))
    left = divide(signals, v[None], p[None], np.array([AIRSPEED_M_S]), dt, across[None])[0]
    lift = np.gradient(left[0], dt) + left[2]
    moment = np.gradient(left[1], dt) + left[3]
    inner = slice(2, -2)
    # alpha is taken from its mean, which x' a of a constant a brings back
    constant = alpha.mean() * np.gradient(v / p, dt)
    expected = (v / p) * (alpha_rate - q - G0 * across / (AIRSPEED_M_S * v))
    np.testing.assert_allclose((lift + constant - constant)[inner], expected[inner], atol=2e-6)
    np.testing.assert_allclose(moment[inner], (q_rate / p)[inner], atol=2e-6)
    np.testing.assert_allclose(signals[0, 1], q / v, rtol=1e-14)
    np.testing.assert_allclose(signals[0, 2], -1.0 / p, rtol=1e-14)


@pytest.mark.grid
@pytest.mark.parametrize("name", [*REGRESSIONS, *OWN])
@pytest.mark.parametrize("trim", ["intercept", "mean"])
def test_a_constant_airspeed_gives_the_constant_form(name, trim):
    options = replace(CONSTANT, trim=trim, trim_window_s=0.98)
    batch = fly(runs=2, gust=1.0, noise=1.0, seed=92)
    a = identify_batch(batch, GTM, name, options).theta
    b = identify_batch(batch, GTM, name, replace(options, pressure="measured")).theta
    np.testing.assert_allclose(b, a, rtol=1e-6)


@pytest.mark.parametrize(
    ("name", "cl_percent", "cm_percent"),
    [("iv-f1", 0.2, 0.01), ("iv-refined", 0.001, 0.05), ("frequency", 0.001, 0.01)],
)
def test_a_climbing_airspeed_is_followed(name, cl_percent, cm_percent):
    """The airspeed grows by 8 % in a rising head wind, without noise. The generator turns the flight path at
    the inertial speed, the equation of alpha_dot at the airspeed: what is left of CL in iv-f1, which reads it.
    """
    batch = fly(acting=True, wind=lambda t: 0.08 * AIRSPEED_M_S * t / 5.0)
    got = identify_batch(batch, GTM, name, MEASURED).theta[0]
    error = 100.0 * np.abs(got / THETA - 1.0)
    assert error[:3].max() < cl_percent
    assert error[3:].max() < cm_percent
    off = 100.0 * np.abs(identify_batch(batch, GTM, name, CONSTANT).theta[0] / THETA - 1.0)
    assert off.max() > 2.0


@pytest.mark.grid
@pytest.mark.parametrize("name", ["ls", "iv-lowpass", "iv-f1", "iv-f2"])
def test_airspeed_narrows_the_spread_of_the_lift(name):
    """Standard deviations over 500 runs fall in CL by 1.9 to 3.5 (iv-f1: CLq from 17.9 to 6.5), none rises."""
    constant, measured = (
        identify_batch(GUSTS, GTM, name, Options(pressure=p, covariance="none")).theta.std(axis=0)
        for p in ("constant", "measured")
    )
    assert (measured[:3] < 0.6 * constant[:3]).all()
    assert (measured[3:] < constant[3:]).all()


@pytest.mark.grid
@pytest.mark.parametrize("name", REGRESSIONS)
def test_the_methods_of_the_paper_hold_the_pressure_constant(name):
    few = fly(runs=2, gust=2.0, noise=1.0, seed=93, acting=True, airspeed_std_m_s=0.0309)
    own, constant, measured = (
        identify_batch(few, GTM, name, Options(pressure=p)).theta for p in ("method", "constant", "measured")
    )
    assert (own == constant).all()
    assert (np.abs(measured / own - 1.0) > 1e-4).any()


@pytest.mark.parametrize("name", OWN)
def test_the_others_measure_it_unless_the_airspeed_is_given(name):
    few = fly(runs=2, gust=2.0, noise=1.0, seed=93, acting=True, airspeed_std_m_s=0.0309)
    own, measured = (
        identify_batch(few, GTM, name, Options(pressure=p)).theta for p in ("method", "measured")
    )
    assert (own == measured).all()
    given, constant = (
        identify_batch(few, GTM, name, Options(pressure=p, airspeed_m_s=AIRSPEED_M_S)).theta
        for p in ("method", "constant")
    )
    assert (given == constant).all()


def test_joint_estimates_take_it_too():
    joint = identify_joint([GUSTS], GTM, "iv-f1", replace(MEASURED, tolerance=1e-3))
    assert np.abs(joint.theta[0] / THETA - 1.0).max() < 0.03


def test_density_is_followed_as_well_as_airspeed():
    """A tenth more density in the log is a tenth less in every derivative."""
    few = fly(runs=2, noise=1.0, seed=94)
    denser = with_channel(few, "density_kg_m3", few.channels["density_kg_m3"] * 1.1)
    a, b = (identify_batch(x, GTM, "ls", MEASURED).theta for x in (few, denser))
    np.testing.assert_allclose(b[:, 3:], a[:, 3:] / 1.1, rtol=1e-9)


def test_a_given_airspeed_and_a_measured_one_exclude_each_other():
    with pytest.raises(ConfigurationError, match="airspeed_m_s = 40 replaces the measured"):
        Options(pressure="measured", airspeed_m_s=40.0)
    with pytest.raises(ConfigurationError, match=r"option pressure = 'measure'.*measured"):
        Options(pressure="measure")


@pytest.mark.long
@pytest.mark.slow
def test_the_efficiency_study_prints_its_table():
    command = [sys.executable, "-m", "studies.efficiency_study", "--runs", "20"]
    done = subprocess.run(
        [*command, "--experiment", "measured", "ls", "frequency"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert sum(line.startswith("  efficiency %") for line in lines) == 2
    refused = subprocess.run([*command, "iv-f3"], capture_output=True, text=True, check=False)
    assert refused.returncode == 2
    assert "no method iv-f3" in refused.stderr
