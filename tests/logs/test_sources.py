"""Logs given as files, folders, logs in memory, or several of these."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from airtruth.errors import ConfigurationError, LogError, StoreError
from airtruth.logs import manifest
from airtruth.logs.flight_log import FlightLog
from airtruth.logs.sources import IN_MEMORY, named_logs, sources
from airtruth.logs.store import write_log


@pytest.fixture
def folder(log: FlightLog, tmp_path: Path) -> Path:
    (tmp_path / "logs").mkdir()
    for name in ("b", "a"):
        write_log(tmp_path / "logs" / f"{name}.parquet", log.select(name), dtype="float64")
    return tmp_path


def test_each_form_resolves_to_files_or_logs(log: FlightLog, folder: Path) -> None:
    files = (folder / "logs" / "a.parquet", folder / "logs" / "b.parquet")
    assert sources(folder) == sources(str(folder)) == files
    assert sources(files[1]) == files[1:]
    assert sources([log, files[0]]) == (log, files[0])
    assert sources(log) == (log,)


@pytest.mark.parametrize(
    ("given", "error", "message"),
    [
        ([], ConfigurationError, "none is given"),
        ([3], ConfigurationError, "int is not a log; give a file"),
        (None, ConfigurationError, "NoneType is not a log"),
        (
            pd.DataFrame(),
            ConfigurationError,
            "DataFrame is not a log; .*; write the frame with its method to_parquet",
        ),
        ("absent", StoreError, "no such file or folder"),
        ("", StoreError, "the path is empty"),
    ],
)
def test_other_things_are_refused(given: object, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        sources(given)


def test_logs_are_read_one_by_one_with_their_names(log: FlightLog, folder: Path) -> None:
    read = list(named_logs([folder, log.select("c")]))
    assert [name for name, _ in read] == [*(str(path) for path in sources(folder)), IN_MEMORY]
    assert [one.run_ids for _, one in read] == [("a",), ("b",), ("c",)]
    np.testing.assert_array_equal(read[1][1].channels["q_rad_s"], log.channels["q_rad_s"][30:70])


def test_runs_and_channels_are_chosen_over_all_logs(log: FlightLog, folder: Path) -> None:
    read = list(named_logs([folder, log.select("c")], ["q_rad_s"], ["c", "a"]))
    assert [one.run_ids for _, one in read] == [("a",), ("c",)]
    assert all(list(one.channels) == ["q_rad_s"] for _, one in read)
    with pytest.raises(LogError, match="no run 'd' in the logs given"):
        list(named_logs(folder, run_ids=["a", "d"]))


def test_a_run_in_two_logs_is_refused(log: FlightLog, folder: Path) -> None:
    with pytest.raises(LogError, match=r"run 'a' is in .*a\.parquet and in log in memory"):
        list(named_logs([folder, replace(log, metadata={})]))


def test_a_campaign_without_a_recorded_log_is_refused(tmp_path):
    """The logs that are left can be given themselves."""
    (tmp_path / "logs").mkdir()
    for number in range(3):
        (tmp_path / "logs" / f"0000{number}.parquet").touch()
    files = {f"logs/0000{number}.parquet": "0" * 64 for number in range(3)}
    manifest.append(tmp_path / manifest.MANIFEST, manifest.sealed({"files": files}))
    assert len(sources(tmp_path)) == 3
    (tmp_path / "logs" / "00001.parquet").unlink()
    with pytest.raises(
        StoreError, match=r"00001\.parquet: recorded in manifest\.jsonl and missing; .* give .*logs to use"
    ):
        sources(tmp_path)
    assert len(sources(tmp_path / "logs")) == 2
