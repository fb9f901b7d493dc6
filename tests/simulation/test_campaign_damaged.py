"""Damaged files of a finished campaign: `verify` names each, and the same command restores it."""

import hashlib
import random
import shutil
from pathlib import Path

import pytest
from fly_campaigns import command, fly, results, write

from airtruth.logs.verify import DAMAGED, EXTRA, MISSING, verify
from airtruth.simulation.campaign import plan
from airtruth.simulation.campaign import run as campaign
from validation.robustness.damages import damage_trial, flip

RUNS = 18  # the last chunk has two
DAMAGE_TRIALS = 5  # one of each kind; `make robustness` has 150


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return fly(tmp_path_factory.mktemp("whole"), runs=RUNS)


def damaged(whole: Path, tmp_path: Path) -> Path:
    out = tmp_path / "out"
    shutil.copytree(whole, out)
    return out


@pytest.mark.slow
def test_an_intact_campaign(whole):
    result = verify(whole)
    assert result.intact
    assert result.checked == len(results(whole)) - 1
    ended = command("verify", whole)
    assert (ended.code, ended.err) == (0, "")
    assert ended.out == f"{whole}: {result.checked} files checked, 0 damaged, 0 missing, 0 extra\n"


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(DAMAGE_TRIALS))
def test_random_damage_is_named_and_restored(whole, tmp_path, seed):
    planned = plan.make(write(tmp_path / "campaign.toml", runs=RUNS))
    assert damage_trial(whole, planned, tmp_path / "out", seed)[2] == ""


@pytest.mark.slow
def test_the_command_line_names_and_restores(whole, tmp_path):
    out = damaged(whole, tmp_path)
    flip(out / "logs" / "00004.parquet", random.Random(1))
    ended = command("verify", out)
    assert (ended.code, "damaged  logs/00004.parquet: its SHA-256 is not the recorded one" in ended.out) == (
        1,
        True,
    )
    ended = command("fly", write(tmp_path / "campaign.toml", runs=RUNS), "--out", out, "--jobs", 1)
    assert (ended.code, ended.out) == (0, f"{RUNS} runs in {out} (1 flown now, 0 failed)\n")
    assert (
        ended.err
        == f"airtruth: {out}/logs/00004.parquet: its SHA-256 is not that of the manifest; restored\n"
    )
    assert results(out) == results(whole)


@pytest.mark.slow
def test_states_and_extra_files(whole, tmp_path):
    out = damaged(whole, tmp_path)
    (out / "logs" / "00001.parquet").unlink()
    (out / "logs" / "00002.parquet").write_bytes(b"")
    (out / "logs" / "00099.parquet").write_bytes(b"")
    (out / "notes.txt").write_text("mine")
    states = {f.file: f.state for f in verify(out).findings}
    assert states == {
        "logs/00001.parquet": MISSING,
        "logs/00002.parquet": DAMAGED,
        "logs/00099.parquet": EXTRA,
        "notes.txt": EXTRA,
    }
    assert verify(out).to_frame()["state"].tolist() == list(states.values())
    assert len(verify(out).to_dict()["findings"]) == 4
    assert "1 damaged, 1 missing, 2 extra" in verify(out).summary()


@pytest.mark.slow
def test_a_resume_restores_what_is_damaged_and_flies_no_other_run(whole, tmp_path):
    out = damaged(whole, tmp_path)
    flip(out / "logs" / "00003.parquet", random.Random(1))
    flip(out / "plan.parquet", random.Random(2))
    result = campaign.fly(plan.make(write(tmp_path / "campaign.toml", runs=RUNS)), out)
    assert result.flown_now == 1
    assert result.repaired == (
        "plan.parquet: its SHA-256 is not that of the manifest",
        "logs/00003.parquet: its SHA-256 is not that of the manifest",
    )
    assert results(out) == results(whole)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["campaign.json", "manifest.jsonl"])
def test_one_of_the_two_files_that_identify_a_campaign_is_enough(whole, tmp_path, name):
    out = damaged(whole, tmp_path)
    (out / name).unlink()
    result = campaign.fly(plan.make(write(tmp_path / "campaign.toml", runs=RUNS)), out)
    assert result.flown_now == (0 if name == "campaign.json" else RUNS)
    assert result.repaired[0].startswith(f"{name}: ")
    assert results(out) == results(whole)


def test_verify_of_other_folders(tmp_path):
    for folder, words in (
        (tmp_path, "holds neither manifest.jsonl nor .airtruth.json"),
        (tmp_path / "x", "is not a folder"),
    ):
        ended = command("verify", folder)
        assert (ended.code, words in ended.err) == (2, True)


@pytest.mark.slow
def test_a_parent_of_campaigns(whole, tmp_path):
    """Each manifest belongs to its own folder, at any depth."""
    parent = tmp_path / "out"
    folders = [parent / "light", parent / "paper" / "moderate"]
    for folder in folders:
        shutil.copytree(whole, folder)
    result = verify(parent)
    assert (result.findings, result.checked) == ((), 2 * verify(whole).checked)
    (folders[0] / "logs" / "00001.parquet").unlink()
    (folders[1] / "logs" / "00002.parquet").write_bytes(b"")
    (folders[1] / "manifest-parts").mkdir()
    (folders[1] / "manifest-parts" / "0").write_bytes(b"")
    (folders[1] / "notes.txt").write_text("mine")
    states = {f.file: f.state for f in verify(parent).findings}
    assert states == {
        "light/logs/00001.parquet": MISSING,
        "paper/moderate/logs/00002.parquet": DAMAGED,
        "paper/moderate/notes.txt": EXTRA,
    }
    (folders[0] / "manifest.jsonl").unlink()
    assert ("light/manifest.jsonl", MISSING) in [(f.file, f.state) for f in verify(parent).findings]


def test_verify_names_a_manifest_that_is_missing(whole, tmp_path):
    out = damaged(whole, tmp_path)
    (out / "manifest.jsonl").unlink()
    assert [(f.file, f.state) for f in verify(out).findings] == [("manifest.jsonl", MISSING)]


def test_verify_names_what_an_unfinished_campaign_lacks(whole, tmp_path):
    out = damaged(whole, tmp_path)
    lines = (out / "manifest.jsonl").read_bytes().splitlines(keepends=True)
    (out / "manifest.jsonl").write_bytes(b"".join(lines[:-1]))
    states = {f.file: f.state for f in verify(out).findings}
    assert states == {"manifest.jsonl": DAMAGED}
    digest = hashlib.sha256((out / "plan.parquet").read_bytes()).hexdigest()
    assert digest.encode() in lines[0]


@pytest.mark.slow
def test_an_unrecorded_chunk_is_flown_again(whole, tmp_path):
    """The line of the last chunk, of two runs, is missing; its files are whole."""
    out = damaged(whole, tmp_path)
    lines = (out / "manifest.jsonl").read_bytes().splitlines(keepends=True)
    kept = [line for line in lines if b'"logs/00016.parquet"' not in line]
    assert len(kept) == len(lines) - 1
    (out / "manifest.jsonl").write_bytes(b"".join(kept))
    assert [f.file for f in verify(out).findings] == ["manifest.jsonl"]
    result = campaign.fly(plan.make(write(tmp_path / "campaign.toml", runs=RUNS)), out)
    assert (result.flown_now, len(result.repaired)) == (2, 1)
    assert results(out) == results(whole)
