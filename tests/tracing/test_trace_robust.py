"""Robust standard deviations: the elimination against the whole matrix, the long-run variance by hand, and coverage."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import block_diag
from trace_records import NOTHING, SETTINGS, fly, problem

from airtruth.effects.registry import EFFECTS
from airtruth.tracing.inference.optimise import fit, initial_parameters
from airtruth.tracing.inference.posterior import likelihood_terms, marginal_information
from airtruth.tracing.inference.robust import MEMORY_S, inflation, long_run, mean_share, scatter
from airtruth.tracing.model.parameters import SHORT_PERIOD
from airtruth.tracing.model.settings import common_prior, per_record_prior

pytestmark = pytest.mark.slow

HYPOTHESIS = NOTHING.plus(EFFECTS["vane_arm"])


def disturbed(rng, sign, amount):
    """A record whose alpha and pitch rate carry correlated noise that the model does not know."""
    record = fly(rng, samples=300, amplitude=sign * 0.035, name=f"r{sign}")
    slow = np.zeros((300, 2))
    for k in range(1, 300):
        slow[k] = 0.95 * slow[k - 1] + np.sqrt(1.0 - 0.95**2) * rng.standard_normal(2)
    y = record.signals.y.copy()
    y[:, :2] += amount * SETTINGS.noise[:2] * slow
    return replace(record, signals=replace(record.signals, y=y))


def fitted(seed, amount):
    rng = np.random.default_rng(seed)
    p = problem([disturbed(rng, sign, amount) for sign in (1, -1)])
    return p, fit(p, HYPOTHESIS, initial_parameters(p, HYPOTHESIS))


def whole(p, found):
    """The same ratio from the matrix of all parameters, nothing eliminated."""
    m, n = SHORT_PERIOD.common.size + 1, len(p.records)
    slopes, information = (
        [],
        np.zeros((m + n * SHORT_PERIOD.per_record.size, m + n * SHORT_PERIOD.per_record.size)),
    )
    information[: SHORT_PERIOD.common.size, : SHORT_PERIOD.common.size] = common_prior(p.records, p.settings)
    middle = information.copy()
    for i, (record, t) in enumerate(zip(p.records, found.sensitivities, strict=True)):
        _, _, h = likelihood_terms(t, found.whitener, levels=True)
        at = np.r_[:m, m + i * SHORT_PERIOD.per_record.size : m + (i + 1) * SHORT_PERIOD.per_record.size]
        prior = per_record_prior(record, p.settings)[1]
        information[np.ix_(at, at)] += h + block_diag(np.zeros((m, m)), prior)
        rows = np.array([[float(np.sum(a * r)) for a in t.t[:, k]] for k, r in enumerate(t.r)])
        rows += 0.5 * np.array([[np.trace(w) - r @ w @ r for w in t.w] for r in t.r])
        full = np.zeros((len(rows), m + n * SHORT_PERIOD.per_record.size))
        full[:, at] = rows - rows.mean(axis=0)
        slopes.append(full)
    for record, x in zip(p.records, slopes, strict=True):
        lags = round(MEMORY_S / record.signals.dt_s)
        for a in range(-lags, lags + 1):
            low, high = max(0, -a), len(x) - max(0, a)
            middle += (1.0 - abs(a) / (lags + 1)) * x[low + a : high + a].T @ x[low:high]
    inverse = np.linalg.inv(information)
    # the prior of the records' own parameters is not in the middle matrix, as in the code
    return np.sqrt(np.diag(inverse @ middle @ inverse) / np.diag(inverse))[:m]


def test_elimination_is_the_whole_matrix():
    p, found = fitted(3, 2.0)
    np.testing.assert_allclose(inflation(p, found), np.maximum(whole(p, found), 1.0), rtol=1e-4)


@pytest.mark.parametrize(("samples", "lags"), [(125, 50), (500, 50), (10, 30)])
def test_share_that_is_left_without_the_mean_is_the_trace_of_both_matrices(samples, lags):
    """Expected value of the long-run variance of a white series about its own mean, over that about zero: explicit matrices."""
    at = np.arange(samples)
    weights = np.maximum(0.0, 1.0 - np.abs(at[:, None] - at) / (lags + 1.0))
    centred = np.eye(samples) - 1.0 / samples
    assert mean_share(samples, lags) == pytest.approx(
        np.trace(centred @ weights @ centred) / samples, rel=1e-12
    )


def test_share_of_a_long_record_is_one():
    """1 - b + b^2/3 of Kiefer and Vogelsang, b = 0.01."""
    assert mean_share(100_000, 999) == pytest.approx(1.0 - 0.01 + 0.01**2 / 3.0, abs=1e-5)


def test_long_run_variance_by_hand():
    x = np.array([[1.0], [2.0], [-1.0], [3.0]])
    # sum of squares 15; lag one products 2 - 2 - 3 = -3 with weight 1/2 on both sides
    assert long_run(x, 0)[0, 0] == 15.0
    assert long_run(x, 1)[0, 0] == pytest.approx(15.0 - 3.0)


def test_slow_noise_widens_and_white_noise_hardly_does():
    white = [inflation(*fitted(seed, 0.0))[SHORT_PERIOD.common.size] for seed in range(4)]
    slow = [inflation(*fitted(seed, 4.0))[SHORT_PERIOD.common.size] for seed in range(4)]
    assert np.mean(white) < 1.1
    assert np.mean(slow) > 1.15


def test_records_that_disagree_widen():
    """Alike records, one of them with alpha scaled by 1.1 besides: its pull on the size is not the others'."""
    rng = np.random.default_rng(4)
    alike = [
        fly(rng, samples=300, amplitude=a, name=f"r{i}") for i, a in enumerate((0.035, -0.035, 0.03, -0.03))
    ]
    y = alike[0].signals.y * [1.1, 1.0, 1.0]
    other = replace(alike[0], signals=replace(alike[0].signals, y=y))
    ratios = []
    for records in (alike, [other, *alike[1:]]):
        p = problem(records)
        found = fit(p, HYPOTHESIS, initial_parameters(p, HYPOTHESIS))
        ratios.append(scatter(p, found)[SHORT_PERIOD.common.size])
    assert ratios[0] < 2.0
    assert ratios[1] > 1.2 * ratios[0]


def test_scatter_by_hand():
    """One size of four records: J^-1 K J^-1 over J^-1 with K from the records' gradients at the optimum."""
    rng = np.random.default_rng(5)
    p = problem([fly(rng, samples=200, amplitude=a, name=f"r{a}") for a in (0.035, -0.035, 0.03)])
    found = fit(p, HYPOTHESIS, initial_parameters(p, HYPOTHESIS))
    m = SHORT_PERIOD.common.size + 1
    gradients = np.array(
        [-likelihood_terms(t, found.whitener, levels=True)[1][:m] for t in found.sensitivities]
    )
    middle = 3.0 * np.cov(gradients.T)
    middle[: SHORT_PERIOD.common.size, : SHORT_PERIOD.common.size] += common_prior(p.records, p.settings)
    pieces = [likelihood_terms(t, found.whitener, levels=True) for t in found.sensitivities]
    inverse = np.linalg.inv(
        marginal_information(p.priors(found.hypothesis), found.point, pieces, levels=True).information
    )
    expected = np.sqrt(np.diag(inverse @ middle @ inverse) / np.diag(inverse))
    np.testing.assert_allclose(scatter(p, found), np.maximum(expected, 1.0), rtol=1e-3)


def test_two_records_cannot_tell_their_scatter():
    assert (scatter(*fitted(1, 0.0)) == 1.0).all()
