"""The typed result of an identification, and the file that keeps estimates of several methods."""

import hashlib
import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from airtruth.errors import ConfigurationError, LogError, StoreError
from airtruth.identification import Options, identify, identify_batch, require_mergeable, write_estimates
from airtruth.identification.tables import overview, overview_of
from airtruth.logs.store import read_metadata, read_table, write_log, write_table
from airtruth.result import Result
from airtruth.table import as_text
from validation.linear_flight import AIRSPEED_M_S, GTM, as_log, fly

LOG = as_log(fly(runs=3, gust=1.0, noise=1.0, seed=71))
METHODS = ("ls", "iv-f1")


@pytest.fixture(scope="module")
def result():
    return identify(LOG, GTM, METHODS)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "estimates.parquet"


def test_rows_are_those_of_each_method_run_by_run(result):
    table = result.to_frame()
    assert isinstance(result, Result)
    assert table["run_id"].tolist() == [run for run in LOG.run_ids for _ in METHODS]
    assert table["method"].tolist() == list(METHODS) * 3
    for name in METHODS:
        expected = identify_batch(fly(runs=3, gust=1.0, noise=1.0, seed=71), GTM, name).theta
        np.testing.assert_array_equal(result.of(name).theta, expected)
    with pytest.raises(ConfigurationError, match="'iv-f2' is not in this result"):
        result.of("iv-f2")


def test_logs_of_a_folder_and_in_memory_give_the_same_rows(result, tmp_path):
    """Two files of one and two runs, of another order than their names."""
    parts = [LOG.select(run_ids=LOG.run_ids[:1]), LOG.select(run_ids=LOG.run_ids[1:])]
    for name, part in zip("ab", parts, strict=True):
        write_log(tmp_path / f"{name}.parquet", part, dtype="float64")
    seen = []
    read = identify(tmp_path, GTM, METHODS, advance=lambda *counts: seen.append(counts))
    pd.testing.assert_frame_equal(read.to_frame(), result.to_frame())
    assert seen == [(k, 4, 0) for k in (1, 2, 3, 4)]  # two methods of two logs
    assert [(s.name, s.runs) for s in read.sources] == [("a.parquet", 1), ("b.parquet", 2)]
    assert read.sources[0].sha256 == hashlib.sha256((tmp_path / "a.parquet").read_bytes()).hexdigest()
    in_memory = identify(parts, GTM, METHODS)
    pd.testing.assert_frame_equal(in_memory.to_frame(), result.to_frame())
    assert in_memory.sources == ()


def test_every_form_holds_the_estimates(result):
    document = json.loads(json.dumps(result.to_dict(), allow_nan=False))
    assert document["options"]["covariance"] == "corrected"
    assert document["estimates"][1]["Cmalpha"] == result.of("iv-f1").theta[0, 3]
    assert "iv-f1" in result.summary()
    assert "<table" in result._repr_html_()
    figure = result.plot()
    assert len(figure.axes) == 8
    assert [tick.get_text() for tick in figure.axes[0].get_yticklabels()] == list(METHODS)
    # the mean of each method, the first at the top
    marks = [line.get_xydata()[0] for line in figure.axes[3].lines]
    means = [result.of(name).theta[:, 3].mean() for name in METHODS]
    np.testing.assert_allclose(marks, [(means[0], 0.0), (means[1], 1.0)])
    assert figure.axes[3].yaxis_inverted()


def test_a_joint_estimate_is_one_row_per_method():
    joint = identify(LOG, GTM, METHODS, joint=True)
    assert joint.run_ids == ("joint",)
    assert joint.to_frame()["method"].tolist() == list(METHODS)
    assert joint.details("ls").rows[0][0] == "CLalpha"
    assert joint.compare().columns[2:] == ("ls", "ls +-", "iv-f1", "iv-f1 +-")


@pytest.mark.parametrize("factor", [1.0 / 1.6, 1.6])
def test_an_airspeed_far_from_the_measured_one_is_refused_unless_forced(factor):
    options = Options(airspeed_m_s=factor * AIRSPEED_M_S)
    with pytest.raises(ConfigurationError, match=r"the measured airspeed averages 42\.85 m/s.*--force"):
        identify(LOG, GTM, ["ls"], options)
    forced = identify(LOG, GTM, ["ls"], options, force=True)
    assert "airspeed_m_s" in forced.forced[0]
    assert "airspeed_m_s" in forced.summary()
    assert identify(LOG, GTM, ["ls"], Options(airspeed_m_s=1.4 * AIRSPEED_M_S)).forced == ()


