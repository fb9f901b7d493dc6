"""A campaign in Google Cloud Storage, against an emulator: the bytes of a local one, kills, damage, a bucket that is missing."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest
from campaigns import contents, everything, wait_for_records
from commands import running

from airtruth.errors import StoreError
from airtruth.logs.remote import location
from airtruth.logs.verify import verify
from airtruth.simulation.campaign import plan
from airtruth.simulation.campaign.run import fly

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("stores")]


def test_a_killed_campaign_continues_to_the_bytes_of_a_local_one(
    google_bucket: str, campaign: Path, local: Path
) -> None:
    out = location(f"{google_bucket}/results")
    with running("fly", campaign, "--out", out / "light", "--jobs", 1) as process:
        wait_for_records(out / "light", process, 1)
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    everything(campaign, out)
    assert contents(out) == contents(local)
    (out / "light" / "logs" / "00001.parquet").upload(b"damaged")
    (out / "light" / "logs" / "00002.parquet").unlink()
    states = {f.file: f.state for f in verify(out / "light").findings}
    assert states == {
        "estimates.parquet": "extra",  # of no command
        "logs/00001.parquet": "damaged",
        "logs/00002.parquet": "missing",
    }
    assert fly(plan.make(campaign), out / "light").flown_now == 2
    assert contents(out) == contents(local)


def test_a_bucket_that_is_missing_is_one_sentence(google_bucket: str, campaign: Path) -> None:
    with pytest.raises(StoreError, match="there is no bucket 'nowhere'; create it"):
        fly(plan.make(campaign), location("gs://nowhere/light"))
