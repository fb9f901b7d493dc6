"""The runner: resumes, does not depend on jobs; the scores count what they say; the committed logs."""

import json
import shutil
import subprocess
import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from airtruth.cluster import connected
from airtruth.logs.store import read_log
from airtruth.logs.validate import validate
from validation import undeclared
from validation.blind import draw, results, scoring, trials
from validation.blind.figures import APART, BEYOND
from validation.blind.scoring import Share

pytestmark = pytest.mark.long

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).parent


def stand_in(log):
    """Answers from the log's own bytes, so that a second run shows whether it was asked again."""
    q = read_log(log).channels["q_rad_s"]
    free_run = {"alpha_rad": 0.001, "q_rad_s": float(np.std(q)) / 10.0, "az_m_s2": 0.1}
    return {
        "verdict": "none",
        "provisional": False,
        "effects": [],
        "candidates": [{"name": "vane_lag", "p_value": 0.5}],
        "error": {stage: {"held_out": {"free_run": free_run}} for stage in ("before", "after")},
    }


def broken(log):
    """A tracer that fails."""
    raise ValueError(f"cannot read {log.name}")


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    """Two trials with the stand-in."""
    return trials.Plan(2, 4, "null", tmp_path_factory.mktemp("blind"), "test_blind_trials:stand_in")


@pytest.fixture(scope="module")
def cases(plan):
    return trials.run(plan, 2)


def test_result_does_not_depend_on_jobs(plan, cases, tmp_path):
    again = trials.Plan(2, 4, "null", tmp_path, plan.tracer)
    assert trials.run(again, 1) == cases


def test_a_cluster_gives_the_same_trials(plan, cases, tmp_path):
    with connected("local:2") as cluster:
        again = trials.Plan(2, 4, "null", tmp_path, plan.tracer)
        assert trials.run(again, 1, cluster) == cases


def test_a_killed_run_goes_on(plan, cases):
    kept = plan.file("answer", 0).stat().st_mtime_ns
    plan.file("answer", 1).unlink()
    plan.file("truth", 1).unlink()
    assert trials.run(plan, 1) == cases
    assert plan.file("answer", 0).stat().st_mtime_ns == kept


def test_the_tracer_is_shown_a_log_and_nothing_else(plan, cases):
    assert [p.name for p in plan.log(0).iterdir()] == ["log.parquet"]
    log = read_log(plan.log(0) / "log.parquet")
    validate(log)
    assert set(log.metadata) == {"schema", "aircraft", "sample_rate_hz"}


def test_weak_trials_can_be_left_out(plan, cases):
    """Of a null, a weak and a strong effect, the first and the last are traced."""
    only = replace(plan, count=3, out=plan.out.parent / "only", only_counted=True)
    for folder in ("truth", "logs"):
        shutil.copytree(plan.out / folder, only.out / folder)
    for number, noncentrality in ((1, 5.0), (2, 50.0)):
        trial = {"effects": [{"key": "vane_lag"}], "composition": "single"}
        truth = {"trial": trial, "lambda": {"vane_lag": noncentrality}}
        only.file("truth", number).write_text(json.dumps(truth))
    shutil.copytree(plan.log(0), only.log(2))
    assert [case["truth"] for case in trials.run(only, 1)] == [cases[0]["truth"], truth]
    assert not only.file("answer", 1).exists()


def test_selected_trials_are_those_of_the_whole_seed():
    """Delays of any sensor count as one effect, and a trial keeps its number."""
    plan = trials.Plan(40, 4, "single", Path(), effects=("sensor_delay",))
    drawn = [draw.draw(4, k, "single").effects[0].key for k in range(40)]
    assert plan.numbers == [k for k, key in enumerate(drawn) if key.startswith("sensor_delay:")]
    assert len(plan.numbers) > 1
    assert replace(plan, effects=()).numbers == list(range(40))
    kinds = [draw.draw(4, k, "single").noise for k in range(40)]
    both = replace(plan, noise="white").numbers
    assert both == [k for k in plan.numbers if kinds[k] == "white"]
    assert 0 < len(both) < len(plan.numbers)


def test_a_tracer_that_fails_is_counted(plan, cases):
    bad = trials.Plan(1, 4, "null", plan.out.parent / "bad", "test_blind_trials:broken")
    case = trials.run(bad, 1)
    assert "cannot read log.parquet" in case[0]["answer"]["failed"]
    scores = scoring.score(case)
    assert len(scores["failed"]) == 1
    assert scores["false_trace_all"].count == 0
    good = trials.Plan(1, 4, "null", bad.out, plan.tracer)
    assert trials.run(good, 1) == cases[:1]


