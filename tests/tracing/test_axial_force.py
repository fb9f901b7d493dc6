"""Increments of the axial force: flown with a drag that is not declared, and with the declared one."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import trace_flights as flights
from tiers import sampled

from airtruth import aircraft as planes
from airtruth.aircraft.write import write_aircraft
from airtruth.physics.atmosphere import air_density
from airtruth.physics.readings import reading_increments
from airtruth.physics.terms import AeroTerm, Change, ReadingTerm, SensorTerm, StateTerm
from airtruth.simulation.probe import forces_over_alpha
from airtruth.simulation.simulator import Condition
from airtruth.simulation.trim import trim
from airtruth.tracing import TraceOptions, trace
from airtruth.tracing.accepted import AcceptedEffect
from airtruth.tracing.answer import DeclaredModel
from airtruth.tracing.axial_force import axial_force
from airtruth.tracing.axial_series import axial_series
from airtruth.tracing.declared_model import with_axial_force
from airtruth.tracing.model.parameters import SHORT_PERIOD
from airtruth.tracing.model.reading import read
from airtruth.tracing.prepare import prepare
from airtruth.tracing.presentation.error_table import axial_words
from airtruth.tracing.stage_errors import AxialErrors, AxialRms
from airtruth.units import FT, KT

BREAK = AeroTerm("CX", "alpha", "above", -0.8, at=0.11)
"""A drag that rises from 6.3 deg on, 2.5 deg above it as much as the declared CX changes over the flown range."""
NOISE_M_S2 = 0.0016 * 9.80665
"""White noise of ax that aircraft/gtm declares."""
STILL = np.zeros(SHORT_PERIOD.per_record.size)
"""Own parameters of a record without biases."""
OWN = {"gtm": (Condition(75 * KT, 7000 * FT), 1e-6), "c172x": (Condition(100 * KT, 4000 * FT), 1e-5)}
"""Condition, and the error over q_bar S: the axial force changes alpha', on which c172x has terms of its own."""


@pytest.fixture(scope="module")
def dragged(tmp_path_factory):
    """Flights of the aircraft with the undeclared drag."""
    folder = tmp_path_factory.mktemp("dragged")
    plane = write_aircraft("gtm", Change(aero=(BREAK,)), folder / "plane")
    return flights.fly(folder / "flights", aircraft=str(plane), runs=6)


@pytest.fixture(scope="module")
def clean(tmp_path_factory):
    """Flights of the declared aircraft."""
    return flights.fly(tmp_path_factory.mktemp("clean"), runs=6)


def shown(log):
    """What ax of a log shows at the declared aircraft, without a search."""
    plane = planes.load("gtm")
    case = prepare([log], plane, (), TraceOptions())
    still = np.zeros((len(case.fitted.records), SHORT_PERIOD.per_record.size))
    held = [SimpleNamespace(per_record=STILL) for _ in (case.held.records if case.held is not None else ())]
    stages = SimpleNamespace(case=case, best="before", held={"before": held})
    nothing = SimpleNamespace(
        hypothesis=case.hypothesis, point=SimpleNamespace(sizes=np.zeros(0), per_record=still)
    )
    return axial_force(stages, [log], plane, nothing)


@pytest.mark.parametrize("name", OWN)
def test_written_terms_are_a_force_along_x_through_the_cg(name, tmp_path):
    """Models with body axes (gtm) and with lift and drag (c172x); expected: q_bar S amplitude (alpha - at)."""
    plane, (at, tolerance) = planes.load(name), OWN[name]
    term = AeroTerm("CX", "alpha", "linear", 0.3, at=0.05)
    changed = planes.load(write_aircraft(plane, Change(aero=(term,)), tmp_path / "changed"))
    start = trim(plane, at)
    alpha = start.alpha_rad + np.array([-0.02, 0.0, 0.03])
    before, after = (forces_over_alpha(p, start, alpha, np.ones(1))[0] for p in (plane, changed))
    force = 0.5 * start.density_kg_m3 * start.airspeed_m_s**2 * plane.constants.wing_area_m2
    along = force * 0.3 * (alpha - 0.05)
    np.testing.assert_allclose(after[:, 0] - before[:, 0], along, rtol=0, atol=tolerance * force)
    np.testing.assert_allclose(after[:, 1:], before[:, 1:], rtol=0, atol=tolerance * force)


