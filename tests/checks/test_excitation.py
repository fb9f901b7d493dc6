"""An elevator moves or is noise, and a record whose elevator is noise tells nothing of its sign."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from airtruth.checks.excitation import moves
from airtruth.checks.gate import inspect
from airtruth.logs.store import read_log
from airtruth.units import DEG

ROOT = Path(__file__).resolve().parents[2]
DT = 0.02


@pytest.mark.parametrize("std_deg", [0.01, 0.05])
def test_noise_about_a_drift_is_no_motion(std_deg):
    noise = np.random.default_rng(1).standard_normal((50, 48)) * std_deg * DEG
    assert not moves(noise + np.linspace(0.0, 0.03 * DEG, 48), DT).any()


def test_a_constant_is_no_motion():
    assert not moves(np.full((1, 48), 0.1), DT).any()


def test_a_doublet_is_a_motion_whatever_its_unit():
    doublet = np.repeat([0.0, 1.0, -1.0, 0.0], 20)
    noise = 0.02 * np.random.default_rng(2).standard_normal(80)
    rows = np.stack([doublet, doublet * DEG, doublet + noise, 0.06 * doublet]) * DEG
    assert moves(rows, DT).all()
    assert moves(np.repeat(rows, 4, axis=1)[:, ::10], 10 * DT).all()


def still(log, seed, samples=47):
    """The start of each run, the elevator at rest behind a sensor with a noise of 0.02 deg."""
    keep = np.concatenate([np.arange(start, start + samples) for start in log.offsets[:-1]])
    channels = {n: v[keep] for n, v in log.channels.items() if n != "elevator_command_rad"}
    channels["elevator_rad"] = 0.02 * DEG * np.random.default_rng(seed).standard_normal(len(keep))
    return replace(
        log, offsets=np.arange(len(log.run_ids) + 1) * samples, t_s=log.t_s[keep], channels=channels
    )


@pytest.mark.grid
@pytest.mark.parametrize("seed", [0, 10, 24, 35, 39])
def test_noise_of_the_elevator_has_no_sign(seed, gtm):
    """With each of these seeds noise alone was certainly a swapped column, or an elevator of opposite sign."""
    log = read_log(sorted((ROOT / "data" / "undeclared").glob("*.parquet"))[0])
    faults = inspect(still(log, seed), gtm)
    assert not [f for f in faults if f.certain or f.channel == "elevator_rad"]
