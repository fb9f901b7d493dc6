"""Earlier effects that a later one makes redundant, on records whose sensors' scales are known."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import trace_records as tr

from airtruth.effects.registry import EFFECTS
from airtruth.tracing.inference.optimise import fit, initial_parameters
from airtruth.tracing.selection.explanation import REFERENCE, CauseSet
from airtruth.tracing.selection.pruning import pruned
from airtruth.tracing.selection.refit import redundant_effect
from airtruth.tracing.selection.release import Release
from airtruth.tracing.selection.rounds import RoundStart, search_round
from airtruth.tracing.selection.set_table import SetTable
from airtruth.tracing.selection.significance import significant_gain
from airtruth.units import DEG

EARLIER, LATER = EFFECTS["gyro_scale"], EFFECTS["accelerometer_scale"]
MATERIAL = EARLIER.parameters[0].material
LEAST = significant_gain(33)


def fitted(gyro, accelerometer):
    """Both effects, fitted to two records of sensors with these scales."""
    rng = np.random.default_rng(4)
    records = []
    for amplitude in (2.0, -2.0):
        one = tr.fly(rng, amplitude=amplitude * DEG, sigma_w=0.05, name=str(amplitude))
        y = one.signals.y * [1.0, gyro, accelerometer]
        records.append(replace(one, signals=replace(one.signals, y=y)))
    problem = tr.problem(records)
    hypothesis = tr.NOTHING.plus(EARLIER).plus(LATER)
    return problem, fit(problem, hypothesis, initial_parameters(problem, hypothesis))


@pytest.mark.grid
@pytest.mark.parametrize(("gyro", "expected"), [(1.2, None), (1.0, 0)])
def test_an_effect_that_is_there_stays_and_one_that_is_not_goes(gyro, expected):
    problem, found = fitted(gyro, 1.1)
    std = np.sqrt(found.covariance[-2, -2])
    assert found.point.sizes[0] == pytest.approx(gyro - 1.0, abs=3.0 * std)
    assert redundant_effect(SetTable(problem), found, LEAST) == expected


def test_an_immaterial_effect_goes_however_sure():
    """A size short of material, known to far less than that: the same fit with its size moved there."""
    problem, found = fitted(1.2, 1.1)
    for share, expected in ((0.99, 0), (1.01, None)):
        sizes = np.array([share * MATERIAL, found.point.sizes[1]])
        moved = replace(found, point=replace(found.point, sizes=sizes), cost=found.cost - 1e3)
        assert redundant_effect(SetTable(problem), moved, LEAST) == expected


@pytest.mark.grid
@pytest.mark.parametrize(
    ("gyro", "expected"), [(1.2, ["gyro_scale", "accelerometer_scale"]), (1.0, ["accelerometer_scale"])]
)
def test_a_finished_search_gives_up_an_effect_that_is_not_there(gyro, expected):
    """The first effect of a search, which a later one or released derivatives made unnecessary."""
    problem, found = fitted(gyro, 1.1)
    candidates = (EARLIER, LATER, EFFECTS["vane_scale"])
    begin = RoundStart(found.hypothesis, found.point, candidates[2:], scores_only=True)
    last = search_round(SetTable(problem), begin, 2, 1, lambda step: None)
    kept = pruned(SetTable(problem), (last,), candidates, 1, 0.05, lambda step: None)
    assert [e.key for e in kept[-1].null.hypothesis.effects] == expected
    alone = (replace(last, null=replace(last.null, hypothesis=tr.NOTHING.plus(LATER))),)
    assert pruned(SetTable(problem), alone, candidates, 1, 0.05, lambda step: None) is alone


@pytest.mark.grid
@pytest.mark.parametrize(("odds", "is_kept"), [(5.0, False), (20.0, True)])
def test_derivatives_beside_names_need_strong_odds(odds, is_kept):
    """The derivatives are as declared, and were released. A further cause needs odds of ten to one; then it is a rival."""
    problem, right = fitted(1.2, 1.1)
    wide = replace(right.hypothesis, spread=9.0 * np.diag(np.diag(problem.declared_covariance)))
    candidates = (EARLIER, LATER, EFFECTS["vane_scale"])
    begin = RoundStart(wide, right.point, candidates[2:], scores_only=True)
    last = search_round(SetTable(problem), begin, 2, 1, lambda step: None)
    cost = right.cost - REFERENCE - np.log(odds)
    wrong = (CauseSet((), ("Cmq",), (), (), problem.declared_covariance, cost),)
    last = replace(last, sets=wrong, release=Release(last.declared_test, last.null, wrong, 0.0))
    accepted = (SimpleNamespace(score=SimpleNamespace(effect=e), gain=100.0) for e in (EARLIER, LATER))
    before = tuple(replace(last, tied=(c,), candidates=()) for c in accepted)
    kept = pruned(SetTable(problem), (*before, last), candidates, 1, 0.05, lambda step: None)
    assert (kept[-1] is last) == is_kept
    if not is_kept:
        assert kept[-1].null.hypothesis.spread is None
        assert {e.key for e in kept[-1].null.hypothesis.effects} == {EARLIER.key, LATER.key}
        assert kept[-1].release is None
        assert ("accelerometer_scale", "derivatives", "gyro_scale") in kept[0].rival.sets
