"""Logs as recorders write them: DataFlash, MDF4 and HDF5 come back as they were flown."""

import sys

import numpy as np
import pytest
from import_flight import DEG, flown

from airtruth.errors import ConfigurationError, StoreError
from airtruth.foreign import dataflash, hdf5, mdf
from airtruth.importers import import_log, open_source
from validation import recorders
from validation.recorders import Topic

G = 9.80665


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return flown(tmp_path_factory.mktemp("flown"), runs=1, duration_s=6.0)


def topics(log, dataflash_names=True):
    """Attitude and inertial channels at the log's rate, air data at half of it, 4 ms later."""
    c, t = log.channels, log.t_s + 36.0
    half = slice(0, None, 2)
    units = {"Pitch": "deg", "GyrY": "deg/s", "AccX": "m/s/s", "AccZ": "m/s/s", "AOA": "deg", "Elev": "deg"}
    fast = {
        "Pitch": c["theta_rad"] / DEG,
        "GyrY": c["q_rad_s"] / DEG,
        "AccX": c["ax_m_s2"],
        "AccZ": c["az_m_s2"],
        "AOA": c["alpha_rad"] / DEG,
        "Elev": c["elevator_rad"] / DEG,
    }
    slow = {"TAS": c["airspeed_m_s"][half], "Alt": c["altitude_m"][half]}
    return [
        Topic("NAVX", t, fast, units, "d" * 6),
        Topic("AIR", t[half], slow, {"TAS": "m/s", "Alt": "m"}, "dd"),
    ]


MAPPING = """
run_id = "f"
[resample]
rate_hz = 50.0
method = "cubic"
[channels.airspeed_m_s]
column = "{air}TAS"
unit = "m/s"
{slow}
[channels.alpha_rad]
column = "{nav}AOA"
unit = "deg"
{fast}
[channels.theta_rad]
column = "{nav}Pitch"
unit = "deg"
{fast}
[channels.q_rad_s]
column = "{nav}GyrY"
unit = "deg/s"
{fast}
[channels.ax_m_s2]
column = "{nav}AccX"
unit = "m/s2"
{fast}
[channels.az_m_s2]
column = "{nav}AccZ"
unit = "m/s2"
{fast}
[channels.elevator_rad]
column = "{nav}Elev"
unit = "deg"
{fast}
[channels.altitude_m]
column = "{air}Alt"
unit = "m"
{slow}
"""


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["dataflash", "mdf", "hdf5"])
def test_a_recorder_gives_the_log_that_was_flown(kind, log, tmp_path):
    nav, air, fast, slow = "NAVX.", "AIR.", "", ""
    if kind == "dataflash":
        path = tmp_path / "f.bin"
        path.write_bytes(recorders.dataflash(topics(log)))
    elif kind == "mdf":
        path, nav, air = tmp_path / "f.mf4", "", ""
        recorders.mdf4(path, topics(log))
    else:
        path = tmp_path / "f.h5"
        recorders.hdf5(path, topics(log))
        fast, slow = (f'clock = {{ column = "{name}.time" }}' for name in ("NAVX", "AIR"))
    (tmp_path / "m.toml").write_text(MAPPING.format(nav=nav, air=air, fast=fast, slow=slow))
    back = import_log(path, tmp_path / "m.toml").log
    assert back.metadata["sample_rate_hz"] == 50.0
    assert len(back.t_s) in (len(log.t_s), len(log.t_s) - 1)
    inner = slice(2, len(back.t_s) - 2)
    for name in ("alpha_rad", "q_rad_s", "az_m_s2", "theta_rad", "elevator_rad"):
        np.testing.assert_allclose(
            back.channels[name][inner],
            log.channels[name][: len(back.t_s)][inner],
            atol=1e-6 * np.ptp(log.channels[name]),
        )
    deviation = back.channels["airspeed_m_s"] - log.channels["airspeed_m_s"][: len(back.t_s)]
    assert np.abs(deviation).max() < 0.6 * np.ptp(log.channels["airspeed_m_s"])  # half of the noisy samples


