"""Runs, folders and files that fail: what is said, what stays, what goes on."""

import subprocess
import sys

import numpy as np
import pandas as pd
import pytest
from fly_campaigns import command, fly, leftovers, read, results, runs_recorded, write
from tiers import sampled

from airtruth.simulation.flight import Flight, Inputs

pytestmark = pytest.mark.slow

# A factor of 1e5 on light gusts is a wind of 100 km/s; of six runs with seed 3, some draw it.
STORMS = {"runs": 6, "gust": {"level": "light", "factor": {"choose": [1.0, 1e5]}}}
# As root a read-only folder is writable, so a full disk is a limit on the size of a file.
LIMITED = """
import resource, sys
limit, *arguments = sys.argv[1:]
resource.setrlimit(resource.RLIMIT_FSIZE, (int(limit), int(limit)))
sys.argv = ["airtruth", *arguments]
from airtruth.cli import main
main()
"""
LARGE = {"runs": 3, "duration_s": 5.0, "log_hz": 200.0}


@pytest.mark.parametrize("jobs", [1, 2])
def test_flights_that_leave_the_range_are_recorded_and_the_others_go_on(tmp_path, jobs):
    file = write(tmp_path / "campaign.toml", **STORMS)
    ended = command("fly", file, "--out", tmp_path / "out", "--jobs", jobs)
    assert ended.code == 1
    plan, truth = (pd.read_parquet(tmp_path / "out" / f"{n}.parquet") for n in ("plan", "truth"))
    stormy = plan.loc[plan["sigma_u_m_s"] > 100.0, "run_id"].tolist()
    assert 0 < len(stormy) < 6
    records = runs_recorded(tmp_path / "out")
    failed = {r["run_id"]: r["reason"] for r in records if r["status"] == "failed"}
    assert sorted(failed) == stormy
    assert all("the flight left the simulation's range at 0.0" in reason for reason in failed.values())
    assert all(f"airtruth: {run} failed: {failed[run]}" in ended.err for run in stormy)
    assert f"6 runs in {tmp_path / 'out'} (6 flown now, {len(stormy)} failed)" in ended.out
    calm = sorted(set(plan["run_id"]) - set(stormy))
    assert sorted(read(tmp_path / "out")["run_id"].unique()) == calm
    assert truth.loc[truth["status"] == "failed", "run_id"].tolist() == stormy
    again = command("fly", file, "--out", tmp_path / "out")
    assert (again.code, "0 flown now" in again.out) == (1, True)


def test_a_failed_run_leaves_no_trace_in_the_next(gtm, paper_trim):
    zero = np.zeros(201)
    calm = Inputs(np.where(np.arange(201) > 50, 0.01, 0.0), zero, zero)
    fresh = Flight(gtm, paper_trim, 1 / 200).fly(calm)
    flight = Flight(gtm, paper_trim, 1 / 200)
    for storm in (np.full(201, 1e200), np.where(np.arange(201) > 60, np.nan, 0.0)):
        with pytest.raises(Exception, match="left the simulation's range"):
            flight.fly(Inputs(zero, storm, zero))
        again = flight.fly(calm)
        assert again.keys() == fresh.keys()
        for name, values in again.items():
            np.testing.assert_array_equal(values, fresh[name], err_msg=name)


def test_runs_that_cannot_be_trimmed_are_recorded(tmp_path):
    condition = {"eas_kt": {"choose": [75.0, 75.0, 75.0, 15.0]}, "altitude_ft": 7000.0}
    file = write(tmp_path / "campaign.toml", runs=12, condition=condition, gust=None)
    ended = command("fly", file, "--out", tmp_path / "out", "--jobs", 1)
    plan = pd.read_parquet(tmp_path / "out" / "plan.parquet")
    slow = plan.loc[plan["eas_m_s"] < 10.0, "run_id"].tolist()
    assert 0 < len(slow) < 6
    assert ended.code == 1
    assert ended.err.count("failed: gtm cannot be trimmed at EAS 15.0 kt") == len(slow)
    assert read(tmp_path / "out")["run_id"].nunique() == 12 - len(slow)


def test_a_campaign_of_failures_alone_ends_with_truth_and_no_log(tmp_path):
    file = write(tmp_path / "campaign.toml", runs=2, gust={"level": "light", "factor": 1e5})
    ended = command("fly", file, "--out", tmp_path / "out", "--jobs", 1)
    assert ended.code == 1
    assert len(pd.read_parquet(tmp_path / "out" / "truth.parquet")) == 2
    assert not list((tmp_path / "out" / "logs").iterdir())


