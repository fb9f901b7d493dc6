"""A changed aircraft keeps every byte that the change does not concern, and states the origin of each new number."""

import difflib
import tomllib
import xml.etree.ElementTree as ET

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from airtruth import aircraft as planes
from airtruth.aircraft.file import AircraftFile
from airtruth.aircraft.jsbsim.document import parse
from airtruth.aircraft.origin import Origin, rounded
from airtruth.aircraft.toml_patch import patched
from airtruth.aircraft.write import Corrections, write_aircraft
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.terms import AeroTerm, Change, DeclaredTerm, SensorTerm, SurfaceTerm
from airtruth.quantity import Quantity
from airtruth.toml_places import places

MOST_LINES = 40
"""Changed lines of both files for one arm and six increments (the bar of a patch that a maintainer can review)."""
ARM = SensorTerm("alpha_rad", "arm", 1.6716)
SIX = dict(
    zip(LONGITUDINAL.parameters, (-0.26092, 10.612, 0.026032, -0.070529, -4.3993, 0.15686), strict=True)
)
STD = dict(zip(LONGITUDINAL.parameters, (0.022, 4.9, 0.023, 0.016, 1.8, 0.012), strict=True))
SOURCE = "airtruth trace of 2026-11-28, records r1, r2"


def changed_lines(old, new):
    """Lines that a unified diff adds or removes."""
    lines = difflib.unified_diff(old.splitlines(), new.splitlines(), lineterm="", n=0)
    return [line for line in lines if line[0] in "+-" and not line.startswith(("+++", "---"))]


@pytest.fixture(scope="module")
def updated(tmp_path_factory):
    gtm = planes.load("gtm")
    refitted = {
        name: Quantity(value=q.value + SIX[name], std=STD[name], source=SOURCE)
        for name, q in gtm.file.derivatives.items()
    }
    plane = gtm.model_copy(update={"file": gtm.file.model_copy(update={"derivatives": refitted})})
    folder = tmp_path_factory.mktemp("patch") / "gtm"
    corrections = Corrections(SIX, {"alpha": 0.097366, "elevator": -0.000816}, STD)
    origin = Origin(SOURCE, {ARM: 0.152})
    write_aircraft(plane, Change(sensors=(ARM,)), folder, "Effects: vane_arm.", corrections, origin=origin)
    return gtm, folder


def test_one_arm_and_six_increments_change_few_lines(updated):
    gtm, folder = updated
    changed = {
        name: changed_lines((gtm.folder / name).read_text(), (folder / name).read_text())
        for name in ("gtm.xml", "aircraft.toml")
    }
    assert 0 < sum(map(len, changed.values())) <= MOST_LINES
    assert not [line for line in changed["gtm.xml"] if line.startswith("-")]
    removed = [line for line in changed["aircraft.toml"] if line.startswith("-")]
    assert len(removed) == 1 + len(LONGITUDINAL.parameters)  # the arm, and the derivatives


def test_each_new_number_has_its_source_and_standard_deviation(updated):
    _, folder = updated
    file = planes.read_file(folder)
    arm = file.sensors["alpha_rad"].x
    assert (arm.value, arm.std, arm.source) == (1.6716, 0.152, SOURCE)
    for name in LONGITUDINAL.parameters:
        assert (file.derivatives[name].std, file.derivatives[name].source) == (STD[name], SOURCE)
    words = [d.text for d in ET.parse(folder / "gtm.xml").getroot().iter("description")]
    for name in LONGITUDINAL.parameters:
        (own,) = [w for w in words if w.startswith(f"{name[:2]} += {SIX[name]!r} ")]
        assert own.endswith(f"; std {STD[name]:.3g}; {SOURCE}")


def test_declared_quantities_state_their_own_uncertainty(tmp_path):
    heavy = DeclaredTerm("mass", 1.05)
    gtm = planes.load("gtm")
    written = write_aircraft(
        "gtm", Change(declared=(heavy,)), tmp_path / "gtm", origin=Origin(SOURCE, {heavy: 0.02})
    )
    mass = planes.read_file(written).mass.mass
    assert mass.value == pytest.approx(1.05 * gtm.mass_kg, rel=1e-4)
    assert mass.std == pytest.approx(0.02 * gtm.mass_kg, rel=1e-2)
    text = (written / "aircraft.toml").read_text()
    assert 'unit = "lb"' in text
    assert f"mass: 1.05; std 0.02; {SOURCE}" in (written / "gtm.xml").read_text()


def test_a_section_in_a_file_of_its_own_stays_there(tmp_path):
    """Its own text is not rewritten: lines are added."""
    source = tmp_path / "source" / "gtm"
    write_aircraft("gtm", Change(), source)
    text = (source / "gtm.xml").read_text()
    start, end = text.index("  <aerodynamics>"), text.index("</aerodynamics>") + len("</aerodynamics>")
    (source / "aero.xml").write_text(text[start:end].strip() + "\n")
    (source / "gtm.xml").write_text(text[:start] + '  <aerodynamics file="aero.xml"/>' + text[end:])
    term = AeroTerm("Cm", "alpha", "linear", 0.1)
    again = write_aircraft(source, Change(aero=(term,)), tmp_path / "gtm")
    assert '<aerodynamics file="aero.xml"/>' in (again / "gtm.xml").read_text()
    added = changed_lines((source / "aero.xml").read_text(), (again / "aero.xml").read_text())
    assert added
    assert all(line.startswith("+") for line in added)


