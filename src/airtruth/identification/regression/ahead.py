"""Calls that compile the kernels which the instrumental variables need last; no run is filtered."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from airtruth.identification.regression import rows
from airtruth.identification.regression.auxiliary import short_period
from airtruth.identification.regression.dynamic_kernel import DynamicModel, DynamicRecords, filtered_moments


def _sum() -> None:
    rows.moments_of(np.empty((0, rows.COUNT, 1)))


def _respond() -> None:
    short_period(np.empty((0, 6)), np.empty((0, 4)), np.empty((0, 1)), 1.0)


def _filter() -> None:
    signals = np.empty((0, 4, 1))
    records = DynamicRecords(signals, np.empty((0, 1)), np.empty((0, 4)), signals, np.empty((0, 4)), 1.0)
    none = np.empty(0, dtype=np.int64)
    model = DynamicModel(np.empty((0, 6)), np.empty((0, 2)), np.empty((0, 3, 1)), none)
    filtered_moments(records, model, np.empty((0, 4, rows.COUNT - 3)))


KERNELS: Final[tuple[tuple[str, Callable[[], None]], ...]] = (
    ("airtruth.identification.regression.rows._moments", _sum),
    ("airtruth.identification.regression.auxiliary._respond_runs", _respond),
    ("airtruth.identification.regression.dynamic_kernel._filtered", _filter),
)
"""Full name of each kernel, and the call that compiles it."""

__all__ = ["KERNELS"]
