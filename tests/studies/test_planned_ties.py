"""The study of planned flights on ties of blind trials: which trials it takes, what it flies, and what it counts."""

import json

import numpy as np
import pytest

from airtruth.simulation.campaign.file import Campaign
from studies.planned_flights import single
from studies.planned_ties import study
from validation.blind import surface


def stored(folder, number, key, noncentrality, sets):
    """A trial of one effect and the sets of its answer, as `validation.blind` keeps them."""
    for stage in ("truth", "answer"):
        (folder / stage).mkdir(exist_ok=True)
    name = f"single-7-{number:05d}.json"
    truth = {"trial": {"effects": [{"key": key}]}, "lambda": {key: noncentrality}}
    answer = {"effects": [{"name": s[0], "indistinguishable_from": s[1:]} for s in sets]}
    (folder / "truth" / name).write_text(json.dumps(truth))
    (folder / "answer" / name).write_text(json.dumps(answer))


def test_ties_are_sets_of_several_effects_with_the_true_one(tmp_path):
    pair = [["elevator_delay", "actuator_lag"]]
    stored(tmp_path, 0, "actuator_lag", 50.0, pair)
    stored(tmp_path, 1, "actuator_lag", 29.0, pair)
    stored(tmp_path, 2, "vane_lag", 50.0, pair)
    stored(tmp_path, 3, "elevator_delay", 50.0, [["elevator_delay"]])
    stored(tmp_path, 4, "sensor_delay:q_rad_s", 50.0, [["gyro_lag", "sensor_delay"]])
    stored(tmp_path, 5, "inertia_error", 50.0, [["inertia_error", "derivatives"]])
    assert study.ties(tmp_path) == ["single-7-00000", "single-7-00004"]


def test_the_aircraft_of_a_trial_flies_the_planned_command():
    """Two segments of 0.4 and 0.3 s from 1 s on, 0.02 rad up and down; the command is linear over the step of an edge."""
    manoeuvre = {
        "kind": "multistep",
        "amplitude_rad": 0.02,
        "start_s": 1.0,
        "segments_s": [0.4, 0.3],
        "levels": [1.0, -1.0],
    }
    raw = {"schema": 1, "name": "next", "aircraft": "gtm", "runs": 3, "seed": 1, "duration_s": 5.0}
    condition = {"eas_m_s": 38.58, "altitude_m": 2133.6}
    campaign = Campaign.model_validate(raw | {"condition": condition, "manoeuvre": [manoeuvre]})
    flown = study.commanded(campaign)
    assert len(flown) == 3
    t = np.array([-0.5, 0.0, 0.99, 1.01, 1.2, 1.39, 1.41, 1.69, 1.71, 5.0])
    expected = 0.02 * np.array([0, 0, 0, 1, 1, 1, -1, -1, 0, 0])
    for m in flown:
        np.testing.assert_allclose(surface.command(m, t), expected, atol=1e-12)


def facts(truth, sets, keys=None, jsbsim=((2.0, 1.0), (3.0, 2.0)), ratio=2.5):
    return {
        "truth": [{"key": truth}],
        "air": "light",
        "tie": [["gyro_lag", "sensor_delay"]],
        "sigma": 4.0,
        "ratio": ratio,
        "jsbsim": [{"planned": a, "reference": b} for a, b in jsbsim],
        "answer": {"truth": truth, "verdict": "traced", "sets": sets, "variants": keys or sets},
    }


@pytest.mark.parametrize(
    ("truth", "sets", "keys", "alone"),
    [
        ("gyro_lag", [["gyro_lag"]], None, True),
        ("gyro_lag", [["gyro_lag", "sensor_delay"]], None, False),
        ("gyro_lag", [["sensor_delay"]], [["sensor_delay:q_rad_s"]], False),
        ("sensor_delay:q_rad_s", [["sensor_delay"]], [["sensor_delay:q_rad_s"]], True),
        ("sensor_delay:q_rad_s", [["sensor_delay"]], [["sensor_delay:az_m_s2"]], False),
    ],
)
def test_a_tie_is_broken_by_a_set_of_the_true_effect_alone(truth, sets, keys, alone):
    assert single(facts(truth, sets, keys)["answer"]) is alone


def test_the_report_counts_ties_wrong_names_and_ratios(tmp_path):
    rows = [
        facts("gyro_lag", [["gyro_lag"]]),
        facts("gyro_lag", [["sensor_delay"]], [["sensor_delay:q_rad_s"]], ratio=1.5),
        {
            "truth": [{"key": "gyro_lag"}],
            "air": "calm",
            "tie": [["gyro_lag", "sensor_delay"]],
            "failed": "no",
        },
    ]
    for k, row in enumerate(rows):
        (tmp_path / f"single-7-{k:05d}.json").write_text(json.dumps(row))
    last = study.report(tmp_path).splitlines()[-1]
    assert last == (
        "ties broken 1 of 3; the true effect in no set 1 of 2; median ratio expected 2.00, in JSBSim 1.75"
    )
