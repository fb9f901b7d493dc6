"""Channels that repeat each sample until the next one, in a table of a faster recorder."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from airtruth.importers.build import sentences
from airtruth.importers.convert import convert
from airtruth.importers.held import updates, without_repeats
from airtruth.importers.mapping import MappingFile
from airtruth.importers.series import Series
from airtruth.importers.sources import Source

T = np.arange(600) * 0.02


def speed(t):
    return 30.0 + 2.0 * np.sin(0.9 * t) + 0.5 * np.sin(2.3 * t)


def held(hz, t=T, late=0.0, of=speed):
    """Values of an instrument at its own instants, repeated until the next one."""
    return of((np.floor((t - late) * hz + 1e-9)) / hz + late)


@pytest.mark.parametrize("hz", [1.0, 5.0, 10.0, 16.667, 17.0, 25.0, 33.0])
@pytest.mark.parametrize("late", [0.0, 0.013])
def test_the_rate_and_the_instants_of_the_instrument(hz, late):
    made = updates(T, held(hz, late=late))
    assert 1.0 / made.period_s == pytest.approx(hz, rel=3e-3)
    inner = slice(1, -1)
    # an instant is known to the step of the table, and to a small part of it where the rates share no factor
    tolerance = 2.2 * 0.02 * (1.0 if (50.0 / hz).is_integer() else 0.4)
    np.testing.assert_allclose(made.values[inner], speed(made.t_s[inner]), atol=2.95 * tolerance)
    np.testing.assert_allclose(np.diff(made.t_s)[inner], 1.0 / hz, atol=4e-3)


@given(hz=st.floats(1.2, 32.0), late=st.floats(0.0, 0.5), seed=st.integers(0, 99))
@settings(max_examples=40, deadline=None)
def test_any_slower_clock_is_recognised(hz, late, seed):
    noise = np.random.default_rng(seed).standard_normal(2000)
    values = held(hz, late=late, of=lambda t: noise[np.round(t * hz).astype(int)])
    made = updates(T, values)
    assert made is not None
    assert 1.0 / made.period_s == pytest.approx(hz, rel=0.01)


def test_a_channel_of_the_rate_of_the_table_is_none():
    rng = np.random.default_rng(1)
    assert updates(T, speed(T)) is None
    assert updates(T, np.full(600, 3.0)) is None
    assert updates(T, np.round(speed(T) / 0.5) * 0.5) is None  # a coarse reading changes when it likes
    assert updates(T, np.repeat(rng.standard_normal(200), 3)[rng.permutation(600)]) is None
    assert updates(T, np.repeat(rng.standard_normal(120), rng.integers(1, 9, 120))[:600]) is None


def test_steps_of_an_input_are_no_samples_of_a_slow_instrument():
    """A 3-2-1-1 in units of 0.4 s, twice, and a random sequence of steps of 0.1 s: the surface does keep each value."""
    shape = np.repeat([1.0, -1.0, 1.0, -1.0, 0.0], [60, 40, 20, 20, 160])
    twice = np.tile(shape, 2)
    random = np.repeat(np.random.default_rng(2).choice([-1.0, 0.0, 1.0], 120), 5)
    series = {
        "elevator_rad": Series(T, twice),
        "rudder_rad": Series(T, random),
        "elevator_command_rad": Series(T, held(10.0)),
    }
    made, rates = without_repeats(series, None)
    assert rates == {}
    assert all(made[name] is one for name, one in series.items())
    surface = without_repeats({"elevator_rad": Series(T, held(10.0))}, None)
    assert surface[1] == {"elevator_rad": pytest.approx(10.0)}


@pytest.mark.parametrize("resample", [None, {"rate_hz": 50, "method": "cubic"}])
def test_only_the_updates_are_used_and_the_rate_is_stated(resample):
    """Repeats are late by half a period, 29 ms; the updates alone are not."""
    q = 0.1 * np.sin(3.0 * T) + 1e-3 * np.random.default_rng(0).standard_normal(600)
    source = Source(Path("f.csv"), {"t": T, "v": held(17.0), "q": q})
    stated = {
        "time": {"column": "t"},
        "channels": {
            "airspeed_m_s": {"column": "v", "unit": "m/s"},
            "q_rad_s": {"column": "q", "unit": "rad/s"},
        },
    }
    log = convert(source, MappingFile.model_validate(stated | ({"resample": resample} if resample else {})))
    inner = slice(10, -10)
    rows = np.searchsorted(T, log.t_s + T[0] + 1e-9) - 1
    late = (held(17.0) - speed(T))[10:-10].std()
    assert (log.channels["airspeed_m_s"] - speed(T[rows]))[inner].std() < 0.15 * late
    np.testing.assert_allclose(log.channels["q_rad_s"], q[rows], atol=1e-12)
    assert log.metadata["resampled"]["from_hz"] == {"airspeed_m_s": pytest.approx(17.0, rel=2e-3)}
    assert log.metadata["resampled"]["method"] == ("cubic" if resample else "linear")
    assert sentences(log) == [
        "airspeed_m_s: each sample is repeated until the next one, 17 Hz of its own; only these samples are used, and values "
        "between are interpolated"
    ]


def test_each_run_has_a_phase_of_its_own():
    t = np.concatenate([T, T])
    values = np.concatenate([held(17.0), held(17.0, late=0.031)])
    source = Source(Path("f.csv"), {"t": t, "v": values})
    stated = {"time": {"column": "t"}, "channels": {"airspeed_m_s": {"column": "v", "unit": "m/s"}}}
    log = convert(source, MappingFile.model_validate(stated))
    for run in range(2):
        error = log.channels["airspeed_m_s"][log.rows(run)] - speed(T)
        assert error[10:-10].std() < 0.02
