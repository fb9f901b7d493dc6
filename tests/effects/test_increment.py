"""Learned increments: the spline and its terms, the table that an aircraft flies, and the closed forms of a table."""

import math
from dataclasses import replace

import jsbsim
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from airtruth.aircraft.write import write_aircraft
from airtruth.effects.closed_form import closed_forms
from airtruth.effects.increment import Memory, Shape, increment
from airtruth.physics.terms import AeroTerm, Change, shape_of

SHAPE = Shape("Cm", "alpha", 0.02, 0.18, 8, trim=0.07)
BENDS = [0.002, -0.001, 0.003, -0.004, 0.002, 0.001, -0.002]
SLOPE = 0.0015
SWITCH = replace(SHAPE, memory=Memory("play", half_width=0.005), step_cell=4)


def values_of(shape, bends, slope=SLOPE):
    return {f"bend_{k + 1}": float(b) for k, b in enumerate(bends)} | {"slope": slope}


def total(change, signal):
    return sum(t.amplitude * shape_of(t, signal) for t in change.aero)


def by_hand(shape, bends, x, slope=0.0):
    """Slope changes summed from the trim outwards, the definition in the module's head."""
    width = (shape.high - shape.low) / shape.cells
    inside = min(max(x, shape.low), shape.high)
    y = slope / width * (inside - shape.trim)
    for k, b in enumerate(bends):
        knot = shape.low + (k + 1) * width
        if knot > shape.trim and inside > knot:
            y += b / width * (inside - knot)
        if knot <= shape.trim and inside < knot:
            y += b / width * (inside - knot)
    return y


@given(
    x=st.floats(-0.5, 0.5),
    bends=st.lists(st.floats(-0.01, 0.01), min_size=7, max_size=7),
    slope=st.floats(-0.01, 0.01),
)
def test_terms_are_the_spline_through_zero_at_the_trim_and_constant_outside(x, bends, slope):
    change = increment(SHAPE).change(values_of(SHAPE, bends, slope))
    expected = by_hand(SHAPE, bends, x, slope)
    np.testing.assert_allclose(total(change, x), expected, atol=1e-14)
    np.testing.assert_allclose(SHAPE.basis(np.array([x]))[0] @ [*bends, slope], expected, atol=1e-14)


def test_it_is_its_slope_in_the_cell_of_the_trim():
    change = increment(SHAPE).change(values_of(SHAPE, BENDS))
    cell = np.linspace(0.06, 0.08, 5)  # the third cell of eight from 0.02 to 0.18, 0.02 rad wide
    np.testing.assert_allclose(total(change, cell), SLOPE / 0.02 * (cell - 0.07), atol=1e-16)


@pytest.mark.parametrize(
    ("shape", "has_slope"),
    [
        (Shape("CL", "elevator", -0.1, 0.1, 4, 0.0), True),
        (Shape("Cm", "qhat", -0.01, 0.01, 4, 0.0), True),
        (Shape("Cm", "alpha_dot_hat", -0.01, 0.01, 4, 0.0), True),
        (Shape("alpha_rad", "alpha", 0.0, 0.2, 4, 0.05), True),
        (Shape("Cm", "alpha", 0.0, 0.2, 4, 0.05, Memory("lag", 0.2)), True),
        (Shape("Cm", "alpha", 0.0, 0.2, 4, 0.05, None, "elevator", 0.0), True),
        (Shape("CX", "alpha", 0.0, 0.2, 4, 0.05), False),
        (Shape("alpha_rad", "qbar", 500.0, 900.0, 4, 700.0, Memory("lag", 0.1), "alpha", 0.1), False),
    ],
)
def test_every_function_has_a_slope_but_those_of_the_axial_force_and_of_a_lag(shape, has_slope):
    names = [p.name for p in increment(shape).parameters]
    assert ("slope" in names) == has_slope
    assert increment(shape).bends == 3 + has_slope


def test_a_held_slope_has_next_to_no_prior_deviation():
    held = increment(SHAPE, prior_std=0.01).with_slope_held()
    assert [p.prior_std for p in held.parameters[:-1]] == [0.01] * 7
    assert held.parameters[-1].prior_std < 1e-5 * held.parameters[-1].high


@pytest.mark.parametrize(
    ("cell", "expected"),
    [
        (4, lambda u: np.clip((u - 0.10) / 0.02, 0.0, 1.0)),
        (0, lambda u: np.clip((u - 0.04) / 0.02, -1.0, 0.0)),
        (2, lambda u: (np.clip(u, 0.06, 0.08) - 0.07) / 0.02),
    ],
    ids=["above the trim", "below", "about it"],
)
def test_a_step_rises_over_its_cell_and_is_zero_at_the_trim(cell, expected):
    """The cells are 0.02 rad wide from 0.02 rad, the trim is 0.07 rad."""
    effect = increment(replace(SWITCH, step_cell=cell))
    change = effect.change({"step": -0.01})
    x = np.linspace(0.0, 0.2, 81)
    assert [p.name for p in effect.parameters] == ["step"]
    assert {t.signal for t in change.aero} == {change.states[0].name}
    assert change.states[0].half_width == 0.005
    np.testing.assert_allclose(total(change, x), -0.01 * expected(x), atol=1e-15)
    np.testing.assert_allclose(effect.shape.basis(x)[:, 0], expected(x), atol=1e-13)


