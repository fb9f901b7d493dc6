"""The exported lateral-directional system: its matrices by finite differences of the nonlinear equations, and its uncertainty."""

import numpy as np
import pytest

import airtruth as at
from airtruth.errors import ConfigurationError
from airtruth.exporting.model import SYSTEMS, FlightPoint, LinearModel
from airtruth.identification import identify, write_estimates
from airtruth.identification.record_constants import values_of
from airtruth.physics.motion import LATERAL
from airtruth.units import G0
from validation.affine_lateral import ALPHA, DENSITY, GTM, SPEED, THETA, fly, log_of, pitching

PITCH = 0.08
POINT = FlightPoint(SPEED, DENSITY, values_of(GTM, LATERAL), {"alpha_rad": ALPHA, "theta_rad": PITCH})


def rates_and_outputs(x, u):
    """Klein and Morelli, 3.2, of a steady straight flight: moments by the inertia tensor, the v equation with sin(beta)."""
    beta, p, r, phi = x
    half = GTM.span_m / (2.0 * SPEED)
    side, roll, yaw = THETA.reshape(3, 5) @ [beta, p * half, r * half, *u]
    pressure = 0.5 * DENSITY * SPEED**2 * GTM.wing_area_m2
    ay = pressure * side / GTM.mass_kg
    inertia = [[GTM.inertia_xx_kg_m2, -GTM.inertia_xz_kg_m2], [-GTM.inertia_xz_kg_m2, GTM.inertia_zz_kg_m2]]
    p_dot, r_dot = np.linalg.solve(inertia, pressure * GTM.span_m * np.array([roll, yaw]))
    along, down = SPEED * np.cos(beta) * np.cos(ALPHA), SPEED * np.cos(beta) * np.sin(ALPHA)
    v_dot = ay + p * down - r * along + G0 * np.cos(PITCH) * np.sin(phi)
    return np.array(
        [v_dot / (SPEED * np.cos(beta)), p_dot, r_dot, p + r * np.cos(phi) * np.tan(PITCH), *x, ay]
    )


def test_the_matrices_are_the_finite_differences_of_the_equations_of_motion():
    model = LinearModel(LATERAL, POINT, THETA, np.eye(15), "a test")
    step = 1e-5
    difference = np.stack(
        [
            (rates_and_outputs(z[:4], z[4:]) - rates_and_outputs(-z[:4], -z[4:])) / (2.0 * step)
            for z in step * np.eye(6)
        ],
        axis=1,
    )
    m = model.matrices
    np.testing.assert_allclose(
        np.block([[m["A"], m["B"]], [m["C"], m["D"]]]), difference, rtol=1e-8, atol=1e-8
    )
    assert model.states == ("beta_rad", "p_rad_s", "r_rad_s", "phi_rad")
    assert model.inputs == ("aileron_rad", "rudder_rad")
    assert model.outputs == ("beta_rad", "p_rad_s", "r_rad_s", "phi_rad", "ay_m_s2")


def test_an_estimate_gives_the_matrices_and_the_covariance_of_their_entries(tmp_path):
    """The covariance by central differences of the entries with respect to the derivatives."""
    result = identify(log_of(fly(q=pitching, runs=2, gust=0.4, seed=2)), GTM, ["ls"], motion=LATERAL)
    write_estimates(tmp_path / "estimates-lateral.parquet", result)
    run = result.run_ids[1]
    model = at.export(tmp_path, tmp_path / "m.json", method="ls", run_id=run)
    own = result.of("ls")
    np.testing.assert_allclose(model.derivatives, own.theta[1], rtol=1e-14)
    np.testing.assert_allclose(model.derivative_covariance, own.covariance[1], rtol=1e-9, atol=1e-20)
    assert model.point.trim["alpha_rad"] == own.scale.alpha_rad[1]

    def entries(theta):
        return np.concatenate([m.ravel() for m in SYSTEMS["lateral"](theta, model.point)])

    slopes = np.stack(
        [(entries(own.theta[1] + h) - entries(own.theta[1] - h)) / 2e-3 for h in 1e-3 * np.eye(15)], axis=1
    )
    expected = slopes @ own.covariance[1] @ slopes.T
    scale = np.abs(expected).max(axis=1)
    np.testing.assert_allclose(model.covariance, expected, rtol=1e-7, atol=1e-9 * scale.max())
    modes = np.linalg.eigvals(model.matrices["A"])
    pair = modes[modes.imag > 0.0]
    row = result.to_frame().iloc[1]
    assert np.abs(pair[0]) == pytest.approx(row["dutch_roll_wn_rad_s"], rel=1e-9)


def test_a_file_without_the_flight_condition_is_refused(tmp_path):
    result = identify(log_of(fly(q=pitching, runs=2, gust=0.4, seed=2)), GTM, ["ls"], motion=LATERAL)
    file = tmp_path / "estimates-lateral.parquet"
    write_estimates(file, result)
    from airtruth.identification.stored import read_stored
    from airtruth.logs.store import write_table

    frame, _ = read_stored(file)
    write_table(file, frame.drop(columns="alpha_rad"))
    with pytest.raises(ConfigurationError, match="alpha_rad, theta_rad"):
        at.export(file, method="ls")
