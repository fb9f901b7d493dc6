"""The written aircraft folder: stands alone, says what was changed, and holds for aircraft of others."""

import shutil
import xml.etree.ElementTree as ET
from dataclasses import replace

import effect_flights as flights
import numpy as np
import pytest

from airtruth import aircraft
from airtruth.aircraft import toml as toml_text
from airtruth.aircraft import write as writing
from airtruth.effects.registry import EFFECTS
from airtruth.errors import AircraftError, ConfigurationError, StoreError
from airtruth.physics.terms import AeroTerm, Change, DeclaredTerm, SurfaceTerm
from airtruth.simulation.linearise import linearise
from airtruth.simulation.simulator import Condition
from airtruth.simulation.trim import trim
from airtruth.units import DEG, FT, KT

FOREIGN = {
    "c172x": (Condition(100 * KT, 4000 * FT), 4.0 * DEG),
    "f16": (Condition(300 * KT, 10000 * FT), 0.5 * DEG),
    "T38": (Condition(300 * KT, 10000 * FT), 1.0 * DEG),
}


@pytest.fixture(scope="module", params=FOREIGN)
def foreign(request):
    plane = aircraft.load(request.param)
    at, amplitude = FOREIGN[request.param]
    start, flown = flights.fly(plane, at, amplitude=amplitude, duration=2.0)
    return plane, at, amplitude, flown, linearise(plane, start).central


@pytest.mark.grid
def test_copy_of_a_wheel_model_stands_alone_and_flies_the_same_bits(foreign, tmp_path):
    plane, at, amplitude, flown, _ = foreign
    copy = flights.changed(plane, Change(), tmp_path)
    assert copy.file.jsbsim.root == "."
    _, again = flights.fly(copy, at, amplitude=amplitude, duration=2.0)
    for name, channel in flown.items():
        np.testing.assert_array_equal(again[name], channel)


@pytest.mark.grid
def test_surface_effect_on_a_foreign_aircraft_is_felt_late(foreign, tmp_path):
    plane, at, amplitude, flown, _ = foreign
    late = flights.changed(plane, Change(surface=(SurfaceTerm("delay", 0.05),)), tmp_path)
    _, delayed = flights.fly(late, at, amplitude=amplitude, duration=2.0)
    peak = np.abs(flown["q_rad_s"]).max()
    np.testing.assert_array_equal(delayed["elevator_rad"], flown["elevator_rad"])  # as measured
    # The Cessna is not quite at rest (its propeller rolls it): 0.2 % of the peak.
    shift = round(0.05 * 200)
    before = round(0.5 * 200) + shift  # nothing reaches the air within 50 ms of the first edge
    np.testing.assert_allclose(delayed["q_rad_s"][:before], 0.0, atol=2e-3 * peak)
    np.testing.assert_allclose(
        delayed["q_rad_s"][shift:], flown["q_rad_s"][:-shift], rtol=0, atol=1e-2 * peak
    )


@pytest.mark.slow
def test_derivatives_of_a_foreign_aircraft_move_by_what_is_written(foreign, tmp_path):
    plane, at, _, _, before = foreign
    start = trim(plane, at)
    lift = {"CLalpha": 0.3, "CLq": 2.0, "CLde": 0.1}
    moment = {"Cmalpha": -0.1, "Cmq": -3.0, "Cmde": -0.1}
    # CL acts along -z of the body; alpha_dot sees its component normal to the flight path, cos(alpha).
    # Lift alone is written first: with it c172x and T38 move in Cm too, by their own term in alpha_dot.
    # That of c172x in CL, 1.7 per alpha_dot c/(2V), takes 1 % off any lift.
    for amounts, rows, share in ((lift, slice(0, 3), np.cos(start.alpha_rad)), (moment, slice(3, 6), 1.0)):
        corrections = writing.Corrections(amounts, {"alpha": start.alpha_rad, "elevator": start.elevator_rad})
        name = next(iter(amounts))
        changed = flights.changed(plane, Change(), tmp_path / name, derivatives=corrections)
        moved = linearise(changed, trim(changed, at)).central[rows] - before[rows]
        np.testing.assert_allclose(moved, share * np.array(list(amounts.values())), rtol=1.2e-2, atol=2e-4)


