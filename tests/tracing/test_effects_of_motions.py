"""A trace of both motions with candidates of one of them: each motion has its own, and one without any is left out."""

import pytest

from airtruth import aircraft as planes
from airtruth.physics.motion import LATERAL, LONGITUDINAL
from airtruth.tracing import TraceOptions, motions


@pytest.fixture
def parts(monkeypatch):
    """Motions and their candidates for a log that excites both."""
    monkeypatch.setattr(motions, "excited_motions", lambda logs: (LONGITUDINAL, LATERAL))
    monkeypatch.setattr(motions, "_runs", lambda logs, motion: ("r1", "r2"))

    def of(*keys):
        return motions.parts_of([], planes.load("gtm"), TraceOptions(effects=keys or None))

    return of


def test_a_motion_without_a_candidate_is_left_out_and_stated(parts):
    (lateral,) = parts("rudder_delay")
    assert lateral.motion is LATERAL
    assert lateral.folder == ""
    assert lateral.options.effects == ("rudder_delay",)
    assert "longitudinal motion as well, which is not traced" in lateral.notes[0]


def test_each_motion_has_its_own_candidates(parts):
    found = {p.motion.name: p.options.effects for p in parts("rudder_delay", "vane_lag", "mass_error")}
    assert found["lateral"] == ("rudder_delay", "vane_lag", "mass_error")
    assert found["longitudinal"] == ("vane_lag", "mass_error")
    assert [p.options.effects for p in parts()] == [None, None]


def test_a_name_of_no_motion_stays_to_be_refused(parts):
    assert [p.options.effects for p in parts("rudder_delya")] == [("rudder_delya",)] * 2
