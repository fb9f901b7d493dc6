"""Blind modes whose truth is a set of effects: the draws, the build-up of wing and tail, and the scores."""

import importlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2, poisson

from validation.blind import (
    causes,
    declaration,
    draw,
    information,
    refit,
    results,
    scoring,
    set_scoring,
    trials,
)
from validation.blind.aircraft_xml import Body
from validation.blind.figures import DERIVATIVES, TOGETHER, held_out
from validation.blind.flight import LeftRangeError
from validation.blind.truths import Added, shrunk

TAIL = {
    "factor": 0.5,
    "arm_mac": 4.0,
    "efficiency": 0.9,
    "downwash": 0.3,
    "body_lift": 0.1,
    "body_moment": 0.2,
}
NAMES = tuple(DERIVATIVES)


def aircraft(tail: float, wing: float) -> dict[str, float]:
    """Body, wing and tail added up; a wing with a share of its lift bends the air at the tail by that share."""
    a, arm = 0.9 * 1.47, 4.0
    declared = causes.DECLARED
    body = {
        "CLalpha": declared["CLalpha"] - a * (1.0 - 0.3),
        "CLq": declared["CLq"] - 2.0 * a * arm,
        "Cmalpha": declared["Cmalpha"] + arm * a * (1.0 - 0.3),
        "Cmq": declared["Cmq"] + 2.0 * a * arm**2,
    }
    share = {"CLalpha": 0.9, "CLq": 0.9, "Cmalpha": 0.8, "Cmq": 0.9}
    kept = {name: value * (1.0 - share[name] * (1.0 - wing)) for name, value in body.items()}
    lift = tail * a * (1.0 - 0.3 * wing)
    return {
        "CLalpha": kept["CLalpha"] + lift,
        "CLq": kept["CLq"] + tail * 2.0 * a * arm,
        "CLde": tail * declared["CLde"],
        "Cmalpha": kept["Cmalpha"] - arm * lift,
        "Cmq": kept["Cmq"] - tail * 2.0 * a * arm**2,
        "Cmde": tail * declared["Cmde"],
    }


@pytest.mark.parametrize(
    ("key", "tail", "wing"), [("tail_effectiveness", 0.5, 1.0), ("wing_effectiveness", 1.0, 0.5)]
)
def test_a_part_that_is_lost_leaves_the_sum_of_the_others(key, tail, wing):
    found = causes.increments(key, TAIL)
    lost, whole = aircraft(tail, wing), aircraft(1.0, 1.0)
    assert found == pytest.approx({name: lost[name] - whole[name] for name in NAMES}, rel=1e-12, abs=1e-12)
    assert whole == pytest.approx(causes.DECLARED)


def test_ice_takes_the_measured_shares():
    found = causes.increments("icing", causes.ice_values(2.0, 0.5))
    assert found["CLalpha"] == pytest.approx(-0.2 * 4.793)
    assert found["Cmq"] == pytest.approx(0.07 * 41.38)


def test_a_part_of_a_shift_is_a_shift_of_each_derivative():
    half = shrunk(Added("derivatives", {"dCLq": 4.0, "dCmq": -6.0}), 0.5)
    assert half.values == {"dCLq": 2.0, "dCmq": -3.0}


