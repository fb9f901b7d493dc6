"""Tables probed from JSBSim fly as JSBSim does."""

import shutil

import numpy as np
import pytest

from airtruth import aircraft
from airtruth.errors import AircraftError
from airtruth.simulation.flight import Flight, Inputs
from airtruth.simulation.linearise import linearise
from airtruth.simulation.manoeuvres import Manoeuvre, sample
from airtruth.simulation.probe import (
    ForceGrid,
    alpha_dot_terms,
    grid_about,
    probe,
    with_breaks,
    with_breaks_of,
)
from airtruth.simulation.simulator import Condition
from airtruth.simulation.trim import trim
from airtruth.tracing.model.plant import looked_up
from airtruth.tracing.model.probed import probed, with_throttle
from airtruth.units import DEG
from studies.longitudinal_motion import model_of, simulate


@pytest.fixture(scope="module")
def model(gtm, paper_trim):
    return model_of(gtm, paper_trim)


@pytest.mark.parametrize("kind", ["doublet", "3211"])
def test_tables_fly_as_jsbsim_does(gtm, paper_trim, model, kind):
    t = np.arange(1001) / 200.0
    command = sample(Manoeuvre(kind, amplitude_rad=2.0 * DEG), t)
    still = np.zeros_like(t)
    flown = Flight(gtm, paper_trim, 1.0 / 200.0).fly(Inputs(command, still, still))
    motion = simulate(model, flown["elevator_rad"][None], 1.0 / 200.0)
    # JSBSim's own Adams-Bashforth integrator errs by 1.1e-3 of q at 200 Hz (facts of tests/fly/oracle.py).
    for name, relative in (
        ("alpha_rad", 3e-4),
        ("q_rad_s", 1.5e-3),
        ("az_m_s2", 5e-4),
        ("airspeed_m_s", 4e-3),
    ):
        error = getattr(motion, name)[0] - flown[name]
        assert np.abs(error).max() < relative * np.ptp(flown[name]), name


def test_the_trim_is_an_equilibrium_of_the_tables(model):
    motion = simulate(model, np.full((1, 101), model.elevator_rad), 0.02)
    assert np.abs(motion.alpha_rad - model.alpha_rad).max() < 1e-10
    assert np.abs(motion.airspeed_m_s - model.airspeed_m_s).max() < 1e-8
    # weight balances the forces: X = m g sin(alpha), Z = -m g cos(alpha) in level flight
    assert motion.ax_m_s2[0, 0] == pytest.approx(model.gravity_m_s2 * np.sin(model.alpha_rad), rel=1e-9)
    assert motion.az_m_s2[0, 0] == pytest.approx(-model.gravity_m_s2 * np.cos(model.alpha_rad), rel=1e-9)


def test_axes_hold_the_trim_and_the_breaks_of_the_tables(paper_trim, model):
    t = model.tables
    alpha, elevator, q = t.axes
    assert paper_trim.alpha_rad in alpha
    assert np.abs(elevator - paper_trim.elevator_rad).min() < 1e-15
    for axis, value in ((alpha, 4.0 * DEG), (alpha, 6.0 * DEG), (elevator, 0.0), (q, 0.0)):
        assert np.abs(axis - value).min() < 1e-12
    assert t.values.shape == (t.airspeed_m_s.size, alpha.size, elevator.size, q.size, 3)


def test_a_surface_that_feedback_moves_is_refused(gtm, paper_trim, tmp_path):
    shutil.copytree(gtm.folder, tmp_path / "gtm")
    path = tmp_path / "gtm" / "aircraft.toml"
    damper = 'model = "gtm"\nset = { "fcs/augmentation/damper-gain-s" = 0.5 }'
    path.write_text(path.read_text().replace('model = "gtm"', damper))
    with pytest.raises(AircraftError, match=r"moves by up to .* deg with alpha, q or airspeed"):
        probe(
            aircraft.load(tmp_path / "gtm"), paper_trim, grid_about(paper_trim, (2 * DEG, 2 * DEG, 20 * DEG))
        )


