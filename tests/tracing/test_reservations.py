"""Names that are provisional without an anomaly: several causes at once, and names beside an increment."""

import pytest

from airtruth.tracing.accepted import AcceptedEffect
from airtruth.tracing.answer import Alternative
from airtruth.tracing.reservations import MANY, causes, reservations


def effects(*names):
    return [
        AcceptedEffect(name, {}, 1e-9, 5.0, acts_on="Cm" if name == "increment" else None) for name in names
    ]


@pytest.mark.parametrize(
    "names",
    [
        (),
        ("vane_lag",),
        ("vane_lag", "elevator_delay"),
        ("cg_shift", "mass_error", "inertia_error"),
        ("cg_shift", "mass_error", "inertia_error", "vane_lag"),
        ("increment",),
        ("increment", "increment"),
    ],
)
def test_one_or_two_causes_or_increments_alone_are_not_reserved(names):
    """A load that is not declared moves CG, mass and inertia together: one cause."""
    assert reservations(effects(*names), ()) == ()


def test_three_causes_are_provisional():
    names = ("accelerometer_scale", "gyro_bias", "derivatives")
    (reason,) = reservations(effects(*names), ())
    assert causes(effects(*names)) == MANY
    assert reason.startswith("accelerometer_scale, gyro_bias, derivatives are 3 causes or more")


def test_an_axial_force_beside_another_effect_is_provisional():
    """Where a wrong effect leaves an error of the angle of attack, ax shows it as an axial force."""
    along = AcceptedEffect("increment", {}, 1e-9, 5.0, variant="CX over alpha_rad", acts_on="CX")
    assert reservations([along], ()) == ()
    (reason,) = reservations([*effects("vane_scale"), along], ())
    assert "where vane_scale is not the true cause" in reason
    (reason,) = reservations([*effects("increment"), along], ())
    assert "where increment is not the true cause" in reason


def test_a_leading_set_that_is_improbable_is_provisional():
    sets = [Alternative(("inertia_error", "mass_error"), 0.28), Alternative(("airspeed_scale",), 0.14)]
    (reason,) = reservations(effects("inertia_error", "mass_error"), sets)
    assert reason.startswith("the leading set of causes has a posterior weight of 28 %:")
    assert reservations(effects("vane_lag"), [Alternative(("vane_lag",), 0.5)]) == ()
    assert reservations(effects("increment"), sets) == ()


def test_names_beside_an_increment_are_provisional():
    (one,) = reservations(effects("vane_arm", "increment"), ())
    assert "what vane_arm explains:" in one
    two, many = reservations(effects("vane_arm", "cg_shift", "derivatives", "increment"), ())
    assert "what vane_arm, cg_shift, derivatives explain:" in two
    assert "or more" in many
