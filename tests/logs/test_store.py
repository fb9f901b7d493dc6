"""The Parquet store: round trips, formats, selective reading, and failure that leaves nothing behind."""

from __future__ import annotations

import errno
import json
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from decimal import Decimal
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from airtruth.channels import LATERAL, SIGNALS
from airtruth.errors import LogError, StoreError
from airtruth.logs import atomic, store
from airtruth.logs.flight_log import FlightLog
from airtruth.logs.tables import readable
from airtruth.logs.validate import validate


def test_float64_round_trip_is_exact(log: FlightLog, tmp_path: Path) -> None:
    path = tmp_path / "log.parquet"
    store.write_log(path, log, dtype="float64", runs_per_group=2)
    back = store.read_log(path)
    assert back.metadata == {"schema": 1, **log.metadata}
    assert back.run_ids == log.run_ids
    np.testing.assert_array_equal(back.offsets, log.offsets)
    np.testing.assert_array_equal(back.t_s, log.t_s)
    assert list(back.channels) == list(log.channels)
    for name, values in log.channels.items():
        np.testing.assert_array_equal(back.channels[name], values)
        assert back.channels[name].dtype == np.float64
        assert back.channels[name].flags.c_contiguous
    validate(back)


def test_default_is_float32_but_for_time(log: FlightLog, tmp_path: Path) -> None:
    path = tmp_path / "log.parquet"
    store.write_log(path, log)
    back = store.read_log(path)
    np.testing.assert_array_equal(back.t_s, log.t_s)
    for name, values in log.channels.items():
        np.testing.assert_array_equal(back.channels[name], values.astype(np.float32).astype(np.float64))


def test_format(log: FlightLog, tmp_path: Path) -> None:
    """Contract: zstd, dictionary on run_id only, byte-stream split of floats, units, one JSON."""
    path = tmp_path / "log.parquet"
    store.write_log(path, log, runs_per_group=2)
    schema, meta = pq.read_schema(path), pq.read_metadata(path)
    assert schema.names == ["run_id", "t_s", *SIGNALS]
    assert schema.field("t_s").type == pa.float64()
    assert schema.field("alpha_rad").type == pa.float32()
    assert {n: schema.field(n).metadata[b"unit"].decode() for n in SIGNALS} == {
        n: s.unit for n, s in SIGNALS.items()
    }
    document = json.loads(schema.metadata[b"airtruth"])
    assert document["schema"] == 1
    assert document["note"] == {"unknown": ["kept", 1.5]}
    assert meta.num_row_groups == 2
    assert meta.row_group(0).num_rows == 70  # whole runs
    for group in range(meta.num_row_groups):
        for index in range(meta.num_columns):
            column = meta.row_group(group).column(index)
            assert column.compression == "ZSTD"
            encodings = set(column.encodings)
            if column.path_in_schema == "run_id":
                assert encodings & {"RLE_DICTIONARY", "PLAIN_DICTIONARY"}
            else:
                assert "BYTE_STREAM_SPLIT" in encodings
                assert not encodings & {"RLE_DICTIONARY", "PLAIN_DICTIONARY"}
    frame = pd.read_parquet(path)  # readable without airtruth
    assert frame["run_id"].astype(str).tolist() == ["a"] * 30 + ["b"] * 40 + ["c"] * 30


def test_runs_are_sorted_by_name(log: FlightLog, tmp_path: Path) -> None:
    path = tmp_path / "log.parquet"
    store.write_log(path, replace(log, run_ids=("z", "b", "a")), dtype="float64")
    back = store.read_log(path)
    assert back.run_ids == ("a", "b", "z")
    np.testing.assert_array_equal(back.offsets, [0, 30, 70, 100])
    np.testing.assert_array_equal(back.channels["q_rad_s"][back.rows(2)], log.channels["q_rad_s"][:30])


