"""Derivatives of one fit for another with other effects, on records whose sensors' scales are known."""

from dataclasses import replace

import numpy as np
import pytest
from scaled_records import GYRO, VANE, fitted, scaled_problem

from airtruth.tracing.inference.nearby import begins_at, nearby
from airtruth.tracing.inference.optimise import fit
from airtruth.tracing.inference.posterior import sensitivities_of
from airtruth.tracing.model.parameters import Parameters


@pytest.fixture(scope="module")
def problem():
    return scaled_problem()


@pytest.fixture(scope="module")
def vane(problem):
    """A fit with the derivatives where it ended: a search ends with those of the step before."""
    own = fitted(problem, VANE)
    renewed = tuple(sensitivities_of(problem, i, own.hypothesis, own.point) for i in range(2))
    return replace(own, sensitivities=renewed)


def beside(own, *effects, **sizes):
    """The hypothesis of these effects, and the fit's point with their sizes."""
    hypothesis = replace(own.hypothesis, effects=effects)
    known = {VANE.key: own.point.sizes[0], **sizes}
    values = np.array([known[e.key] for e in effects])
    return hypothesis, Parameters(own.point.common, own.point.per_record, values)


def test_kept_derivatives_are_those_of_a_renewal(problem, vane):
    """The vane's changes its position, and the gyro's is made."""
    hypothesis, point = beside(vane, GYRO, VANE, gyro_scale=0.0)
    known = list(nearby(vane, hypothesis))
    assert len(known) == len(problem.records)
    for i, old in enumerate(known):
        kept = sensitivities_of(problem, i, hypothesis, point, old=old)
        made = sensitivities_of(problem, i, hypothesis, point)
        scale = np.abs(made.t).max(axis=(1, 2), keepdims=True) + 1e-300
        np.testing.assert_allclose(kept.t / scale, made.t / scale, atol=1e-8)
        np.testing.assert_allclose(kept.w, made.w, atol=1e-6 * np.abs(made.w).max())


def test_a_fit_begins_at_another_only_with_its_effects_and_its_point(vane):
    assert begins_at(vane, vane.hypothesis, vane.point)
    hypothesis, point = beside(vane, VANE)
    moved = Parameters(point.common, point.per_record, point.sizes + 1e-6)
    assert not begins_at(vane, hypothesis, moved)
    assert not begins_at(vane, *beside(vane, VANE, GYRO, gyro_scale=0.0))


def test_a_fit_that_begins_with_them_ends_where_it_would(problem, vane):
    """Within the 0.05 in log-likelihood that end a search."""
    hypothesis, start = beside(vane, VANE, GYRO, gyro_scale=0.05)
    slow, fast = fit(problem, hypothesis, start), fit(problem, hypothesis, start, near=vane)
    assert slow is not None
    assert fast is not None
    assert fast.converged
    assert fast.cost == pytest.approx(slow.cost, abs=0.05)
