"""Contributions of tail, wing and flow to the derivatives."""

import numpy as np
import pytest

from airtruth.physics.composition import ICED, TailGeometry, cg_transfer, directions, tail_part, wing_part

A, ARM, ASPECT = 1.2, 3.5, 7.0
"""A tail drawn up by hand: lift slope by the wing area [1/rad], arm over chord, aspect ratio of the wing."""
WING = 4.0
"""Lift slope of the wing [1/rad]."""


def aircraft(f_tail: float = 1.0, f_wing: float = 1.0) -> np.ndarray:
    """Derivatives by the textbook sums (Etkin and Reid, eqs 2.2,8; 2.3,18; 5.4), tail and wing scaled."""
    wing = WING * f_wing
    downwash = 2.0 * wing / (np.pi * ASPECT)
    a = A * f_tail
    tail_alpha, tail_q, tail_de = a * (1.0 - downwash), 2.0 * a * ARM, 0.45 * f_tail
    wing_cm_q = -0.1 * 2.0 * A * ARM**2
    return np.array(
        [
            wing + tail_alpha,
            5.0 * f_wing + tail_q,
            tail_de,
            0.3 * wing - ARM * tail_alpha,
            wing_cm_q * f_wing - ARM * tail_q,
            -ARM * tail_de,
        ]
    )


@pytest.mark.parametrize("geometry", [TailGeometry(ASPECT), TailGeometry(ASPECT, ARM, A)])
def test_the_tail_of_a_textbook_aircraft(geometry):
    """Inferred from CLde, Cmde and Cmq, or declared: the change of every derivative for a lost tail."""
    np.testing.assert_allclose(
        tail_part(aircraft(), geometry), aircraft() - aircraft(f_tail=0.0), rtol=1e-12, atol=1e-12
    )


def test_the_wing_of_a_textbook_aircraft():
    """The downwash at the tail follows the wing; the sums are linear in the wing's lift."""
    change = aircraft() - aircraft(f_wing=0.0)
    np.testing.assert_allclose(wing_part(aircraft(), TailGeometry(ASPECT)), change, rtol=1e-12, atol=1e-12)


def test_directions_of_declared_quantities():
    d = aircraft()
    found = directions(d, TailGeometry(ASPECT))
    np.testing.assert_allclose(found["mass"], [-d[0], -d[1], -d[2], 0, 0, 0])
    np.testing.assert_allclose(found["inertia"], [0, 0, 0, -d[3], -d[4], -d[5]])
    np.testing.assert_allclose(found["cg"], [0, 0, 0, d[0], d[1], d[2]])
    np.testing.assert_allclose(found["aerodynamic_center"], [0, 0, 0, -d[0], 0, 0])
    np.testing.assert_allclose(found["icing"], np.array(ICED) * d)


def test_an_aircraft_without_a_tail_has_no_tail_part():
    """Without Cmq and Cmde nothing can be inferred, and nothing is divided by zero."""
    d = np.array([4.0, 0.0, 0.0, -0.5, 0.0, 0.0])
    assert (tail_part(d, TailGeometry()) == 0.0).all()


def test_transfer_to_another_centre_of_gravity_is_that_of_moments_and_velocities():
    """Strips that lift where they are: derivatives summed about two points against the matrix; and T(a) T(b) = T(a + b)."""
    rng = np.random.default_rng(2)
    slopes, behind, flap = rng.uniform(0.1, 2.0, 30), rng.uniform(-2.0, 5.0, 30), rng.uniform(0.0, 0.3, 30)

    def about(x: float) -> np.ndarray:
        arm = behind - x  # chords behind the centre of gravity, where alpha is larger by 2 arm q c/(2V)
        return np.array(
            [
                slopes.sum(), (2.0 * slopes * arm).sum(), flap.sum(),
                -(slopes * arm).sum(), -(2.0 * slopes * arm**2).sum(), -(flap * arm).sum(),
            ]
        )  # fmt: skip

    np.testing.assert_allclose(cg_transfer(0.13) @ about(0.2), about(0.33), rtol=1e-12)
    np.testing.assert_allclose(cg_transfer(0.1) @ cg_transfer(-0.3), cg_transfer(-0.2), atol=1e-15)
