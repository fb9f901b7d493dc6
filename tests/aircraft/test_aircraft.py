"""Aircraft folders: what is read, and what is said of those that cannot be flown."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from airtruth import aircraft
from airtruth.errors import AircraftError
from airtruth.simulation.linearise import linearise
from airtruth.simulation.trim import trim

ROOT = Path(__file__).resolve().parents[2] / "aircraft"
FT, LB, SLUG = 0.3048, 0.45359237, 14.593902937206364


@pytest.fixture
def copy(tmp_path):
    """A copy of the GTM that may be spoilt."""
    return Path(shutil.copytree(ROOT / "gtm", tmp_path / "gtm"))


def edit(path, old, new):
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


def refusal(folder):
    with pytest.raises(AircraftError) as caught:
        aircraft.load(folder)
    assert caught.value.exit_code == 2
    return str(caught.value)


def test_gtm_constants(gtm):
    # NASA GTM_DesignSim, AC_baseparams_T2, in its units.
    assert gtm.name == "gtm"
    assert gtm.wing_area_m2 == pytest.approx(5.9018 * FT**2)
    assert gtm.chord_m == pytest.approx(0.9153 * FT)
    assert gtm.mass_kg == pytest.approx(57.75 * LB)
    assert gtm.inertia_yy_kg_m2 == pytest.approx(4.657102 * SLUG * FT**2)
    assert gtm.constants.cg_fraction == 0.2199
    assert gtm.file.mass.mass.std == pytest.approx(0.58 * LB)


@pytest.mark.parametrize("name", ["c172x", "f16", "T38"])
def test_constants_of_aircraft_without_geometry_come_from_the_model(name):
    loaded = aircraft.load(name)
    assert loaded.file.geometry is None
    # Wing areas of the wheel's own XML files [ft2].
    assert loaded.wing_area_m2 == pytest.approx({"c172x": 174.0, "f16": 300.0, "T38": 170.0}[name] * FT**2)
    assert loaded.mass_kg > 100.0


def test_found_by_name_folder_or_file(copy, monkeypatch, tmp_path):
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    assert aircraft.find("gtm") == ROOT / "gtm"
    assert aircraft.find(copy) == copy
    assert aircraft.find(copy / "aircraft.toml") == copy
    assert aircraft.find("gtm", near=tmp_path) == copy


def test_a_copy_under_another_name_flies_its_own_model(gtm, copy, paper_condition):
    """Not that of the folder beside it, which has the model's name."""
    renamed = Path(shutil.copytree(copy, copy.with_name("v2")))
    loaded = aircraft.load(renamed)
    flown, own = (linearise(plane, trim(plane, paper_condition)).plus for plane in (loaded, gtm))
    np.testing.assert_array_equal(flown, own)
    shutil.rmtree(copy)
    assert aircraft.load(renamed).constants == gtm.constants
    shutil.copytree(renamed, copy)
    edit(renamed / "gtm.xml", "<property>aero/ci2vel</property>", "<property>aero/ci2vell</property>")
    assert "ci2vell" in refusal(renamed)


def test_unknown_name_lists_the_known():
    assert "aircraft 'gtn' not found; did you mean 'gtm'? allowed: " in refusal("gtn")


def test_folder_without_aircraft_toml(tmp_path):
    assert f"{tmp_path}: no aircraft.toml in this folder" in refusal(tmp_path)


def test_constants_alone_need_no_jsbsim(tmp_path):
    (tmp_path / "aircraft.toml").write_text(
        'schema = 1\nname = "paper"\n[geometry]\nwing_area = { value = 2.0, unit = "m2" }\n'
        'chord = { value = 300.0, unit = "mm" }\nspan = { value = 4.0, unit = "m" }\n'
        '[mass]\nmass = { value = 20.0, unit = "kg" }\ninertia_yy = { value = 3.0, unit = "kg_m2" }\n'
    )
    loaded = aircraft.load(tmp_path)
    assert (loaded.wing_area_m2, loaded.chord_m, loaded.mass_kg, loaded.file.jsbsim) == (2.0, 0.3, 20.0, None)
    assert loaded.constants.cg_fraction == 0.25


def test_neither_constants_nor_model(tmp_path):
    (tmp_path / "aircraft.toml").write_text('schema = 1\nname = "none"\n')
    assert "without a JSBSim model it needs [geometry] and [mass]" in refusal(tmp_path)


