"""Effects on the derivatives: written, linearised, flown; and the tail that an aircraft.toml declares."""

import effect_flights as flights
import fly_campaigns as campaigns
import numpy as np
import pytest

from airtruth import aircraft as planes
from airtruth.aircraft import write as writing
from airtruth.aircraft.tail import tail_geometry
from airtruth.effects.registry import EFFECTS
from airtruth.errors import AircraftError, ConfigurationError
from airtruth.physics.composition import CAUSES, directions
from airtruth.physics.terms import Change, DeclaredTerm
from airtruth.simulation.linearise import linearise
from airtruth.simulation.resolution import linear_point
from airtruth.simulation.trim import trim

TAIL = """
[tail]
arm = { value = 3.0, unit = "ft" }
area = { value = 1.3, unit = "ft2" }
lift_slope = { value = 4.0 }
efficiency = { value = 0.9 }
"""
CASES = {
    "tail_effectiveness": {"factor": 0.6},
    "wing_effectiveness": {"factor": 0.9},
    "dynamic_pressure": {"factor": 1.1},
    "aerodynamic_center": {"dx_mac": 0.03},
    "icing": {"severity": 1.5},
    "derivatives": {"dCLalpha": 0.2, "dCLq": 3.0, "dCLde": 0.05, "dCmalpha": -0.1, "dCmq": 4.0, "dCmde": 0.1},
}


@pytest.fixture(scope="module")
def point(gtm, paper_condition):
    return linear_point(gtm, paper_condition)


@pytest.mark.slow
@pytest.mark.parametrize("key", CASES)
def test_the_written_aircraft_has_the_derivatives_of_its_effect(gtm, paper_condition, point, tmp_path, key):
    change = EFFECTS[key].change(CASES[key])
    along = directions(point.derivatives, point.geometry)
    if key == "derivatives":
        expected = np.array(list(CASES[key].values()))
    else:
        (term,) = change.derivatives
        expected = (term.value - CAUSES[term.cause]) * along[term.cause]
    at = trim(flights.changed(gtm, change, tmp_path, paper_condition), paper_condition)
    assert (at.alpha_rad, at.elevator_rad) == pytest.approx(tuple(point.trim.values()), abs=1e-9)
    plane = planes.load(tmp_path / gtm.name)
    found = linearise(plane, at).central - point.derivatives
    np.testing.assert_allclose(found, expected, rtol=1e-3, atol=1e-6)


def test_a_change_that_is_not_resolved_is_not_written(gtm, tmp_path):
    change = EFFECTS["icing"].change({"severity": 1.0})
    with pytest.raises(ConfigurationError, match=r"icing changes the derivatives .* resolve the change"):
        writing.write_aircraft(gtm, change, tmp_path / "gtm")


@pytest.mark.slow
def test_an_effect_on_the_derivatives_flies_in_a_campaign(tmp_path):
    quiet = {"gust": {"level": "none"}, "sensors": {"ideal": True}, "runs": 1}
    plain = campaigns.channel(campaigns.fly(tmp_path / "plain", **quiet), "q_rad_s")
    weak = campaigns.fly(
        tmp_path / "weak", effect=[{"name": "derivatives", "dCmde": 0.1787}], **quiet
    )  # 10 % of Cmde
    neutral = campaigns.fly(tmp_path / "neutral", effect=[{"name": "icing", "severity": 0}], **quiet)
    np.testing.assert_array_equal(campaigns.channel(neutral, "q_rad_s"), plain)
    found = campaigns.channel(weak, "q_rad_s")
    assert np.ptp(found) == pytest.approx(0.9 * np.ptp(plain), rel=2e-3)


def test_the_tail_of_an_aircraft_toml(gtm, tmp_path):
    assert tail_geometry(gtm).aspect_ratio == pytest.approx(6.8488**2 / 5.9018, rel=1e-6)
    assert (tail_geometry(gtm).arm, tail_geometry(gtm).lift) == (None, None)
    with_tail = copy_with(gtm, tmp_path / "a", TAIL)
    found = tail_geometry(with_tail)
    assert found.arm == pytest.approx(3.0 / 0.9153, rel=1e-6)
    assert found.lift == pytest.approx(0.9 * 4.0 * 1.3 / 5.9018, rel=1e-6)
    aft = flights.changed(with_tail, Change(declared=(DeclaredTerm("cg", 0.1),)), tmp_path / "b")
    assert tail_geometry(aft).arm == pytest.approx(found.arm - 0.1, rel=1e-6)
    assert tail_geometry(aft).lift == pytest.approx(found.lift, rel=1e-12)


@pytest.mark.parametrize(
    ("table", "problem"),
    [
        ("[tail]\narm = { value = -1.0, unit = 'm' }", "arm has to be above 0"),
        ("[tail]\narea = { value = 0.1, unit = 'm2' }", "state both or neither"),
        ("[tail]\narm = { value = 1.0, unit = 'kg' }", "tail.arm"),
        ("[tail]\nspan = { value = 1.0, unit = 'm' }", "tail.span"),
    ],
)
def test_a_tail_that_cannot_be(gtm, tmp_path, table, problem):
    with pytest.raises(AircraftError, match=problem):
        copy_with(gtm, tmp_path, table)


def copy_with(plane, folder, table):
    """The aircraft with a table more in its aircraft.toml."""
    made = flights.changed(plane, Change(), folder).folder
    path = made / "aircraft.toml"
    path.write_text(path.read_text(encoding="utf-8") + "\n" + table + "\n", encoding="utf-8")
    return planes.load(made)
