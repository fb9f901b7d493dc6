"""Campaigns that are really killed, at several moments, and the same call that finishes them."""

import os
import signal
import subprocess
import sys
import time

import pytest
from commands import running
from fly_campaigns import alive, children, fly, leftovers, results, runs_recorded, write
from tiers import sampled

from airtruth.simulation.campaign import plan
from airtruth.simulation.campaign import run as campaign

pytestmark = pytest.mark.slow

RUNS = 96
LONG = {"runs": RUNS, "duration_s": 5.0}
SHORT = {"runs": 3}

# Dies by SIGKILL just before or just after its n-th rename: each file of a campaign appears by one.
DIES_AT_RENAME = """
import os, signal, sys
number, after, *arguments = sys.argv[1:]
rename, left = os.replace, [int(number)]
def replace(*paths):
    left[0] -= 1
    if left[0] == 0:
        if after == "after":
            rename(*paths)
        os.kill(os.getpid(), signal.SIGKILL)
    rename(*paths)
os.replace = replace
sys.argv = ["airtruth", *arguments]
from airtruth.cli import main
main()
"""


@pytest.fixture(scope="module")
def short(tmp_path_factory):
    return results(fly(tmp_path_factory.mktemp("short"), **SHORT))


@pytest.fixture(scope="module")
def long(tmp_path_factory):
    return results(fly(tmp_path_factory.mktemp("long"), **LONG))


def resume(folder):
    """The same call again, in this process."""
    return campaign.fly(plan.make(folder / "campaign.toml"), folder / "out")


# Renames: campaign.json 1, plan 2, manifest 3; workers rename the chunks; truth.parquet 4, manifest 5.
@pytest.mark.parametrize(
    "moment",
    [
        pytest.param((1, "before"), marks=pytest.mark.study),
        (1, "after"),
        (2, "before"),
        pytest.param((2, "after"), marks=pytest.mark.study),
        (3, "before"),
        (3, "after"),
        (4, "before"),
        pytest.param((4, "after"), marks=pytest.mark.study),
        (5, "before"),
        pytest.param((5, "after"), marks=pytest.mark.study),
    ],
)
def test_killed_at_a_rename(short, tmp_path, moment):
    file, out = write(tmp_path / "campaign.toml", **SHORT), tmp_path / "out"
    arguments = ["fly", file, "--out", out, "--jobs", "1"]
    ended = subprocess.run(
        [sys.executable, "-c", DIES_AT_RENAME, *map(str, (*moment, *arguments))], check=False
    )
    assert ended.returncode == -signal.SIGKILL
    resume(tmp_path)
    assert results(out) == short


def flying(folder, jobs=2):
    """The command that flies `LONG`."""
    file = write(folder / "campaign.toml", **LONG)
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # of a shell's background jobs, and inherited
        signal.signal(signal.SIGINT, signal.default_int_handler)
    return running("fly", file, "--out", folder / "out", "--jobs", jobs, "--quiet")


def wait_until(condition, process=None, patience_s=60.0):
    end = time.monotonic() + patience_s
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        assert process is None or process.poll() is None, "it ended before it could be killed"
        time.sleep(0.001)


def done(folder):
    return len(runs_recorded(folder / "out"))


@pytest.mark.parametrize("share", sampled([None, 0.0, 0.3, 0.8], 4))
def test_killed_with_all_its_processes(long, tmp_path, share):
    """None: as soon as the folder exists; else once this share of the runs is recorded."""
    with flying(tmp_path) as process:
        reached = (tmp_path / "out").exists if share is None else lambda: done(tmp_path) > share * RUNS
        wait_until(reached, process)
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    assert done(tmp_path) < RUNS
    summary = resume(tmp_path)
    assert summary.runs == RUNS
    assert results(tmp_path / "out") == long


def test_workers_die_with_their_parent_and_leave_nothing(long, tmp_path):
    with flying(tmp_path) as process:
        wait_until(lambda: done(tmp_path) > 0, process)
        workers = children(process.pid)
        assert len(workers) == 2
        process.kill()
        process.wait()
        resume(tmp_path)  # at once, while the orphans may still write
        wait_until(lambda: not any(map(alive, workers)), patience_s=20.0)
    assert not leftovers(tmp_path / "out")
    assert results(tmp_path / "out") == long


def test_a_killed_worker_costs_no_run(long, tmp_path):
    with flying(tmp_path) as process:
        wait_until(lambda: done(tmp_path) > 0, process)
        os.kill(children(process.pid)[0], signal.SIGKILL)
        out, err = process.communicate(timeout=120)
    assert (process.returncode, err) == (0, "")
    assert f"{RUNS} runs" in out
    assert results(tmp_path / "out") == long


@pytest.mark.parametrize("jobs", sampled([1, 2], 2))
def test_ctrl_c_exits_130_says_so_and_resumes(long, tmp_path, jobs):
    with flying(tmp_path, jobs) as process:
        wait_until(lambda: done(tmp_path) > 0, process)
        workers = children(process.pid)
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to every process
        _, err = process.communicate(timeout=60)
        assert process.returncode == 130
        assert "Traceback" not in err
        wait_until(lambda: not any(map(alive, workers)))
    assert 0 < done(tmp_path) < RUNS
    resume(tmp_path)
    assert results(tmp_path / "out") == long
    assert "interrupted; the same command resumes" in err


def test_a_second_command_in_the_same_folder_is_refused(tmp_path):
    with flying(tmp_path) as process:
        wait_until(lambda: done(tmp_path) > 0, process)
        os.kill(process.pid, signal.SIGSTOP)
        with pytest.raises(
            Exception, match="another process is flying this campaign; wait for it or stop it"
        ):
            resume(tmp_path)
