"""Several files with clocks and rates of their own become one log, without aliasing and with the error of the offset."""

from dataclasses import replace

import numpy as np
import pytest
from import_flight import DEG, flown, write_csv

from airtruth.errors import ConfigurationError, LogError
from airtruth.importers import import_log
from airtruth.importers.align import aligned, offset_between
from airtruth.importers.mapping import Resample
from airtruth.importers.series import Series
from airtruth.importers.uniform import even_times, low_passed, resampled


def motion(t, rng):
    """A smooth random signal with the band of a short period, about 1 Hz, as a function of time."""
    frequencies = rng.uniform(0.15, 1.5, 30)
    phases, sizes = rng.uniform(0, 2 * np.pi, 30), rng.normal(size=30)
    return lambda t: sum(
        a * np.sin(2 * np.pi * f * t + p) for a, f, p in zip(sizes, frequencies, phases, strict=True)
    )


def test_what_a_lower_rate_would_alias_is_removed_and_the_rest_is_untouched():
    t = np.arange(0, 20, 0.01)
    slow, fast = (
        np.sin(2 * np.pi * 7.0 * t),
        np.sin(2 * np.pi * 21.0 * t),
    )  # 21 Hz at 25 Hz would show as 4 Hz
    inner = slice(200, -200)
    np.testing.assert_allclose(low_passed(slow + fast, 100.0, 25.0)[inner], slow[inner], atol=3e-4)
    new = np.arange(1.0, 19.0, 0.04)
    made = resampled(Series(t, slow + fast), new, Resample(rate_hz=25.0, method="cubic"))
    np.testing.assert_allclose(made[25:-25], np.sin(2 * np.pi * 7.0 * new)[25:-25], atol=1e-3)


def test_the_low_pass_has_no_lag_and_continues_a_ramp():
    t = np.arange(0, 10, 0.01)
    np.testing.assert_allclose(low_passed(3.0 + 2.0 * t, 100.0, 20.0), 3.0 + 2.0 * t, atol=1e-9)


def test_offset_and_its_standard_deviation():
    """Shifts of 40 pairs of noisy records: within their standard deviations, which are neither small nor large."""
    z, stds = [], []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        signal = motion(None, rng)
        shift = rng.uniform(-3.0, 3.0)
        t_a, t_b = np.arange(0, 25, 0.01), np.arange(0, 25, 0.04) + 0.003
        a = signal(t_a) + 0.05 * rng.normal(size=len(t_a))
        b = signal(t_b + 1000.0 * 0 + shift) * 1.1 + 0.3 + 0.3 * rng.normal(size=len(t_b))
        found = offset_between("b.csv", Series(t_a, a), Series(t_b + 5000.0, b), "q_rad_s")
        z.append((found.offset_s - (shift - 5000.0)) / found.std_s)
        stds.append(found.std_s)
    assert (
        0.7 < np.std(z) < 1.4
    )  # 0.78 to 1.22 in 95 % of samples of 40, and colour makes the statistic rougher
    assert np.abs(np.mean(z)) < 0.5
    assert 1e-4 < np.median(stds) < 2e-2


def test_a_drifting_clock_is_followed_over_ten_minutes():
    rng = np.random.default_rng(5)
    signal = motion(None, rng)
    t_a, true = np.arange(0, 600, 0.02), np.arange(20, 560, 0.05)
    a = signal(t_a) + 0.05 * rng.normal(size=len(t_a))
    b = signal(true) + 0.1 * rng.normal(size=len(true))
    t_b = (true - 123.4) * (1.0 - 80e-6)
    found = offset_between("b.csv", Series(t_a, a), Series(t_b, b), "q_rad_s")
    assert abs(found.drift - 80e-6) < 3.0 * found.drift_std
    assert found.drift_std < 10e-6
    np.testing.assert_allclose(found.applied(t_b), true, atol=0.006)
    assert "ppm, applied" in found.sentence("b.csv")


def test_a_periodic_signal_and_another_signal_are_refused():
    t = np.arange(0, 30, 0.02)
    with pytest.raises(LogError, match=r"two offsets almost as well.*\[align\] offset_s"):
        offset_between("b", Series(t, np.sin(3.0 * t)), Series(t, np.sin(3.0 * t + 1.0)), "q_rad_s")
    rng = np.random.default_rng(1)
    with pytest.raises(LogError, match="not the same"):
        offset_between("b", Series(t, rng.normal(size=len(t))), Series(t, rng.normal(size=len(t))), "q_rad_s")
    with pytest.raises(LogError, match="shares no channel"):
        aligned("b", {"q_rad_s": Series(t, t)}, {"az_m_s2": Series(t, t)})


