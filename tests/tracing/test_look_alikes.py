"""Accepted effects beside the others: which others explain as much, and where an effect has its location."""

from dataclasses import replace

import numpy as np
import pytest
from scaled_records import ACCELEROMETER, GYRO, VANE, fitted, scaled_problem

from airtruth.effects.registry import EFFECTS
from airtruth.physics.terms import AeroTerm, Change
from airtruth.tracing.declared_model import explaining_effects
from airtruth.tracing.inference.hypothesis import Hypothesis
from airtruth.tracing.inference.optimise import fit, initial_parameters
from airtruth.tracing.inference.profile import relocated
from airtruth.tracing.model.parameters import Parameters
from airtruth.tracing.selection import look_alikes
from airtruth.tracing.selection.acceptance import Candidate
from airtruth.tracing.selection.explanation import CauseSet
from airtruth.tracing.selection.look_alikes import with_look_alikes
from airtruth.tracing.selection.refusal import Refusal
from airtruth.tracing.selection.release import Release
from airtruth.tracing.selection.rounds import RoundStart, search_round
from airtruth.tracing.selection.set_table import SetTable

TWIN = replace(GYRO, name="gyro_twin")
LIBRARY = (VANE, GYRO, ACCELEROMETER, TWIN)
NONE = np.zeros(0)


@pytest.fixture(scope="module")
def problem():
    return scaled_problem()


def scored(problem, *effects):
    """A round that scores the library and refits nothing, behind these effects."""
    start = fitted(problem, *effects)
    keys = {e.key for e in effects}
    left = tuple(e for e in LIBRARY if e.key not in keys)
    begin = RoundStart(start.hypothesis, start.point, left, scores_only=True)
    return search_round(SetTable(problem), begin, len(effects), 1, lambda step: None)


def candidate(problem, own, gain, reasons, *effects):
    score = next(s for s in own.table.scores if s.effect.key == effects[-1].key)
    return Candidate(score, fitted(problem, *effects), gain, NONE, NONE, 0.1, 0.01, reasons)


@pytest.mark.slow
def test_ties_are_those_beside_the_other_effects(problem):
    """A twin that a set surpassed in its round is as good at the end; a tie of the first round is none any more."""
    first, second, last = scored(problem), scored(problem, VANE), scored(problem, VANE, GYRO)
    vane = candidate(problem, first, 60.0, (), VANE)
    tied = candidate(problem, first, 58.0, (), ACCELEROMETER)
    gyro = candidate(problem, second, 50.0, (), VANE, GYRO)
    twin = candidate(problem, second, 40.0, (Refusal.SURPASSED,), VANE, TWIN)
    rounds = (
        replace(first, candidates=(vane, tied), tied=(vane, tied)),
        replace(second, candidates=(gyro, twin), tied=(gyro,)),
        last,
    )
    steps = []
    before, after, end = with_look_alikes(SetTable(problem), rounds, LIBRARY, steps.append)
    assert [c.score.effect.key for c in before.tied] == ["vane_scale"]
    assert {c.score.effect.key: c.reasons for c in before.candidates} == {
        "vane_scale": (),
        "accelerometer_scale": (Refusal.OUTDONE,),
    }
    assert [c.score.effect.key for c in after.tied] == ["gyro_scale", "gyro_twin"]
    assert after.tied[1].gain == pytest.approx(50.0, abs=1e-3)
    assert end is last
    assert steps == [
        "accelerometer_scale in place of vane_scale beside the other effects",
        "gyro_twin in place of gyro_scale beside the other effects",
    ]


@pytest.mark.slow
def test_a_single_effect_keeps_the_ties_of_its_round(problem):
    first, last = scored(problem), scored(problem, VANE)
    vane = candidate(problem, first, 60.0, (), VANE)
    rounds = (replace(first, candidates=(vane,), tied=(vane,)), last)
    assert with_look_alikes(SetTable(problem), rounds, LIBRARY, lambda step: None) is rounds


def test_every_release_that_was_followed_states_its_causes(problem):
    """The first release was refitted with a mass error and the second with an inertia error; a third was not followed."""
    mass, inertia = EFFECTS["mass_error"], EFFECTS["inertia_error"]
    last = scored(problem, mass, inertia)

    def release(*causes):
        size = (0.1,) * len(causes)
        return Release(
            last.declared_test, last.null, (CauseSet(causes, (), size, size, np.zeros((6, 6)), 1.0),), 0.0
        )

    rounds = tuple(
        replace(last, release=release(*names))
        for names in (("mass_error",), ("cg_shift",), ("inertia_error",))
    )
    stated = explaining_effects((*rounds, last), last.null.covariance)
    assert [e.name for e in stated] == ["mass_error", "inertia_error"]
    span = last.null.hypothesis.span("inertia_error")
    assert stated[1].parameters["factor"].value == inertia.parameters[0].value(last.null.point.sizes[span][0])


@pytest.mark.slow
def test_a_break_finds_its_angle_again_beside_a_later_effect(problem):
    """The declared aircraft has a break of Cm that the flown one lacks: the effect has to cancel it, where it is."""
    at, slope = 0.015, -1.5
    hypothesis = Hypothesis(Change(aero=(AeroTerm("Cm", "alpha", "above", slope, at),)))
    hypothesis = hypothesis.plus(EFFECTS["cm_alpha_nonlinear:break"]).plus(VANE).plus(GYRO)
    start = initial_parameters(problem, hypothesis)
    scales = [e.parameters[0].size(value) for e, value in ((VANE, 1.3), (GYRO, 1.1))]
    point = Parameters(start.common, start.per_record, np.array([-0.5 * slope, -0.01, *scales]))
    away = fit(problem, hypothesis, point, iterations=1)
    found = relocated(problem, away)
    assert found.cost < away.cost
    assert [e.key for e in found.hypothesis.effects] == [e.key for e in hypothesis.effects]
    truth = np.array([-slope, at, *scales])
    std = np.array([found.size_std(i) for i in range(4)])
    assert (std < [0.3, 2e-3, 0.05, 0.02]).all()
    assert (np.abs(found.point.sizes - truth) < 3.0 * std).all()
    assert relocated(problem, found, placed="cm_alpha_nonlinear:break") is found


@pytest.mark.slow
@pytest.mark.parametrize("near", [True, False])
def test_a_late_rival_is_followed_by_its_own_twin(problem, monkeypatch, near):
    """A gyro lag that explains nearly as much as the member may be a gyro delay as well."""
    monkeypatch.setattr(look_alikes, "TIE", 1e6 if near else -1e6)
    lag, delay = EFFECTS["gyro_lag"], EFFECTS["sensor_delay:q_rad_s"]
    library = (*LIBRARY, lag, delay)
    start = RoundStart(
        fitted(problem, VANE).hypothesis, fitted(problem, VANE).point, library[1:], scores_only=True
    )
    second = search_round(SetTable(problem), start, 1, 1, lambda step: None)
    gyro = candidate(problem, second, 50.0, (), VANE, GYRO)
    tied = candidate(problem, second, 49.0, (), VANE, lag)
    first, last = scored(problem), scored(problem, VANE, GYRO)
    vane = candidate(problem, first, 60.0, (), VANE)
    rounds = (
        replace(first, candidates=(vane,), tied=(vane,)),
        replace(second, candidates=(gyro, tied), tied=(gyro, tied)),
        last,
    )
    steps = []
    with_look_alikes(SetTable(problem), rounds, library, steps.append)
    assert ("sensor_delay:q_rad_s in place of gyro_scale beside the other effects" in steps) == near
