"""Advice of the gate on imported logs: it never repeats the mapping, and a reconstruction that drifts is not a wrong unit."""

from pathlib import Path

import numpy as np
import pytest

from airtruth.checks.gate import inspect
from airtruth.importers import MappingFile, Source, convert
from validation.guess_flights import measured

SI = {
    "airspeed_m_s": "m/s",
    "alpha_rad": "rad",
    "theta_rad": "rad",
    "q_rad_s": "rad/s",
    "ax_m_s2": "m/s2",
    "az_m_s2": "m/s2",
    "elevator_rad": "rad",
    "altitude_m": "m",
    "density_kg_m3": "kg/m3",
}
FT, KT = 0.3048, 1852.0 / 3600.0


def faults(craft, scale=None, bias=None, units=None, leave=("density_kg_m3",), reconstruct=False):
    """Faults of a flight whose columns are scaled and shifted, under a mapping with some other units."""
    t = np.arange(1250) * 0.02
    scale, bias, units = scale or {}, bias or {}, units or {}
    names = [name for name in SI if name not in leave]
    arrays = {
        name: measured(craft, name, t, 4) * scale.get(name, 1.0) + bias.get(name, 0.0) for name in names
    }
    stated = {
        "time": {"column": "t"},
        "channels": {name: {"column": name, "unit": units.get(name, SI[name])} for name in names},
        "reconstruct": {"alpha": reconstruct},
    }
    source = Source(Path("f.csv"), {"t": t, **arrays})
    return inspect(convert(source, MappingFile.model_validate(stated)))


@pytest.mark.parametrize("craft", ["model", "single", "jet"])
def test_feet_that_the_mapping_states_are_no_fault(craft):
    found = faults(craft, {"altitude_m": 1.0 / FT}, units={"altitude_m": "ft"}, leave=())
    assert [fault.sentence for fault in found] == []


@pytest.mark.parametrize("craft", ["single", "jet"])
def test_a_wrong_airspeed_beside_right_feet_is_the_airspeed_s(craft):
    found = faults(
        craft, {"altitude_m": 1.0 / FT, "airspeed_m_s": 1.0 / KT}, units={"altitude_m": "ft"}, leave=()
    )
    assert [fault.channel for fault in found if fault.certain] == ["airspeed_m_s"]
    assert all('unit = "ft"' not in fault.sentence for fault in found)
    assert 'state unit = "kt" in place of "m_s"' in found[0].sentence


def test_metres_under_a_mapping_that_states_feet():
    """The density at 5200 m contradicts the altitude, and the cure differs from what the mapping states."""
    found = faults("jet", units={"altitude_m": "ft"}, leave=())
    (fault,) = [one for one in found if one.certain]
    assert fault.channel == "altitude_m"
    assert "metres taken as feet" in fault.sentence
    assert 'state unit = "m" in place of "ft"' in fault.sentence


@pytest.mark.parametrize("leave", [("alpha_rad",), ("alpha_rad", "theta_rad")])
@pytest.mark.parametrize("bias", [{"q_rad_s": 0.02}, {"az_m_s2": 0.5}, {"q_rad_s": -0.03, "az_m_s2": 0.3}])
@pytest.mark.parametrize("craft", ["model", "single"])
def test_a_reconstruction_that_drifts_is_no_wrong_unit(craft, bias, leave):
    """A gyro of 1.1 deg/s, an accelerometer of 0.05 g: what is said concerns the reconstruction, whose channels are named."""
    found = faults(craft, bias=bias, leave=(*leave, "density_kg_m3"), reconstruct=True)
    assert {fault.channel for fault in found} == {"alpha_rad"}
    for fault in found:
        assert fault.code in ("reconstructed", "impossible")
        assert "degrees" not in fault.sentence
        assert "reconstructed" in fault.sentence