def test_a_fault_of_the_log_is_recorded_where_it_is_forced():
    flipped = replace(LOG, channels={**LOG.channels, "az_m_s2": -LOG.channels["az_m_s2"]})
    with pytest.raises(LogError, match="az_m_s2"):
        identify(flipped, GTM, ["ls"])
    assert any("az_m_s2" in sentence for sentence in identify(flipped, GTM, ["ls"], force=True).forced)


def test_methods_are_merged_and_their_settings_kept(result, path):
    write_estimates(path, identify(LOG, GTM, ["ls"]))
    write_estimates(path, identify(LOG, GTM, ["iv-f1"]))
    rows = read_table(path)
    pd.testing.assert_frame_equal(rows, result.to_frame())
    pd.testing.assert_frame_equal(read_table(path), rows)
    records = read_metadata(path)["estimates"]
    assert set(records) == set(METHODS)
    assert records["ls"]["options"]["covariance"] == "corrected"
    assert records["ls"]["constants"]["mass_kg"] == GTM.mass_kg
    before = path.read_bytes()
    write_estimates(path, identify(LOG, GTM, ["iv-f1"]))
    assert path.read_bytes() == before


def test_runs_are_added_to_those_of_the_same_method(path):
    first, last = LOG.select(run_ids=LOG.run_ids[:2]), LOG.select(run_ids=LOG.run_ids[1:])
    write_estimates(path, identify(first, GTM, METHODS))
    write_estimates(path, identify(last, GTM, METHODS))
    rows = read_table(path)
    pd.testing.assert_frame_equal(rows, identify(LOG, GTM, METHODS).to_frame())


def test_other_options_are_refused_by_name_and_replaced_by_force(path):
    write_estimates(path, identify(LOG, GTM, METHODS))
    other = identify(LOG, GTM, ["ls"], Options(airspeed_m_s=45.0))
    before = path.read_bytes()
    message = r"estimates of ls with other options \(airspeed_m_s None in the file, 45\.0 now\).*--force"
    with pytest.raises(StoreError, match=message):
        write_estimates(path, other)
    with pytest.raises(StoreError, match=message):
        require_mergeable(path, other.methods, other.settings)
    assert path.read_bytes() == before
    write_estimates(path, other, force=True)
    rows = read_table(path)
    assert rows.groupby("method").size().to_dict() == {"ls": 3, "iv-f1": 3}
    np.testing.assert_array_equal(rows.loc[rows["method"] == "ls", "Cmde"], other.of("ls").theta[:, 5])


def test_a_joint_estimate_does_not_mix_with_single_ones(path):
    write_estimates(path, identify(LOG, GTM, ["ls"]))
    with pytest.raises(StoreError, match="estimates of ls run by run"):
        write_estimates(path, identify(LOG, GTM, ["ls"], joint=True))


def test_another_aircraft_is_refused_whatever_the_method(path):
    write_estimates(path, identify(LOG, GTM, ["ls"]))
    heavy = identify(LOG, replace(GTM, mass_kg=30.0), ["iv-f1"])
    with pytest.raises(StoreError, match=r"another aircraft \(mass_kg 26\.195 in the file, 30 now\)"):
        write_estimates(path, heavy)
    write_estimates(path, heavy, force=True)
    assert set(read_table(path)["method"]) == {"iv-f1"}


def test_files_without_settings_or_of_another_kind(result, path):
    write_table(path, identify(LOG, GTM, ["ls"]).to_frame())
    with pytest.raises(StoreError, match="estimates of ls without a record of their options"):
        write_estimates(path, result)
    write_estimates(path, identify(LOG, GTM, ["iv-f1"]))
    assert len(read_table(path)) == 6
    write_table(path, pd.DataFrame({"run_id": ["a"]}))
    with pytest.raises(StoreError, match="is not a file of estimates"):
        write_estimates(path, result)
    path.write_bytes(b"notes")
    with pytest.raises(StoreError, match="is not a Parquet file"):
        write_estimates(path, result)
    write_estimates(path, result, force=True)
    pd.testing.assert_frame_equal(read_table(path), result.to_frame())


def test_the_rows_in_parts_are_those_of_the_frame(result, monkeypatch):
    monkeypatch.setattr("airtruth.identification.result.RUNS_PER_FRAME", 2)
    parts = list(result.frames())
    assert [len(part) for part in parts] == [4, 2]
    pd.testing.assert_frame_equal(pd.concat(parts, ignore_index=True), result.to_frame())


def test_the_summary_is_that_of_the_rows(result):
    assert as_text(overview_of(lambda: [result.estimates])) == as_text(overview(result.to_frame()))