def test_clopper_pearson():
    """Rule of three's exact form for 0 of 10; 5 of 10 as tabulated (Brown, Cai, DasGupta 2001)."""
    assert Share(0, 10).interval == pytest.approx((0.0, 1.0 - 0.025**0.1))
    assert Share(5, 10).interval == pytest.approx((0.1871, 0.8129), abs=1e-4)
    assert str(Share(0, 0)) == "none"


def case(composition, effects, answered, *, air="calm", verdict=None, provisional=False, p=None, after=0.5):
    """A case: effects (key, parameters, lambda); answered (name, parameters, look-alikes)."""
    channels = ("alpha_rad", "q_rad_s", "az_m_s2")
    clean = dict.fromkeys(channels, 0.25)
    return {
        "truth": {
            "trial": {
                "composition": composition,
                "air": air,
                "body": {"mass": 1.01, "inertia": 0.96, "cg": 0.004},
                "effects": [{"key": k, "values": v} for k, v, _ in effects],
            },
            "lambda": {k: strength for k, _, strength in effects}
            | ({BEYOND: 0.9 * effects[0][2]} if composition == "off-library" else {}),
            "oracle": {"free_run": clean, "signal": dict.fromkeys(channels, 2.0)},
        },
        "answer": {
            "verdict": verdict or ("traced" if answered else "none"),
            "provisional": provisional,
            "effects": [
                {"name": n, "parameters": v, "indistinguishable_from": alike} for n, v, alike in answered
            ],
            "candidates": [{"name": k, "p_value": p} for k, _, _ in effects],
            "error": {
                "before": {"held_out": {"free_run": dict.fromkeys(channels, 1.0)}},
                "after": {"held_out": {"free_run": dict.fromkeys(channels, after)}},
            },
        },
    }


LAG = ("vane_lag", {"tau_s": 0.01}, 100.0)
ARM = ("vane_arm", {"x_m": 0.4}, 200.0)
RIGHT = ("vane_lag", {"tau_s": {"ci95": [0.008, 0.012]}}, [])
LEARNED = ("increment", {}, [])
WRONG = ("vane_arm", {"x_m": {"ci95": [0.1, 0.3]}}, ["vane_lag"])


def test_scores_of_a_hand_made_set():
    cases = [
        case("null", [], []),
        case("null", [], [WRONG], air="light"),
        case("null", [], [], verdict="unexplained"),
        case("single", [LAG], [RIGHT], p=1e-5),
        case("single", [LAG], [WRONG], p=1e-3, verdict="one_of", after=0.25),
        case("single", [LAG], [("vane_lag", {"tau_s": {"ci95": [0.011, 0.012]}}, []), WRONG], p=0.02),
        case("single", [("cm_alpha_nonlinear:break", {"dCmalpha": 0.1}, 10.0)], [], p=0.3),
        case("single", [ARM], [("mass_error", {}, [])], p=1e-9),
        case("off-library", [("fuel_slosh", {"gain": 1.0}, 90.0)], [], verdict="unexplained"),
        case("off-library", [("fuel_slosh", {"gain": 1.0}, 90.0)], [RIGHT], provisional=True),
        case("off-library", [("fuel_slosh", {"gain": 1.0}, 90.0)], [RIGHT]),
        case("off-library", [("fuel_slosh", {"gain": 1.0}, 90.0)], [LEARNED], verdict="learned"),
        case("pair", [LAG, ARM], [RIGHT]),
        case("pair", [LAG, ARM], [RIGHT, ("vane_arm", {}, [])]),
        case("clutter", [LAG], [RIGHT], after=1.5),
        case("clutter", [], []),
    ]
    s = scoring.score(cases)
    assert {air: (v.hits, v.count) for air, v in s["false_trace"].items()} == {
        "calm": (0, 2),
        "light": (1, 1),
        "moderate": (0, 0),
    }
    strong = {k: (v.hits, v.count) for k, v in s["strong"].items() if isinstance(v, Share)}
    assert strong == {
        "detected": (4, 4),
        "in_set": (3, 4),
        "first": (2, 4),
        "in_set_of_detected": (3, 4),
        "first_of_detected": (2, 4),
        "coverage": (1, 2),
        "second_effect": (1, 4),
    }
    assert s["strong"]["mean_set_size"] == pytest.approx((1 + 2 + 1 + 1) / 4)
    off = {k: (v.hits, v.count) for k, v in s["off_library"].items() if isinstance(v, Share)}
    assert off == {
        "flagged": (3, 4),
        "learned": (1, 4),
        "named_without_reservation": (1, 4),
        "passed_as_none": (0, 4),
        "worse_not_denied": (0, 4),
        "worse_unstated": (0, 4),
    }
    assert s["off_library"]["after_over_oracle"] == (2.0, 1)
    assert {k: (v.hits, v.count) for k, v in s["pairs"].items()} == {
        "both_in_sets": (1, 2),
        "one_in_sets": (2, 2),
        "first_is_one": (2, 2),
    }
    assert (s["clutter"]["dominant_first"].hits, s["clutter"]["held_out_not_worse"].hits) == (1, 0)
    # errors over signals of 2: truth's own 0.25/2, after 0.5/2 thrice and 0.25/2
    assert s["after_over_oracle"] == (2.0, 4)
    assert s["calm_after_over_before"] == (0.5, 4)
    assert s["confusion"]["vane_lag"] == {"vane_lag": 2, "vane_arm": 1}
    assert s["confusion"]["(null)"] == {"(none)": 1, "(unexplained)": 1, "vane_arm": 1}
    row = next(r for r in s["detection"] if r["from"] == 60.0)
    assert (row["score"].hits, row["score"].count) == (2, 3)
    assert row["bound"] == pytest.approx(scoring.bound(100.0))