@pytest.mark.parametrize("mode", causes.COMPOSITIONS)
def test_draws_keep_their_ranges(mode):
    trials = [draw.draw(6, k, mode) for k in range(60)]
    assert trials == [draw.draw(6, k, mode) for k in range(60)]
    keys = {tuple(e.key for e in t.effects) for t in trials}
    if mode == "derivative":
        off = [{n[1:]: v / causes.DECLARED[n[1:]] for n, v in t.effects[0].values.items()} for t in trials]
        assert {len(o) for o in off} == set(range(1, 7))
        sizes = np.abs([x for o in off for x in o.values()])
        assert 0.02 <= sizes.min() < sizes.max() <= 0.30
        assert all(sum((x / DERIVATIVES[n][1]) ** 2 for n, x in o.items()) > 30.0 for o in off)
    elif mode == "composite":
        loading = ("cg_shift", "mass_error", "inertia_error")
        assert keys == {("tail_effectiveness",), ("wing_effectiveness",), ("icing",), loading}
        stiffness = [
            causes.DECLARED["Cmalpha"] + causes.increments(e.key, e.values).get("Cmalpha", 0.0)
            for t in trials
            for e in t.effects
        ]
        assert max(stiffness) < 0.15 * causes.DECLARED["Cmalpha"]
    elif mode == "triple":
        rows = [{row for row in causes.FAMILIES for e in t.effects if e.key in row} for t in trials]
        assert all(len(row) == 3 for row in rows)
    else:
        assert keys == {("vane_lag", "elevator_delay"), ("gyro_lag", "elevator_delay")}
        assert {len(t.manoeuvres) for t in trials} == {2, 3}
        lags = [t.effects[0].values["tau_s"] / causes.TIME_CONSTANT_S for t in trials]
        assert 0.2 <= min(lags) < max(lags) <= 0.8


def test_an_aircraft_that_departs_is_replaced(monkeypatch, tmp_path):
    asked = []

    def flown(plan, number, trial):
        asked.append(trial.number)
        if len(asked) == 1:
            raise LeftRangeError("departed")
        return {"number": number}

    monkeypatch.setattr(trials, "_flown", flown)
    assert trials.fly(trials.Plan(1, 6, "composite", tmp_path), 4) == {"number": 4}
    assert asked == [4, 1_000_004]


def test_the_default_tracer_is_there():
    module, name = trials.Plan(1, 1, "null", Path()).tracer.split(":")
    assert callable(getattr(importlib.import_module(module), name))


def test_records_that_are_held_out():
    assert [held_out(n) for n in (2, 3, 6)] == [(1,), (2,), (2, 5)]


def test_the_time_constant_of_the_short_period(gtm, paper_trim):
    from airtruth.simulation.linearise import linearise

    found = linearise(gtm, paper_trim)
    assert 1.0 / (found.modes["zeta"] * found.modes["wn_rad_s"]) == pytest.approx(
        causes.TIME_CONSTANT_S, rel=0.03
    )


@pytest.fixture(scope="module")
def calm():
    """A set in calm air, white noise, no draws."""
    return replace(draw.draw(1, 0, "derivative"), air="calm", noise="white", body=Body(), duration_s=5.0)


@pytest.mark.long
def test_shifts_are_as_strong_as_their_declared_uncertainty_lets_them_be(calm):
    """In calm air the records fix a slope far better than its declaration: lambda is (shift/std)^2, a little less."""
    trial = replace(calm, effects=(Added("derivatives", {"dCmalpha": 0.3 * 1.79}),))
    assert refit.lambdas(trial)["derivatives"] == pytest.approx(36.0, rel=0.1)


@pytest.mark.long
def test_a_set_is_as_strong_as_what_imitates_it(calm):
    """A larger inertia divides the moments: at most (0.25/0.03)^2 of the inertia alone, and at least what inertia and
    the three slopes leave together, known to 3 % and to 5, 15 and 5 %; the curves of the tables tell more than slopes.
    """
    effects = (Added("inertia_error", {"factor": 1.25}), Added("cg_shift", {"dx_mac": 1e-4}))
    found = refit.lambdas(replace(calm, composition="composite", effects=effects))
    least = np.log(1.25) ** 2 / (0.03**2 + 1.0 / (0.05**-2 + 0.15**-2 + 0.05**-2))
    assert least < found["inertia_error"] < (0.25 / 0.03) ** 2
    assert found[TOGETHER] == pytest.approx(found["inertia_error"], rel=0.02)
    assert found["cg_shift"] < 0.1