def test_a_linear_part_behind_a_lag_vanishes_at_rest():
    shape = Shape("CL", "alpha", 0.0, 0.2, 0, trim=0.05, memory=Memory("lag", 0.3))
    change = increment(shape).change({"share": 0.4, "time_s": 0.3})
    (state,) = change.states
    assert (state.kind, state.signal, state.time_s) == ("lag", "alpha", 0.3)
    assert [(t.signal, t.amplitude, t.at) for t in change.aero] == [
        (state.name, 0.4, 0.05),
        ("alpha", -0.4, 0.05),
    ]


def test_a_prior_applies_to_the_bends_and_not_to_the_times():
    effect = increment(Shape("Cm", "alpha", 0.0, 0.2, 4, 0.05, Memory("lag", 0.2)), prior_std=0.01)
    assert [p.prior_std for p in effect.parameters] == [0.01] * 4 + [math.inf]


@pytest.mark.parametrize(
    "change",
    [increment(SHAPE).change(values_of(SHAPE, BENDS)), increment(SWITCH).change({"step": -0.01})],
    ids=["function", "step"],
)
def test_the_written_table_is_the_increment_and_flags_its_range(tmp_path, change):
    """JSBSim interpolates the written table, slope and all; the expected values are those of the terms.

    The state of a play is at first its signal.
    """
    folder = write_aircraft("gtm", change, tmp_path / "learned")
    text = (folder / "learned.xml").read_text()
    assert "<tableData>" in text
    fdm = jsbsim.FGFDMExec(str(tmp_path), None)
    fdm.set_debug_level(0)
    fdm.set_aircraft_path(str(tmp_path))
    assert fdm.load_model("learned")
    for alpha_deg in (-5.0, 1.3, 4.0, 7.7, 10.0, 12.0):
        fdm["ic/vt-kts"], fdm["ic/h-sl-ft"], fdm["ic/alpha-deg"] = 80.0, 7000.0, alpha_deg
        fdm.run_ic()
        expected = total(change, math.radians(alpha_deg))
        assert fdm["aero/effects/Cm-table-1"] == pytest.approx(float(expected), abs=1e-12)
        outside = not 0.02 <= math.radians(alpha_deg) <= 0.18
        assert fdm["aero/effects/Cm-table-1-outside"] == float(outside)


def test_a_break_beside_an_increment_leaves_its_table(tmp_path):
    """Both act on Cm over alpha; the break is a formula of its own."""
    broken = AeroTerm("Cm", "alpha", "above", -0.4, 0.1)
    change = increment(SHAPE).change(values_of(SHAPE, BENDS)) + Change(aero=(broken,))
    folder = write_aircraft("gtm", change, tmp_path / "both")
    text = (folder / "both.xml").read_text()
    assert "aero/effects/Cm-table-1-outside" in text
    assert "aero/effects/Cm-1" in text


def test_a_single_break_is_still_written_as_a_formula(tmp_path):
    folder = write_aircraft(
        "gtm", Change(aero=(AeroTerm("Cm", "alpha", "above", -0.4, 0.1),)), tmp_path / "one"
    )
    assert "Cm-table" not in (folder / "one.xml").read_text()


@pytest.mark.parametrize(
    ("name", "truth", "expected"),
    [
        ("break above", lambda x: -0.4 * np.maximum(x - 0.1, 0.0), {"slope": -0.4, "at": 0.1}),
        ("break below", lambda x: 0.3 * np.minimum(x - 0.05, 0.0), {"slope": 0.3, "at": 0.05}),
        (
            "step above",
            lambda x: -0.01 * np.clip((x - 0.11) / 0.03, 0.0, 1.0),
            {"step": -0.01, "at": 0.11, "width": 0.03},
        ),
        ("curve", lambda x: 2.0 * (x - 0.06) ** 2, {"curvature": 2.0}),
        ("line", lambda x: 5.0 * (x - 0.06), {"slope": 5.0}),
    ],
)
def test_closed_forms_recover_what_made_the_table(name, truth, expected):
    x = np.linspace(0.0, 0.2, 41)
    near = np.abs(x - 0.06) < 1e-9
    best = closed_forms(x, truth(x), np.where(near, 0.0, 1e-4), float(x[near].mean()))[0]
    assert best.name == name
    assert best.is_as_good
    for key, value in expected.items():
        assert best.values[key] == pytest.approx(value, rel=2e-3)


@pytest.mark.parametrize("trim", [0.06, 0.0425])
def test_a_break_below_the_trim_is_recovered_from_its_difference_from_the_trim(trim):
    """The table of a break at 0.04 is a line through zero at the trim, and flat below 0.04; the trim may be next to it."""
    x = np.linspace(0.0, 0.2, 41)
    table = -0.4 * (np.maximum(x - 0.04, 0.0) - (trim - 0.04))
    best = closed_forms(x, table, np.full(41, 1e-4), trim)[0]
    assert best.name == "break above"
    assert best.values == pytest.approx({"slope": -0.4, "at": 0.04}, rel=1e-6)


def test_no_closed_form_is_as_good_as_a_table_that_oscillates():
    x = np.linspace(0.0, 0.2, 21)
    assert not any(f.is_as_good for f in closed_forms(x, 0.01 * np.sin(150.0 * x), np.full(21, 1e-4), 0.1))
