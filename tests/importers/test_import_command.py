"""import and check as a user runs them."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from import_flight import flown, foreign, mapping_by_name, write_csv

from airtruth.logs.store import read_log

ROOT = Path(__file__).resolve().parents[2]


def run(*arguments):
    command = [sys.executable, "-m", "airtruth", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("command")
    write_csv(place / "f.csv", foreign(flown(place, runs=1)))
    (place / "m.toml").write_text(mapping_by_name())
    return place


@pytest.mark.long
@pytest.mark.slow
def test_guess_import_check_identify(folder):
    guessed = run("import", "--guess", folder / "f.csv")
    assert guessed.returncode == 0, guessed.stderr
    assert "[channels.airspeed_m_s]" in guessed.stdout
    done = run("import", folder / "f.csv", "--mapping", folder / "m.toml", "--out", folder / "f.parquet")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("1 run, 401 rows in ")
    assert done.stderr == ""
    assert read_log(folder / "f.parquet").metadata["source"] == "f.csv"
    checked = run("check", folder / "f.parquet", "--aircraft", "gtm")
    assert checked.returncode == 0, checked.stderr
    assert "gyro_bias" in checked.stdout
    answer = json.loads(run("check", folder / "f.parquet", "--json").stdout)
    assert answer["run_ids"] == ["flight"]
    delay = next(f for f in answer["findings"] if f["name"] == "sensor_delay:theta_rad")
    assert delay["lower"] < 0.040 < delay["upper"]  # aircraft/gtm/aircraft.toml
    identified = run("identify", folder / "f.parquet", "--aircraft", "gtm", "--json")
    assert json.loads(identified.stdout)[0]["converged"]


@pytest.mark.slow
def test_a_wrong_sign_ends_with_2_and_writes_nothing_unless_forced(folder):
    text = mapping_by_name()
    at = text.index("[channels.q_rad_s]")
    (folder / "bad.toml").write_text(
        text[:at] + text[at:].replace('unit = "deg/s"', 'unit = "deg/s"\nsign = -1', 1)
    )
    arguments = (
        "import",
        folder / "f.csv",
        "--mapping",
        folder / "bad.toml",
        "--out",
        folder / "bad.parquet",
    )
    done = run(*arguments)
    assert done.returncode == 2
    assert done.stdout == ""
    assert "contradicts physics" in done.stderr
    assert "sign = 1 in place of -1 under [channels.q_rad_s]" in done.stderr
    assert not (folder / "bad.parquet").exists()
    forced = run(*arguments, "--force")
    assert forced.returncode == 0
    assert "q_rad_s" in forced.stderr
    assert (folder / "bad.parquet").exists()


@pytest.mark.grid
@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (("import", __file__), f"`airtruth import --guess {__file__}` prints a mapping"),
        (("import", "--guess", "none.csv"), "none.csv: no such file"),
        (("check", "none.parquet"), "no such file"),
    ],
)
def test_usage_errors(arguments, part):
    done = run(*arguments)
    assert done.returncode == 2
    assert part in done.stderr
    assert "Traceback" not in done.stderr
