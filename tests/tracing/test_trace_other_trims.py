"""Flight conditions of a trace where the declared aircraft cannot fly steadily at the mean airspeed of a record."""

from dataclasses import replace

import numpy as np
import pytest
import trace_flights as flights

from airtruth.effects.registry import EFFECTS
from airtruth.errors import LogError
from airtruth.simulation.trim import trim
from airtruth.tracing import TraceOptions
from airtruth.tracing.conditions import condition_notes
from airtruth.tracing.prepare import prepare

SLOW_M_S = 26.0
"""An airspeed at which the trim of the T2 ends at full throttle."""


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return flights.log_of(flights.fly(tmp_path_factory.mktemp("conditions") / "null"))


def with_airspeed(log, low_m_s, high_m_s):
    """Every record with an airspeed that falls from the higher to the lower value."""
    speed = np.concatenate([np.linspace(high_m_s, low_m_s, log.t_s[log.rows(i)].size) for i in range(3)])
    return replace(log, channels={**log.channels, "airspeed_m_s": speed})


def prepared(log, gtm):
    return prepare([log], gtm, [EFFECTS["gyro_scale"]], TraceOptions())


@pytest.mark.slow
def test_a_trim_at_an_airspeed_that_the_record_passes(log, gtm):
    """The trim is the nearest that exists, and a note states both airspeeds."""
    case = prepared(with_airspeed(log, SLOW_M_S - 10.0, SLOW_M_S + 10.0), gtm)
    notes = [note for note in case.notes if "cannot fly steadily" in note]
    assert [note.split()[0] for note in notes] == list(log.run_ids)
    at = case.fitted.records[0].plant.trim
    assert at is not None
    assert SLOW_M_S < at.airspeed_m_s < SLOW_M_S + 3.0
    where = "mean airspeed of 26 m/s, where the declared aircraft cannot fly steadily"
    assert f"{where}: its forces are those about a trim at {at.airspeed_m_s:.3g} m/s" in notes[0]
    assert trim(gtm, at.condition).alpha_rad == pytest.approx(at.alpha_rad, abs=1e-6)


@pytest.mark.slow
def test_no_airspeed_of_the_record_has_a_trim(log, gtm):
    with pytest.raises(
        LogError, match=r"gtm cannot fly steadily at the 26 m/s .* nor at another airspeed that it reaches"
    ):
        prepared(with_airspeed(log, SLOW_M_S - 1.0, SLOW_M_S + 1.0), gtm)


@pytest.mark.slow
def test_a_record_that_leaves_the_dynamic_pressure_of_its_trim(log, gtm):
    """26 m/s after 54 m/s: 0.42 of the dynamic pressure at their mean of 40 m/s, and (54/40)^2 = 1.8 is nearer to it."""
    notes = [
        note for note in prepared(with_airspeed(log, 26.0, 54.0), gtm).notes if "dynamic pressure" in note
    ]
    assert [note.split()[0] for note in notes] == list(log.run_ids)
    assert "reaches 26 m/s and 0.42 of the dynamic pressure of its trim at 40 m/s" in notes[0]


@pytest.mark.slow
def test_a_record_along_which_the_declared_aircraft_departs(log, gtm):
    """The record that departs is named; a record of the linear model has no flight in JSBSim."""
    first, second = prepared(log, gtm).fitted.records
    (note,) = condition_notes([first, replace(second, remainder=None)])
    assert note.startswith(f"along {second.signals.run_id} the declared aircraft departs in JSBSim")
    linear = replace(second, remainder=None, plant=replace(second.plant, trim=None))
    assert condition_notes([first, linear]) == []


def test_no_note_where_the_aircraft_flies(log, gtm):
    case = prepared(log, gtm)
    assert condition_notes([*case.fitted.records, *case.held.records]) == []
