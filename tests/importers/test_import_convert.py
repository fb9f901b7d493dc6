"""What a mapping may ask for: slices, resampling, constants, labels, PX4 topics; and the guess."""

import struct
import tomllib

import numpy as np
import pandas as pd
import pytest
import scipy.io
from import_flight import flown, foreign, write_csv

from airtruth.errors import ConfigurationError, LogError
from airtruth.importers import (
    MappingFile,
    Source,
    convert,
    guess_mapping,
    import_log,
    open_source,
    record_constants,
)
from airtruth.units import DEG, FT, SLUG


def source(tmp_path, **arrays):
    return Source(tmp_path / "x.mat", {n: np.asarray(a) for n, a in arrays.items()}, ordered=False)


def mapped(**sections):
    return MappingFile.model_validate({"channels": {"alpha_rad": {"column": "a", "unit": "rad"}}, **sections})


def test_manoeuvres_are_cut_on_the_files_own_clock_and_start_at_zero(tmp_path):
    t = 53550.06 + np.arange(1000) * 0.02
    made = convert(
        source(tmp_path, t=t, a=np.arange(1000.0), m=np.repeat([1.0, 3.0], 500)),
        mapped(
            time={"column": "t"},
            manoeuvre=[
                {"run_id": "one", "start_s": 53550.06, "end_s": 53552.06},
                {"run_id": "two", "start_s": 53562.0601, "end_s": 53563.0},
            ],
            constants={"mass_kg": {"column": "m", "unit": "slug"}, "chord_m": {"value": 2.0, "unit": "ft"}},
        ),
    )
    assert made.run_ids == ("one", "two")
    np.testing.assert_array_equal(made.offsets, [0, 101, 101 + 47])
    first, second = made.rows(0), made.rows(1)
    np.testing.assert_array_equal(made.channels["alpha_rad"][first], np.arange(101.0))
    assert made.channels["alpha_rad"][second][0] == 601.0
    assert made.t_s[second][0] == 0.0
    np.testing.assert_allclose(np.diff(made.t_s[first]), 0.02, rtol=1e-9)
    # a slug is 32.17405 lb, exactly lbf s2/ft
    assert record_constants(made, "one") == pytest.approx({"mass_kg": SLUG, "chord_m": 2.0 * FT})
    assert record_constants(made, "two")["mass_kg"] == pytest.approx(3.0 * SLUG)
    assert record_constants(made, "three") == {}


def test_sign_scale_and_offset_act_in_the_stated_order(tmp_path):
    channel = {"column": "a", "unit": "deg", "sign": -1, "scale": 2.0, "offset": 3.0}
    made = convert(
        source(tmp_path, a=[1.0, 2.0, 5.0]), mapped(time={"rate_hz": 10}, channels={"alpha_rad": channel})
    )
    np.testing.assert_allclose(made.channels["alpha_rad"], -DEG * (2.0 * np.array([1.0, 2.0, 5.0]) + 3.0))
    np.testing.assert_allclose(made.t_s, [0.0, 0.1, 0.2])
    assert made.metadata["sample_rate_hz"] == 10.0


@pytest.mark.parametrize(("method", "tolerance"), [("linear", 2e-4), ("cubic", 1e-5), ("previous", 3e-2)])
def test_mixed_rates_come_to_one_clock_by_the_stated_method(method, tolerance, tmp_path):
    fast, slow = np.arange(0.0, 4.0, 0.01), np.arange(0.013, 3.9, 0.04)
    made = convert(
        source(tmp_path, tf=fast, ts=slow * 1000.0, a=np.sin(fast), q=np.cos(slow)),
        mapped(
            time={"column": "tf"},
            resample={"rate_hz": 50, "method": method},
            channels={
                "alpha_rad": {"column": "a", "unit": "rad"},
                "q_rad_s": {"column": "q", "unit": "rad_s", "clock": {"column": "ts", "unit": "ms"}},
                "density_kg_m3": {"value": 1.1, "unit": "kg_m3"},
            },
        ),
    )
    t = 0.013 + made.t_s  # the clock starts where all channels have begun, and ends where one ends
    assert t[-1] <= slow[-1] < t[-1] + 0.02 + 1e-9
    np.testing.assert_allclose(made.channels["alpha_rad"], np.sin(t), atol=tolerance)
    np.testing.assert_allclose(made.channels["q_rad_s"], np.cos(t), atol=1.5 * tolerance)
    np.testing.assert_array_equal(made.channels["density_kg_m3"], 1.1)
    assert made.metadata["resampled"] == {"rate_hz": 50.0, "method": method, "from_hz": {"q_rad_s": 25.0}}


