"""A time budget ends the search, and the answer says what it left out."""

import pytest

import airtruth as at
from airtruth.errors import ConfigurationError
from airtruth.tracing.budget import Budget, may_begin


def test_steps_begin_until_the_time_is_over():
    now, announced = [0.0], []
    budget = Budget(2.0, announced.append, lambda: now[0])
    assert may_begin(budget, "a")
    now[0] = 2.0
    assert not may_begin(budget, "b")
    assert not may_begin(budget, "b")
    budget("c")
    assert announced == ["a", "c"]
    assert budget.left_out == ("b",)
    assert may_begin(announced.append, "d")


@pytest.mark.parametrize("seconds", [-1.0, float("inf"), float("nan")])
def test_a_budget_is_a_number_of_seconds(seconds):
    with pytest.raises(ConfigurationError, match="--time-budget"):
        at.TraceOptions(time_budget_s=seconds)


@pytest.mark.slow
def test_without_time_nothing_is_refitted_and_the_answer_says_so():
    answer = at.trace("data/undeclared/a.parquet", "gtm", at.TraceOptions(time_budget_s=0.0)).answer
    assert answer.verdict == "unexplained"
    assert answer.provisional
    assert any("the time budget ended the search" in note for note in answer.notes)
    leader = next(c for c in answer.candidates if c.name == "elevator_delay")
    assert leader.why_not == "the time budget ended before its refit"
