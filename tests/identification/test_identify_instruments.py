"""iv-frequency and iv-kalman: sums and gains against plain algebra, noise-free answers, bias, spread and coverage."""

import numpy as np
import pytest

from airtruth.errors import ConfigurationError
from airtruth.identification import Options, Status, identify_batch, identify_joint, quantities
from airtruth.identification.condition import observe
from airtruth.identification.regression.auxiliary import linear_auxiliary
from airtruth.identification.regression.frequency_kernel import CORNERS, instrumented_sums, sums_of
from airtruth.identification.regression.kalman_instruments import (
    measurement_variance,
    predict,
    predictions,
    steady_gain,
)
from validation.linear_flight import GTM, THETA, fly

PLAIN = Options(covariance="none")
RUNS = 300
GUSTS = fly(runs=RUNS, gust=2.0, noise=1.0, seed=61)


def transforms(rng, count):
    """Both equations of one run with white noise, the left sides made by THETA; the factors and frequencies."""
    omega = 2.0 * np.pi * 0.2 * np.arange(1, count + 1)
    x = rng.normal(size=(2, 3, count)) + 1j * rng.normal(size=(2, 3, count))
    factors = np.array([[-1.0, 20.0, -2.0, 0.003]])
    pole = 20.0 * 0.003 * -THETA[4]
    sides = []
    for i, (factor, colour) in enumerate(((-2.0, 1.0), (20.0, 1j * omega + pole))):
        columns = factor * x[i] * np.array([[1.0], [0.003], [1.0]])
        noise = 1e-3 * (rng.normal(size=count) + 1j * rng.normal(size=count)) * colour
        sides.append(THETA[3 * i : 3 * i + 3] @ columns + 0.7 - 0.2j / omega + noise)
    both = [np.concatenate([x[i], sides[i][None]])[None] for i in range(2)]
    return both[0], both[1], factors, omega, pole


def test_sums_are_those_of_weighted_instrumental_variables():
    """Each equation by plain algebra on stacked real and imaginary parts, the nuisance columns their own instruments."""
    rng = np.random.default_rng(3)
    normal, moment, factors, omega, pole = transforms(rng, 40)
    z = rng.normal(size=(1, 2, 40)) + 1j * rng.normal(size=(1, 2, 40))
    z += np.stack([normal[:, 0], normal[:, 1]], axis=1)
    sums = np.empty((1, 2, 3, 7))
    instrumented_sums(z, normal, moment, factors, THETA[None], np.array([[0, 40]]), omega, sums)
    for i, (data, factor, slow) in enumerate(((normal[0], -2.0, 0.0), (moment[0], 20.0, pole))):
        size = factor * np.array([[1.0], [0.003], [1.0]])
        free = np.stack([np.ones(40), 1j / omega])
        expected = []
        for corner in CORNERS:
            weight = 1.0 / np.sqrt(1.0 + corner**2 / (omega**2 + slow**2))
            weight = weight / (1j * omega + slow) if i == 1 else weight
            x = np.concatenate([data[:3] * size, free]) * weight
            instruments = np.concatenate([np.concatenate([z[0], data[2:3]]) * size, free]) * weight
            x, instruments = (np.hstack([a.real, a.imag]) for a in (x, instruments))
            side = np.concatenate([(data[3] * weight).real, (data[3] * weight).imag])
            expected.append(np.linalg.solve(instruments @ x.T, instruments @ side)[:3])
        got = np.linalg.solve(sums[0, i, :, :3], sums[0, i, :, 3])
        errors = np.abs(np.array(expected) / got - 1.0).max(axis=1)
        assert errors.min() < 1e-9
        assert CORNERS[errors.argmin()] < 0.5 * omega[-1]  # the noise is white: no rise in most of the band
        np.testing.assert_allclose(got, THETA[3 * i : 3 * i + 3], rtol=2e-3)


def test_regressors_as_their_own_instruments_are_least_squares():
    """Z = X gives the sums of `frequency`, to the variance of the residual at the truth in place of the fit's."""
    normal, moment, factors, omega, _ = transforms(np.random.default_rng(4), 60)
    band = np.array([[0, 60]])
    plain, own = np.empty((1, 2, 3, 4)), np.empty((1, 2, 3, 7))
    sums_of(normal, moment, factors, THETA[None], band, omega, plain)
    instrumented_sums(normal[:, :2], normal, normal, factors, THETA[None], band, omega, own)
    np.testing.assert_allclose(own[0, 0, :, :3], own[0, 0, :, 4:], rtol=1e-12)
    left = np.linalg.solve(own[0, 0, :, :3], own[0, 0, :, 3])
    np.testing.assert_allclose(left, np.linalg.solve(plain[0, 0, :, :3], plain[0, 0, :, 3]), rtol=1e-3)


@pytest.mark.parametrize("factors", [(1.0,) * 6, (0.8, 1.3, 0.7, 1.4, 0.75, 1.2)])
def test_noise_free_records_give_the_derivatives(factors):
    theta = THETA * np.array(factors)
    record = fly(theta=theta)
    got = identify_batch(record, GTM, "iv-frequency", PLAIN).theta[0]
    np.testing.assert_allclose(got, theta, rtol=2e-3)
    # central differences at 50 Hz cost iv-kalman what they cost iv-lowpass
    kalman, lowpass = (identify_batch(record, GTM, n, PLAIN).theta[0] for n in ("iv-kalman", "iv-lowpass"))
    np.testing.assert_allclose(kalman, lowpass, rtol=2e-3)


