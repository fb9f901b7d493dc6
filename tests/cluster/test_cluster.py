"""A Dask cluster of two processes: results, errors, lost workers, a lost scheduler, and the bytes of a campaign."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import cluster_tasks as tasks
import pytest

from airtruth.cluster import LostWorkError, client, connected
from airtruth.errors import ConfigurationError, LogError, StoreError
from airtruth.identification import identify
from airtruth.logs.verify import verify
from airtruth.simulation.campaign import plan
from airtruth.simulation.campaign.distributed import fly_chunks_on
from airtruth.simulation.campaign.run import fly

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("cluster")]
HERE = Path(__file__).resolve().parent
CAMPAIGN = """
schema = 1
name = "far"
aircraft = "gtm"
runs = 24
seed = 7
duration_s = 3.0
[condition]
eas_kt = 75.0
altitude_ft = 7000.0
[[manoeuvre]]
kind = "doublet"
amplitude_deg = 1.0
[gust]
figures = "gtm"
level = "light"
"""


class Processes:
    """A scheduler and workers as a user starts them."""

    def __init__(self, folder: Path, workers: int) -> None:
        self.file = folder / "scheduler.json"
        path = os.pathsep.join([str(HERE), *os.environ.get("PYTHONPATH", "").split(os.pathsep)])
        self.environment = os.environ | {"PYTHONPATH": path}
        self.folder = folder
        self.scheduler = self._start(
            "scheduler", "--scheduler-file", str(self.file), "--port", "0", "--no-dashboard"
        )
        while not self.file.exists():
            time.sleep(0.05)
        self.workers = [self._start_worker() for _ in range(workers)]

    def _start(self, *arguments: str) -> subprocess.Popen[bytes]:
        return subprocess.Popen(
            [sys.executable, "-m", "dask", *arguments],
            env=self.environment,
            cwd=self.folder,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )

    def _start_worker(self) -> subprocess.Popen[bytes]:
        return self._start("worker", "--scheduler-file", str(self.file), "--nthreads", "1", "--no-dashboard")

    def close(self) -> None:
        for process in (*self.workers, self.scheduler):
            try:
                os.killpg(process.pid, signal.SIGKILL)
            except ProcessLookupError:
                continue
            process.wait()


@pytest.fixture(scope="module")
def processes(tmp_path_factory):
    own = Processes(tmp_path_factory.mktemp("cluster"), 2)
    yield own
    own.close()


@pytest.fixture
def cluster(processes):
    with connected(str(processes.file)) as own:
        yield own


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    file = tmp_path_factory.mktemp("campaign") / "far.toml"
    file.write_text(CAMPAIGN)
    return file


@pytest.fixture(scope="module")
def local(campaign, tmp_path_factory):
    """The campaign flown and identified on this machine."""
    out = tmp_path_factory.mktemp("local") / "out"
    fly(plan.make(campaign), out, jobs=2)
    return out, identify(out, "gtm", ["ls", "iv-f1"]).to_frame()


def contents(folder: Path) -> dict[str, bytes]:
    """Every file except the manifest, whose lines are in the order of completion."""
    return {
        str(p.relative_to(folder)): p.read_bytes()
        for p in sorted(folder.rglob("*"))
        if p.is_file() and p.name != "manifest.jsonl"
    }


def test_every_item_comes_back_with_its_result(cluster):
    assert dict(cluster.completed(tasks.double, range(30))) == {i: 2 * i for i in range(30)}


def test_an_error_of_the_function_is_the_callers(cluster):
    with pytest.raises(LogError, match="number 3 contradicts physics"):
        dict(cluster.completed(tasks.refuse, range(6)))
    assert dict(cluster.completed(tasks.double, [1])) == {1: 2}


def test_a_task_whose_worker_dies_is_done_by_another(cluster, tmp_path):
    marker = str(tmp_path / "marker")
    assert dict(cluster.completed(tasks.die_once, [marker])) == {marker: "returned"}


def test_a_task_that_ends_every_worker_is_reported(cluster):
    ((item, result),) = cluster.completed(tasks.die, [7])
    assert item == 7
    assert isinstance(result, LostWorkError)


def test_a_campaign_has_the_bytes_of_this_machine(cluster, campaign, local, tmp_path):
    flown, estimates = local
    result = fly(plan.make(campaign), tmp_path / "out", cluster=cluster)
    assert result.flown_now == 24
    assert contents(tmp_path / "out") == contents(flown)
    assert verify(tmp_path / "out").intact
    far = identify(tmp_path / "out", "gtm", ["ls", "iv-f1"], cluster=cluster).to_frame()
    assert far.equals(estimates)


@pytest.mark.long
def test_a_campaign_survives_dying_workers(campaign, local, tmp_path):
    """A nanny process starts each worker again; one of them is killed every three seconds, six times."""
    own = Processes(tmp_path, 2)
    killer = subprocess.Popen(
        [sys.executable, str(HERE / "kill_workers.py"), *(str(w.pid) for w in own.workers)]
    )
    try:
        with connected(str(own.file)) as cluster:
            fly(plan.make(campaign), tmp_path / "out", cluster=cluster)
            while not all(o.status == "ok" for o in fly(plan.make(campaign), tmp_path / "out").outcomes):
                continue
    finally:
        killer.kill()
        killer.wait()
        own.close()
    assert contents(tmp_path / "out") == contents(local[0])


@pytest.mark.long
def test_a_lost_scheduler_is_one_sentence_and_the_command_continues(campaign, local, tmp_path):
    own = Processes(tmp_path, 2)
    done = []

    def advance(count, total, failed):
        done.append(count)
        if count >= 5 and own.scheduler.poll() is None:
            os.killpg(own.scheduler.pid, signal.SIGKILL)

    try:
        with (
            pytest.raises(
                StoreError, match=r"connection to the scheduler was lost.*the same command continues"
            ),
            connected(str(own.file)) as cluster,
        ):
            fly(plan.make(campaign), tmp_path / "out", advance=advance, cluster=cluster)
    finally:
        own.close()
    assert 5 <= done[-1] < 24
    assert fly(plan.make(campaign), tmp_path / "out").flown_now == 24 - done[-1]
    assert contents(tmp_path / "out") == contents(local[0])


def test_other_versions_are_refused(processes, monkeypatch):
    monkeypatch.setattr(client, "AGREEING", (*client.AGREEING, "pytest"))  # the workers do not state it
    with (
        pytest.raises(
            ConfigurationError, match=r"worker .* has pytest None, this machine .*; install the same"
        ),
        connected(str(processes.file)),
    ):
        pass


def test_other_versions_are_one_sentence(campaign, tmp_path):
    """Of a package that Dask itself compares and warns of."""
    facts = tmp_path / "other" / "numpy-9.9.0.dist-info"
    facts.mkdir(parents=True)
    (facts / "METADATA").write_text("Metadata-Version: 2.1\nName: numpy\nVersion: 9.9.0\n")
    own = Processes(tmp_path, 0)
    path = os.pathsep.join([str(facts.parent), own.environment["PYTHONPATH"]])
    own.environment = own.environment | {"PYTHONPATH": path}
    own.workers.append(own._start_worker())
    try:
        command = [sys.executable, "-m", "airtruth", "fly", campaign, "--out", tmp_path / "out"]
        ended = subprocess.run(
            [*command, "--cluster", own.file], capture_output=True, text=True, check=False, timeout=120
        )
    finally:
        own.close()
    assert (ended.returncode, ended.stdout, ended.stderr.count("\n")) == (2, "", 1)
    assert "has numpy 9.9.0, this machine" in ended.stderr


def test_two_clusters_on_one_machine():
    """Dask warns of a port of its pages that is taken; the tests turn warnings into errors."""
    with client.connected("local:1"), client.connected("local:1"):
        pass


def test_a_scheduler_without_workers(tmp_path, monkeypatch):
    monkeypatch.setattr(client, "WORKERS_S", 1.0)
    own = Processes(tmp_path, 0)
    try:
        with (
            pytest.raises(
                ConfigurationError, match=r"no worker after 1 s; start one with `dask worker tcp://"
            ),
            connected(str(own.file)),
        ):
            pass
    finally:
        own.close()


def test_workers_that_do_not_see_the_folder(cluster, campaign, tmp_path):
    hidden = tmp_path / "out"
    with pytest.raises(StoreError, match="does not see this folder; use one that all machines share"):
        list(fly_chunks_on(cluster, plan.make(campaign), [0], hidden / "logs", hidden / "parts"))
