"""What an import might lose or move without a word: clocks that drift, flagged samples, marks in cells, ends of records."""

import numpy as np
import pandas as pd
import pytest
from import_flight import mapping_by_name, write_csv
from test_import_bad import columns

from airtruth.errors import ConfigurationError, LogError, StoreError
from airtruth.foreign.mdf import read_mdf
from airtruth.foreign.text import TextFormat, read_text
from airtruth.importers import find_manoeuvres, import_log, read_table
from airtruth.importers.mapping import Resample
from airtruth.importers.series import Series
from airtruth.importers.uniform import even_times, uniform

LAYOUT = TextFormat()


def test_steps_that_add_up_are_no_even_grid():
    """0.6 % fast, then 0.6 % slow: each step is within 1 %, the middle is 6 samples off."""
    t = np.concatenate([[0.0], np.cumsum(np.repeat([0.02 * 0.994, 0.02 * 1.006], 1000))])
    np.testing.assert_array_equal(even_times(t), t)
    _, values = uniform("f", {"alpha_rad": Series(t, np.sin(t))}, Resample(rate_hz=50.0, method="cubic"))
    even = np.arange(len(values["alpha_rad"])) / 50.0
    np.testing.assert_allclose(values["alpha_rad"], np.sin(even), atol=1e-6)


def test_jitter_of_less_than_a_hundredth_of_a_step_is_an_even_grid():
    even = np.arange(500) / 50.0
    t = even + 1e-5 * np.cos(np.arange(500.0))
    np.testing.assert_allclose(even_times(t), even, atol=2e-5)


@pytest.mark.parametrize("since", [0.0, 1.7e9])
def test_a_cut_does_not_depend_on_the_start_of_the_clock(since):
    t = since + np.arange(1000) / 50.0
    cut = Series(t, t).between(since + 4.0, since + 9.0)
    assert len(cut.t_s) == 251


def test_a_table_of_manoeuvres_keeps_times_since_1970(tmp_path):
    t = 1.7e9 + np.arange(6000) / 50.0
    after = t - t[0] - 40.0
    elevator = 0.05 * ((after >= 0.0) & (after < 1.0)) - 0.05 * ((after >= 1.0) & (after < 2.0))
    rate = 0.3 * np.exp(-0.5 * (after - 1.0) ** 2)
    table = pd.DataFrame(
        {"t": t, "e": elevator, "q": rate, "a": 0.1 + 0.1 * rate, "az": -9.8 - rate, "V": 40.0}
    )
    table.to_csv(tmp_path / "f.csv", index=False)
    channels = {
        "elevator_rad": ("e", "rad"),
        "q_rad_s": ("q", "rad/s"),
        "alpha_rad": ("a", "rad"),
        "az_m_s2": ("az", "m/s2"),
        "airspeed_m_s": ("V", "m/s"),
    }
    mapped = "".join(f'[channels.{n}]\ncolumn = "{c}"\nunit = "{u}"\n' for n, (c, u) in channels.items())
    (tmp_path / "m.toml").write_text(f'[time]\ncolumn = "t"\nunit = "s"\n{mapped}')
    found = find_manoeuvres(tmp_path / "f.csv", tmp_path / "m.toml")
    (tmp_path / "t.csv").write_text(found.table().replace(",no,", ",yes,"))
    (one,) = read_table(tmp_path / "t.csv")
    assert one.start_s == pytest.approx(found.candidates[0].start_s, abs=1e-6)


def test_samples_that_a_recorder_flags_are_no_measurements(tmp_path):
    asammdf = pytest.importorskip("asammdf")
    flagged = np.zeros(60, dtype=bool)
    flagged[10:20] = True
    signal = asammdf.Signal(
        samples=np.where(flagged, 30.0, 5.0),
        timestamps=np.arange(60) / 50.0,
        name="AOA",
        unit="deg",
        invalidation_bits=flagged,
    )
    with asammdf.MDF(version="4.10") as mdf:
        mdf.append([signal], acq_name="air", comment="air")
        mdf.save(tmp_path / "f.mf4", overwrite=True)
    read = read_mdf(tmp_path / "f.mf4").arrays["AOA"]
    np.testing.assert_array_equal(np.isnan(read), flagged)


