"""Increments of readings: in the filter, in the flown log, in the updated aircraft, and learned from records."""

from dataclasses import replace

import numpy as np
import pytest
import trace_flights as flights
import trace_records as tr

from airtruth import aircraft
from airtruth.aircraft.write import write_aircraft
from airtruth.effects.increment import Memory, Shape, increment
from airtruth.physics.readings import reading_increments, state_of
from airtruth.physics.terms import Change, ReadingTerm, StateTerm
from airtruth.tracing import TraceOptions, trace
from airtruth.tracing.compensate import Compensation, RunCondition, compensated_log
from airtruth.tracing.inference.optimise import initial_parameters
from airtruth.tracing.model.parameters import SHORT_PERIOD
from airtruth.tracing.model.records import FINE
from airtruth.tracing.model.response import respond
from airtruth.units import DEG, KT

MODE = StateTerm("bending", "mode", "elevator", 1.0 / (2.0 * np.pi * 7.0), 0.04)
SHARE = 0.6
BENDING = Change(
    states=(MODE,),
    readings=(
        ReadingTerm("q_rad_s", "bending", "linear", SHARE),
        ReadingTerm("q_rad_s", "elevator", "linear", -SHARE),
    ),
)


def read(problem, change):
    """Innovations of the first record in calm air, where the filter does not correct its motion."""
    start = initial_parameters(problem, tr.NOTHING)
    start.per_record[0, SHORT_PERIOD.per_record.log_gust] = np.log(1e-6)
    return respond(problem.records[0], problem.settings, change, start.common, start.per_record[0]).e


@pytest.mark.parametrize(("channel", "output"), [("q_rad_s", 1), ("az_m_s2", 2)])
def test_the_filter_adds_a_mode_to_one_reading(channel, output):
    """The innovation changes by the increment of the surface."""
    one = tr.fly(np.random.default_rng(1), amplitude=2.0 * DEG, sigma_w=0.0, name="a")
    problem = tr.problem([one])
    slow = Memory("mode", 0.2, 0.3)
    shape = Shape(channel, "elevator", -0.05, 0.05, 0, 0.0, slow)
    change = increment(shape).describe({"share": 0.3, "time_s": 0.2, "damping": 0.3})
    s = one.signals
    fine_s = s.dt_s / (s.sub * FINE)
    state = state_of(change.states[0], s.elevator_rad[None, :], fine_s)[0]
    expected = 0.3 * (state - s.elevator_rad)[:: s.sub * FINE]
    moved = read(problem, Change()) - read(problem, change)
    np.testing.assert_allclose(moved[:, output], expected, atol=1e-3 * np.abs(expected).max())


def test_the_filter_changes_the_lag_of_the_vane_with_the_dynamic_pressure():
    """The innovation changes by the increment of `reading_increments`, along the predicted angle of attack."""
    one = tr.fly(np.random.default_rng(1), amplitude=2.0 * DEG, sigma_w=0.0, name="a")
    speed = one.signals.airspeed_m_s * np.linspace(1.0, 1.04, one.signals.airspeed_m_s.size)
    one = replace(one, signals=replace(one.signals, airspeed_m_s=speed))
    problem, s = tr.problem([one]), one.signals
    pressure = 0.5 * s.density_kg_m3 * speed**2
    shape = Shape(
        "alpha_rad", "qbar", pressure[0], pressure[-1], 4, pressure.mean(), Memory("lag", 0.1), "alpha", 0.0
    )
    change = increment(shape).describe({"bend_1": -0.2, "bend_2": 0.0, "bend_3": -0.1})
    start = initial_parameters(problem, tr.NOTHING)
    start.per_record[0, SHORT_PERIOD.per_record.log_gust] = np.log(1e-6)
    alpha = s.y[:, 0] - respond(one, problem.settings, Change(), start.common, start.per_record[0]).e[:, 0]
    truth = {
        "alpha_rad": alpha[None, :],
        "elevator_rad": np.zeros((1, alpha.size)),
        "q_rad_s": np.zeros((1, alpha.size)),
        "airspeed_m_s": speed[None, :: s.sub],
        "density_kg_m3": s.density_kg_m3[None, :: s.sub],
    }
    constants = one.plant.aircraft.constants
    expected = reading_increments(change.readings, change.states, truth, constants, s.dt_s)["alpha_rad"][0]
    moved = read(problem, Change()) - read(problem, change)
    assert np.abs(expected).max() > 1e-4
    np.testing.assert_allclose(moved[:, 0], expected, atol=0.02 * np.abs(expected).max())
    assert np.abs(moved[:, 1:]).max() < 1e-9


