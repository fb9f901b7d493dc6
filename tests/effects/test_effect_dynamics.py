"""What a static probe does not see, from a change to aircraft.toml and back."""

import numpy as np
import pytest

from airtruth import aircraft as planes
from airtruth.aircraft import Dynamics
from airtruth.effects.change import AeroTerm, Change, StateTerm, SurfaceTerm
from airtruth.effects.dynamics import declared_dynamics, joined
from airtruth.effects.writing import write_aircraft

SURFACE = (SurfaceTerm("delay", 0.02), SurfaceTerm("rate_limit", 0.5))
MODE = StateTerm("mode", "mode", "alpha", 0.05, 0.1)
OF_MODE = AeroTerm("Cm", "mode", "linear", 0.3, 0.02)
DOT = AeroTerm("Cm", "alpha_dot_hat", "linear", -9.0)
STATIC = AeroTerm("Cm", "alpha", "above", -0.4, 0.1)
CHANGE = Change(surface=SURFACE, states=(MODE,), aero=(OF_MODE, DOT, STATIC))


def test_forces_at_rest_are_left_out_and_nothing_is_nothing():
    found = joined(None, CHANGE)
    assert found is not None
    assert [(r.coefficient, r.signal) for r in found.aero] == [("Cm", "mode"), ("Cm", "alpha_dot_hat")]
    assert joined(None, Change(aero=(STATIC,))) is None
    assert declared_dynamics(None) == Change()


def test_as_a_change_it_does_nothing_at_rest():
    """A state equals what drives it there, so that its term and the one taken off cancel; the rate is none."""
    change = declared_dynamics(joined(None, CHANGE))
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
    once = joined(None, CHANGE)
    twice = joined(once, CHANGE)
    assert [r.value for r in twice.surface] == [0.02, 0.5, 0.02, 0.5]
    assert [r.name for r in twice.states] == ["mode", "mode_2"]
    assert [r.signal for r in twice.aero] == ["mode", "alpha_dot_hat", "mode_2", "alpha_dot_hat"]


def test_the_file_says_it_to_the_last_bit(tmp_path):
    third = CHANGE.states[0].time_s / 3.0
    change = Change(
        surface=(SurfaceTerm("lag", np.pi / 100.0),),
        states=(StateTerm("x", "lag", "elevator", third),),
        aero=(AeroTerm("CL", "x", "linear", 0.1),),
    )
    folder = write_aircraft("gtm", change, tmp_path / "gtm")
    found = planes.load(folder).file.dynamics
    assert found == joined(None, change)
    assert found.surface[0].value == np.pi / 100.0
    again = write_aircraft(folder, CHANGE, tmp_path / "again")
    assert planes.load(again).file.dynamics == joined(found, CHANGE)
    assert planes.load("gtm").file.dynamics is None
    assert Dynamics() == Dynamics(surface=(), states=(), aero=())
