"""A small campaign, flown, identified and tabulated in a folder or in a store."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from airtruth.cluster import Cluster
from airtruth.identification import identify, write_estimates
from airtruth.logs.remote import RemotePath
from airtruth.reporting import write_tables
from airtruth.simulation.campaign import plan
from airtruth.simulation.campaign.run import fly

CAMPAIGN = """
schema = 1
name = "light"
aircraft = "gtm"
runs = 36
seed = 7
duration_s = 5.0
[condition]
eas_kt = 75.0
altitude_ft = 7000.0
[[manoeuvre]]
kind = "doublet"
amplitude_deg = 1.0
[gust]
figures = "gtm"
level = "light"
"""
METHODS = ("ls", "iv-lowpass", "iv-f1")


@pytest.fixture(scope="session")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("campaign") / "light.toml"
    file.write_text(CAMPAIGN)
    return file


@pytest.fixture(scope="session")
def local(campaign: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The campaign flown, identified and tabulated in a folder."""
    out = tmp_path_factory.mktemp("local")
    everything(campaign, out)
    return out


def silent(done: int, total: int, failed: int) -> None:
    """Report no progress."""


def everything(
    campaign: Path,
    out: Path,
    cluster: Cluster | None = None,
    flying: Callable[[int, int, int], None] = silent,
    identifying: Callable[[int, int, int], None] = silent,
) -> None:
    fly(plan.make(campaign), out / "light", cluster=cluster, advance=flying)
    result = identify(out / "light", "gtm", METHODS, cluster=cluster, advance=identifying)
    write_estimates(out / "light" / "estimates.parquet", result)
    write_tables([out / "light"], out / "tables")


def contents(folder: Path) -> dict[str, bytes]:
    files = folder.files() if isinstance(folder, RemotePath) else folder.rglob("*")
    return {
        p.relative_to(folder).as_posix(): p.read_bytes()
        for p in files
        if p.name != ".lock" and (isinstance(folder, RemotePath) or p.is_file())
    }


def wait_for_records(out: Path, process: subprocess.Popen[str], number: int) -> None:
    while len(list((out / "manifest-parts").iterdir())) < number:
        assert process.poll() is None, "it ended before it could be killed"
        time.sleep(0.02)