def test_a_command_beyond_the_surface_s_limits_is_refused(gtm, paper_trim):
    with pytest.raises(AircraftError, match="does not rise with its command"):
        probe(gtm, paper_trim, grid_about(paper_trim, (1 * DEG, 25 * DEG, 12 * DEG)))


TURBOPROP = """
name = "pc7"
[jsbsim]
model = "pc7"
root = "wheel"
set = { "gear/gear-cmd-norm" = 0.0, "propulsion/fuel_freeze" = 1.0, "fcs/advance-cmd-norm" = 1.0, "fcs/mixture-cmd-norm" = 1.0 }
engine_start_s = 60.0
[jsbsim.elevator]
command = "fcs/elevator-cmd-norm"
command_per_rad = 2.857142857142857
surface = "fcs/elevator-pos-rad"
[jsbsim.throttle]
command = ["fcs/throttle-cmd-norm"]
[jsbsim.lateral]
aileron = "fcs/aileron-cmd-norm"
rudder = "fcs/rudder-cmd-norm"
"""


@pytest.mark.slow
def test_the_tables_of_a_turboprop_have_its_power(tmp_path):
    """The tables balance the trim and have its derivatives; without power Cm was 0.01, and Cmde 19 % less."""
    (tmp_path / "aircraft.toml").write_text(TURBOPROP)
    plane = aircraft.load(tmp_path)
    at = trim(plane, Condition(52.7, 1500.0, 0.0))
    command = at.controls.command("elevator") + np.array([-DEG, 0.0, DEG])
    alpha = at.alpha_rad + np.array([-DEG, 0.0, DEG])
    tables = probe(plane, at, ForceGrid((alpha, command, np.zeros(1)), np.ones(1)))
    c = plane.constants
    moment = tables.values[0, :, :, 0, 2] / (
        0.5 * at.density_kg_m3 * at.airspeed_m_s**2 * c.wing_area_m2 * c.chord_m
    )
    assert abs(moment[1, 1]) < 1e-4
    declared = linearise(plane, at).central
    by_alpha = (moment[2, 1] - moment[0, 1]) / (2.0 * DEG)
    by_elevator = (moment[1, 2] - moment[1, 0]) / np.ptp(tables.axes[1])
    assert by_alpha == pytest.approx(declared[3], rel=0.01)
    assert by_elevator == pytest.approx(declared[5], rel=0.01)


@pytest.mark.slow
def test_the_plant_of_a_propeller_has_its_forces_at_other_angles_and_airspeeds(tmp_path):
    """Forces in states that the plant was not made from; in proportion to the dynamic pressure the pitch acceleration errs
    by 0.007 rad/s2 at 94 % and 105 % of the airspeed and 5 deg above the trim, as a line over it by 0.001."""
    (tmp_path / "aircraft.toml").write_text(
        TURBOPROP.replace("pc7", "DHC6").replace('-norm"]', '-norm", "fcs/throttle-cmd-norm[1]"]')
    )
    plane = aircraft.load(tmp_path)
    at = trim(plane, Condition(51.7, 1500.0, 0.0))
    plant = probed(plane, at, (at.alpha_rad, 8.0 * DEG), (at.elevator_rad, at.elevator_rad), 0.1)
    command = np.array([at.controls.command("elevator")])
    other = ForceGrid((np.array([5.0, 7.5]) * DEG, command, np.zeros(1)), np.array([0.94, 1.05]))
    tables = probe(plane, at, other)
    states = [(v, a) for v in range(3) for a in range(1, 3)]
    alpha = tables.axes[0][[a for _, a in states]]
    pressure = 0.5 * at.density_kg_m3 * tables.airspeed_m_s[[v for v, _ in states]] ** 2
    still = np.zeros(len(states))
    signals = {"alpha": alpha, "elevator": still + tables.axes[1][0], "qhat": still}
    _, z, moment = looked_up(plant, signals, pressure).T
    truth = np.array([tables.values[v, a, 0, 0] for v, a in states])
    assert np.abs(z - truth[:, 1]).max() < 0.001 * at.mass_kg
    assert np.abs(moment - truth[:, 2]).max() < 0.0015 * plane.constants.inertia_yy_kg_m2
    # a lever that is not the trim's: held straight
    held = with_throttle(plane, at, at.controls.throttle + 0.05)
    assert held.residual < 1e-5
    assert held.controls.held["aileron"] != at.controls.held["aileron"]


