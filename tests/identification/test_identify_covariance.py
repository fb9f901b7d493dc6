"""Covariances against dense, independent computations of their definitions."""

from itertools import product

import numpy as np
import pytest
from scipy.fft import next_fast_len
from scipy.linalg import toeplitz
from tiers import sampled

from airtruth.identification import COVARIANCES, METHODS, Options, identify_batch, identify_joint
from airtruth.identification.condition import observe
from airtruth.identification.methods import method
from validation.linear_flight import GTM, fly

BATCH = fly(runs=3, gust=1.0, noise=1.0, seed=33)


def dense(batch, name, options):
    """Z, X (3 n, 6) free of the intercept, residuals (3 n,) and n, of each run, from plain algebra."""
    estimates = identify_batch(batch, GTM, name, options)
    observation = observe(batch, GTM, options)
    problem = method(name).pose(observation, options)
    rows = problem.rows(estimates.theta, np.arange(len(batch.run_ids)))
    for r in range(len(batch.run_ids)):
        w, f = rows[r], observation.factors[r]
        n = w.shape[1]
        away = np.eye(n) - np.outer(w[3], w[3]) / (w[3] @ w[3])
        if options.trim == "mean":
            away = np.eye(n)

        def block(first, w=w, f=f, away=away):
            columns = away @ (w[first : first + 3].T * [1.0, f[3], 1.0])
            zero = np.zeros_like(columns)
            lift, moment, normal = f[0] * columns, f[1] * columns, f[2] * columns
            return np.vstack([np.hstack([lift, zero]), np.hstack([zero, moment]), np.hstack([normal, zero])])

        z, x = block(0), block(4)
        e = np.concatenate([away @ w[7], away @ w[8], away @ w[9]]) - x @ estimates.theta[r]
        yield z, x, e, n, estimates.covariance[r]


def autocovariance(e, n):
    """(3 n, 3 n) matrix whose block (i, j) is Toeplitz with (1/n) sum_t e_i(t + k) e_j(t) at lag k."""
    blocks = []
    for i in range(3):
        row = []
        for j in range(3):
            full = np.correlate(e[i * n : (i + 1) * n], e[j * n : (j + 1) * n], "full") / n
            row.append(toeplitz(full[n - 1 :], full[n - 1 :: -1]))
        blocks.append(row)
    return np.block(blocks)


@pytest.mark.parametrize("name", ["ls", "iv-lowpass", "iv-reference", "iv-f1", "iv-f2"])
@pytest.mark.parametrize("trim", ["intercept", "mean"])
def test_coloured_is_morelli_and_kleins_double_sum(name, trim):
    options = Options(covariance="coloured", trim=trim, trim_window_s=0.9)
    cases = list(dense(BATCH, name, options))
    assert cases
    for z, x, e, n, covariance in cases:
        bread = np.linalg.inv(z.T @ x)
        expected = bread @ (z.T @ autocovariance(e, n) @ z) @ bread.T
        size = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
        np.testing.assert_allclose(covariance / size, expected / size, atol=1e-8)


@pytest.mark.parametrize("name", ["ls", "iv-f1"])
def test_white_and_printed_are_equation_10(name):
    for z, _, e, n, covariance in dense(BATCH, name, Options(covariance="white")):
        inverse = np.linalg.inv(e.reshape(3, n) @ e.reshape(3, n).T / n)
        expected = np.linalg.inv(z.T @ np.kron(inverse, np.eye(n)) @ z)
        size = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
        np.testing.assert_allclose(covariance / size, expected / size, atol=1e-8)
    white = identify_batch(BATCH, GTM, name, Options(covariance="white")).covariance
    paper = identify_batch(BATCH, GTM, name, Options(covariance="paper")).covariance
    np.testing.assert_allclose(paper / white, n, rtol=1e-9)


