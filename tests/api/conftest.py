"""A working folder with a small campaign, which every example of the public API uses."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

import airtruth as at
from airtruth.channels import SIGNALS
from airtruth.logs.store import write_table

ROOT = Path(__file__).resolve().parents[2]
RUNS = 6


@pytest.fixture(scope="session")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with light.toml, its campaign in out/light with estimates, and one run as flight.csv."""
    folder = tmp_path_factory.mktemp("workspace")
    shutil.copy(ROOT / "data" / "campaigns" / "light.toml", folder)
    campaign = folder / "out" / "light"
    at.fly(folder / "light.toml", campaign, runs=RUNS)
    log = at.read_log(campaign)
    write_table(campaign / "estimates.parquet", at.identify(log, "gtm", ["ls"]).to_frame())
    one = log.select(log.run_ids[0])
    one.to_frame().drop(columns="run_id").to_csv(folder / "flight.csv", index=False)
    channels = "".join(
        f'[channels.{name}]\ncolumn = "{name}"\nunit = "{SIGNALS[name].unit}"\n' for name in one.channels
    )
    mapping = f'schema = 1\n[time]\ncolumn = "t_s"\nunit = "s"\n{channels}'
    (folder / "flight.toml").write_text(mapping, encoding="utf-8")
    return folder
