"""A campaign's files depend on the campaign alone: not on processes, order or length."""

import hashlib
import json
import shutil

import numpy as np
import pytest
from fly_campaigns import command, fly, read, results, write
from hypothesis import given
from hypothesis import strategies as st

from airtruth.channels import PITCH_PLANE
from airtruth.simulation.campaign import plan, streams
from airtruth.simulation.campaign import run as campaign
from airtruth.simulation.campaign.air import air_of
from airtruth.simulation.campaign.chunk import Pilot
from airtruth.simulation.campaign.numbering import chunk_numbers
from airtruth.simulation.campaign.workers import orders_of

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


@pytest.mark.slow
def test_two_processes_write_the_bytes_of_one(once, tmp_path):
    assert results(fly(tmp_path, jobs=2, **MIXED)) == results(once)


@pytest.mark.slow
def test_manifest_holds_a_line_for_each_chunk_and_the_digest_of_every_file(once):
    records = [json.loads(line) for line in (once / "manifest.jsonl").read_text().splitlines()]
    assert len(records) == 1 + 7 + 1
    assert [(r["chunk"], r["runs"]) for r in records if "chunk" in r] == [(k, 1) for k in range(7)]
    digests = {name: digest for r in records for name, digest in r.get("files", {}).items()}
    files = {p.relative_to(once).as_posix(): p for p in once.rglob("*") if p.is_file()}
    assert set(files) == {*digests, "manifest.jsonl", ".lock"}
    assert digests == {n: hashlib.sha256(files[n].read_bytes()).hexdigest() for n in digests}


def test_chunks_flown_backwards_by_one_pilot_are_the_same(once, tmp_path):
    planned = plan.make(write(tmp_path / "campaign.toml", **MIXED))
    pilot = Pilot(planned)
    logs, truths = tmp_path / "logs", tmp_path / "truths"
    logs.mkdir()
    truths.mkdir()
    for order in reversed(list(orders_of(planned, range(7)))):
        pilot.fly_chunk(order, logs, truths)
    paths = sorted((once / "logs").iterdir())
    assert paths
    for path in paths:
        assert (logs / path.name).read_bytes() == path.read_bytes()


@pytest.mark.long
@pytest.mark.slow
def test_a_campaign_grows_to_the_files_of_a_longer_one(once, tmp_path):
    """Seven runs grow to 20, whose last chunk has two, then to 25, where a chunk of 20 is flown whole."""
    out = tmp_path / "out"
    shutil.copytree(once, out)
    for runs, flown in ((17, 10), (20, 4), (25, 5)):
        file = write(tmp_path / "campaign.toml", **MIXED | {"runs": runs})
        ended = command("fly", file, "--out", out, "--jobs", 2)  # a slow machine shows its progress on stderr
        assert (ended.code, ended.out) == (0, f"{runs} runs in {out} ({flown} flown now, 0 failed)\n")
    assert results(out) == results(fly(tmp_path / "whole", **MIXED | {"runs": 25}))
    assert {n: c for n, c in results(out).items() if n in results(once) and n.startswith("logs")} == {
        n: c for n, c in results(once).items() if n.startswith("logs")
    }


@pytest.mark.slow
def test_a_campaign_does_not_shrink(once, tmp_path):
    before = results(once)
    file = write(tmp_path / "campaign.toml", **MIXED)
    ended = command("fly", file, "--out", once, "--runs", 6)
    assert ended.code == 2
    assert "holds 7 runs of this campaign, more than the 6 asked for, and a campaign only grows" in ended.err
    assert "give --runs 7 or more, or choose another --out" in ended.err
    assert results(once) == before


@given(st.integers(1, 5000), st.integers(1, 5000))
def test_the_chunk_of_a_run_depends_on_its_number_alone(one, other):
    fewer, more = chunk_numbers(min(one, other)), chunk_numbers(max(one, other))
    np.testing.assert_array_equal(more[: len(fewer)], fewer)
    assert (np.bincount(more) <= 100).all()
    assert (np.diff(more, prepend=0) <= 1).all()


@pytest.mark.slow
def test_runs_and_seeds_differ(once, tmp_path):
    gusts = read(once).pivot(columns="run_id", index="t_s", values="alpha_rad").to_numpy()
    assert np.unique(gusts, axis=1).shape[1] == 7
    assert not np.array_equal(
        read(fly(tmp_path, **MIXED | {"seed": 4}))["alpha_rad"], read(once)["alpha_rad"]
    )


@pytest.mark.slow
def test_a_finished_campaign_is_left_alone(once):
    before = results(once)
    summary = campaign.fly(plan.make(once.parent / "campaign.toml"), once)
    assert (summary.runs, summary.flown_now) == (7, 0)
    assert results(once) == before


@pytest.mark.slow
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


def test_draws_and_gusts_of_a_pitch_plane_campaign_are_those_of_earlier_versions(tmp_path):
    """Numbers that the version without lateral motion wrote: a new quantity or channel must not move an existing stream."""
    doublet = {"kind": "doublet", "amplitude_deg": {"low": 1.0, "high": 2.0}, "start_s": 0.5, "step_s": 0.25}
    file = write(
        tmp_path / "campaign.toml",
        runs=5,
        duration_s=3.0,
        condition={"eas_kt": {"low": 70.0, "high": 80.0}, "altitude_ft": {"mean": 5000.0, "std": 300.0}},
        gust={"level": "moderate", "factor": {"choose": [0.5, 1.0]}, "rotary": True},
        manoeuvre=[doublet, doublet | {"amplitude_deg": 1.0}],
    )
    made = plan.make(file)
    expected = {
        "eas_m_s": [38.31714901644626, 40.29033866663662, 36.31841354398453],
        "altitude_m": [1652.3657753088871, 1386.2580306134578, 1473.7156220956638],
        "amplitude_rad": [0.02823186200194506, 0.017453292519943295, 0.02899502768425677],
        "sigma_u_m_s": [2.1499519834592156, 2.049417734715226, 2.082458799591732],
        "length_w_m": [669.770628298329, 575.4073203714529, 606.4202758381341],
    }
    for name, values in expected.items():
        np.testing.assert_allclose(made.table[name][:3], values, rtol=1e-14)
    air = air_of(made, plan.planned_runs(made.table)[1], 42.0)
    found = [air.u_m_s[100], air.w_m_s[100], air.rotation_rad_s["q_rad_s"][100]]
    np.testing.assert_allclose(
        found, [-0.4378579444731933, -0.06596919047123283, -0.01491144717817038], rtol=1e-10
    )
    numbers = dict(zip(PITCH_PLANE, range(1, 12), strict=True))
    assert {name: streams.SENSORS[name] for name in PITCH_PLANE} == numbers
