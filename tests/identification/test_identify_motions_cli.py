"""`airtruth identify` on flown campaigns of the lateral and of both motions: files, JSON, options."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from airtruth.physics.motion import LATERAL, LONGITUDINAL
from airtruth.simulation.campaign import plan
from airtruth.simulation.campaign import run as campaign

ROOT = Path(__file__).resolve().parents[2]
pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("cli-identify-motions")]


def run(*arguments):
    """The gate, whose tests of the elevator have tests of their own, is overruled."""
    command = [
        sys.executable,
        "-m",
        "airtruth",
        "identify",
        *map(str, arguments),
        "--aircraft",
        "gtm",
        "--force",
    ]
    return subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT)


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    out = tmp_path_factory.mktemp("flown")
    for name in ("lateral", "combined"):
        campaign.fly(plan.make(ROOT / "data" / "campaigns" / f"{name}.toml", runs=4), out / name)
    return out


def test_a_lateral_campaign_writes_its_own_file(flown):
    done = run(flown / "lateral", "--method", "ls", "--method", "filter-error")
    assert done.returncode == 0, done.stderr
    assert not (flown / "lateral" / "estimates.parquet").exists()
    table = pd.read_parquet(flown / "lateral" / "estimates-lateral.parquet")
    assert table.groupby("method").size().to_dict() == {"ls": 4, "filter-error": 4}
    truth = pd.read_parquet(flown / "lateral" / "truth.parquet")
    for name, share in (("Clbeta", 0.05), ("Clp", 0.05), ("Clda", 0.05), ("Cnbeta", 0.05), ("Cndr", 0.05)):
        np.testing.assert_allclose(table[name], truth[name].iloc[0], rtol=share)


def test_a_combined_campaign_answers_both_motions(flown):
    done = run(flown / "combined", "--method", "ls", "--json", "--quiet")
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    assert list(answer) == ["longitudinal", "lateral"]
    assert [len(rows) for rows in answer.values()] == [4, 4]
    for motion in (LONGITUDINAL, LATERAL):
        assert set(motion.parameters) <= set(answer[motion.name][0])
    assert (flown / "combined" / "estimates.parquet").is_file()
    assert (flown / "combined" / "estimates-lateral.parquet").is_file()
    shown = run(flown / "combined", "--method", "ls", "--quiet").stdout
    assert (
        shown.index("Longitudinal motion")
        < shown.index("CLalpha")
        < shown.index("Lateral-directional motion")
    )


def test_one_motion_is_answered_alone(flown, tmp_path):
    out = tmp_path / "own.parquet"
    done = run(flown / "combined", "--motion", "lateral", "--joint", "--term", "alpha", "--out", out)
    assert done.returncode == 0, done.stderr
    table = pd.read_parquet(out)
    assert table["run_id"].tolist() == ["joint"]
    assert "Cnbeta" in table.columns
    refused = run(flown / "combined", "--motion", "lateral", "--term", "gamma")
    assert refused.returncode != 0
    assert "option terms" in refused.stderr