def test_the_expected_share_of_contradictions_is_the_power_of_the_chi_square_test():
    """A noncentral chi-square variable is a Poisson mixture of central ones (Johnson, Kotz and Balakrishnan, Continuous
    Univariate Distributions 2, 2nd ed., 1995, eq. 29.3)."""
    shifted = {"truth": {"trial": {"effects": [{"key": "derivatives"}]}, "lambda": {"derivatives": 32.0}}}
    j = np.arange(200)
    critical = chi2.isf(0.0025, 6)
    mixture = float(poisson.pmf(j, 16.0) @ chi2.sf(critical, 6 + 2 * j))
    assert set_scoring.contradiction_power(shifted) == pytest.approx(mixture, rel=1e-10)
    loaded = {"truth": {"trial": {"effects": [{"key": "cg_shift"}]}, "lambda": {}}}
    assert set_scoring.contradiction_power(loaded) is None


def test_derivatives_outside_their_declared_uncertainty():
    """One error at a time. The covariance is d + u u', so that a shift s u has the square s^2 u'u / (1 + u'u), u and the
    shift in units of the derivatives' own standard deviations (Sherman and Morrison, Ann. Math. Stat. 21, 1950)."""
    body = {"mass": 1.0, "inertia": 1.0, "cg": 0.0}
    declared = causes.DECLARED
    assert declaration.on_declared_body(declared, body) == pytest.approx(declared)
    assert declaration.p_value(declared, declared) == 1.0
    light = declaration.on_declared_body(declared, body | {"mass": 1.0 / 1.05})
    # 5 % more lift; the derivatives' own 5, 30 and 10 % and the 1 % of the mass
    own = sum((0.01 / std) ** 2 for std in (0.05, 0.30, 0.10))
    square = 25.0 * own / (1.0 + own)
    assert declaration.p_value(light, declared) == pytest.approx(chi2.sf(square, 6), rel=1e-9)
    aft = declaration.on_declared_body(declared, body | {"cg": 0.1})
    assert aft["Cmalpha"] == pytest.approx(declared["Cmalpha"] + 0.1 * declared["CLalpha"])
    assert aft["CLalpha"] == declared["CLalpha"]


def test_a_null_outside_its_declared_uncertainty_counts_apart():
    answer = {"derivatives": {"declared": dict(causes.DECLARED)}}
    cases = [case("null", {}, {}, **CONTRADICTED, **answer) for _ in range(3)]
    for one, share in zip(cases, (0.0, 0.1, 0.3), strict=True):
        one["truth"] = one["truth"] | {
            "increments": {name: share * value for name, value in causes.DECLARED.items()},
        }
        one["truth"]["trial"]["body"] = {"mass": 1.0, "inertia": 1.0, "cg": 0.0}
    found = scoring.score(cases)
    assert found["false_contradiction"]["calm"].count == 3
    # 10 % of all six: squares 4 + 0.11 + 1 + 4 + 0.44 + 4 at most, far from 20.2 at 0.0025; 30 %: 9 times as much
    assert found["false_contradiction_inside"]["calm"].count == 2


def test_the_truths_derivatives_are_its_draw_and_its_causes():
    trial = replace(
        draw.draw(1, 0, "derivative"),
        body=Body(derivatives={"CLalpha": 0.1}),
        effects=(Added("derivatives", {"dCmq": -2.0}), Added("icing", causes.ice_values(1.0, 0.0))),
    )
    found = draw.derivative_increments(trial)
    assert found["CLalpha"] == pytest.approx(0.0, abs=1e-12)  # ice takes what the draw adds
    assert found["Cmq"] == pytest.approx(-2.0 + 0.035 * 41.38)


# -- scores


CHANNELS = ("alpha_rad", "q_rad_s", "az_m_s2")


