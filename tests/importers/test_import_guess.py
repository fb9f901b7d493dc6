"""Headers of other people's files: what the guess maps, with which unit and sign, and what it leaves alone."""

import tomllib

import numpy as np
import pytest
import scipy.io
from import_flight import DEG, FOOT, flown, write_csv

from airtruth.errors import ConfigurationError, LogError, StoreError
from airtruth.importers import guess_mapping, import_log, open_source, read_dictionary
from airtruth.importers.mapping import MappingFile
from validation import recorders
from validation.recorders import Topic


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return flown(tmp_path_factory.mktemp("flown"), runs=1, duration_s=6.0)


def guessed(path, **more):
    text = guess_mapping(path, **more)
    return text, MappingFile.model_validate(tomllib.loads(text))


def test_headers_of_flight_test_centres(log, tmp_path):
    c = log.channels
    columns = {
        "TIME_SEC": log.t_s,
        "VTAS_FTS": c["airspeed_m_s"] / FOOT,
        "AoA1 [deg]": c["alpha_rad"] / DEG,
        "THETA_D": c["theta_rad"] / DEG,
        "Q (deg/sec)": c["q_rad_s"] / DEG,
        "Nx": c["ax_m_s2"] / 9.80665,
        "Nz": -c["az_m_s2"] / 9.80665,
        "STAB POS (deg TEU)": -c["elevator_rad"] / DEG,
        "Hp [ft]": c["altitude_m"] / FOOT,
        "rho": 0.0 * log.t_s,
    }
    write_csv(tmp_path / "f.csv", columns)
    text, mapping = guessed(tmp_path / "f.csv")
    assert {n: (x.unit, x.sign) for n, x in mapping.channels.items()} == {
        "airspeed_m_s": ("ft_s", 1),
        "alpha_rad": ("deg", 1),
        "theta_rad": ("deg", 1),
        "q_rad_s": ("deg_s", 1),
        "ax_m_s2": ("g", 1),
        "az_m_s2": ("g", -1),
        "elevator_rad": ("deg", -1),
        "altitude_m": ("ft", 1),
    }
    assert "# density_kg_m3: column 'rho' is zero throughout and is not mapped" in text
    assert "do not contradict" in text
    (tmp_path / "m.toml").write_text(text)
    back = import_log(tmp_path / "f.csv", tmp_path / "m.toml").log
    np.testing.assert_allclose(back.channels["elevator_rad"], c["elevator_rad"], atol=1e-12)


LABELS = [
    "* time (sec)",
    "* V (ft/sec)",
    "* alpha (deg)",
    "* q (deg/sec)",
    "* az (g)",
    "* de (deg)",
    "* h (ft)",
]


def matrix(log):
    c = log.channels
    return np.column_stack(
        [
            log.t_s,
            c["airspeed_m_s"] / FOOT,
            c["alpha_rad"] / DEG,
            c["q_rad_s"] / DEG,
            c["az_m_s2"] / 9.80665,
            c["elevator_rad"] / DEG,
            c["altitude_m"] / FOOT,
        ]
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    "more",
    [
        {"varlab": LABELS, "copy": LABELS},
        {"varlab": [*LABELS, "* beta (deg)", "* phi (deg)"]},
        {"varlab": LABELS, "varunits": ["s", "ft/s", "deg", "deg/s", "g", "deg", "ft"]},
    ],
)
def test_labels_twice_longer_than_the_matrix_and_beside_units(more, log, tmp_path):
    cells = {name: np.array(texts, dtype=object) for name, texts in more.items()}
    scipy.io.savemat(tmp_path / "f.mat", {"fdata": matrix(log), **cells})
    assert open_source(tmp_path / "f.mat").labels["fdata"] == tuple(LABELS)
    text, mapping = guessed(tmp_path / "f.mat")
    assert mapping.channels["airspeed_m_s"].unit == "ft_s"
    assert "do not contradict" in text


