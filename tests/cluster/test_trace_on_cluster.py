"""Traces and loops on a cluster of two local processes: the files are those of this machine."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from airtruth import aircraft as planes
from airtruth.api.trace_sets import FAILED, trace_sets
from airtruth.api.trace_tasks import Ended, TraceTask, attempted_on, perform
from airtruth.cluster import connected
from airtruth.errors import ConfigurationError, StoreError
from airtruth.logs.store import read_log, write_log
from airtruth.tracing import TraceOptions

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("cluster")]
ROOT = Path(__file__).resolve().parents[2]
OPTIONS = TraceOptions(model="linear", effects=("elevator_delay",))


@pytest.fixture(scope="module")
def cluster():
    with connected("local:2") as own:
        yield own


@pytest.fixture(scope="module")
def declared():
    return planes.load(ROOT / "aircraft" / "gtm")


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """Two logs of two records."""
    folder = tmp_path_factory.mktemp("logs")
    for name in ("a", "b"):
        log = read_log(ROOT / "data" / "undeclared" / f"{name}.parquet")
        write_log(folder / f"{name}.parquet", log.select(log.run_ids[:2]))
    return folder


def contents(folder):
    return {p.relative_to(folder): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


@pytest.mark.long
@pytest.mark.parametrize("methods", [None, ("ls",)], ids=["trace", "loop"])
def test_the_files_are_those_of_this_machine(methods, cluster, declared, logs, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copy(logs / "a.parquet", tmp_path / "a.parquet")
    task = TraceTask((Path("a.parquet"),), declared, OPTIONS, Path("out"), methods=methods)
    summary = perform(task)
    Path("out").rename("here")
    ((same, ended),) = attempted_on(cluster, [task])
    assert same == task
    assert (ended.summary, ended.error) == (summary, None)
    assert contents(Path("out")) == contents(Path("here"))


def test_an_error_of_the_task_is_the_callers(cluster, declared, tmp_path):
    task = TraceTask((tmp_path / "none.parquet",), declared, OPTIONS, tmp_path / "out")
    ((_, ended),) = attempted_on(cluster, [task])
    assert isinstance(ended.error, StoreError)
    assert "none.parquet: no such file" in str(ended.error)


class OtherDisk:
    """Workers that finish, and whose files are elsewhere."""

    def completed(self, function, items):
        for item in items:
            yield item, Ended("done")


def test_files_that_do_not_appear_are_named(declared, logs, tmp_path):
    task = TraceTask((logs / "a.parquet",), declared, OPTIONS, tmp_path / "out")
    ((_, ended),) = attempted_on(OtherDisk(), [task])
    assert "trace.json: a worker of the cluster has written this file, which does not appear" in str(
        ended.error
    )


@pytest.mark.long
def test_sets_are_traced_by_themselves_and_once(cluster, declared, logs, tmp_path):
    sets = [logs / "a.parquet", logs / "b.parquet", tmp_path / "none.parquet"]
    seen = []
    result = trace_sets(
        sets, declared, OPTIONS, tmp_path, cluster=cluster, advance=lambda *step: seen.append(step)
    )
    assert [s.name for s in result.sets] == ["a", "b", "none"]
    assert [s.answer is None for s in result.sets] == [False, False, True]
    assert "none.parquet: no such file" in result.failed[0].error
    assert result.verdicts[FAILED] == 1
    assert seen[0] == (0, 3, 0)
    assert seen[-1] == (3, 3, 1)
    assert result.to_frame()["set"].tolist() == ["a", "b", "none"]
    assert set(result.to_dict()) == {"a", "b", "none"}
    assert "3 sets of records traced: 1 failed" in result.summary()
    assert "none.parquet: no such file" in (tmp_path / "traces.csv").read_text()

    times = {p: p.stat().st_mtime_ns for p in tmp_path.glob("?/trace.json")}
    again = trace_sets(sets[:2], declared, OPTIONS, tmp_path)
    assert again.sets == result.sets[:2]
    assert times == {p: p.stat().st_mtime_ns for p in tmp_path.glob("?/trace.json")}
    other = trace_sets(sets[:1], declared, replace(OPTIONS, seed=1), tmp_path)
    assert other.sets[0].answer is not None
    assert times[tmp_path / "a" / "trace.json"] < (tmp_path / "a" / "trace.json").stat().st_mtime_ns


def test_two_sets_of_one_name_are_refused(declared, logs, tmp_path):
    with pytest.raises(ConfigurationError, match="have the same name 'a', which names their folder"):
        trace_sets([logs / "a.parquet", tmp_path / "a.parquet"], declared, OPTIONS, tmp_path)