def test_what_leaves_nothing_beside_a_rival_is_named_first_by_chance():
    """Phi(d/2): Phi(0) = 1/2, Phi(1) = 0.8413 (any table of the normal distribution); none where not measured."""
    cases = [case("single", [LAG], [RIGHT]) for _ in range(3)]
    cases[0]["truth"]["lambda"][APART] = 0.0
    cases[1]["truth"]["lambda"][APART] = 4.0
    value, count = scoring.score(cases)["strong"]["first_bound"]
    assert value == pytest.approx((0.5 + 0.84134) / 2.0, abs=1e-5)
    assert count == 2


def test_a_declared_quantity_is_covered_with_its_draw():
    for key, parameters, expected in (
        ("mass_error", {"factor": 1.1}, 1.1 * 1.01),
        ("inertia_error", {"factor": 1.2}, 1.2 * 0.96),
        ("cg_shift", {"dx_mac": 0.03}, 0.034),
        ("vane_arm", {"x_m": 0.3}, 0.3),
    ):
        (name,) = parameters
        answered = (key, {name: {"ci95": [expected - 1e-9, None]}}, [])
        one = case("single", [(key, parameters, 50.0)], [answered])
        assert scoring.actual(one)[name] == pytest.approx(expected)
        assert scoring.covered(one) == [True]


def test_the_p_value_is_that_of_the_variant():
    answer = {
        "candidates": [
            {"name": "cm_alpha_nonlinear", "variant": "break", "p_value": 0.3},
            {"name": "cm_alpha_nonlinear", "variant": "quadratic", "p_value": 0.1},
            {"name": "sensor_delay:q_rad_s", "p_value": 0.2},
            {"name": "mass_error", "p_value": None},
        ]
    }
    found = {
        key: scoring.p_value({"answer": answer}, key)
        for key in ("cm_alpha_nonlinear:break", "cm_alpha_nonlinear", "sensor_delay:q_rad_s", "mass_error")
    }
    assert list(found.values()) == [0.3, 0.1, 0.2, None]


def test_tables_json_and_figures(cases, tmp_path):
    extra = [case("single", [LAG], [RIGHT], p=1e-5), case("off-library", [("fuel_slosh", {}, 90.0)], [])]
    scores = scoring.score([*cases, *extra])
    text = results.markdown(scores)
    assert "| false traces on nulls | 0 of 2 = 0.00 (0.00 to 0.84) |" in text
    assert "NaN" not in results.as_json(scores)
    assert json.loads(results.as_json(scores))["strong"]["in_set"]["hits"] == 1
    paths = results.figures(scores, [*cases, *extra], tmp_path)
    assert {p.name for p in paths} == {"detection.png", "effects.png", "confusion.png"}
    assert all(p.stat().st_size > 5000 for p in paths)


def test_committed_logs_are_what_the_script_flies():
    key = tomllib.loads((HERE / "undeclared_key.toml").read_text())
    assert set(key) == set(undeclared.FLOWN)
    for name in key:
        trial = undeclared.trial(name)
        stated = {e["name"]: e["parameters"] for e in key[name].get("effects", [])}
        assert stated == {e.key: dict(e.values) for e in trial.effects}
        assert key[name]["air"] == trial.air
    committed = read_log(ROOT / "data" / "undeclared" / "g.parquet")
    validate(committed)
    # a process of its own, as this one may know the tracer
    code = (
        f"import sys; sys.path.insert(0, {str(ROOT)!r})\n"
        "from validation import undeclared as m\n"
        "q = m.draw.fly(m.trial('g')).channels['q_rad_s']\n"
        "print(q[500], q[1500], q[-1])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    flown = [float(word) for word in done.stdout.split()]
    q = committed.channels["q_rad_s"]
    assert [q[500], q[1500], q[-1]] == pytest.approx(flown, rel=1e-4, abs=1e-5)
    assert draw.draw(undeclared.SEED, 6, "null").noise == key["g"]["noise"] == "white"