def test_label_arrays_that_contradict_each_other_are_left_alone(log, tmp_path):
    other = [*LABELS[:2], LABELS[3], LABELS[2], *LABELS[4:]]
    cells = {n: np.array(t, dtype=object) for n, t in (("a", LABELS), ("b", other))}
    scipy.io.savemat(tmp_path / "f.mat", {"fdata": matrix(log), **cells})
    assert open_source(tmp_path / "f.mat").labels == {}


@pytest.mark.parametrize(("rate_hz", "single"), [(10.0, False), (25.0, True)])
def test_a_time_column_without_a_name(rate_hz, single, tmp_path):
    n = 200
    t = 3600.0 + np.arange(n) / rate_hz
    t = t.astype(np.float32).astype(float) if single else t
    values = np.column_stack([t, np.arange(n) + 1.0, np.sin(t)])
    np.savetxt(tmp_path / "f.txt", values)
    text, mapping = guessed_channels(tmp_path / "f.txt")
    assert mapping["time"] == {"column": 1, "unit": "s"}
    assert "a column without a name that increases evenly" in text
    np.savetxt(tmp_path / "f.txt", values[:, 1:])
    text, mapping = guessed_channels(tmp_path / "f.txt")
    assert mapping["time"] == {}  # a counter is no time, and no rate is invented
    assert "no time was found" in text


def guessed_channels(path):
    text = guess_mapping(path)
    return text, tomllib.loads(text)


def test_recorders_state_their_units_and_their_own_clocks(log, tmp_path):
    c, half = log.channels, slice(0, None, 2)
    fast = {"Pitch": c["theta_rad"], "GyrY": c["q_rad_s"], "AccZ": c["az_m_s2"], "AOA": c["alpha_rad"] / DEG}
    fast |= {"Elev": c["elevator_rad"] / DEG}
    units = {
        "Pitch": "rad",
        "GyrY": "rad/s",
        "AccZ": "m/s²",
        "AOA": "°",
        "Elev": "deg",
        "TAS": "m/s",
        "Alt": "m",
    }
    topics = [
        Topic("nav", log.t_s, fast, units),
        Topic("air", log.t_s[half], {"TAS": c["airspeed_m_s"][half], "Alt": c["altitude_m"][half]}, units),
    ]
    recorders.hdf5(tmp_path / "f.h5", topics)
    recorders.mdf4(tmp_path / "f.mf4", topics)
    for name in ("f.h5", "f.mf4"):
        text, mapping = guessed(tmp_path / name)
        assert {n: x.unit for n, x in mapping.channels.items()} == {
            "airspeed_m_s": "m_s",
            "alpha_rad": "deg",
            "theta_rad": "rad",
            "q_rad_s": "rad_s",
            "az_m_s2": "m_s2",
            "elevator_rad": "deg",
            "altitude_m": "m",
        }
        assert mapping.resample is not None
        assert mapping.resample.rate_hz == 50.0
        assert "do not contradict" in text
        (tmp_path / "m.toml").write_text(text)
        assert import_log(tmp_path / name, tmp_path / "m.toml").log.metadata["sample_rate_hz"] == 50.0