def case(mode, effects, answered, **answer):
    """A case: effects key -> (parameters, lambda); answered name -> (parameters, look-alikes)."""
    clean = dict.fromkeys(CHANNELS, 0.25)
    stage = {"held_out": {"free_run": clean, "innovation": clean}}
    return {
        "truth": {
            "trial": {
                "composition": mode,
                "air": "calm",
                "duration_s": 5.0,
                "manoeuvres": [{}] * 6,
                "body": {"mass": 1.0, "inertia": 1.0, "cg": 0.0},
                "effects": [{"key": k, "values": v} for k, (v, _) in effects.items()],
            },
            "lambda": {k: strength for k, (_, strength) in effects.items()} | {TOGETHER: 90.0},
            "increments": dict.fromkeys(NAMES, 0.0),
            "oracle": {"free_run": clean, "signal": dict.fromkeys(CHANNELS, 2.0)},
        },
        "answer": {
            "verdict": "traced",
            "provisional": False,
            "effects": [
                {"name": n, "parameters": v, "indistinguishable_from": alike}
                for n, (v, alike) in answered.items()
            ],
            "candidates": [],
            "error": {"before": stage, "after": stage},
            **answer,
        },
    }


CONTRADICTED = {"declared_model": {"consistent": False}}
TAIL_LOST = {"tail_effectiveness": (TAIL, 90.0)}
LOADING = {
    "cg_shift": ({"dx_mac": 0.1}, 60.0),
    "mass_error": ({"factor": 1.1}, 8.0),
    "inertia_error": ({"factor": 1.3}, 50.0),
}


def test_sets_of_a_hand_made_run():
    heavy = {"factor": {"ci95": [1.25, 1.35]}}
    cases = [
        case(
            "composite",
            TAIL_LOST,
            {"tail_effectiveness": ({"factor": {"ci95": [0.6, 0.7]}}, [])},
            **CONTRADICTED,
        ),
        case("composite", TAIL_LOST, {"derivatives": ({}, ["tail_effectiveness"])}),
        case("composite", TAIL_LOST, {"icing": ({}, [])}, alternatives=[{"effects": ["tail_effectiveness"]}]),
        case("composite", TAIL_LOST, {"tail_effectiveness": ({}, []), "vane_lag": ({}, [])}),
        # the mass is weak beside the others: it may be missing
        case("composite", LOADING, {"cg_shift": ({}, []), "inertia_error": (heavy, [])}),
        case("composite", LOADING, {"cg_shift": ({}, [])}),
        case("triple", {k: (v, 40.0) for k, (v, _) in LOADING.items()}, {}),
        case("triple", LOADING, {}),  # one of three is weak: it does not count
    ]
    found = set_scoring.set_scores(cases)
    one = found["composite"]
    counts = {
        k: (one[k].hits, one[k].count) for k in ("contradicted", "first", "reported", "parameter_coverage")
    }
    assert counts == {
        "contradicted": (1, 6),
        "first": (2, 6),
        "reported": (4, 6),
        "parameter_coverage": (1, 1),
    }
    assert one["after_over_oracle"] == (1.0, 6)
    assert (found["triple"]["trials"], found["triple"]["strong"]) == (2, 1)
    assert [r["truth"] for r in one["by_set"]] == [
        "cg_shift, inertia_error, mass_error",
        "tail_effectiveness",
    ]
    text = results.markdown(scoring.score(cases), found)
    assert "| right set first | 2 of 6 = 0.33 (0.04 to 0.78) |" in text
    assert "false traces" not in text


