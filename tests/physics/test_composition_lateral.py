"""Contributions of the fin and of lost parts of the wing against forces that the test itself sums over fin and strips."""

import numpy as np
import pytest

from airtruth.physics.composition import SideGeometry, TailGeometry, directions
from airtruth.physics.composition_lateral import cg_part, fin_part, inertia_parts, lost_at_rest, lost_part
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


TIP, FLAP = ("wing_tip", (0.8, 1.0), 1.0, 0.2), ("flap", (0.15, 0.65), 0.3, 1.0)
"""Part, its ends in semispans, its share of the chord, and the size of its cause that loses all of it."""


def strips(taper, ends, share, side):
    """Middles and chords of the strips of a wing in semispans, without a part of the chord between two ends of one half."""
    y = (np.arange(-STRIPS, STRIPS) + 0.5) / STRIPS
    chord = 1.0 + (taper - 1.0) * np.abs(y)
    return y, np.where((side * y > ends[0]) & (side * y < ends[1]), (1.0 - share) * chord, chord)


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize(("part", "ends", "depth", "lost"), [TIP, FLAP])
def test_a_lost_part_of_the_wing_takes_its_strips(part, ends, depth, lost, side):
    """Roll damping, dihedral effect and aileron of the strips, and the moment of their lift and mass at rest."""
    taper, aileron, mass = 0.6, (0.55, 0.9), 0.11
    inertia = GTM.inertia[0], GTM.inertia[2], GTM.inertia[3]
    geometry = SideGeometry(
        span_m=SPAN_M,
        taper=taper,
        aileron=aileron,
        flap=FLAP[1],
        flap_depth=FLAP[2],
        wing_mass=mass,
        fin_lift=0.0,
        inertia_kg_m2=inertia,
        mass_kg=GTM.mass,
    )
    y, whole = strips(taper, ends, 0.0, side)
    _, left = strips(taper, ends, depth, side)
    moved = (np.abs(y) > aileron[0]) & (np.abs(y) < aileron[1])
    kept = moved & (left == whole)  # the aileron behind a strip is lost with it
    share = {
        "Clp": (left * y**2).sum() / (whole * y**2).sum(),
        "Clbeta": (left * np.abs(y)).sum() / (whole * np.abs(y)).sum(),
        "Clda": (whole * kept * np.abs(y)).sum() / (whole * moved * np.abs(y)).sum(),
    }
    strip = geometry.tip if part == "wing_tip" else geometry.own_flap
    damaged = named(OWN + lost * lost_part(OWN, geometry, strip))
    for name, kept_share in share.items():
        assert damaged[name] == pytest.approx(kept_share * named(OWN)[name], rel=2e-3)
    rest = directions(OWN, TailGeometry(side=geometry), LATERAL)
    name = f"{'right' if side > 0 else 'left'}_{part}"
    np.testing.assert_array_equal(rest[name], lost_part(OWN, geometry, strip))
    # centre of the strips' lift and mass over those of the wing, and their share of the inertias
    centre = 0.5 * SPAN_M * (left * y).sum() / whole.sum()
    turned = mass * GTM.mass * (0.5 * SPAN_M) ** 2 * ((left - whole) * y**2).sum() / whole.sum()
    found = lost_at_rest(geometry, strip, side)
    assert lost * found["load_y"] == pytest.approx(-centre, rel=2e-3)
    assert lost * found["cg_y"] == pytest.approx(mass * centre, rel=2e-3)
    assert lost * found["inertia_xx"] == pytest.approx(turned / inertia[0], rel=2e-3)
    assert lost * found["inertia_zz"] == pytest.approx(turned / inertia[1], rel=2e-3)


def lifting_line(taper, aspect_ratio, lost, angle, panels=200):
    """CL and rolling moment over CL's force and span of a straight wing without its left tip, by horseshoe vortices.

    H. Glauert, Elements of Aerofoil and Airscrew Theory, 1926, ch. 11, solved at points (panels with cosine spacing); semispan 1.
    """
    end = 1.0 - lost
    edges = 0.5 * (1.0 - end) - 0.5 * (1.0 + end) * np.cos(np.linspace(0.0, np.pi, panels + 1))
    middle = np.pi * (np.arange(panels) + 0.5) / panels
    y = 0.5 * (1.0 - end) - 0.5 * (1.0 + end) * np.cos(middle)
    chord = 4.0 / aspect_ratio / (1.0 + taper) * (1.0 + (taper - 1.0) * np.abs(y))
    wash = (1.0 / (y[:, None] - edges[:-1]) - 1.0 / (y[:, None] - edges[1:])) / (4.0 * np.pi)
    bound = np.linalg.solve(np.diag(1.0 / (np.pi * chord)) + wash, angle(y))
    force = 2.0 * bound * np.diff(edges) / (4.0 / aspect_ratio)
    return force.sum(), -(force * y).sum() / 2.0


@pytest.mark.parametrize("taper", [0.4, 0.7, 1.0])
@pytest.mark.parametrize("lost", [0.1, 0.2, 0.25])
def test_a_lost_tip_is_that_of_a_lifting_line(taper, lost):
    """The lift falls off towards the new tip too: strips lose 0.76 to 1.06 of what a lifting line loses."""
    ratio = 8.0
    geometry = SideGeometry(span_m=2.0, aspect_ratio=ratio, taper=taper, fin_lift=0.0)
    level, rolling = (lambda y: np.ones_like(y)), (lambda y: y)
    whole = lifting_line(taper, ratio, 0.0, level)[0]
    moment = lifting_line(taper, ratio, lost, level)[1] / whole
    damping = [lifting_line(taper, ratio, x, rolling)[1] for x in (lost, 0.0)]
    at_rest = lost * lost_at_rest(geometry, geometry.tip, -1.0)["load_y"] / geometry.span_m
    part = lost * named(lost_part(OWN, geometry, geometry.tip))["Clp"] / named(OWN)["Clp"]
    print(
        f"taper {taper}, lost {lost}: at rest {at_rest / moment:.3f}, damping {part / (damping[0] / damping[1] - 1.0):.3f}"
    )
    assert 0.75 < at_rest / moment < 1.06
    assert 0.75 < part / (damping[0] / damping[1] - 1.0) < 1.06


def test_the_gtm_without_a_tip():
    """Published tables: Clp falls to 0.75 of its value."""
    geometry = SideGeometry(span_m=SPAN_M)
    damaged = named(OWN + 0.25 * lost_part(OWN, geometry, geometry.tip))
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
