"""frequency: transforms and sums against plain algebra, noise-free answers, band, spread and coverage."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from monte_carlo import coverage, efficiency_percent

from airtruth.errors import ConfigurationError
from airtruth.identification import Options, Status, identify_batch, identify_joint
from airtruth.identification.regression.frequency import HIGHEST, SURE, band_of, spectra, transform
from airtruth.identification.regression.frequency_kernel import sums_of
from airtruth.physics.short_period import modal
from validation.linear_flight import DEG, GTM, THETA, doublet, fly, gtm_scale, with_channel

NAME = "frequency"
PLAIN = Options(covariance="none")
RUNS = 600
GUSTS = fly(runs=RUNS, gust=2.0, noise=1.0, seed=51)
AIR = fly(runs=RUNS, gust=2.0, noise=1.0, seed=52, acting=True, airspeed_std_m_s=0.0309)


def test_transform_is_the_trapezoidal_sum():
    x, dt = np.random.default_rng(1).normal(size=51), 0.02
    t = np.arange(51) * dt
    got = transform(x, dt)
    for k in (0, 1, 7):
        wave = x * np.exp(-2j * np.pi * k * t / t[-1])
        assert got[k] == pytest.approx(dt * (wave.sum() - 0.5 * (wave[0] + wave[-1])), abs=1e-12)


def test_transform_of_a_decaying_oscillation():
    """int_0^T exp(s t) exp(-j w t) dt = (exp(s T) - 1)/(s - j w), T a multiple of the wave's period."""
    dt, s = 0.02, -6.0 + 6.0j
    t = np.arange(501) * dt
    w = 2.0 * np.pi * np.arange(1, 6) / t[-1]
    # trapezoidal error of a corner at the start: dt^2/12 (s - j w), the first term of Euler and Maclaurin
    exact = (np.exp(s * t[-1]) - 1.0) / (s - 1j * w) - dt**2 / 12.0 * (s - 1j * w)
    signal = np.exp(s * t)
    got = transform(signal.real, dt)[1:6] + 1j * transform(signal.imag, dt)[1:6]
    np.testing.assert_allclose(got, exact, atol=1e-6)


def test_sums_are_those_of_weighted_least_squares():
    """Both equations by lstsq on stacked real and imaginary parts, at the corner that the sums imply: none,
    where the noise is made white by construction and the corner's likelihood is that of white noise."""
    rng = np.random.default_rng(2)
    count = 40
    omega = 2.0 * np.pi * 0.2 * np.arange(1, count + 1)
    x = rng.normal(size=(2, 1, 3, count)) + 1j * rng.normal(size=(2, 1, 3, count))
    factors = np.array([[-1.0, 20.0, -2.0, 0.003]])
    theta = THETA[None].copy()
    pole = 20.0 * 0.003 * 41.41
    shape = (1.0, 1j * omega + pole)
    design, sides = [], []
    for i, (factor, first) in enumerate(((-2.0, 0), (20.0, 3))):
        columns = factor * x[i, 0] * np.array([[1.0], [0.003], [1.0]])
        noise = 1e-3 * (rng.normal(size=count) + 1j * rng.normal(size=count)) * shape[i]
        sides.append(theta[0, first : first + 3] @ columns + 0.7 - 0.2j / omega + noise)
        design.append(columns)
    sums = np.empty((1, 2, 3, 4))
    transforms = [np.concatenate([x[i], sides[i][None, None]], axis=1) for i in range(2)]
    sums_of(transforms[0], transforms[1], factors, theta, np.array([[0, count]]), omega, sums)
    for i in range(2):
        got = np.linalg.solve(sums[0, i, :, :3], sums[0, i, :, 3])
        full = np.vstack([design[i], np.ones(count), 1j / omega]) / shape[i]
        side = sides[i] / shape[i]
        stacked, y = np.hstack([full.real, full.imag]).T, np.hstack([side.real, side.imag])
        solution, square = np.linalg.lstsq(stacked, y)[:2]
        std = np.sqrt(np.diag(np.linalg.inv(stacked.T @ stacked))[:3] * square[0] / (2 * count - 7))
        # the corner may be a little above none: within a small part of an error
        assert (np.abs(got - solution[:3]) < 0.3 * std).all()
        np.testing.assert_allclose(np.sqrt(np.diag(np.linalg.inv(sums[0, i, :, :3]))), std, rtol=0.1)


@settings(max_examples=10, deadline=None)
@given(st.lists(st.floats(0.7, 1.4), min_size=6, max_size=6))
def test_noise_free_records_give_the_derivatives(factors):
    theta = THETA * np.array(factors)
    got = identify_batch(fly(theta=theta), GTM, NAME, PLAIN)
    assert got.converged.all()
    np.testing.assert_allclose(got.theta[0], theta, rtol=2e-3)


@pytest.mark.parametrize("delay_s", [0.0, 0.005, 0.015])
def test_noise_free_bias_is_below_five_in_ten_thousand(delay_s):
    theta = identify_batch(fly(delay_s=delay_s), GTM, NAME, PLAIN).theta[0]
    assert np.abs(theta / THETA - 1.0).max() < 5e-4


