"""Random streams: reproducible, and independent over seeds, runs and purposes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from airtruth.simulation.campaign import streams

N = 4000
PURPOSES = [streams.GUST, streams.SIDE_GUST, *streams.SENSORS.values()]


@given(seed=st.integers(0, 2**63 - 1), run=st.integers(0, 10_000_000), purpose=st.sampled_from(PURPOSES))
@settings(max_examples=50)
def test_a_stream_is_the_same_again_and_a_longer_one_begins_with_it(seed, run, purpose):
    first = streams.normals(seed, run, purpose, 20)
    np.testing.assert_array_equal(first, streams.normals(seed, run, purpose, 20))
    np.testing.assert_array_equal(first, streams.normals(seed, run, purpose, 50)[:20])


def test_all_streams_of_neighbouring_seeds_runs_and_purposes_are_uncorrelated():
    keys = [(s, r, p) for s in (0, 1, 2**62) for r in (0, 1, 255, 256) for p in (0, 1, 2, 11)]
    draws = np.stack([streams.normals(*key, N) for key in keys])
    for lag in (0, 1):
        correlation = draws[:, : N - lag] @ draws[:, lag:].T / (N - lag)
        if lag == 0:
            np.fill_diagonal(correlation, 0.0)
        # 48 streams, 2304 pairs a lag: 5.5 standard errors are passed with probability 1e-4.
        assert np.abs(correlation).max() < 5.5 / np.sqrt(N)


def test_draws_are_standard_normal():
    x = np.concatenate([streams.normals(7, run, streams.GUST, N) for run in range(25)])
    assert abs(x.mean()) < 4 / np.sqrt(len(x))
    assert abs(x.var() - 1) < 4 * np.sqrt(2 / len(x))
    assert abs((x**4).mean() - 3) < 4 * np.sqrt(96 / len(x))


def test_purposes_are_distinct_and_fit():
    assert len(set(PURPOSES)) == len(PURPOSES)
    # Two purposes of one run, and the last purpose of a run and the first of the next, differ.
    assert not np.array_equal(streams.normals(1, 0, max(PURPOSES), 5), streams.normals(1, 1, 0, 5))


@pytest.mark.parametrize("count", [1, 7])
def test_plan_draws_of_a_quantity_do_not_depend_on_another(count):
    wind = streams.plan_stream(5, "wind").standard_normal(count)
    streams.plan_stream(5, "eas").random(100)
    np.testing.assert_array_equal(wind, streams.plan_stream(5, "wind").standard_normal(count))
    assert not np.array_equal(wind, streams.plan_stream(5, "eas").standard_normal(count))
    assert not np.array_equal(wind, streams.plan_stream(6, "wind").standard_normal(count))
