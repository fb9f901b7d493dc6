"""Survey of JSBSim models of unknown origin: controls, engines, trims in all axes, glides, refusals."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from airtruth import aircraft
from airtruth.errors import AircraftError, StoreError
from airtruth.logs.verify import verify
from airtruth.physics.motion import LONGITUDINAL
from airtruth.simulation.campaign import plan
from airtruth.simulation.flight import Flight, Inputs
from airtruth.simulation.foreign_aircraft import CAMPAIGN, REPORT, new_from_jsbsim
from airtruth.simulation.linearise import linearise
from airtruth.simulation.simulator import Condition, Executive
from airtruth.simulation.survey.names import names_of
from airtruth.simulation.trim import trim
from airtruth.units import DEG

ROOT = Path(__file__).resolve().parents[2]
STEP_S = 1.0 / 200.0


@pytest.fixture(scope="module")
def surveyed(tmp_path_factory):
    """The GTM as if nothing were known of it but its XML."""
    return new_from_jsbsim(ROOT / "aircraft" / "gtm", tmp_path_factory.mktemp("survey") / "mine")


def test_the_elevator_is_found_whatever_its_command_is_called(surveyed, gtm):
    found, declared = surveyed.aircraft.file.jsbsim.elevator, gtm.file.jsbsim.elevator
    assert (found.command, found.surface) == (declared.command, declared.surface)
    assert found.command_per_rad == pytest.approx(declared.command_per_rad, rel=1e-9)
    assert found.surface_rad == declared.surface_rad


def test_the_new_folder_has_the_derivatives_of_the_model(surveyed, gtm, paper_trim):
    """In one state; the thrust, which the surveyed aircraft lacks, has no moment derivative."""
    found, declared = (linearise(plane, paper_trim).central for plane in (surveyed.aircraft, gtm))
    moments = [LONGITUDINAL.parameters.index(name) for name in ("Cmalpha", "Cmq", "Cmde")]
    np.testing.assert_allclose(found[moments], declared[moments], rtol=1e-6)


def test_a_glide_has_the_slope_of_drag_over_lift(surveyed, paper_trim):
    at = trim(surveyed.aircraft, paper_trim.condition)
    executive = Executive(surveyed.aircraft, STEP_S)
    executive.initialise(at.condition, at.controls)
    drag, lift = (executive.fdm[f"forces/fw{axis}-aero-lbs"] for axis in "xz")
    assert np.tan(-at.condition.gamma_rad) == pytest.approx(abs(drag / lift), rel=1e-4)


def test_the_folder_is_complete_and_its_campaign_flies(surveyed):
    folder = surveyed.aircraft.folder
    assert verify(folder).intact
    assert (folder / REPORT).read_text().rstrip() == surveyed.summary()
    assert len(plan.make(folder / CAMPAIGN).table) == 6
    assert surveyed.flies
    assert any("sensors" in line for line in surveyed.decisions)


def test_a_model_of_a_stranger_is_confined(tmp_path):
    folder = tmp_path / "gtm"
    shutil.copytree(ROOT / "aircraft" / "gtm", folder)
    xml = folder / "gtm.xml"
    xml.write_text(xml.read_text().replace("</fdm_config>", '<output name="x" type="CSV"/></fdm_config>'))
    with pytest.raises(AircraftError, match="lets JSBSim open files"):
        new_from_jsbsim(folder, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_force_replaces_an_aircraft_and_nothing_else(tmp_path):
    source, out = tmp_path / "gtm", tmp_path / "mine"
    shutil.copytree(ROOT / "aircraft" / "gtm", source)
    out.mkdir()
    (out / "notes.txt").write_text("mine")
    with pytest.raises(StoreError, match=r"mine: is not empty; choose a new folder"):
        new_from_jsbsim(source, out)
    with pytest.raises(StoreError, match=r"holds no aircraft\.toml, so --force does not replace it"):
        new_from_jsbsim(source, out, force=True)
    with pytest.raises(StoreError, match=r"gtm: holds the model that is read"):
        new_from_jsbsim(source, source, force=True)
    (out / "aircraft.toml").write_text("")
    assert new_from_jsbsim(source, out, force=True).aircraft.name == "mine"
    assert verify(out).intact
    assert not (out / "notes.txt").exists()
    assert (source / "gtm.xml").is_file()


def test_a_wrong_name_lists_the_models(tmp_path):
    with pytest.raises(AircraftError, match="c172p"):
        new_from_jsbsim("c172q", tmp_path / "out")


def test_names_are_read_from_every_form_of_reference(tmp_path):
    model = tmp_path / "m.xml"
    model.write_text(
        """<fdm_config><aerodynamics><axis name="PITCH"><function><product>
        <property> fcs/elevator-pos-rad </property><table><independentVar lookup="row">aero/alpha-rad</independentVar>
        </table></product></function></axis></aerodynamics><flight_control><channel>
        <summer name="Pitch Trim Sum"><input>-ap/pitch-hold</input><output>fcs/x</output></summer>
        <switch name="fcs/sas-gain"><default value="0"/><test value="1">fcs/fbw-override eq 0</test></switch>
        </channel></flight_control></fdm_config>"""
    )
    names = names_of([model])
    assert names.aerodynamic == ("fcs/elevator-pos-rad", "aero/alpha-rad")
    assert {"fcs/x", "fcs/pitch-trim-sum", "fcs/sas-gain"} <= set(names.written)
    assert names.switches == ["ap/pitch-hold", "fcs/fbw-override"]


@pytest.mark.long
@pytest.mark.slow
def test_a_propeller_starts_and_its_torque_is_held(tmp_path):
    """The Cessna 182 of the JSBSim package, whose engine stalls in JSBSim's own steady state."""
    cessna = new_from_jsbsim("c182", tmp_path / "c182").aircraft
    at = trim(cessna, Condition(45.0, 1500.0))
    executive = Executive(cessna, STEP_S)
    executive.initialise(at.condition, at.controls)
    r = executive.respond()
    assert executive.fdm["propulsion/engine/thrust-lbs"] > 50.0
    assert at.residual < 1e-6
    # engines that have just started are within 1e-5 of the steady state that the trim has
    assert max(abs(r.v_dot_m_s2), abs(r.p_dot_rad_s2), abs(r.r_dot_rad_s2)) < 1e-5
    assert at.controls.held["aileron"] != 0.0
    still = np.zeros(2001)
    flown = Flight(cessna, at, STEP_S, 4).fly(Inputs(still, still, still))
    assert np.ptp(flown["alpha_rad"]) < 1e-4 * DEG
    assert np.ptp(flown["airspeed_m_s"]) < 1e-4


@pytest.mark.slow
def test_properties_of_a_simulator_around_the_model_are_declared(tmp_path):
    found = new_from_jsbsim("f104", tmp_path / "f104")
    assert found.aircraft.file.jsbsim.declare == {"systems/radar/range": 0.0}
    assert any("systems/radar/range" in line for line in found.decisions)
    assert found.flies


@pytest.mark.slow
def test_an_engine_that_cannot_fly_is_named(tmp_path):
    found = new_from_jsbsim("C130", tmp_path / "C130")
    assert any("JSBSim takes its thrust for shaft power" in line for line in found.notes)
    assert found.flies
    assert aircraft.load(found.aircraft.folder).file.jsbsim.throttle.command == ()
