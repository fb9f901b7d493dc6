"""Scores against refits, p-values against scipy and brute force, and their spread under the null."""

from dataclasses import replace

import numpy as np
import pytest
import trace_records as tr
from scipy.stats import norm

from airtruth.effects.registry import EFFECTS
from airtruth.physics.terms import AeroTerm, Change
from airtruth.tracing.anomalies.score_test import directions, holm, table
from airtruth.tracing.inference.optimise import fit, initial_parameters
from airtruth.tracing.inference.whitening import NO_WHITENER, autoregression
from airtruth.tracing.model.parameters import SHORT_PERIOD
from airtruth.tracing.model.response import respond
from airtruth.units import DEG

pytestmark = pytest.mark.slow


def effects(*keys):
    return [EFFECTS[k] for k in keys]


def test_holm_by_hand():
    """Sorted .005 x 4, .01 x 3, .03 x 2, .04 x 1, each at least the one before."""
    np.testing.assert_allclose(holm([0.01, 0.04, 0.03, 0.005]), [0.03, 0.06, 0.06, 0.02], rtol=1e-15)
    np.testing.assert_allclose(holm([0.4, 0.9, 0.5]), [1.0, 1.0, 1.0])
    np.testing.assert_allclose(holm([0.02, 0.02]), [0.04, 0.04])
    assert holm([]).size == 0


# -- p-values at a null's optimum


@pytest.fixture(scope="module")
def null():
    rng = np.random.default_rng(20)
    problem = tr.problem([tr.fly(rng, amplitude=a * DEG, name=str(a)) for a in (2.0, -2.0)])
    found = fit(problem, tr.NOTHING, initial_parameters(problem, tr.NOTHING))
    return problem, found


def test_p_value_of_one_direction(null):
    """Two-sided for a scale, one-sided for a delay: scipy's normal distribution."""
    problem, found = null
    scores = table(found, problem, effects("vane_scale", "elevator_delay"), NO_WHITENER, 0).scores
    assert len(scores) == 2
    for score in scores:
        one_sided = score.effect.name == "elevator_delay"
        expected = norm.sf(score.z) if one_sided else 2.0 * norm.sf(abs(score.z))
        assert score.p_value == pytest.approx(expected, rel=1e-12)
        assert score.size == pytest.approx(score.z / np.sqrt(score.information), rel=1e-12)


def test_p_value_over_places_against_brute_force(null):
    """Largest |z| of 400 000 draws with the correlation of the directions; 20 000 draws stand behind the score's."""
    problem, found = null
    tried = effects("vane_scale", "cm_alpha_nonlinear:break", "cl_alpha_nonlinear:break")
    made = table(found, problem, tried, NO_WHITENER, 0)
    rng = np.random.default_rng(21)
    at = 0
    for effect, score in zip(tried, made.scores, strict=True):
        count = len(directions(effect, found, problem))
        span = slice(at, at + count)
        at += count
        if count == 1:
            continue
        block = made.information[span, span]
        scale = np.sqrt(np.diag(block))
        values, vectors = np.linalg.eigh(block / np.outer(scale, scale))
        draws = rng.standard_normal((400_000, count)) @ (vectors * np.sqrt(np.maximum(values, 0.0))).T
        expected = np.mean(np.abs(draws).max(axis=1) >= abs(score.z))
        error = np.sqrt(expected * (1.0 - expected) / 20_000)
        assert score.p_value == pytest.approx(expected, abs=5.0 * error + 2e-4, rel=0.1)
        assert 2.0 * norm.sf(abs(score.z)) <= score.p_value + 1e-12
        assert score.p_value <= count * 2.0 * norm.sf(abs(score.z)) * 1.2


def test_scores_do_not_depend_on_company_or_threads(null):
    problem, found = null
    keys = ("vane_lag", "gyro_scale", "elevator_asymmetry")
    together = table(found, problem, effects(*keys), NO_WHITENER, 0)
    threaded = table(found, replace(problem, threads=2), effects(*keys), NO_WHITENER, 0)
    assert [s.z for s in threaded.scores] == [s.z for s in together.scores]
    for key, score in zip(keys, together.scores, strict=True):
        alone = table(found, problem, effects(key), NO_WHITENER, 0)
        assert alone.scores[0].z == pytest.approx(score.z, rel=1e-9)


# -- scores against refits


