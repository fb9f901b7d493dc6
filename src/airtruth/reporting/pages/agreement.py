"""Tables of R2 and Theil's coefficient of the simulations, pooled over the records and of each record."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.channels import shown
from airtruth.logs.histories import Histories, History
from airtruth.numerics.agreement import Agreement, agreement
from airtruth.table import Group, Number, Row, Table, flat

Array = NDArray[np.float64]

_HELD: Final = "held out"
"""Group of the records that a trace did not fit."""
_NOTE: Final = (
    "R2: share of the measured variance that the simulation explains. U: Theil's inequality coefficient, 0 for a perfect "
    "match, 1 for the worst (Jategaonkar, 2015). bias, variance, covariance: shares of the mean "
    "square error that come from different means, different amplitudes, and a lack of correlation. Each record counts "
    "about its measured mean."
)
"""Meaning of the figures."""


def agreement_table(histories: Histories) -> Table:
    """R2, Theil's coefficient and its proportions per channel and model, pooled over the records.

    Of a trace with held-out records, these alone count.
    """
    held = [r for r in histories.records if r.group == _HELD]
    records = held or list(histories.records)
    over = "held-out records" if held else "records" if len(records) > 1 else "record"
    groups = []
    for channel in histories.first.measured:
        rows: list[Row] = []
        for model in histories.models:
            a = _pooled(records, model, channel)
            shares = (Number(100.0 * x, decimals=0) for x in (a.bias, a.variance, a.covariance))
            rows.append((model, Number(a.r2, decimals=3), Number(a.theil, decimals=3), *shares))
        groups.append(Group(_name(channel), tuple(rows)))
    return Table(
        title=f"Agreement of the simulations over {len(records)} {over}",
        columns=("", "R2", "U", "bias [%]", "variance [%]", "covariance [%]"),
        groups=tuple(groups),
        notes=(_NOTE,),
    )


def agreement_of_records(histories: Histories) -> Table:
    """R2 and Theil's coefficient of every record, channel and model."""
    rows: list[Row] = []
    for record in histories.records:
        for channel in record.measured:
            cells: list[Number] = []
            for model in histories.models:
                a = _pooled([record], model, channel)
                cells += [Number(a.r2, decimals=3), Number(a.theil, decimals=3)]
            rows.append((record.run_id, _name(channel), *cells))
    columns = [f"{figure} {model}" for model in histories.models for figure in ("R2", "U")]
    return replace(
        flat("R2 and Theil's coefficient U, per record", ("record", "channel", *columns), rows), keys=2
    )


def _pooled(records: Sequence[History], model: str, channel: str) -> Agreement:
    """Agreement over the samples of all records, each less its measured mean."""
    own = [r for r in records if np.isfinite(r.models[model][channel]).all()]
    if not own:
        return Agreement(*[math.nan] * 5)
    means = [r.measured[channel].mean() for r in own]
    measured, simulated = (
        np.concatenate([values[channel] - mean for values, mean in zip(each, means, strict=True)])
        for each in ([r.measured for r in own], [r.models[model] for r in own])
    )
    return agreement(measured, simulated)


def _name(channel: str) -> str:
    return shown(channel)[0].split(" [")[0]


__all__ = ["agreement_of_records", "agreement_table"]