def test_empty_cells_of_a_slow_channel_are_interpolated_when_asked(tmp_path):
    t = np.arange(200) * 0.02
    slow = np.where(np.arange(200) % 4 == 0, np.sin(t), np.nan)
    made = convert(
        source(tmp_path, t=t, a=np.sin(t), b=slow),
        mapped(
            time={"column": "t"},
            resample={"rate_hz": 50, "method": "cubic"},
            channels={
                "alpha_rad": {"column": "a", "unit": "rad"},
                "theta_rad": {"column": "b", "unit": "rad"},
            },
        ),
    )
    np.testing.assert_allclose(made.channels["theta_rad"], made.channels["alpha_rad"], atol=2e-5)


def test_rounded_time_stamps_become_uniform_and_larger_jitter_does_not(tmp_path):
    t = np.round(np.arange(100) / 30.0, 4)
    even = convert(source(tmp_path, t=t, a=np.zeros(100)), mapped(time={"column": "t"})).t_s
    assert np.ptp(np.diff(even)) < 1e-12
    rough = convert(source(tmp_path, t=np.round(t, 2), a=np.zeros(100)), mapped(time={"column": "t"})).t_s
    np.testing.assert_allclose(rough, np.round(t, 2))


def test_labels_of_a_matrix_are_its_column_names(tmp_path):
    labels = np.array(["* time (sec)", "* alpha (deg)", "* q (deg/sec)"], dtype=object)
    scipy.io.savemat(tmp_path / "f.mat", {"fdata": np.arange(30.0).reshape(10, 3), "varlab": labels})
    opened = open_source(tmp_path / "f.mat")
    assert opened.labels["fdata"] == tuple(labels)
    made = convert(
        opened,
        mapped(
            time={"column": 1, "variable": "fdata"},
            channels={"alpha_rad": {"column": "* alpha (deg)", "variable": "fdata", "unit": "deg"}},
        ),
    )
    np.testing.assert_allclose(made.channels["alpha_rad"], (1.0 + 3.0 * np.arange(10)) * DEG)


def test_a_constant_that_makes_no_sense(tmp_path):
    with pytest.raises(LogError, match="mass_kg is 0, which has to be above 0"):
        convert(
            source(tmp_path, a=np.ones(50), m=np.zeros(50)),
            mapped(time={"rate_hz": 50}, constants={"mass_kg": {"column": "m", "unit": "kg"}}),
        )


def ulog(path, topics):
    """The smallest PX4 log: header, formats, subscriptions, data (ULog file format, version 1)."""

    def message(kind: bytes, body: bytes) -> bytes:
        return struct.pack("<HB", len(body), ord(kind)) + body

    data = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0) + message(b"B", bytes(40))
    for name, (fields, _) in topics.items():
        data += message(b"F", f"{name}:uint64_t timestamp;{''.join(f'float {f};' for f in fields)}".encode())
    for number, name in enumerate(topics):
        data += message(b"A", struct.pack("<BH", 0, number) + name.encode())
    for number, (_, rows) in enumerate(topics.values()):
        for stamp, *values in rows:
            data += message(b"D", struct.pack(f"<HQ{len(values)}f", number, stamp, *values))
    path.write_bytes(data)


def test_px4_topics_with_clocks_of_their_own(tmp_path):
    pytest.importorskip("pyulog")
    rates = [(1_000_000 + 4000 * i, 0.1 * np.sin(0.004 * i)) for i in range(1000)]
    speeds = [(1_000_000 + 50_000 * i, 20.0 + i / 80.0) for i in range(80)]
    ulog(
        tmp_path / "f.ulg",
        {
            "vehicle_angular_velocity": (["xyz_y"], rates),
            "airspeed": (["true_airspeed_m_s"], speeds),
        },
    )
    opened = open_source(tmp_path / "f.ulg")
    assert "airspeed.true_airspeed_m_s" in opened.arrays
    made = convert(
        opened,
        mapped(
            resample={"rate_hz": 100, "method": "linear"},
            channels={
                "q_rad_s": {"column": "vehicle_angular_velocity.xyz_y", "unit": "rad/s"},
                "airspeed_m_s": {"column": "airspeed.true_airspeed_m_s", "unit": "m/s"},
            },
        ),
    )
    np.testing.assert_allclose(made.channels["q_rad_s"], 0.1 * np.sin(made.t_s), atol=1e-6)
    np.testing.assert_allclose(made.channels["airspeed_m_s"], 20.0 + made.t_s / 4.0, rtol=1e-6)