def test_selected_columns_and_runs(log: FlightLog, tmp_path: Path) -> None:
    path = tmp_path / "log.parquet"
    for per_group in (1, 2, 3):
        store.write_log(path, log, dtype="float64", runs_per_group=per_group)
        some = store.read_log(path, columns=["q_rad_s", "alpha_rad"], run_ids=["c", "a"])
        assert list(some.channels) == ["q_rad_s", "alpha_rad"]
        assert some.run_ids == ("a", "c")
        np.testing.assert_array_equal(some.offsets, [0, 30, 60])
        q = log.channels["q_rad_s"]
        np.testing.assert_array_equal(some.channels["q_rad_s"], np.concatenate([q[:30], q[70:]]))
        np.testing.assert_array_equal(some.t_s[30:], log.t_s[70:])
    assert store.read_log(path, run_ids=[]).run_ids == ()
    with pytest.raises(LogError, match=r"no run 'bb'; did you mean 'b'\? the log holds 3 runs, 'a' to 'c'"):
        store.read_log(path, run_ids=["bb"])
    with pytest.raises(LogError, match=r"no channel 'alpha'; did you mean 'alpha_rad'"):
        store.read_log(path, columns=["alpha"])


def write_foreign(path: Path, **columns: object) -> Path:
    pq.write_table(pa.table(columns), path)
    return path


def test_foreign_logs(tmp_path: Path) -> None:
    """Written by other tools: plain strings, nulls, integers, small row groups, no metadata, more columns."""
    path = tmp_path / "foreign.parquet"
    table = pa.table(
        {
            "run_id": pa.array(["x"] * 4 + ["y"] * 3, type=pa.large_string()),
            "t_s": pa.array([0, 1, 2, 3, 0, 1, 2], type=pa.float32()),
            "alpha_rad": pa.array([0.1, None, 0.3, 0.4, 0.5, 0.6, 0.7]),
            "throttle": pa.array([0, 1, 0, 1, 0, 1, 0]),
            "my_own": pa.array(np.arange(7.0)),
            "counter": pa.array(range(7)),
            "comment": pa.array(["-"] * 7),
        }
    )
    pq.write_table(table, path, row_group_size=3)
    log = store.read_log(path)
    assert log.metadata == {}
    assert log.run_ids == ("x", "y")
    assert list(log.channels) == ["alpha_rad", "throttle", "my_own"]
    np.testing.assert_array_equal(log.offsets, [0, 4, 7])
    np.testing.assert_array_equal(log.channels["alpha_rad"], [0.1, np.nan, 0.3, 0.4, 0.5, 0.6, 0.7])
    np.testing.assert_array_equal(
        store.read_log(path, columns=["counter"]).channels["counter"], np.arange(7.0)
    )
    np.testing.assert_array_equal(store.read_log(path, run_ids=["y"]).t_s, [0, 1, 2])
    with pytest.raises(LogError, match=r"channel 'comment' is string, not numeric"):
        store.read_log(path, columns=["comment"])


def test_a_run_in_two_places_shows(tmp_path: Path) -> None:
    path = write_foreign(tmp_path / "two.parquet", run_id=["x", "y", "x"], t_s=[0.0, 0.0, 1.0])
    assert store.read_log(path).run_ids == ("x", "y", "x")


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        (
            {"time": [0.0], "aoa": [0.1]},
            r"not a flight log, it has no column run_id nor t_s \(columns: time, aoa\)",
        ),
        ({"run_id": [1], "t_s": [0.0]}, "run_id is int64, not a string; write the names of the runs"),
        (
            {"run_id": ["a", None], "t_s": [0.0, 1.0]},
            "run_id is empty in 1 row, the first is row 1; name the run",
        ),
        (
            {"run_id": ["a"], "t_s": ["0"]},
            "t_s is string, not a floating-point time in seconds; write the seconds",
        ),
        (
            {"run_id": ["a"], "t_s": [0.0], "alpha_rad": ["0.1"]},
            r"channel 'alpha_rad' is string, not numeric; write it as float64 \[rad\], or leave it out",
        ),
        ({"run_id": ["a"], "t_s": [0.0], "throttle": [True]}, "channel 'throttle' is bool, not numeric"),
        ({"run_id": pa.array([], pa.string()), "t_s": pa.array([], pa.float64())}, "the log has no rows"),
    ],
)
def test_what_is_not_a_log_is_named(tmp_path: Path, columns: dict[str, object], message: str) -> None:
    path = write_foreign(tmp_path / "odd.parquet", **columns)
    with pytest.raises(LogError, match=r"odd\.parquet: .*" + message):
        store.read_log(path)


