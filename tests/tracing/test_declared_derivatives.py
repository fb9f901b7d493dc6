"""The declared derivatives against records: a linear normal problem whose answer is known in closed form."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import kstest

from airtruth.physics.motion import LONGITUDINAL
from airtruth.tracing.anomalies.families import advice
from airtruth.tracing.declared_model import remaining_evidence
from airtruth.tracing.inference import derivative_likelihood as module
from airtruth.tracing.inference.derivative_likelihood import (
    DERIVATIVES_MOVED,
    contradiction,
    derivative_likelihood,
)
from airtruth.tracing.inference.hypothesis_test import HypothesisTest
from airtruth.tracing.model.declared import declared_covariance
from airtruth.tracing.model.parameters import SHORT_PERIOD, Parameters

DECLARED = np.diag([0.24, 9.5, 0.05, 0.09, 6.2, 0.09]) ** 2
"""Covariance of the declared derivatives of aircraft/gtm, independent."""
TOLD = np.diag(np.array([0.02, 6.0, 0.01, 0.05, 1.0, 0.01]) ** -2.0)
"""Information of the records: some derivatives well known, CLq and Cmalpha not."""


@pytest.fixture
def white(monkeypatch):
    """Innovations that are white: plain and robust covariance are equal."""
    for name in ("inflation", "scatter"):
        monkeypatch.setattr(module, name, lambda problem, fitted: np.ones(SHORT_PERIOD.common.size))


def test_a_derivative_declared_as_zero_has_its_stated_deviation(gtm):
    """The others scale with the value at the trim: CLalpha 4.787 +- 0.24 stated, 5.0 at the trim."""
    stated = {
        name: q.model_copy(update={"value": 0.0, "std": 2.0}) for name, q in gtm.file.derivatives.items()
    }
    stated |= {"CLalpha": gtm.file.derivatives["CLalpha"]}
    file = gtm.file.model_copy(update={"derivatives": stated, "mass": None})
    values = np.array([5.0, 30.0, 0.4, 0.0, 0.0, -1.8])
    covariance = declared_covariance(gtm.model_copy(update={"file": file}), values)
    expected = np.array([0.24 * 5.0 / 4.787, *[2.0] * 5])
    np.testing.assert_allclose(covariance, np.diag(expected**2), rtol=1e-12)


def fit_of(estimate, spread=None):
    """The posterior of a linear problem: prior of covariance ``DECLARED + spread`` about zero, likelihood about ``estimate``."""
    prior = np.eye(SHORT_PERIOD.common.size)
    own = SHORT_PERIOD.common.derivatives
    prior[own, own] = np.linalg.inv(DECLARED if spread is None else DECLARED + spread)
    precision = prior.copy()
    precision[own, own] += TOLD
    covariance = np.linalg.inv(precision)
    mode = np.zeros(SHORT_PERIOD.common.size)
    mode[own] = np.linalg.solve(precision[own, own], TOLD @ estimate)
    problem = SimpleNamespace(
        declared_covariance=DECLARED,
        priors=lambda hypothesis: SimpleNamespace(common=prior),
        layout=SHORT_PERIOD,
    )
    fitted = SimpleNamespace(
        point=Parameters(mode, np.zeros((1, SHORT_PERIOD.per_record.size)), np.zeros(0)),
        covariance=covariance,
        hypothesis=SimpleNamespace(unconstrained=(), spread=spread),
        cost=0.5 * float((mode[own] - estimate) @ TOLD @ (mode[own] - estimate))
        + 0.5 * float(mode[own] @ np.linalg.solve(DECLARED, mode[own])),
    )
    return problem, fitted


def test_the_likelihood_is_that_of_the_records(white):
    estimate = np.array([0.3, -4.0, 0.02, 0.2, 3.0, -0.1])
    found = derivative_likelihood(*fit_of(estimate))
    np.testing.assert_allclose(found.information, TOLD, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(found.vector, TOLD @ estimate, rtol=1e-8)
    assert found.cost == pytest.approx(0.5 * estimate @ TOLD @ estimate, rel=1e-8)


def test_the_test_keeps_its_level_under_a_true_declaration(white):
    """p-values of declared derivatives drawn from their uncertainty are uniform, or larger because two tests share the level
    (one-sided Kolmogorov and Smirnov).
    """
    rng = np.random.default_rng(20261122)
    noise = np.linalg.cholesky(np.linalg.inv(TOLD))
    root = np.linalg.cholesky(DECLARED)
    p_values = [
        contradiction(*fit_of(root @ rng.standard_normal(6) + noise @ rng.standard_normal(6))).p_value
        for _ in range(400)
    ]
    assert kstest(p_values, "uniform", alternative="greater").pvalue > 0.01
    assert np.mean(np.array(p_values) <= 0.2) > 0.1


def test_a_wrong_declaration_is_contradicted(white):
    """Six declared standard deviations in a derivative that the records know."""
    estimate = np.array([0.0, 0.0, 0.3, 0.0, 0.0, 0.0])
    test = contradiction(*fit_of(estimate))
    assert (test.degrees, test.directions) == (1, 6)
    assert test.statistic == pytest.approx(0.3**2 / (0.05**2 + 0.01**2), rel=1e-6)
    assert test.p_value < 1e-5


def test_derivatives_that_the_records_do_not_show_do_not_count(white, monkeypatch):
    told = TOLD.copy()
    told[1, 1] = told[3, 3] = 1e-9
    monkeypatch.setitem(globals(), "TOLD", told)
    assert contradiction(*fit_of(np.zeros(6))).degrees == 4


def test_derivatives_along_what_explains_them_are_no_contradiction(white):
    """A cause of size 1 that moves CLde and Cmde, and the same with Cmde against its direction.

    The mode is an invertible function of the estimate, so that the statistic is the estimate's own about the total covariance."""
    along = np.array([0.0, 0.0, 0.3, 0.0, 0.0, 0.5])
    spread = np.outer(along, along)
    assert contradiction(*fit_of(along)).p_value < 1e-9
    explained = contradiction(*fit_of(along, spread))
    total = DECLARED + np.linalg.inv(TOLD) + spread
    assert explained.statistic == pytest.approx(along @ np.linalg.solve(total, along), rel=1e-6)
    assert explained.p_value > 0.9
    against = along * np.array([1.0, 1.0, 1.0, 1.0, 1.0, -1.0])
    assert contradiction(*fit_of(against, spread)).p_value < 1e-9


def test_what_an_answer_leaves_is_in_the_remaining_evidence(white):
    """The anomaly of the last round, or the derivatives with twice the probability of their test (Bonferroni)."""
    cause = np.array([0.0, 0.0, 0.3, 0.0, 0.0, 0.5])
    anomaly = HypothesisTest("a drift in time", 3.0, 5, 0.4)
    test = contradiction(*fit_of(cause))
    left = remaining_evidence(SimpleNamespace(declared_test=test, anomaly=anomaly))
    assert left == HypothesisTest(DERIVATIVES_MOVED, test.statistic, test.degrees, 2.0 * test.p_value)
    assert advice(left.null, LONGITUDINAL).startswith("trace again with `derivatives` among the candidates")
    test = contradiction(*fit_of(cause, np.outer(cause, cause)))
    assert remaining_evidence(SimpleNamespace(declared_test=test, anomaly=anomaly)) is anomaly