@pytest.mark.slow
def test_the_flown_log_and_the_updated_aircraft_have_the_increment(tmp_path):
    """A campaign of the written aircraft less one of the declared aircraft, both without noise."""
    folder = write_aircraft(aircraft.load("gtm"), BENDING, tmp_path / "bending")
    assert aircraft.load(folder).file.dynamics.readings == BENDING.readings
    logs = {}
    for name, plane in (("declared", "gtm"), ("bending", str(folder))):
        place = flights.fly(tmp_path / name, aircraft=plane, runs=1, gust=flights.CALM)
        logs[name] = flights.log_of(place)
    elevator = logs["declared"].channels["elevator_rad"].astype(float)
    difference = {c: logs["bending"].channels[c] - x for c, x in logs["declared"].channels.items()}
    moving = np.abs(np.gradient(elevator)) > 1e-3
    assert np.abs(difference["q_rad_s"][moving]).max() > 0.2 * SHARE * np.abs(np.diff(elevator)).max()
    # the noise of both logs is the same: it is drawn from seed and run alone
    assert all(np.abs(d).max() < 1e-6 for c, d in difference.items() if c != "q_rad_s")


@pytest.mark.long
def test_the_loop_takes_the_increment_out_of_the_records(tmp_path):
    folder = write_aircraft(aircraft.load("gtm"), BENDING, tmp_path / "bending")
    clean, bent = (
        flights.log_of(flights.fly(tmp_path / name, aircraft=plane, runs=1, gust=flights.CALM))
        for name, plane in (("declared", "gtm"), ("bent", str(folder)))
    )
    taken = Compensation((RunCondition(40.0, tr.TRUTH),), readings=BENDING.readings, states=BENDING.states)
    mended = compensated_log(bent, aircraft.load("gtm").constants, taken)
    before, after = (np.std(log.channels["q_rad_s"] - clean.channels["q_rad_s"]) for log in (bent, mended))
    # the surface between the samples, on which a mode of 7 Hz depends, and its noise remain
    assert after < 0.6 * before


@pytest.mark.long
def test_a_mode_at_the_gyro_is_learned_and_written(tmp_path):
    folder = write_aircraft(aircraft.load("gtm"), BENDING, tmp_path / "bending")
    place = flights.fly(tmp_path, aircraft=str(folder), runs=6, seed=3, amplitude=2.5, gust=flights.CALM)
    answer = trace(place, "gtm", TraceOptions(), tmp_path / "out").answer
    assert answer.verdict == "learned"
    (effect,) = answer.effects
    assert (effect.acts_on, effect.over) == ("q_rad_s", "elevator_rad")
    for name, truth in (("share", SHARE), ("time_s", MODE.time_s), ("damping", MODE.damping)):
        estimate = effect.parameters[name]
        assert abs(estimate.value - truth) < 3.0 * estimate.std, name
    updated = aircraft.load(tmp_path / "out" / "aircraft" / "gtm").file.dynamics
    assert {t.channel for t in updated.readings} == {"q_rad_s"}


@pytest.mark.long
def test_a_lag_of_the_vane_that_falls_with_the_airspeed_is_learned(tmp_path):
    """A distance constant of 6 m, flown as a constant lag at each of three airspeeds; one cause, and nothing beside it."""
    truth_s, places = {}, []
    for eas_kt in (65.0, 78.0, 95.0):
        lag_s = 6.0 / (eas_kt * KT / np.sqrt(0.81))
        name = f"eas{eas_kt:.0f}"
        effects = [("vane_lag", {"tau_s": lag_s})]
        place = flights.fly(tmp_path / name, effects, name=name, runs=3, seed=11, amplitude=2.5, eas=eas_kt)
        pressure = 0.5 * 1.225 * (eas_kt * KT) ** 2
        truth_s[pressure] = lag_s
        places.append(str(place))
    options = TraceOptions(effects=("vane_lag", "gyro_lag", "elevator_delay"), increments=True)
    answer = trace(places, "gtm", options, tmp_path / "out").answer
    assert {e.key for e in answer.effects} == {
        "vane_lag",
        "increment:alpha_rad by a lag of alpha_rad over qbar_pa",
    }
    named, learned = sorted(answer.effects, key=lambda e: e.name, reverse=True)
    (state,), table = learned.states, learned.table
    for pressure, lag_s in truth_s.items():
        change = np.interp(pressure, table.at, table.value) * state.time_s
        assert named.parameters["tau_s"].value + change == pytest.approx(lag_s, rel=0.05)
    updated = aircraft.load(tmp_path / "out" / "aircraft" / "gtm").file.dynamics
    assert {t.behind for t in updated.readings} == {s.name for s in updated.states}