# -- breaks between the points of a grid


def broken(*breaks):
    """Two values of x: a line, and one whose slope changes by 1, -2, 1.5, ... at each break."""
    turns = (1.0, -2.0, 1.5, 0.7)

    def function(x):
        bends = sum(turn * max(x - at, 0.0) for turn, at in zip(turns, breaks, strict=False))
        return np.array([3.0 * x, x + bends])

    return function


POINTS = np.arange(6.0)


def test_a_straight_line_adds_no_point():
    np.testing.assert_array_equal(with_breaks_of(broken(), POINTS), POINTS)


@pytest.mark.parametrize("at", [0.1, 1.5, 2.37, 4.9])
def test_a_break_within_a_cell_is_located_to_rounding(at):
    found = with_breaks_of(broken(at), POINTS)
    np.testing.assert_allclose(found, np.sort([*POINTS, at]), rtol=0, atol=1e-12)


def test_several_breaks_within_a_cell_are_located_too():
    breaks = (2.16, 2.73)
    found = with_breaks_of(broken(*breaks), POINTS)
    assert max(np.abs(found - at).min() for at in breaks) < 1e-12


def test_cells_of_a_curve_are_halved_until_they_are_straight():
    """A parabola is off its chord by a quarter of the squared half-width at most: 1e-3 of its range after three halvings."""
    found = with_breaks_of(lambda x: np.array([x * x]), POINTS)
    middles, ends = 0.5 * (found[1:] + found[:-1]), 0.5 * (found[1:] ** 2 + found[:-1] ** 2)
    assert np.abs(ends - middles**2).max() <= 1e-3 * 25.0
    assert found.size > POINTS.size


def test_the_breaks_of_a_model_whose_tables_are_in_radians():
    """The slope of CL in c172x.xml doubles between 0.09 and 0.10 rad; the forces in body axes are slightly curved."""
    plane = aircraft.load("c172x")
    at = trim(plane, Condition(51.44, 1219.2))
    grid = ForceGrid(
        (np.arange(3.0, 9.0) * DEG, np.array([at.controls.command("elevator")]), np.zeros(1)), np.ones(1)
    )
    found = with_breaks(plane, at, grid).axes[0]
    assert max(np.abs(found - x).min() for x in (0.09, 0.10)) < 1e-4


def test_tables_in_whole_degrees_add_no_point(gtm, paper_trim):
    grid = grid_about(paper_trim)
    np.testing.assert_allclose(with_breaks(gtm, paper_trim, grid).axes[0], grid.axes[0], rtol=0, atol=0)


ALPHA_DOT = """<axis name="{axis}"><function name="aero/by-alpha-dot-{axis}"><product>
<property>aero/qbar-psf</property><property>metrics/Sw-sqft</property>{arm}<property>aero/ci2vel</property>
<property>aero/alphadot-rad_sec</property><value>{value}</value></product></function>"""
"""A term in alpha_dot at the start of an axis."""


def test_terms_in_alpha_dot_are_those_of_the_model(gtm, paper_trim, tmp_path):
    """The GTM has none; with a term in its file, that one. The rate derivatives contain it, so that they do not tell."""
    assert alpha_dot_terms(gtm, paper_trim) == pytest.approx([0.0, 0.0], abs=1e-8)
    folder = tmp_path / "gtm"
    shutil.copytree(gtm.folder, folder)
    model = folder / "gtm.xml"
    arm = "<property>metrics/cbarw-ft</property>"
    lagging = model.read_text().replace(
        '<axis name="PITCH">', ALPHA_DOT.format(axis="PITCH", arm=arm, value=-16.0)
    )
    model.write_text(lagging)
    assert alpha_dot_terms(aircraft.load(folder), paper_trim) == pytest.approx(
        [0.0, -16.0], rel=1e-3, abs=1e-6
    )