@pytest.mark.parametrize(
    ("document", "message"),
    [
        (b"{", "malformed"),
        (b"[1]", "not an object"),
        (b'{"schema": 2}', "log schema 2, but this version reads schema 1; use a newer airtruth"),
        (b'{"schema": "1"}', "log schema '1', but .* schema 1; state schema 1, a number"),
    ],
)
def test_bad_metadata(tmp_path: Path, document: bytes, message: str) -> None:
    path = tmp_path / "odd.parquet"
    table = pa.table({"run_id": ["a"], "t_s": [0.0]}).replace_schema_metadata({b"airtruth": document})
    pq.write_table(table, path)
    with pytest.raises(LogError, match=message):
        store.read_log(path)


def test_truncated_and_damaged_files(log: FlightLog, tmp_path: Path) -> None:
    path = tmp_path / "log.parquet"
    store.write_log(path, log)
    whole = path.read_bytes()
    for content in (
        whole[: len(whole) // 2],
        whole[:-3],
        b"",
        b"run_id,t_s\n",
        b"PAR1" + b"\0" * 100 + b"PAR1",
    ):
        path.write_bytes(content)
        with pytest.raises(
            StoreError, match=r"log\.parquet: is not a Parquet file, or is truncated or damaged"
        ):
            store.read_log(path)
    flipped = bytearray(whole)
    flipped[len(whole) // 3] ^= 0x10  # inside a page: its checksum tells
    path.write_bytes(flipped)
    with pytest.raises(StoreError, match="truncated or damaged"):
        store.read_log(path)
    with pytest.raises(StoreError, match="no such file"):
        store.read_log(tmp_path / "absent.parquet")


def test_a_column_that_occurs_twice_is_named(tmp_path: Path) -> None:
    path = tmp_path / "odd.parquet"
    columns = [pa.array(["a"]), pa.array([0.0]), pa.array([1.0]), pa.array([2.0])]
    pq.write_table(pa.Table.from_arrays(columns, names=["run_id", "t_s", "q_rad_s", "q_rad_s"]), path)
    with pytest.raises(StoreError, match=r"odd\.parquet: column 'q_rad_s' occurs more than once"):
        store.read_log(path)


@pytest.mark.parametrize("read", [store.read_log, store.read_table])
def test_a_column_name_that_is_not_utf8_is_an_error(tmp_path: Path, read: Callable[[Path], object]) -> None:
    path = tmp_path / "odd.parquet"
    table = pa.table({"run_id": ["a"], "t_s": [0.0], "zzzz": [1.0]})
    pq.write_table(table, path, store_schema=False)
    path.write_bytes(path.read_bytes().replace(b"zzzz", b"\xff\xfezz"))
    with pytest.raises(StoreError, match=r"odd\.parquet: a column name or text is not UTF-8"):
        read(path)


@pytest.mark.parametrize(
    "metadata",
    [b"{", b"[]", b'{"columns": 3}', b'{"index_columns": [], "columns": [{"name": 7}]}', b"\xff"],
)
def test_damaged_pandas_metadata_are_an_error_or_ignored(tmp_path: Path, metadata: bytes) -> None:
    path = tmp_path / "odd.parquet"
    pq.write_table(pa.table({"x": [1.0]}).replace_schema_metadata({b"pandas": metadata}), path)
    with pytest.raises(StoreError, match=r"odd\.parquet: (the pandas metadata|a column name or text)"):
        store.read_table(path)


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (OSError(errno.EMFILE, "Too many open files"), "too many files are open: raise the limit"),
        (
            pa.ArrowException("Failed to launch worker thread: busy"),
            "no thread can be started: raise the limits",
        ),
        (pa.ArrowException(""), r"truncated or damaged \(ArrowException\)"),
    ],
)
def test_limits_of_the_system_are_no_damage(tmp_path: Path, error: Exception, words: str) -> None:
    with pytest.raises(StoreError, match=rf"log\.parquet: .*{words}"), readable(tmp_path / "log.parquet"):
        raise error


def test_a_name_that_is_not_utf8(log: FlightLog, tmp_path: Path) -> None:
    path = tmp_path / "gr\udcf6\udcdfe.parquet"
    store.write_log(tmp_path / "log.parquet", log)
    (tmp_path / "log.parquet").rename(path)
    assert store.read_log(path).run_ids == log.run_ids
    assert store.read_metadata(path)["aircraft"] == "gtm"


