"""The tracer's likelihood of a flown trial under its truth and under another name."""

import json

import pytest

from validation.blind.draw import draw, plain
from validation.blind.trials import frozen
from validation.truth_likelihood import compare, compared, main

SEED, NUMBER = 9, 7
"""A frozen trial with a wrong scale of the vane, see tests/tracing/test_frozen_trials.py."""


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    folder = tmp_path_factory.mktemp("blind")
    (log,) = frozen(SEED, [NUMBER], "mixed", folder)
    return folder, {"trial": plain(draw(SEED, NUMBER, "mixed"))}, log / "log.parquet"


def answer(*names):
    return {
        "effects": [{"name": n, "parameters": {p: {"value": x} for p, x in own.items()}} for n, own in names]
    }


def test_effects_outside_the_library_are_not_compared(tmp_path):
    truth = {"trial": {"effects": [{"key": "fuel_slosh", "values": {}}]}}
    found = compare(truth, answer(("vane_lag", {"tau_s": 0.1})), tmp_path / "absent.parquet")
    assert (found.lead, found.right) == (None, False)


@pytest.mark.slow
def test_the_truth_is_more_probable_than_another_scale(flown):
    _, truth, log = flown
    (effect,) = truth["trial"]["effects"]
    assert effect["key"] == "vane_scale"
    other = compare(truth, answer(("gyro_scale", effect["values"])), log)
    assert other.lead < -10.0
    assert not other.right


@pytest.mark.slow
def test_an_answer_without_a_likelihood_of_its_own_is_not_compared(flown, capsys):
    folder, truth, log = flown
    values = truth["trial"]["effects"][0]["values"]
    assert compare(truth, answer(("vane_scale", values)), log).right
    assert compare(truth, answer(("increment", {})), log).lead is None
    late = answer(("sensor_delay", {"delay_s": 0.01}))
    late["effects"][0] |= {"variant": "q_rad_s", "channel": "q_rad_s"}
    assert compare(truth, late, log).answer == ("sensor_delay:q_rad_s",)
    assert compare(truth, answer(("derivatives", {"dCmq": 1.0})), log).lead is None
    for kind, content in (("truth", truth), ("answer", answer(("increment", {})))):
        (folder / kind).mkdir()
        (folder / kind / f"{log.parent.name}.json").write_text(json.dumps(content))
    (folder / "answer" / "x.json").write_text(json.dumps({"failed": "LogError"}))
    assert list(compared(folder)) == [log.parent.name]
    assert main(["--blind", str(folder)]) == 0
    assert "not compared: 1 of 1" in capsys.readouterr().out
