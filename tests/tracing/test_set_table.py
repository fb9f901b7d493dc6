"""The table of fits: a set of effects is fitted once, in any order of its effects and of the records."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
import trace_records as tr
from scaled_records import ACCELEROMETER, GYRO, VANE, disturbed_problem, fitted, scaled_problem

from airtruth.tracing.inference.causes import DeclaredCauses
from airtruth.tracing.inference.optimise import fit, initial_parameters
from airtruth.tracing.selection import set_table
from airtruth.tracing.selection.search import search
from airtruth.tracing.selection.set_table import SetTable, in_order_of


@pytest.fixture(scope="module")
def problem():
    return scaled_problem()


@pytest.fixture
def made(monkeypatch):
    """Effects of every fit that a table makes."""
    every = []

    def counted(problem, hypothesis, *arguments, **options):
        every.append(tuple(e.key for e in hypothesis.effects))
        return fit(problem, hypothesis, *arguments, **options)

    monkeypatch.setattr(set_table, "fit", counted)
    return every


def start_of(problem, *effects):
    hypothesis = replace(tr.NOTHING, effects=effects)
    start = initial_parameters(problem, hypothesis)
    return hypothesis, replace(start, sizes=np.zeros(len(effects)))


def test_a_set_is_fitted_once_in_any_order(problem, made):
    sets = SetTable(problem)
    first = sets.fit(*start_of(problem, GYRO, VANE))
    assert sets.fit(*start_of(problem, GYRO, VANE)) is first
    again = sets.fit(*start_of(problem, VANE, GYRO))
    assert made == [("gyro_scale", "vane_scale")]
    assert again.cost == first.cost
    assert again.point.sizes.tolist() == first.point.sizes[::-1].tolist()
    sets.fit(*start_of(problem, GYRO))
    assert len(made) == 2


@pytest.mark.parametrize("order", list(itertools.permutations((GYRO, VANE, ACCELEROMETER)))[1:])
def test_a_fit_in_another_order_is_the_fit_of_that_order(problem, order):
    """Against an evaluation, without a step, of the hypothesis in that order."""
    own = fitted(problem, GYRO, VANE, ACCELEROMETER)
    moved = in_order_of(own, replace(own.hypothesis, effects=order))
    direct = fit(problem, moved.hypothesis, moved.point, iterations=0)
    assert moved.cost == pytest.approx(direct.cost, rel=1e-12)
    assert [moved.size_std(k) for k in range(3)] == pytest.approx(
        [own.size_std((GYRO, VANE, ACCELEROMETER).index(e)) for e in order]
    )
    for ours, theirs in zip(moved.sensitivities, direct.sensitivities, strict=True):
        np.testing.assert_allclose(ours.r, theirs.r, atol=1e-9)
        np.testing.assert_allclose(ours.t, theirs.t, rtol=0.05, atol=0.02 * np.abs(theirs.t).max())


def test_the_order_of_the_records_does_not_change_a_fit(problem):
    hypothesis, start = start_of(problem, GYRO, VANE)
    turned = replace(problem, records=problem.records[::-1])
    first = SetTable(problem).fit(hypothesis, start)
    second = SetTable(turned).fit(hypothesis, replace(start, per_record=start.per_record[::-1]))
    assert second.cost == pytest.approx(first.cost, rel=1e-9)
    np.testing.assert_allclose(second.point.sizes, first.point.sizes, rtol=1e-5)
    np.testing.assert_allclose(second.point.per_record[::-1], first.point.per_record, rtol=1e-4, atol=1e-6)


def test_another_start_is_tried_once_and_the_better_optimum_remains(problem, made):
    sets = SetTable(problem)
    hypothesis, start = start_of(problem, GYRO)
    first = sets.fit(hypothesis, start)
    away = replace(start, sizes=np.array([0.3]))
    second = sets.fit_from(hypothesis, away)
    assert len(made) == 2
    best = min((first, second), key=lambda f: f.cost)
    assert sets.fit(hypothesis, start) is best
    assert sets.fit_from(hypothesis, away) is best
    assert len(made) == 2


def test_released_derivatives_are_another_row(problem, made):
    sets = SetTable(problem)
    hypothesis, start = start_of(problem)
    spread = 9.0 * np.diag(np.diag(problem.declared_covariance))
    declared = sets.fit(hypothesis, start)
    free = sets.fit(replace(hypothesis, spread=spread), start)
    assert free.cost < declared.cost
    assert len(made) == 2


@pytest.mark.slow
@pytest.mark.parametrize("turned", ["candidates", "records"])
def test_the_order_of_candidates_and_records_does_not_change_an_answer(turned):
    """Scales of gyro and accelerometer are in the records."""
    problem = disturbed_problem([1.0, 1.1, 1.15], 0, 0.0)
    candidates = GYRO, VANE, ACCELEROMETER

    def named(problem, candidates):
        start = initial_parameters(problem, tr.NOTHING)
        rounds = search(SetTable(problem), tr.NOTHING, start, candidates, 1, DeclaredCauses())
        last = rounds[-1].null
        sizes = {
            e.key: float(last.point.sizes[last.hypothesis.span(e.key)][0]) for e in last.hypothesis.effects
        }
        return sizes, last.cost, {names: round(w, 2) for names, w in rounds[-1].posterior.items() if w > 0.02}

    sizes, cost, sets = named(problem, candidates)
    assert set(sizes) == {"gyro_scale", "accelerometer_scale"}
    if turned == "candidates":
        others = named(problem, candidates[::-1])
    else:
        others = named(replace(problem, records=problem.records[::-1]), candidates)
    assert others[0] == pytest.approx(sizes, rel=1e-3)
    assert others[1] == pytest.approx(cost, abs=0.01)
    assert others[2] == sets