def changed(seed, change):
    """Two noisy records in gusts of an aircraft that is changed, and the null's fit."""
    rng = np.random.default_rng(seed)
    common, per_record = tr.still()
    records = []
    for amplitude in (2.0, -2.0):
        made = tr.fly(rng, amplitude=amplitude * DEG, name=str(amplitude), samples=150)
        before, after = (
            respond(made, tr.SETTINGS, c, common, per_record, free_run=True).e for c in (Change(), change)
        )
        records.append(replace(made, signals=replace(made.signals, y=made.signals.y + before - after)))
    problem = tr.problem(records)
    return problem, fit(problem, tr.NOTHING, initial_parameters(problem, tr.NOTHING))


def refit(problem, null, effect, size):
    start = replace(null.point, sizes=np.array([size]))
    found = fit(problem, null.hypothesis.plus(effect), start)
    return 2.0 * (null.cost - found.cost), found.point.sizes[0]


PAIRS = [
    ("vane_arm", {"x_m": 1.0}, 1.0, "vane_lag"),
    ("gyro_scale", {"factor": 1.12}, 0.12, "vane_scale"),
    ("elevator_delay", {"delay_s": 0.008}, 0.008, "gyro_lag"),
]
SEEDS = range(40, 44)


@pytest.mark.parametrize(("key", "values", "size", "other"), PAIRS)
def test_separation_of_two_directions_is_that_of_their_refits(key, values, size, other):
    """2 log L of the true effect's refit is z^2, and exceeds the other's by d^2 (1 - c^2) in the mean.

    d^2 from the information of the size, c the cosine of the two. One record set scatters by
    2 d sqrt(1 - c^2), so that four allow three halves of that; and curvature a tenth of d^2.
    """
    gains, predicted, d2 = [], [], []
    for seed in SEEDS:
        problem, null = changed(seed, EFFECTS[key].change(values))
        made = table(null, problem, effects(key, other), NO_WHITENER, 0)
        i = made.information
        c2 = i[0, 1] ** 2 / (i[0, 0] * i[1, 1])
        own, _ = refit(problem, null, EFFECTS[key], size)
        others, _ = refit(problem, null, EFFECTS[other], 0.5 * made.scores[1].size)
        gains.append(own - others)
        d2.append(size**2 * i[0, 0])
        predicted.append(d2[-1] * (1.0 - c2))
    mean, strength = np.mean(predicted), np.mean(d2)
    assert strength > 16.0
    error = 2.0 * np.sqrt(mean / len(SEEDS))
    assert np.mean(gains) == pytest.approx(mean, abs=3.0 * error + 0.1 * strength)


@pytest.mark.parametrize(("key", "values", "size", "other"), PAIRS)
def test_one_step_of_scoring_is_the_refit_for_a_small_effect(key, values, size, other):
    """A quarter of the effect: size within 0.3 standard errors, 2 log L within 1."""
    effect = EFFECTS[key]
    first = effect.parameters[0]
    problem, null = changed(50, effect.change({first.name: first.value(0.25 * size)}))
    (score,) = table(null, problem, [effect], NO_WHITENER, 0).scores
    gain, refitted = refit(problem, null, effect, score.size)
    unit = np.sqrt(score.information)
    assert score.size * unit == pytest.approx(refitted * unit, abs=0.3)
    assert score.z**2 == pytest.approx(gain, abs=1.0)


def test_one_step_agrees_with_the_refit_in_noise():
    """Within a fifth of a standard error."""
    rng = np.random.default_rng(22)
    records = [tr.fly(rng, amplitude=a * DEG, name=str(a)) for a in (2.0, -2.0, 1.0)]
    problem = tr.problem(records)
    null = fit(problem, tr.NOTHING, initial_parameters(problem, tr.NOTHING))
    scores = table(null, problem, effects("vane_arm", "gyro_scale"), NO_WHITENER, 0).scores
    assert len(scores) == 2
    for score in scores:
        found = fit(
            problem, null.hypothesis.plus(score.effect), replace(null.point, sizes=np.array([score.size]))
        )
        assert found.point.sizes[0] * np.sqrt(score.information) == pytest.approx(score.z, abs=0.2)


# -- under the null


