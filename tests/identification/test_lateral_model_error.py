"""Random terms and repeated noise of the lateral filter error: against the formulas of a Gaussian likelihood, and on records."""

from dataclasses import replace

import numpy as np
import pytest

from airtruth.identification import Options, identify_batch, identify_joint
from airtruth.identification.estimates import Status
from airtruth.identification.lateral.model_error import random_terms, with_random_terms, with_repeated_noise
from airtruth.identification.likelihood.scoring import Maxima
from airtruth.identification.options import TERMS
from airtruth.physics.motion import LATERAL
from validation.affine_lateral import GTM, THETA, fly

COUNT, LEVELS = 15, 2
RANDOM = random_terms(Options(), COUNT + LEVELS)
CLBETA = LATERAL.index("Clbeta")


def gaussian(size, rng):
    """Information of all parameters, the maximum with the factors at zero, and the one with all free."""
    count = COUNT + RANDOM.factors.size + LEVELS
    root = rng.standard_normal((count, 4 * count))
    information = root @ root.T
    best = rng.standard_normal(count)
    best[RANDOM.factors] *= size
    own = np.ix_(RANDOM.places, RANDOM.places)
    pull = (information @ best)[RANDOM.places]
    covariance = np.linalg.inv(information[own])
    plain = Maxima((covariance @ pull)[None], covariance[None], np.array([Status.CONVERGED]), np.array([3]))
    at = RANDOM.point(plain.z)
    score = (np.zeros(1), ((at[0] - best) @ information)[None], information[None])
    return plain, score, best, information


@pytest.mark.parametrize("size", [0.0, 0.1, 1e6])
def test_random_terms_move_the_derivatives_by_the_share_of_stein(size):
    plain, score, best, information = gaussian(size, np.random.default_rng(4))
    moved = with_random_terms(plain, score, np.zeros(COUNT + LEVELS), RANDOM)
    full = np.linalg.inv(information)
    f = best[RANDOM.factors]
    wald = f @ np.linalg.solve(full[np.ix_(RANDOM.factors, RANDOM.factors)], f)
    share = max(0.0, 1.0 - f.size / wald) if wald else 0.0
    expected = plain.z[0, :COUNT] + share * (best[:COUNT] - plain.z[0, :COUNT])
    np.testing.assert_allclose(moved.z[0, :COUNT], expected, rtol=1e-6, atol=1e-9 * (1.0 + size))
    own = plain.covariance[0, :COUNT, :COUNT]
    wanted = own + share * (full[:COUNT, :COUNT] - own)
    np.testing.assert_allclose(moved.covariance[0, :COUNT, :COUNT], wanted, rtol=1e-7, atol=1e-12)
    assert (share > 0.99) == (size == 1e6)


def test_terms_that_are_free_are_not_random():
    assert random_terms(Options(terms=TERMS), COUNT + 18 + LEVELS).factors.size == 0
    some = random_terms(Options(terms=("beta",)), COUNT + 3 + LEVELS)
    assert some.factors.size == 15
    assert sorted([*some.places, *some.factors]) == list(range(COUNT + 18 + LEVELS))


def test_noise_that_repeats_is_not_averaged():
    records, rng = 4, np.random.default_rng(2)
    root = rng.standard_normal((COUNT, 60))
    one = root @ root.T
    joint = np.linalg.inv(records * one)
    maxima = Maxima(np.zeros((1, COUNT)), joint[None], np.array([Status.CONVERGED]), np.array([3]))
    each = np.repeat(one[None], records, axis=0)
    # a third of the variance is that of the sensors: the noise of the moments causes the rest
    quiet = 3.0 * records * one
    made = np.diag(with_repeated_noise(maxima, joint, each, quiet).covariance[0])
    np.testing.assert_allclose(made, np.diag(joint) / 3.0 + records * np.diag(joint) * 2.0 / 3.0, rtol=1e-9)
    alone = with_repeated_noise(maxima, joint, each, records * one)
    np.testing.assert_allclose(alone.covariance, maxima.covariance, rtol=1e-6)


def test_a_curved_rolling_moment_is_within_the_intervals_of_a_joint_estimate():
    batch = fly(runs=4, gust=1.0, seed=8, curvature=0.3)
    made = identify_joint([batch], GTM, "filter-error", Options(), LATERAL)
    off = np.abs(made.theta[0] - THETA) / np.sqrt(np.diag(made.covariance[0]))
    assert off[CLBETA] < 2.5
    # a straight line through the curve errs by a tenth, which is ten standard deviations of a linear model
    assert abs(made.theta[0, CLBETA] / THETA[CLBETA] - 1.0) < 0.03


def test_a_run_does_not_depend_on_the_others():
    batch = fly(runs=3, seconds=6.0, gust=1.0, seed=5)
    alone = replace(
        batch, run_ids=("one",), t_s=batch.t_s[1:2], channels={n: x[1:2] for n, x in batch.channels.items()}
    )
    both, one = (identify_batch(b, GTM, "filter-error", Options(), LATERAL) for b in (batch, alone))
    np.testing.assert_array_equal(both.theta[1], one.theta[0])
    np.testing.assert_array_equal(both.covariance[1], one.covariance[0])