AIR = """
[time]
column = "t"
{align}
[channels.airspeed_m_s]
column = "V"
unit = "m/s"
[channels.alpha_rad]
column = "aoa"
unit = "deg"
[channels.altitude_m]
column = "h"
unit = "m"
[channels.q_rad_s]
column = "rate"
unit = "deg/s"
"""
INERTIAL = """
[time]
column = "t"
[channels.q_rad_s]
column = "q"
unit = "rad/s"
[channels.az_m_s2]
column = "az"
unit = "m/s2"
[channels.theta_rad]
column = "theta"
unit = "rad"
[channels.elevator_rad]
column = "de"
unit = "rad"
[constants.mass_kg]
value = 25.0
unit = "kg"
"""


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return flown(tmp_path_factory.mktemp("flown"), runs=1, duration_s=12.0)


def two_files(log, folder, lag=17.31):
    """An inertial recorder, and one of air data at half of its rate whose clock reads less."""
    c = log.channels
    write_csv(
        folder / "imu.csv",
        {
            "t": log.t_s,
            "q": c["q_rad_s"],
            "az": c["az_m_s2"],
            "theta": c["theta_rad"],
            "de": c["elevator_rad"],
        },
    )
    half = slice(1, None, 2)
    write_csv(
        folder / "air.csv",
        {
            "t": log.t_s[half] - lag,
            "V": c["airspeed_m_s"][half],
            "aoa": c["alpha_rad"][half] / DEG,
            "h": c["altitude_m"][half],
            "rate": c["q_rad_s"][half] / DEG,
        },
    )
    (folder / "imu.toml").write_text(INERTIAL)
    return [folder / "imu.csv", folder / "air.csv"]


@pytest.mark.slow
def test_two_files_become_the_log_that_was_flown(log, tmp_path):
    files = two_files(log, tmp_path)
    (tmp_path / "air.toml").write_text(AIR.format(align=""))
    made = import_log(files, [tmp_path / "imu.toml", tmp_path / "air.toml"])
    (moved,) = made.log.metadata["alignment"]
    assert moved["channel"] == "q_rad_s"
    assert abs(moved["offset_s"] - 17.31) < 0.003
    assert moved["std_s"] < 0.003
    assert "from q_rad_s" in made.notes[0]
    assert made.log.metadata["sample_rate_hz"] == 50.0
    assert made.log.metadata["record_constants"] == {"imu": {"mass_kg": 25.0}}
    start = int(
        np.ceil(50.0 * (log.t_s[1] + moved["offset_s"] - 17.31) - 1e-6)
    )  # no channel of imu.csv is interpolated
    count = len(made.log.t_s)
    for name, share in (("q_rad_s", 1e-3), ("alpha_rad", 0.06), ("theta_rad", 1e-3)):
        flownvalues = log.channels[name][start : start + count]
        error = np.abs(made.log.channels[name] - flownvalues)[5:-5]
        assert error.max() < share * np.ptp(flownvalues) + 1e-12, name


@pytest.mark.slow
def test_a_declared_offset(log, tmp_path):
    files = two_files(log, tmp_path)
    (tmp_path / "air.toml").write_text(AIR.format(align="[align]\noffset_s = 17.31\nstd_s = 0.002"))
    made = import_log(files, [tmp_path / "imu.toml", tmp_path / "air.toml"])
    assert made.log.metadata["alignment"][0]["std_s"] == 0.002
    assert "(declared)" in made.notes[0]


