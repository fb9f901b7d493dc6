"""Layouts that a guess recognises: stacked records, two elevators, bars between cells, and a sign on weak evidence."""

import tomllib

import numpy as np
import pytest

from airtruth.importers import guess_mapping, import_log
from airtruth.importers.guessing.evidence import RELATIONS, control
from airtruth.importers.guessing.sides import side_of
from validation.guess_flights import flown, measured

NAMES = {
    "tas [m/s]": ("airspeed_m_s", 1.0),
    "alpha [deg]": ("alpha_rad", np.pi / 180.0),
    "theta [deg]": ("theta_rad", np.pi / 180.0),
    "q [deg/s]": ("q_rad_s", np.pi / 180.0),
    "ax [m/s2]": ("ax_m_s2", 1.0),
    "az [m/s2]": ("az_m_s2", 1.0),
    "elevator [deg]": ("elevator_rad", np.pi / 180.0),
    "alt [m]": ("altitude_m", 1.0),
}


def columns(start=0.0, end=25.0, rate=50.0):
    """A table of the 1100 kg aircraft."""
    t = start + np.arange(round((end - start) * rate)) / rate
    made = {name: measured("single", c, t, 3) / factor for name, (c, factor) in NAMES.items()}
    return {"time [s]": t - start, **made}


def write(path, table, delimiter=","):
    rows = zip(*table.values(), strict=True)
    lines = [delimiter.join(f"{x:.7g}" if isinstance(x, float) else str(x) for x in row) for row in rows]
    path.write_text("\n".join([delimiter.join(table), *lines]) + "\n")
    return path


def guessed(path):
    text = guess_mapping(path)
    path.with_suffix(".toml").write_text(text)
    return text, tomllib.loads(text)


@pytest.mark.parametrize("names", [("tp1", "tp2", "tp3"), (101, 102, 103)])
def test_records_one_below_another_are_runs(tmp_path, names):
    parts = [columns(0.0, 9.0), columns(9.0, 17.0), columns(17.0, 25.0)]
    record = [name for name, part in zip(names, parts, strict=True) for _ in part["time [s]"]]
    table = {"Record": record, **{n: np.concatenate([p[n] for p in parts]) for n in parts[0]}}
    phase = np.arange(len(record)) // 100 % 2  # constant in blocks too, but not those of the records
    text, mapping = guessed(write(tmp_path / "all.csv", {"Phase": phase.tolist(), **table}))
    assert mapping["time"] == {"column": "time [s]", "unit": "s", "run": "Record"}
    assert "resample" not in mapping
    log = import_log(tmp_path / "all.csv", tmp_path / "all.toml").log
    assert log.run_ids == tuple(map(str, names))
    assert "Gravity and kinematics do not contradict it" in text


def test_records_without_a_name_are_runs_of_the_clock(tmp_path):
    parts = [columns(0.0, 12.0), columns(12.0, 25.0)]
    table = {n: np.concatenate([p[n] for p in parts]) for n in parts[0]}
    _, mapping = guessed(write(tmp_path / "two.csv", table))
    assert "run" not in mapping["time"]
    assert import_log(tmp_path / "two.csv", tmp_path / "two.toml").log.run_ids == ("two-1", "two-2")


@pytest.mark.parametrize(
    ("left", "right"), [("ELEV_L [deg]", "ELEV_R [deg]"), ("Left Elevator [deg]", "Right Elevator [deg]")]
)
def test_two_elevators_that_agree_become_their_mean(tmp_path, left, right):
    table = columns()
    own = table.pop("elevator [deg]")
    text, mapping = guessed(write(tmp_path / "f.csv", {**table, left: own - 0.2, right: own + 0.3}))
    assert set(mapping["channels"]["elevator_rad"]["columns"]) == {left, right}
    assert "# their mean" in text
    log = import_log(tmp_path / "f.csv", tmp_path / "f.toml").log
    np.testing.assert_allclose(log.channels["elevator_rad"], np.radians(own + 0.05), atol=1e-6)


@pytest.mark.parametrize(
    ("name", "expected"),
    [("ELEV_L", ("elev", "left")), ("elevator port", ("elevator", "left")), ("elevator", ("elevator", ""))],
)
def test_the_side_of_a_name(name, expected):
    assert side_of(name) == expected


def test_bars_between_cells(tmp_path):
    _, mapping = guessed(write(tmp_path / "Data.txt", columns(), delimiter="|"))
    assert mapping["source"] == {"format": "csv", "delimiter": "|"}
    assert len(mapping["channels"]) == 8