def test_folder_of_another_campaign(tmp_path):
    out = fly(tmp_path, runs=2)
    before = results(out)
    ended = command("fly", write(tmp_path / "other.toml", name="other", runs=2), "--out", out)
    assert ended.code == 2
    assert f"airtruth: {out}: holds another campaign ('small', 2 runs, seed 3; asked for 'other'" in ended.err
    assert "choose another --out" in ended.err
    for option in (("--seed", 8), ("--runs", 1)):
        assert command("fly", tmp_path / "campaign.toml", "--out", out, *option).code == 2
    assert results(out) == before


def test_folder_of_something_else(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "thesis.txt").write_text("precious")
    ended = command("fly", write(tmp_path / "campaign.toml"), "--out", tmp_path / "out")
    assert (ended.code, ended.out) == (2, "")
    assert "is not empty and holds no campaign; choose another --out" in ended.err
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["thesis.txt"]


@pytest.mark.parametrize("place", ["file", "file/below"])
def test_output_that_cannot_be_a_folder(tmp_path, place):
    (tmp_path / "file").write_text("")
    ended = command("fly", write(tmp_path / "campaign.toml"), "--out", tmp_path / place)
    assert ended.code == 2
    assert f"airtruth: {tmp_path / place}" in ended.err


@pytest.mark.parametrize("jobs", sampled([2, 1], 2))
def test_full_disk_is_one_message_and_resumes(tmp_path, jobs):
    whole = results(fly(tmp_path / "whole", **LARGE))
    smallest = min(len(v) for k, v in whole.items() if k.startswith("logs/"))
    assert smallest > len(whole["plan.parquet"]) + 4096
    file, out = write(tmp_path / "campaign.toml", **LARGE), tmp_path / "out"
    arguments = [smallest - 1024, "fly", file, "--out", out, "--jobs", jobs, "--quiet"]
    ended = subprocess.run(
        [sys.executable, "-c", LIMITED, *map(str, arguments)], capture_output=True, text=True, check=False
    )
    assert ended.returncode == 2
    assert ended.stderr.startswith(f"airtruth: {out / 'logs'}/0000")
    assert "not written; the file would pass the size limit" in ended.stderr
    assert ended.stderr.count("\n") == 1
    assert not list(out.rglob("*.tmp"))
    assert command("fly", file, "--out", out).code == 0
    assert results(out) == whole


@pytest.mark.parametrize("damage", ["truncated", "empty", "missing"])
def test_a_damaged_log_is_flown_again(tmp_path, damage):
    out = fly(tmp_path, runs=4)
    before = results(out)
    log = out / "logs" / "00002.parquet"
    content = log.read_bytes()
    log.unlink() if damage == "missing" else log.write_bytes(
        content[: len(content) // 2 if damage == "truncated" else 0]
    )
    ended = command("fly", tmp_path / "campaign.toml", "--out", out, "--jobs", 1)
    assert (ended.code, "(1 flown now, 0 failed)" in ended.out) == (0, True)
    assert results(out) == before


def test_a_missing_truth_is_made_again(tmp_path):
    out = fly(tmp_path, runs=2)
    before = results(out)
    (out / "truth.parquet").unlink()
    assert command("fly", tmp_path / "campaign.toml", "--out", out, "--jobs", 1).code == 0
    assert results(out) == before


@pytest.mark.parametrize("name", ["truth.parquet", "plan.parquet"])
def test_a_truncated_table_beside_the_logs_does_not_pass_for_whole(tmp_path, name):
    """Either it is made again, or the command says which file and ends with 2."""
    out = fly(tmp_path, runs=2)
    before = results(out)
    (out / name).write_bytes(before[name][:1000])
    ended = command("fly", tmp_path / "campaign.toml", "--out", out, "--jobs", 1)
    if ended.code == 0:
        assert results(out) == before
    else:
        assert (ended.code, str(out / name) in ended.err) == (2, True)


@pytest.mark.parametrize(("cut", "flown"), [(20, 0), (300, 1), (10_000, 3)])
def test_a_torn_manifest_costs_the_torn_chunks_alone(tmp_path, cut, flown):
    out = fly(tmp_path, runs=3)
    before = results(out)
    manifest = out / "manifest.jsonl"
    manifest.write_bytes(manifest.read_bytes()[:-cut])
    ended = command("fly", tmp_path / "campaign.toml", "--out", out, "--jobs", 1)
    assert (ended.code, f"({flown} flown now" in ended.out) == (0, True), ended
    assert results(out) == before
    assert not leftovers(out)