@pytest.mark.parametrize("name", ["ls", "iv-lowpass", "iv-f1", "iv-f2"])
def test_corrected_by_dense_algebra(name):
    """Each block: c has the mean diagonals of Q C Q' taken out of it by one ratio of spectra."""
    estimates = identify_batch(BATCH, GTM, name, Options(covariance="corrected"))
    observation = observe(BATCH, GTM, Options())
    rows = method(name).pose(observation, Options()).rows(estimates.theta, np.arange(3))
    for r in range(3):
        w, f, theta = rows[r], observation.factors[r], estimates.theta[r]
        n = w.shape[1]
        step = w[3] / np.linalg.norm(w[3])
        away = np.eye(n) - np.outer(step, step)
        d = np.array([1.0, f[3], 1.0])
        z, x, y = away @ w[:3].T, away @ w[4:7].T, away @ w[7:].T
        solver = np.linalg.solve(z.T @ x, z.T)
        q = away - x @ solver
        for block, used in ((0, [0, 2]), (1, [1])):
            own = theta[3 * block : 3 * block + 3]
            acting = sum(f[i] * (y[:, i] - f[i] * x @ (d * own)) for i in used)
            c = np.correlate(acting, acting, "full")[n - 1 :] / n
            expected = q @ toeplitz(c) @ q.T
            mean = np.array([np.trace(expected, k) for k in range(n)]) / n
            of_c, of_mean = spectrum(c), spectrum(mean)
            ratio = np.clip(of_c / np.maximum(of_mean, 1e-9 * of_c.max()), 1 / 3, 3)
            corrected = np.fft.irfft(of_c * ratio, padded(n))[:n]
            gain = d * sum(f[i] ** 2 for i in used)
            by_hand = solver @ toeplitz(corrected) @ solver.T / np.outer(gain, gain)
            got = estimates.covariance[r, 3 * block : 3 * block + 3, 3 * block : 3 * block + 3]
            size = np.sqrt(np.outer(np.diag(by_hand), np.diag(by_hand)))
            np.testing.assert_allclose(got / size, by_hand / size, atol=1e-8)


def padded(n):
    """The grid of frequencies is part of the definition: 2 n - 1 rounded up to a fast length."""
    return next_fast_len(2 * n - 1, real=True)


def spectrum(c):
    wide = np.zeros(padded(c.size))
    wide[: c.size] = c
    wide[-(c.size - 1) :] = c[:0:-1]
    return np.fft.rfft(wide).real


@pytest.mark.grid
@pytest.mark.parametrize(("name", "covariance"), sampled(product(METHODS, COVARIANCES), 3))
def test_every_covariance_is_symmetric_and_positive(name, covariance):
    p = identify_batch(BATCH, GTM, name, Options(covariance=covariance)).covariance
    size = np.sqrt(np.einsum("rii->ri", p))
    correlation = p / (size[:, :, None] * size[:, None, :])
    np.testing.assert_allclose(correlation, np.swapaxes(correlation, 1, 2), atol=1e-9)
    assert (np.linalg.eigvalsh(correlation) > -1e-9).all()


@pytest.mark.parametrize("covariance", sorted(set(COVARIANCES) - {"corrected"}))
def test_a_joint_estimate_of_copies_is_known_better(covariance):
    """Four identical runs: the same estimate, a quarter of the variance; as printed, N cancels that.

    "corrected" takes the degrees of freedom of one fit from all records together, and so differs from four fits.
    """
    one = fly(runs=1, gust=1.0, noise=1.0, seed=35)
    options = Options(covariance=covariance)
    single = identify_batch(one, GTM, "iv-lowpass", options)
    joint = identify_joint([one] * 4, GTM, "iv-lowpass", options)
    np.testing.assert_allclose(joint.theta, single.theta, rtol=1e-9)
    # N of a joint estimate counts every sample of the records, N of a run its rows (two samples fewer)
    ratio = 250.0 / 248.0 if covariance == "paper" else 0.25
    np.testing.assert_allclose(joint.covariance[0], ratio * single.covariance[0], rtol=1e-6)


def test_a_joint_fit_takes_its_degrees_of_freedom_once():
    """Of 3 parameters and a constant fitted to 20 records of 250 samples nearly nothing is taken from the residuals, of
    each record alone about what 4 of the few excited frequencies are."""
    batch = fly(runs=20, noise=1.0, seed=7)
    std = {
        name: np.sqrt(np.diag(identify_joint([batch], GTM, "iv-f1", Options(covariance=name)).covariance[0]))
        for name in ("coloured", "corrected")
    }
    assert np.all(std["corrected"] < 1.15 * std["coloured"])
    assert np.all(std["corrected"] > 0.95 * std["coloured"])


@pytest.mark.grid
@pytest.mark.parametrize("name", ["ls", "iv-f1"])
def test_a_joint_fit_of_one_record_is_that_of_the_record(name):
    batch = fly(runs=1, noise=1.0, gust=0.5, seed=8)
    joint = identify_joint([batch], GTM, name, Options()).covariance[0]
    own = identify_batch(batch, GTM, name, Options()).covariance[0]
    np.testing.assert_allclose(joint, own, rtol=1e-6)


def test_none_saves_the_time():
    assert np.isnan(identify_batch(BATCH, GTM, "ls", Options(covariance="none")).covariance).all()
