"""Traced effects taken out of lateral records: arms, late surfaces, inertias and increments against independent solutions."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from airtruth import aircraft as planes
from airtruth.logs.flight_log import FlightLog
from airtruth.physics.lateral import lateral_system
from airtruth.physics.motion import LATERAL
from airtruth.physics.sensors import rotation_acceleration, side_vane_equation
from airtruth.physics.terms import AeroTerm, Change, DeclaredTerm, SensorTerm, SurfaceTerm
from airtruth.tracing.compensate import (
    Compensation,
    RunCondition,
    compensated_log,
    treatment_of,
    updated_constants,
)
from airtruth.tracing.increment_response import increments, response
from tests.physics.test_lateral import GTM, SPEED, THETA, full_equations, gtm_scale

DT = 0.01
T = DT * np.arange(501)


def log(**channels):
    still = {name: np.zeros(len(T)) for name in (*LATERAL.output_channels, "aileron_rad", "rudder_rad")}
    air = {"airspeed_m_s": np.full(len(T), SPEED), "density_kg_m3": np.full(len(T), 0.9931)}
    return FlightLog({}, ("r1",), np.array([0, len(T)]), T, {**air, **still, **channels})


def taken(**changed):
    return Compensation((RunCondition(SPEED, THETA),), motion=LATERAL, **changed)


def test_a_boom_is_undone_with_both_rates():
    beta, p, r = 0.05 * np.sin(2.0 * T), 0.4 * np.cos(3.0 * T), 0.2 * np.sin(T)
    vane = side_vane_equation(beta, p, r, 1.5, 0.3, SPEED)
    terms = (SensorTerm("beta_rad", "arm", 1.5), SensorTerm("beta_rad", "arm_down", 0.3))
    found = compensated_log(log(beta_rad=vane, p_rad_s=p, r_rad_s=r), GTM, taken(sensors=terms))
    np.testing.assert_allclose(found.channels["beta_rad"], beta, atol=2e-5)


def test_an_accelerometer_off_the_cg():
    p, r = 0.4 * np.cos(3.0 * T), 0.2 * np.sin(T)
    changes = -1.2 * np.sin(3.0 * T), 0.2 * np.cos(T)
    still = np.zeros(len(T))
    ay = rotation_acceleration((p, still, r), (changes[0], still, changes[1]), (0.5, 0.0, 0.2))[1]
    terms = (SensorTerm("ay_m_s2", "arm", 0.5), SensorTerm("ay_m_s2", "arm_down", 0.2))
    found = compensated_log(log(ay_m_s2=ay, p_rad_s=p, r_rad_s=r), GTM, taken(sensors=terms))
    inside = (T > 0.5) & (T < 4.5)
    np.testing.assert_allclose(found.channels["ay_m_s2"][inside], 0.0, atol=0.01)
    assert np.abs(ay).max() > 0.2


def test_a_late_rudder_is_replaced_and_the_ailerons_stay():
    deflections = {"aileron_rad": 0.03 * np.sin(4.0 * T), "rudder_rad": 0.05 * np.sin(3.0 * T)}
    own = taken(surface=(SurfaceTerm("delay", 0.08, "rudder"),))
    found = compensated_log(log(**deflections), GTM, own).channels
    np.testing.assert_array_equal(found["aileron_rad"], deflections["aileron_rad"])
    late = T > 0.08
    np.testing.assert_allclose(found["rudder_rad"][late], 0.05 * np.sin(3.0 * (T[late] - 0.08)), atol=1e-5)


def test_inertias_and_their_product():
    gtm = planes.load("gtm")
    own = taken(declared={"mass": 1.0, "inertia_xx": 1.2, "inertia_zz": 1.0, "inertia_xz": 0.05})
    moved, before = updated_constants(gtm, own).constants, gtm.constants
    assert moved.inertia_xx_kg_m2 == pytest.approx(1.2 * before.inertia_xx_kg_m2)
    assert moved.inertia_zz_kg_m2 == before.inertia_zz_kg_m2
    shift = 0.05 * np.sqrt(before.inertia_xx_kg_m2 * before.inertia_zz_kg_m2)
    assert moved.inertia_xz_kg_m2 == pytest.approx(before.inertia_xz_kg_m2 + shift)


def test_the_response_is_that_of_the_equations_of_motion():
    """Small increments of the three coefficients: the difference of two integrated nonlinear motions."""
    scale = gtm_scale()
    each = np.array([0.01 * np.sin(3.0 * T), 0.002 * np.sin(2.0 * T), -0.003 * np.cos(4.0 * T)])

    def rates(t, x):
        at = np.array([np.interp(t, T, row) for row in each])
        own = full_equations(x, 0.0, 0.0, scale)[0]
        q_s = scale.force * GTM.mass_kg
        inertia = np.array(
            [
                [GTM.inertia_xx_kg_m2, -GTM.inertia_xz_kg_m2],
                [-GTM.inertia_xz_kg_m2, GTM.inertia_zz_kg_m2],
            ]
        )
        more = np.linalg.solve(inertia, q_s * GTM.span_m * at[1:])
        return own + np.array([scale.force * at[0] / SPEED, *more, 0.0])

    flown = solve_ivp(rates, (0.0, T[-1]), np.zeros(4), t_eval=T, rtol=1e-8, atol=1e-10, max_step=DT).y
    runs = SimpleNamespace(**{k: np.atleast_1d(v) for k, v in vars(scale).items()})
    found = response(THETA, type(scale)(**vars(runs)), each[:, None], DT)[:, 0]
    largest = np.abs(flown).max(axis=1)
    np.testing.assert_allclose(found[:4], flown, atol=0.01 * largest.max())
    c = lateral_system(THETA, scale).c
    np.testing.assert_allclose(found[4], c[4] @ found[:4] + scale.force * each[0], atol=1e-9)


def test_increments_of_each_coefficient():
    signals = {"beta": np.array([0.1, 0.2]), "rudder": np.array([0.0, 0.05])}
    terms = (AeroTerm("Cn", "beta", "linear", 0.3), AeroTerm("CY", "rudder", "linear", -0.2))
    found = increments(terms, signals, LATERAL)
    np.testing.assert_allclose(found, [[0.0, -0.01], [0.0, 0.0], [0.03, 0.06]])


def test_treatments_name_the_motion():
    surface = treatment_of("rudder_delay", Change(surface=(SurfaceTerm("delay", 0.1, "rudder"),)), LATERAL)
    assert surface.sentence == "rudder_delay: rudder_rad is replaced by the surface that the air sees"
    aero = treatment_of("adverse_yaw", Change(aero=(AeroTerm("Cn", "aileron", "linear", 0.01),)), LATERAL)
    assert aero.kind == "subtracted"
    assert aero.sentence.endswith("increments of CY, Cl and Cn is subtracted")
    heavy = treatment_of("inertia_error:izz", Change(declared=(DeclaredTerm("inertia_zz", 1.2),)), LATERAL)
    assert heavy.kind == "declared"
