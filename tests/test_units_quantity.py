"""Units at the border, and the two notations of a quantity."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from airtruth import quantity as qt
from airtruth import units
from airtruth.effects.registry import EFFECTS
from airtruth.errors import ConfigurationError, choices

# International yard and pound agreement of 1959; nautical mile of 1929; CGPM 1901; NIST SP 811, appendix B.8.
PUBLISHED = [
    ("length", "ft", 0.3048),
    ("length", "in", 0.0254),
    ("speed", "kt", 1852 / 3600),
    ("speed", "km_h", 1 / 3.6),
    ("mass", "lb", 0.45359237),
    ("mass", "slug", 14.59390),
    ("force", "lbf", 4.448222),
    ("acceleration", "g", 9.80665),
    ("pressure", "psf", 47.88026),
    ("inertia", "slug_ft2", 1.355818),
    ("density", "slug_ft3", 515.3788),
    ("moment", "lbf_ft", 1.355818),
    ("angle", "deg", math.pi / 180),
    ("area", "ft2", 0.09290304),
    ("ratio", "pct", 0.01),
    ("time", "ms", 1e-3),
    ("angular_rate", "deg_s", math.pi / 180),
    ("frequency", "hz", 1.0),
]


@pytest.mark.parametrize(("dimension", "unit", "value"), PUBLISHED)
def test_factors_are_the_published_ones(dimension, unit, value):
    assert units.factor(dimension, unit) == pytest.approx(value, rel=1e-6)


def test_every_dimension_starts_with_its_si_unit():
    assert all(next(iter(table.values())) == 1.0 for table in units.UNITS.values())


def test_unknown_unit_is_a_key_error():
    with pytest.raises(KeyError):
        units.factor("length", "furlong")


@given(value=st.floats(-1e6, 1e6), data=st.data())
def test_a_table_and_a_key_with_the_same_unit_agree(value, data):
    dimension = data.draw(st.sampled_from([d for d in units.UNITS if d != "ratio"]))
    unit = data.draw(st.sampled_from(list(units.UNITS[dimension])))
    table = qt.table_in(dimension, {"value": value, "unit": unit})
    key = qt.keys_to_si({f"x_{unit}": value}, {"x": dimension})
    assert table.value == key["x"] == value * units.factor(dimension, unit)


def test_an_integer_beyond_any_float_is_refused():
    words = r"is too large; write a number between -1e\+15 and 1e\+15"
    with pytest.raises(ValueError, match=words):
        qt.table_in("mass", {"value": 10**400, "unit": "lb"})
    with pytest.raises(ValueError, match=words):
        qt.keys_to_si({"eas_kt": {"mean": -(10**400), "std": 1}}, {"eas": "speed"})
    with pytest.raises(ConfigurationError, match="delay_ms has to be between"):
        EFFECTS["elevator_delay"].read({"delay_ms": 10**400})


@pytest.mark.parametrize("key", ["value", "std"])
def test_true_is_no_quantity(key):
    with pytest.raises(ValidationError, match=r"write a number \(got True\)"):
        qt.table_in("mass", {"value": 1.0, "unit": "kg", key: True})


def test_std_and_source_go_with_the_value():
    read = qt.table_in("mass", {"value": 2.0, "std": 0.5, "unit": "lb", "source": "scales"})
    assert (read.value, read.std, read.source) == (2 * units.LB, 0.5 * units.LB, "scales")


@pytest.mark.parametrize(
    ("raw", "message"),
    [
        (3.0, r"write it as \{ value = ..., unit = \"...\" \}; units: use one of kg, lb, slug"),
        ({"value": 3.0}, r"unit None is not a unit of mass; use one of kg, lb, slug"),
        ({"value": 3.0, "unit": "m"}, r"unit 'm' is not a unit of mass"),
        ({"value": 3.0, "unit": "kg", "sigma": 1.0}, r"sigma"),
        ({"value": 3.0, "unit": "kg", "std": -1.0}, r"greater than or equal to 0"),
        ({"value": math.nan, "unit": "kg"}, r"finite"),
        ({"unit": "kg"}, r"value"),
    ],
)
def test_bad_tables(raw, message):
    with pytest.raises(ValueError, match=message):
        qt.table_in("mass", raw)


def test_ratio_needs_no_unit_and_takes_per_cent():
    assert qt.table_in("ratio", {"value": 0.25}).value == 0.25
    assert qt.table_in("ratio", {"value": 25.0, "unit": "pct"}).value == 0.25


def test_keys_scale_numbers_in_lists_and_tables_but_no_flags():
    read = qt.keys_to_si(
        {"x_ft": {"mean": 1.0, "choose": [2, 3.0]}, "y_ms": True, "z": "text"},
        {"x": "length", "y": "time"},
    )
    assert read == {"x": {"mean": 0.3048, "choose": [2 * 0.3048, 3.0 * 0.3048]}, "y": True, "z": "text"}


def test_keys_with_a_wrong_unit_or_none_are_left_for_the_model_to_refuse():
    dimensions = {"eas": "speed", "wind": "speed"}
    read = qt.keys_to_si({"eass_kt": 1.0, "wind_ft": 2.0, "eas": 3.0, "name": ""}, dimensions)
    assert "eas" not in read
    assert {"eass_kt": 1.0, "wind_ft": 2.0, "name": ""}.items() <= read.items()
    with pytest.raises(ValueError, match="wind is given twice, in two units"):
        qt.keys_to_si({"wind_kt": 1.0, "wind_m_s": 1.0}, dimensions)


def test_the_longest_name_that_fits_wins():
    dimensions = {"start": "time", "start_delay": "time"}
    assert qt.keys_to_si({"start_delay_ms": 5.0}, dimensions) == {"start_delay": 0.005}


def test_problems_of_a_model_carry_their_path_and_the_nearest_name():
    class Inner(qt.Strict):
        chord: qt.Length

    class Outer(qt.Strict):
        inner: Inner
        count: int = 0

    with pytest.raises(ValidationError) as caught:
        Outer.model_validate({"inner": {"chord": {"value": 1.0, "unit": "kg"}, "cord": 1}, "count": "many"})
    said = qt.explain(caught.value, Outer)
    assert len(said) == 3
    assert "inner.chord: unit 'kg' is not a unit of length; use one of m, ft, in, mm, cm, km, fl" in said
    assert "inner.cord: unknown key; did you mean 'chord'? allowed: chord" in said
    assert any(s.startswith("count: ") and "(got 'many')" in s for s in said)


def test_choices_suggest_only_what_is_near():
    assert choices("doublte", ["doublet", "step"]) == "did you mean 'doublet'? allowed: doublet, step"
    assert choices("xyz", ["step", "doublet"]) == "allowed: doublet, step"