def test_lift_acts_at_the_cg_of_a_model_that_shifts_its_reference_point(tmp_path):
    """Concorde's model has a shift of half a chord; without it in the written moment Cmalpha would change by -0.5."""
    folder = tmp_path / "gtm"
    shutil.copytree(aircraft.load("gtm").folder, folder)
    model = folder / "gtm.xml"
    shift = """<aerodynamics>
    <aero_ref_pt_shift_x>
      <function name="aero/function/shift">
        <description>Shift of the reference point [chords]</description>
        <table name="aero/function/shift-table">
          <independentVar>aero/alpha-rad</independentVar>
          <tableData>-1.0 0.5
          1.0 0.5</tableData>
        </table>
      </function>
    </aero_ref_pt_shift_x>"""
    model.write_text(model.read_text(encoding="utf-8").replace("<aerodynamics>", shift, 1), encoding="utf-8")
    plane = aircraft.load(str(folder))
    start = trim(plane, Condition(75.0 * KT, 7000.0 * FT))
    before = linearise(plane, start).central
    lift = Change(aero=(AeroTerm("CL", "alpha", "linear", 1.0, start.alpha_rad),))
    moved = linearise(flights.changed(plane, lift, tmp_path / "lift"), start).central - before
    np.testing.assert_allclose(moved[[0, 3]], [np.cos(start.alpha_rad), 0.0], atol=2e-3)


@pytest.mark.slow
def test_declared_values_of_a_foreign_aircraft(foreign, tmp_path):
    plane, at, _, _, _ = foreign
    # CG first alone: the mass stays, and the inertia about the moved CG too
    aft = flights.changed(plane, Change(declared=(DeclaredTerm("cg", 0.03),)), tmp_path / "aft")
    assert aft.inertia_yy_kg_m2 == pytest.approx(plane.inertia_yy_kg_m2, rel=1e-9)
    terms = (DeclaredTerm("mass", 1.1), DeclaredTerm("inertia", 1.2))
    heavy = flights.changed(plane, Change(declared=terms), tmp_path / "heavy")
    assert heavy.mass_kg == pytest.approx(1.1 * plane.mass_kg, rel=1e-8)  # JSBSim's g has eight digits
    assert heavy.inertia_yy_kg_m2 == pytest.approx(1.2 * plane.inertia_yy_kg_m2, rel=1e-9)
    # Cmalpha moves by about CLalpha dx (to first order; thrust and drag are left out)
    before, after = (linearise(p, trim(p, at)).central for p in (plane, aft))
    assert after[3] - before[3] == pytest.approx(0.03 * before[0], rel=0.1)


def test_both_files_say_what_was_changed(gtm, tmp_path):
    change = EFFECTS["elevator_delay"].change({"delay_s": 0.06}) + EFFECTS["vane_bias"].change(
        {"value": 0.01}
    )
    plane = flights.changed(gtm, change, tmp_path, note="A delay found in record 7.")
    notes = [n.text for n in ET.parse(plane.folder / "gtm.xml").getroot().findall("fileheader/note")]
    for said in (notes, (plane.folder / "aircraft.toml").read_text().splitlines()):
        text = "\n".join(said)
        assert "gtm, changed by airtruth" in text
        assert "A delay found in record 7." in text
    assert "Delay of 0.06 s, at simulation rates up to 400 Hz" in (plane.folder / "gtm.xml").read_text()
    assert plane.file.dynamics.surface == (SurfaceTerm("delay", 0.06),)
    assert plane.file.sensors["alpha_rad"].bias.source == "changed by airtruth"
    original = gtm.folder / "gtm.xml"
    text = (plane.folder / "gtm.xml").read_text()
    assert "Two JetCat P70." in text  # comments stay
    assert text.startswith(original.read_text().split("<fdm_config")[0])
    assert plane.file.sensors["alpha_rad"].bias.value == pytest.approx(0.01)


def test_a_changed_aircraft_can_be_changed_again(gtm, paper_condition, tmp_path):
    late = EFFECTS["elevator_delay"].change({"delay_s": 0.06})
    kink = EFFECTS["elevator_asymmetry"].change({"dCmde": 0.3})
    lag = EFFECTS["actuator_lag"].change({"bandwidth_hz": 3.0})
    lift = EFFECTS["lift_lag"].change({"dCLalpha": 1.0, "tau_s": 0.1})
    heavy = EFFECTS["mass_error"].change({"factor": 1.05})
    steps = (kink, late + lift, Change(), lag + lift + heavy)
    plane = gtm
    for number, change in enumerate(steps):
        plane = flights.changed(plane, change, tmp_path / str(number))
    twice = (*lift.states, *(replace(s, name="second") for s in lift.states))
    again = tuple(replace(a, signal="second") if a.signal == "lift-lag" else a for a in lift.aero)
    once = Change(states=twice, aero=lift.aero + again) + kink + late + lag + heavy
    _, expected = flights.fly(flights.changed(gtm, once, tmp_path / "once"), paper_condition)
    _, flown = flights.fly(plane, paper_condition)
    # another order of summation
    np.testing.assert_allclose(flown["q_rad_s"], expected["q_rad_s"], rtol=0, atol=1e-11)
    np.testing.assert_allclose(flown["az_m_s2"], expected["az_m_s2"], rtol=0, atol=1e-10)


