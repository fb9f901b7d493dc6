"""Processes that die while they fly: by the run's fault, or killed from outside."""

import os
import signal
import subprocess
import sys

import pytest
from fly_campaigns import command, fly, results, runs_recorded, write
from tiers import sampled

from airtruth.logs.verify import verify

# Python imports this module at its start: a worker then ends itself by a signal while it flies one of the runs.
DYING = """
import os, sys
if "airtruth.simulation.campaign.worker" in sys.orig_argv:
    from airtruth.simulation.campaign.chunk import Pilot
    channels = Pilot.channels
    def dying(self, run):
        if str(run.run) == os.environ["DIES_AT"]:
            os.kill(os.getpid(), int(os.environ["DIES_BY"]))
        return channels(self, run)
    Pilot.channels = dying
"""
RUNS = 18


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return fly(tmp_path_factory.mktemp("whole"), runs=RUNS)


@pytest.fixture
def dies(monkeypatch, tmp_path):
    (tmp_path / "path").mkdir()
    (tmp_path / "path" / "sitecustomize.py").write_text(DYING)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path / "path"), *sys.path]))

    def by(number, run):
        monkeypatch.setenv("DIES_BY", str(int(number)))
        monkeypatch.setenv("DIES_AT", str(run))

    return by


@pytest.mark.slow
@pytest.mark.parametrize("jobs", sampled([2, 1], 2))
def test_a_run_that_ends_its_process_is_one_failed_run(tmp_path, dies, jobs):
    dies(signal.SIGSEGV, 17)  # the second run of the last chunk
    file = write(tmp_path / "campaign.toml", runs=RUNS)
    ended = command("fly", file, "--out", tmp_path / "out", "--jobs", jobs, "--quiet")
    assert ended.code == 1
    assert ended.out == f"18 runs in {tmp_path / 'out'} (18 flown now, 1 failed)\n"
    assert ended.err == "airtruth: small-000017 failed: the flight ends its process each time (SIGSEGV)\n"
    assert [r["run_id"] for r in runs_recorded(tmp_path / "out") if r["status"] == "failed"] == [
        "small-000017"
    ]
    assert verify(tmp_path / "out").intact
    again = command("fly", file, "--out", tmp_path / "out")
    assert (again.code, "0 flown now" in again.out) == (1, True)


@pytest.mark.long
@pytest.mark.slow
def test_a_run_whose_process_is_killed_is_interrupted_and_flown_by_the_next_command(tmp_path, dies, whole):
    file, out = write(tmp_path / "campaign.toml", runs=RUNS), tmp_path / "out"
    dies(signal.SIGKILL, 17)
    for flown in (16, 0):  # however often
        ended = command("fly", file, "--out", out, "--jobs", 1)
        assert (ended.code, ended.out) == (
            1,
            f"18 runs in {out} ({flown} flown now, 0 failed, 2 interrupted)\n",
        )
        assert (
            "small-000016 interrupted: the process that flew this chunk of runs ended 3 times (last: SIGKILL)"
            in ended.err
        )
        states = {r["run_id"]: r["status"] for r in runs_recorded(out)}
        assert [s for s in states.values() if s != "ok"] == ["interrupted"] * 2
    dies(signal.SIGKILL, -1)
    ended = command("fly", file, "--out", out, "--jobs", 1, "--quiet")
    assert (ended.code, ended.out, ended.err) == (0, f"18 runs in {out} (2 flown now, 0 failed)\n", "")
    assert results(out) == results(whole)


@pytest.mark.slow
def test_files_of_the_working_folder_are_not_imported(tmp_path):
    canary = tmp_path / "imported"
    for name in ("json", "pickle", "numpy", "signal", "jsbsim", "threading", "sitecustomize"):
        (tmp_path / f"{name}.py").write_text(f"open({str(canary)!r}, 'w'); raise SystemExit(9)")
    file = write(tmp_path / "campaign.toml", runs=2)
    done = subprocess.run(
        [sys.executable, "-P", "-m", "airtruth", "fly", file, "--out", "out", "--jobs", "2", "--quiet"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert not canary.exists()
