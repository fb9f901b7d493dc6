"""Manoeuvres in a long flight: which parts become runs, the table that a person edits, and the picture."""

import json
from itertools import pairwise

import numpy as np
import pytest
from import_flight import DEG, write_csv

import airtruth as at
from airtruth import style
from airtruth.errors import ConfigurationError, LogError
from airtruth.importers import find_manoeuvres, import_log, read_table
from airtruth.importers.manoeuvres import RATE_HZ, SETTLE_S, TRIM_S, find, shortest_s
from airtruth.importers.series import Series
from studies.real_rows import run
from validation.linear_flight import DENSITY_KG_M3, fly

STEP = 0.5


def train(t, starts, size_s=STEP):
    """3-2-1-1 inputs of unit size that begin at given times."""
    total = np.zeros_like(t)
    for start in starts:
        edges = start + size_s * np.cumsum([0, 3, 2, 1, 1])
        for number, (a, b) in enumerate(pairwise(edges)):
            total += ((t + 1e-9 >= a) & (t + 1e-9 < b)) * (1.0 if number % 2 == 0 else -1.0)
    return total


STARTS = (20.0, 60.0, 95.0, 140.0)


@pytest.fixture(scope="module")
def flight():
    """Three minutes of the linear aircraft at 100 Hz in light gusts, with four 3-2-1-1 and a trim change."""
    batch = fly(
        rate_hz=100, duration_s=180.0, gust=0.2, noise=0.5, seed=4, shape=lambda t: train(t, STARTS), amplitude_rad=2 * DEG
    )  # fmt: skip
    c = {name: values[0] for name, values in batch.channels.items()}
    c["elevator_rad"] = c["elevator_rad"] + 0.15 * DEG * np.tanh(
        batch.t_s[0] - 120.0
    )  # a trim wheel, no input
    return batch.t_s[0] + 1000.0, c


def series(flight):
    t, c = flight
    return {name: Series(t, values) for name, values in c.items()}


def test_inputs_are_cut_with_trim_before_and_response_after(flight):
    found = find("f", series(flight))
    assert [c.accept for c in found.candidates] == ["yes"] * 4
    for one, start in zip(found.candidates, STARTS, strict=True):
        assert one.start_s == pytest.approx(1000.0 + start - TRIM_S, abs=0.2)
        end = 1000.0 + start + 7 * STEP
        assert end + SETTLE_S[0] - 0.2 <= one.end_s <= end + SETTLE_S[1] + 0.2
        assert one.input_deg == pytest.approx(4.0, rel=0.15)
        # 2 deg over 3.5 s behind a servo: 14 deg2 s
        assert one.energy_deg2_s == pytest.approx(14.0, rel=0.15)
        assert one.excitation > 3.0
        assert one.airspeed_m_s == pytest.approx(42.85, rel=0.01)
        assert one.load_factor == pytest.approx(1.0, abs=0.05)
    assert found.summary() == "4 of 4 manoeuvres accepted"


def test_gusts_alone_are_no_manoeuvre():
    batch = fly(rate_hz=50, duration_s=120.0, gust=1.0, noise=1.0, seed=2, amplitude_rad=0.0)
    found = find("f", {n: Series(batch.t_s[0], v[0]) for n, v in batch.channels.items()})
    assert found.candidates == ()


def test_the_reason_of_a_part_that_is_not_accepted(flight):
    t, c = flight
    turn = dict(c)
    turn["az_m_s2"] = np.where(t > 1130.0, c["az_m_s2"] * 1.4, c["az_m_s2"])
    slow = np.where((t > 1062.0) & (t < 1075.0), 0.7, 1.0)
    turn["airspeed_m_s"] = c["airspeed_m_s"] * slow
    turn["elevator_rad"] = c["elevator_rad"] + 2 * DEG * np.where((t > 1093.5) & (t < 1094.8), 1.0, 0.0)
    turn["q_rad_s"] = np.where(t < 1050.0, 0.0 * c["q_rad_s"], c["q_rad_s"])  # the gyro did not run
    found = find("f", {n: Series(t, v) for n, v in turn.items()})
    reasons = {one.run_id: one.reason for one in found.candidates}
    assert "q moves" in reasons["m01"]
    assert "airspeed changes" in reasons["m02"]
    assert "load factor of 1.4" in reasons["m04"]
    assert "m04 not: mean load factor" in found.summary()


