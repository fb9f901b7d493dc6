"""Lateral effects that are flown, against what mechanics says of each."""

from dataclasses import replace

import effect_flights as flights
import fly_campaigns as campaigns
import numpy as np
import pytest

from airtruth import aircraft as planes
from airtruth.aircraft.tail import tail_geometry
from airtruth.effects.registry import EFFECTS
from airtruth.errors import AircraftError, ConfigurationError
from airtruth.physics.composition import CAUSES, directions
from airtruth.physics.motion import LATERAL
from airtruth.physics.terms import Change, DeclaredTerm
from airtruth.simulation.linearise import linearise
from airtruth.simulation.resolution import linear_point
from airtruth.simulation.simulator import Executive
from airtruth.simulation.trim import trim
from validation import lateral_flight

ROLL = {"control": "aileron", "kind": "doublet", "amplitude_deg": 3.0, "start_s": 0.5, "step_s": 0.4}
YAW = {"control": "rudder", "kind": "doublet", "amplitude_deg": 3.0, "start_s": 2.0, "step_s": 0.4}
QUIET = {
    "gust": {"level": "none"},
    "sensors": {"ideal": True},
    "runs": 1,
    "duration_s": 4.0,
    "log_hz": 200.0,
    "manoeuvre": [ROLL | {"also": [YAW]}],
}


@pytest.fixture(scope="module")
def level(paper_condition):
    return replace(paper_condition, straight="wings-level")


@pytest.fixture(scope="module")
def point(gtm, level):
    return linear_point(gtm, level, motion=LATERAL)


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    return campaigns.fly(tmp_path_factory.mktemp("plain"), **QUIET)


def flown(folder, **effect):
    return campaigns.fly(folder, effect=[effect], **QUIET)


def series(out, name):
    """(samples,) of the one run."""
    (values,) = campaigns.channel(out, name)
    return values.astype(float)


CASES = {
    "fin_effectiveness": {"factor": 0.4},
    "adverse_yaw": {"dCnda": 0.03},
    "dihedral": {"dClbeta": -0.05},
    "derivatives:lateral": {"dCYbeta": 0.1, "dClp": -0.05, "dCnr": 0.1, "dCndr": -0.02},
}


@pytest.mark.slow
@pytest.mark.parametrize("key", CASES)
def test_the_written_aircraft_has_the_derivatives_of_its_effect(gtm, level, point, tmp_path, key):
    change = EFFECTS[key].change(CASES[key])
    along = directions(point.derivatives, point.geometry, LATERAL)
    expected = sum((t.value - CAUSES[t.cause]) * along[t.cause] for t in change.derivatives)
    plane = flights.changed(gtm, change, tmp_path, level)
    at = trim(plane, level)
    assert at.alpha_rad == pytest.approx(point.trim["alpha"], abs=1e-9)
    found = linearise(plane, at, motion=LATERAL).central - point.derivatives
    np.testing.assert_allclose(found, expected, rtol=1e-3, atol=2e-6)


@pytest.mark.slow
@pytest.mark.parametrize("control", ["aileron", "rudder"])
def test_the_effectiveness_of_a_control_scales_its_column(gtm, level, point, tmp_path, control):
    change = EFFECTS[f"{control}_effectiveness"].change({"factor": 0.7})
    plane = flights.changed(gtm, change, tmp_path)
    found = linearise(plane, trim(plane, level), motion=LATERAL).central
    expected = point.derivatives.copy()
    expected[LATERAL.column(control)] *= 0.7
    np.testing.assert_allclose(found, expected, rtol=2e-3, atol=2e-4)


def accelerations(plane, at, beta=0.0, p=0.0, r=0.0):
    """v_dot, p_dot, r_dot of a plane at another's trim with a sideslip and rates [m/s2, rad/s2]."""
    executive = Executive(plane, 1.0 / 200.0)
    moved = {"beta_rad": at.controls.of("beta_rad") + beta, "p_rad_s": p, "r_rad_s": r}
    executive.initialise(at.condition, at.controls.moved({}, **moved))
    found = executive.respond()
    return np.array([found.v_dot_m_s2, found.p_dot_rad_s2, found.r_dot_rad_s2])


