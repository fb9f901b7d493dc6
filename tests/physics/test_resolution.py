"""Causes of a change of the derivatives, as linear terms about a trim."""

import math

import numpy as np
import pytest

from airtruth.errors import ConfigurationError
from airtruth.physics.composition import TailGeometry, directions
from airtruth.physics.motion import LATERAL
from airtruth.physics.resolution import LinearPoint, derivative_increments, linear_terms, resolved
from airtruth.physics.terms import AeroTerm, Change, DeclaredTerm, DerivativeTerm

DERIVATIVES = np.array([5.0, 8.0, 0.4, -1.2, -20.0, -1.4])
GEOMETRY = TailGeometry(8.0, 3.5, 0.8)
POINT = LinearPoint(DERIVATIVES, {"alpha": 0.1, "elevator": -0.02}, GEOMETRY)
MASS = DeclaredTerm("mass", 1.1)


@pytest.mark.parametrize(
    ("cause", "value", "size"),
    [
        ("tail", 0.5, -0.5),
        ("wing", 1.1, 0.1),
        ("dynamic_pressure", 0.9, -0.1),
        ("aerodynamic_center", 0.03, 0.03),
        ("icing", 2.0, 2.0),
    ],
)
def test_increment_is_size_times_direction(cause, value, size):
    found = derivative_increments([DerivativeTerm(cause, value)], DERIVATIVES, GEOMETRY)
    np.testing.assert_allclose(found, size * directions(DERIVATIVES, GEOMETRY)[cause], rtol=1e-12)


def test_causes_add_and_a_derivative_is_its_own_cause():
    terms = [DerivativeTerm("dynamic_pressure", 1.2), DerivativeTerm("Cmq", -3.0)]
    expected = 0.2 * DERIVATIVES + [0, 0, 0, 0, -3.0, 0]
    np.testing.assert_allclose(derivative_increments(terms, DERIVATIVES, GEOMETRY), expected)


def test_terms_vanish_at_the_trim():
    change = Change(declared=(MASS,), derivatives=(DerivativeTerm("dynamic_pressure", 1.1),))
    found = resolved(change, POINT)
    assert (found.derivatives, found.declared) == ((), (MASS,))
    assert [(t.coefficient, t.signal, t.at) for t in found.aero] == [
        *(("CL", "alpha", 0.1), ("CL", "qhat", 0.0), ("CL", "elevator", -0.02)),
        *(("Cm", "alpha", 0.1), ("Cm", "qhat", 0.0), ("Cm", "elevator", -0.02)),
    ]
    scale = np.repeat([1.0 / math.cos(0.1), 1.0], 3)
    np.testing.assert_allclose([t.amplitude for t in found.aero], 0.1 * scale * DERIVATIVES, rtol=1e-12)


def test_a_change_without_causes_is_kept():
    change = Change(aero=(AeroTerm("Cm", "alpha", "quadratic", 1.0),), declared=(MASS,))
    assert resolved(change, POINT) is change


def test_unknown_names_are_errors():
    with pytest.raises(ConfigurationError, match=r"cause 'tial'.*did you mean 'tail'"):
        derivative_increments([DerivativeTerm("tial", 0.5)], DERIVATIVES, GEOMETRY)
    with pytest.raises(ConfigurationError, match=r"derivative 'CMQ'"):
        linear_terms({"CMQ": 1.0}, {})


def test_lateral_causes_have_the_derivatives_of_the_lateral_motion():
    derivatives = np.arange(1.0, 16.0)
    point = LinearPoint(derivatives, {"rudder": 0.03}, TailGeometry(aspect_ratio=8.0), LATERAL)
    terms = (DerivativeTerm("Cnr", -0.2), DerivativeTerm("CYdr", 0.1))
    found = resolved(Change(derivatives=terms), point)
    assert [(t.coefficient, t.signal, t.amplitude, t.at) for t in found.aero] == [
        ("CY", "rudder", 0.1, 0.03),
        ("Cn", "rhat", -0.2, 0.0),
    ]
    with pytest.raises(ConfigurationError, match=r"cause 'tail'"):
        resolved(Change(derivatives=(DerivativeTerm("tail", 0.5),)), point)


def test_lateral_directions_of_declared_quantities():
    derivatives = np.arange(1.0, 16.0)
    found = directions(derivatives, TailGeometry(aspect_ratio=8.0), LATERAL)
    row = dict(zip(("CY", "Cl", "Cn"), derivatives.reshape(3, 5), strict=True))
    zero = np.zeros(5)
    # a side force acts a chord, an eighth of the span, ahead of a CG that lies a chord farther aft
    moment = np.vstack([zero, zero, row["CY"]])
    moment[:, 2] += 2.0 * derivatives.reshape(3, 5)[:, 0]  # and a yaw rate turns its sideslip
    np.testing.assert_allclose(found["cg"], moment.ravel() / 8.0)
    np.testing.assert_allclose(found["mass"], [*-row["CY"], *zero, *zero])
    np.testing.assert_allclose(found["inertia_zz"], [*zero, *zero, *-row["Cn"]])
    rudder = np.zeros((3, 5))
    rudder[:, 4] = derivatives.reshape(3, 5)[:, 4]
    np.testing.assert_allclose(found["rudder"], rudder.ravel())
    assert "tail" not in found
