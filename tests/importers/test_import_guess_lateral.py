"""The guess and the import of lateral-directional columns: names, units, signs and sides by names and by physics."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from airtruth.channels import LATERAL
from airtruth.importers import MappingFile, Source, convert, guess_mapping, import_log
from airtruth.importers.dictionary import lexicon
from tests.importers.lateral_flight import NOISE, lateral, recorded
from tests.importers.test_import_guess_layouts import NAMES, columns, write

DEG, G0 = np.pi / 180.0, 9.80665
MOTION = {
    "p": ("p_rad_s", DEG),
    "r": ("r_rad_s", DEG),
    "phi": ("phi_rad", DEG),
    "beta": ("beta_rad", DEG),
    "ay": ("ay_m_s2", G0),
}
SURFACES = {"da": ("aileron_rad", DEG), "dr": ("rudder_rad", DEG)}


def flight(**lateral_columns):
    """The longitudinal table with its units in the headers, and further columns."""
    table = columns(0.0, 26.0)
    rows = len(table["time [s]"])
    return {**table, **{name: values[:rows] for name, values in lateral_columns.items()}}


def usual(which=MOTION, units=None):
    return {
        name + (f" [{units[name]}]" if units else ""): recorded(channel) / factor
        for name, (channel, factor) in which.items()
    }


def guess(tmp_path, table):
    path = write(tmp_path / "f.csv", table)
    text = guess_mapping(path)
    (tmp_path / "m.toml").write_text(text)
    mapping = tomllib.loads(text)
    return text, mapping, import_log(path, tmp_path / "m.toml").log


def assert_true(log, expected):
    """Lateral channels are those that are expected, and within four deviations of their noise."""
    assert {name for name in log.channels if name in LATERAL} == set(expected)
    for name in expected:
        exact = lateral()[name][::8][: len(log.t_s)]
        np.testing.assert_allclose(log.channels[name], exact, atol=4.8 * NOISE[name], err_msg=name)


@pytest.mark.parametrize(
    "units", [None, {"p": "deg/s", "r": "deg/s", "phi": "deg", "beta": "deg", "ay": "g"}]
)
def test_units_follow_from_the_motion(tmp_path, units):
    """Without units in their headers the columns are in deg and g, as kinematics and the other accelerometers show."""
    table = flight(**usual(units=units))
    if units is None:  # accelerometers share a unit
        for name in ("ax", "az"):
            table[name] = table.pop(f"{name} [m/s2]") / G0
    text, mapping, log = guess(tmp_path, table)
    assert_true(log, ["p_rad_s", "r_rad_s", "phi_rad", "beta_rad", "ay_m_s2"])
    assert "phi is 1 of the integral of p and of the turn" in text
    assert mapping["channels"]["p_rad_s"]["unit"] == "deg_s"


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_signs_of_aileron_and_rudder_follow_from_the_motion(tmp_path, sign):
    table = flight(
        **usual(units={"p": "deg/s", "r": "deg/s", "phi": "deg", "beta": "deg", "ay": "g"}),
        **{
            "da [deg]": sign * recorded("aileron_rad") / DEG,
            "dr [deg]": -sign * recorded("rudder_rad") / DEG,
        },
    )
    text, mapping, log = guess(tmp_path, table)
    assert_true(log, ["p_rad_s", "r_rad_s", "phi_rad", "beta_rad", "ay_m_s2", "aileron_rad", "rudder_rad"])
    assert mapping["channels"]["aileron_rad"].get("sign", 1) == sign
    assert mapping["channels"]["rudder_rad"].get("sign", 1) == -sign
    assert "the aileron changes p' by -" in text
    assert "the rudder changes r' by -" in text


def test_a_heading_that_jumps_by_a_turn(tmp_path):
    """The flight begins at 355 deg and turns through north."""
    heading = np.mod(recorded("psi_rad") / DEG, 360.0)
    assert np.abs(np.diff(heading)).max() > 300.0
    table = flight(**usual(units={"p": "deg/s", "r": "deg/s", "phi": "deg", "beta": "deg", "ay": "g"}))
    text, _, log = guess(tmp_path, {**table, "heading [deg]": heading[: len(table["time [s]"])]})
    assert "psi is" in text
    turned = log.channels["psi_rad"] - lateral()["psi_rad"][::8][: len(log.t_s)]
    np.testing.assert_allclose(turned - turned[0], 0.0, atol=9.6 * NOISE["psi_rad"])


@pytest.mark.parametrize("mirrored", [False, True])
def test_two_ailerons_are_half_their_difference(tmp_path, mirrored):
    """Each trailing edge down, or both positive for a roll to the right."""
    right = recorded("aileron_rad") / DEG
    left = -right + 0.02 * np.random.default_rng(3).standard_normal(len(right))
    sides = {"Aileron Left [deg]": -left if mirrored else left, "Aileron Right [deg]": right}
    table = flight(
        **usual(units={"p": "deg/s", "r": "deg/s", "phi": "deg", "beta": "deg", "ay": "g"}), **sides
    )
    _, mapping, log = guess(tmp_path, table)
    assert_true(log, ["p_rad_s", "r_rad_s", "phi_rad", "beta_rad", "ay_m_s2", "aileron_rad"])
    stated = mapping["channels"]["aileron_rad"]
    assert stated["columns"] == ["Aileron Right [deg]", "Aileron Left [deg]"]
    assert stated["weights"] == [0.5, 0.5 if mirrored else -0.5]


@pytest.mark.parametrize("mirrored", [False, True])
def test_elevons_are_elevator_and_aileron(tmp_path, mirrored):
    table = flight(**usual(units={"p": "deg/s", "r": "deg/s", "phi": "deg", "beta": "deg", "ay": "g"}))
    elevator = table.pop("elevator [deg]")
    aileron = (recorded("aileron_rad") / DEG)[: len(elevator)]
    left, right = elevator - aileron, elevator + aileron
    table |= {"elevon left [deg]": -left if mirrored else left, "elevon right [deg]": right}
    _, mapping, log = guess(tmp_path, table)
    assert_true(log, ["p_rad_s", "r_rad_s", "phi_rad", "beta_rad", "ay_m_s2", "aileron_rad"])
    np.testing.assert_allclose(log.channels["elevator_rad"], elevator * DEG, atol=1e-6)
    weights = {name: mapping["channels"][name]["weights"] for name in ("elevator_rad", "aileron_rad")}
    assert weights == {
        "elevator_rad": [0.5, -0.5 if mirrored else 0.5],
        "aileron_rad": [0.5, 0.5 if mirrored else -0.5],
    }


def test_the_surfaces_of_a_v_tail_are_elevator_and_rudder(tmp_path):
    table = flight(**usual(units={"p": "deg/s", "r": "deg/s", "phi": "deg", "beta": "deg", "ay": "g"}))
    elevator = table.pop("elevator [deg]")
    rudder = (recorded("rudder_rad") / DEG)[: len(elevator)]
    table |= {"ruddervator_l (deg)": elevator - rudder, "ruddervator_r (deg)": elevator + rudder}
    _, mapping, log = guess(tmp_path, table)
    assert_true(log, ["p_rad_s", "r_rad_s", "phi_rad", "beta_rad", "ay_m_s2", "rudder_rad"])
    assert mapping["channels"]["rudder_rad"]["weights"] == [0.5, -0.5]


def test_two_fins_are_the_mean_of_their_rudders(tmp_path):
    rudder = recorded("rudder_rad") / DEG
    table = flight(
        **usual(units={"p": "deg/s", "r": "deg/s", "phi": "deg", "beta": "deg", "ay": "g"}),
        **{"rudder left [deg]": rudder - 0.3, "rudder right [deg]": rudder + 0.3},
    )
    _, mapping, log = guess(tmp_path, table)
    assert_true(log, ["p_rad_s", "r_rad_s", "phi_rad", "beta_rad", "ay_m_s2", "rudder_rad"])
    assert len(mapping["channels"]["rudder_rad"]["columns"]) == 2


def test_columns_that_do_not_decide_a_sign_are_doubts_and_stop_nothing(tmp_path):
    """An aileron that does not move, and a yaw rate with empty cells."""
    rate = recorded("r_rad_s") / DEG
    rate[40] = np.nan
    still = 0.5 * np.random.default_rng(5).standard_normal(len(rate))
    table = flight(**{"r [deg/s]": rate, "aileron [deg]": still})
    text, mapping, log = guess(tmp_path, table)
    assert set(mapping["channels"]) == {channel for channel, _ in NAMES.values()}
    assert "# 'r [deg/s]' is not r_rad_s: some of its cells are empty" in text
    assert "# Not mapped: aileron_rad is in doubt: neither header nor physics decides its sign" in text
    assert "Gravity and kinematics do not contradict it" in text
    assert set(log.channels) == set(mapping["channels"])


def test_a_quaternion_and_a_velocity_give_the_lateral_angles(tmp_path):
    c = {name: values[::8] for name, values in lateral().items()}
    half = 0.5 * np.stack([c["phi_rad"], c["theta_rad"], c["psi_rad"]])
    (sx, sy, sz), (cx, cy, cz) = np.sin(half), np.cos(half)
    speed, alpha, beta = c["airspeed_m_s"], c["alpha_rad"], c["beta_rad"]
    table = flight(
        **usual({"p": MOTION["p"], "r": MOTION["r"]}, {"p": "deg/s", "r": "deg/s"}),
        qw=cx * cy * cz + sx * sy * sz,
        qx=sx * cy * cz - cx * sy * sz,
        qy=cx * sy * cz + sx * cy * sz,
        qz=cx * cy * sz - sx * sy * cz,
        **{
            "u [m/s]": speed * np.cos(alpha) * np.cos(beta),
            "v [m/s]": speed * np.sin(beta),
            "w [m/s]": speed * np.sin(alpha) * np.cos(beta),
        },
    )
    del table["theta [deg]"], table["tas [m/s]"], table["alpha [deg]"]
    _, mapping, log = guess(tmp_path, table)
    assert not {"phi_rad", "psi_rad", "beta_rad"} & set(mapping["channels"])
    for name in ("phi_rad", "beta_rad"):
        np.testing.assert_allclose(log.channels[name], c[name][: len(log.t_s)], atol=1e-6)


def test_a_stated_heading_is_unwrapped_on_import():
    t = np.arange(100) * 0.02
    source = Source(Path("f.csv"), {"t": t, "hdg": np.mod(350.0 + 20.0 * t, 360.0)})
    stated = {"time": {"column": "t"}, "channels": {"psi_rad": {"column": "hdg", "unit": "deg"}}}
    log = convert(source, MappingFile.model_validate(stated))
    np.testing.assert_allclose(log.channels["psi_rad"], (350.0 + 20.0 * t) * DEG)


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (["vehicle_attitude.q[0]", "vehicle_angular_velocity.xyz[0]"], "p_rad_s"),
        (["vehicle_attitude.q[0]", "vehicle_acceleration.xyz[1]"], "ay_m_s2"),
        (["ATT.Pitch", "ATT.Roll"], "phi_rad"),
        (["ATT.Pitch", "IMU.GyrZ"], "r_rad_s"),
        (["NormAc", "LatAc"], "ay_m_s2"),
        (["*velocities/q-rad_sec", "fcs/left-aileron-pos-rad"], "aileron_rad"),
        (["PfwdSmoothed", "boomBeta"], "beta_rad"),
        (["alpha,__deg ", "Gload,_side "], "ay_m_s2"),
    ],
)
def test_sources_know_their_lateral_columns(names, expected):
    entry = lexicon(names).entry(names[1])
    assert entry is not None
    assert entry[0].channel == expected


@pytest.mark.parametrize("name", ["elevon_{}_pwm", "elevon {}"])
def test_pulse_widths_of_elevons_are_no_angles(tmp_path, name):
    """Half the difference of two pulse widths has the size of an angle, and is none."""
    table = flight(**usual(units={"p": "deg/s", "r": "deg/s", "phi": "deg", "beta": "deg", "ay": "g"}))
    elevator = table.pop("elevator [deg]")
    table |= {name.format("L"): 1500.0 + 16.0 * elevator, name.format("R"): 1500.0 - 16.0 * elevator}
    text = guess_mapping(write(tmp_path / "f.csv", table))
    assert not {"elevator_rad", "aileron_rad"} & set(tomllib.loads(text)["channels"])
    assert "# Not mapped: elevator_rad: " in text
    assert "are several surfaces that are elevator and aileron together; state columns, and weights" in text
