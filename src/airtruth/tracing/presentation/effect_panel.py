"""A traced effect drawn by its kind: a surface, a curve of a coefficient, a declared value, a sensor."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.channels import SIGNALS, shown
from airtruth.charts import Band, Line, Mark, Panel, Rule
from airtruth.effects.registry import EFFECTS
from airtruth.physics.terms import OUTPUTS, AeroTerm, Change, shape_of
from airtruth.table import significant
from airtruth.tracing.accepted import AcceptedEffect, IncrementTable
from airtruth.tracing.answer import TraceAnswer
from airtruth.tracing.model.records import FINE, TraceRecord
from airtruth.tracing.model.surface import through
from airtruth.tracing.presentation.curves import angles_of, curve_of
from airtruth.tracing.presentation.shown_record import ShownRecord
from airtruth.tracing.presentation.text import unit_of
from airtruth.units import DEG

Array = NDArray[np.float64]

_AROUND_S: Final = 2.5
"""Width of the shown part of a sensor's channel [s] (judgement: one doublet)."""
_DENSITY: Final = 0.2
"""Height of the density of the samples over that of the band [-] (judgement)."""
_EDGE_S: Final = 0.8
"""Width of the shown part of a control [s] (judgement: one edge of a doublet)."""


def effect_panel(answer: TraceAnswer, shown_: ShownRecord) -> Panel:
    """Draw the first effect in the form that suits its kind."""
    change = shown_.change
    table = next((e for e in answer.effects if e.table is not None), None)
    if table is not None:
        return learned_panel(table, table.table)
    if change.surface:
        return _surface(shown_.record, change)
    angles = angles_of(shown_.record)
    if change.aero and change.aero[0].signal in angles and not change.aero[0].factor and not change.states:
        return _curve(shown_, change.aero)
    if change.sensors:
        return _sensor(answer, shown_, change)
    if change.declared or (answer.effects and not change.aero and not change.readings):
        return _estimates(answer)
    if change.readings:
        return _motion(shown_, change.readings[0].channel)
    if change.aero:
        return _motion(shown_)
    return Panel(title="the effect", words="no effect accepted")


def line(x: Iterable[float], y: Iterable[float]) -> Line:
    """A solid curve of two arrays."""
    return Line(tuple(map(float, x)), tuple(map(float, y)))


def _surface(record: TraceRecord, change: Change) -> Panel:
    s = record.signals
    step = s.dt_s / (s.sub * FINE)
    name = change.surface[0].control
    control = s.controls_rad[[c.name for c in s.motion.controls].index(name)]
    air = through(change.of_surface(name), control, step)
    time = np.arange(len(air)) * step
    middle = float(time[int(np.argmax(np.abs(air - control)))])
    span = np.abs(time - middle) < 0.5 * _EDGE_S
    measured, seen = (line(time[span], v[span] / DEG) for v in (control, air))
    return Panel(
        title="the effect: surface",
        x_label="time [s]",
        y_label=f"{name} [deg]",
        lines=(
            replace(measured, label="measured", colour="grey"),
            replace(seen, label="as the air sees it", colour="vermillion", stroke="dashed"),
        ),
    )


def _curve(shown_: ShownRecord, terms: tuple[AeroTerm, ...]) -> Panel:
    """Coefficient over its signal: the declared one, refitted, and with the effect."""
    first, motion = terms[0], shown_.record.signals.motion
    own = curve_of(shown_.record, first)
    fine = np.linspace(*own.ends, 201)
    declared = np.interp(fine, own.over, own.declared)
    models = shown_.stages.models
    before, after = declared, declared
    if first.coefficient in [c.name for c in motion.coefficients]:
        derivative = motion.at(first.coefficient, first.signal)
        before = declared + models["before"].common[derivative] * (fine - own.trim)
        after = declared + models["after"].common[derivative] * (fine - own.trim)
    for term in terms:
        if term.signal == first.signal and term.coefficient == first.coefficient:
            after = after + term.amplitude * shape_of(term, fine)
    angle = (fine + own.shift) / DEG
    low, high = own.flown
    return Panel(
        title=f"the effect: {first.coefficient}",
        x_label=f"{first.signal} [deg]",
        y_label=f"{first.coefficient} [-]",
        lines=(
            replace(line(angle, declared), label="declared", colour="grey"),
            replace(line(angle, before), label="before", stroke="dotted"),
            replace(line(angle, after), label="after", colour="vermillion", stroke="dashed"),
        ),
        bands=(Band(low / DEG, high / DEG, axis="x", label="flown"),),
    )


