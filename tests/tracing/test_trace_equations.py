"""Equations of motion, effects' terms, declared changes and gusts against independent calculations."""

import math

import numpy as np
import pytest
import trace_records as tr
from numba import njit
from scipy.integrate import solve_ivp

from airtruth.errors import ConfigurationError
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.terms import AeroTerm, Change, DeclaredTerm, StateTerm
from airtruth.tracing.model.longitudinal.equations import gust, rates
from airtruth.tracing.model.longitudinal.input import AirPoint
from airtruth.tracing.model.parameters import SHORT_PERIOD
from airtruth.tracing.model.response import respond
from airtruth.tracing.model.settings import common_prior
from airtruth.units import DEG, G0


def forces(plant, alpha, surface, qhat):
    """Trilinear products over axes of -1 and 1."""
    share = [0.5 * (1.0 + s) for s in (alpha, surface, qhat)]
    f = np.zeros(3)
    for i in (0, 1):
        for j in (0, 1):
            for n in (0, 1):
                weights = [s if k else 1.0 - s for s, k in zip(share, (i, j, n), strict=True)]
                f += math.prod(weights) * plant.tables[0].values[i, j, n]
    return f


@pytest.mark.parametrize("bolted", [0.0, 1.0])
def test_nonlinear_free_run_against_dop853(bolted):
    """Varying airspeed, density, attitude and speed over ground, declared changes, increments, offsets, biases.

    Sensors that are bolted to the airframe lie ahead of a CG that has moved aft: they read the motion there.
    """
    plant = tr.curved()
    mass, inertia, factor, cg, arm = 1.1, 0.9, 1.2, 0.03, 0.1
    change = Change(
        declared=(
            DeclaredTerm("mass", mass),
            DeclaredTerm("inertia", inertia),
            DeclaredTerm("elevator", factor),
            DeclaredTerm("cg", cg),
            DeclaredTerm("thrust_arm", arm),
        )
    )

    def elevator(t):
        return 0.03 * np.sin(6.0 * t)

    def theta(t):
        return 0.05 + 0.04 * np.sin(2.0 * t)

    def speed(t):
        return 42.0 + 1.5 * np.sin(1.3 * t)

    def ground(t):
        return 41.0 + 0.5 * t

    def density(t):
        return 1.0 - 0.01 * t

    common, per_record = tr.still()
    common[SHORT_PERIOD.common.derivatives] = [0.1, 2.0, -0.05, 0.03, -3.0, 0.1]
    common[SHORT_PERIOD.common.thrust] = 0.04
    common[SHORT_PERIOD.common.mounting] = bolted - 0.5
    per_record[SHORT_PERIOD.per_record.motion_start] = [0.06, -0.1]
    per_record[SHORT_PERIOD.per_record.offsets] = [0.001, -0.002, 0.05, 0.01, -0.004]
    c = tr.C

    def rates(t, x):
        alpha_ground, q = x
        v, vg = speed(t), ground(t)
        qbar = 0.5 * density(t) * v * v
        alpha = theta(t) - math.asin(vg * math.sin(theta(t) - alpha_ground) / v)
        surface = plant.neutral_rad[0] + factor * (elevator(t) - plant.neutral_rad[0])
        qhat = q * c.chord_m / (2.0 * v)
        share = 0.5 * (alpha + 1.0)  # of the one cell from -1 to 1 rad
        constant = (1.0 - share) * plant.constant[0] + share * plant.constant[1]
        fx, fz, fm = qbar * forces(plant, alpha, surface, qhat) + constant + 0.04 * plant.power.constant
        states = np.array([alpha - plant.trim_alpha_rad, qhat, surface - plant.trims["elevator"]])
        lift = per_record[SHORT_PERIOD.per_record.trim.start] + common[LONGITUDINAL.row("CL")] @ states
        moment = (
            per_record[SHORT_PERIOD.per_record.offsets.stop - 1] + common[LONGITUDINAL.row("Cm")] @ states
        )
        fz -= qbar * c.wing_area_m2 * lift
        fm += (
            qbar * c.wing_area_m2 * c.chord_m * moment
            - cg * c.chord_m * fz  # a CG aft of the forces' old point: nose-up for an upward force
            + (plant.power.thrust[0] + plant.power.thrust[1] * qbar) * arm
        )
        m = c.mass_kg * mass
        turn = (fz * math.cos(alpha) - fx * math.sin(alpha)) / (m * vg)
        slope = [q + turn + G0 * math.cos(theta(t) - alpha_ground) / vg, fm / (c.inertia_yy_kg_m2 * inertia)]
        ahead = bolted * cg * c.chord_m
        return slope, (alpha - q * ahead / v, q, fz / m - ahead * slope[1])

    end = 2.0
    t = np.arange(round(end / tr.DT) + 1) * tr.DT
    solved = solve_ivp(
        lambda t, x: rates(t, x)[0],
        (0.0, end),
        per_record[SHORT_PERIOD.per_record.motion_start],
        "DOP853",
        t,
        rtol=1e-12,
        atol=1e-14,
    )
    expected = (
        np.array([rates(s, x)[1] for s, x in zip(t, solved.y.T, strict=True)])
        + per_record[SHORT_PERIOD.per_record.bias]
    )
    made = tr.record(
        np.zeros((len(t), 3)), elevator, theta, 16, v=speed, density=density, ground=ground, plant_=plant
    )
    found = -respond(made, tr.SETTINGS, change, common, per_record, free_run=True).e
    tr.close(found, expected, 1e-7)


