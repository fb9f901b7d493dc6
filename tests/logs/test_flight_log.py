"""A log in memory: stacking, selecting, joining, printing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from airtruth.errors import LogError
from airtruth.logs.flight_log import FlightLog, batches
from airtruth.logs.validate import validate


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


def test_select_runs_and_channels(log: FlightLog) -> None:
    some = log.select(run_ids=("c", "a"), channels=["q_rad_s", "alpha_rad"])
    assert some.run_ids == ("a", "c")
    assert list(some.channels) == ["q_rad_s", "alpha_rad"]
    np.testing.assert_array_equal(some.offsets, [0, 30, 60])
    kept = np.r_[0:30, 70:100]
    np.testing.assert_array_equal(some.t_s, log.t_s[kept])
    np.testing.assert_array_equal(some.channels["q_rad_s"], log.channels["q_rad_s"][kept])
    assert some.metadata == log.metadata
    assert log.select("b").run_ids == ("b",)
    assert list(log.select(channels="q_rad_s").channels) == ["q_rad_s"]


def test_select_all_is_the_log(log: FlightLog) -> None:
    same = log.select()
    np.testing.assert_array_equal(same.t_s, log.t_s)
    np.testing.assert_array_equal(same.offsets, log.offsets)
    assert list(same.channels) == list(log.channels)


def test_select_times_includes_both_ends_and_counts_from_the_first(log: FlightLog) -> None:
    cut = log.select(t_s=(0.1, 0.5))  # samples 5 to 25 of every run at 50 Hz
    np.testing.assert_array_equal(np.diff(cut.offsets), [21, 21, 21])
    np.testing.assert_allclose(cut.t_s[:21], np.arange(21) / 50, atol=1e-12)
    np.testing.assert_array_equal(cut.channels["q_rad_s"][21:42], log.channels["q_rad_s"][35:56])
    validate(cut)


def test_select_of_nothing_is_an_empty_log(log: FlightLog) -> None:
    none = log.select(run_ids=[])
    assert len(none) == len(none.t_s) == 0
    np.testing.assert_array_equal(none.offsets, [0])


@pytest.mark.parametrize(
    ("choice", "message"),
    [
        ({"run_ids": "A"}, r"no run 'A'; the log holds 3 runs, 'a' to 'c'"),
        ({"channels": ["alpha"]}, r"no channel 'alpha'; did you mean 'alpha_rad'"),
        ({"t_s": (0.6, 0.7)}, r"run 'a' has no sample from 0.6 to 0.7 s; it runs from 0 to 0.58 s"),
        ({"t_s": (1.0,)}, r"t_s = \(1.0,\): must be the first and the last time to keep \[s\]"),
        ({"t_s": (0.5, 0.1)}, r"run 'a' has no sample from 0.5 to 0.1 s"),
    ],
)
def test_a_wrong_selection_is_an_error(log: FlightLog, choice: dict, message: str) -> None:
    with pytest.raises(LogError, match=message):
        log.select(**choice)


def test_concat_of_parts_is_the_whole(log: FlightLog) -> None:
    whole = FlightLog.concat([log.select("a"), log.select(["b", "c"])])
    assert whole.run_ids == log.run_ids
    assert whole.metadata == log.metadata
    np.testing.assert_array_equal(whole.offsets, log.offsets)
    np.testing.assert_array_equal(whole.t_s, log.t_s)
    for name, values in log.channels.items():
        np.testing.assert_array_equal(whole.channels[name], values)


def test_concat_keeps_common_metadata_and_the_constants_of_every_record(log: FlightLog) -> None:
    one = replace(log.select("a"), metadata={"aircraft": "gtm", "note": 1, "record_constants": {"a": 5.0}})
    two = replace(log.select("b"), metadata={"aircraft": "gtm", "note": 2, "record_constants": {"b": 6.0}})
    assert FlightLog.concat([one, two]).metadata == {
        "aircraft": "gtm",
        "record_constants": {"a": 5.0, "b": 6.0},
    }


def test_concat_refuses_what_cannot_be_joined(log: FlightLog) -> None:
    with pytest.raises(LogError, match="no log is given"):
        FlightLog.concat([])
    with pytest.raises(LogError, match="run 'a' is in two of the logs"):
        FlightLog.concat([log, log.select("a")])
    fewer = log.select("b", [name for name in log.channels if name != "throttle"])
    with pytest.raises(LogError, match=r"channel 'throttle' is not in all of the logs; select"):
        FlightLog.concat([log.select("a"), fewer])


def test_to_frame_is_the_table_of_the_file(log: FlightLog) -> None:
    frame = log.to_frame()
    assert list(frame.columns) == ["run_id", "t_s", *log.channels]
    assert frame["run_id"].tolist() == ["a"] * 30 + ["b"] * 40 + ["c"] * 30
    np.testing.assert_array_equal(frame["q_rad_s"], log.channels["q_rad_s"])


def test_repr_is_one_short_line(log: FlightLog) -> None:
    assert repr(log) == (
        "FlightLog(3 runs of 0.58 to 0.78 s at 50 Hz, "
        "21 channels: airspeed_m_s, alpha_rad, theta_rad, q_rad_s, ...)"
    )
    assert repr(log.select("a", "q_rad_s")) == "FlightLog(1 run of 0.58 s at 50 Hz, 1 channel: q_rad_s)"
    assert repr(log.select([])).startswith("FlightLog(0 runs, 21 channels: ")


def test_html_lists_channels_with_units(log: FlightLog) -> None:
    page = "".join(log._repr_html_().split())
    assert "<p>Flightlog:3runsof0.58to0.78sat50Hz</p>" in page
    assert f"<td>az_m_s2</td><td>m/s2</td><td>{log.channels['az_m_s2'].min():.4g}</td>" in page
    assert "<td>NaN</td>" in log.select([])._repr_html_()  # no extremes without samples


def test_lists_and_columns_of_frames_become_arrays(log: FlightLog) -> None:
    frame = log.to_frame()
    given = replace(
        log,
        offsets=log.offsets.tolist(),
        t_s=frame["t_s"],
        channels={
            "alpha_rad": frame["alpha_rad"].tolist(),
            "q_rad_s": frame["q_rad_s"].astype("Float64"),
            "throttle": frame["throttle"].astype(object),
        },
    )
    assert given.offsets.dtype == np.int64
    for name, values in given.channels.items():
        assert type(values) is np.ndarray
        np.testing.assert_array_equal(values, log.channels[name])
    np.testing.assert_array_equal(given.t_s, log.t_s)
    assert log.channels["alpha_rad"] is replace(log).channels["alpha_rad"]  # what is right is not copied


def test_values_that_are_no_numbers_are_named(log: FlightLog) -> None:
    with pytest.raises(
        LogError, match=r"throttle: Series does not hold numbers alone .*; give one number per row"
    ):
        replace(log, channels={"throttle": pd.Series(["idle"] * 100)})
