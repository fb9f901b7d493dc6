"""The record that the figures of a trace show, and its simulations with and without the effects."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from airtruth.physics.terms import Change
from airtruth.tracing.inference.assess import Assessment
from airtruth.tracing.model.compile import compile_change
from airtruth.tracing.model.records import TraceRecord
from airtruth.tracing.model.response import respond
from airtruth.tracing.stages import StageModel, Stages, free_run_floor

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ShownRecord:
    """One record with its assessment in the two stages that the figures compare.

    Attributes
    ----------
    stages : every stage of the trace.
    record : the record; of the held-out ones if there are any, that whose free run the effects improve most.
    compared : names of the two stages.
    before, after : assessments of the record in these stages.
    floor : (outputs,) root mean squares of a free run that gusts and sensor noise alone explain.
    """

    stages: Stages
    record: TraceRecord
    compared: tuple[str, str]
    before: Assessment
    after: Assessment
    floor: Array

    @property
    def time_s(self) -> Array:
        """(samples,) time from the start of the record [s]."""
        return self.record.signals.dt_s * np.arange(self.record.samples, dtype=np.float64)

    @property
    def change(self) -> Change:
        """The accepted effects, without the declared errors of the sensors; neutral where there are none."""
        model = self.stages.models.get("after")
        return Change() if model is None else model.hypothesis.added(model.sizes)

    def free_run(self, model: StageModel, change: Change) -> Array:
        """(samples, outputs) readings of a simulation with the parameters of the second stage and another change."""
        local = self.after.per_record.copy()
        settings = self.stages.case.fitted.settings
        local[settings.layout.per_record.gusts] = 0.0  # no gust
        compiled = compile_change(change, self.record.signals.motion)
        response = respond(self.record, settings, compiled, model.common, local, free_run=True)
        return np.asarray(self.record.signals.y - response.e)

    def contribution(self) -> Array | None:
        """(samples, outputs) free run with the effects less the free run without; None where there are no effects.

        Released derivatives are part of the effects: without the effects they are the declared ones.
        """
        model = self.stages.models.get("after")
        if model is None:
            return None
        complete, declared = model.hypothesis.change(model.sizes), model.hypothesis.declared
        without = model
        if model.hypothesis.spread is not None:
            common = model.common.copy()
            common[self.stages.case.fitted.layout.common.derivatives] = 0.0
            without = replace(model, common=common)
        return self.free_run(model, complete) - self.free_run(without, declared)


def shown_record(stages: Stages) -> ShownRecord:
    """Choose the record to show."""
    problem, assessed = stages.reported
    compared = ("before", "after") if stages.best == "after" else ("declared", "before")
    if stages.models[stages.best].hypothesis.spread is not None:
        compared = ("declared", stages.best)  # the effects explain what a refit of the derivatives absorbs
    first, second = (assessed[name] for name in compared)
    floors = free_run_floor(problem, stages.models[compared[1]], second)
    gains = [
        float(((a.free_run**2 - b.free_run**2) / level**2).sum())
        for a, b, level in zip(first, second, floors, strict=True)
    ]
    at = int(np.argmax(np.nan_to_num(gains, nan=-np.inf)))
    return ShownRecord(stages, problem.records[at], compared, first[at], second[at], floors[at])


__all__ = ["ShownRecord", "shown_record"]