def test_intervals_of_derivatives_hold_the_truth_on_the_declared_mass():
    declared = {"CLalpha": 5.0, "CLq": 30.0, "CLde": 0.5, "Cmalpha": -2.0, "Cmq": -40.0, "Cmde": -1.8}
    truth = case("derivative", {"derivatives": ({"dCmalpha": 0.3}, 90.0)}, {})
    truth["truth"]["increments"]["Cmalpha"] = 0.3
    truth["truth"]["trial"]["body"] = {"mass": 1.25, "inertia": 1.1, "cg": 0.02}
    # CL over the mass; Cm about the declared CG over the inertia, 1.1
    expected = {"CLalpha": 4.0, "CLq": 24.0, "CLde": 0.4, "Cmalpha": -16.0 / 11.0}
    expected |= {"Cmq": -394.0 / 11.0, "Cmde": -17.9 / 11.0}
    after = expected | {"Cmq": expected["Cmq"] + 0.4}
    truth["answer"]["derivatives"] = {
        "declared": declared,
        "after": after,
        "after_std": dict.fromkeys(NAMES, 0.1),
    }
    assert set_scoring.true_derivatives(truth) == pytest.approx(expected)
    assert set_scoring.derivatives_covered(truth) == [True, True, True, True, False, True]
    shift = {"dCmalpha": {"ci95": [0.50, 0.60]}, "dCmq": {"ci95": [4.4, None]}}  # 6/11 and 46/11
    truth["answer"]["effects"] = [{"name": "derivatives", "parameters": shift}]
    assert set_scoring.parameters_covered(truth) == [True, False]


def test_a_curvature_adds_its_slope_where_the_answer_counts_it_from():
    """CL'' / 2 = 20 per rad2, from 5.57 deg in the truth and from 1 deg more in the answer: a slope of 40 times 1 deg."""
    declared = {"CLalpha": 5.0, "CLq": 30.0, "CLde": 0.5, "Cmalpha": -2.0, "Cmq": -40.0, "Cmde": -1.8}
    truth = case("derivative", {"cl_alpha_nonlinear:quadratic": ({"CLalpha2": 20.0}, 90.0)}, {})
    truth["truth"]["trial"]["body"] = {"mass": 1.0, "inertia": 1.0, "cg": 0.0}
    truth["answer"]["derivatives"] = {"declared": declared}
    named = {"name": "cl_alpha_nonlinear", "about_alpha_rad": np.radians(6.57)}
    truth["answer"]["effects"] = [named]
    assert set_scoring.true_derivatives(truth)["CLalpha"] == pytest.approx(5.0 + 40.0 * np.radians(1.0))
    truth["answer"]["effects"] = []
    assert set_scoring.true_derivatives(truth) == pytest.approx(declared)


def test_an_effect_that_worsens_a_held_out_error_has_to_say_so():
    """Ten seconds of three channels: 1/sqrt(1500) of the innovations, 1/sqrt(3 10/0.39) of the free run."""
    for kind, ratio, expected in (
        ("innovation", 1.06, True),
        ("innovation", 1.04, False),
        ("free_run", 1.3, True),
        ("free_run", 1.2, False),
    ):
        one = case("slow", {"vane_lag": ({"tau_s": 0.2}, 90.0)}, {"lift_lag": ({}, [])})
        stages = {
            s: {"held_out": {k: dict.fromkeys(CHANNELS, 1.0) for k in ("innovation", "free_run")}}
            for s in ("before", "after")
        }
        stages["after"]["held_out"][kind] = dict.fromkeys(CHANNELS, ratio)
        one["answer"]["error"] = stages
        assert set_scoring.worse_unstated(one) == expected
        assert not set_scoring.worse_unstated({**one, "answer": {**one["answer"], "confirmed": False}})
        one["answer"]["notes"] = [
            "on the held-out records, the error of the innovations is 6 % larger after than before"
        ]
        assert not set_scoring.worse_unstated(one)


def test_a_null_that_is_called_contradicted_counts_per_air():
    cases = [case("null", {}, {}), case("null", {}, {}, **CONTRADICTED)]
    found = scoring.score(cases)["false_contradiction"]
    assert (found["calm"].hits, found["calm"].count) == (1, 2)
    assert set_scoring.set_scores(cases) == {}


def test_equivalent_records_of_a_short_set_are_flown(calm):
    """Two records: the first is fitted, the second held out."""
    trial = replace(draw.draw(1, 0, "slow"), air="calm", body=Body())
    two = replace(trial, manoeuvres=trial.manoeuvres[:2])
    assert information.fitted(two) == [0]
