"""data/undeclared traced from outside: the command line in a folder with the logs and the declared aircraft alone.

What was flown stands in undeclared_key.toml, which the traced folder does not hold.
"""

import json
import math
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
KEY = tomllib.loads((Path(__file__).parent / "undeclared_key.toml").read_text())
NAMES = sorted(KEY)
WITH_EFFECT = [n for n in NAMES if KEY[n]["composition"] in ("single", "pair")]
TRACE = """
import sys
from airtruth.cli import app
for name in sys.argv[1:]:
    app(["trace", f"{name}.parquet", "--aircraft", "gtm", "--out", f"out/{name}", "--jobs", "2", "--quiet"],
        standalone_mode=False)
"""
"""As the shell would, one start of the interpreter for all."""
WORSE = 1.02
"""A held-out error counts as worse above this ratio (docs/blind.md)."""

pytestmark = [pytest.mark.long, pytest.mark.xdist_group("undeclared")]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("undeclared")
    shutil.copytree(ROOT / "aircraft" / "gtm", place / "gtm")
    for name in NAMES:
        shutil.copy(ROOT / "data" / "undeclared" / f"{name}.parquet", place)
    done = subprocess.run(
        [sys.executable, "-c", TRACE, *NAMES], cwd=place, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return place


@pytest.fixture(scope="module")
def answers(folder):
    return {name: json.loads((folder / "out" / name / "trace.json").read_text()) for name in NAMES}


def reported(answer):
    """Every name in the reported sets."""
    return [{e["name"], *e["indistinguishable_from"]} for e in answer["effects"]]


KNOWN_TO_MISS = {("a", "delay_s"), ("d", "dCmalpha")}


def relative(error, oracle):
    """Root mean square over the channels of an error over that which the truth leaves."""
    return math.sqrt(sum((error[c] / oracle[c]) ** 2 for c in oracle) / len(oracle))


@pytest.mark.parametrize("name", WITH_EFFECT)
def test_each_effect_is_in_a_reported_set_of_its_own(answers, name):
    answer = answers[name]
    assert answer["verdict"] in ("traced", "one_of")
    sets = reported(answer)
    for effect in KEY[name]["effects"]:
        holding = [s for s in sets if effect["name"].partition(":")[0] in s]
        assert holding, f"{effect['name']} not in {sets}"
        sets.remove(holding[0])
    several = any(e["indistinguishable_from"] for e in answer["effects"])
    assert (answer["verdict"] == "one_of") == several


def test_the_declared_aircraft_lacks_nothing(answers):
    nothing = [n for n in NAMES if KEY[n]["composition"] == "null"]
    assert nothing
    for name in nothing:
        assert answers[name]["verdict"] == "none"
        assert answers[name]["effects"] == []
        assert answers[name]["refined"]
        assert answers[name]["updated_aircraft"] is not None


def test_what_the_library_does_not_hold_is_not_called_known_without_reserve(answers):
    for name in (n for n in NAMES if KEY[n]["composition"] == "off-library"):
        answer = answers[name]
        assert answer["verdict"] != "none"
        assert answer["verdict"] in ("unexplained", "learned", "one_of") or answer["provisional"]


def test_intervals_hold_the_truth(answers):
    """All but the two that are known to miss, by 2.9 and 2.2 standard deviations; none by more than 3.5."""
    missed, far = [], []
    for name in WITH_EFFECT:
        stated = {e["name"]: e["parameters"] for e in answers[name]["effects"]}
        for effect in KEY[name]["effects"]:
            for parameter, truth in effect["parameters"].items():
                own = stated.get(effect["name"].partition(":")[0], {}).get(parameter)
                if own is None:  # another member of the class leads it
                    continue
                low, high = own["ci95"]
                if not (low is None or low <= truth) or not (high is None or truth <= high):
                    missed.append((name, parameter))
                if abs(own["value"] - truth) > 3.5 * own["std"]:
                    far.append((name, parameter, truth, own))
    assert far == []
    assert set(missed) <= KNOWN_TO_MISS


@pytest.mark.parametrize("name", NAMES)
def test_held_out_error_is_what_the_truth_leaves(answers, name):
    answer, oracle = answers[name], KEY[name]["oracle"]
    stage = "after" if answer["effects"] else "before"
    found = relative(answer["error"][stage]["held_out"]["free_run"], oracle)
    # the truth's free run is free in biases and initial state, the tracer's in the trim as well
    assert found < 1.1
    if answer["effects"]:
        before = relative(answer["error"]["before"]["held_out"]["free_run"], oracle)
        # in rough air the truth itself may fly these two records worse than an aircraft without the effect: set e
        assert found < WORSE * max(before, 1.0)


@pytest.mark.parametrize("name", NAMES)
def test_answer_and_updated_aircraft_are_written(folder, answers, name):
    answer = answers[name]
    assert answer["records"]["held_out"] == ["r3", "r6"]
    assert answer["model"] == "aircraft"
    assert (folder / "out" / name / "trace.html").stat().st_size > 0
    if answer["effects"]:
        updated = folder / answer["updated_aircraft"]
        assert updated.is_dir()
        assert (updated / "aircraft.toml").is_file()
        assert updated.resolve() != (folder / "gtm").resolve()
