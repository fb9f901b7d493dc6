"""The lateral motion as an input of the pitch plane: against the vector equations of a rigid body, and in identification."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from airtruth.identification import identify_batch
from airtruth.identification.condition import across_path
from airtruth.identification.lateral_inputs import beside_lateral, lateral_rates
from airtruth.identification.options import Options
from airtruth.logs.flight_log import Batch
from airtruth.physics.short_period import normal_force_row, scale, system
from airtruth.units import G0

AIRCRAFT = SimpleNamespace(
    wing_area_m2=0.5483,
    chord_m=0.27898,
    mass_kg=26.195,
    inertia_yy_kg_m2=6.314,
    inertia_xx_kg_m2=1.8,
    inertia_zz_kg_m2=7.4,
    inertia_xz_kg_m2=0.15,
)
THETA = np.array([4.79, 31.0, 0.48, -1.785, -41.4, -1.787])
SPEED, DENSITY, DT_S = 42.85, 0.9931, 0.02
TIME = DT_S * np.arange(501)
P, R = 1.2 * np.sin(3.0 * TIME) * (TIME > 4.0), 0.5 * np.sin(3.0 * TIME - 1.0) * (TIME > 4.0)
BETA, BANK = 0.1 * np.sin(3.0 * TIME + 0.5) * (TIME > 4.0), 0.3 * np.sin(1.5 * TIME) * (TIME > 4.0)
ELEVATOR = np.interp(TIME, [1.0, 1.1, 1.5, 1.7, 2.1, 2.2], [0.0, 0.03, 0.03, -0.03, -0.03, 0.0])


AILERON = np.interp(TIME, [4.0, 4.1, 4.8, 5.0, 5.8, 6.0], [0.0, 0.06, 0.06, -0.06, -0.06, 0.0])


def flown(lift_of_aileron=0.0, moment_of_aileron=0.0, moment_of_sideslip=0.0):
    """One run of both motions: the vector equations of a rigid body with linear lift and moment, integrated.

    The aileron adds CL and Cm in proportion to its absolute value [1/rad], the sideslip Cm to its square [1/rad2].
    """
    s = scale(AIRCRAFT.wing_area_m2, AIRCRAFT.chord_m, AIRCRAFT.mass_kg, 6.314, SPEED, DENSITY)
    a, b = system(THETA, s)
    inertia = np.array([[1.8, 0.0, -0.15], [0.0, 6.314, 0.0], [-0.15, 0.0, 7.4]])
    alpha0 = 0.06

    def slope(t, x):
        p, r, beta, bank, de = (np.interp(t, TIME, c) for c in (P, R, BETA, BANK, ELEVATOR))
        alpha, q = x
        omega = np.array([p, q, r])
        gyroscopic = -np.cross(omega, inertia @ omega)[1] / 6.314
        velocity = np.array(
            [np.cos(alpha + alpha0) * np.cos(beta), np.sin(beta), np.sin(alpha + alpha0) * np.cos(beta)]
        )
        turn = -np.cross(omega, velocity)
        rate = (velocity[0] * turn[2] - velocity[2] * turn[0]) / (velocity[0] ** 2 + velocity[2] ** 2)
        # body and path level at rest, gravity falls with the bank
        fall = G0 / SPEED * (np.cos(bank) - 1.0) * np.cos(alpha0) ** 2
        lift, moment = a @ np.array([alpha, q]) + b * de
        aileron = abs(np.interp(t, TIME, AILERON))
        lift -= s.lift * lift_of_aileron * aileron
        moment += s.moment * (moment_of_aileron * aileron + moment_of_sideslip * beta**2)
        return [lift - q + rate + fall, moment + gyroscopic]

    x = solve_ivp(slope, (0.0, TIME[-1]), [0.0, 0.0], t_eval=TIME, rtol=1e-9, atol=1e-12, max_step=DT_S).y
    row = normal_force_row(THETA, s)
    az = row[:2] @ x + row[2] * ELEVATOR - G0 - s.normal * lift_of_aileron * np.abs(AILERON)
    one = np.ones_like(TIME)
    channels = {
        "alpha_rad": x[0] + alpha0,
        "q_rad_s": x[1],
        "az_m_s2": az,
        "elevator_rad": ELEVATOR,
        "aileron_rad": AILERON,
        "airspeed_m_s": SPEED * one,
        "density_kg_m3": DENSITY * one,
        "theta_rad": alpha0 * one,
        "phi_rad": BANK,
        "p_rad_s": P,
        "r_rad_s": R,
        "beta_rad": BETA,
    }
    return Batch(("a",), DT_S, TIME[None], {name: value[None] for name, value in channels.items()})


BATCH = flown()


def test_inputs_are_those_of_the_vector_equations():
    lift, moment = lateral_rates(BATCH, AIRCRAFT)
    inertia = np.array([[1.8, 0.0, -0.15], [0.0, 6.314, 0.0], [-0.15, 0.0, 7.4]])
    for k in (0, 260, 333, 480):
        p, q, r, alpha, beta = (
            BATCH.channels[c][0, k] for c in ("p_rad_s", "q_rad_s", "r_rad_s", "alpha_rad", "beta_rad")
        )
        omega = np.array([p, q, r])
        assert moment[0, k] == pytest.approx(-np.cross(omega, inertia @ omega)[1] / 6.314, abs=1e-12)
        velocity = np.array([np.cos(alpha) * np.cos(beta), np.sin(beta), np.sin(alpha) * np.cos(beta)])
        turn = -np.cross(omega, velocity)
        rate = (velocity[0] * turn[2] - velocity[2] * turn[0]) / (velocity[0] ** 2 + velocity[2] ** 2)
        assert q + lift[0, k] == pytest.approx(rate, abs=1e-12)


def test_gravity_across_the_path_falls_with_the_bank():
    c = BATCH.channels
    expected = np.cos(c["phi_rad"]) * np.cos(c["theta_rad"]) * np.cos(c["alpha_rad"]) + np.sin(
        c["theta_rad"]
    ) * np.sin(c["alpha_rad"])
    np.testing.assert_allclose(across_path(BATCH), expected, rtol=1e-12)


@pytest.mark.parametrize("lacking", ["p_rad_s", "beta_rad", "inertias", "motion"])
def test_a_record_without_lateral_motion_has_no_inputs(lacking):
    channels = {name: x for name, x in BATCH.channels.items() if name != lacking}
    if lacking == "motion":
        channels |= {name: 0.01 * channels[name] for name in ("p_rad_s", "r_rad_s")}
    constants = SimpleNamespace(
        **{k: v for k, v in vars(AIRCRAFT).items() if lacking != "inertias" or "yy" in k}
    )
    assert not any(part.any() for part in lateral_rates(replace(BATCH, channels=channels), constants))


@pytest.mark.parametrize("pressure", ["constant", "measured"])
@pytest.mark.parametrize("method", ["ls", "iv-f1", "frequency", "filter-error", "iv-refined", "iv-frequency"])
def test_a_record_of_both_motions_gives_the_moment_derivatives(method, pressure):
    options = Options(pressure=pressure)
    own = identify_batch(beside_lateral(BATCH, AIRCRAFT, options), AIRCRAFT, method, options).theta[0]
    np.testing.assert_allclose(own[3:], THETA[3:], rtol=0.03)
    without = identify_batch(BATCH, AIRCRAFT, method, options).theta[0]
    assert np.abs(own / THETA - 1.0)[3:].max() < 0.3 * np.abs(without / THETA - 1.0)[3:].max()


FORCES = flown(lift_of_aileron=0.12, moment_of_aileron=-0.2, moment_of_sideslip=-1.2)
"""A record whose ailerons and sideslip lift and pitch as much as those of the GTM."""


def test_forces_of_the_lateral_motion_are_recovered():
    """The moment that the record was flown with, about its mean; the low-pass and differences blunt the edges of the aileron."""
    made = beside_lateral(FORCES, AIRCRAFT, Options())
    flown_rad_s2 = -0.2 * np.abs(AILERON) - 1.2 * BETA**2
    flown_rad_s2 *= scale(0.5483, 0.27898, 26.195, 6.314, SPEED, DENSITY).moment
    _, inertia = lateral_rates(FORCES, AIRCRAFT)
    error = made.known_rates[1, 0] - inertia[0] - flown_rad_s2
    assert error.std() < 0.05 * flown_rad_s2.std()
    taken = FORCES.channels["az_m_s2"] - made.channels["az_m_s2"]
    lift_m_s2 = -scale(0.5483, 0.27898, 26.195, 6.314, SPEED, DENSITY).normal * 0.12 * np.abs(AILERON)
    assert (taken[0] - lift_m_s2).std() < 0.05 * lift_m_s2.std()


@pytest.mark.parametrize("method", ["ls", "iv-f1", "frequency", "filter-error", "iv-refined", "iv-frequency"])
def test_forces_of_the_lateral_motion_do_not_move_the_derivatives(method):
    """Within 4 % with the forces taken out; with inertia and kinematics alone some derivative of Cm is off by 6 % and more.

    iv-f1 needs neither: its instruments follow the elevator alone, and the ailerons move later.
    """
    options = Options(pressure="measured")
    own = identify_batch(beside_lateral(FORCES, AIRCRAFT, options), AIRCRAFT, method, options).theta[0]
    np.testing.assert_allclose(own[3:], THETA[3:], rtol=0.04)
    kinematic = replace(FORCES, known_rates=np.stack(lateral_rates(FORCES, AIRCRAFT)))
    without = identify_batch(kinematic, AIRCRAFT, method, options).theta[0]
    assert method == "iv-f1" or np.abs(without / THETA - 1.0)[3:].max() > 0.06


def test_a_run_does_not_depend_on_the_others():
    """A run without lateral motion beside one with it keeps its estimate."""
    still = {
        name: np.zeros_like(x)
        for name, x in FORCES.channels.items()
        if name in ("p_rad_s", "r_rad_s", "beta_rad")
    }
    still |= {"aileron_rad": np.zeros_like(AILERON)[None]}
    quiet = replace(FORCES, channels={**FORCES.channels, **still})
    channels = {name: np.concatenate([x, quiet.channels[name]]) for name, x in FORCES.channels.items()}
    both = replace(FORCES, run_ids=("a", "b"), t_s=np.concatenate([FORCES.t_s] * 2), channels=channels)
    for method in ("ls", "filter-error"):
        options = Options(pressure="measured")
        together = identify_batch(beside_lateral(both, AIRCRAFT, options), AIRCRAFT, method, options).theta
        for run, batch in enumerate((FORCES, quiet)):
            alone = identify_batch(beside_lateral(batch, AIRCRAFT, options), AIRCRAFT, method, options).theta[
                0
            ]
            np.testing.assert_allclose(together[run], alone, rtol=1e-6)