@pytest.mark.slow
def test_an_undeclared_drag_is_learned_over_alpha(dragged):
    """The band has to contain the truth at 95 % of the flown angles, counted by samples; exact is -0.8 (alpha - 0.11)."""
    found = shown(flights.log_of(dragged))
    (effect,) = found.increments
    assert (effect.acts_on, effect.over) == ("CX", "alpha_rad")
    table = effect.table
    truth = BREAK.amplitude * np.maximum(np.array(table.at) - BREAK.at, 0.0)
    inside = (truth >= np.array(table.low) - 1e-3) & (truth <= np.array(table.high) + 1e-3)
    assert np.average(inside, weights=table.samples) >= 0.95
    assert effect.p_value < 1e-6
    errors = found.errors
    assert errors.declared.held_out > 6.0 * errors.after.held_out
    assert errors.after.held_out < 2.0 * NOISE_M_S2


@pytest.mark.slow
def test_the_declared_aircraft_lacks_nothing_along_x(clean):
    """What remains is the noise of ax and of the vane: dX/dalpha of 25 m/s2 at 0.031 deg is 0.013 m/s2."""
    found = shown(flights.log_of(clean))
    assert found.increments == ()
    assert found.change == Change()
    assert found.errors.after == found.errors.declared
    assert NOISE_M_S2 < found.errors.declared.held_out < 1.4 * NOISE_M_S2


@pytest.mark.slow
@pytest.mark.parametrize(
    ("term", "state"),
    [
        (ReadingTerm("alpha_rad", "alpha", "linear", 0.05, at=0.1), None),
        (ReadingTerm("alpha_rad", "late", "linear", 0.05, at=0.1), StateTerm("late", "lag", "alpha", 0.1)),
        (
            ReadingTerm("alpha_rad", "qbar", "above", 1e-3, at=800.0, behind="late"),
            StateTerm("late", "lag", "alpha", 0.1),
        ),
    ],
)
def test_readings_that_a_trace_learned_are_undone(clean, term, state):
    """A curve of the vane, one behind a lag, and a lag that changes: the angle of attack of the series lacks the increment."""
    log, plane = flights.log_of(clean, [0]), planes.load("gtm")
    case = prepare([log], plane, (), TraceOptions(hold_out=()))
    whole = replace(case.fitted.records[0], signals=read(log)[0])
    change = Change(readings=(term,), states=() if state is None else (state,))
    (plain,), (undone,) = (axial_series([log], [whole], [STILL], c, plane) for c in (Change(), change))
    signals = {
        name: log.channels[name][None, :] for name in ("alpha_rad", "elevator_rad", "q_rad_s", "airspeed_m_s")
    }
    signals["density_kg_m3"] = air_density(log.channels)[None, :]
    more = reading_increments(change.readings, change.states, signals, plane.constants, plain.dt_s)
    expected = plain.signals["alpha"] - more["alpha_rad"][0]
    np.testing.assert_allclose(undone.signals["alpha"], expected, rtol=0, atol=1e-12)
    assert np.abs(more["alpha_rad"]).max() > 1e-4