NULL_EFFECTS = (
    "elevator_delay",
    "backlash",
    "elevator_asymmetry",
    "cm_alpha_nonlinear:quadratic",
    "cl_alpha_nonlinear:quadratic",
    "downwash_lag",
    "vane_arm",
    "vane_lag",
    "gyro_lag",
    "accelerometer_lag",
    "gyro_scale",
    "accelerometer_arm",
)
DRAWS = 20


def test_scores_have_unit_variance_under_the_null():
    """20 flight tests of two records, derivatives and biases drawn from what is declared of them.

    The mean of z^2 over draws and m effects of correlation c_ij has variance 2 mean(c_ij^2)/draws; z itself
    mean(c_ij)/draws. Four standard errors are allowed.
    """
    rng = np.random.default_rng(23)
    root = np.linalg.cholesky(tr.plant().derivative_cov)
    z, correlations = [], []
    for _ in range(DRAWS):
        theta = tr.TRUTH + root @ rng.standard_normal(6)
        records = [
            tr.fly(
                rng,
                theta,
                samples=150,
                amplitude=a * DEG,
                bias=tr.SETTINGS.bias_std * rng.standard_normal(3),
                name=str(a),
            )
            for a in (2.0, -2.0)
        ]
        problem = tr.problem(records)
        null = fit(problem, tr.NOTHING, initial_parameters(problem, tr.NOTHING))
        whitener = autoregression(null.innovations)
        made = table(null, problem, effects(*NULL_EFFECTS), whitener, 0)
        assert len(made.scores) == len(NULL_EFFECTS)
        # a one-sided effect has one direction, so that its z is signed too
        z.append([s.z for s in made.scores])
        scale = np.sqrt(np.diag(made.information))
        correlations.append(made.information / np.outer(scale, scale))
    z, c = np.array(z), np.mean(correlations, axis=0)
    assert np.mean(z**2) == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 * np.mean(c**2) / DRAWS))
    assert np.mean(z) == pytest.approx(0.0, abs=4.0 * np.sqrt(np.mean(c) / DRAWS))
    each = np.mean(z**2, axis=0)
    assert each.max() < 1.0 + 5.0 * np.sqrt(2.0 / DRAWS)


def test_nothing_is_scored_that_the_records_do_not_excite():
    """A change that moves nothing has no information, and no score."""
    problem, null = changed(51, Change())
    silent = replace(EFFECTS["gyro_lag"], describe=lambda values: Change())
    assert table(null, problem, [silent], NO_WHITENER, 0).scores == ()


def test_the_score_of_a_curvature_is_that_of_a_refit_beside_a_free_slope():
    """At a trim of 0.1 rad, 7 alpha^2 of lift, its constant trimmed out: z^2 is 2 log L over a null that is as free,
    the likelihood's own curvature a tenth. Its slope of 1.4 is six standard deviations of the declared one.
    """
    rng = np.random.default_rng(92)
    bent = Change(aero=(AeroTerm("CL", "alpha", "quadratic", 7.0, 0.0),))
    plant = tr.plant()
    plant = tr.about(plant, 0.1)
    common, per_record = tr.still()
    per_record[SHORT_PERIOD.per_record.index("alpha0")], per_record[SHORT_PERIOD.per_record.trim.start] = (
        0.1,
        -0.07,
    )
    made = tr.fly(rng, amplitude=1.5 * DEG)
    made = replace(
        made, signals=replace(made.signals, theta_rad=np.full_like(made.signals.theta_rad, 0.1)), plant=plant
    )
    y = made.signals.y - respond(made, tr.SETTINGS, bent, common, per_record, free_run=True).e
    y += tr.SETTINGS.noise * rng.standard_normal(y.shape)
    problem = tr.problem([replace(made, signals=replace(made.signals, y=y))])
    curvature = EFFECTS["cl_alpha_nonlinear:quadratic"]
    declared = replace(tr.NOTHING, trim_flow_rad=0.1)
    null = fit(problem, declared, initial_parameters(problem, declared))
    (score,) = table(null, problem, [curvature], NO_WHITENER, 0).scores
    also_unconstrained = fit(problem, replace(declared, also_unconstrained=(0,)), null.point)
    found = fit(problem, declared.plus(curvature), replace(null.point, sizes=np.array([score.size])))
    assert score.z > 4.0
    assert score.z**2 == pytest.approx(2.0 * (also_unconstrained.cost - found.cost), rel=0.1)
