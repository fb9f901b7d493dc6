"""What a static probe does not see, from a change to aircraft.toml and back."""

from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError

from airtruth import aircraft as planes
from airtruth.aircraft import Dynamics
from airtruth.aircraft.dynamics import declared_dynamics, with_change
from airtruth.aircraft.neutral import effective
from airtruth.aircraft.write import write_aircraft
from airtruth.physics.terms import AeroTerm, Change, ReadingTerm, StateTerm, SurfaceTerm
from airtruth.quantity import explain

SURFACE = (SurfaceTerm("delay", 0.02), SurfaceTerm("rate_limit", 0.5))
MODE = StateTerm("mode", "mode", "alpha", 0.05, 0.1)
OF_MODE = AeroTerm("Cm", "mode", "linear", 0.3, 0.02)
DOT = AeroTerm("Cm", "alpha_dot_hat", "linear", -9.0)
STATIC = AeroTerm("Cm", "alpha", "above", -0.4, 0.1)
CHANGE = Change(surface=SURFACE, states=(MODE,), aero=(OF_MODE, DOT, STATIC))


def test_forces_at_rest_are_left_out_and_nothing_is_nothing():
    found = with_change(None, CHANGE)
    assert found is not None
    assert [(r.coefficient, r.signal) for r in found.aero] == [("Cm", "mode"), ("Cm", "alpha_dot_hat")]
    assert with_change(None, Change(aero=(STATIC,))) is None
    assert declared_dynamics(None) == Change()


def test_as_a_change_it_does_nothing_at_rest():
    """A state equals what drives it there, so that its term and the one taken off cancel; the rate is none."""
    change = declared_dynamics(with_change(None, CHANGE))
    assert change.surface == SURFACE
    (state,) = change.states
    drives = {state.name: state.signal}
    for alpha in (0.0, 0.07, -0.2):
        values = {"alpha": alpha, "alpha_dot_hat": 0.0}
        total = sum(
            t.amplitude * (values[drives.get(t.signal, t.signal)] - t.at)
            for t in change.aero
            if t.signal != "alpha_dot_hat"
        )
        assert total == pytest.approx(0.0, abs=1e-15)
    assert DOT in change.aero


def test_a_second_change_stands_behind_the_first_under_a_name_of_its_own():
    once = with_change(None, CHANGE)
    twice = with_change(once, CHANGE)
    assert [r.value for r in twice.surface] == [0.02, 0.5, 0.02, 0.5]
    assert [r.name for r in twice.states] == ["mode", "mode_2"]
    assert [r.signal for r in twice.aero] == ["mode", "alpha_dot_hat", "mode_2", "alpha_dot_hat"]


def test_a_reading_keeps_the_state_that_multiplies_it(tmp_path):
    """Through the neutral terms, the file, a second change and the declared dynamics."""
    lag = StateTerm("late", "lag", "alpha", 0.1)
    change = Change(
        states=(lag,), readings=(ReadingTerm("alpha_rad", "qbar", "above", -2e-4, 900.0, behind="late"),)
    )
    assert effective(change) == change
    once = planes.load(write_aircraft("gtm", change, tmp_path / "once")).file.dynamics
    assert (once.states, once.readings) == (change.states, change.readings)
    twice = with_change(once, change)
    assert [r.behind for r in twice.readings] == ["late", "late_2"]
    declared = declared_dynamics(twice)
    assert [r.behind for r in declared.readings] == [s.name for s in declared.states]


def test_a_bend_without_a_slope_is_an_end_of_a_table_beside_other_bends_and_nothing_alone():
    end = replace(STATIC, amplitude=0.0, at=0.2)
    assert effective(Change(aero=(STATIC, end))).aero == (STATIC, end)
    assert effective(Change(aero=(end,))).aero == ()
    elsewhere = replace(end, coefficient="CL")
    assert effective(Change(aero=(STATIC, elsewhere))).aero == (STATIC,)


def test_the_file_says_it_to_the_last_bit(tmp_path):
    third = CHANGE.states[0].time_s / 3.0
    change = Change(
        surface=(SurfaceTerm("lag", np.pi / 100.0),),
        states=(StateTerm("x", "lag", "elevator", third),),
        aero=(AeroTerm("CL", "x", "linear", 0.1),),
    )
    folder = write_aircraft("gtm", change, tmp_path / "gtm")
    found = planes.load(folder).file.dynamics
    assert found == with_change(None, change)
    assert found.surface[0].value == np.pi / 100.0
    again = write_aircraft(folder, CHANGE, tmp_path / "again")
    assert planes.load(again).file.dynamics == with_change(found, CHANGE)
    assert planes.load("gtm").file.dynamics is None
    assert Dynamics() == Dynamics(surface=(), states=(), aero=())


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ({"kind": "delay", "value": 0.0}, "surface delay: value has to be above 0 (is 0)"),
        ({"kind": "dely", "value": 0.1}, "surface.0.kind: Input should be 'delay', 'lag'"),
        ({"kind": "delay", "valu": 0.1}, "surface.0.valu: unknown key; did you mean 'value'?"),
    ],
)
def test_a_wrong_surface_is_refused_with_the_cure(row, message):
    with pytest.raises(ValidationError) as caught:
        Dynamics.model_validate({"surface": [row]})
    assert message in "; ".join(explain(caught.value, Dynamics))


LATE = {"name": "late", "kind": "lag", "signal": "alpha", "time_s": 0.1}
READING = {"channel": "alpha_rad", "signal": "qbar", "shape": "linear", "amplitude": 1e-4}
AERO = {"coefficient": "Cm", "signal": "alpha_dot_hat", "shape": "linear", "amplitude": -9.0}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"states": [LATE | {"signal": "qbar"}]},
            "state late: signal 'qbar': allowed: aileron, alpha, alpha_dot_hat, beta",
        ),
        (
            {"aero": [AERO | {"signal": "alpha_dot"}]},
            "aero Cm: signal 'alpha_dot': did you mean 'alpha_dot_hat'",
        ),
        ({"aero": [AERO | {"factor": "qbar"}]}, "aero Cm: factor 'qbar': allowed: alpha, elevator, qhat"),
        ({"readings": [READING | {"signal": "alpha_dot_hat"}]}, "readings alpha_rad: signal 'alpha_dot_hat'"),
        (
            {"readings": [READING | {"behind": "lat"}]},
            "readings alpha_rad: behind 'lat': did you mean 'late'?",
        ),
        (
            {"states": [LATE | {"signal": "alpha_dot_hat"}], "readings": [READING | {"signal": "late"}]},
            "readings alpha_rad: signal 'late': allowed: alpha, elevator, qbar, qhat",
        ),
        ({"states": [], "readings": [READING | {"behind": "late"}]}, "behind 'late': declare it in states"),
    ],
)
def test_a_name_that_is_unknown_is_refused_with_those_that_exist(change, message):
    Dynamics.model_validate({"states": [LATE], "aero": [AERO], "readings": [READING | {"behind": "late"}]})
    with pytest.raises(ValidationError) as caught:
        Dynamics.model_validate({"states": [LATE]} | change)
    assert message in "; ".join(explain(caught.value, Dynamics))