def test_units_instances_and_integer_formats_of_dataflash(tmp_path):
    t = np.arange(50) / 10.0
    both = [
        Topic("IMU", t + 0.001 * i, {"GyrY": np.sin(t) + i, "T": 20.0 + t}, {"GyrY": "rad/s"}, "fc", i)
        for i in (0, 1)
    ]
    (tmp_path / "f.bin").write_bytes(
        recorders.dataflash([*both, Topic("GPS", t, {"Lat": 48.1234567 + t}, {"Lat": "deglatitude"}, "L")])
    )
    source = open_source(tmp_path / "f.bin")
    assert source.units["IMU.GyrY"] == "rad/s"
    np.testing.assert_allclose(source.arrays["IMU#1.GyrY"], np.sin(t) + 1.0, rtol=1e-6)
    np.testing.assert_allclose(source.arrays["IMU.T"], 20.0 + t, atol=1e-9)
    np.testing.assert_allclose(source.arrays["GPS.Lat"], 48.1234567 + t, atol=6e-8)
    np.testing.assert_allclose(source.clocks["IMU#1.GyrY"], t + 0.001, atol=1e-6)


def test_names_that_two_groups_of_mdf_share(tmp_path):
    t = np.arange(40) / 20.0
    recorders.mdf4(
        tmp_path / "f.mf4",
        [Topic("left", t, {"x": t}, {"x": "deg"}), Topic("right", t[::2], {"x": -t[::2], "y": t[::2]}, {})],
    )
    source = open_source(tmp_path / "f.mf4")
    assert set(source.arrays) == {"left.x", "right.x", "y"}
    assert source.units == {"left.x": "deg"}
    np.testing.assert_allclose(source.arrays["right.x"], -t[::2])
    np.testing.assert_allclose(source.clocks["y"], t[::2])


def test_hdf5_matrix_labels_and_no_link_leaves_the_file(tmp_path):
    import h5py

    t = np.arange(40) / 20.0
    recorders.hdf5(tmp_path / "other.h5", [Topic("secret", t, {"x": t}, {})])
    recorders.hdf5(tmp_path / "f.h5", [Topic("data", t, {"q": np.sin(t)}, {})], matrix=True)
    with h5py.File(tmp_path / "f.h5", "a") as file:
        file["link"] = h5py.ExternalLink("other.h5", "/secret/x")
    source = open_source(tmp_path / "f.h5")
    assert set(source.arrays) == {"data"}
    assert source.labels["data"] == ("time", "q")


@pytest.mark.parametrize(
    ("module", "reader", "command"),
    [
        ("pymavlink.DFReader", dataflash.read_dataflash, "pip install airtruth[ardupilot]"),
        ("asammdf", mdf.read_mdf, "pip install airtruth[mdf]"),
        ("h5py", hdf5.read_hdf5, "pip install airtruth[measured]"),
    ],
)
def test_a_missing_package_is_one_sentence_with_the_command(module, reader, command, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(ConfigurationError) as caught:
        reader(tmp_path / "f")
    assert command in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["f.bin", "f.mf4", "f.h5"])
def test_a_file_of_another_kind_is_refused(name, tmp_path):
    (tmp_path / name).write_bytes(b"something else entirely, and rather long" * 40)
    with pytest.raises(StoreError, match=rf"{name}.*(is not|died)"):
        open_source(tmp_path / name)


def test_a_cut_off_dataflash_log_keeps_its_whole_messages(tmp_path):
    t = np.arange(50) / 10.0
    content = recorders.dataflash([Topic("IMU", t, {"GyrY": t}, {}, "f")])
    (tmp_path / "f.bin").write_bytes(content[:-5])
    assert len(open_source(tmp_path / "f.bin").arrays["IMU.GyrY"]) == 49
