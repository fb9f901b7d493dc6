"""A campaign's files depend on the campaign alone: not on processes, order or length."""

import json

import numpy as np
import pandas as pd
import pytest
from fly_campaigns import command, fly, read, results, write

from airtruth.fly import campaign, plan
from airtruth.fly.chunk import Pilot

MIXED = {
    "runs": 7,
    "condition": {"eas_kt": {"low": 70.0, "high": 80.0}, "altitude_ft": {"mean": 5000.0, "std": 300.0}},
    "gust": {"level": "moderate", "factor": {"choose": [0.5, 1.0]}, "rotary": True},
    "manoeuvre": [
        {"kind": "doublet", "amplitude_deg": {"low": 1.0, "high": 2.0}, "start_s": 0.5, "step_s": 0.25},
        {"kind": "pulse", "amplitude_deg": -1.0, "start_s": 0.5, "step_s": 0.25},
    ],
}


@pytest.fixture(scope="module")
def once(tmp_path_factory):
    return fly(tmp_path_factory.mktemp("once"), **MIXED)


def test_two_processes_write_the_bytes_of_one(once, tmp_path):
    assert results(fly(tmp_path, jobs=2, **MIXED)) == results(once)


def test_manifest_holds_each_run_once_whatever_the_order(once, tmp_path):
    def lines(out):
        return sorted((out / "manifest.jsonl").read_text().splitlines())

    two = fly(tmp_path, jobs=2, **MIXED)
    assert lines(two) == lines(once)
    assert [json.loads(line)["run_id"] for line in lines(once)] == [f"small-{k:06d}" for k in range(7)]


def test_chunks_flown_backwards_by_one_pilot_are_the_same(once, tmp_path):
    pilot = Pilot(plan.make(write(tmp_path / "campaign.toml", **MIXED)))
    logs, truths = tmp_path / "logs", tmp_path / "truths"
    logs.mkdir()
    truths.mkdir()
    for chunk in reversed(range(7)):
        pilot.fly_chunk(chunk, logs, truths)
    for path in sorted((once / "logs").iterdir()):
        assert (logs / path.name).read_bytes() == path.read_bytes()


def test_a_longer_campaign_begins_with_the_runs_of_a_shorter_one(once, tmp_path):
    """40 runs fly in chunks of two, 7 in chunks of one: other files, the same samples."""
    longer = read(fly(tmp_path, **MIXED | {"runs": 40}))
    shorter = read(once)
    pd.testing.assert_frame_equal(longer.iloc[: len(shorter)], shorter, check_exact=True)


def test_runs_and_seeds_differ(once, tmp_path):
    gusts = read(once).pivot(columns="run_id", index="t_s", values="alpha_rad").to_numpy()
    assert np.unique(gusts, axis=1).shape[1] == 7
    assert not np.array_equal(
        read(fly(tmp_path, **MIXED | {"seed": 4}))["alpha_rad"], read(once)["alpha_rad"]
    )


def test_a_finished_campaign_is_left_alone(once):
    before = results(once)
    summary = campaign.fly(plan.make(once.parent / "campaign.toml"), once)
    assert (summary.runs, summary.flown_now) == (7, 0)
    assert results(once) == before


def test_seed_and_runs_of_the_command_line_replace_those_of_the_file(once, tmp_path):
    file = write(tmp_path / "campaign.toml", **MIXED | {"seed": 99, "runs": 1})
    ended = command("fly", file, "--out", tmp_path / "out", "--jobs", 1, "--seed", 3, "--runs", 7)
    assert ended.code == 0
    assert results(tmp_path / "out") == results(once)


def test_plan_holds_every_draw_before_anything_flies(tmp_path):
    made = plan.make(write(tmp_path / "campaign.toml", **MIXED)).table
    assert made["eas_m_s"].nunique() == 7
    assert set(made["manoeuvre"]) == {0, 1}
    np.testing.assert_array_equal(made.loc[made["manoeuvre"] == 1, "amplitude_rad"], np.deg2rad(-1.0))
    assert made.equals(plan.make(tmp_path / "campaign.toml").table)