@pytest.fixture(scope="module")
def at(gtm, level):
    return trim(gtm, level)


INERTIA = lateral_flight.INERTIA[np.ix_([0, 2], [0, 2])]


def pressure(at, plane):
    return 0.5 * at.density_kg_m3 * at.airspeed_m_s**2 * plane.wing_area_m2


@pytest.mark.parametrize(
    ("key", "moment", "row"),
    [("cl_beta_nonlinear:break", "dClbeta", 0), ("cn_beta_nonlinear:break", "dCnbeta", 1)],
)
@pytest.mark.parametrize("beta", [0.2, -0.2])
def test_a_break_adds_its_moment_beyond_the_sideslip(gtm, at, tmp_path, key, moment, row, beta):
    change = EFFECTS[key].change({moment: 0.3, "at_beta_rad": 0.12})
    plane = flights.changed(gtm, change, tmp_path)
    found = accelerations(plane, at, beta) - accelerations(gtm, at, beta)
    total = at.controls.of("beta_rad") + beta
    added = np.zeros(2)
    added[row] = 0.3 * np.sign(total) * (abs(total) - 0.12) * pressure(at, gtm) * gtm.constants.span_m
    np.testing.assert_allclose(found, [0.0, *np.linalg.solve(INERTIA, added)], rtol=1e-3, atol=1e-6)
    np.testing.assert_array_equal(accelerations(plane, at, 0.1), accelerations(gtm, at, 0.1))


@pytest.mark.parametrize("derivative", ["CYbeta", "CYp", "Clr", "Cnp"])
def test_an_increment_acts_about_the_cg(gtm, at, tmp_path, derivative):
    """Side forces are applied at JSBSim's reference point and taken back to the CG."""
    change = EFFECTS["derivatives:lateral"].change({f"d{derivative}": 0.4})
    plane = flights.changed(gtm, change, tmp_path, at.condition)
    beta, p, r = 0.1, 0.5, -0.4
    found = accelerations(plane, at, beta, p, r) - accelerations(gtm, at, beta, p, r)
    half = gtm.constants.span_m / (2.0 * at.airspeed_m_s)
    signal = {"beta": beta, "p": p * half, "r": r * half}[derivative[2:]]
    force = 0.4 * signal * pressure(at, gtm)
    if derivative.startswith("CY"):
        expected = [force / at.mass_kg, 0.0, 0.0]
    else:
        moment = np.array([derivative.startswith("Cl"), derivative.startswith("Cn")]) * force
        expected = [0.0, *np.linalg.solve(INERTIA, moment * gtm.constants.span_m)]
    np.testing.assert_allclose(found, expected, rtol=1e-3, atol=1e-5)