@pytest.mark.slow
def test_a_guess_from_names_with_units_imports_as_it_stands(tmp_path):
    log = flown(tmp_path, runs=1)
    columns = foreign(log)
    names = {
        "Clock [ms]": "time (ms)",
        "KTAS": "true_airspeed [kt]",
        "AOA_nose": "alpha_deg",
        "PitchAtt": "theta (deg)",
        "PitchRate": "pitch rate [deg/s]",
        "Ax": "ax [ft/s^2]",
        "Nz": "az (g)",
        "ELEV_L": "elevator_deg",
        "Hp": "alt_ft",
        "rho": "rho [slug/ft3]",
    }
    write_csv(tmp_path / "f.csv", {names[n]: columns[n] for n in names})
    text = guess_mapping(tmp_path / "f.csv")
    mapping = MappingFile.model_validate(tomllib.loads(text))
    units = {name: channel.unit for name, channel in mapping.channels.items()}
    assert units == {
        "airspeed_m_s": "kt",
        "alpha_rad": "deg",
        "theta_rad": "deg",
        "q_rad_s": "deg_s",
        "ax_m_s2": "ft_s2",
        "az_m_s2": "g",
        "elevator_rad": "deg",
        "altitude_m": "ft",
        "density_kg_m3": "slug_ft3",
    }
    assert mapping.channels["az_m_s2"].sign == -1
    assert mapping.channels["elevator_rad"].sign == -1  # trailing edge up positive in this file
    assert "the elevator changes q' by" in text
    (tmp_path / "m.toml").write_text(text)
    assert import_log(tmp_path / "f.csv", tmp_path / "m.toml").faults == ()


@pytest.mark.slow
def test_a_guess_says_what_it_did_not_find(tmp_path):
    columns = foreign(flown(tmp_path, runs=1))
    write_csv(tmp_path / "f.csv", {n: v for n, v in columns.items() if not n.startswith("ELEV")})
    text = guess_mapping(tmp_path / "f.csv")
    assert "# Not mapped: elevator_rad was not found" in text
    assert "# [channels.airspeed_m_s] # needed, not found" not in text  # KTAS
    assert "# [channels.q_rad_s] # needed, not found" not in text  # PitchRate
    assert "# [channels.elevator_rad] # needed, not found" in text  # ELEV_L
    tomllib.loads(text)


@pytest.mark.slow
def test_units_are_guessed_by_size_where_names_say_nothing(tmp_path):
    log = flown(tmp_path, runs=1)
    c = log.channels
    columns = {
        "t": log.t_s,
        "V": c["airspeed_m_s"],
        "alpha": c["alpha_rad"] / DEG,
        "q": c["q_rad_s"] / DEG,
        "az": c["az_m_s2"] / 9.80665,
        "de": c["elevator_rad"],
        "rho": c["density_kg_m3"],
    }
    write_csv(tmp_path / "f.csv", columns)
    text = guess_mapping(tmp_path / "f.csv")
    mapping = MappingFile.model_validate(tomllib.loads(text))
    assert {n: x.unit for n, x in mapping.channels.items()} == {
        "airspeed_m_s": "m_s",
        "alpha_rad": "deg",
        "q_rad_s": "deg_s",
        "az_m_s2": "g",
        "elevator_rad": "rad",
        "density_kg_m3": "kg_m3",
    }
    assert "do not contradict" in text


