"""Blind trials of effects that the tracer's library lacks: the five of the mode unmodelled, and leave-one-out."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from airtruth.effects.registry import EFFECTS as LIBRARY
from airtruth.tracing.options import TraceOptions
from validation.blind import bands, draw, refit, scoring, sensors, states, tracing, truths
from validation.blind.aircraft_xml import Body, Shape
from validation.blind.figures import (
    ALPHA_TRIM_RAD,
    APART,
    BEYOND,
    DEG,
    DERIVATIVES,
    LEAVE_ONE_OUT,
    STEP_S,
    STRONG,
    WITHHELD,
)
from validation.blind.flight import Model, Truth
from validation.blind.sensors import Fault
from validation.blind.truths import FURTHER, OFF_LIBRARY, Added

SEVEN = (
    "structural_mode",
    "hinge_blowback",
    "cm_hysteresis",
    "fuel_slosh",
    "thrust_lag",
    "separation_switch",
    "vane_friction",
)


def test_the_pools_of_frozen_trials_are_unchanged():
    assert OFF_LIBRARY == SEVEN
    assert len(FURTHER) == 5


def test_separated_flow_follows_kirchhoff_with_a_lag():
    """Closed form of a first-order lag after a step of alpha; lift of Kirchhoff's flow, its centre 0.15 chords aft."""
    lift, alpha = 0.4, ALPHA_TRIM_RAD + 3.0 * DEG
    settled = [
        0.5 * (1.0 - math.tanh(30.0 * (a - ALPHA_TRIM_RAD - 2.0 * DEG))) for a in (ALPHA_TRIM_RAD, alpha)
    ]
    state = states.stall(lift)(ALPHA_TRIM_RAD)
    assert state(ALPHA_TRIM_RAD, 0.0, 40.0, 1e-4) == pytest.approx((0.0, 0.0), abs=1e-15)
    for _ in range(3000):
        cl, cm = state(alpha, 0.0, 40.0, 1e-4)
    x = settled[1] + (settled[0] - settled[1]) * math.exp(-0.3 / 0.15)
    before, after = (((1.0 + math.sqrt(s)) / 2.0) ** 2 for s in (settled[0], x))
    assert cl == pytest.approx(lift * (after - before), rel=1e-3)
    assert cm == pytest.approx(0.15 * cl, rel=1e-12)


def test_a_moving_cg_turns_the_lift_of_the_declared_aircraft_about_it():
    state = states.drifting_cg(0.002)(0.0)
    for _ in range(1000):
        cl, cm = state(ALPHA_TRIM_RAD + 0.01, 0.0, 40.0, 1e-3)
    # CL at the trim: 57.75 lb at 75 kt over 5.9018 ft2
    weight, pressure = 57.75 * 4.4482216, 0.5 * 1.225 * (75.0 * 1852.0 / 3600.0) ** 2
    trim = weight / (pressure * 5.9018 * 0.3048**2)
    assert cl == 0.0
    assert cm == pytest.approx(0.002 * 1.0 * (trim + 0.01 * DERIVATIVES["CLalpha"][0]), rel=0.01)


def test_an_elevator_in_the_wake_loses_moment_in_proportion_to_alpha():
    """From the angular acceleration of two flights that differ in nothing else: dq'/dt = q_bar S c k da de / Iyy."""
    k, shift, step = 5.0, 0.03, 0.02
    rates = []
    for shapes in ((), (Shape("Cm", "alpha-elevator", k, ALPHA_TRIM_RAD),)):
        truth = Truth(Model(Body(), shapes), STEP_S)
        flown = truth.fly(np.array([0.0, 0.0, step, step]), None, shift)
        rates.append(flown["q_dot_rad_s2"][2])
        alpha, elevator = flown["alpha_rad"][2], truth.elevator_rad + step
    inertia, area, chord = 4.657102 * 14.593902937 * 0.3048**2, 5.9018 * 0.3048**2, 0.9153 * 0.3048
    pressure = 0.5 * 1.225 * (75.0 * 1852.0 / 3600.0) ** 2
    expected = pressure * area * chord * k * (alpha - ALPHA_TRIM_RAD) * elevator / inertia
    assert rates[1] - rates[0] == pytest.approx(expected, rel=0.03)