# -- terms of effects, by the rates at one state


@njit
def of_kernel(x, at, model, out):
    """`rates`, which only kernels call."""
    return rates(x, at, model, out)


def rates_at(change, x=(0.04, 0.3), de=0.05, common=None, coupling=(0.0, 0.0)):
    model = tr.model(change, common)
    state = np.zeros(model.states.size)
    state[:2] = x
    out = np.zeros(state.size)
    at = AirPoint(de, tr.V, tr.V, 0.5 * tr.DENSITY * tr.V**2, 0.04, *coupling, 0.0, 0.0)
    return out, of_kernel(state, at, model, out)


def test_what_roll_yaw_and_bank_add_to_the_rates_leaves_the_force():
    (plain, az), (coupled, same) = rates_at(Change()), rates_at(Change(), coupling=(-0.02, 0.3))
    assert coupled[:2] - plain[:2] == pytest.approx([-0.02, 0.3], rel=1e-12)
    assert same == az


VALUES = {"alpha": 0.04, "elevator": 0.05, "qhat": 0.3 * tr.HALF}


@pytest.mark.grid
@pytest.mark.parametrize("signal", sorted(VALUES))
@pytest.mark.parametrize("shape", ["linear", "quadratic", "above", "below"])
@pytest.mark.parametrize("side", [-0.5, 0.5])
def test_shapes_of_aerodynamic_terms(signal, shape, side):
    at = VALUES[signal] * (1.0 + side)
    s = VALUES[signal] - at
    f = {"linear": s, "quadratic": s * s, "above": max(0.0, s), "below": min(0.0, s)}[shape]
    (plain, az), amplitude = rates_at(Change()), 0.7
    moment, az_moment = rates_at(Change(aero=(AeroTerm("Cm", signal, shape, amplitude, at),)))
    assert moment[1] - plain[1] == pytest.approx(
        tr.FORCE * tr.C.chord_m * amplitude * f / tr.C.inertia_yy_kg_m2, rel=1e-9, abs=1e-12
    )
    assert az_moment == az
    lift, az_lift = rates_at(Change(aero=(AeroTerm("CL", signal, shape, amplitude, at),)))
    assert az_lift - az == pytest.approx(-tr.FORCE * amplitude * f / tr.C.mass_kg, rel=1e-9, abs=1e-12)
    assert lift[0] - plain[0] == pytest.approx(
        -tr.FORCE * amplitude * f * math.cos(0.04) / (tr.C.mass_kg * tr.V), rel=1e-9, abs=1e-13
    )
    assert lift[1] == plain[1]


