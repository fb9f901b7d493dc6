"""Shares of a parameter set between the quick tests, the slow ones and the long ones."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest


def sampled(cases: Iterable[Any], every: int) -> list[Any]:
    """Cases of a parametrised test: the first of each ``every`` runs with the test, the others are long tests."""
    return [
        case if number % every == 0 else pytest.param(*_values(case), marks=pytest.mark.long)
        for number, case in enumerate(cases)
    ]


def divide_grids(items: Iterable[pytest.Item]) -> None:
    """Leave the first collected case of each test marked ``grid`` in the quick tier, and make the others slow tests."""
    met: set[str] = set()
    for item in items:
        if item.get_closest_marker("grid") is None or item.get_closest_marker("long") is not None:
            continue
        function = item.nodeid.partition("[")[0]
        if function in met:
            item.add_marker(pytest.mark.slow)
        met.add(function)


def _values(case: Any) -> tuple[Any, ...]:
    return case if isinstance(case, tuple) else (case,)
