"""24 frozen blind trials, flown again from their seed and traced: what the tracer answered when they were frozen.

The truth is scripts/blind's own (docs/blind.md). Expected names are those of the effects that were flown, where
`python scripts/blind_trials.py --trials 80 --seed 9 --mode mixed` gives them a noncentrality above 30. Trials with
less in them are only required to answer.
"""

import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "scripts"))

SEED, COUNT = 9, 24
NULLS = (8, 10, 19)
"""In a fourth, 13, a rate limit is named: its score has Holm's p = 0.04, and 1 null in 20 may be named."""
FIRST = {
    2: "cm_alpha_nonlinear",
    5: "cm_alpha_nonlinear",
    7: "vane_scale",
    9: "gyro_lag",
    11: "vane_scale",
    15: "vane_scale",
    16: "gyro_scale",
    20: "elevator_delay",
}
"""Trial -> the effect, or the dominant one, which has to be in the first reported set."""
BOTH = {12: {"downwash_lag", "inertia_error"}}
OFF_LIBRARY = (0, 1, 23)
"""Effects that the library lacks: unexplained, or provisional. The best effect of the library leaves 57, 659 and 72 of
their noncentrality; of a fourth, a weak mode of the structure in 14, it leaves 9.9."""
NOT_WORSE = 1.02

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("frozen")]


def answer(folder):
    from airtruth.trace import TraceOptions, trace

    return trace([folder], "gtm", TraceOptions())


@pytest.fixture(scope="module")
def answers(tmp_path_factory):
    from blind.trials import frozen

    folders = frozen(SEED, range(COUNT), "mixed", tmp_path_factory.mktemp("frozen"))
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        return list(pool.map(answer, folders))


def names(effect):
    return {effect["name"], *effect["indistinguishable_from"]}


@pytest.mark.parametrize("number", NULLS)
def test_nothing_is_named_where_nothing_is_missing(answers, number):
    assert answers[number]["effects"] == []


@pytest.mark.parametrize(("number", "name"), FIRST.items())
def test_the_effect_is_in_the_first_set(answers, number, name):
    assert name in names(answers[number]["effects"][0])


@pytest.mark.parametrize(("number", "both"), BOTH.items())
def test_two_effects_are_both_found(answers, number, both):
    found = set().union(*(names(e) for e in answers[number]["effects"]))
    assert both <= found


@pytest.mark.parametrize("number", OFF_LIBRARY)
def test_what_the_library_lacks_is_not_named_without_reservation(answers, number):
    assert answers[number]["verdict"] == "unexplained" or answers[number]["provisional"]


def test_an_accepted_effect_does_not_worsen_held_out_innovations(answers):
    for found in answers:
        if not found["effects"]:
            continue
        before, after = (found["error"][s]["held_out"]["innovation"] for s in ("before", "after"))
        assert all(after[c] < NOT_WORSE * before[c] for c in after)


def test_every_trial_is_answered(answers):
    assert len(answers) == COUNT
    assert {a["verdict"] for a in answers} <= {"none", "traced", "one_of", "unexplained"}
