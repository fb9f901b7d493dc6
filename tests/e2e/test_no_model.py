"""From the log of an autopilot to a corrected aircraft that flies: no vane, no JSBSim model, a servo delay of 60 ms.

The files are those of `validation.autopilot_logs`, whose truth is a simulation of its own. The commands are those of
docs/howto/from-px4.md and from-ardupilot.md.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest

from airtruth import aircraft
from validation import autopilot_logs as uav

HOWTO = Path(__file__).resolve().parents[2] / "docs" / "howto"
MANOEUVRES = "".join(
    f'\n[[manoeuvre]]\nrun_id = "m{k + 1}"\nstart_s = {start + 0.1}\nend_s = {end - 0.1}\n'
    for k, (start, end) in enumerate(uav.command_windows()[:6])
)


def commands_of(page: str) -> list[str]:
    """The commands of a page, which are indented lines."""
    lines = (line.strip() for line in page.splitlines() if line.startswith("       "))
    return [line.removeprefix("airtruth ") for line in lines if line.startswith("airtruth ")]


def completed(mapping: str, page: str) -> str:
    """A guessed mapping with the edits of the page: rate, elevator, height, and the manoeuvres of the flight."""
    block = page.split("```toml")[1].split("[[manoeuvre]]")[0]
    elevator = "\n".join(line.strip() for line in block.splitlines())
    text = mapping.replace("rate_hz = 100", "rate_hz = 50")
    head, found, height = text.partition("# [channels.height_m]")
    if found:
        rows = height.split("\n")
        end = rows.index("")
        rows[1:end] = [row.removeprefix("# ") for row in rows[1:end]]
        text = "\n".join([head + "[channels.height_m]" + rows[0], *rows[1:]])
    return text + elevator + MANOEUVRES


def command(folder: Path, line: str) -> str:
    """Run a command line in a folder and return what it prints."""
    done = subprocess.run(
        [sys.executable, "-m", "airtruth", *line.split()],
        cwd=folder,
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.long
@pytest.mark.parametrize("source", ["px4", "ardupilot"])
def test_the_log_of_an_autopilot_becomes_a_corrected_aircraft(tmp_path, source):
    pytest.importorskip("pyulog" if source == "px4" else "pymavlink")
    page = (HOWTO / f"from-{source}.md").read_text(encoding="utf-8")
    if source == "px4":
        uav.write_px4(tmp_path / "flight.ulg", uav.fly())
    else:
        uav.write_ardupilot(tmp_path / "flight.bin", uav.fly())
    first, *others = commands_of(page)
    assert len(others) == 5
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command(tmp_path, first)
    file = tmp_path / "map.toml"
    file.write_text(completed(file.read_text(encoding="utf-8"), page), encoding="utf-8")
    for line in others:
        command(tmp_path, line)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    answer = json.loads((tmp_path / "traced" / "trace.json").read_text(encoding="utf-8"))
    (late,) = [e for e in answer["effects"] if e["name"] == "elevator_delay"]
    assert late["parameters"]["delay_s"]["value"] == pytest.approx(uav.DELAY_S, rel=0.05)
    corrected = aircraft.load(tmp_path / answer["updated_aircraft"])
    for name, quantity in corrected.file.derivatives.items():
        assert abs(quantity.value - uav.DERIVATIVES[name]) < 2.0 * quantity.std, name
    (element,) = corrected.file.dynamics.surface
    assert (element.kind, element.value) == ("delay", late["parameters"]["delay_s"]["value"])
    assert list((tmp_path / "first" / "logs").glob("*.parquet"))
    assert after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime < 180.0


def test_a_page_has_at_most_six_commands_and_its_edits_complete_a_guess():
    page = (HOWTO / "from-ardupilot.md").read_text(encoding="utf-8")
    assert len(commands_of(page)) == 6
    guess = 'rate_hz = 100\n# [channels.height_m] # in doubt\n# column = "BARO.Alt"\n# reference_m = 0.0\n\n# an end\n'
    text = completed(guess, page)
    assert '\n[channels.height_m] # in doubt\ncolumn = "BARO.Alt"\nreference_m = 0.0\n\n# an end' in text
    assert "calibration = [[1100, -25], [1900, 25]]" in text