def test_a_dictionary_of_the_users_own(log, tmp_path):
    c = log.channels
    columns = {
        "t": log.t_s,
        "KTAS X": c["airspeed_m_s"],
        "VANE 1 [grd]": c["alpha_rad"] * 200.0 / np.pi / (200.0 / 180.0),
        "alpha": c["theta_rad"],
        "q": c["q_rad_s"],
        "az": c["az_m_s2"],
        "de [up]": -c["elevator_rad"],
        "h [m]": c["altitude_m"],
    }
    write_csv(tmp_path / "f.csv", columns)
    (tmp_path / "w.toml").write_text(
        '[names]\nalpha_rad = ["Vane-1"]\nairspeed_m_s = "ktas x"\n'
        '[units]\ngrd = "deg"\n"up" = { unit = "rad", sign = -1 }\n'
    )
    text, mapping = guessed(tmp_path / "f.csv", words=read_dictionary(tmp_path / "w.toml"))
    assert mapping.channels["alpha_rad"].column == "VANE 1 [grd]"
    assert mapping.channels["alpha_rad"].unit == "deg"
    assert mapping.channels["airspeed_m_s"].column == "KTAS X"
    assert mapping.channels["elevator_rad"].sign == -1
    assert "do not contradict" in text


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ('[name]\nalpha_rad = "x"', "'name': did you mean 'names'"),
        ('[names]\nalfa_rad = "x"', "'alfa_rad' is not a channel; did you mean 'alpha_rad'"),
        ("[names]\nalpha_rad = 3", "3 is not a column name"),
        ('[units]\nx = "degg"', "'degg' is not a unit; did you mean 'deg'"),
        ('[units]\nx = { unit = "deg", sign = 2 }', "sign = 1 or -1"),
        ("names = 3", "names must be a table"),
    ],
)
def test_a_dictionary_that_cannot_be_used(content, message, tmp_path):
    (tmp_path / "w.toml").write_text(content)
    with pytest.raises(ConfigurationError, match=message.replace("[", r"\[")):
        read_dictionary(tmp_path / "w.toml")


def test_without_a_vane_the_guess_offers_the_reconstruction(log, tmp_path):
    c = log.channels
    columns = {"t": log.t_s, "qbar": c["airspeed_m_s"] ** 2 * 0.5, "q": c["q_rad_s"], "az": c["az_m_s2"]}
    write_csv(tmp_path / "f.csv", {**columns, "de": c["elevator_rad"], "h [m]": c["altitude_m"]})
    _, mapping = guessed(tmp_path / "f.csv")
    assert mapping.reconstruct.alpha
    assert mapping.channels["dynamic_pressure_pa"].unit == "pa"
    assert "airspeed_m_s" not in mapping.channels


@pytest.mark.parametrize("step", [5e-324, 1e-200, 1e-6, 20.0, 1e300])
def test_a_clock_whose_rate_no_recorder_has(step, log, tmp_path):
    """The mapping keeps 50 Hz; the reciprocal of the first step is infinite."""
    times = step * np.arange(len(log.t_s))
    topics = [
        Topic("nav", times, {"GyrY": log.channels["q_rad_s"]}, {"GyrY": "rad/s"}),
        Topic("air", times[::2], {"TAS": log.channels["airspeed_m_s"][::2]}, {"TAS": "m/s"}),
    ]
    recorders.hdf5(tmp_path / "f.h5", topics)
    _, mapping = guessed(tmp_path / "f.h5")
    assert mapping.resample.rate_hz == 50.0


def german(log):
    c = log.channels
    return {
        "Time [s]": log.t_s,
        "TAS [kt]": c["airspeed_m_s"] / (1852.0 / 3600.0),
        "Alpha [deg]": c["alpha_rad"] / DEG,
        "Theta [deg]": c["theta_rad"] / DEG,
        "q [deg/s]": c["q_rad_s"] / DEG,
        "nx [g]": c["ax_m_s2"] / 9.80665,
        "nz [g]": -c["az_m_s2"] / 9.80665,
        "Elevator [deg]": c["elevator_rad"] / DEG,
        "Altitude [ft]": c["altitude_m"] / FOOT,
    }


@pytest.mark.parametrize(
    ("suffix", "delimiter", "source"),
    [
        ("csv", ";", {"delimiter": ";", "decimal": ","}),
        ("csv", "\t", {"delimiter": "\t", "decimal": ","}),
        ("txt", ";", {"format": "csv", "delimiter": ";", "decimal": ","}),
    ],
)
def test_a_table_with_decimal_commas(log, tmp_path, suffix, delimiter, source):
    """A spreadsheet of a German desk writes them, with a mark of byte order."""
    file = tmp_path / f"f.{suffix}"
    write_csv(file, german(log), "|")
    file.write_text("\ufeff" + file.read_text().replace(".", ",").replace("|", delimiter))
    text, mapping = guessed(file)
    assert tomllib.loads(text)["source"] == source
    assert "do not contradict" in text
    (tmp_path / "m.toml").write_text(text)
    back = import_log(file, tmp_path / "m.toml").log
    np.testing.assert_allclose(back.channels["elevator_rad"], log.channels["elevator_rad"], atol=1e-12)
    assert mapping.source.skip_rows == 0


