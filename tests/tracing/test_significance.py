"""Gains that a refit has to reach, against the quantiles of chi-square and on records of sensors with wrong scales."""

import math
from dataclasses import replace

import pytest
import trace_records as tr
from scaled_records import disturbed_problem

from airtruth.effects.registry import EFFECTS
from airtruth.tracing.inference.hypothesis_test import HypothesisTest
from airtruth.tracing.inference.optimise import initial_parameters
from airtruth.tracing.inference.robust import inflation
from airtruth.tracing.selection import acceptance
from airtruth.tracing.selection.search import search
from airtruth.tracing.selection.set_table import SetTable
from airtruth.tracing.selection.significance import (
    FAMILY_LEVEL,
    LATER_FAMILY_LEVEL,
    MISFIT_FAMILY_LEVEL,
    later_gain,
    significant_gain,
)


@pytest.mark.parametrize(
    ("level", "gain"), [(FAMILY_LEVEL, 10.0), (LATER_FAMILY_LEVEL, 16.0), (MISFIT_FAMILY_LEVEL, 25.0)]
)
def test_the_gains_of_33_candidates_are_round(level, gain):
    """The survival function of chi-square with one degree of freedom is erfc(sqrt(x / 2))."""
    assert significant_gain(33, level) == pytest.approx(gain, abs=1e-8)
    assert level == pytest.approx(33 * math.erfc(math.sqrt(0.5 * gain)), rel=1e-9)


@pytest.mark.parametrize(("p_value", "gain"), [(1.0, 16.0), (1e-6, 16.0), (9e-7, 25.0), (0.0, 25.0)])
def test_beside_an_anomaly_beyond_doubt_a_later_effect_needs_more(p_value, gain):
    assert later_gain(33, HypothesisTest("alpha_rad", 50.0, 1, p_value)) == pytest.approx(gain, abs=1e-8)


CANDIDATES = tuple(EFFECTS[key] for key in ("gyro_scale", "vane_scale", "accelerometer_scale"))


@pytest.mark.slow
@pytest.mark.parametrize(("gyro", "sinusoid_rad", "accepted"), [(1.027, 0.0, True), (1.04, 0.003, False)])
def test_a_small_second_effect_is_accepted_unless_an_anomaly_is_beyond_doubt(gyro, sinusoid_rad, accepted):
    """Its gain is between the two limits of three candidates, 11.5 and 20.4."""
    problem = disturbed_problem([1.0, gyro, 1.15], 0, sinusoid_rad)
    start = initial_parameters(problem, tr.NOTHING)
    rounds = search(SetTable(problem), tr.NOTHING, start, CANDIDATES, 1)
    (gain,) = (c.gain for c in rounds[1].candidates if c.score.effect.key == "gyro_scale")
    low, high = (significant_gain(3, level) for level in (LATER_FAMILY_LEVEL, MISFIT_FAMILY_LEVEL))
    assert low < gain < high
    keys = [e.key for e in rounds[-1].null.hypothesis.effects]
    assert keys == ["accelerometer_scale", *(["gyro_scale"] if accepted else [])]


@pytest.mark.slow
@pytest.mark.parametrize(("count", "unbiased"), [(2, True), (3, False)])
def test_with_one_or_two_records_the_variance_is_unbiased(count, unbiased, monkeypatch):
    asked = []

    def spy(problem, fitted, unbiased=False):
        asked.append(unbiased)
        return inflation(problem, fitted, unbiased)

    monkeypatch.setattr(acceptance, "inflation", spy)
    problem = disturbed_problem([1.0, 1.0, 1.15], 0, 0.0)
    problem = replace(problem, records=problem.records[:count])
    search(SetTable(problem), tr.NOTHING, initial_parameters(problem, tr.NOTHING), CANDIDATES, 1)
    assert set(asked) == {unbiased}