def test_readings_of_a_bent_vane_and_of_a_gyro_that_feels_acceleration():
    n = 5
    channels = dict.fromkeys(("airspeed_m_s", "alpha_rad", "q_rad_s", "az_m_s2", "q_dot_rad_s2"), np.zeros(n))
    channels["airspeed_m_s"] = np.full(n, 40.0)
    channels["alpha_rad"] = ALPHA_TRIM_RAD + np.linspace(-0.02, 0.02, n)
    channels["az_m_s2"] = -9.0 + np.arange(n)
    placed = sensors.placed(channels, (Fault("q_rad_s", "cross", 0.01),), 0.0)
    assert placed["q_rad_s"] == pytest.approx(0.01 * np.arange(n), abs=1e-15)
    bent = sensors.faulty(channels["alpha_rad"], (Fault("alpha_rad", "curve", 3.0),), STEP_S)
    assert bent == pytest.approx(channels["alpha_rad"] + 3.0 * np.linspace(-0.02, 0.02, n) ** 2, abs=1e-12)


def test_every_further_effect_is_drawn_and_scored_as_off_the_library():
    trials = [draw.draw(11, k, "unmodelled") for k in range(80)]
    assert {t.composition for t in trials} == {"off-library"}
    assert {e.key for t in trials for e in t.effects} == {*SEVEN, *FURTHER}


def test_a_withheld_effect_is_withheld_with_all_of_its_variants(tmp_path, monkeypatch):
    seen = []

    class Answer:
        def to_dict(self):
            return {}

    def trace(log, aircraft, options):
        seen.append(options)
        return Answer()

    monkeypatch.setattr("airtruth.tracing.trace", trace)
    monkeypatch.setattr(tracing, "read_log", lambda log, names: type("Log", (), {"run_ids": ("r1",)}))
    tracing.answer(tmp_path / "log.parquet")
    (tmp_path / WITHHELD).write_text(json.dumps(["cm_alpha_nonlinear"]))
    tracing.answer(tmp_path / "log.parquet")
    assert seen[0] == TraceOptions()
    variants = {key for key, e in LIBRARY.items() if e.name == "cm_alpha_nonlinear"}
    assert variants
    assert set(seen[1].effects) == {k for k, e in LIBRARY.items() if not e.in_derivatives} - variants
    assert seen[1].learns


@pytest.mark.long
@pytest.mark.slow
def test_the_noncentrality_beyond_the_rest_of_the_library():
    """That of `APART`: an effect withheld leaves what its nearest rival does."""
    trial = replace(
        draw.draw(3, 0, LEAVE_ONE_OUT),
        effects=(Added("elevator_asymmetry", {"dCmde": 0.9}),),
        air="calm",
        duration_s=5.0,
    )
    own = refit.lambdas(trial)
    single = refit.lambdas(replace(trial, composition="single"))
    assert own[BEYOND] == pytest.approx(single[APART], rel=1e-12)
    assert own[BEYOND] > STRONG


def case(key, verdict, named, *, after, provisional=False, confirmed=None):
    """A leave-one-out case with errors relative to a truth's own of 1 and a before of 2."""
    clean = {"alpha_rad": 1.0}
    errors = {
        stage: {"held_out": {"free_run": {"alpha_rad": e}}}
        for stage, e in (("before", 2.0), ("after", after))
    }
    return {
        "truth": {
            "trial": {"composition": LEAVE_ONE_OUT, "effects": [{"key": key, "values": {}}], "air": "calm"},
            "lambda": {key: 90.0, BEYOND: 60.0},
            "oracle": {"free_run": clean, "signal": clean},
        },
        "answer": {
            "verdict": verdict,
            "provisional": provisional,
            "confirmed": confirmed,
            "effects": [{"name": name, "parameters": {}} for name in named],
            "candidates": [],
            "error": errors,
        },
    }