@pytest.mark.slow
def test_an_accepted_error_of_the_airspeed_is_undone(clean):
    """An airspeed that reads 10 % more: the same series as that of the right one, where the effect is accepted."""
    log, plane = flights.log_of(clean, [0]), planes.load("gtm")
    case = prepare([log], plane, (), TraceOptions(hold_out=()))
    high = replace(log, channels=log.channels | {"airspeed_m_s": 1.1 * log.channels["airspeed_m_s"]})
    records = [replace(case.fitted.records[0], signals=read(one)[0]) for one in (log, high)]
    change = Change(sensors=(SensorTerm("airspeed_m_s", "scale", 1.1),))
    (right,) = axial_series([log], records[:1], [STILL], Change(), plane)
    (undone,) = axial_series([high], records[1:], [STILL], change, plane)
    np.testing.assert_allclose(undone.y, right.y, rtol=0, atol=1e-9)
    np.testing.assert_allclose(undone.unit_m_s2, right.unit_m_s2, rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("key", "values"),
    sampled(
        [
            ("vane_bias", {"value": 0.02}),
            ("airspeed_scale", {"factor": 1.12}),
            ("vane_scale", {"factor": 1.2}),
            ("mass_error", {"factor": 1.1}),
            ("elevator_effectiveness", {"factor": 0.7}),
            ("rate_limit", {"rate_rad_s": 0.4}),
            ("vane_lag", {"tau_s": 0.1}),
        ],
        7,
    ),
)
def test_other_effects_are_no_axial_force(key, values, tmp_path):
    """What the trace estimates of them is undone: ax beyond the model is the noise of ax and of the vane.

    A bias of the vane of 0.02 rad alone would be 0.1 m/s2. A vane lag of 0.1 s amplifies the vane's noise where it is undone.
    """
    log = flights.fly(tmp_path, [(key, values)], runs=6, duration=6.0, amplitude=3.0)
    answer = trace(log, "gtm", TraceOptions()).to_dict()
    assert all(e.get("acts_on") is None for e in answer["effects"])
    largest = 3.0 if key == "vane_lag" else 1.2
    assert answer["axial_force"]["declared"]["held_out"] < largest * NOISE_M_S2


def test_noise_of_the_vane_is_no_axial_force(clean):
    """0.2 deg of noise, seven times the declared: it is in the residual and in the angle over which it is learned."""
    log = flights.log_of(clean)
    noise = np.random.default_rng(4).normal(0.0, 0.2 * np.pi / 180.0, log.channels["alpha_rad"].size)
    found = shown(replace(log, channels=log.channels | {"alpha_rad": log.channels["alpha_rad"] + noise}))
    assert found.errors.declared.fit > 2.0 * NOISE_M_S2
    assert found.increments == ()


@pytest.mark.slow
@pytest.mark.parametrize("missing", ["ax", "throttle at rest", "records"])
def test_nothing_is_compared_where_ax_says_nothing(clean, missing):
    log = flights.log_of(clean, [0, 1, 2] if missing == "records" else None)
    channels = dict(log.channels)
    if missing == "ax":
        del channels["ax_m_s2"]
    if missing == "throttle at rest":
        channels["throttle"] = np.linspace(0.2, 0.6, log.t_s.size)
    assert shown(replace(log, channels=channels)) is None


def test_the_declared_model_is_contradicted_by_its_axial_force():
    consistent = DeclaredModel(True, 5.0, 6, 0.5, {}, "the derivatives")
    increment = AcceptedEffect("increment", {}, 1e-8, 4.0, acts_on="CX", gain_2_log_likelihood=36.8)
    found = with_axial_force(consistent, (increment,))
    assert not found.consistent
    assert (found.p_value, found.statistic, found.where) == (2e-8, 36.8, "the axial force")
    assert with_axial_force(consistent, ()) == consistent


@pytest.mark.slow
def test_the_updated_aircraft_flies_with_the_drag(dragged, tmp_path):
    """Traced again from the updated aircraft, the same records show nothing along x; the file states the band."""
    result = trace(dragged, "gtm", TraceOptions(), tmp_path)
    answer = result.to_dict()
    assert answer["verdict"] == "learned"
    assert not answer["provisional"]
    assert not answer["declared_model"]["consistent"]
    assert "RMS of ax beyond the declared model" in result.details()
    assert "95 % band of increment:CX over alpha_rad" in (tmp_path / "aircraft/gtm/gtm.xml").read_text()
    again = trace(dragged, answer["updated_aircraft"], TraceOptions()).to_dict()
    assert again["verdict"] == "none"
    declared = (a["axial_force"]["declared"]["held_out"] for a in (answer, again))
    assert next(declared) > 6.0 * next(declared)


def test_the_errors_in_words():
    held, alone = (
        AxialErrors(AxialRms(0.2, 0.16), AxialRms(0.03, 0.024)),
        AxialErrors(AxialRms(0.2), AxialRms(0.2)),
    )
    assert axial_words(held) == (
        "RMS of ax beyond the declared model on held-out records 0.160 m/s2, with the increment of CX 0.0240 m/s2."
    )
    assert axial_words(alone) == "RMS of ax beyond the declared model on fitted records 0.200 m/s2."