SPOILT_TOML = {
    "misspelt key": (
        "schema = 1",
        "schema = 1\ndescripton = ''",
        ["descripton: unknown key", "did you mean 'description'"],
    ),
    "misspelt key below": ("[mass]\n", "[mass]\nmas = 1\n", ["mass.mas: unknown key", "did you mean 'mass'"]),
    "unit": (
        'value = 57.75, unit = "lb"',
        'value = 57.75, unit = "ft"',
        ["mass.mass: unit 'ft' is not a unit of mass", "kg, lb, slug"],
    ),
    "no unit": (
        'value = 57.75, unit = "lb"',
        "value = 57.75",
        ["mass.mass: unit None is not a unit of mass"],
    ),
    "negative noise": (
        "noise_std = { value = 0.06",
        "noise_std = { value = -0.06",
        ["airspeed_m_s", "noise_std", "must not be negative"],
    ),
    "negative delay": (
        "delay = { value = 40.0",
        "delay = { value = -40.0",
        ["theta_rad", "delay", "must not be negative"],
    ),
    "bandwidth of zero": (
        "bandwidth = { value = 5.0",
        "bandwidth = { value = 0.0",
        ["elevator_actuator: bandwidth has to be above 0 (is 0 in SI)"],
    ),
    "negative rate limit": (
        "rate_limit = { value = ",
        "rate_limit = { value = -",
        ["elevator_actuator: rate_limit has to be above 0 (is -5.23599 in SI)"],
    ),
    "negative delay of the actuator": (
        "delay = { value = 15.0",
        "delay = { value = -15.0",
        ["elevator_actuator.delay: must not be negative (is -0.015 in SI)"],
    ),
    "stops": (
        "maximum = { value = 20.0",
        "maximum = { value = -30.0",
        ["elevator_actuator", "minimum has to be below maximum"],
    ),
    "channel": (
        "[sensors.q_rad_s]",
        "[sensors.q_rads]",
        ["'q_rads' is not a channel", "did you mean 'q_rad_s'"],
    ),
    "syntax": ("schema = 1", "schema = = 1", ["not valid TOML"]),
    "schema": ("schema = 1", "schema = 2", ["schema"]),
    "not a number": ("value = 57.75", 'value = "heavy"', ["mass.mass.value", "heavy"]),
    "infinite": ("value = 57.75", "value = inf", ["mass.mass.value", "finite"]),
    "mass of another aircraft": (
        "value = 57.75",
        "value = 67.75",
        ["mass_kg is 30.7", "but 26.19", "make them agree"],
    ),
    "property": (
        'surface = "fcs/elevator-pos-rad"',
        'surface = "fcs/elevator-pos-rads"',
        ["property 'fcs/elevator-pos-rads' does not exist", "did you mean 'fcs/elevator-pos-rad'"],
    ),
    "throttle": (
        'command = ["fcs/throttle-cmd-norm"]',
        'command = ["fcs/throttel-cmd-norm"]',
        ["property 'fcs/throttel-cmd-norm' does not exist"],
    ),
    "gain": (
        "fcs/augmentation/damper-gain-s",
        "fcs/augmentation/damper-gain",
        ["'fcs/augmentation/damper-gain' does not exist"],
    ),
    "rotary": ("aero/gust/q-rad_sec", "aero/gust/q", ["'aero/gust/q' does not exist"]),
    "model": ('model = "gtm"', 'model = "gtx"', ["no gtx.xml below", "did you mean 'gtm'"]),
}


@pytest.mark.parametrize("case", SPOILT_TOML)
def test_spoilt_aircraft_toml(copy, case):
    old, new, words = SPOILT_TOML[case]
    edit(copy / "aircraft.toml", old, new)
    said = refusal(copy)
    for word in ("gtm", *words):
        assert word in said


def test_all_problems_of_aircraft_toml_at_once(copy):
    for case in ("misspelt key", "unit", "negative noise"):
        edit(copy / "aircraft.toml", *SPOILT_TOML[case][:2])
    said = refusal(copy)
    for word in ("descripton", "'ft' is not a unit of mass", "noise_std"):
        assert word in said


def test_all_missing_properties_at_once(copy):
    for case in ("property", "rotary"):
        edit(copy / "aircraft.toml", *SPOILT_TOML[case][:2])
    said = refusal(copy)
    assert "fcs/elevator-pos-rads" in said
    assert "aero/gust/q'" in said


# JSBSim refuses some of these, aborts on others; the child process dies in the caller's place.
SPOILT_XML = {
    "not XML": ("</metrics>", "</metric>", []),
    "cut short": ("</fdm_config>", "", []),
    "property in a function": (
        "<property>aero/ci2vel</property>",
        "<property>aero/ci2vell</property>",
        ["ci2vell"],
    ),
    "property in a table": (
        ">aero/alpha-deg</independentVar>",
        ">aero/alfa-deg</independentVar>",
        ["alfa-deg"],
    ),
    "property in the loop": (
        "<input>fcs/elevator-cmd-rad</input>",
        "<input>fcs/elevator-cmd-rd</input>",
        ["elevator-cmd-rd"],
    ),
    "function": (
        "<difference>\n          <property>velocities",
        "<diference>\n          <property>velocities",
        [],
    ),
    "system file": ('<system file="pitch-augmentation"/>', '<system file="pitch-augmentatio"/>', []),
    "unit": ('<chord unit="FT">', '<chord unit="FEET">', ["FEET"]),
}


@pytest.mark.parametrize("case", SPOILT_XML)
def test_spoilt_model_is_an_error_message(copy, case):
    old, new, words = SPOILT_XML[case]
    edit(copy / "gtm.xml", old, new)
    said = refusal(copy)
    assert str(copy) in said
    assert "JSBSim" in said
    for word in words:
        assert word in said
    assert "\x1b" not in said  # no colours of a terminal


def test_a_model_spoilt_after_it_was_read_is_not_flown_from_memory(copy):
    aircraft.load(copy)
    edit(copy / "gtm.xml", "<property>aero/ci2vel</property>", "<property>aero/ci2vell</property>")
    assert "ci2vell" in refusal(copy)


def test_an_aircraft_file_alone_is_an_aircraft_without_a_model(tmp_path):
    """That of the GTM states geometry and mass, which are all that the linear model needs beside the derivatives."""
    declared = aircraft.load("gtm")
    (tmp_path / "aircraft.toml").write_bytes((declared.folder / "aircraft.toml").read_bytes())
    alone = aircraft.load(tmp_path)
    assert declared.file.jsbsim is not None
    assert alone.file.jsbsim is None
    assert alone.constants.mass_kg == pytest.approx(declared.constants.mass_kg, rel=1e-3)
    assert alone.file.derivatives == declared.file.derivatives
