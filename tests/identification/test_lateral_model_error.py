"""Random terms and repeated noise of the lateral filter error: against the formulas of a Gaussian likelihood, and on records."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from airtruth.identification import Options, identify_batch, identify_joint
from airtruth.identification.estimates import Status
from airtruth.identification.lateral import model_error
from airtruth.identification.lateral.model_error import (
    WithTerms,
    random_terms,
    with_random_terms,
    with_repeated_noise,
    with_uncertain_attack,
)
from airtruth.identification.lateral.observation import steady_flight
from airtruth.identification.lateral.predictor import factor_names
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


def norms(theta):
    """Sizes of the factors, by name: of both moments, and of both rates."""
    own = dict(zip(LATERAL.parameters, theta, strict=True))
    sizes = {}
    for name in own:
        moments = "ln" if name[1] in "ln" else "Y"
        rates = "pr" if name[2:] in ("p", "r") else [name[2:]]
        sizes[name] = np.sqrt(sum(own[f"C{c}{s}"] ** 2 for c in moments for s in rates))
    every = (*LATERAL.parameters, *factor_names(TERMS))
    return [(sizes[every[i].split("_")[0]], every[i].split("_")[1]) for i in RANDOM.factors]


@pytest.mark.parametrize("size", [0.0, 0.1, 1e3])
def test_random_terms_are_the_posterior_of_normal_factors_of_unknown_spread(size, monkeypatch):
    plain, score, best, information = gaussian(size, np.random.default_rng(4))
    monkeypatch.setattr(model_error, "LOG_SPREADS", np.array([-2.0, 1.0]))
    moved = with_random_terms(plain, score, np.zeros(COUNT + LEVELS), RANDOM)
    f, full = best[RANDOM.factors], np.linalg.inv(information)
    points = []
    for alpha, beta in product(np.exp([-2.0, 1.0]), repeat=2):
        spread = [own * (alpha if term == "alpha" else beta) for own, term in norms(plain.z[0, :COUNT])]
        prior = np.zeros(len(best))
        prior[RANDOM.factors] = np.array(spread) ** -2
        covariance = np.linalg.inv(information + np.diag(prior))
        marginal = full[np.ix_(RANDOM.factors, RANDOM.factors)] + np.diag(np.square(spread))
        points.append(
            (multivariate_normal.logpdf(f, cov=marginal), covariance @ information @ best, covariance)
        )
    share = np.exp([p[0] - max(q[0] for q in points) for p in points])
    share /= share.sum()
    mean = sum(w * p[1] for w, p in zip(share, points, strict=True))
    wanted = sum(w * (p[2] + np.outer(p[1] - mean, p[1] - mean)) for w, p in zip(share, points, strict=True))
    scale = np.sqrt(np.diag(wanted)[:COUNT])
    np.testing.assert_allclose((moved.maxima.z[0, :COUNT] - mean[:COUNT]) / scale, 0.0, atol=1e-5)
    made = moved.maxima.covariance[0, :COUNT, :COUNT] / np.outer(scale, scale)
    np.testing.assert_allclose(made, wanted[:COUNT, :COUNT] / np.outer(scale, scale), atol=1e-5)
    every = (*LATERAL.parameters, *factor_names(TERMS))
    np.testing.assert_allclose(
        moved.by_attack[0, CLBETA], mean[every.index("Clbeta_alpha")], rtol=1e-5, atol=1e-7
    )


def test_an_uncertain_angle_of_attack_widens_the_derivatives_that_change_with_it():
    slopes = np.linspace(-1.0, 1.0, COUNT)
    maxima = Maxima(np.zeros((1, COUNT)), np.eye(COUNT)[None], np.array([Status.CONVERGED]), np.array([3]))
    made = with_uncertain_attack(WithTerms(maxima, slopes[None]), np.array([0.04]))
    np.testing.assert_allclose(made.covariance[0], np.eye(COUNT) + 0.04 * np.outer(slopes, slopes))


def test_derivatives_hold_at_the_angle_of_attack_of_the_steady_flight():
    batch = fly(runs=1, gust=0.0, noise=0.0)
    alpha = np.full_like(batch.t_s, 0.08)
    alpha[:, 50:] = 0.06
    made = steady_flight(replace(batch, channels={**batch.channels, "alpha_rad": alpha}), Options())
    pieces = [0.08, *[0.06] * (batch.t_s.shape[1] // 50 - 1)]
    np.testing.assert_allclose(made.attack, 0.08)
    np.testing.assert_allclose(made.variance, np.var(pieces, ddof=1))
    lacking = {name: x for name, x in batch.channels.items() if name != "alpha_rad"}
    assert not steady_flight(replace(batch, channels=lacking), Options()).variance.any()


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
