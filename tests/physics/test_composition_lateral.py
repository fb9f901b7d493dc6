"""Contributions of fin and wing tips against forces that the test itself sums over fin and strips."""

import numpy as np
import pytest

from airtruth.physics.composition import SideGeometry, TailGeometry, directions
from airtruth.physics.composition_lateral import cg_part, fin_part, inertia_parts, tip_at_rest, tip_part
from airtruth.physics.motion import LATERAL
from validation.lateral_truth import GTM

OWN = GTM.lateral.ravel()
SPAN_M, AREA_M2, SPEED_M_S = GTM.span, GTM.area, GTM.speed


def named(part):
    return dict(zip(LATERAL.parameters, part, strict=True))


def coefficients_of_fin(beta, p, r, arm_m, height_m, slope):
    """CY, Cl and Cn of a fin in the velocity of its own place: v + omega x r, and the moment r x F."""
    place = np.array([-arm_m, 0.0, -height_m])
    velocity = np.array([SPEED_M_S, SPEED_M_S * beta, 0.0]) + np.cross([p, 0.0, r], place)
    force = np.array([0.0, -slope * velocity[1] / SPEED_M_S, 0.0])
    roll, _, yaw = np.cross(place, force) / SPAN_M
    return np.array([force[1], roll, yaw])