@pytest.mark.parametrize("factor", sorted(VALUES))
@pytest.mark.parametrize(("signal", "s"), [("alpha", 0.04), ("qbar", 0.5 * tr.DENSITY * tr.V**2)])
def test_a_factor_multiplies_a_term_from_its_origin(factor, signal, s):
    """Cm += 0.7 (s - 0.9 s) (p - p/4)."""
    plain, _ = rates_at(Change())
    term = AeroTerm("Cm", signal, "above", 0.7, 0.9 * s, factor, 0.25 * VALUES[factor])
    out, _ = rates_at(Change(aero=(term,)))
    expected = 0.7 * 0.1 * s * 0.75 * VALUES[factor]
    assert (out[1] - plain[1]) * tr.C.inertia_yy_kg_m2 / (tr.FORCE * tr.C.chord_m) == pytest.approx(
        expected, rel=1e-8
    )


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (Change(aero=(AeroTerm("Cm", "alpha", "linear", 1.0, factor="qbar"),)), "factor 'qbar'"),
        (Change(states=(StateTerm("x", "lag", "qbar", 0.1),)), "signal 'qbar'"),
    ],
)
def test_the_dynamic_pressure_is_neither_a_factor_nor_drives_a_state(change, words):
    with pytest.raises(ConfigurationError, match=words):
        rates_at(change)


def test_lift_in_alpha_dot_is_in_proportion_to_the_alpha_dot_that_it_changes():
    amplitude = 12.0
    _, az = rates_at(Change())
    out, az_more = rates_at(Change(aero=(AeroTerm("CL", "alpha_dot_hat", "linear", amplitude),)))
    lift = -(az_more - az) * tr.C.mass_kg / tr.FORCE
    assert lift == pytest.approx(amplitude * out[0] * tr.HALF, rel=1e-9)


def test_moment_in_alpha_dot_takes_the_motion_over_ground():
    plain, _ = rates_at(Change())
    out, _ = rates_at(Change(aero=(AeroTerm("Cm", "alpha_dot_hat", "linear", -9.0),)))
    assert out[0] == plain[0]
    assert (out[1] - plain[1]) * tr.C.inertia_yy_kg_m2 / (tr.FORCE * tr.C.chord_m) == pytest.approx(
        -9.0 * plain[0] * tr.HALF, rel=1e-9
    )


def test_declared_terms_at_one_state():
    plain, az = rates_at(Change())
    heavy, az_heavy = rates_at(Change(declared=(DeclaredTerm("mass", 1.25),)))
    assert az_heavy == pytest.approx(az / 1.25, rel=1e-12)
    assert heavy[1] == plain[1]
    inert, _ = rates_at(Change(declared=(DeclaredTerm("inertia", 0.8),)))
    assert inert[1] == pytest.approx(plain[1] / 0.8, rel=1e-12)
    twice, _ = rates_at(Change(declared=(DeclaredTerm("mass", 1.25), DeclaredTerm("mass", 0.8))))
    np.testing.assert_allclose(twice, plain, rtol=1e-12)


# -- gusts


