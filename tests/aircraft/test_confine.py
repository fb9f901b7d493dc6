"""Hostile JSBSim models: each is refused in one sentence, before JSBSim reads a byte, and nothing is written."""

import os
import shutil
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from airtruth import aircraft
from airtruth.aircraft.jsbsim.confine import LARGEST_BYTES, controls_simulation, model_files
from airtruth.aircraft.jsbsim.files import copy, read, write
from airtruth.aircraft.probe import wheel_root
from airtruth.errors import AircraftError

ROOT = Path(__file__).resolve().parents[2]
BEFORE_END = "</fdm_config>"


@pytest.fixture
def plane(tmp_path):
    """A copy of the GTM that a test may spoil; outside it a canary file."""
    shutil.copytree(ROOT / "aircraft" / "gtm", tmp_path / "gtm")
    (tmp_path / "canary.xml").write_text("<system name='x'/>")
    return tmp_path / "gtm"


def add(plane, text):
    xml = plane / "gtm.xml"
    xml.write_text(xml.read_text().replace(BEFORE_END, text + BEFORE_END))


def refuses(plane, message):
    before = {p: p.stat().st_mtime_ns for p in plane.parent.rglob("*")}
    with pytest.raises(AircraftError, match=message) as error:
        aircraft.load(plane)
    assert len(str(error.value).splitlines()) == 1
    assert {p: p.stat().st_mtime_ns for p in plane.parent.rglob("*")} == before


@pytest.mark.parametrize(
    "element",
    [
        '<output name="../canary.xml" type="CSV" rate="10"><rates>ON</rates></output>',
        '<output name="/tmp/airtruth-canary.csv" type="CSV"/>',
        '<output name="localhost" type="SOCKET" port="5123" protocol="TCP" rate="10"/>',
        '<output name="localhost" type="FLIGHTGEAR" port="5124" protocol="UDP" rate="10"/>',
        '<output name="localhost" type="TERMINAL"/>',
        '<output file="../canary.xml"/>',
        '<output/>',
        '<input port="5125"/>',
        '<input type="QTJSBSIM" port="5126"/>',
        '<input file="../canary.xml"/>',
    ],
)  # fmt: skip
def test_outputs_and_inputs_are_refused_by_name(plane, element):
    add(plane, element)
    refuses(plane, r"<(output|input).*remove this element")


@pytest.mark.parametrize("type_", ["SOCKET", "FLIGHTGEAR"])
def test_no_connection_is_made(plane, type_):
    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))
        server.listen()
        server.settimeout(0.2)
        port = server.getsockname()[1]
        add(plane, f'<output name="127.0.0.1" type="{type_}" port="{port}" protocol="TCP" rate="10"/>')
        refuses(plane, "<output 127.0.0.1>")
        with pytest.raises(TimeoutError):
            server.accept()


@pytest.mark.parametrize(
    "reference",
    [
        "../canary",
        "../canary.xml",
        "./../canary.xml",
        "Systems/../../canary",
        "/etc/hostname",
        "/etc/hostname.xml",
    ],
)
@pytest.mark.parametrize("tag", ["system", "autopilot", "planet"])
def test_references_out_of_the_folder_are_refused(plane, tag, reference):
    add(plane, f'<{tag} file="{reference}"/>')
    refuses(plane, "leads out of the folder of the aircraft")


@pytest.mark.parametrize("tag", ["engine", "thruster"])
def test_so_are_engines_and_thrusters(plane, tag):
    add(plane, f'<propulsion><{tag} file="../canary"/></propulsion>')
    refuses(plane, "leads out of the folder of the aircraft")


def test_links_are_not_followed(plane):
    (plane / "Systems" / "linked.xml").symlink_to(plane.parent / "canary.xml")
    add(plane, '<system file="linked"/>')
    refuses(plane, "leads out of the folder of the aircraft")


def test_devices_and_missing_files_are_refused(plane):
    (plane / "zero.xml").symlink_to("/dev/zero")
    add(plane, '<system file="zero"/>')
    refuses(plane, "leads out of the folder of the aircraft")
    xml = plane / "gtm.xml"
    xml.write_text(xml.read_text().replace('file="zero"', 'file="nothing"'))
    refuses(plane, "does not exist in")


def test_a_reference_of_a_referenced_file_is_checked_too(plane):
    (plane / "Systems" / "deeper.xml").write_text('<system name="d"><channel file="../canary"/></system>')
    add(plane, '<system file="deeper"/>')
    refuses(plane, "leads out of the folder of the aircraft")


@pytest.mark.parametrize(
    "declaration",
    [
        '<!DOCTYPE fdm_config [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">]>',
        '<!DOCTYPE fdm_config [<!ENTITY secret SYSTEM "file:///etc/hostname">]>',
        '<!DOCTYPE fdm_config SYSTEM "http://localhost/x.dtd">',
    ],
)
def test_entities_are_refused(plane, declaration):
    xml = plane / "gtm.xml"
    head, tail = xml.read_text().split("<fdm_config", 1)
    xml.write_text(head + declaration + "<fdm_config" + tail)
    refuses(plane, "declares XML entities")


