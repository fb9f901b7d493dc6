"""A search beside what the kinematics of its records name, on records whose gyro reads 20 % too much.

A sinusoid of 4 Hz in az, 0.5 m/s2, is the anomaly beyond doubt that no effect explains.
"""

import pytest
import trace_records as tr
from scaled_records import disturbed_problem

from airtruth.effects.registry import EFFECTS
from airtruth.tracing.inference.optimise import initial_parameters
from airtruth.tracing.selection.search import search
from airtruth.tracing.selection.set_table import SetTable

CANDIDATES = tuple(EFFECTS[key] for key in ("gyro_scale", "vane_scale"))
AGAIN = "round 1: refit without further effects"


@pytest.fixture(scope="module", params=[0.0, 0.5], ids=["clean", "anomaly"])
def problem(request):
    return request.param > 0.0, disturbed_problem([1.0, 1.2, 1.0], 2, request.param)


def searched(problem, *causes):
    """Keys of the accepted effects, the anomaly, and how often the search began."""
    steps = []
    start = initial_parameters(problem, tr.NOTHING)
    sets = [frozenset(cause) for cause in causes]
    rounds = search(SetTable(problem), tr.NOTHING, start, CANDIDATES, 1, steps.append, causes=sets)
    keys = [e.key for e in rounds[-1].null.hypothesis.effects]
    return keys, rounds[-1].anomaly.p_value, steps.count(AGAIN)


@pytest.mark.grid
def test_a_search_follows_the_kinematics_where_it_leaves_an_anomaly_beyond_doubt(problem):
    """The vane that the kinematics are made to name explains nothing beside the gyro, and is not accepted."""
    anomaly, records = problem
    keys, p_value, begun = searched(records, ["vane_scale"])
    assert keys == ["gyro_scale"]
    assert (p_value < 1e-6) == anomaly
    assert begun == searched(records)[2] + (1 if anomaly else 0)


@pytest.mark.slow
def test_one_of_several_sets_is_enough(problem):
    _, records = problem
    assert searched(records, ["vane_scale"], ["gyro_scale"]) == searched(records)