@pytest.mark.parametrize(
    ("channel", "factor", "reason"),
    [
        ("airspeed_m_s", 0.1, "on the ground: airspeed of 4.3 m/s"),
        ("elevator_rad", 30.0, "beyond 45 deg: another unit or column"),  # 60 deg
    ],
)
def test_a_control_check_on_the_ground_and_an_impossible_surface_are_no_manoeuvres(
    flight, channel, factor, reason
):
    t, c = flight
    other = {**c, channel: np.where(t < 1050.0, factor, 1.0) * c[channel]}
    first = find("f", {n: Series(t, v) for n, v in other.items()}).candidates[0]
    assert first.accept == "no"
    assert reason in first.reason


def test_a_record_that_check_and_identify_would_refuse_is_too_short(flight):
    """The record ends half a second after an input at 140 s; at 3 Hz the low-pass needs more than the 6 s that remain."""
    t, c = flight
    part = (t > 1100.0) & (t < 1144.0)
    cut = {n: Series(t[part], v[part]) for n, v in c.items()}
    (one,) = find("f", cut).candidates
    assert one.accept == "yes"
    (one,) = find("f", cut, 3.0).candidates
    assert one.end_s - one.start_s < shortest_s(3.0)
    assert (
        one.reason
        == f"lasts {one.end_s - one.start_s:.1f} s, check and identify need {shortest_s(3.0):.1f} s at this rate"
    )


def test_two_inputs_close_together_share_no_sample(flight):
    t, _ = flight
    batch = fly(
        rate_hz=50, duration_s=60.0, gust=0.1, noise=0.3, seed=1, shape=lambda x: train(x, (20.0, 28.0))
    )
    found = find("f", {n: Series(batch.t_s[0], v[0]) for n, v in batch.channels.items()})
    first, second = found.candidates
    assert first.end_s <= 28.0 + 2.0 / RATE_HZ
    assert second.start_s >= 20.0 + 7 * STEP
    assert len(t) == 18000


def test_a_pause_of_a_recorder_is_no_manoeuvre_and_is_not_interpolated(flight, files, tmp_path):
    t, c = flight
    keep = ~((t > 1061.0) & (t < 1062.0))
    found = find("f", {n: Series(t[keep], v[keep]) for n, v in c.items()})
    assert [one.accept for one in found.candidates] == ["yes", "no", "yes", "yes"]
    assert "has a gap of 1" in found.candidates[1].reason
    write_csv(tmp_path / "f.csv", {"t": t[keep], **{n: c[n][keep] for n in UNITS}})
    text = (files / "m.toml").read_text() + '[resample]\nrate_hz = 50.0\nmethod = "linear"\n'
    (tmp_path / "m.toml").write_text(text)
    with pytest.raises(LogError, match=r"1 gap, the longest of 1\S* s from 1061 to 1062.*find-manoeuvres"):
        import_log(tmp_path / "f.csv", tmp_path / "m.toml")
    (tmp_path / "t.csv").write_text(found.table())
    log = import_log(tmp_path / "f.csv", tmp_path / "m.toml", manoeuvres=tmp_path / "t.csv").log
    assert log.run_ids == ("m01", "m03", "m04")