def learned_panel(effect: AcceptedEffect, table: IncrementTable | None) -> Panel:
    """A learned increment with its band, and the density of the samples below it."""
    if table is None:
        return Panel(title="the effect", words="no table")
    over = effect.over or ""
    factor, unit = (1.0 / DEG, "deg") if over.endswith("_rad") else (1.0, "Pa" if over == "qbar_pa" else "-")
    subject, scale = _subject(effect)
    behind = "state driven by " if effect.states and not effect.by else ""
    x = [factor * at for at in table.at]
    value, lower, upper = (
        tuple(scale * v for v in values) for values in (table.value, table.low, table.high)
    )
    bottom, top = min(lower), max(upper)
    most = max(*table.samples, 1)
    density = [bottom - (top - bottom) * _DENSITY * (1.0 - n / most) for n in table.samples]
    return Panel(
        title=f"the effect: increment of {effect.subject}",
        x_label=f"{behind}{over.removesuffix('_rad').removesuffix('_pa')} [{unit}]",
        y_label=f"increment of {subject}",
        lines=(
            replace(line(x, value), label="learned", colour="vermillion"),
            replace(line(x, lower), label="95 % band", colour="vermillion", stroke="dotted"),
            replace(line(x, upper), colour="vermillion", stroke="dotted"),
            replace(line(x, density), label="density of the samples", colour="grey"),
        ),
    )


def _subject(effect: AcceptedEffect) -> tuple[str, float]:
    """Quantity that a learned increment changes, with its display unit, and the factor to this unit from SI."""
    acts_on, by = effect.acts_on or "", effect.by or ""
    if acts_on in OUTPUTS and not by:
        return shown(acts_on)
    own = SIGNALS[acts_on].unit if acts_on in OUTPUTS else ""
    unit = (f"{own or 1}/rad" if by.endswith("_rad") else own) or "-"
    return f"{effect.subject} [{unit}]", 1.0


def _sensor(answer: TraceAnswer, shown_: ShownRecord, change: Change) -> Panel:
    """The measured channel about the largest difference, with the simulation through either sensor."""
    channels = shown_.record.signals.motion.output_channels
    channel = next((t.channel for t in change.sensors if t.channel in channels), None)
    if channel is None:
        return _estimates(answer)
    model = shown_.stages.models["after"]
    i, factor = channels.index(channel), shown(channel)[1]
    full = model.hypothesis.change(model.sizes)
    rest = replace(full, sensors=model.hypothesis.declared.sensors)
    complete, declared = (shown_.free_run(model, c)[:, i] * factor for c in (full, rest))
    time_s = shown_.time_s
    middle = float(time_s[int(np.argmax(np.abs(complete - declared)))])
    span = (time_s >= middle - 0.5 * _AROUND_S) & (time_s <= middle + 0.5 * _AROUND_S)
    measured = shown_.record.signals.y[span, i] * factor
    return Panel(
        title="the effect: sensor",
        x_label="time [s]",
        y_label=shown(channel)[0],
        lines=(
            replace(line(time_s[span], measured), label="measured", colour="grey", stroke="points"),
            replace(line(time_s[span], declared[span]), label="sensor as declared", stroke="dotted"),
            replace(
                line(time_s[span], complete[span]),
                label="with the effect",
                colour="vermillion",
                stroke="dashed",
            ),
        ),
    )


def _estimates(answer: TraceAnswer) -> Panel:
    """Estimates with their 95 % intervals, beside the declared values."""
    rows: list[str] = []
    marks = []
    for effect in answer.effects:
        for name, estimate in effect.parameters.items():
            low, high = (estimate.value if x is None else x for x in estimate.ci95)
            marks.append(
                Mark(len(rows), estimate.value, low, high, label="estimate, 95 %", colour="vermillion")
            )
            size = f"{significant(estimate.value)} {unit_of(effect.key, name)}".rstrip()
            # the heading of the figure names a single effect; a long row would narrow the panels
            of = f"{effect.key} " if len(answer.effects) > 1 else ""
            rows.append(f"{of}{name} = {size}")
    known = (EFFECTS[e.key] for e in answer.effects if e.key in EFFECTS)
    neutral = {p.neutral for effect in known for p in effect.parameters if not p.is_location}
    return Panel(
        title="the effect: value and 95 % interval",
        rows=tuple(rows),
        marks=tuple(marks),
        rules=tuple(Rule(x, label="as declared") for x in sorted(neutral) if math.isfinite(x)),
    )


def _motion(shown_: ShownRecord, channel: str = "") -> Panel:
    """An effect with memory: a channel of the simulation with it and without; by default the first rate."""
    model = shown_.stages.models["after"]
    motion = shown_.record.signals.motion
    channel = channel or next(o.channel for o in motion.outputs if o.instrument == "gyro")
    label, factor = shown(channel)
    i, time_s = motion.output_channels.index(channel), shown_.time_s
    runs = (
        shown_.free_run(model, change)[:, i] * factor
        for change in (model.hypothesis.declared, model.hypothesis.change(model.sizes))
    )
    measured, without, complete = (line(time_s, y) for y in (shown_.record.signals.y[:, i] * factor, *runs))
    return Panel(
        title="the effect: motion with and without it",
        x_label="time [s]",
        y_label=label,
        lines=(
            replace(measured, label="measured", colour="grey", stroke="points"),
            replace(without, label="without the effect", stroke="dotted"),
            replace(complete, label="with the effect", colour="vermillion", stroke="dashed"),
        ),
    )


__all__ = ["effect_panel", "learned_panel", "line"]