def test_a_mark_in_a_cell_is_no_comment(tmp_path):
    (tmp_path / "f.csv").write_text("# made by hand\nt,event,q\n0,,1\n1,#mark,2\n# a pause\n2,,3\n")
    read = read_text(tmp_path / "f.csv", LAYOUT)
    np.testing.assert_array_equal(read.arrays["q"], [1, 2, 3])
    assert read.arrays["event"].tolist()[1] == "#mark"


@pytest.mark.parametrize("delimiter", [",", ";"])
def test_rows_that_end_with_a_delimiter_keep_their_columns(tmp_path, delimiter):
    rows = ["t,q", "0,1,", "1,2,"]
    (tmp_path / "f.csv").write_text("\n".join(rows).replace(",", delimiter))
    read = read_text(tmp_path / "f.csv", TextFormat(delimiter))
    np.testing.assert_array_equal(read.arrays["t"], [0, 1])
    np.testing.assert_array_equal(read.arrays["q"], [1, 2])


def test_values_without_a_name_are_refused(tmp_path):
    (tmp_path / "f.csv").write_text("t,q\n0,1,2\n1,2,3\n")
    with pytest.raises(StoreError, match="the first row has 3 values and the header 2 names"):
        read_text(tmp_path / "f.csv", LAYOUT)


def imported(folder, table, more=""):
    mapping = mapping_by_name().replace("[time]", f"[time]\n{more}").replace('run_id = "flight"\n', "")
    pd.DataFrame(table).to_csv(folder / "f.csv", index=False)
    (folder / "m.toml").write_text(mapping)
    return import_log(folder / "f.csv", folder / "m.toml", force=True)


def test_rows_without_a_run_belong_to_none(tmp_path):
    table = columns()
    table["run"] = [""] * 20 + ["1"] * 40
    log = imported(tmp_path, table, 'run = "run"').log
    assert log.run_ids == ("1",)
    assert len(log.t_s) == 40


def test_a_column_of_runs_without_a_name_is_refused(tmp_path):
    table = columns()
    table["run"] = [""] * 60
    with pytest.raises(LogError, match="is empty in every row"):
        imported(tmp_path, table, 'run = "run"')


def test_a_channel_that_begins_late_is_stated(tmp_path):
    table = columns()
    table["Hp"] = np.where(np.arange(60) < 30, np.nan, table["Hp"])
    write_csv(tmp_path / "f.csv", table)
    (tmp_path / "m.toml").write_text(mapping_by_name() + '[resample]\nrate_hz = 50\nmethod = "linear"\n')
    found = import_log(tmp_path / "f.csv", tmp_path / "m.toml", force=True)
    assert len(found.log.t_s) == 30
    assert found.notes == ("run 'flight': its first 0.6 s are left out, where altitude_m has no value",)


@pytest.mark.parametrize("method", ["linear", "cubic"])
def test_an_infinite_cell_is_interpolated_like_an_empty_one(tmp_path, method):
    table = columns()
    table["AOA_nose"] = np.where(np.arange(60) == 30, np.inf, table["AOA_nose"])
    write_csv(tmp_path / "f.csv", table)
    (tmp_path / "m.toml").write_text(mapping_by_name() + f'[resample]\nrate_hz = 20\nmethod = "{method}"\n')
    log = import_log(tmp_path / "f.csv", tmp_path / "m.toml", force=True).log
    assert np.isfinite(log.channels["alpha_rad"]).all()


def test_a_table_of_manoeuvres_with_an_infinite_or_unnamed_row(tmp_path):
    (tmp_path / "t.csv").write_text("run_id,start_s,end_s\n  ,1,2\n")
    assert [one.run_id for one in read_table(tmp_path / "t.csv")] == ["m01"]
    (tmp_path / "t.csv").write_text("run_id,start_s,end_s\na,1,inf\n")
    with pytest.raises(ConfigurationError, match="line 2: start_s 1 and end_s inf must be finite"):
        read_table(tmp_path / "t.csv")


def test_a_parquet_file_with_the_time_as_index(tmp_path):
    table = pd.DataFrame({"Clock [ms]": columns()["Clock [ms]"], **columns()}).set_index("Clock [ms]")
    table.to_parquet(tmp_path / "f.parquet")
    (tmp_path / "m.toml").write_text(mapping_by_name())
    assert len(import_log(tmp_path / "f.parquet", tmp_path / "m.toml", force=True).log.t_s) == 60
