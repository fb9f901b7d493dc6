"""The tables of docs/blind.md follow from the ledger of runs, and its sums are those of the runs."""

from __future__ import annotations

import pytest

from validation.blind.ledger import GROUPS, PAGE, PRESENT, TABLES, Run, added, interval, runs, with_tables


def test_the_page_has_the_tables_of_the_ledger() -> None:
    page = PAGE.read_text(encoding="utf-8")
    assert with_tables(page, runs()) == page, "run `python -m validation.blind.ledger`"
    assert len(page.splitlines()) <= 200


def test_every_table_has_rows_of_each_of_its_modes() -> None:
    sums = added(runs())
    for table in TABLES.values():
        for mode in table.modes:
            own = [sums[mode, group] for group in GROUPS if (mode, group) in sums]
            assert sum(s.scored[table.scores[0].key] + s.scored["reported"] for s in own) > 0


def test_rows_of_a_group_are_added() -> None:
    rows = [
        Run("triple", "a", (1,), 9, PRESENT, {"first": (1, 4)}),
        Run("triple", "b", (2,), 9, PRESENT, {"first": (2, 3)}),
        Run("triple", "c", (3,), 9, "earlier", {"first": (0, 5)}),
    ]
    sums = added(rows)
    assert (sums["triple", PRESENT].hits["first"], sums["triple", PRESENT].scored["first"]) == (3, 7)
    assert sums["triple", "earlier"].scored["first"] == 5


def test_the_interval_of_no_hit_is_the_analytic_one() -> None:
    """No hit in n trials has a probability of 0.025 at 1 - 0.025^(1/n)."""
    assert interval(0, 60) == pytest.approx((0.0, 1.0 - 0.025 ** (1 / 60)), rel=1e-9)
    assert interval(60, 60) == pytest.approx((0.025 ** (1 / 60), 1.0), rel=1e-9)


def test_more_hits_than_trials_are_refused() -> None:
    with pytest.raises(ValueError, match="first has 5 of 4 trials"):
        Run("triple", "a", (1,), 9, PRESENT, {"first": (5, 4)})
    with pytest.raises(ValueError, match="group"):
        Run("triple", "a", (1,), 9, "late", {})
