"""The test of the declared derivatives has its level where the declaration is right, and power against one wrong derivative."""

import numpy as np
import pytest
from scipy.stats import chi2

from airtruth.tracing.inference.derivative_likelihood import against_declaration


def setting(count, seed, told=1.0):
    """Declared covariance, covariance of the mode and gain for an information with correlated derivatives."""
    rng = np.random.default_rng(seed)
    std = rng.uniform(0.05, 2.0, count)
    declared = np.diag(std**2)
    mixed = rng.normal(size=(count, 2 * count)) / std[:, None]
    information = told * mixed @ mixed.T
    covariance = np.linalg.inv(np.linalg.inv(declared) + information)
    gain = covariance @ information
    spread = gain @ declared @ gain.T + covariance @ information @ covariance
    return std, declared, spread, gain, rng


@pytest.mark.parametrize("count", [6, 15])
@pytest.mark.parametrize("told", [1.0, 0.01])
def test_its_level_is_no_more_than_it_states(count, told):
    _, declared, spread, gain, rng = setting(count, 10 + count, told)
    root = np.linalg.cholesky(spread)
    p = np.array(
        [
            against_declaration(root @ rng.normal(size=count), declared, spread, gain).p_value
            for _ in range(6000)
        ]
    )
    for level in (0.2, 0.05, 0.01):
        allowed = 3.0 * np.sqrt(level / p.size)
        assert 0.4 * level < np.mean(p <= level) < level + allowed, level


def test_one_derivative_far_off_contradicts_the_declaration_that_the_joint_test_accepts():
    """4.7 standard deviations in one of fifteen, the others as they are: chi-square of 22 with 15 degrees of freedom."""
    std, declared, spread, gain, _ = setting(15, 3)
    mode = gain[:, 4] * 4.7 * std[4]
    found = against_declaration(mode, declared, spread, gain)
    assert found.degrees == 1
    assert found.statistic == pytest.approx(4.7**2, rel=0.15)
    assert (found.directions, found.derivatives) == (15, 15)
    assert found.p_value < 1e-3
    assert chi2.sf(4.7**2, 15) > 0.1


def test_many_small_errors_are_those_of_the_joint_test():
    std, declared, spread, gain, rng = setting(15, 4)
    found = against_declaration(gain @ (2.0 * std * rng.choice([-1.0, 1.0], 15)), declared, spread, gain)
    assert found.degrees == 15
    assert found.p_value < 0.01


def test_derivatives_that_the_records_do_not_show_are_not_counted():
    _, declared, spread, gain, _ = setting(6, 5, told=1e-9)
    assert against_declaration(np.zeros(6), declared, spread, gain).p_value == 1.0
