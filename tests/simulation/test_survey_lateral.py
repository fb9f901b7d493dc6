"""Aileron and rudder of JSBSim models: found by the motion that they cause, flown in six axes."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from airtruth import aircraft
from airtruth.aircraft import JsbsimModel
from airtruth.aircraft.jsbsim.confine import model_files
from airtruth.aircraft.model import ElevatorProperties, ThrottleProperties
from airtruth.aircraft.probe import wheel_root
from airtruth.logs.verify import verify
from airtruth.physics.motion import LATERAL
from airtruth.simulation.campaign import plan
from airtruth.simulation.flight import Flight, Inputs, LateralInputs
from airtruth.simulation.foreign_aircraft import LATERAL_CAMPAIGN, new_from_jsbsim
from airtruth.simulation.linearise import linearise
from airtruth.simulation.manoeuvres import Manoeuvre, sample
from airtruth.simulation.simulator import Condition
from airtruth.simulation.survey import bench as benches
from airtruth.simulation.survey.controls import feedback_rad, with_controls
from airtruth.simulation.survey.names import names_of
from airtruth.simulation.trim import trim
from airtruth.units import DEG, FT, KT

AIRCRAFT = Path(__file__).resolve().parents[2] / "aircraft"
STEP_S = 1.0 / 200.0


def found_in(name):
    folder = wheel_root() / "aircraft" / name
    model = JsbsimModel(
        model=name,
        root="wheel",
        elevator=ElevatorProperties(command="fcs/elevator-cmd-norm"),
        throttle=ThrottleProperties(command=()),
    )
    names = names_of(model_files(folder / f"{name}.xml", wheel_root()))
    return with_controls(benches.bench(folder, model), names, LATERAL)


@pytest.mark.parametrize(
    ("name", "aileron", "rudder", "carried"),
    [
        ("T37", ("fcs/left-aileron-pos-rad", -1.0), ("fcs/rudder-pos-rad", 1.0), (False, False)),
        ("T38", ("fcs/left-aileron-pos-norm", -1.0), ("fcs/rudder-pos-norm", 1.0), (False, True)),
        # Its rolling moment reads this surface; drag reads the flaperons, which move as well.
        ("f16", ("fcs/aileron-pos-rad", -1.0), ("fcs/rudder-pos-rad", 1.0), (True, True)),
    ],
)
def test_surface_sign_and_feedback(name, aileron, rudder, carried):
    model = found_in(name)[0].model
    assert (model.aileron.surface, model.aileron.surface_rad) == aileron
    assert (model.rudder.surface, model.rudder.surface_rad) == rudder
    assert (model.aileron.feedback, model.rudder.feedback) == carried


def test_the_survey_of_the_gtm_recovers_its_lateral_controls(tmp_path):
    """Its commands are angles [rad]; the survey reads gtm.xml without aircraft.toml, and the trim needs both surfaces."""
    model = tmp_path / "model"
    shutil.copytree(AIRCRAFT / "gtm", model, ignore=shutil.ignore_patterns("aircraft.toml"))
    off, on = (f'<property value="{value}">aero/six-axes</property>' for value in (0, 1))
    text = (model / "gtm.xml").read_text()
    assert off in text
    (model / "gtm.xml").write_text(text.replace(off, on))
    new_from_jsbsim(model, tmp_path / "surveyed")
    model = aircraft.load(tmp_path / "surveyed").file.jsbsim
    declared = aircraft.load("gtm").file.jsbsim
    assert model.aileron.command == declared.aileron.command == model.lateral.aileron
    assert model.rudder.command == declared.rudder.command == model.lateral.rudder


def test_a_yaw_damper_with_a_switch_is_switched_off():
    bench, notes, decisions = found_in("global5000")
    assert bench.model.set == {"fcs/yaw-damper-enable": 0.0}
    assert max(feedback_rad(bench, LATERAL).values()) == 0.0
    assert any("switches the feedback to the aileron and rudder off" in note for note in notes)
    assert not decisions


def test_a_model_without_ailerons_flies_in_the_pitch_plane_alone():
    bench, notes, _ = found_in("ball")
    assert bench.model.aileron is None
    assert any("lateral flights are not possible: no aileron" in note for note in notes)


def fly(plane, at, control, amplitude_deg):
    t = np.arange(1601) * STEP_S
    still = np.zeros_like(t)
    doublet = sample(Manoeuvre("doublet", amplitude_deg * DEG, start_s=1.0, step_s=0.5), t)
    return Flight(plane, at, STEP_S, 4).fly(
        Inputs(still, still, still, lateral=LateralInputs({control: doublet}))
    )


@pytest.mark.parametrize(
    ("name", "eas_kt", "altitude_ft"), [("T38", 300, 10000), ("f16", 300, 10000), ("c172x", 90, 3000)]
)
def test_foreign_aircraft_fly_doublets_of_aileron_and_rudder(name, eas_kt, altitude_ft):
    """Signs of contract 1: a positive aileron rolls to the left, a positive rudder yaws to the left."""
    plane = aircraft.load(AIRCRAFT / name)
    at = trim(plane, Condition(eas_kt * KT, altitude_ft * FT, straight="wings-level"))
    assert at.residual < 1e-8
    for control, rate in (("aileron", "p_rad_s"), ("rudder", "r_rad_s")):
        flown = fly(plane, at, control, 2.0)
        surface = flown[f"{control}_rad"] - flown[f"{control}_rad"][0]
        assert 0.4 * 2.0 * DEG < surface.max() < 1.3 * 2.0 * DEG  # feedback takes or adds a part
        early = slice(50, 72)  # the first step
        assert (flown[rate] - flown[rate][0])[early].min() < -1e-3
        assert np.abs(flown["phi_rad"]).max() < 20.0 * DEG


def test_the_damping_of_the_t38_is_that_of_its_file():
    """T38.xml states Clp -0.4, Clr 0.12 and Cnr -0.15; the yaw damper, which moves the rudder with r, is subtracted."""
    plane = aircraft.load(AIRCRAFT / "T38")
    linear = linearise(
        plane, trim(plane, Condition(300 * KT, 10000 * FT, straight="wings-level")), motion=LATERAL
    )
    found = dict(zip(LATERAL.parameters, linear.central, strict=True))
    assert [found[name] for name in ("Clp", "Clr", "Cnr")] == pytest.approx([-0.4, 0.12, -0.15], rel=1e-3)


@pytest.mark.slow
def test_a_survey_writes_a_lateral_campaign(tmp_path):
    found = new_from_jsbsim("737", tmp_path / "737")
    folder = found.aircraft.folder
    assert found.has_lateral_campaign
    made = plan.make(folder / LATERAL_CAMPAIGN)
    assert made.campaign.lateral
    assert len(made.table) == 6
    assert verify(folder).intact
    assert any("six axes: wings level" in line for line in found.flight)
    assert "lateral.toml" in found.summary()
    assert found.aircraft.file.sensors.keys() >= {"beta_rad", "p_rad_s", "r_rad_s", "ay_m_s2", "rudder_rad"}
