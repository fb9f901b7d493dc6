"""An identification whose estimates are in a temporary file: the bytes, notes and tables of one in memory."""

import errno
from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest

from airtruth.errors import LogError, StoreError
from airtruth.identification import Options, identified, identify, json_of, spool, store, write_estimates
from airtruth.identification.charts import intervals_chart
from airtruth.identification.doubts import doubts
from airtruth.identification.spool import Spool
from airtruth.identification.tables import overview_of
from airtruth.logs import tables
from airtruth.logs.owners import Owners
from airtruth.logs.store import read_log, read_table, write_log
from airtruth.table import as_text
from validation.linear_flight import GTM, as_log, fly

LOG = as_log(fly(runs=7, gust=1.0, noise=1.0, seed=72))
METHODS = ("ls", "iv-f1")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Four logs of up to two runs."""
    out = tmp_path_factory.mktemp("logs")
    for k in range(0, 7, 2):
        write_log(out / f"{k}.parquet", LOG.select(run_ids=LOG.run_ids[k : k + 2]), dtype="float64")
    return out


@pytest.fixture(scope="module")
def whole(folder):
    return identify(folder, GTM, METHODS)


@pytest.mark.parametrize("runs", [1, 3, 100])
def test_the_file_has_the_bytes_of_an_identification_in_memory(folder, whole, runs, tmp_path, monkeypatch):
    monkeypatch.setattr(spool, "RUNS_PER_PART", runs)
    monkeypatch.setattr(tables, "ROWS_PER_GROUP", 5)
    write_estimates(tmp_path / "memory.parquet", whole)
    with identified(folder, GTM, METHODS, folder=tmp_path) as result:
        assert list(tmp_path.iterdir()) == [tmp_path / "memory.parquet"]  # the temporary file has no name
        write_estimates(tmp_path / "parts.parquet", result)
        assert result.summary() == whole.summary()
        assert (result.notes, result.sources, result.methods) == (whole.notes, whole.sources, whole.methods)
        assert result.to_frame().equals(whole.to_frame())
        text = whole.to_frame().to_json(orient="records", indent=1) + "\n"
        assert "".join(json_of(result.frames())) == "".join(json_of(whole.frames())) == text
    assert (tmp_path / "parts.parquet").read_bytes() == (tmp_path / "memory.parquet").read_bytes()


@pytest.mark.grid
@pytest.mark.parametrize("options", [Options(), Options(tolerance=0.02)], ids=["kept", "replaced"])
def test_a_merge_in_parts_has_the_bytes_of_a_merge_of_all_rows(folder, whole, options, tmp_path, monkeypatch):
    """Into a file of two methods: one of them again, and a third; row groups of five rows, parts of one log."""
    monkeypatch.setattr(tables, "ROWS_PER_GROUP", 5)
    monkeypatch.setattr(spool, "RUNS_PER_PART", 1)
    paths = [tmp_path / "parts.parquet", tmp_path / "whole.parquet"]
    merged = store._merged
    for path in paths:
        write_estimates(path, whole)
        with identified(folder, GTM, ("iv-f1", "iv-lowpass"), options) as result:
            monkeypatch.setattr(store, "_merged", merged if path is paths[0] else _refused)
            write_estimates(path, result, force=True)
    assert paths[0].read_bytes() == paths[1].read_bytes()
    rows = read_table(paths[0])
    assert list(rows["method"]) == (["ls", "iv-f1", "iv-lowpass"] * 7)
    assert list(dict.fromkeys(rows["run_id"])) == list(LOG.run_ids)
    for name in ("ls", "iv-f1"):
        assert (
            rows[rows["method"] == name]
            .reset_index(drop=True)
            .equals(identify(folder, GTM, [name], options if name == "iv-f1" else None).to_frame())
        )


def _refused(*arguments):
    raise store._OtherRunsError
    yield


def test_a_merge_of_other_runs_or_columns_holds_all_rows(folder, whole, tmp_path, monkeypatch):
    monkeypatch.setattr(tables, "ROWS_PER_GROUP", 5)
    path = tmp_path / "estimates.parquet"
    write_estimates(path, whole)
    few = sorted(folder.iterdir())[1:3]
    write_estimates(path, identify(few, GTM, ["iv-lowpass"]))
    first = read_table(path)
    assert len(first) == 7 * 2 + 4
    table = pq.read_table(path)
    pq.write_table(table.append_column("remark", [["x"] * len(table)]), path)
    write_estimates(path, identify(folder, GTM, ["iv-lowpass"]))
    rows = read_table(path)
    assert len(rows) == 7 * 3
    assert rows["remark"].isna().sum() == 7


def test_doubts_and_means_of_parts_are_those_of_all_runs(whole):
    """Of runs without estimates, with wrong signs, with open parameters, and of methods that contradict each other."""
    ls, iv = whole.estimates
    theta, covariance = ls.theta.copy(), ls.covariance.copy()
    theta[1] = np.nan
    theta[3:, 3] = np.abs(theta[3:, 3])
    theta[:, 1] += 200.0
    covariance[2:, 1, 1] = 40.0**2
    covariance[5, 0, 0] = -1.0
    estimates = (replace(ls, theta=theta, covariance=covariance), iv)

    def parts():
        return [[e.rows(first, first + 2) for e in estimates] for first in range(0, 7, 2)]

    expected = doubts(lambda: [estimates])
    words = ("no estimate", "no frequency", "no intervals", "do not determine", "wrong sign", "contradict")
    assert all(any(word in sentence for sentence in expected) for word in words)
    assert doubts(parts) == expected
    assert as_text(overview_of(parts)) == as_text(overview_of(lambda: [estimates]))


def test_estimates_of_no_run_are_an_empty_chart(whole):
    chart = intervals_chart(whole.to_frame().iloc[:0])
    assert chart.title == "Derivatives of 0 runs"
    assert not any(panel.marks for panel in chart.panels)


def test_a_run_that_two_logs_hold_is_refused_in_any_order_of_names(folder):
    files = sorted(folder.iterdir())
    owners = Owners()
    for file in (files[2], files[0], files[3], files[1]):
        owners.add(file, read_log(file, columns=[]).run_ids)
    with pytest.raises(
        LogError, match=r"run 'b0-run-0002' is in .*2\.parquet and in log in memory; give each run once"
    ):
        owners.add(LOG, ("q", LOG.run_ids[2], "z"))
    owners.add(LOG, ("q", "z"))  # a range of names that holds the others, and none of them


@pytest.mark.parametrize(
    ("number", "step"),
    [(errno.ENOSPC, "the disk is full: free some space"), (errno.EROFS, "read-only: choose another folder")],
)
def test_a_folder_that_cannot_be_written_is_one_sentence(whole, tmp_path, number, step):
    class Full:
        def write(self, content):
            raise OSError(number, "words of the system")

        def close(self):
            return

    with Spool(tmp_path) as estimates:
        estimates._file.close()
        estimates._file = Full()
        estimates.add(whole.estimates)
        with pytest.raises(StoreError, match=f"temporary file of the estimates is not written; .*{step}"):
            list(estimates.parts())
    with pytest.raises(
        StoreError, match=r"absent: .*; the folder does not exist: create it or choose another"
    ):
        Spool(tmp_path / "absent")
    (tmp_path / "file").touch()
    with pytest.raises(StoreError, match=r"file: .*; a part of the path is a file, not a folder"):
        Spool(tmp_path / "file")
