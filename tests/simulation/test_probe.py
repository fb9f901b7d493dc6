"""Tables probed from JSBSim fly as JSBSim does."""

import shutil

import numpy as np
import pytest

from airtruth import aircraft
from airtruth.errors import AircraftError
from airtruth.physics.longitudinal import simulate
from airtruth.simulation.flight import Flight, Inputs
from airtruth.simulation.manoeuvres import Manoeuvre, sample
from airtruth.simulation.probe import grid_about, probe
from airtruth.units import DEG


@pytest.fixture(scope="module")
def model(gtm, paper_trim):
    return probe(gtm, paper_trim)


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
    assert paper_trim.alpha_rad in t.alpha_rad
    assert np.abs(t.elevator_rad - paper_trim.elevator_rad).min() < 1e-15
    for axis, value in (
        (t.alpha_rad, 4.0 * DEG),
        (t.alpha_rad, 6.0 * DEG),
        (t.elevator_rad, 0.0),
        (t.q_rad_s, 0.0),
    ):
        assert np.abs(axis - value).min() < 1e-12
    assert t.values.shape == (t.airspeed_m_s.size, t.alpha_rad.size, t.elevator_rad.size, t.q_rad_s.size, 3)


def test_a_surface_that_feedback_moves_is_refused(gtm, paper_trim, tmp_path):
    shutil.copytree(gtm.folder, tmp_path / "gtm")
    path = tmp_path / "gtm" / "aircraft.toml"
    damper = 'model = "gtm"\nset = { "fcs/augmentation/damper-gain-s" = 0.5 }'
    path.write_text(path.read_text().replace('model = "gtm"', damper))
    with pytest.raises(AircraftError, match=r"moves by up to .* deg with alpha, q or airspeed"):
        probe(aircraft.load(tmp_path / "gtm"), paper_trim, grid_about(paper_trim, 2 * DEG, 2 * DEG, 20 * DEG))


def test_a_command_beyond_the_surface_s_limits_is_refused(gtm, paper_trim):
    with pytest.raises(AircraftError, match="does not rise with its command"):
        probe(gtm, paper_trim, grid_about(paper_trim, 1 * DEG, 25 * DEG, 12 * DEG))