def test_huge_and_deep_files_are_refused(plane):
    xml = plane / "gtm.xml"
    text = xml.read_text()
    add(plane, "<!--" + " " * LARGEST_BYTES + "-->")
    refuses(plane, "MB")
    xml.write_text(text)
    add(plane, "<product>" * 500 + "</product>" * 500)
    refuses(plane, "nested more than")


@pytest.mark.parametrize(
    "element",
    [
        '<system name="s"><channel name="c"><pure_gain name="g"><input>velocities/q-rad_sec</input>'
        "<output>simulation/do_simple_trim</output></pure_gain></channel></system>",
        '<system name="s"><property value="0">simulation/dt</property></system>',
        '<system name="s"><channel name="c"><switch name="g"><default value="1"/>'
        "<output> simulation/terminate </output></switch></channel></system>",
        '<aerodynamics><function name="simulation/reset"><value>1</value></function></aerodynamics>',
    ],
)
def test_a_model_must_not_control_the_simulation(plane, element):
    add(plane, element)
    refuses(plane, "must not stop, trim, rewind or re-time the simulation")


@pytest.mark.parametrize(
    "name",
    ["fcs/../simulation/terminate", "./simulation/terminate", "simulation[0]/terminate", "-simulation/reset"],
)
def test_nor_by_another_name_of_the_same_property(plane, name):
    """JSBSim 1.3.3 ends the simulation through each of the first three."""
    add(
        plane,
        f'<system name="s"><channel name="c"><pure_gain name="g"><output>{name}</output></pure_gain></channel></system>',
    )
    refuses(plane, "must not stop, trim, rewind or re-time the simulation")


@pytest.mark.parametrize("name", ["simulation/do_simple_trim", "simulation/dt", "/simulation/reset"])
def test_nor_may_aircraft_toml(plane, name):
    toml = plane / "aircraft.toml"
    text = toml.read_text()
    assert "[jsbsim]" in text
    toml.write_text(text + f'\n[jsbsim.set]\n"{name}" = 0.0\n')
    refuses(plane, r"\[jsbsim\] writes")


def test_reading_the_time_is_no_control():
    assert controls_simulation("simulation/dt")
    assert not controls_simulation("simulation")
    assert not controls_simulation("fcs/elevator-cmd-norm")


def test_every_model_of_the_wheel_is_accepted():
    wheel = wheel_root()
    folders = [d for d in sorted((wheel / "aircraft").iterdir()) if (d / f"{d.name}.xml").is_file()]
    assert len(folders) > 50
    for folder in folders:
        files = model_files(folder / f"{folder.name}.xml", wheel)
        assert files[0].name == f"{folder.name}.xml"


def test_a_copy_holds_what_the_model_refers_to_and_nothing_else(plane, tmp_path):
    (plane / "private.txt").write_text("mine")
    (plane / "zero").symlink_to("/dev/zero")
    gtm = aircraft.load(plane)
    out = tmp_path / "out"
    copy(read(gtm.folder, gtm.file.jsbsim), out)
    copied = {p.relative_to(out).as_posix() for p in out.rglob("*") if p.is_file()}
    assert copied == {"Systems/pitch-augmentation.xml"}


def test_a_copy_of_a_model_of_the_wheel_has_no_output(tmp_path):
    cessna = aircraft.load("c172x")
    model = read(cessna.folder, cessna.file.jsbsim)
    assert model.root.find("output") is None
    copy(model, tmp_path / "out")
    assert (tmp_path / "out" / "Engines").is_dir()


def test_a_copy_of_a_model_of_the_wheel_does_not_control_the_simulation(tmp_path):
    """The F-104 of the JSBSim package stops its integrators in a crash; its copy is a model that may be loaded."""
    crash = wheel_root() / "aircraft" / "f104" / "Systems" / "crash-detect.xml"
    assert "<output>simulation/" in crash.read_text()
    f104 = aircraft.load("c172x").file.jsbsim.model_copy(update={"model": "f104"})
    model = read(tmp_path, f104)
    copy(model, tmp_path / "f104")
    write(model, tmp_path / "f104" / "f104.xml")
    copied = (tmp_path / "f104" / "Systems" / "crash-detect.xml").read_text()
    assert "<output>simulation/" not in copied
    assert copied.count("<output>systems/crash-detect/crashed</output>") == 2
    assert len(model_files(tmp_path / "f104" / "f104.xml")) > 3


@pytest.mark.slow
def test_code_in_the_working_folder_is_not_run(plane, tmp_path):
    """A file named like a module of the standard library in the working folder must not be imported by the probe."""
    for name in ("subprocess", "json", "pathlib"):
        (tmp_path / f"{name}.py").write_text("open('ran', 'w').write('x')\nraise SystemExit(3)\n")
    code = f"from airtruth import aircraft; print(aircraft.load({str(plane)!r}).name)"
    done = subprocess.run(
        [sys.executable, "-P", "-c", code],
        cwd=tmp_path,
        env=os.environ,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stdout.strip() == "gtm", done.stderr
    assert not (tmp_path / "ran").exists()