def test_scores_of_leave_one_out():
    cases = [
        case("elevator_asymmetry", "learned", ["increment"], after=1.1),
        case("downwash_lag", "unexplained", [], after=2.0),
        case("vane_lag", "traced", ["vane_arm"], after=1.3),
        case("vane_arm", "traced", ["vane_lag"], after=2.2, provisional=True),
    ]
    s = scoring.score(cases)["leave_one_out"]
    counts = {k: (v.hits, v.count) for k, v in s.items() if isinstance(v, scoring.Share)}
    assert counts == {
        "flagged": (3, 4),
        "learned": (1, 4),
        "named_without_reservation": (1, 4),
        "passed_as_none": (0, 4),
        "worse_not_denied": (1, 4),
        "worse_unstated": (1, 4),
    }
    assert s["after_over_oracle"] == (1.1, 1)
    assert s["after_over_oracle_of_all"] == (pytest.approx(1.65), 4)
    assert s["after_over_oracle_of_curves"] == (pytest.approx(1.55), 2)


def test_the_share_of_a_band_counts_the_samples_of_the_true_curve():
    """A break of Cm of 0.4 at 0.1 rad, inertia 10 % high, no draw of a derivative; the answer's Cmalpha is 0.1 high."""
    at = np.array([0.05, 0.1, 0.15, 0.2])
    true = np.array([0.0, 0.0, 0.02, 0.04]) / 1.1 - 0.1 * (at - 0.05)
    off = np.array([0.0, 0.0, 0.0, 0.01])
    table = {
        "at": at.tolist(),
        "low": (true + off - 0.001).tolist(),
        "high": (true + off + 0.001).tolist(),
        "samples": [10, 20, 30, 40],
        "trim": 0.05,
    }
    names = ("CLalpha", "CLq", "CLde", "Cmalpha", "Cmq", "Cmde")
    declared = dict.fromkeys(names, 1.1)
    stated = dict.fromkeys(names, 1.0) | {"Cmalpha": 1.1}
    own = {"name": "increment", "acts_on": "Cm", "over": "alpha_rad", "states": [], "table": table}
    truth = {
        "trial": {
            "effects": [
                {"key": "cm_alpha_nonlinear:break", "values": {"dCmalpha": 0.4, "at_alpha_rad": 0.1}}
            ],
            "body": {"mass": 1.0, "inertia": 1.1, "cg": 0.0},
        },
        "increments": dict.fromkeys(names, 0.0),
    }
    answer = {"effects": [own], "derivatives": {"declared": declared, "after": stated}}
    behind_a_lag = {**own, "states": [{"kind": "lag"}]}
    assert bands.covered({"truth": truth, "answer": answer}) == [pytest.approx(0.6)]
    assert bands.covered({"truth": truth, "answer": {**answer, "effects": [behind_a_lag]}}) == []
    assert bands.covered({"truth": {"trial": {"effects": []}}, "answer": answer}) == []
    both = [{"truth": truth, "answer": answer}, {"truth": truth, "answer": {"failed": "no"}}]
    assert bands.score(both) == (pytest.approx(0.6), 1)


@pytest.mark.parametrize("key", sorted(bands.CURVES))
def test_the_true_curve_of_a_band_is_that_of_the_flown_aircraft(key):
    """A table or a sensor of the truth, evaluated by its own code, is the curve at angles about the trim."""
    kind = truths.EFFECTS[key]
    values = kind.values(0.3, 0.5)
    parts = kind.parts(values)
    x = np.linspace(-0.05, 0.2, 26)
    curve = bands.CURVES[key].value(values, x)
    if parts.faults:
        expected = sensors.faulty(x, parts.faults, 0.001) - x
    else:
        (shape,) = parts.shapes
        expected = shape.value * shaped(shape, x)
    np.testing.assert_allclose(curve, expected, atol=1e-15)


def shaped(shape, x):
    """The shape of an increment by hand, the elevator at 1 rad where it multiplies."""
    by_hand = {
        "alpha-above": np.maximum(0.0, x - shape.at),
        "alpha-square": (x - shape.at) ** 2,
        "alpha-elevator": x - shape.at,
        "elevator-below": np.minimum(0.0, x),
        "elevator-odd-square": x * np.abs(x),
    }
    return by_hand[shape.shape]