@pytest.mark.parametrize(("rolloff", "tolerance"), [(0.0, 1e-9), (1.0, 0.06)])
def test_spectrum_of_the_gust(rolloff, tolerance):
    """MIL-F-8785C, 3.7.1: Dryden's exactly; von Karman's from 0.5 to 600 rad/s but for the level."""
    common, per_record = tr.still()
    common[SHORT_PERIOD.common.rolloff] = rolloff - 0.5
    length, v = 840.419, tr.V
    model = tr.model(None, common, per_record)
    model = model._replace(gusts=model.gusts._replace(length_m=length))
    at = AirPoint(0.0, v, v, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    rate = v / length
    a = np.zeros((8, 8))
    a[2, 2], a[3, 2], a[3, 3] = -rate, rate, -rate
    state, out = np.zeros(8), np.zeros(8)
    row = np.zeros(8)
    for i in (2, 3, 5, 6, 7):
        state[:] = 0.0
        state[i] = 1.0
        row[i] = gust(state, model.gusts.rolloff)
        of_kernel(state, at, model, out)
        a[5:, i] = out[5:]
    omega = np.geomspace(0.5, 600.0, 200)
    drive = np.zeros(8)
    drive[2] = np.sqrt(2.0 * rate)
    density = np.array([abs(row @ np.linalg.solve(1j * w * np.eye(8) - a, drive)) ** 2 for w in omega])
    x2 = (omega / rate) ** 2
    expected = (1.0 + 3.0 * x2) / (1.0 + x2) ** 2
    if rolloff == 1.0:
        y2 = 1.339**2 * x2
        expected = (1.0 + 8.0 / 3.0 * y2) / (1.0 + y2) ** (11.0 / 6.0)
    off = np.log(density / expected)
    assert np.abs(off - off.mean()).max() < tolerance
    if rolloff == 0.0:  # two-sided over omega: sigma^2 L/V times Dryden's form
        np.testing.assert_allclose(density * rate, expected, rtol=1e-9)


def test_common_inertia_leaves_the_linear_model_alone():
    """Its derivatives are those of the pitch acceleration, so that only the tables' curvature sees it."""
    common, per_record = tr.still()
    common[SHORT_PERIOD.common.derivatives] = 0.02 * tr.TRUTH
    made = tr.record(np.zeros((len(tr.T), 3)), lambda t: tr.doublet(t, DEG))
    plain = respond(made, tr.SETTINGS, Change(), common, per_record, free_run=True).e
    common[SHORT_PERIOD.common.inertia] = 0.05
    heavy = respond(made, tr.SETTINGS, Change(), common, per_record, free_run=True).e
    tr.close(heavy - heavy[0], plain - plain[0], 1e-9)


def test_common_inertia_is_the_declared_one_s_factor_with_other_derivatives():
    """On a curved plant: factor 1 + i and, of the moment's derivatives, i of the declared added to the increments."""
    plant = tr.curved()
    made = tr.record(np.zeros((len(tr.T), 3)), lambda t: tr.doublet(t, DEG), plant_=plant)
    common, per_record = tr.still()
    common[SHORT_PERIOD.common.inertia] = 0.05
    found = respond(made, tr.SETTINGS, Change(), common, per_record, free_run=True).e
    by_hand, _ = tr.still()
    by_hand[LONGITUDINAL.row("Cm")] = 0.05 * plant.derivatives[LONGITUDINAL.row("Cm")]
    change = Change(declared=(DeclaredTerm("inertia", 1.05),))
    np.testing.assert_allclose(
        found, respond(made, tr.SETTINGS, change, by_hand, per_record, free_run=True).e, rtol=1e-12
    )


def test_common_prior_is_what_is_declared():
    """Covariance of the derivatives as declared; of the inertia too, and between them that of 1/Iyy."""
    plant = tr.plant()
    made = tr.record(np.zeros((len(tr.T), 3)), 0.0, plant_=plant)
    covariance = np.linalg.inv(common_prior([made], tr.SETTINGS))
    at = SHORT_PERIOD.common.inertia
    std = tr.GTM.file.mass.inertia_yy.std / tr.GTM.file.mass.inertia_yy.value
    np.testing.assert_allclose(
        covariance[SHORT_PERIOD.common.derivatives, SHORT_PERIOD.common.derivatives],
        plant.derivative_cov,
        rtol=1e-9,
    )
    assert covariance[at, at] == pytest.approx(std**2, rel=1e-9)
    np.testing.assert_allclose(
        covariance[at, LONGITUDINAL.row("Cm")],
        -(std**2) * plant.derivatives[LONGITUDINAL.row("Cm")],
        rtol=1e-9,
    )
