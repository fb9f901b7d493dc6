"""Correlated noise of the sensors enters where the records show it, and not elsewhere."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import trace_records as tr
from scipy.stats import norm

from airtruth.tracing.calibration import noise_colour
from airtruth.tracing.calibration.noise_colour import (
    LATER_LEVEL,
    LEVEL,
    TYPICAL,
    later_level,
    scores,
    share_slopes,
    with_coloured_noise,
)
from airtruth.tracing.inference.causes import DeclaredCauses
from airtruth.tracing.inference.optimise import fit, initial_parameters
from airtruth.tracing.model.parameters import SHORT_PERIOD
from airtruth.tracing.prepare import Case
from airtruth.units import DEG

SHARES = SHORT_PERIOD.common.colour_shares

pytestmark = pytest.mark.slow


def flown(seed, share, amplitudes=(2.0, -2.0), time_s=0.08):
    rng = np.random.default_rng(seed)
    return [
        tr.fly(
            rng,
            sigma_w=0.1,
            amplitude=a * DEG,
            samples=150,
            name=str(a),
            slow_share=share,
            slow_time_s=time_s,
        )
        for a in amplitudes
    ]


def case(seed, share, time_s=0.08):
    records = flown(seed, share, (2.0, -2.0, 3.0), time_s)
    return Case(
        tr.problem(records[:2]), tr.problem(records[2:]), tr.NOTHING, (), (), "linear", (), DeclaredCauses()
    )


def test_scores_of_white_noise_are_no_larger_than_normal():
    """Initial states and biases take up what is slow in a short record, so that the mean of 60 is below none and the
    standard deviation below one, each within four standard errors.
    """
    z = []
    for seed in range(20):
        problem = tr.problem(flown(seed, 0.0))
        slow = replace(problem, settings=replace(problem.settings, coloured=True))
        z.append(scores(slow, fit(problem, tr.NOTHING, initial_parameters(problem, tr.NOTHING))))
    z = np.array(z)
    assert -2.0 < z.mean() < 4.0 / np.sqrt(z.size)
    assert 0.5 < z.std() < 1.0 + 4.0 / np.sqrt(2.0 * z.size)


def test_slope_of_a_share_is_that_of_the_refitted_likelihood():
    """Differences over a share of 0.01 and its half, refitted, extrapolated to none; a search ends within 0.002."""
    problem = tr.problem(flown(4, 0.3, (2.0, -2.0, 3.0)))
    slow = replace(problem, settings=replace(problem.settings, coloured=True))
    null = fit(problem, tr.NOTHING, initial_parameters(problem, tr.NOTHING))
    slope, information = share_slopes(slow, null)

    def rise(place, share):
        common = null.point.common.copy()
        common[place] = share
        again = fit(problem, tr.NOTHING, replace(null.point, common=common))
        return (again.cost - 0.5 * share**2 / 0.5**2 - null.cost) / share

    for i, place in enumerate(range(*SHARES.indices(SHARES.stop))):
        expected = 2.0 * rise(place, 0.005) - rise(place, 0.01)
        assert slope[i] == pytest.approx(expected, abs=0.04 * abs(expected) + 1.5)
        assert abs(slope[i]) > 3.0 * np.sqrt(information[i, i])


def test_white_records_stay_as_they_are():
    white = case(5, 0.0)
    found, start = with_coloured_noise(white)
    assert found is white
    np.testing.assert_array_equal(start.common[SHARES], 0.0)


def test_slow_noise_enters_fitted_and_held_out_records():
    slow = case(5, 0.5)
    found, start = with_coloured_noise(slow)
    assert found.fitted.settings.coloured
    assert found.held is not None
    assert found.held.settings.coloured
    assert (start.common[SHARES] > 0.0).any()
    assert found.fitted.records == slow.fitted.records


def test_typical_score_is_that_of_simulated_records():
    """20 pairs of linear records, flown by another program than the 37 flights behind the constant; each of the 60 scores over
    the root of the samples scatters by about 0.08."""
    found = []
    for seed in range(20):
        problem = tr.problem(flown(seed, 0.5))
        slow = replace(problem, settings=replace(problem.settings, coloured=True))
        null = fit(problem, tr.NOTHING, initial_parameters(problem, tr.NOTHING))
        found.append(scores(slow, null) / np.sqrt(sum(r.samples for r in problem.records)))
    assert np.mean(found) == pytest.approx(TYPICAL, abs=0.03)


def test_less_is_enough_beside_effects_in_a_short_record():
    """Two thirds of the typical score: 0.2 sqrt(400) = 4 in 400 samples; 0.2 sqrt(960) > 6.17, the limit of the first test."""
    assert later_level(400, 3) == pytest.approx(3.0 * norm.sf(4.0))
    assert later_level(100, 3) == LATER_LEVEL
    assert later_level(960, 3) == later_level(100_000, 3) == LEVEL


def test_a_search_does_not_begin_where_the_motion_diverges(monkeypatch):
    """A refit of the declared aircraft ended, not converged, where its derivatives cannot be computed."""
    short = case(5, 0.0)
    ended = SimpleNamespace(converged=False, hypothesis=short.hypothesis, point=None)
    ends = iter([ended, None])
    monkeypatch.setattr(noise_colour, "fit", lambda *args, **options: next(ends))
    found, start = with_coloured_noise(short)
    assert found is short
    np.testing.assert_array_equal(start.vector, initial_parameters(short.fitted, short.hypothesis).vector)


def test_noise_that_nobody_declares_is_no_slow_noise():
    """It would explain whatever the model lacks."""
    slow = case(5, 0.5)
    settings = replace(tr.SETTINGS, noise_prior=1.0)
    slow = replace(slow, fitted=replace(slow.fitted, settings=settings))
    found, start = with_coloured_noise(slow)
    assert found is slow
    np.testing.assert_array_equal(start.common[SHARES], 0.0)


def test_what_is_as_slow_as_a_motion_is_no_noise():
    """A correlation time of a second ends the search at the limit of 0.27 s, and the records stay with white noise."""
    slow = case(5, 0.5, time_s=1.0)
    problem = replace(slow.fitted, settings=replace(slow.fitted.settings, coloured=True))
    white = fit(slow.fitted, tr.NOTHING, initial_parameters(slow.fitted, tr.NOTHING))
    assert scores(problem, white).max() > 5.0
    found, start = with_coloured_noise(slow)
    assert found is slow
    np.testing.assert_array_equal(start.common[SHARES], 0.0)
