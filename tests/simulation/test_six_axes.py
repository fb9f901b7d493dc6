"""The GTM in six axes: tables, trim, lateral derivatives and flights that stay in the pitch plane."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from airtruth import aircraft
from airtruth.aircraft.model import LateralProperties
from airtruth.errors import ConfigurationError, TrimError
from airtruth.physics.motion import LATERAL
from airtruth.simulation.attitude import straight_attitude
from airtruth.simulation.flight import Flight, Inputs, LateralInputs
from airtruth.simulation.lateral_feedback import LateralFeedback
from airtruth.simulation.linearise import linearise
from airtruth.simulation.simulator import Condition, Controls, Executive
from airtruth.simulation.trim import trim
from airtruth.units import DEG, FT, KT
from scripts import gtm_model

GTM = Path(__file__).parents[2] / "aircraft" / "gtm"
# An independent six-degree-of-freedom integration of NASA's tables at 75 kt EAS, 7000 ft, level, to its printed digits.
TRUTH = {
    "CYbeta": -1.0158, "CYp": 0.063, "CYr": 0.8565, "CYda": -0.0157, "CYdr": 0.3406,
    "Clbeta": -0.1403, "Clp": -0.3352, "Clr": 0.1472, "Clda": -0.0718, "Cldr": 0.0266,
    "Cnbeta": 0.2185, "Cnp": -0.0528, "Cnr": -0.3897, "Cnda": -0.0035, "Cndr": -0.1700,
}  # fmt: skip
MODES = {
    "dutch_roll_wn_rad_s": 5.985,
    "dutch_roll_zeta": 0.120,
    "roll_1_s": -5.434,
    "spiral_1_s": -0.0366,
}
ABSOLUTE = {"CYp": 0.005, "Cnda": 0.005}  # determined by no flight: compared in absolute terms
angles = st.floats(-0.3, 0.3)


@pytest.fixture(scope="module")
def level(gtm, paper_condition):
    return trim(gtm, replace(paper_condition, straight="wings-level"))


def state_of(gtm, at, names):
    executive = Executive(gtm, 1.0 / 200.0)
    executive.initialise(at.condition, at.controls)
    return [executive.fdm[name] for name in names]


def test_commands_in_six_axes_take_the_place_of_those_that_hold_the_aircraft_straight(gtm, paper_condition):
    """The properties of both are the same in the models of most propeller aircraft."""
    model = gtm.file.jsbsim
    held = LateralProperties(aileron=model.aileron.command, rudder=model.rudder.command)
    file = gtm.file.model_copy(update={"jsbsim": model.model_copy(update={"lateral": held})})
    executive = Executive(gtm.model_copy(update={"file": file}), 1.0 / 200.0)
    executive.initialise(replace(paper_condition, straight="wings-level"), Controls(0.3, {"aileron": 0.02}))
    assert executive.fdm[model.aileron.command] == pytest.approx(0.02 * model.aileron.command_per_rad)


def test_the_model_holds_the_tables_of_the_folder():
    functions = {c: gtm_model.function(c) for c in ("CX", "CY", "CZ", "Cl", "Cm", "Cn")}
    text = gtm_model.MODEL.read_text(encoding="utf-8")
    assert gtm_model.generated(text, functions) == text


@pytest.mark.parametrize(("coefficient", "factor"), [("CX", 1.0), ("CY", -1.0), ("Cm", 1.0), ("Cn", -1.0)])
def test_a_mirrored_flight_has_the_mirrored_coefficients(coefficient, factor):
    """The aircraft is symmetric: sideslip and deflections of the other sign give CY, Cl, Cn of the other sign."""
    for name, both in (("right_aileron", gtm_model.both_ailerons), ("rudder", gtm_model.both_ways)):
        points, values = both(*gtm_model.read(name, coefficient), factor)
        np.testing.assert_array_equal(points[2], -points[2][::-1])
        np.testing.assert_allclose(values[:, ::-1, ::-1], factor * values, atol=1e-15)


@given(alpha=angles, beta=angles, phi=angles, gamma=angles)
def test_straight_attitude_holds_the_path(alpha, beta, phi, gamma):
    """The rotation matrix of the Euler angles turns the velocity into the flight path: north, at the path angle."""
    theta, psi, v = straight_attitude(alpha, beta, phi, gamma)
    (cp, sp), (ct, s), (cf, sf) = ((np.cos(x), np.sin(x)) for x in (psi, theta, phi))
    matrix = np.array(
        [
            [ct * cp, sf * s * cp - cf * sp, cf * s * cp + sf * sp],
            [ct * sp, sf * s * sp + cf * cp, cf * s * sp - sf * cp],
            [-s, sf * ct, cf * ct],
        ]
    )
    np.testing.assert_allclose(matrix @ v, [np.cos(gamma), 0.0, -np.sin(gamma)], atol=1e-12)


def test_the_wings_are_level(gtm, level):
    c = level.controls
    assert level.residual < 1e-8
    assert c.of("phi_rad") == 0.0
    # The increments of the rates are not zero at zero rate (NASA's tables): sideslip, aileron and rudder balance them.
    assert [
        round(x / DEG, 2)
        for x in (c.of("beta_rad"), level.surfaces_rad["aileron"], level.surfaces_rad["rudder"])
    ] == [
        -0.05,
        0.08,
        -0.07,
    ]
    names = ("aero/beta-rad", "attitude/phi-rad", "velocities/v-east-fps", "velocities/h-dot-fps")
    np.testing.assert_allclose(state_of(gtm, level, names), [c.of("beta_rad"), 0.0, 0.0, 0.0], atol=1e-12)


def test_there_is_no_sideslip(gtm, paper_condition):
    at = trim(gtm, replace(paper_condition, straight="no-sideslip"))
    assert at.residual < 1e-8
    names = ("aero/beta-rad", "attitude/phi-rad", "velocities/h-dot-fps")
    np.testing.assert_allclose(state_of(gtm, at, names), [0.0, at.controls.of("phi_rad"), 0.0], atol=1e-12)


@pytest.mark.parametrize("eas_kt", [55, 75, 95])
@pytest.mark.parametrize("path_deg", [-4.0, 0.0, 3.0])
@pytest.mark.parametrize("straight", ["wings-level", "no-sideslip"])
def test_residual_over_the_envelope(gtm, eas_kt, path_deg, straight):
    at = trim(gtm, Condition(eas_kt * KT, 5000 * FT, path_deg * DEG, straight))
    assert at.residual < 1e-8
    climb = state_of(gtm, at, ["velocities/h-dot-fps"])[0] * FT
    assert climb == pytest.approx(at.airspeed_m_s * np.sin(path_deg * DEG), abs=1e-9)


def edited(tmp_path, old, new):
    folder = tmp_path / "gtm"
    shutil.copytree(GTM, folder)
    text = (folder / "gtm.xml").read_text(encoding="utf-8")
    assert text.count(old) == 1
    (folder / "gtm.xml").write_text(text.replace(old, new), encoding="utf-8")
    return aircraft.load(folder)


CG = """<location name="CG" unit="IN">
      <x> 56.9697 </x>
      <y> {} </y>"""


@pytest.mark.parametrize("straight", ["wings-level", "no-sideslip"])
def test_an_asymmetric_aircraft_is_trimmed(tmp_path, paper_condition, straight):
    """The CG of the real aircraft lies 0.14 in to the left; NASA's simulation then trims with alpha 5.558 deg and elevator
    0.095 deg, through the pitching moment of the ailerons."""
    plane = edited(tmp_path, CG.format("0.0"), CG.format("-0.1416"))
    at = trim(plane, replace(paper_condition, straight=straight))
    assert at.residual < 1e-8
    assert at.alpha_rad / DEG == pytest.approx(5.558, abs=0.001)
    assert at.elevator_rad / DEG == pytest.approx(
        0.095, abs=0.01
    )  # the thrust lines' toe angles are left out
    # The lift, m g, acts 0.1416 in to the right of the CG: Clda aileron q_bar S b = m g y, without sideslip.
    lift_moment = at.mass_kg * 9.80665 * 0.1416 * FT / 12.0
    pressure = 0.5 * at.density_kg_m3 * at.airspeed_m_s**2
    aileron = lift_moment / (TRUTH["Clda"] * pressure * plane.wing_area_m2 * plane.constants.span_m)
    assert at.surfaces_rad["aileron"] == pytest.approx(
        aileron, rel=0.02 if straight == "no-sideslip" else 0.1
    )
    assert (at.controls.of("phi_rad") == 0.0) == (straight == "wings-level")


def test_what_cannot_be_balanced_is_refused(tmp_path, paper_condition):
    plane = edited(tmp_path, CG.format("0.0"), CG.format("-9.0"))
    with pytest.raises(
        TrimError,
        match=r"cannot be trimmed .*, aileron .* deg, rudder .* deg, sideslip .*Choose another speed",
    ):
        trim(plane, replace(paper_condition, straight="wings-level"))


def test_six_axes_need_lateral_controls(gtm, paper_condition):
    model = gtm.file.jsbsim.model_copy(update={"rudder": None})
    plane = gtm.model_copy(update={"file": gtm.file.model_copy(update={"jsbsim": model})})
    with pytest.raises(
        TrimError, match=r"gtm has no lateral controls: .* jsbsim\.aileron and jsbsim\.rudder"
    ):
        trim(plane, replace(paper_condition, straight="wings-level"))


def test_declared_lateral_derivatives_are_the_independent_truth(gtm, level):
    linear = linearise(gtm, level, motion=LATERAL)
    found = dict(zip(LATERAL.parameters, linear.central, strict=True))
    assert set(found) == set(TRUTH)
    for name, expected in TRUTH.items():
        allowed = ABSOLUTE.get(name, 0.005 * abs(expected))
        assert found[name] == pytest.approx(expected, abs=allowed), name
    assert linear.modes == pytest.approx(MODES, rel=0.01)


def test_the_short_period_is_that_of_the_pitch_plane(gtm, paper_trim, level):
    plane, six = linearise(gtm, paper_trim), linearise(gtm, level)
    np.testing.assert_allclose(six.plus, plane.plus, rtol=1e-3)  # 0.002 deg of alpha and 0.01 deg of elevator
    assert six.modes == pytest.approx(plane.modes, rel=1e-3)


def test_lateral_derivatives_need_six_axes(gtm, paper_trim):
    with pytest.raises(TrimError, match="lateral derivatives need a trim in six axes"):
        linearise(gtm, paper_trim, motion=LATERAL)


def still(samples):
    return np.zeros(samples)


def test_a_trim_stays_where_it_is(gtm, level):
    flown = Flight(gtm, level, 1.0 / 200.0, 4).fly(Inputs(still(801), still(801), still(801)))
    for name in ("beta_rad", "p_rad_s", "r_rad_s", "phi_rad", "alpha_rad", "aileron_rad", "ay_m_s2"):
        np.testing.assert_allclose(flown[name], flown[name][0], atol=1e-9, err_msg=name)


def test_a_flight_in_the_pitch_plane_has_no_lateral_motion(gtm, paper_trim):
    flight = Flight(gtm, paper_trim, 1.0 / 200.0, 4)
    command = 2.0 * DEG * np.sin(np.arange(401) / 30.0)
    assert "beta_rad" not in flight.fly(Inputs(command, still(401), 3.0 * np.cos(np.arange(401) / 20.0)))
    fdm = flight._executive.fdm
    names = ("aero/beta-rad", "velocities/p-rad_sec", "velocities/r-rad_sec", "attitude/phi-rad")
    assert [fdm[name] for name in names] == [0.0, 0.0, 0.0, 0.0]
    lateral = LateralInputs({})
    with pytest.raises(ConfigurationError, match="lateral inputs need a trim in six axes"):
        flight.fly(Inputs(still(401), still(401), still(401), lateral=lateral))


@pytest.mark.parametrize(
    ("control", "signs"),
    [("aileron_rad", {"p_rad_s": -1.0}), ("rudder_rad", {"r_rad_s": -1.0, "ay_m_s2": 1.0})],
)
def test_signs_of_the_controls(gtm, level, control, signs):
    """Right aileron down: left wing down; rudder's trailing edge left: nose left, side force to the right."""
    step = np.where(np.arange(101) > 20, 1.0 * DEG, 0.0)
    flown = Flight(gtm, level, 1.0 / 200.0).fly(
        Inputs(
            still(101), still(101), still(101), lateral=LateralInputs({control.removesuffix("_rad"): step})
        )
    )
    assert flown[control][-1] - flown[control][0] == pytest.approx(1.0 * DEG, rel=0.01)
    for name, sign in signs.items():
        assert sign * (flown[name][40] - flown[name][0]) > 0.0, name


