"""The aircraft and the flight condition that `airtruth plan --from` takes from a trace."""

import shutil

import numpy as np
import pytest

from airtruth import aircraft
from airtruth.aircraft.corrected import write_corrected
from airtruth.aircraft.jsbsim.short_period import TrimPoint
from airtruth.design import from_files
from airtruth.design.flight import PlanOptions
from airtruth.errors import AircraftError, ConfigurationError
from airtruth.logs.histories import FILE, Histories, History, write_histories
from airtruth.logs.provenance import PROVENANCE, Provenance, aircraft_digests
from airtruth.physics.terms import Change
from airtruth.tracing.answer import ANSWER
from airtruth.tracing.update import WITHOUT_EFFECTS
from validation import small_aircraft as small

CHANNELS = ("alpha_rad", "q_rad_s", "az_m_s2")


def traced(folder, plane, rate_hz=50.0):
    """A folder as a trace leaves it, with one record of a second."""
    t = np.arange(round(rate_hz)) / rate_hz
    series = {name: np.zeros(len(t)) for name in CHANNELS}
    conditions = {
        "airspeed_m_s": 42.85,
        "density_kg_m3": 0.9931,
        "altitude_m": 2133.6,
        "sample_rate_hz": rate_hz,
    }
    record = History(
        "r1", "fitted", t, {"elevator_rad": t}, series, {"before": series}, conditions=conditions
    )
    origin = Provenance("1", plane.name, {}, aircraft_digests(plane.folder), str(plane.folder.resolve()))
    folder.mkdir()
    write_histories(folder / FILE, Histories((record,), ("before",), "r1", 1, {PROVENANCE: origin.to_dict()}))
    (folder / ANSWER).write_text("{}")
    return folder


@pytest.fixture
def planned(monkeypatch):
    """What the planner would be given."""
    given = []

    def narrow(base, question, options, declared, step):
        given.append((base, declared))
        raise ConfigurationError("no search in this test")

    monkeypatch.setattr(from_files, "narrow", narrow)

    def ask(folder, out=None):
        with pytest.raises(ConfigurationError, match="no search"):
            from_files.planned_from(
                None, from_files.Request(derivatives=("Cmq",), trace=folder), None, PlanOptions(), out
            )
        return given[-1]

    return ask


@pytest.fixture
def own(tmp_path):
    """A copy of a shipped aircraft, under the name of its source."""
    folder = tmp_path / "own" / "gtm"
    shutil.copytree(aircraft.load("gtm").folder, folder)
    return aircraft.load(str(folder))


def test_a_trace_of_a_copy_plans_for_the_copy(tmp_path, own, planned):
    base, declared = planned(traced(tmp_path / "t", own))
    assert declared.folder.resolve() == own.folder.resolve()
    assert base.aircraft == str(own.folder.resolve())


def test_a_shipped_aircraft_is_stated_by_its_name(tmp_path, planned):
    base, _ = planned(traced(tmp_path / "t", aircraft.load("gtm")))
    assert base.aircraft == "gtm"


def test_the_name_of_any_file_is_made_one_that_a_campaign_accepts(tmp_path, planned):
    out = tmp_path / "made before the search" / "my plan.toml"
    base, _ = planned(traced(tmp_path / "t", aircraft.load("gtm")), out)
    assert base.name == "my-plan"
    assert out.parent.is_dir()


def test_an_aircraft_that_changed_since_is_refused(tmp_path, own):
    folder = traced(tmp_path / "t", own)
    file = own.folder / "aircraft.toml"
    file.write_text(file.read_text() + "\n# heavier\n")
    with pytest.raises(
        ConfigurationError, match=r"aircraft\.toml is not the file of the trace; state --aircraft"
    ):
        from_files.planned_from(
            None, from_files.Request(derivatives=("Cmq",), trace=folder), None, PlanOptions()
        )


@pytest.mark.parametrize("rate", [62.5, 33.333, 12.5, 49.98, 100.0])
def test_a_trace_at_any_rate_gives_a_campaign(tmp_path, planned, rate):
    base, _ = planned(traced(tmp_path / "t", aircraft.load("gtm"), rate))
    assert base.log_hz == rate
    assert base.simulation_hz >= 150.0


def test_an_aircraft_without_a_model_flies_in_the_form_that_its_trace_wrote(tmp_path, planned):
    (tmp_path / "small").mkdir()
    plane = small.declared(tmp_path / "small")
    folder = traced(tmp_path / "t", plane)
    at = TrimPoint(small.AIRSPEED_M_S, small.DENSITY_KG_M3, 0.05, -0.02)
    flying = folder / WITHOUT_EFFECTS / plane.name
    write_corrected(plane, plane.file.derivatives, at, Change(), flying)
    base, declared = planned(folder)
    assert declared.file.jsbsim is not None
    assert base.aircraft == str(flying.resolve())


def test_an_aircraft_without_a_model_is_told_so_before_a_campaign_is_asked_for(tmp_path):
    """A campaign would be refused in the next step."""
    shutil.copy(aircraft.load("gtm").folder / "aircraft.toml", tmp_path)
    stated = from_files.Request(derivatives=("Cmq",))
    with pytest.raises(
        AircraftError, match=r"has no JSBSim model to fly.*`airtruth aircraft new` writes one"
    ):
        from_files.planned_from(None, stated, str(tmp_path), PlanOptions(), None)


def test_a_condition_is_asked_for_with_every_option(tmp_path):
    with pytest.raises(ConfigurationError, match="--aircraft gtm --eas-kt SPEED --altitude-ft ALTITUDE"):
        from_files.planned_from(None, from_files.Request(derivatives=("Cmq",)), "gtm", PlanOptions(), None)