def test_the_layout_of_other_tables(tmp_path):
    for name, row, stated in (
        ("a.csv", "1.5;2.5;3", {"delimiter": ";"}),
        ("b.csv", "1.5\t2.5\t3", {"delimiter": "\t"}),
        ("c.csv", "1,2,3", {}),
        ("d.dat", "1,5   2,5  3", {"decimal": ","}),
        ("e.dat", "1.5, 2.5, 3.5", {"format": "csv"}),
        ("f.dat", "1.5 2.5 3.5", {}),
    ):
        (tmp_path / name).write_text("# made by hand\n" + f"{row}\n" * 9)
        text = guess_mapping(tmp_path / name)
        assert tomllib.loads(text).get("source", {}) == stated, name
        assert "#   3: 3" in text


def test_utf_16_without_a_mark_is_refused(tmp_path):
    (tmp_path / "f.csv").write_text("Zeit;Alpha [\u00b0]\n0,0;1,5\n0,1;1,6\n", encoding="utf-16-le")
    with pytest.raises(StoreError, match="probably in UTF-16; save it as UTF-8"):
        guess_mapping(tmp_path / "f.csv")


def test_a_name_of_two_columns(log, tmp_path):
    write_csv(tmp_path / "f.csv", german(log) | {"Q2 [deg/s]": 0.0 * log.t_s})
    text = (tmp_path / "f.csv").read_text().replace("Q2 [deg/s]", "q [deg/s]")
    (tmp_path / "f.csv").write_text(text)
    guess, mapping = guessed(tmp_path / "f.csv")
    assert mapping.channels["q_rad_s"].column == 5
    assert "\n#   10 (q): 0, 0; 0, 0\n" in guess
    (tmp_path / "m.toml").write_text(guess)
    assert len(import_log(tmp_path / "f.csv", tmp_path / "m.toml").log.t_s) == len(log.t_s)
    for stated, words in (
        (
            '"q [deg/s]"',
            "2 columns are named 'q [deg/s]'; state the number of the one that is meant, column = 5 or 10",
        ),
        ('"q"', "Theta [deg], Time [s], nx [g], nz [g], q [deg/s]"),
    ):
        (tmp_path / "m.toml").write_text(guess.replace("column = 5", f"column = {stated}"))
        with pytest.raises(LogError) as caught:
            import_log(tmp_path / "f.csv", tmp_path / "m.toml")
        assert words in str(caught.value)
        assert "q [deg/s].1" not in str(caught.value)


def test_an_impact_pressure_is_no_dynamic_pressure(tmp_path):
    """q_c/q_bar = ((1 + 0.2 M^2)^3.5 - 1)/(0.7 M^2): 1.064 at Mach 0.5, an airspeed that is 3.2 % high."""
    mach = 0.5
    assert (((1.0 + 0.2 * mach**2) ** 3.5 - 1.0) / (0.7 * mach**2)) ** 0.5 == pytest.approx(1.0315, abs=1e-4)
    for name, mapped in (("qc [psf]", False), ("qbar [psf]", True)):
        rows = "".join(f"{0.02 * k:.2f},{300.0 + k % 7}\n" for k in range(60))
        (tmp_path / "f.csv").write_text(f"Time [s],{name}\n{rows}")
        text = guess_mapping(tmp_path / "f.csv")
        assert ("[channels.dynamic_pressure_pa]" in text) is mapped