@pytest.mark.slow
def test_one_mapping_for_several_files_makes_a_run_of_each(log, tmp_path):
    c = log.channels
    columns = {name: values for name, values in c.items() if name != "elevator_command_rad"}
    for name in ("one", "two"):
        write_csv(tmp_path / f"{name}.csv", {"t": log.t_s, **columns})
    units = {"rad": "rad", "rad_s": "rad_s", "m_s2": "m_s2", "kg_m3": "kg_m3"}
    text = '[time]\ncolumn = "t"\n'
    for name in columns:
        unit = next((u for u in ("kg_m3", "rad_s", "m_s2", "m_s", "rad", "m") if name.endswith("_" + u)), "")
        text += f'[channels.{name}]\ncolumn = "{name}"\nunit = "{units.get(unit, unit)}"\n'
    (tmp_path / "m.toml").write_text(text)
    made = import_log([tmp_path / "one.csv", tmp_path / "two.csv"], tmp_path / "m.toml").log
    assert made.run_ids == ("one", "two")
    with pytest.raises(ConfigurationError, match="1 files and 2 mappings"):
        import_log([tmp_path / "one.csv"], [tmp_path / "m.toml"] * 2)


def test_single_precision_times_become_even_where_they_still_count_samples():
    even = 8000.0 + np.arange(400) * 0.01
    rounded = even.astype(np.float32).astype(np.float64)
    assert np.ptp(np.diff(rounded)) > 4e-4
    np.testing.assert_allclose(even_times(rounded, 2.0**-11), even, atol=4e-4)
    assert np.ptp(np.diff(even_times(rounded, 2.0**-11))) < 1e-9
    lost = np.delete(rounded, 200)
    np.testing.assert_array_equal(even_times(lost, 2.0**-11), lost)


@pytest.mark.slow
def test_single_precision_times_in_a_file(log, tmp_path):
    files = two_files(replace(log, t_s=log.t_s), tmp_path, lag=0.0)
    columns = {"t": (log.t_s + 9000.0).astype(np.float32).astype(np.float64)}
    c = log.channels
    names = {"V": "airspeed_m_s", "h": "altitude_m", "q": "q_rad_s", "az": "az_m_s2", "theta": "theta_rad"}
    columns |= {short: c[name] for short, name in names.items()}
    columns |= {"aoa": c["alpha_rad"] / DEG, "de": c["elevator_rad"]}
    write_csv(files[0], columns)
    both = INERTIAL + AIR.format(align="").split("[channels.q_rad_s]")[0].replace(
        '[time]\ncolumn = "t"\n', ""
    )
    (tmp_path / "m.toml").write_text(both)
    made = import_log(files[0], tmp_path / "m.toml").log
    np.testing.assert_allclose(made.t_s, log.t_s, atol=5e-4)
    columns["t"] = (log.t_s + 400000.0).astype(np.float32).astype(np.float64)
    columns["t"] = np.maximum.accumulate(columns["t"]) + 1e-9 * 0
    write_csv(files[0], columns)
    with pytest.raises(LogError, match=r"single precision|does not increase"):
        import_log(files[0], tmp_path / "m.toml")


def test_a_topic_of_another_clock_is_the_same_file_with_a_second_mapping(log, tmp_path):
    """Both tables in one file: the air data were stamped 80 ms late, as their mapping declares."""
    c = log.channels
    columns = {
        "t": log.t_s,
        "q": c["q_rad_s"],
        "az": c["az_m_s2"],
        "theta": c["theta_rad"],
        "de": c["elevator_rad"],
    }
    columns |= {
        "ta": log.t_s + 0.08,
        "V": c["airspeed_m_s"],
        "aoa": c["alpha_rad"] / DEG,
        "h": c["altitude_m"],
    }
    columns["rate"] = c["q_rad_s"] / DEG
    write_csv(tmp_path / "f.csv", columns)
    (tmp_path / "imu.toml").write_text(INERTIAL)
    text = AIR.replace('column = "t"', 'column = "ta"')
    files, mappings = [tmp_path / "f.csv"] * 2, [tmp_path / "imu.toml", tmp_path / "air.toml"]
    for align, offset in (("[align]\noffset_s = -0.08", -0.08), ('[align]\nchannel = "q_rad_s"', -0.08)):
        (tmp_path / "air.toml").write_text(text.format(align=align))
        made = import_log(files, mappings).log
        assert made.metadata["alignment"][0]["offset_s"] == pytest.approx(offset, abs=1e-4)
        count = len(made.t_s)
        start = round(50.0 * (log.t_s[-1] - log.t_s[0])) + 1 - count
        expected = c["alpha_rad"]
        error = min(
            np.abs(made.channels["alpha_rad"] - expected[s : s + count]).max() for s in range(start + 1)
        )
        assert error < 1e-3 * np.ptp(expected)
