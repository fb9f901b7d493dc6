"""The closed-loop study: its aircraft, its auxiliary model, and which estimators it finds consistent."""

from dataclasses import replace

import numpy as np
import pytest

from airtruth import aircraft
from airtruth.identification import Options, identify_batch
from airtruth.physics.motion import LONGITUDINAL
from airtruth.simulation.flight import Flight, Inputs
from airtruth.simulation.linearise import linearise
from airtruth.simulation.manoeuvres import Manoeuvre, sample
from airtruth.simulation.probe import grid_about
from airtruth.simulation.trim import trim
from airtruth.units import DEG
from studies import closed_loop_study as study
from studies.affine_aircraft import affine_copy
from studies.longitudinal_motion import auxiliary, model_of

pytestmark = pytest.mark.slow

CLALPHA, CMALPHA, CMQ = (LONGITUDINAL.parameters.index(name) for name in ("CLalpha", "Cmalpha", "Cmq"))


@pytest.fixture(scope="module")
def affine(gtm, paper_trim, tmp_path_factory):
    folder = tmp_path_factory.mktemp("affine") / "gtm"
    return aircraft.load(affine_copy(gtm.folder, folder, paper_trim.alpha_rad, paper_trim.elevator_rad))


@pytest.fixture(scope="module")
def affine_trim(affine, paper_condition):
    return trim(affine, paper_condition)


def test_affine_copy_keeps_trim_and_slopes_and_has_no_breaks(gtm, paper_trim, affine, affine_trim):
    assert affine_trim.alpha_rad == pytest.approx(paper_trim.alpha_rad, abs=1e-9)
    assert affine_trim.elevator_rad == pytest.approx(paper_trim.elevator_rad, abs=1e-9)
    linear = linearise(affine, affine_trim)
    np.testing.assert_allclose(linear.plus, linearise(gtm, paper_trim).plus, rtol=1e-6)
    np.testing.assert_allclose(linear.plus, linear.minus, rtol=1e-3)  # what is left is the turn of the axes


@pytest.mark.parametrize("gain_s", [0.0, 0.3, 0.6])
def test_loop_auxiliary_is_the_loop_of_the_aircraft(affine, affine_trim, gain_s):
    t = np.arange(401) / 200.0
    command = sample(Manoeuvre("doublet", amplitude_rad=0.2 * DEG, start_s=0.5), t)
    still = np.zeros_like(t)
    inputs = Inputs(command, still, still, damper_gain_s=gain_s)
    flown = Flight(affine, affine_trim, 1.0 / 200.0).fly(inputs)
    linear = linearise(affine, affine_trim)
    scale = replace(linear.scale, **{k: np.array([float(v)]) for k, v in vars(linear.scale).items()})
    loop = study.loop_auxiliary(gain_s, 2.0 * np.pi * 5.0, 0.015, study.DAMPER_DELAY_S)
    # the airspeed changes in flight: 1 % of alpha after two seconds
    for name, values in zip(
        ("alpha_rad", "q_rad_s", "elevator_rad"),
        loop(linear.plus[None], command[None], 0.005, scale),
        strict=True,
    ):
        deviation = flown[name] - flown[name][0]
        assert np.abs(values[0] - deviation).max() < 0.015 * np.ptp(deviation), name


def test_noise_in_the_loop_spares_only_instruments_made_of_the_reference(affine, affine_trim):
    """150 runs jointly, damper 0.6 s, four times the sensors' noise; spread of Cmalpha about 1.2 %."""
    level = study.Level(0.6, 0.0, 4.0)
    batch = study.fly(affine.folder, level, 150, 5)
    truth = linearise(affine, affine_trim).plus
    error = {
        label: study.joint(batch, 150, affine, method, options)[0] / truth - 1.0
        for label, (method, options) in study.estimators(batch, level, affine).items()
    }
    assert error["ls"][CMQ] < -0.4
    assert error["iv-lowpass"][CMALPHA] < -0.07
    assert error["iv-f1"][CMALPHA] < -0.06
    assert abs(error["iv-reference"][CMALPHA]) < 0.05
    assert abs(error["iv-f1, loop"][CMALPHA]) < 0.05


def test_gusts_in_the_loop_spare_the_filter_with_gusts_in_its_model(affine, affine_trim):
    """40 runs jointly, damper 0.6 s, twice the light gusts; standard error of filter error 0.3 % (lift) to 0.6 % (Cmq).

    Output error has no gusts, and instruments predicted from earlier samples contain those that persist.
    """
    batch = study.fly(affine.folder, study.Level(0.6, 2.0, 1.0), 40, 303)
    truth = linearise(affine, affine_trim).plus
    options = Options(covariance="none")
    error = {
        method: study.joint(batch, 40, affine, method, options)[0] / truth - 1.0
        for method in ("ls", "iv-kalman", "filter-error", "output-error")
    }
    shown = [LONGITUDINAL.parameters.index(name) for name in study.SHOWN]
    assert np.abs(error["filter-error"][shown]).max() < 0.03
    assert error["ls"][CLALPHA] < -0.1
    assert error["iv-kalman"][CLALPHA] < -0.04
    assert error["output-error"][CMQ] > 0.4


@pytest.mark.long
def test_nonlinear_auxiliary_changes_nothing_where_the_aircraft_is_affine(affine, affine_trim):
    batch = study.fly(affine.folder, study.Level(0.0, 1.0, 1.0), 20, 5)
    model = model_of(affine, affine_trim, grid_about(affine_trim, (8 * DEG, 4 * DEG, 48 * DEG)))
    plain = Options(covariance="none", tolerance=1e-4)
    linear = identify_batch(batch, affine, "iv-f1", plain)
    declared = linearise(affine, affine_trim).plus
    tables = identify_batch(batch, affine, "iv-f1", replace(plain, auxiliary=auxiliary(model, declared)))
    assert tables.converged.all()
    difference = (tables.theta - linear.theta).mean(axis=0) / linear.theta.std(axis=0)
    assert np.abs(difference[3:]).max() < 0.3
