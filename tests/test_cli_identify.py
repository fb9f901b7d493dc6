"""identify and tables as a user runs them: contracts, truth kept apart, errors."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from airtruth import aircraft
from airtruth.errors import LogError
from airtruth.identification import identify, identify_joint
from airtruth.logs.flight_log import batches
from airtruth.logs.store import log_paths, read_log
from airtruth.simulation.campaign import plan
from airtruth.simulation.campaign import run as campaign

ROOT = Path(__file__).resolve().parents[1]
NAMES = ("CLalpha", "CLq", "CLde", "Cmalpha", "Cmq", "Cmde", "wn_rad_s", "zeta")


def run(*arguments, folder=ROOT):
    command = [sys.executable, "-m", "airtruth", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False, cwd=folder)


pytestmark = pytest.mark.xdist_group("cli-identify")


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    out = tmp_path_factory.mktemp("flown") / "light"
    campaign.fly(plan.make(ROOT / "data" / "campaigns" / "light.toml", runs=40), out)
    return out


@pytest.mark.slow
def test_identify_writes_contract_2(flown, tmp_path):
    out = tmp_path / "estimates.parquet"
    done = run("identify", flown, "--aircraft", "gtm", "--method", "ls", "--method", "iv-f1", "--out", out)
    assert done.returncode == 0, done.stderr
    assert "iv-f1" in done.stdout
    table = pd.read_parquet(out)
    assert list(table.columns[:4]) == ["run_id", "method", "converged", "iterations"]
    assert set(table["method"]) == {"ls", "iv-f1"}
    assert table.groupby("method").size().eq(40).all()
    for name in NAMES:
        assert {name, f"{name}_std", f"{name}_lower", f"{name}_upper"} <= set(table.columns)
        assert (table[f"{name}_lower"] < table[name]).all()
        assert (table[name] < table[f"{name}_upper"]).all()


@pytest.mark.slow
def test_json_on_stdout_is_the_table(flown):
    done = run(
        "identify", flown / "logs" / "00000.parquet", "--aircraft", ROOT / "aircraft" / "gtm", "--json"
    )
    rows = json.loads(done.stdout)
    assert {row["method"] for row in rows} == {"iv-f1"}
    assert rows[0]["run_id"] == "light-000000"


@pytest.mark.slow
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_json_on_a_full_stdout_is_one_message(flown):
    log = flown / "logs" / "00000.parquet"
    command = [sys.executable, "-m", "airtruth", "identify", log, "--aircraft", "gtm", "--json"]
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False, cwd=ROOT)
    assert done.returncode == 2
    assert done.stderr.startswith("airtruth: standard output: not written; the disk is full")
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.slow
def test_identify_never_reads_what_tells_the_truth(flown, tmp_path):
    """Poison every file beside the logs: the bytes that identify writes do not change."""
    clean, poisoned = tmp_path / "clean", tmp_path / "poisoned"
    shutil.copytree(flown, clean)
    shutil.copytree(flown, poisoned)
    for name in ("truth.parquet", "plan.parquet", "campaign.json", "manifest.jsonl"):
        (poisoned / name).write_bytes(b"poison")
    outputs = []
    for folder in (clean, poisoned):
        done = run("identify", folder, "--aircraft", "gtm", "--method", "ls", "--method", "iv-lowpass")
        assert done.returncode == 0, done.stderr
        outputs.append((folder / "estimates.parquet").read_bytes())
    assert outputs[0] == outputs[1]


@pytest.mark.slow
def test_files_and_folders_and_chunks_give_the_same_estimates(flown):
    gtm = aircraft.load("gtm")
    whole = identify(flown, gtm, ["iv-f1"]).to_frame()
    by_file = identify(list(reversed(log_paths(flown))), gtm, ["iv-f1"]).to_frame()
    merged = whole.merge(by_file, on="run_id", suffixes=("", "_again"))
    assert len(merged) == 40
    for name in NAMES:
        np.testing.assert_array_equal(merged[name], merged[f"{name}_again"])


@pytest.mark.slow
def test_joint_over_files_is_the_joint_of_all_runs(flown):
    gtm = aircraft.load("gtm")
    table = identify(flown, gtm, ["iv-lowpass"], joint=True).to_frame()
    parts = [batch for path in log_paths(flown) for batch in batches(read_log(path))]
    np.testing.assert_array_equal(
        table.loc[0, list(NAMES[:6])].to_numpy(dtype=float), identify_joint(parts, gtm, "iv-lowpass").theta[0]
    )


def test_a_run_in_two_files_is_refused(flown, tmp_path):
    copy = tmp_path / "copy.parquet"
    shutil.copy(log_paths(flown)[0], copy)
    with pytest.raises(LogError, match=r"run 'light-000000' is in .*00000.parquet and in .*copy.parquet"):
        identify([log_paths(flown)[0], copy], aircraft.load("gtm"), ["ls"])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--aircraft", "gtm", "--method", "iv-f3"), "iv-f1"),
        (("--aircraft", "gtn"), "did you mean 'gtm'"),
        (("--aircraft", "gtm", "--trim", "means"), "intercept"),
    ],
)
def test_wrong_names_are_told_with_the_allowed_ones(flown, arguments, message):
    done = run("identify", flown, *arguments)
    assert done.returncode == 2
    assert message in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.slow
def test_tables_stand_beside_the_published_figures(flown, tmp_path):
    run("identify", flown, "--aircraft", "gtm", "--method", "ls", "--method", "iv-lowpass")
    done = run("tables", flown, "--out", tmp_path / "tables")
    assert done.returncode == 0, done.stderr
    assert "published" in done.stdout
    assert {p.suffix for p in (tmp_path / "tables").glob("[!.]*")} == {".md", ".csv", ".tex"}


@pytest.mark.slow
def test_tables_of_an_unidentified_campaign_name_the_command(flown, tmp_path):
    copy = tmp_path / "light"
    shutil.copytree(flown, copy, ignore=shutil.ignore_patterns("estimates.parquet"))
    done = run("tables", copy, "--out", tmp_path / "tables")
    assert done.returncode == 2
    assert "airtruth identify" in done.stderr