def test_a_changed_aircraft_can_be_renamed_and_changed_again(gtm, paper_condition, tmp_path):
    late = EFFECTS["elevator_delay"].change({"delay_s": 0.06})
    changed = flights.changed(gtm, late, tmp_path / "first")
    renamed = aircraft.load(shutil.copytree(changed.folder, tmp_path / "v2"))
    again = flights.changed(renamed, Change(), tmp_path / "second")
    expected, *flown = (flights.fly(plane, paper_condition)[1] for plane in (changed, renamed, again))
    assert len(flown) == 2
    for other in flown:
        np.testing.assert_array_equal(other["q_rad_s"], expected["q_rad_s"])


def test_aircraft_file_survives_its_own_text(gtm, tmp_path):
    (tmp_path / "aircraft.toml").write_text(toml_text.write(gtm.file, "a\nheading"))
    again = aircraft.read_file(tmp_path)
    assert again == gtm.file
    assert again.sensors["q_rad_s"].bias.source == gtm.file.sensors["q_rad_s"].bias.source
    for name in ("c172x", "f16", "T38"):
        file = aircraft.read_file(aircraft.find(name))
        (tmp_path / "aircraft.toml").write_text(toml_text.write(file, ""))
        assert aircraft.read_file(tmp_path) == file


def test_an_aircraft_without_a_model_takes_sensor_terms_alone(tmp_path):
    folder = tmp_path / "paper"
    folder.mkdir()
    (folder / "aircraft.toml").write_text(
        'name = "paper"\n'
        "[geometry]\n"
        'wing_area = { value = 0.55, unit = "m2" }\nchord = { value = 0.28, unit = "m" }\n'
        'span = { value = 2.1, unit = "m" }\n'
        "[mass]\n"
        'mass = { value = 26.0, unit = "kg" }\ninertia_yy = { value = 6.3, unit = "kg_m2" }\n'
    )
    written = writing.write_aircraft(folder, EFFECTS["vane_lag"].change({"tau_s": 0.02}), tmp_path / "out")
    assert aircraft.load(written).file.sensors["alpha_rad"].lag.value == 0.02
    with pytest.raises(AircraftError, match=r"no \[jsbsim\] table"):
        writing.write_aircraft(folder, EFFECTS["backlash"].change({"width_rad": 0.01}), tmp_path / "other")


def test_what_cannot_be_written_says_why(gtm, tmp_path):
    with pytest.raises(StoreError, match="is not empty"):
        writing.write_aircraft(gtm, Change(), gtm.folder)
    with pytest.raises(StoreError, match="name is the model's"):
        writing.write_aircraft(gtm, Change(), tmp_path / "my aircraft")
    corrections = writing.Corrections({"Cmalfa": 0.1}, {"alpha": 0.1})
    with pytest.raises(ConfigurationError, match=r"did you mean 'Cmalpha'"):
        writing.write_aircraft(gtm, Change(), tmp_path / "a", derivatives=corrections)
    nonsense = Change(aero=(AeroTerm("Cm", "mach", "linear", 1.0),))
    with pytest.raises(ConfigurationError, match="signal 'mach'"):
        writing.write_aircraft(gtm, nonsense, tmp_path / "b")
    lift = EFFECTS["lift_lag"].change({"dCLalpha": 1.0, "tau_s": 0.1})
    with pytest.raises(ConfigurationError, match="two states are named 'lift-lag'"):
        writing.write_aircraft(gtm, lift + lift, tmp_path / "d")
    surface = gtm.file.jsbsim.elevator.model_copy(update={"surface": "fcs/elevator-pos-norm"})
    model = gtm.file.jsbsim.model_copy(update={"elevator": surface})
    other = gtm.model_copy(update={"file": gtm.file.model_copy(update={"jsbsim": model})})
    with pytest.raises(AircraftError, match="do not read 'fcs/elevator-pos-norm'"):
        writing.write_aircraft(other, Change(surface=(SurfaceTerm("lag", 0.1),)), tmp_path / "c")
