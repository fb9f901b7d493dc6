"""Sets that the quadratic about a fit predicts, against refits and against every subset of a quadratic."""

import itertools

import numpy as np
import pytest
from scaled_records import ACCELEROMETER, GYRO, VANE, fitted, scaled_problem
from scipy.optimize import minimize

from airtruth.effects.registry import EFFECTS
from airtruth.physics.motion import LONGITUDINAL
from airtruth.tracing.selection.explanation import REFERENCE
from airtruth.tracing.selection.subsets import minima, subsets

LIBRARY = tuple(e for e in EFFECTS.values() if not e.in_derivatives and e.applies_to(LONGITUDINAL))


@pytest.fixture(scope="module")
def problem():
    return scaled_problem()


def keys(subset):
    return {e.key for e in subset.effects}


def test_the_least_values_of_a_quadratic():
    """Against a general search over the variables that are not zero."""
    rng = np.random.default_rng(1)
    root = rng.standard_normal((6, 6))
    slope, information = rng.standard_normal(6), root @ root.T + np.eye(6)
    chosen = np.array(list(itertools.combinations(range(6), 3)))
    x, least = minima(slope, information, chosen)
    for members, at, value in zip(chosen, x, least, strict=True):
        g, h = slope[members], information[np.ix_(members, members)]
        other = minimize(lambda v, g=g, h=h: g @ v + 0.5 * v @ h @ v, np.zeros(3), tol=1e-12)
        assert value == pytest.approx(other.fun, abs=1e-8)
        assert at == pytest.approx(other.x, abs=1e-5)


def test_dependent_variables_have_no_minimum():
    information = np.array([[1.0, 1.0], [1.0, 1.0 + 1e-9]])
    x, least = minima(np.ones(2), information, np.array([[0, 1]]))
    assert np.isnan(x).all()
    assert least == pytest.approx([np.inf])


@pytest.mark.slow
def test_two_effects_at_once_in_place_of_another():
    """Vane and gyro read 1.2 of the truth. A wrong scale of the accelerometer imitates both, and either alone explains less."""
    problem = scaled_problem(1.2, 1.2)
    wrong = fitted(problem, ACCELEROMETER)
    assert min(fitted(problem, e).cost for e in (VANE, GYRO)) > wrong.cost
    best = next(subsets(problem, wrong, (VANE, GYRO), 3))
    assert keys(best) == {"vane_scale", "gyro_scale"}
    assert best.start.sizes == pytest.approx([0.2, 0.2], abs=0.05)


def test_the_sizes_are_those_of_the_fit_and_the_losses_follow_from_its_covariance(problem):
    """The loss without an effect is half the square of its size in standard errors (A. Wald, 1943)."""
    both = fitted(problem, GYRO, VANE)
    predicted = {frozenset(keys(s)): s for s in subsets(problem, both, (), 2)}
    own = predicted[frozenset(("gyro_scale", "vane_scale"))]
    assert own.start.sizes == pytest.approx(both.point.sizes, abs=2e-4)
    for i, (effect, other) in enumerate(((GYRO, VANE), (VANE, GYRO))):
        lost = predicted[frozenset((other.key,))].cost - own.cost + 1.0 + REFERENCE
        at = own.start.sizes[[e.key for e in own.effects].index(effect.key)]
        assert lost == pytest.approx(0.5 * (at / both.size_std(i)) ** 2, rel=1e-6)


def test_the_start_of_a_set_holds_the_other_parameters_too(problem):
    """From the start of the right set the likelihood is near its optimum, although the derivatives of the wrong one are far."""
    wrong, right = fitted(problem, ACCELEROMETER), fitted(problem, VANE, GYRO)
    start = next(subsets(problem, wrong, (VANE, GYRO), 3)).start
    away = np.abs(start.common[:6] - right.point.common[:6]) / right.common_std[:6]
    before = np.abs(wrong.point.common[:6] - right.point.common[:6]) / right.common_std[:6]
    assert away.max() < 0.5 * before.max()


def test_no_set_has_two_variants_of_an_effect_but_delays_of_two_channels(problem):
    delays = [EFFECTS[f"sensor_delay:{c}"] for c in ("q_rad_s", "az_m_s2")]
    curves = [e for e in LIBRARY if e.name == "cm_alpha_nonlinear"]
    found = [keys(s) for s in subsets(problem, fitted(problem, GYRO, VANE), [*delays, *curves], 4)]
    assert any({d.key for d in delays} <= names for names in found)
    assert not any(len({c.key for c in curves} & names) > 1 for names in found)


def test_sizes_are_within_the_plausible_range(problem):
    """Sizes are limited, and locations are those of the score."""
    sets = list(subsets(problem, fitted(problem, ACCELEROMETER), LIBRARY, 2))
    assert any(len(s.effects) == 2 for s in sets)
    for s in sets:
        parameters = [p for e in s.effects for p in e.parameters]
        assert len(parameters) == len(s.start.sizes)
        for parameter, value in zip(parameters, s.start.sizes, strict=True):
            low, high = parameter.reach
            assert low <= value <= high


@pytest.mark.grid
@pytest.mark.parametrize(
    ("members", "further", "number"), [((), (), 0), ((), (VANE,), 1), ((VANE,), (), 1), ((VANE,), (GYRO,), 3)]
)
def test_a_library_of_few_effects_has_few_sets(problem, members, further, number):
    assert len(list(subsets(problem, fitted(problem, *members), further, 3))) == number