def test_frequency_instruments_remove_the_bias_and_their_intervals_hold():
    """300 runs: the standard error of a coverage is 1.3 points, that of a mean a seventeenth of a spread."""
    estimates = identify_batch(GUSTS, GTM, "iv-frequency", Options(pressure="constant"))
    assert estimates.converged.mean() > 0.99
    theta = estimates.theta[estimates.converged]
    assert (np.abs(theta.mean(axis=0) - THETA) < 0.15 * theta.std(axis=0)).all()
    q = quantities(estimates)
    cover = ((q.lower[:, :6] < THETA) & (q.upper[:, :6] > THETA)).mean(axis=0)
    assert (cover > 0.90).all(), cover
    assert (cover < 0.985).all(), cover


def test_predicted_states_keep_most_of_the_bias_in_lift():
    """Gusts persist from sample to sample: CLq of least squares is 29 % off, of iv-kalman 28 %, of iv-frequency 3 %."""
    bias = {}
    for name in ("ls", "iv-kalman", "iv-frequency"):
        theta = identify_batch(GUSTS, GTM, name, PLAIN).theta
        bias[name] = float(np.nanmean(theta[:, 1]) / THETA[1] - 1.0)
    assert bias["iv-kalman"] > 0.15
    assert bias["ls"] > 0.15
    assert abs(bias["iv-frequency"]) < 0.08


@pytest.mark.slow
def test_joint_of_one_run_is_that_run_and_of_many_is_sharper():
    one = fly(runs=1, gust=2.0, noise=1.0, seed=62)
    for name in ("iv-frequency", "iv-kalman"):
        single, joint = identify_batch(one, GTM, name), identify_joint([one], GTM, name)
        np.testing.assert_allclose(joint.theta, single.theta, rtol=1e-9)
        np.testing.assert_allclose(joint.covariance, single.covariance, rtol=1e-6)
    joint = identify_joint(
        [GUSTS, fly(runs=5, rate_hz=100, gust=2.0, noise=1.0, seed=63)], GTM, "iv-frequency"
    )
    assert joint.status[0] == Status.CONVERGED
    std = np.sqrt(np.diag(joint.covariance[0]))
    assert (np.abs(joint.theta[0] - THETA) < 4.0 * std + 2e-3 * np.abs(THETA)).all()


def test_gain_is_that_of_the_scalar_filter():
    """x(k+1) = e x + w, y = x + v: P = e^2 P r/(P + r) + q has the positive root of a quadratic equation."""
    e, q, r = 0.9, 0.04, 0.25
    p = 0.5 * (q - r * (1.0 - e**2) + np.sqrt((q - r * (1.0 - e**2)) ** 2 + 4.0 * q * r))
    step = np.diag([q + r + e**2 * r] * 2)
    gain = steady_gain(np.diag([e, e]), step, np.array([r, r]))
    np.testing.assert_allclose(gain, np.diag([p / (p + r)] * 2), rtol=1e-9, atol=1e-12)


def test_predictions_need_earlier_samples_alone():
    """A measurement that changes at a sample changes no prediction up to that sample."""
    rng = np.random.default_rng(64)
    y, u = rng.normal(size=(1, 2, 200)), rng.normal(size=(1, 200))
    e, g, h = np.array([[[0.9, 0.02], [-0.1, 0.8]]]), np.array([[0.1, -0.3]]), np.array([[0.0, -0.2]])
    moved = y.copy()
    moved[0, 0, 150] += 1.0
    before, after = np.empty((1, 3, 200)), np.empty((1, 3, 200))
    gain = np.array([[[0.3, 0.1], [0.05, 0.4]]])
    predict(e, g, h, gain, y, u, before)
    predict(e, g, h, gain, moved, u, after)
    assert (after[0, :, :151] == before[0, :, :151]).all()
    # e K of the first column reaches the next sample
    np.testing.assert_allclose((after - before)[0, :2, 151], e[0] @ gain[0, :, 0], rtol=1e-9)


def test_predictions_without_noise_are_the_motion():
    """The record itself, to the error of an elevator that is linear between samples."""
    o = observe(fly(runs=1, rate_hz=200), GTM, PLAIN)
    u = o.signals[:, 3] - o.signals[:, 3, :1]
    got = predictions(o, u, THETA[None], np.arange(1))[0]
    np.testing.assert_allclose(got[:2], o.signals[0, :2] - o.signals[0, :2, :1], atol=2e-4)


def test_variance_of_white_noise_on_a_slow_signal():
    rng = np.random.default_rng(5)
    t = np.arange(20_000) * 0.02
    signal = np.sin(2.0 * np.pi * 0.3 * t) + 0.01 * rng.normal(size=t.size)
    assert measurement_variance(signal) == pytest.approx(1e-4, rel=0.05)


def test_an_auxiliary_model_would_not_be_used_and_is_refused():
    with pytest.raises(ConfigurationError, match="uses no auxiliary model"):
        identify_batch(fly(), GTM, "iv-kalman", Options(auxiliary=linear_auxiliary))