@pytest.mark.parametrize("zone", [None, "UTC", "Europe/Berlin"])
@pytest.mark.parametrize("unit", ["ns", "us", "ms"])
def test_dates_and_durations_of_a_parquet_file_are_seconds(tmp_path, zone, unit):
    """2024-05-01 00:00 UTC is 1,714,521,600 s after 1970; a float64 resolves 0.24 us there. The index holds the dates."""
    steps = pd.to_timedelta(10 * np.arange(300), unit="ms")
    dates = (pd.Timestamp("2024-05-01") + steps).as_unit(unit)
    if zone:
        dates = dates.tz_localize("UTC").tz_convert(zone)
    table = pd.DataFrame(
        {"a": np.arange(300.0), "after": steps.as_unit(unit)}, index=pd.Index(dates, name="date")
    )
    table.to_parquet(tmp_path / "f.parquet")
    read = open_source(tmp_path / "f.parquet")
    expected = 1714521600.0 + 0.01 * np.arange(300)
    np.testing.assert_allclose(read.arrays["date"], expected, rtol=0.0, atol=3e-7)
    np.testing.assert_allclose(read.arrays["after"], 0.01 * np.arange(300), rtol=1e-14, atol=1e-15)
    for column in ("date", "after"):
        made = convert(read, mapped(time={"column": column}))
        np.testing.assert_allclose(made.t_s, 0.01 * np.arange(300), rtol=0.0, atol=3e-7)


def test_a_unit_of_dates_is_refused(tmp_path):
    """They are seconds already; milliseconds would make 100 Hz of 0.1 Hz."""
    dates = pd.Timestamp("2024-05-01") + pd.to_timedelta(10 * np.arange(5), unit="ms")
    pd.DataFrame({"a": np.arange(5.0), "date": dates}).to_parquet(tmp_path / "f.parquet")
    with pytest.raises(ConfigurationError, match=r"'date' holds dates or durations, .*; state unit = .s."):
        convert(open_source(tmp_path / "f.parquet"), mapped(time={"column": "date", "unit": "ms"}))


def test_a_manoeuvre_that_the_file_does_not_hold_in_full_is_stated(tmp_path):
    made = convert(
        source(tmp_path, t=2.0 + np.arange(100) * 0.02, a=np.arange(100.0)),
        mapped(time={"column": "t"}, manoeuvre=[{"run_id": "one", "start_s": 1.0, "end_s": 30.0}]),
    )
    assert made.metadata["shortened"] == [
        "run 'one': [[manoeuvre]] start_s is 1, but the first sample is at 2 s",
        "run 'one': [[manoeuvre]] end_s is 30, but the last sample is at 3.98 s",
    ]


def test_a_missing_date_is_no_time(tmp_path):
    dates = pd.Series(pd.to_datetime(["2024-05-01", None, "2024-05-02"]))
    pd.DataFrame({"a": np.arange(3.0), "date": dates}).to_parquet(tmp_path / "f.parquet")
    with pytest.raises(LogError, match="the time of alpha_rad in row 2 is empty or NaN; delete the row"):
        convert(open_source(tmp_path / "f.parquet"), mapped(time={"column": "date"}))


@pytest.mark.parametrize("delimiter", [";", "blanks"])
def test_the_cell_that_is_no_number_is_named_among_decimal_commas(tmp_path, delimiter):
    """Line 4, and not line 2, whose 1,5 is a number in a file with decimal commas."""
    lines = ["t;a", "0,0;1,5", "0,1;1,6", "0,2;bad", "0,3;1,8"]
    text = "\n".join(lines)
    layout = {"decimal": ",", "delimiter": ";"}
    if delimiter == "blanks":
        text, layout = text.replace(";", "  "), {"decimal": ",", "format": "table"}
    (tmp_path / "f.csv").write_text(text)
    mapping = mapped(time={"column": "t"}, source=layout)
    read = open_source(tmp_path / "f.csv", mapping.source)
    with pytest.raises(LogError, match=r"column 'a', line 4: 'bad' is not a number"):
        convert(read, mapping)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("t,a\n0,1\n# pause\n0.1,2\n\n0.2,bad\n", 6),
        ("# made\n\nt,a\n% units\n# signs\n0,bad\n", 6),
        ("0,1\n# pause\n# pause\n0.1,bad\n", 4),
        ("t,a\n0,1\n0.1,bad\n", 3),
    ],
)
def test_the_line_of_a_cell_counts_the_comments_before_it(tmp_path, text, line):
    """As an editor counts, from 1."""
    assert text.splitlines()[line - 1].endswith("bad")
    (tmp_path / "f.csv").write_text(text)
    layout = {"header": False} if text.startswith("0") else {}
    mapping = MappingFile.model_validate(
        {"channels": {"alpha_rad": {"column": 2, "unit": "rad"}}, "time": {"column": 1}, "source": layout}
    )
    with pytest.raises(LogError, match=f"line {line}: 'bad'"):
        convert(open_source(tmp_path / "f.csv", mapping.source), mapping)