def test_bank_and_heading_have_no_jumps(gtm, level):
    """A bank that goes through half a turn, and a heading that starts below north, are added up."""
    roll = LateralInputs({"aileron": np.full(1201, -15.0 * DEG)})
    flown = Flight(gtm, level, 1.0 / 200.0, 4).fly(
        Inputs(still(1201), still(1201), still(1201), lateral=roll)
    )
    assert np.abs(flown["phi_rad"]).max() > np.pi
    for name in ("phi_rad", "psi_rad"):
        assert abs(flown[name][0]) < 0.01
        assert np.abs(np.diff(flown[name])).max() < 0.5


def test_feedback_holds_bank_and_damps_the_dutch_roll(gtm, level):
    rudder = np.where((np.arange(1601) > 100) & (np.arange(1601) < 160), 3.0 * DEG, 0.0)

    def flown(**gains):
        feedback = LateralFeedback((still(1601),) * 3, **gains)
        lateral = LateralInputs({"rudder": rudder}, feedback=feedback)
        return Flight(gtm, level, 1.0 / 200.0, 4).fly(
            Inputs(still(1601), still(1601), still(1601), lateral=lateral)
        )

    free, held = flown(), flown(yaw_damper_gain_s=0.4, bank_gain=0.2)
    late = slice(100, None)  # from 2 s
    assert np.ptp(held["r_rad_s"][late]) < 0.6 * np.ptp(free["r_rad_s"][late])
    assert abs(held["phi_rad"][-1]) < 0.2 * abs(free["phi_rad"][-1])