def test_line_ends_stay(tmp_path):
    source = tmp_path / "source" / "gtm"
    write_aircraft("gtm", Change(), source)
    for name in ("gtm.xml", "aircraft.toml"):
        (source / name).write_bytes((source / name).read_bytes().replace(b"\n", b"\r\n"))
    change = Change(surface=(SurfaceTerm("delay", 0.02),), sensors=(ARM,))
    again = write_aircraft(source, change, tmp_path / "gtm")
    for name in ("gtm.xml", "aircraft.toml"):
        content = (again / name).read_bytes()
        assert content.count(b"\n") == content.count(b"\r\n")
        assert content != (source / name).read_bytes()


NAMES = st.sampled_from(("a", "b", "function"))
TEXTS = st.sampled_from(("", " x ", "1.5 < 2 & ä"))


@st.composite
def trees(draw):
    root = ET.Element("root")
    elements = [root]
    for _ in range(draw(st.integers(0, 6))):
        child = ET.SubElement(draw(st.sampled_from(elements)), draw(NAMES), {"name": draw(TEXTS)})
        child.text = draw(TEXTS)
        elements.append(child)
    return root


def content_of(element):
    """Tags, attributes and texts without white space."""
    return element.tag, element.attrib, (element.text or "").strip(), [content_of(child) for child in element]


@settings(deadline=None)
@given(root=trees(), data=st.data())
def test_a_patched_document_is_the_changed_tree(root, data):
    document = parse(b"<!-- head -->\n" + ET.tostring(root, encoding="utf-8"))
    assert document.patched() == document.content
    for _ in range(data.draw(st.integers(1, 4))):
        element = data.draw(st.sampled_from(list(document.root.iter())))
        match data.draw(st.sampled_from(("insert", "remove", "text", "attribute"))):
            case "insert":
                new = ET.Element("function", {"name": "<new>"})
                ET.SubElement(new, "description").text = "a & b"
                element.insert(data.draw(st.integers(0, len(element))), new)
            case "remove" if len(element):
                element.remove(data.draw(st.sampled_from(list(element))))
            case "text":
                element.text = "2 < 3"
            case "attribute":
                element.set("more", 'say "no"')
    assert content_of(ET.fromstring(document.patched())) == content_of(document.root)


@settings(deadline=None, max_examples=30)
@given(
    value=st.floats(-1e3, 1e3, allow_nan=False),
    std=st.floats(0.0, 10.0),
    entry=st.sampled_from(("bias", "noise_std", "x")),
)
def test_a_patched_quantity_is_read_as_stated(value, std, entry):
    text = planes.find("gtm").joinpath("aircraft.toml").read_text()
    file = AircraftFile.model_validate(tomllib.loads(text))
    sensor = file.sensors["alpha_rad"]
    new = Quantity(value=abs(value), std=std, source='a "quoted" source')
    changed = file.model_copy(
        update={"sensors": {**file.sensors, "alpha_rad": sensor.model_copy(update={entry: new})}}
    )
    result = patched(text, changed, "head")
    assert result.startswith("# head\n# GTM")
    assert len(changed_lines(text, result)) <= 3
    again = getattr(AircraftFile.model_validate(tomllib.loads(result)).sensors["alpha_rad"], entry)
    assert again.value == pytest.approx(new.value, rel=1e-12, abs=1e-3 * std)
    assert again.std == pytest.approx(std, rel=1e-2)
    assert again.source == new.source


NOTATIONS = {
    "a table for each quantity": "[derivatives.Cmq]\nvalue = -10.0 # as flown\nstd = 1.0\n",
    "dotted keys": "derivatives.Cmq.value = -10.0\nderivatives.Cmq.std = 1.0\n",
    "braces throughout": "derivatives = { Cmq = { value = -10.0, std = 1.0 } }\n",
}


@pytest.mark.parametrize("notation", NOTATIONS.values(), ids=NOTATIONS)
def test_any_notation_takes_the_change(notation):
    text = f'name = "x"\n{notation}'
    file = AircraftFile.model_validate(tomllib.loads(text))
    new = file.model_copy(update={"derivatives": {"Cmq": Quantity(value=-12.0, std=0.5, source="s")}})
    result = patched(text, new, "head")
    assert AircraftFile.model_validate(tomllib.loads(result)) == new
    assert result.startswith("# head\n")


def test_values_are_found_in_every_kind_of_text():
    text = (
        "a = '''x]}''' # ] = {\n'b c' = [1, # one\n 2, {d = \"e\\\"}\"}]\n"
        "[[t]]\nk = 1\n[t.u]\nk = 2\n[[t]]\nk = 1979-05-27T07:32:00Z\n"
    )
    found = places(text)
    at = {path: text[a:b] for path, (a, b) in found.values.items()}
    assert at["a",] == "'''x]}'''"
    assert (at["b c", 1], at["b c", 2, "d"]) == ("2", '"e\\"}"')
    assert (at["t", 0, "k"], at["t", 0, "u", "k"], at["t", 1, "k"]) == ("1", "2", "1979-05-27T07:32:00Z")
    assert text[: found.tables["t", 0, "u"]].endswith("k = 2\n")


@given(value=st.floats(-1e6, 1e6, allow_nan=False), std=st.floats(1e-6, 1e6))
def test_rounding_keeps_a_thousandth_of_the_standard_deviation(value, std):
    assert abs(rounded(value, std) - value) <= 1e-3 * std