@pytest.mark.parametrize(("read", "runs"), [("read_log", None), ("read_log", ["a"]), ("read_table", None)])
def test_more_rows_than_memory_are_refused_before_they_are_read(
    log: FlightLog, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, read: str, runs: list[str] | None
) -> None:
    store.write_log(tmp_path / "log.parquet", log)
    monkeypatch.setattr("airtruth.logs.tables.BYTES_PER_VALUE", 1e14)
    with pytest.raises(
        StoreError, match=r"log\.parquet: declares \d+ rows, which need .* GB .*; write it again"
    ):
        getattr(store, read)(tmp_path / "log.parquet", None, *([runs] if runs else []))


def test_places(log: FlightLog, tmp_path: Path) -> None:
    logs = tmp_path / "campaign" / "logs"
    logs.mkdir(parents=True)
    for name in ("b", "a"):
        store.write_log(logs / f"{name}.parquet", replace(log, metadata={"name": name}))
    for name in store.CAMPAIGN_TABLES:
        (tmp_path / "campaign" / name).write_bytes(b"poison")
        (logs / name).write_bytes(b"poison")
    (logs / ".a.parquet.0123.tmp").write_bytes(b"torn")
    for place in (tmp_path / "campaign", logs):
        assert store.log_paths(place) == [logs / "a.parquet", logs / "b.parquet"]
        assert [one.metadata["name"] for one in store.iter_logs(place, columns=["q_rad_s"])] == ["a", "b"]
    assert store.log_paths(logs / "a.parquet") == [logs / "a.parquet"]
    with pytest.raises(StoreError, match="no such file or folder"):
        store.log_paths(tmp_path / "absent")
    with pytest.raises(
        StoreError, match=r"holds no flight log .*; `airtruth fly` or `airtruth import` writes them"
    ):
        store.log_paths(tmp_path)
    (tmp_path / "parts" / "run_id=a").mkdir(parents=True)
    store.write_log(tmp_path / "parts" / "run_id=a" / "0.parquet", log)
    with pytest.raises(
        StoreError, match=r"run_id=a/0\.parquet lies in a folder below it: give that folder, or write"
    ):
        store.log_paths(tmp_path / "parts")


def test_tables(tmp_path: Path) -> None:
    path = tmp_path / "estimates.parquet"
    frame = pd.DataFrame(
        {"run_id": ["a", "b"], "converged": [True, False], "CLalpha": [4.79, np.nan]}, index=[5, 9]
    )
    store.write_table(path, frame, metadata={"method": "ls"})
    pd.testing.assert_frame_equal(store.read_table(path), frame.reset_index(drop=True))
    assert list(store.read_table(path, ["CLalpha", "run_id"]).columns) == ["CLalpha", "run_id"]
    assert store.read_metadata(path) == {"method": "ls"}
    store.write_table(path, pa.table({"x": [1, 2]}))
    assert store.read_metadata(path) == {}
    assert store.read_table(path)["x"].tolist() == [1, 2]
    with pytest.raises(StoreError, match=r"no column 'X'; .*allowed: x"):
        store.read_table(path, ["X"])
    path.write_bytes(b"torn")
    with pytest.raises(StoreError, match="truncated or damaged"):
        store.read_table(path)
    with pytest.raises(StoreError, match="no such file"):
        store.read_metadata(tmp_path / "absent.parquet")


def test_text(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    store.write_text(path, "Größe\n")
    store.write_text(path, "α\n")
    assert path.read_text(encoding="utf-8") == "α\n"
    assert os.listdir(tmp_path) == ["a.csv"]


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EIO])
def test_a_failed_write_keeps_the_old_file(
    log: FlightLog, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: int
) -> None:
    path = tmp_path / "log.parquet"
    store.write_log(path, log)
    before = path.read_bytes()

    def refuse(descriptor: int) -> None:
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(atomic.os, "fsync", refuse)
    with pytest.raises(
        StoreError, match=r"log\.parquet: not written \(the existing file is unchanged\); "
    ) as caught:
        store.write_log(path, replace(log, metadata={}))
    assert {
        errno.ENOSPC: "free some space",
        errno.EDQUOT: "quota",
        errno.EROFS: "read-only",
        errno.EIO: "error",
    }[code] in str(caught.value)
    assert path.read_bytes() == before
    assert os.listdir(tmp_path) == ["log.parquet"]