def of(elevator):
    """Slots of a relation from the truth."""
    c = {name: values[::16] for name, values in flown("single").items()}
    slots = {"q": "q_rad_s", "az": "az_m_s2", "alpha": "alpha_rad", "airspeed": "airspeed_m_s"}
    return {"elevator": elevator, **{slot: c[name] for slot, name in slots.items()}}


def test_the_two_signs_differ_by_the_odds_of_the_effect():
    """Of an effect of t standard deviations the odds of a negative one are Phi(-t) to Phi(t); at t = -1.22 they are 8 to 1."""
    (pitches,) = [r.test for r in RELATIONS if r.needs == ("elevator", "q", "az")]
    (x,) = [n for n in noises() if -1.35 < ratio(n) < -1.1][:1]
    odds = pitches(of(x), 0.04).log_ratio - pitches(of(-x), 0.04).log_ratio
    assert 1.8 < odds < 2.4  # log 6.4 at t = -1.1, log 10.3 at t = -1.35


def ratio(elevator):
    value, std = control(of(elevator), 0.04)
    return value / std


def noises():
    samples = len(flown("single")["t_s"][::16])
    return (0.02 * np.random.default_rng(seed).standard_normal(samples) for seed in range(400))


def test_a_sign_on_weak_evidence_is_a_doubt(tmp_path):
    """An elevator whose record is noise moves q' by 1.3 to 1.8 standard deviations in the wrong direction: odds of 10 to 27."""
    (x,) = [n for n in noises() if 1.3 < ratio(n) < 1.8][:1]
    table = columns(rate=25.0)
    table["elevator [deg]"] = np.degrees(x[: len(table["time [s]"])])
    text, mapping = guessed(write(tmp_path / "f.csv", table))
    assert "elevator_rad" not in mapping["channels"]
    assert "neither header nor physics decides its sign, sign = -1 or 1" in text
    assert "# Not mapped: elevator_rad is in doubt" in text


def test_a_pitch_attitude_from_0_to_360_deg(tmp_path):
    table = columns()
    exact = table["theta [deg]"]
    _, mapping = guessed(write(tmp_path / "f.csv", {**table, "theta [deg]": np.mod(exact, 360.0)}))
    assert mapping["channels"]["theta_rad"] == {"column": "theta [deg]", "unit": "deg"}
    log = import_log(tmp_path / "f.csv", tmp_path / "f.toml").log
    np.testing.assert_allclose(log.channels["theta_rad"], np.radians(exact), atol=1e-6)


def test_text_among_the_numbers_of_a_channel_is_named(tmp_path):
    path = write(tmp_path / "f.csv", columns())
    path.write_text(path.read_text() + "END OF FILE\n")
    text, _ = guessed(path)
    (line,) = [one for one in text.splitlines() if one.startswith("# Not read")]
    assert "column 'time [s]', line 1252: 'END OF FILE' is not a number" in line


def test_times_that_only_decrease_are_named(tmp_path):
    table = columns()
    text, _ = guessed(write(tmp_path / "f.csv", {**table, "time [s]": table["time [s]"][::-1]}))
    assert "# Not read: column 'time [s]' has the name of the time and never increases" in text


def test_a_named_column_that_fits_in_no_unit_is_named(tmp_path):
    """Gravity is taken out of the accelerometer."""
    table = columns()
    free = table.pop("az [m/s2]") + 9.80665
    text, mapping = guessed(write(tmp_path / "f.csv", {**table, "az": free}))
    assert "az_m_s2" not in mapping["channels"]
    assert "# Not mapped: az_m_s2: 'az' has its name, and no unit and sign fits its size and physics" in text


def test_greek_and_german_names(tmp_path):
    names = (
        "Zeit [s]",
        "Wahre Fahrt [m/s]",
        "α [°]",
        "Nickwinkel [Grad]",
        "Nickrate [Grad/s]",
        "ax [m/s2]",
        "az [m/s2]",
    )
    table = dict(zip((*names, "Höhenruder [Grad]", "Druckhöhe [m]"), columns().values(), strict=True))
    _, mapping = guessed(write(tmp_path / "f.csv", table))
    assert {"airspeed_m_s", "alpha_rad", "theta_rad", "q_rad_s", "elevator_rad", "altitude_m"} <= mapping[
        "channels"
    ].keys()
