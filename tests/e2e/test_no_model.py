"""From the log of an autopilot, or the table of a test centre, to a corrected aircraft that flies.

There is no vane and no JSBSim model, and the servo is 60 ms late. The files are those of `validation.autopilot_logs`, whose
truth is a simulation of its own. The commands are those of docs/howto/from-px4.md, from-ardupilot.md and from-csv.md, and print
what these pages show.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from airtruth import aircraft
from airtruth.aircraft.origin import rounded
from scripts.readme import differs, steps
from validation import autopilot_logs as uav

HOWTO = Path(__file__).resolve().parents[2] / "docs" / "howto"
MANOEUVRES = "".join(
    f'\n[[manoeuvre]]\nrun_id = "m{k + 1}"\nstart_s = {start + uav.SETTLED_S}\nend_s = {end - uav.SETTLED_S}\n'
    for k, (start, end) in enumerate(uav.command_windows()[: uav.RECORDS])
)


def completed(mapping: str, page: str) -> str:
    """A guessed mapping with the edits of the page: rate, elevator, height, and the manoeuvres of the flight."""
    block = page.split("[[manoeuvre]]")[0].rpartition("```toml")[2]
    elevator = "\n".join(line.strip() for line in block.splitlines())
    text = mapping.replace("rate_hz = 100", "rate_hz = 50")
    head, found, height = text.partition("# [channels.height_m]")
    if found:
        rows = height.split("\n")
        end = rows.index("")
        rows[1:end] = [row.removeprefix("# ") for row in rows[1:end]]
        text = "\n".join([head + "[channels.height_m]" + rows[0], *rows[1:]])
    return text + elevator + MANOEUVRES


def command(folder: Path, words: Sequence[str]) -> list[str]:
    """Run a command in a folder and return the lines that it prints."""
    done = subprocess.run(
        [sys.executable, "-m", "airtruth", *words],
        cwd=folder,
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


WRITERS = {
    "px4": ("flight.ulg", uav.write_px4),
    "ardupilot": ("flight.bin", uav.write_ardupilot),
    "csv": ("flight.csv", uav.write_csv),
}
"""Page -> file that its first command reads, and its writer."""


@pytest.mark.long
@pytest.mark.parametrize("source", sorted(WRITERS))
def test_a_stranger_s_log_becomes_a_corrected_aircraft(tmp_path, source):
    if source != "csv":
        pytest.importorskip("pyulog" if source == "px4" else "pymavlink")
    page = (HOWTO / f"from-{source}.md").read_text(encoding="utf-8")
    name, write = WRITERS[source]
    write(tmp_path / name, uav.fly())
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    other_than_shown = []
    for number, step in enumerate(steps(page)):
        difference = differs(step.shown, command(tmp_path, step.words))
        if difference:
            other_than_shown.append(f"{step.title}: {difference}")
        if number == 0 and source != "csv":
            file = tmp_path / "map.toml"
            file.write_text(completed(file.read_text(encoding="utf-8"), page), encoding="utf-8")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    answer = json.loads((tmp_path / "traced" / "trace.json").read_text(encoding="utf-8"))
    (late,) = [e for e in answer["effects"] if e["name"] == "elevator_delay"]
    assert late["parameters"]["delay_s"]["value"] == pytest.approx(uav.DELAY_S, rel=0.05)
    corrected = aircraft.load(tmp_path / answer["updated_aircraft"])
    for derivative, quantity in corrected.file.derivatives.items():
        assert abs(quantity.value - uav.DERIVATIVES[derivative]) < 2.0 * quantity.std, derivative
    (element,) = corrected.file.dynamics.surface
    delay = late["parameters"]["delay_s"]
    assert (element.kind, element.value) == ("delay", rounded(delay["value"], delay["std"]))
    assert list((tmp_path / "first" / "logs").glob("*.parquet"))
    assert not other_than_shown
    assert after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime < 180.0


@pytest.mark.parametrize("source", sorted(WRITERS))
def test_a_page_has_six_commands(source):
    page = (HOWTO / f"from-{source}.md").read_text(encoding="utf-8")
    words = [step.words[:2] for step in steps(page)]
    assert [one[0] for one in words] == ["new", "import", "new", "trace", "new", "fly"]
    assert next(iter(steps(page))).words[2] == WRITERS[source][0]


def test_the_first_commands_of_the_csv_page_print_what_it_shows(tmp_path):
    """Mapping, import without an edit, and the aircraft; the long test runs the others."""
    page = (HOWTO / "from-csv.md").read_text(encoding="utf-8")
    uav.write_csv(tmp_path / "flight.csv", uav.fly())
    for step in list(steps(page))[:3]:
        assert not differs(step.shown, command(tmp_path, step.words)), step.title
    mapping = (tmp_path / "map.toml").read_text(encoding="utf-8").splitlines()
    shown = page.split("```toml\n")[1].split("```")[0].splitlines()
    assert [line for line in shown if not line.endswith("; ...") and line not in mapping] == []
    assert all(any(m.startswith(line[:-5]) for m in mapping) for line in shown if line.endswith("; ..."))


def test_the_edits_of_a_page_complete_a_guess():
    page = (HOWTO / "from-ardupilot.md").read_text(encoding="utf-8")
    guess = 'rate_hz = 100\n# [channels.height_m] # in doubt\n# column = "BARO.Alt"\n# reference_m = 0.0\n\n# an end\n'
    text = completed(guess, page)
    assert '\n[channels.height_m] # in doubt\ncolumn = "BARO.Alt"\nreference_m = 0.0\n\n# an end' in text
    assert "calibration = [[1100, -25], [1900, 25]]" in text