def test_the_fin_is_a_force_at_its_place():
    arm_m, height_m, slope = 1.1, 0.25, 0.6
    geometry = SideGeometry(fin_arm=arm_m / SPAN_M, fin_height=height_m / SPAN_M, fin_lift=slope)
    half = SPAN_M / (2.0 * SPEED_M_S)
    expected = np.column_stack(
        [
            coefficients_of_fin(1.0, 0.0, 0.0, arm_m, height_m, slope),
            coefficients_of_fin(0.0, 1.0, 0.0, arm_m, height_m, slope) / half,
            coefficients_of_fin(0.0, 0.0, 1.0, arm_m, height_m, slope) / half,
        ]
    )
    found = fin_part(OWN, geometry).reshape(3, 5)
    np.testing.assert_allclose(found[:, :3], expected, rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(found[:, 4], OWN.reshape(3, 5)[:, 4])
    apart = fin_part(OWN, SideGeometry(fin_arm=0.5, rudder_on_fin=False)).reshape(3, 5)
    assert not np.any(apart[:, 3:])


def test_the_gtm_without_its_fin():
    """Published tables: Cnbeta falls from .21 to -.09 and a tenth of the yaw damping is left (NASA GTM_DesignSim)."""
    part = named(fin_part(OWN, SideGeometry(span_m=SPAN_M)))
    lost = named(OWN - fin_part(OWN, SideGeometry(span_m=SPAN_M)))
    assert part["Cnbeta"] == pytest.approx(0.21 + 0.09, rel=0.2)
    assert lost["Cnbeta"] < 0.0
    assert lost["Cnr"] / named(OWN)["Cnr"] == pytest.approx(0.1, abs=1e-12)
    assert lost["Cndr"] == lost["CYdr"] == 0.0
    assert part["CYbeta"] < 0.0 < part["CYr"]
    assert part["Clbeta"] < 0.0 < part["Clr"]


STRIPS = 4000


def strips(taper, lost, side):
    """Middles and chords of the strips of a wing in semispans; those of a lost tip have no chord."""
    y = (np.arange(-STRIPS, STRIPS) + 0.5) / STRIPS
    chord = 1.0 + (taper - 1.0) * np.abs(y)
    return y, np.where(side * y > 1.0 - lost, 0.0, chord)


@pytest.mark.parametrize("side", [1, -1])
def test_a_lost_tip_takes_its_strips(side):
    """Roll damping, dihedral effect and aileron of the strips, and the moment of their lift and mass at rest."""
    taper, lost, ends, mass = 0.6, 0.2, (0.55, 0.9), 0.11
    inertia = GTM.inertia[0], GTM.inertia[2], GTM.inertia[3]
    geometry = SideGeometry(
        span_m=SPAN_M,
        taper=taper,
        aileron=ends,
        wing_mass=mass,
        fin_lift=0.0,
        inertia_kg_m2=inertia,
        mass_kg=GTM.mass,
    )
    y, whole = strips(taper, 0.0, side)
    _, left = strips(taper, lost, side)
    moved = (np.abs(y) > ends[0]) & (np.abs(y) < ends[1])
    share = {
        "Clp": (left * y**2).sum() / (whole * y**2).sum(),
        "Clbeta": (left * np.abs(y)).sum() / (whole * np.abs(y)).sum(),
        "Clda": (left * moved * np.abs(y)).sum() / (whole * moved * np.abs(y)).sum(),
    }
    damaged = named(OWN + lost * tip_part(OWN, geometry))
    for name, kept in share.items():
        assert damaged[name] == pytest.approx(kept * named(OWN)[name], rel=2e-3)
    rest = directions(OWN, TailGeometry(side=geometry), LATERAL)
    name = "right_wing_tip" if side > 0 else "left_wing_tip"
    np.testing.assert_array_equal(rest[name], tip_part(OWN, geometry))
    # centre of the strips' lift and mass over those of the wing, and their share of the inertias
    centre = 0.5 * SPAN_M * (left * y).sum() / whole.sum()
    turned = mass * GTM.mass * (0.5 * SPAN_M) ** 2 * ((left - whole) * y**2).sum() / whole.sum()
    found = tip_at_rest(geometry, side)
    assert lost * found["load_y"] == pytest.approx(-centre, rel=2e-3)
    assert lost * found["cg_y"] == pytest.approx(mass * centre, rel=2e-3)
    assert lost * found["inertia_xx"] == pytest.approx(turned / inertia[0], rel=2e-3)
    assert lost * found["inertia_zz"] == pytest.approx(turned / inertia[1], rel=2e-3)


def test_the_gtm_without_a_tip():
    """Published tables: Clp falls to 0.75 of its value."""
    geometry = SideGeometry(span_m=SPAN_M)
    damaged = named(OWN + 0.25 * tip_part(OWN, geometry))
    assert damaged["Clp"] / named(OWN)["Clp"] == pytest.approx(0.75, rel=0.05)


def test_inertias_are_those_of_eulers_equations():
    """Apparent moments J0 J^-1 M of an aircraft whose inertias differ by little."""
    xx, _, zz, xz = GTM.inertia
    declared = np.array([[xx, -xz], [-xz, zz]])
    found = inertia_parts(OWN, SideGeometry(inertia_kg_m2=(xx, zz, xz)))
    moments = OWN.reshape(3, 5)[1:]
    small, unit = 1e-6, np.sqrt(xx * zz)
    for name, changed in {
        "inertia_xx": np.array([[xx, 0.0], [0.0, 0.0]]),
        "inertia_zz": np.array([[0.0, 0.0], [0.0, zz]]),
        "inertia_xz": np.array([[0.0, -unit], [-unit, 0.0]]),
    }.items():
        apparent = declared @ np.linalg.solve(declared + small * changed, moments)
        slope = (apparent - moments) / small
        np.testing.assert_allclose(found[name].reshape(3, 5)[1:], slope, rtol=1e-4, atol=1e-5)
        assert not np.any(found[name][:5])


def test_a_cg_farther_aft_is_a_transfer_of_force_and_sideslip():
    ratio = SPAN_M / GTM.chord
    found = cg_part(OWN, SideGeometry(span_m=SPAN_M, aspect_ratio=ratio)).reshape(3, 5)
    d, half = 1e-6 * GTM.chord, SPAN_M / (2.0 * SPEED_M_S)
    table = OWN.reshape(3, 5)
    moved = table.copy()
    moved[:, 2] += table[:, 0] * d / SPEED_M_S / half  # sideslip of the old CG, d ahead
    moved[2] += d / SPAN_M * moved[0]
    np.testing.assert_allclose(found, (moved - table) / 1e-6, rtol=1e-5, atol=1e-7)
