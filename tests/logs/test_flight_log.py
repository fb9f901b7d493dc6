"""Stacking runs of one length."""

from __future__ import annotations

import numpy as np
import pytest

from airtruth.logs.flight_log import FlightLog, batches


def test_batches_group_by_length_in_order(log: FlightLog) -> None:
    first, second = batches(log)
    assert first.run_ids == ("a", "c")
    assert second.run_ids == ("b",)
    assert first.dt_s == second.dt_s == pytest.approx(0.02, rel=1e-12)
    assert first.t_s.shape == (2, 30)
    for name, values in log.channels.items():
        np.testing.assert_array_equal(first.channels[name], [values[:30], values[70:]])
        np.testing.assert_array_equal(second.channels[name], [values[30:70]])
        assert first.channels[name].flags.c_contiguous


def test_batches_group_by_sample_period(log: FlightLog) -> None:
    t = log.t_s.copy()
    t[70:] *= 2
    one, _, other = batches(FlightLog({}, log.run_ids, log.offsets, t, log.channels))
    assert one.run_ids == ("a",)
    assert (other.run_ids, other.dt_s) == (("c",), pytest.approx(0.04, rel=1e-12))
