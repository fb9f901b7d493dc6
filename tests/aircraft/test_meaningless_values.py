"""aircraft.toml refuses numbers that no aircraft has."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from airtruth.aircraft.file import AircraftFile

GEOMETRY = {
    "wing_area": {"value": 0.45, "unit": "m2"},
    "chord": {"value": 0.25, "unit": "m"},
    "span": {"value": 1.8, "unit": "m"},
}
MASS = {"mass": {"value": 3.0, "unit": "kg"}, "inertia_yy": {"value": 0.22, "unit": "kg_m2"}}


@pytest.mark.parametrize("value", [0.0, -1.0])
@pytest.mark.parametrize(
    ("table", "name"), [*(("geometry", n) for n in GEOMETRY), *(("mass", n) for n in MASS)]
)
def test_a_size_that_is_not_above_zero_is_refused(table, name, value):
    tables = {"geometry": dict(GEOMETRY), "mass": dict(MASS)}
    AircraftFile.model_validate({"name": "a", **tables})
    tables[table][name] = {**tables[table][name], "value": value}
    with pytest.raises(ValidationError, match=f"{name} has to be above 0"):
        AircraftFile.model_validate({"name": "a", **tables})


def test_an_elevator_that_pitches_the_nose_up_is_refused():
    for value in (-1.0, 0.0):
        AircraftFile.model_validate({"name": "a", "derivatives": {"Cmde": {"value": value}}})
    with pytest.raises(ValidationError, match=r"Cmde has to be below 0 .* for a canard"):
        AircraftFile.model_validate({"name": "a", "derivatives": {"Cmde": {"value": 1.0}}})