def test_a_thrust_asymmetry_yaws(gtm, at, tmp_path):
    plane = flights.changed(gtm, EFFECTS["thrust_asymmetry"].change({"moment_n_m": 3.0}), tmp_path)
    found = accelerations(plane, at) - accelerations(gtm, at)
    np.testing.assert_allclose(found, [0.0, *np.linalg.solve(INERTIA, [0.0, 3.0])], rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize(
    ("key", "values", "changed"),
    [
        ("inertia_error:ixx", {"factor": 1.3}, lambda j, unit: j + np.array([[0.3 * j[0, 0], 0.0], [0.0, 0.0]])),
        ("inertia_error:izz", {"factor": 0.8}, lambda j, unit: j + np.array([[0.0, 0.0], [0.0, -0.2 * j[1, 1]]])),
        ("inertia_error:ixz", {"shift": 0.1}, lambda j, unit: j - 0.1 * unit * np.array([[0.0, 1.0], [1.0, 0.0]])),
    ],
    ids=["ixx", "izz", "ixz"],
)  # fmt: skip
def test_an_error_of_inertia_turns_the_moments_otherwise(gtm, at, tmp_path, key, values, changed):
    plane = flights.changed(gtm, EFFECTS[key].change(values), tmp_path)
    before, after = (accelerations(each, at, 0.1)[1:] for each in (gtm, plane))
    new = changed(INERTIA, np.sqrt(INERTIA[0, 0] * INERTIA[1, 1]))
    np.testing.assert_allclose(after, np.linalg.solve(new, INERTIA @ before), rtol=1e-4)
    c = planes.load(tmp_path / gtm.name).constants
    found = [[c.inertia_xx_kg_m2, -c.inertia_xz_kg_m2], [-c.inertia_xz_kg_m2, c.inertia_zz_kg_m2]]
    np.testing.assert_allclose(found, new, rtol=1e-3)


def test_a_cg_to_the_right_rolls_to_the_right(gtm, at, tmp_path):
    """The normal force of level flight passes the CG on its left."""
    plane = flights.changed(gtm, EFFECTS["cg_shift_y"].change({"dy_m": 0.02}), tmp_path)
    found = accelerations(plane, at) - accelerations(gtm, at)
    normal = at.mass_kg * 9.80665 * np.cos(at.alpha_rad)
    expected = np.linalg.solve(INERTIA, [0.02 * normal, 0.0])
    assert found[1] == pytest.approx(expected[0], rel=0.03)
    constants = planes.load(tmp_path / gtm.name).constants
    assert constants.inertia_xx_kg_m2 == pytest.approx(gtm.constants.inertia_xx_kg_m2, rel=1e-9)


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize(("name", "fraction"), [("wing_tip_loss", 0.1), ("flap_loss", 0.8)])
def test_a_lost_part_of_the_wing_rolls_to_its_side_at_rest(gtm, at, tmp_path, name, fraction, side):
    effect = EFFECTS[name if side == "left" else f"{name}:right"]
    plane = flights.changed(gtm, effect.change({"fraction": fraction}), tmp_path, at.condition)
    found = accelerations(plane, at) - accelerations(gtm, at)
    sign = -1.0 if side == "left" else 1.0
    # lift of a tenth of the semispan at 0.93 of it or of most of a flap, and the CG that moves to the other side
    assert sign * found[1] > 0.0
    held = trim(plane, at.condition)
    assert sign * (held.surfaces_rad["aileron"] - at.surfaces_rad["aileron"]) > np.deg2rad(1.0)


@pytest.mark.slow
def test_a_late_aileron_shifts_the_roll_rate_and_not_the_measured_surface(tmp_path, plain):
    late = flown(tmp_path, name="aileron_delay", delay_ms=80)
    early = slice(0, 300)  # before the rudder moves
    rate, before = (series(out, "p_rad_s") for out in (late, plain))
    np.testing.assert_allclose(rate[early][16:], before[early][:-16], atol=2e-5)
    surface = [series(out, "aileron_rad") for out in (late, plain)]
    np.testing.assert_allclose(*surface, atol=1e-7)


@pytest.mark.slow
def test_sensors_read_what_their_equations_say(tmp_path, plain):
    names = ("beta_rad", "p_rad_s", "r_rad_s", "airspeed_m_s", "alpha_rad", "ay_m_s2")
    truth = {name: series(plain, name) for name in names}
    p_dot, r_dot = (np.gradient(truth[name], 1.0 / 200.0) for name in ("p_rad_s", "r_rad_s"))
    speed = truth["airspeed_m_s"]
    expected = {
        ("vane_arm", "beta_rad", "x_m", 1.5): 1.5 * truth["r_rad_s"] / speed,
        ("accelerometer_arm", "ay_m_s2", "x_m", 0.4): 0.4 * r_dot,
        ("accelerometer_arm_z", "ay_m_s2", "z_m", 0.3): -0.3 * p_dot,
        ("alpha_vane_roll_arm", "alpha_rad", "y_m", 1.0): truth["p_rad_s"] / speed,
        ("gyro_scale", "p_rad_s", "factor", 1.1): 0.1 * truth["p_rad_s"],
    }
    for number, ((name, channel, parameter, value), more) in enumerate(expected.items()):
        effect = {"name": name, parameter: value}
        if EFFECTS.get(name) is None or name in ("vane_arm", "accelerometer_arm", "gyro_scale"):
            effect["variant"] = channel
        out = campaigns.fly(tmp_path / str(number), effect=[effect], **QUIET)
        found = series(out, channel) - truth[channel]
        scale = np.abs(more).max()
        assert np.abs(found - more)[2:-2].max() < 0.06 * scale, name
        assert np.sqrt(np.mean((found - more) ** 2)) < 0.02 * scale, name


@pytest.mark.slow
def test_a_lateral_effect_makes_a_campaign_fly_in_six_axes(tmp_path):
    doublet = {"kind": "doublet", "amplitude_deg": 2.0, "start_s": 0.5, "step_s": 0.25}
    pitch = QUIET | {"manoeuvre": [doublet]}
    out = campaigns.fly(tmp_path, effect=[{"name": "wing_tip_loss", "fraction": 0.1}], **pitch)
    assert np.abs(series(out, "aileron_rad")).max() > np.deg2rad(1.0)
    rate = series(out, "p_rad_s")
    assert np.abs(rate).max() > 1e-4


def test_a_factor_on_side_gusts_needs_them(tmp_path):
    table = {"name": "gust_level", "variant": "v", "factor": 1.5}
    calm = campaigns.write(tmp_path / "calm.toml", effect=[table], gust={"level": "none"})
    from airtruth.simulation.campaign import plan

    with pytest.raises(ConfigurationError, match="needs gusts"):
        plan.make(calm)
    without = {"level": "light", "lateral": False}
    straight = campaigns.write(tmp_path / "straight.toml", effect=[table], gust=without)
    with pytest.raises(ConfigurationError, match="side gusts"):
        plan.make(straight)
    rough = plan.make(campaigns.write(tmp_path / "rough.toml", effect=[table], gust={"level": "light"}))
    ratio = rough.table["sigma_v_m_s"] / rough.table["sigma_w_m_s"]
    np.testing.assert_allclose(ratio, 1.5)


FIN = """
[fin]
arm = { value = 3.4, unit = "ft" }
height = { value = 0.6, unit = "ft" }
area = { value = 0.9, unit = "ft2" }
lift_slope = { value = 3.0 }
[wing]
taper = { value = 0.35 }
aileron_inboard = { value = 0.5 }
flap_outboard = { value = 0.45 }
flap_depth = { value = 0.3 }
"""


def with_tables(plane, folder, text):
    made = flights.changed(plane, Change(), folder).folder
    path = made / "aircraft.toml"
    path.write_text(path.read_text(encoding="utf-8") + "\n" + text + "\n", encoding="utf-8")
    return planes.load(made)


def test_fin_and_wing_of_an_aircraft_toml(gtm, tmp_path):
    plain, stated = tail_geometry(gtm).side, tail_geometry(with_tables(gtm, tmp_path / "a", FIN)).side
    assert (plain.fin_arm, plain.fin_lift, plain.rudder_on_fin) == (None, None, True)
    assert stated.fin_arm == pytest.approx(3.4 / 6.8488, rel=1e-4)
    assert stated.fin_height == pytest.approx(0.6 / 6.8488, rel=1e-4)
    assert stated.fin_lift == pytest.approx(3.0 * 0.9 / 5.9018, rel=1e-4)
    assert (stated.taper, stated.aileron) == (0.35, (0.5, plain.aileron[1]))
    assert (stated.flap, stated.flap_depth) == ((plain.flap[0], 0.45), 0.3)
    aft = Change(declared=(DeclaredTerm("cg", 0.1),))
    moved = flights.changed(planes.load(tmp_path / "a" / gtm.name), aft, tmp_path / "b")
    assert tail_geometry(moved).side.fin_arm == pytest.approx((3.4 - 0.09153) / 6.8488, rel=1e-4)
    with pytest.raises(AircraftError, match="the inboard one first"):
        with_tables(gtm, tmp_path / "c", "[wing]\naileron_inboard = { value = 0.97 }")


def test_an_aircraft_without_the_control_refuses_its_effect(gtm, tmp_path):
    model = gtm.file.jsbsim.model_copy(update={"rudder": None})
    plane = gtm.model_copy(update={"file": gtm.file.model_copy(update={"jsbsim": model})})
    with pytest.raises(AircraftError, match=r"states no rudder.*jsbsim\.rudder"):
        flights.changed(plane, EFFECTS["rudder_delay"].change({"delay_s": 0.05}), tmp_path)