def test_the_commands_find_and_import(files, tmp_path):
    table = tmp_path / "t.csv"
    arguments = ("import", files / "f.csv", "--mapping", files / "m.toml", "--quiet")
    assert "4 of 4 manoeuvres accepted" in run(*arguments, "--find-manoeuvres", "--out", table)
    assert table.with_suffix(".png").stat().st_size > 10_000
    made = run(*arguments, "--manoeuvres", table, "--out", tmp_path / "log.parquet")
    assert made.startswith("4 runs, ")
    table.write_text(table.read_text().replace("m02,yes", "m02,no"))
    with pytest.raises(
        RuntimeError, match="changed since airtruth wrote it"
    ):  # an edited table is not overwritten
        run(*arguments, "--find-manoeuvres", "--out", table)
    with pytest.raises(RuntimeError, match=r"name it with the suffix \.csv"):
        run(*arguments, "--find-manoeuvres", "--out", tmp_path / "t.toml")


def test_what_the_search_needs(flight):
    t, c = flight
    with pytest.raises(LogError, match="needs elevator_rad; map a column"):
        find("f", {"q_rad_s": Series(t, c["q_rad_s"])})
    short = {n: Series(t[:200], v[:200]) for n, v in c.items()}
    with pytest.raises(LogError, match="shorter than a manoeuvre"):
        find("f", short)


MAPPING = """
[time]
column = "t"
"""
UNITS = {
    "airspeed_m_s": "m_s", "alpha_rad": "rad", "q_rad_s": "rad_s", "az_m_s2": "m_s2", "elevator_rad": "rad",
    "density_kg_m3": "kg_m3",
}  # fmt: skip


@pytest.fixture(scope="module")
def files(flight, tmp_path_factory):
    folder = tmp_path_factory.mktemp("files")
    t, c = flight
    write_csv(folder / "f.csv", {"t": t, **{n: c[n] for n in UNITS}})
    text = MAPPING + "".join(f'[channels.{n}]\ncolumn = "{n}"\nunit = "{u}"\n' for n, u in UNITS.items())
    (folder / "m.toml").write_text(text)
    return folder


def test_the_table_passes_through_import_after_an_edit(files, tmp_path):
    found = find_manoeuvres(files / "f.csv", files / "m.toml")
    lines = found.table().splitlines()
    assert lines[0].startswith("run_id,accept,start_s,end_s,")
    lines[2] = lines[2].replace("m02,yes", "m02,no")
    lines[3] = lines[3].replace("m03,", "sortie 3,")
    (tmp_path / "t.csv").write_text("\n".join(lines) + "\n")
    made = import_log(files / "f.csv", files / "m.toml", manoeuvres=tmp_path / "t.csv").log
    assert made.run_ids == ("m01", "sortie 3", "m04")
    assert np.diff(made.offsets).min() > 100 * (TRIM_S + 3.5 + SETTLE_S[0] - 0.5)
    assert float(made.channels["density_kg_m3"].mean()) == pytest.approx(DENSITY_KG_M3)


def test_a_table_by_hand_needs_two_columns(files, tmp_path):
    (tmp_path / "t.csv").write_text("start_s,end_s\n1018,1030\n1058,1070\n")
    assert [m.run_id for m in read_table(tmp_path / "t.csv")] == ["m01", "m02"]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("a,b\n1,2\n", "needs the columns start_s and end_s"),
        ("start_s,end_s\n", "needs the columns start_s and end_s"),
        ("start_s,end_s\n5,3\n", "line 2: end_s 3 is not after start_s 5"),
        ("start_s,end_s\nx,3\n", "line 2: start_s 'x' and end_s '3' must be numbers"),
        ("start_s,end_s,accept\n1,3,perhaps\n", "line 2: accept is 'perhaps'; write yes or no"),
        ("start_s,end_s,accept\n1,3,no\n", "accepts no manoeuvre"),
        ("run_id,start_s,end_s\na,1,3\na,4,6\n", "run_id 'a' is given twice"),
    ],
)
def test_a_table_that_cannot_be_used(content, message, tmp_path):
    (tmp_path / "t.csv").write_text(content)
    with pytest.raises(ConfigurationError, match=message):
        read_table(tmp_path / "t.csv")


