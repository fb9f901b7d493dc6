"""Derived channels of a mapping: weights, calibrations, attitude, velocity in body axes, air data."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from airtruth.errors import ConfigurationError, LogError
from airtruth.importers.attitude import air_angles, euler_angles
from airtruth.importers.convert import convert
from airtruth.importers.mapping import MappingFile, read_mapping
from airtruth.importers.series import calibrated
from airtruth.importers.sources import Source
from airtruth.physics.atmosphere import (
    GAS_CONSTANT_J_KG_K,
    P0_PA,
    RHO0_KG_M3,
    altitude_of_pressure_m,
    density_kg_m3,
    geopotential_m,
    pressure_pa,
    temperature_k,
    true_airspeed_of_calibrated_m_s,
)

DEG = np.pi / 180.0
T = np.arange(50) * 0.02
ANGLES = np.random.default_rng(58).uniform([-np.pi, -1.5, -np.pi], [np.pi, 1.5, np.pi], (40, 3))
"""phi, theta, psi [rad]."""


def made(columns, channels, **more):
    """Channels of a table in memory."""
    arrays = {"t": T, **{name: np.broadcast_to(values, T.shape) for name, values in columns.items()}}
    stated = {"time": {"column": "t"}, "channels": channels, **more}
    return convert(Source(Path("flight.csv"), arrays), MappingFile.model_validate(stated)).channels


def column(name, unit, **more):
    return {"column": name, "unit": unit, **more}


@pytest.mark.parametrize("rotates", ["body_to_earth", "earth_to_body"])
@pytest.mark.parametrize("frame", ["ned", "enu"])
def test_quaternions_have_the_angles_of_scipy(frame, rotates):
    body_to_ned = Rotation.from_euler("ZYX", ANGLES[:, ::-1])
    if frame == "enu":  # east, north, up and forward, left, up as rows of matrices
        earth = Rotation.from_matrix([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
        body = Rotation.from_matrix(np.diag([1.0, -1.0, -1.0]))
        rotation = earth * body_to_ned * body
    else:
        rotation = body_to_ned
    if rotates == "earth_to_body":
        rotation = rotation.inv()
    for sign in (1.0, -1.0):
        quaternion = sign * rotation.as_quat(scalar_first=True).T
        found = euler_angles(quaternion, frame=frame, rotates=rotates)
        np.testing.assert_allclose(np.array(found).T, ANGLES, atol=1e-12)


def test_body_velocities_invert_their_definition():
    rng = np.random.default_rng(5)
    speed, alpha, beta = rng.uniform(10.0, 90.0, 40), rng.uniform(-3.0, 3.0, 40), rng.uniform(-1.5, 1.5, 40)
    u = speed * np.cos(alpha) * np.cos(beta)
    v = speed * np.sin(beta)
    w = speed * np.sin(alpha) * np.cos(beta)
    np.testing.assert_allclose(air_angles(u, v, w), [speed, alpha, beta], rtol=1e-12)


def test_a_mapping_reads_a_quaternion():
    theta = 0.1 * np.sin(3.0 * T)
    psi = np.pi - 0.05 + 0.1 * T  # passes south
    q = Rotation.from_euler("ZYX", np.column_stack([psi, theta, 0.02 + 0.0 * T])).as_quat()
    columns = {f"q{i}": q[:, i] for i in range(4)} | {"de": T}
    attitude = {"quaternion": ["q0", "q1", "q2", "q3"], "order": "xyzw"}
    channels = made(columns, {"elevator_rad": column("de", "deg")}, attitude=attitude)
    np.testing.assert_allclose(channels["theta_rad"], theta, atol=1e-12)
    np.testing.assert_allclose(channels["phi_rad"], 0.02, atol=1e-12)
    np.testing.assert_allclose(channels["psi_rad"] - channels["psi_rad"][0], 0.1 * T, atol=1e-12)
    with pytest.raises(LogError, match=r"has a norm of 0.01 in row 1.*name its four columns"):
        made({**columns, "q3": 0.0, "q2": 0.0}, {}, attitude=attitude)


def test_a_mapping_reads_body_velocities():
    columns = {"u": 30.0, "v": 0.5 * np.sin(T), "w": 2.0 + T, "de": T}
    velocity = {"u": "u", "v": "v", "w": "w", "unit": "km/h"}
    channels = made(columns, {"elevator_rad": column("de", "deg")}, body_velocity=velocity)
    np.testing.assert_allclose(channels["alpha_rad"], np.arctan((2.0 + T) / 30.0), rtol=1e-12)
    expected = np.sqrt(900.0 + columns["v"] ** 2 + (2.0 + T) ** 2) / 3.6
    np.testing.assert_allclose(channels["airspeed_m_s"], expected, rtol=1e-12)
    np.testing.assert_allclose(np.sin(channels["beta_rad"]), columns["v"] / 3.6 / expected, rtol=1e-12)
    stated = {"airspeed_m_s": column("u", "m/s")}
    channels = made(columns, stated, body_velocity={**velocity, "v": None})
    assert channels["airspeed_m_s"][0] == 30.0
    assert "beta_rad" not in channels


def test_mirrored_elevons_give_elevator_and_aileron():
    elevator, aileron = 5.0 * np.sin(9.0 * T), 8.0 * np.cos(4.0 * T)
    pulse = np.array([1100.0, 1520.0, 1900.0])  # the centre is not in the middle
    angle = [-24.0, 0.0, 30.0]
    left = np.interp(elevator - aileron, angle, pulse)
    right = np.interp(-(elevator + aileron), angle, pulse)
    points = [list(pair) for pair in zip(pulse.tolist(), angle, strict=True)]
    both = {"columns": ["left", "right"], "calibration": points, "unit": "deg"}
    channels = made(
        {"left": left, "right": right},
        {
            "elevator_rad": {**both, "weights": [0.5, -0.5]},
            "aileron_rad": {**both, "weights": [-0.5, -0.5]},
        },
    )
    np.testing.assert_allclose(channels["elevator_rad"], elevator * DEG, atol=1e-12)
    np.testing.assert_allclose(channels["aileron_rad"], aileron * DEG, atol=1e-12)


def test_a_calibration_continues_beyond_its_ends_and_may_differ_by_column():
    points = ((1000.0, -20.0), (1500.0, 0.0), (2000.0, 40.0))
    raw = np.array([900.0, 1250.0, 2100.0, np.nan])
    np.testing.assert_allclose(calibrated(raw, points), [-24.0, -10.0, 48.0, np.nan], rtol=1e-14)
    channel = {
        "columns": ["a", "b"],
        "unit": "cdeg",
        "calibration": [[[0, 0], [1, 10]], [[1, 30], [0, 10]]],
        "scale": 2.0,
        "offset": 1.0,
        "sign": -1,
    }
    found = made({"a": T, "b": T}, {"elevator_rad": channel})["elevator_rad"]
    mean = 0.5 * (10.0 * T + 10.0 + 20.0 * T)
    np.testing.assert_allclose(found, -(2.0 * mean + 1.0) * 0.01 * DEG, rtol=1e-14)


def test_calibrated_airspeed_inverts_the_isentropic_flow():
    mach, altitude = np.array([0.05, 0.3, 0.8]), np.array([300.0, 5000.0, 11500.0])
    p, rho = pressure_pa(altitude), density_kg_m3(altitude)
    sound, sound0 = np.sqrt(1.4 * p / rho), np.sqrt(1.4 * P0_PA / RHO0_KG_M3)
    impact = p * ((1.0 + 0.2 * mach**2) ** 3.5 - 1.0)
    cas = sound0 * np.sqrt(5.0 * ((impact / P0_PA + 1.0) ** (2.0 / 7.0) - 1.0))
    np.testing.assert_allclose(true_airspeed_of_calibrated_m_s(cas, p, rho), mach * sound, rtol=1e-12)
    slow = true_airspeed_of_calibrated_m_s(1.0, p, rho)
    np.testing.assert_allclose(slow, np.sqrt(RHO0_KG_M3 / rho), rtol=1e-5)
    np.testing.assert_allclose(true_airspeed_of_calibrated_m_s(200.0, P0_PA, RHO0_KG_M3), 200.0, rtol=1e-14)


def test_calibrated_airspeed_agrees_with_jsbsim(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # the model writes an output file where it is loaded
    jsbsim = pytest.importorskip("jsbsim")
    fdm = jsbsim.FGFDMExec(None)
    fdm.set_debug_level(0)
    assert fdm.load_model("c172x")
    fdm["ic/h-sl-ft"], fdm["ic/vc-kts"] = 12000.0, 130.0
    fdm.run_ic()
    p, rho = fdm["atmosphere/P-psf"] * 47.88025898, fdm["atmosphere/rho-slugs_ft3"] * 515.3788184
    found = true_airspeed_of_calibrated_m_s(130.0 * 1852.0 / 3600.0, p, rho)
    np.testing.assert_allclose(found, fdm["velocities/vt-fps"] * 0.3048, rtol=1e-4)


def test_pressure_altitude_inverts_the_pressure():
    altitude = np.linspace(-4990.0, 19990.0, 41)
    np.testing.assert_allclose(altitude_of_pressure_m(pressure_pa(altitude)), altitude, atol=1e-8)
    assert np.isnan(altitude_of_pressure_m([-1.0, 1e6, np.nan])).all()


def test_a_mapping_states_air_data_instead_of_channels():
    altitude = 3000.0 + 10.0 * T
    p = pressure_pa(altitude)
    columns = {"p": p / 100.0, "oat": -10.0, "ias": 60.0 + T, "h": (altitude - 450.0) * 1000.0}
    air = {
        "static_pressure_pa": column("p", "mbar"),
        "air_temperature_k": column("oat", "degC"),
        "indicated_airspeed_m_s": column("ias", "m/s"),
    }
    channels = made(columns, air)
    rho = p / (GAS_CONSTANT_J_KG_K * 263.15)
    np.testing.assert_allclose(channels["altitude_m"], altitude, rtol=1e-12)
    np.testing.assert_allclose(channels["density_kg_m3"], rho, rtol=1e-12)
    speed = true_airspeed_of_calibrated_m_s(60.0 + T, p, rho)
    np.testing.assert_allclose(channels["airspeed_m_s"], speed, rtol=1e-12)
    assert list(channels) == ["airspeed_m_s", "altitude_m", "density_kg_m3"]
    channels = made(
        columns,
        {
            "height_m": column("h", "mm", reference_m=450.0),
            "equivalent_airspeed_m_s": column("ias", "m/s"),
            "air_temperature_k": {"value": 8.6, "unit": "degF"},
        },
    )
    np.testing.assert_allclose(channels["altitude_m"], geopotential_m(altitude), rtol=1e-12)
    rho = pressure_pa(channels["altitude_m"]) / (GAS_CONSTANT_J_KG_K * 260.15)  # 8.6 F are -13 C
    np.testing.assert_allclose(channels["density_kg_m3"], rho, rtol=1e-12)
    np.testing.assert_allclose(channels["airspeed_m_s"], (60.0 + T) * np.sqrt(RHO0_KG_M3 / rho), rtol=1e-12)
    standard = made(
        {"rho": density_kg_m3(altitude), "ias": 60.0},
        {"density_kg_m3": column("rho", "kg/m3"), "calibrated_airspeed_m_s": column("ias", "m/s")},
    )
    expected = true_airspeed_of_calibrated_m_s(60.0, p, density_kg_m3(altitude))
    np.testing.assert_allclose(standard["airspeed_m_s"], expected, rtol=1e-10)
    assert temperature_k(3000.0) == pytest.approx(268.65)


@pytest.mark.parametrize(
    ("channels", "words"),
    [
        ({"indicated_airspeed_m_s": column("x", "kt")}, "needs density_kg_m3 or altitude_m"),
        ({"air_temperature_k": column("x", "degC")}, "needs static_pressure_pa, altitude_m or height_m"),
        ({"static_pressure_pa": column("x", "psi")}, "static_pressure_pa is not between 55 and 1776 hPa"),
        ({"height_m": column("x", "km", reference_m=0.0)}, "height_m is not between -5 and 20 km"),
    ],
)
def test_air_data_that_lack_something_name_it(channels, words):
    with pytest.raises(LogError, match=words):
        made({"x": 40.0 + T}, channels)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ('[channels.height_m]\ncolumn = "h"\nunit = "m"', "state reference_m, the elevation"),
        ('[channels.altitude_m]\ncolumn = "h"\nunit = "m"\nreference_m = 2.0', "reference_m belongs to height_m"),
        ('[channels.elevator_rad]\ncolumns = ["a", "b"]\nweights = [1.0]\nunit = "deg"', "one weight for each"),
        ('[channels.elevator_rad]\ncolumns = ["a", "b"]\nweights = [0, 0]\nunit = "deg"', "no column is used"),
        (
            '[channels.elevator_rad]\ncolumn = "a"\ncalibration = [[1500, 0], [1500, 2]]\nunit = "deg"',
            "two or more points with different raw values",
        ),
        (
            '[channels.elevator_rad]\ncolumns = ["a", "b"]\ncalibration = [[[0, 0], [1, 2]]]\nunit = "deg"',
            "one list of points, or one for each column",
        ),
        (
            '[channels.theta_rad]\ncolumn = "a"\nunit = "deg"\n[attitude]\nquaternion = ["a", "b", "c", "d"]',
            "computed from \\[attitude\\]",
        ),
        ('[attitude]\nquaternion = ["a", "b", "c"]\n[channels]', "quaternion"),
        ('[body_velocity]\nu = "u"\nw = "w"\nunit = "deg"\n[channels]', "is a unit of angle, where speed is"),
        (
            '[body_velocity]\nu = "u"\nw = "w"\nunit = "m/s"\n[reconstruct]\nalpha = true\n[channels]',
            "both give alpha_rad",
        ),
        (
            '[channels.indicated_airspeed_m_s]\ncolumn = "a"\nunit = "kt"\n[channels.airspeed_m_s]\ncolumn = "b"\nunit = "kt"',
            "keep one of the two",
        ),
    ],
)  # fmt: skip
def test_a_mapping_that_contradicts_itself_is_refused(tmp_path, table, words):
    path = tmp_path / "map.toml"
    path.write_text(f"schema = 1\n{table}\n")
    with pytest.raises(ConfigurationError, match=words):
        read_mapping(path)


def test_columns_of_one_channel_share_their_times():
    arrays = {"a": T, "b": T}
    source = Source(Path("x.bin"), arrays, {"a": T, "b": T + 0.01}, ordered=False)
    mapping = MappingFile.model_validate(
        {"channels": {"elevator_rad": {"columns": ["a", "b"], "unit": "deg"}}}
    )
    with pytest.raises(LogError, match="are recorded at other times; combine columns of one message"):
        convert(source, mapping)
