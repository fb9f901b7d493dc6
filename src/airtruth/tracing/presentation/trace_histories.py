"""The records of a trace beside the simulations of its stages."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from typing import Final

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError

from airtruth.charts import Panel
from airtruth.logs.histories import Histories, History
from airtruth.logs.provenance import PROVENANCE, Provenance
from airtruth.tracing.answer import TraceAnswer
from airtruth.tracing.inference.assess import Assessment
from airtruth.tracing.inference.posterior import TraceProblem
from airtruth.tracing.model.records import TraceRecord
from airtruth.tracing.presentation.effect_panel import effect_panel
from airtruth.tracing.presentation.shown_record import ShownRecord, shown_record
from airtruth.tracing.stages import Stages, free_run_floor

Array = NDArray[np.float64]

MODELS: Final = ("declared", "before", "after")
"""Stages whose simulations are kept; the control is a number in the table of errors."""
PANEL: Final = "effect"
"""Entry of the facts that holds the panel of the effect."""


def trace_histories(answer: TraceAnswer, stages: Stages, provenance: Provenance) -> Histories:
    """Every record of a trace, fitted ones first, with the simulations of its stages.

    Parameters
    ----------
    answer, stages : of a finished trace.
    provenance : of the trace.
    """
    models = tuple(name for name in MODELS if name in stages.models)
    chosen = shown_record(stages)
    records = [
        *_of(stages, stages.case.fitted, stages.fitted, models, "fitted"),
        *(_of(stages, stages.case.held, stages.held, models, "held out") if stages.case.held else ()),
    ]
    panel = _stated(asdict(effect_panel(answer, chosen)))
    facts = {PANEL: panel, PROVENANCE: provenance.to_dict()}
    return Histories(tuple(records), models, chosen.record.signals.run_id, len(records), facts)


def panel_of(histories: Histories) -> Panel:
    """The panel of the effect; one that says so where the file does not hold it."""
    try:
        return TypeAdapter(Panel).validate_python(histories.facts.get(PANEL))
    except ValidationError:
        return Panel(title="the effect", words="not recorded")


def _of(
    stages: Stages,
    problem: TraceProblem,
    assessed: Mapping[str, list[Assessment]],
    models: tuple[str, ...],
    group: str,
) -> Iterator[History]:
    best, motion = stages.best, problem.layout.motion

    def by_channel(values: Array) -> dict[str, Array]:
        return {channel: values[:, i] for i, channel in enumerate(motion.output_channels)}

    floors = free_run_floor(problem, stages.models[best], assessed[best])
    for i, (record, floor) in enumerate(zip(problem.records, floors, strict=True)):
        own = {name: assessed[name][i] for name in models}
        seen = ShownRecord(stages, record, (models[0], best), own[models[0]], own[best], floor)
        moved = seen.contribution()
        yield History(
            run_id=record.signals.run_id,
            group=group,
            t_s=seen.time_s,
            controls_rad={
                c.channel: series[: record.samples]
                for c, series in zip(motion.controls, record.signals.sampled_controls_rad, strict=True)
            },
            measured=by_channel(record.signals.y),
            models={name: by_channel(record.signals.y - a.residual) for name, a in own.items()},
            innovations={name: by_channel(a.whitened) for name, a in own.items()},
            effect={} if moved is None else by_channel(moved),
            floor=dict(zip(motion.output_channels, floor.tolist(), strict=True)),
            conditions=_conditions(record),
        )


def _stated(value: object) -> object:
    """The value in types that JSON has; a number that is not finite in words, which pydantic reads."""
    if isinstance(value, dict):
        return {key: _stated(v) for key, v in value.items()}
    if isinstance(value, list | tuple):
        return [_stated(v) for v in value]
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value


def _conditions(record: TraceRecord) -> dict[str, float]:
    s, plant = record.signals, record.plant
    constants = plant.aircraft.constants
    signals = [signal.channel for signal in s.motion.signals]
    return {
        "airspeed_m_s": float(s.airspeed_m_s.mean()),
        "density_kg_m3": float(s.density_kg_m3.mean()),
        "altitude_m": float(s.altitude_m),
        "trim_alpha_rad": float(plant.trim_alpha_rad + plant.alpha_shift_rad),
        **{
            f"trim_{c.channel}": float(plant.trim_signals[signals.index(c.channel)])
            for c in s.motion.controls
        },
        "mass_kg": float(constants.mass_kg),
        **{f"{name}_kg_m2": float(getattr(constants, f"{name}_kg_m2")) for name in s.motion.inertias},
        "duration_s": float(s.dt_s * (record.samples - 1)),
        "sample_rate_hz": float(1.0 / s.dt_s),
    }


__all__ = ["MODELS", "PANEL", "panel_of", "trace_histories"]