def test_the_picture_shows_every_candidate(flight, tmp_path):
    found = find("f", series(flight))
    figure = found.plot()
    names = [text.get_text() for axis in figure.axes for text in axis.texts]
    assert names == ["m01", "m02", "m03", "m04"]
    style.save(figure, tmp_path / "p.png")
    assert (tmp_path / "p.png").stat().st_size > 10_000


def test_the_public_function_shows_and_writes_its_result(files, tmp_path):
    inputs = (files / "f.csv", files / "m.toml")
    out = tmp_path / "manoeuvres.csv"
    found = at.find_manoeuvres(*inputs, out=out)
    assert isinstance(found, at.ManoeuvreResult)
    assert isinstance(found, at.Result)
    assert found.to_frame()["run_id"].tolist() == ["m01", "m02", "m03", "m04"]
    stated = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert [row["accept"] for row in stated["candidates"]] == ["yes"] * 4
    assert "4 of 4 manoeuvres accepted" in found._repr_html_()
    assert out.with_suffix(".png").stat().st_size > 0
    assert out.read_text() == found.table()
    assert len(at.import_log(*inputs, manoeuvres=out).log.run_ids) == 4
    with pytest.raises(at.ConfigurationError, match=r"name it with the suffix \.csv"):
        at.find_manoeuvres(*inputs, out=tmp_path / "m.txt")


def test_what_was_not_measured_is_none_in_the_dictionary(flight):
    found = find("f", {name: one for name, one in series(flight).items() if name != "az_m_s2"})
    assert {row["load_factor"] for row in found.to_dict()["candidates"]} == {None}


def quiet_flight(extra):
    """Four minutes at 50 Hz with two 3-2-1-1, and a further pitch rate while the elevator is at rest."""
    starts = (20.0, 200.0)
    batch = fly(
        rate_hz=50, duration_s=240.0, gust=0.05, noise=0.3, seed=7, shape=lambda t: train(t, starts), amplitude_rad=2 * DEG
    )  # fmt: skip
    c = {name: values[0] for name, values in batch.channels.items()}
    t = batch.t_s[0]
    c["q_rad_s"] = c["q_rad_s"] + extra(t)
    return {name: Series(t, values) for name, values in c.items()}


def test_a_free_response_is_kept_and_named():
    """An upset of 6 deg/s that decays with a damping ratio of 0.2 at 3 rad/s, as after a gust or a released trim."""

    def upset(t):
        after = np.maximum(t - 110.0, 0.0)
        return np.where(t >= 110.0, 6.0 * DEG * np.exp(-0.6 * after) * np.cos(2.94 * after), 0.0)

    found = find("f", quiet_flight(upset))
    assert [(one.kind, one.reason) for one in found.candidates] == [
        ("input", ""),
        ("free response", ""),
        ("input", ""),
    ]
    one = found.candidates[1]
    assert one.start_s == pytest.approx(110.0 - TRIM_S, abs=0.2)
    assert one.input_deg < 0.2
    assert "3 of 3 manoeuvres accepted" in found.summary()
    assert "m02 is a free response: the elevator stays within" in found.summary()
    assert found.table().splitlines()[0].endswith(",reason,kind")


def test_turbulence_is_no_free_response():
    """Ten seconds of a pitch rate of the short period's band that does not settle."""
    from scipy.signal import butter, sosfilt

    def gusty(t):
        shaped = sosfilt(
            butter(2, [0.2, 1.0], "bandpass", fs=50.0, output="sos"),
            np.random.default_rng(3).standard_normal(len(t)),
        )
        return np.where((t > 105.0) & (t < 115.0), 4.0 * DEG * shaped / shaped.std(), 0.0)

    found = find("f", quiet_flight(gusty))
    assert [one.kind for one in found.candidates] == ["input", "input"]


def test_a_table_with_a_kind_is_read(tmp_path):
    path = tmp_path / "table.csv"
    path.write_text("run_id,accept,start_s,end_s,kind\na,yes,1.0,5.0,free response\nb,no,7.0,9.0,input\n")
    assert [one.run_id for one in read_table(path)] == ["a"]
