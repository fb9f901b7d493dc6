"""A campaign in an object store: the bytes of a local one, kills, leases, and the sentence of each failure."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import store_users as iam
from campaigns import contents, everything, wait_for_records
from commands import running
from conftest_stores import Server, use

from airtruth.errors import ConfigurationError, StoreError
from airtruth.logs import lease
from airtruth.logs.lease import leased
from airtruth.logs.remote import location
from airtruth.logs.verify import verify
from airtruth.simulation.campaign import plan
from airtruth.simulation.campaign.run import fly

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("stores")]


def command(*arguments: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "airtruth", *map(str, arguments)], capture_output=True, text=True, check=False
    )


@pytest.mark.long
def test_a_killed_and_resumed_campaign_has_the_bytes_of_a_local_one(
    bucket: str, campaign: Path, local: Path
) -> None:
    out = location(f"{bucket}/results")
    for records in (1, 4):
        with running("fly", campaign, "--out", out / "light", "--jobs", 1) as process:
            wait_for_records(out / "light", process, records)
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
    everything(campaign, out)
    assert contents(out) == contents(local)
    assert [f.file for f in verify(out / "light").findings] == ["estimates.parquet"]  # of no command


def test_damage_in_a_store_is_named_and_repaired(bucket: str, campaign: Path, local: Path) -> None:
    out = location(f"{bucket}/light")
    for name, content in contents(local / "light").items():
        if name != "estimates.parquet":
            (out / name).upload(content)
    (out / "logs" / "00002.parquet").upload(b"damaged")
    (out / "logs" / "00003.parquet").unlink()
    (out / "stray").upload(b"1")
    states = {f.file: f.state for f in verify(out).findings}
    assert states == {"logs/00002.parquet": "damaged", "logs/00003.parquet": "missing", "stray": "extra"}
    (out / "stray").unlink()
    assert fly(plan.make(campaign), out).flown_now == 2
    assert verify(out).intact


@pytest.mark.long
def test_the_commands_take_urls(bucket: str, campaign: Path, local: Path) -> None:
    url = f"{bucket}/by command"
    flown = command("fly", campaign, "--out", url, "--runs", 8, "--jobs", 1, "--quiet")
    assert (flown.returncode, flown.stderr) == (0, "")
    assert flown.stdout == f"8 runs in {url} (8 flown now, 0 failed)\n"
    for arguments in (
        ("identify", url, "--aircraft", "gtm", "--method", "ls", "--quiet"),
        ("tables", url, "--out", f"{url}/tables", "--quiet"),
        ("report", url, "--out", f"{url}/report.html", "--quiet"),
        ("verify", url),
        ("verify", f"{url}/tables"),
    ):
        ended = command(*arguments)
        assert (ended.returncode, ended.stderr) == (0, ""), arguments
    assert location(f"{url}/report.html").read_bytes().startswith(b"<!doctype html>")
    again = command("identify", url, "--aircraft", "gtm", "--method", "ls", "--out", f"{url}/truth.parquet")
    assert again.returncode == 2
    assert f"{url}/truth.parquet: exists and was not written by airtruth" in again.stderr
    traced = command("trace", url, "--aircraft", "gtm", "--out", f"{url}/trace")
    assert traced.returncode == 2
    assert "choose a local --out and copy it" in traced.stderr


def test_one_process_flies_into_a_folder(bucket: str, campaign: Path) -> None:
    out = location(f"{bucket}/light")
    with leased(out):
        with pytest.raises(
            ConfigurationError, match=r"another process is flying this campaign \(.*, process "
        ):
            fly(plan.make(campaign, runs=2), out)
        assert len(list((out / lease.LEASES).iterdir())) == 1
    assert fly(plan.make(campaign, runs=2), out).flown_now == 2
    assert list((out / lease.LEASES).iterdir()) == []


def test_a_lease_of_another_machine_ends_after_its_expiry(
    bucket: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = location(f"{bucket}/light")
    other = {"host": "elsewhere", "process": 1, "started": 1}
    (out / lease.LEASES / "other.json").upload(json.dumps(other).encode())
    with pytest.raises(ConfigurationError, match=r"\(elsewhere, process 1\)"), leased(out):
        pass
    monkeypatch.setattr(lease, "EXPIRY_S", 1.0)
    time.sleep(2.1)  # a store notes whole seconds
    with leased(out):
        assert not (out / lease.LEASES / "other.json").exists()


def test_a_lease_is_renewed_and_its_loss_is_noticed(bucket: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lease, "RENEWAL_S", 0.2)
    out = location(f"{bucket}/light")
    with leased(out) as held:
        (key,) = (out / lease.LEASES).iterdir()
        first = key.modified_s()
        assert first is not None
        end = time.monotonic() + 10.0
        while key.modified_s() == first:
            assert time.monotonic() < end
            time.sleep(0.1)
        held.require()
        key.unlink()
        with pytest.raises(StoreError, match="another one has taken the campaign over"):
            held.require()


def test_a_lease_of_a_process_that_was_killed_does_not_wait(bucket: str) -> None:
    out = location(f"{bucket}/light")
    code = (
        "import os, sys; from airtruth.logs.remote import location; from airtruth.logs.lease import leased\n"
        "with leased(location(sys.argv[1])): os.kill(os.getpid(), 9)"
    )
    assert subprocess.run([sys.executable, "-c", code, str(out)], check=False).returncode == -9
    assert len(list((out / lease.LEASES).iterdir())) == 1
    with leased(out):
        assert len(list((out / lease.LEASES).iterdir())) == 1


def test_no_such_bucket_is_one_sentence(bucket: str, campaign: Path) -> None:
    for arguments in (
        ("fly", campaign, "--out", f"{bucket}-none/x"),
        ("tables", "nowhere", "--out", f"{bucket}-none/x"),
    ):
        ended = command(*arguments)
        assert (ended.returncode, ended.stdout, ended.stderr.count("\n")) == (2, "", 1)
    flown = command("fly", campaign, "--out", f"{bucket}-none/x")
    assert flown.stderr == (
        f"airtruth: {bucket}-none/x: there is no bucket {bucket[5:] + '-none'!r}; create it and run the same command "
        "again, or choose another\n"
    )


@pytest.mark.long
def test_a_store_without_write_permission_is_one_sentence_and_resumes(
    campaign: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    server = Server(tmp_path, free_requests=iam.REQUESTS)
    try:
        reader, writer = iam.users(server.address, "shared")
        use(server, monkeypatch, *reader)
        refused = command("fly", campaign, "--out", "s3://shared/x", "--runs", 2, "--jobs", 1)
        assert (refused.returncode, refused.stdout, refused.stderr.count("\n")) == (2, "", 1)
        assert "the store denies permission; give credentials that may" in refused.stderr
        use(server, monkeypatch, "nobody", "nothing")
        unknown = command("fly", campaign, "--out", "s3://shared/x", "--runs", 2, "--jobs", 1)
        assert (unknown.returncode, unknown.stderr.count("\n")) == (2, 1)
        use(server, monkeypatch, *writer)
        flown = command("fly", campaign, "--out", "s3://shared/x", "--runs", 2, "--jobs", 1)
        assert (flown.returncode, flown.stderr) == (0, "")
    finally:
        server.close()


def test_a_bucket_that_vanishes_is_one_sentence_and_resumes(
    bucket: str, campaign: Path, local: Path, s3_server: Server
) -> None:
    out = location(f"{bucket}/light")
    with running("fly", campaign, "--out", out, "--jobs", 1) as process:
        wait_for_records(out, process, 3)
        for key in location(bucket).files():
            key.unlink(missing_ok=True)
        for key in location(bucket).files():  # what the flight wrote meanwhile
            key.unlink(missing_ok=True)
        deleted = _delete_bucket(s3_server, bucket)
        printed, said = process.communicate(timeout=60)
    assert deleted
    assert (process.returncode, printed) == (2, "")
    assert said.count("airtruth: ") == 1
    s3_server.request("PUT", bucket[5:])
    fly(plan.make(campaign), out)
    flown = {
        n: c for n, c in contents(local / "light").items() if n not in ("estimates.parquet", ".airtruth.json")
    }
    assert contents(out) == flown


def _delete_bucket(server: Server, bucket: str) -> bool:
    """Delete a bucket into which a flight still writes: a key may appear between."""
    for _ in range(50):
        for key in location(bucket).files():
            key.unlink(missing_ok=True)
        for key in location(bucket).rglob("*"):
            key.rmdir()
        with contextlib.suppress(OSError):
            server.request("DELETE", bucket[5:])
            return True
    return False
