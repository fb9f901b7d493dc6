"""An aircraft.toml alone: the loop closes, the corrected aircraft is written, and the next flight is planned from it."""

import subprocess
import sys

import pytest

from airtruth import aircraft as planes
from airtruth.logs.store import write_log
from validation import small_aircraft as small

pytestmark = pytest.mark.slow


def command(*arguments):
    ran = subprocess.run(
        [sys.executable, "-m", "airtruth", *map(str, arguments)], capture_output=True, text=True, check=False
    )
    assert ran.returncode == 0, ran.stderr
    return ran.stdout


def test_loop_and_plan_need_no_jsbsim_model(tmp_path):
    declared, out = tmp_path / "declared", tmp_path / "out"
    declared.mkdir()
    small.declared(declared)
    flown = small.flight_log(2, truth=small.Truth(effect="vane_arm"))
    write_log(tmp_path / "log.parquet", flown, dtype="float64")
    candidates = ("--effect", "vane_arm", "--effect", "elevator_delay")
    log = tmp_path / "log.parquet"
    text = command(
        "loop", log, "--aircraft", declared, "--out", out, *candidates, "--method", "ls", "--quiet"
    )
    assert "vane_arm: its error is undone in alpha_rad" in text
    written = planes.load(out / "trace" / "aircraft" / "small")
    arm = written.file.sensors["alpha_rad"].x
    assert abs(arm.value - small.EFFECTS["vane_arm"]) < 3.0 * arm.std
    assert "records r1, r2, r4, r5" in arm.source
    assert written.file.jsbsim is not None  # a small model that flies
    kept = [line for line in (declared / "aircraft.toml").read_text().splitlines() if "source" not in line]
    lines = (written.folder / "aircraft.toml").read_text().splitlines()
    assert len(set(kept) - set(lines)) == 6  # the derivatives
    campaign = tmp_path / "next.toml"
    text = command(
        *("plan", "--from", out / "trace", "--derivative", "Cmq", "--length-s", 3, "--records", 1),
        *("--out", campaign, "--quiet"),
    )
    assert "Standard errors before and with the planned flight" in text
    assert campaign.is_file()