def test_a_record_that_starts_and_ends_in_motion():
    """Cut from 1.7 s to 3.2 s of the manoeuvre, and from 1.7 s to 7 s: the ends take nothing of the answer."""
    for duration_s, tolerance in ((7.0, 0.01), (3.5, 0.03)):
        theta = identify_batch(fly(first_s=1.7, duration_s=duration_s), GTM, NAME, PLAIN).theta[0]
        assert np.abs(theta / THETA - 1.0).max() < tolerance


def test_a_linear_drift_of_a_sensor_changes_nothing_in_its_own_equation():
    """az drifts by 0.5 m/s2 over the record: the free trend takes it."""
    one = fly(runs=2, noise=1.0, seed=53)
    drifting = with_channel(one, "az_m_s2", one.channels["az_m_s2"] + 0.1 * one.t_s)
    a, b = (identify_batch(x, GTM, NAME, PLAIN).theta for x in (one, drifting))
    np.testing.assert_allclose(b, a, rtol=1e-4)


def band_hz(batch, options=PLAIN):
    data = spectra(batch, GTM, replace(options, pressure="constant"))
    band = band_of(data, np.tile(THETA, (len(batch.run_ids), 1)), options)
    return data.omega[band[:, 0]] / (2.0 * np.pi), data.omega[band[:, 1] - 1] / (2.0 * np.pi)


def test_the_band_follows_the_signal():
    """wn is 1.02 Hz: to 2.5 times that where noise drowns the rest, further where it does not."""
    wn_hz = modal(THETA, gtm_scale())[0] / (2.0 * np.pi)
    step_hz = 50.0 / 249.0
    low, high = band_hz(fly(runs=20, noise=1.0, amplitude_rad=0.2 * DEG, seed=54))
    assert low == pytest.approx(np.full(20, step_hz))
    assert np.median(high) == pytest.approx(SURE * wn_hz, abs=1.5 * step_hz)
    low, high = band_hz(fly(runs=20, noise=0.05, amplitude_rad=4.0 * DEG, seed=54))
    assert (high > 5.0).all()
    assert (high <= HIGHEST * wn_hz).all()
    # a longer record has the same band in finer steps
    low, high = band_hz(fly(runs=2, noise=1.0, duration_s=30.0, seed=54))
    assert (low > 0.1).all()
    assert (high > SURE * wn_hz - 0.1).all()


@pytest.mark.slow
def test_a_band_may_be_stated():
    options = replace(PLAIN, band_hz=(0.6, 2.4))
    low, high = band_hz(GUSTS, options)
    assert low == pytest.approx(np.full(RUNS, 3 * 50.0 / 249.0))
    assert high == pytest.approx(np.full(RUNS, 11 * 50.0 / 249.0))
    narrow = identify_batch(GUSTS, GTM, NAME, options).theta
    assert (narrow.std(axis=0) > identify_batch(GUSTS, GTM, NAME, PLAIN).theta.std(axis=0)).all()
    with pytest.raises(ConfigurationError, match=r"band_hz = \(1.0, 1.5\): a record of 4.98 s .* has 3 freq"):
        identify_batch(GUSTS, GTM, NAME, replace(PLAIN, band_hz=(1.0, 1.5)))
    with pytest.raises(ConfigurationError, match="a lower and a higher frequency"):
        Options(band_hz=(2.0, 1.0))


@pytest.mark.grid
@pytest.mark.parametrize(("name", "batch"), [("constant", GUSTS), ("measured", AIR)])
def test_spread_and_coverage(name, batch):
    """3000 runs gave 52 to 92 % and 92.9 to 94.7 %; 600 runs have standard errors of 5 and 1 points."""
    estimates = identify_batch(batch, GTM, NAME, Options(pressure=name))
    assert estimates.converged.all()
    assert (efficiency_percent(estimates, name == "measured") > 40.0).all()
    cover = coverage(estimates, name == "measured")
    assert (cover > 0.90).all(), cover
    assert (cover < 0.985).all(), cover


def test_joint_estimate_is_the_truth_within_its_error():
    joint = identify_joint([AIR, fly(runs=5, rate_hz=100, gust=2.0, noise=1.0, seed=55)], GTM, NAME)
    assert joint.status[0] == Status.CONVERGED
    std = np.sqrt(np.diag(joint.covariance[0]))
    # discretisation and the gust between samples leave a bias of a tenth of one record's error
    assert (np.abs(joint.theta[0] - THETA) < 4.0 * std + 2e-3 * np.abs(THETA)).all()
    single = identify_batch(AIR, GTM, NAME)
    mean = np.sqrt(np.einsum("rii->ri", single.covariance).mean(axis=0) / RUNS)
    assert std == pytest.approx(mean, rel=0.25)


def test_joint_of_one_run_is_that_run():
    one = fly(runs=1, gust=2.0, noise=1.0, seed=56)
    single, joint = identify_batch(one, GTM, NAME, PLAIN), identify_joint([one], GTM, NAME, PLAIN)
    np.testing.assert_allclose(joint.theta, single.theta, rtol=1e-12)


def test_longer_records_are_known_better():
    """A second doublet in a record of 10 s: about half the variance of one."""
    twice = fly(runs=200, duration_s=10.0, noise=1.0, seed=57, shape=lambda t: doublet(t) + doublet(t, 6.0))
    once = fly(runs=200, noise=1.0, seed=58)
    ratio = [identify_batch(b, GTM, NAME, PLAIN).theta.var(axis=0) for b in (twice, once)]
    assert (ratio[0] < 0.75 * ratio[1]).all()
