"""Units that a header states, pauses between the manoeuvres of a file, and samples that a recorder lost."""

import tomllib

import numpy as np
import pytest
from import_flight import DEG, FOOT, flown, write_csv

from airtruth.errors import ConfigurationError
from airtruth.importers import guess_mapping, import_log, open_source
from airtruth.importers.build import sentences
from airtruth.importers.guessing.candidates import pauses_of, without_pauses
from airtruth.importers.mapping import MappingFile
from airtruth.importers.series import Series
from airtruth.importers.uniform import lost_of


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return flown(tmp_path_factory.mktemp("flown"), runs=2, duration_s=6.0)


def columns(log, **other):
    """Every channel in usual units, some under another header; None leaves one out."""
    c = log.channels
    usual = {
        "time_s": log.t_s,
        "TAS (m/s)": c["airspeed_m_s"],
        "Alpha (deg)": c["alpha_rad"] / DEG,
        "q (deg/s)": c["q_rad_s"] / DEG,
        "theta (deg)": c["theta_rad"] / DEG,
        "az (m/s2)": c["az_m_s2"],
        "Elevator (deg)": c["elevator_rad"] / DEG,
        "Alt (m)": c["altitude_m"],
    }
    for name, column in other.items():
        usual = {k: v for k, v in usual.items() if not k.lower().startswith(name)}
        usual[column[0]] = column[1]
    return usual


def guessed(path):
    text = guess_mapping(path)
    return text, MappingFile.model_validate(tomllib.loads(text)).channels


STATED = {
    "alt": ("Alt (FL)", lambda c: c["altitude_m"] / (100.0 * FOOT), "altitude_m", "fl"),
    "elevator": ("Elevator (mrad)", lambda c: 1e3 * c["elevator_rad"], "elevator_rad", "mrad"),
    "alpha": ("Alpha (mrad)", lambda c: 1e3 * c["alpha_rad"], "alpha_rad", "mrad"),
    "tas": ("TAS (mph)", lambda c: c["airspeed_m_s"] / 0.44704, "airspeed_m_s", "mph"),
    "tas ": ("KTAS", lambda c: c["airspeed_m_s"] * 3600.0 / 1852.0, "airspeed_m_s", "kt"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", STATED)
def test_a_stated_unit_is_taken(log, tmp_path, name):
    header, made, channel, unit = STATED[name]
    one = log.select(log.run_ids[:1])
    write_csv(tmp_path / "f.csv", columns(one, **{name.strip(): (header, made(one.channels))}))
    _, channels = guessed(tmp_path / "f.csv")
    assert channels[channel].unit == unit


@pytest.mark.slow
def test_a_stated_unit_that_is_not_known_is_never_another_one(log, tmp_path):
    one = log.select(log.run_ids[:1])
    write_csv(tmp_path / "f.csv", columns(one, alt=("Alt (fathom)", one.channels["altitude_m"] / 1.8288)))
    text, channels = guessed(tmp_path / "f.csv")
    assert "altitude_m" not in channels
    assert "the file states the unit 'fathom', which is not known" in text


@pytest.mark.slow
@pytest.mark.parametrize("pause_s", [5.0, 60.0])
def test_a_pause_between_records_changes_no_sign(log, tmp_path, pause_s):
    t = np.concatenate([own.t_s + k * (6.0 + pause_s) for k, own in enumerate(each(log))])
    table = columns(log) | {"time_s": t, "Record": np.repeat([1.0, 2.0], np.diff(log.offsets))}
    write_csv(tmp_path / "f.csv", table)
    text, channels = guessed(tmp_path / "f.csv")
    assert channels["elevator_rad"].sign == 1
    assert "in doubt" not in text


def each(log):
    return [log.select([run]) for run in log.run_ids]


def test_pauses_of_all_columns_are_closed():
    t = np.array([0.0, 0.1, 0.2, 30.2, 30.3, 30.4])
    found = pauses_of(t)
    assert found == pytest.approx(np.array([[30.2, 29.9]]))
    assert without_pauses(t, found) == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4, 0.5])
    assert pauses_of(t[:3]).shape == (0, 2)


def test_lost_samples_are_counted():
    t = np.delete(np.arange(100) * 0.02, [40, 41, 42, 70])
    assert lost_of(Series(t, t)) == (4, pytest.approx(0.08))
    assert lost_of(Series(t[:30], t[:30])) == (0, 0.0)


def test_lost_and_repeated_samples_are_stated(log, tmp_path):
    one = log.select(log.run_ids[:1])
    kept = np.delete(np.arange(one.t_s.size), slice(100, 110))
    rows = np.sort(np.concatenate([kept, kept[20:23]]))  # three rows written twice
    table = {name: values[rows] for name, values in columns(one).items()}
    write_csv(tmp_path / "f.csv", table | {"Record": np.ones(rows.size)})
    units = {"TAS (m/s)": ("airspeed_m_s", "m_s"), "Alpha (deg)": ("alpha_rad", "deg")}
    units |= {"q (deg/s)": ("q_rad_s", "deg_s"), "az (m/s2)": ("az_m_s2", "m_s2")}
    units |= {"Elevator (deg)": ("elevator_rad", "deg"), "Alt (m)": ("altitude_m", "m")}
    mapping = '[time]\ncolumn = "time_s"\nunit = "s"\nrun = "Record"\n[resample]\nrate_hz = 50.0\nmethod = "linear"\n'
    mapping += "".join(
        f'[channels.{name}]\ncolumn = "{column}"\nunit = "{unit}"\n' for column, (name, unit) in units.items()
    )
    (tmp_path / "m.toml").write_text(mapping)
    stated = " ".join(sentences(import_log(tmp_path / "f.csv", tmp_path / "m.toml").log))
    assert "10 samples are missing, and up to 0.22 s lie between two" in stated
    assert "3 repeated times are left out" in stated


@pytest.mark.parametrize(
    ("name", "cure"),
    [("f.zip", "unpack it"), ("f.xlsx", "export the table as CSV"), ("", "a folder is no log")],
)
def test_what_cannot_be_read_states_the_next_step(tmp_path, name, cure):
    if name:
        (tmp_path / name).write_bytes(b"PK")
    with pytest.raises(ConfigurationError, match=cure):
        open_source(tmp_path / name)