def test_an_interrupted_write_leaves_nothing(tmp_path: Path) -> None:
    def interrupted() -> None:
        with atomic.atomic_file(tmp_path / "x") as file:
            file.write(b"half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert os.listdir(tmp_path) == []


def test_impossible_places(log: FlightLog, tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="the folder does not exist: create it"):
        store.write_log(tmp_path / "absent" / "log.parquet", log)
    (tmp_path / "file").write_text("")
    with pytest.raises(StoreError, match="a part of the path is a file"):
        store.write_log(tmp_path / "file" / "log.parquet", log)
    (tmp_path / "folder.parquet").mkdir()
    with pytest.raises(StoreError, match="a folder of that name is in the way"):
        store.write_log(tmp_path / "folder.parquet", log)
    assert sorted(os.listdir(tmp_path)) == ["file", "folder.parquet"]


FULL_DISK = """
import resource, sys
import numpy as np
from airtruth.errors import StoreError
from airtruth.logs import store
from airtruth.logs.flight_log import FlightLog
noise = np.random.default_rng(0).standard_normal(100_000)
log = FlightLog({}, ("a",), np.array([0, 100_000]), np.arange(100_000) / 50, {"alpha_rad": noise})
resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))
try:
    store.write_log(sys.argv[1], log)
except StoreError as error:
    print(error)
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="needs resource limits")
def test_a_real_write_that_runs_out_of_room(tmp_path: Path) -> None:
    path = tmp_path / "log.parquet"
    done = subprocess.run(
        [sys.executable, "-c", FULL_DISK, str(path)], capture_output=True, text=True, check=False, timeout=60
    )
    assert done.stderr == ""
    assert done.stdout.startswith(f"{path}: not written; the file would pass the size limit")
    assert os.listdir(tmp_path) == []


def test_files_are_readable_by_others(log: FlightLog, tmp_path: Path) -> None:
    mask = os.umask(0o022)
    try:
        store.write_log(tmp_path / "log.parquet", log)
    finally:
        os.umask(mask)
    assert (tmp_path / "log.parquet").stat().st_mode & 0o777 == 0o644


def test_decimals_and_views_of_strings_are_read(tmp_path: Path) -> None:
    """Types that databases and data-frame libraries write; a channel without any value is left out."""
    exact = pa.array([Decimal("0.02"), None], pa.decimal128(12, 9))
    path = write_foreign(
        tmp_path / "types.parquet",
        run_id=pa.array(["a", "a"], pa.string_view()),
        t_s=pa.array([Decimal("0.0"), Decimal("0.02")], pa.decimal128(12, 9)),
        alpha_rad=exact,
        throttle=pa.nulls(2),
    )
    back = store.read_log(path)
    assert back.run_ids == ("a",)
    np.testing.assert_array_equal(back.t_s, [0.0, 0.02])
    assert list(back.channels) == ["alpha_rad"]
    np.testing.assert_array_equal(back.channels["alpha_rad"], [0.02, np.nan])


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"offsets": np.array([0, 10, 20])}, "do not divide .* rows into"),
        ({"channels": {"alpha_rad": np.zeros(3)}}, r"alpha_rad: shape \(3,\) where t_s has"),
        ({"metadata": {"mass": float("nan")}}, "the metadata are no JSON"),
        ({"metadata": {"mass": object()}}, "the metadata are no JSON"),
    ],
)
def test_a_log_that_would_not_be_written_as_a_whole_is_refused(log, tmp_path, change, problem):
    with pytest.raises(LogError, match=problem):
        store.write_log(tmp_path / "log.parquet", replace(log, **change))
    assert list(tmp_path.iterdir()) == []


def test_a_log_keeps_the_lateral_channels_and_their_units(log: FlightLog, tmp_path: Path) -> None:
    """Contract 1 lists ten lateral columns; a log may hold all of them or none."""
    assert len(LATERAL) == 10
    assert set(LATERAL) <= set(log.channels)
    store.write_log(tmp_path / "log.parquet", log, dtype="float64")
    read = store.read_log(tmp_path / "log.parquet")
    units = {name: pq.read_schema(tmp_path / "log.parquet").field(name).metadata[b"unit"] for name in LATERAL}
    assert units["ay_m_s2"] == b"m/s2"
    assert units["p_rad_s"] == units["r_rad_s"] == b"rad/s"
    assert {units[n] for n in LATERAL if n.endswith("_rad")} == {b"rad"}
    for name in LATERAL:
        assert np.array_equal(read.channels[name], log.channels[name])
    without = log.select(channels=[n for n in log.channels if n not in LATERAL])
    validate(without)
