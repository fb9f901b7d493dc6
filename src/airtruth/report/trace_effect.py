"""A traced effect drawn by its kind: a surface, a curve of a coefficient, a declared value, a sensor."""

from __future__ import annotations

from typing import Final

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from airtruth.effects.change import AeroTerm, Change
from airtruth.report import style
from airtruth.report.trace_table import figures, shown
from airtruth.trace import Trace
from airtruth.trace.answer import Model
from airtruth.trace.holdout import Assessment
from airtruth.trace.lower import CHANNELS, lower
from airtruth.trace.model import respond
from airtruth.trace.records import FINE, Record
from airtruth.trace.surface import through
from airtruth.units import DEG

Array = NDArray[np.float64]

_CURVES: Final = ("alpha", "elevator")
_AROUND_S: Final = 2.5
_EDGE_S: Final = 0.8


def change_of(found: Trace) -> Change:
    """What the accepted effects change, without what aircraft.toml declares; neutral without any."""
    model = found.outcome.models.get("after")
    if model is None:
        return Change()
    return model.hypothesis.added(model.sizes)


def contribution(found: Trace, record: Record, own: Assessment) -> Array | None:
    """(samples, 3) outputs of the free run with the effects less those without, all else equal; None without any."""
    model = found.outcome.models.get("after")
    if model is None:
        return None
    with_, without = (
        _free_run(found, record, own, model, change)
        for change in (model.hypothesis.change(model.sizes), model.hypothesis.declared)
    )
    return with_ - without


def _free_run(found: Trace, record: Record, own: Assessment, model: Model, change: Change) -> Array:
    local = own.local.copy()
    local[2:4] = 0.0
    response = respond(record, found.case.fitted.settings, lower(change), model.shared, local, free_run=True)
    return np.asarray(record.signals.y - response.e)


def draw_effect(ax: Axes, found: Trace, record: Record, own: Assessment, time_s: Array) -> None:
    """Draw the first effect into ``ax``, as its kind asks."""
    change = change_of(found)
    if change.surface:
        _surface(ax, record, change)
    elif change.aero and change.aero[0].signal in _CURVES and not change.states:
        _curve(ax, found, record, change.aero)
    elif change.sensors:
        _sensor(ax, found, record, own, change, time_s)
    elif change.declared:
        _declared(ax, found)
    elif change.aero:
        _moment(ax, found, record, own, time_s)
    else:
        ax.text(
            0.5, 0.5, "no effect accepted", transform=ax.transAxes, ha="center", va="center", color=style.GREY
        )
        ax.set_title("the effect")


def _surface(ax: Axes, record: Record, change: Change) -> None:
    s = record.signals
    step = s.dt_s / (s.sub * FINE)
    air = through(change.surface, s.elevator_rad, step)
    time = np.arange(len(air)) * step
    middle = float(time[int(np.argmax(np.abs(air - s.elevator_rad)))])
    span = np.abs(time - middle) < 0.5 * _EDGE_S
    ax.plot(time[span], s.elevator_rad[span] / DEG, color=style.GREY, label="measured")
    ax.plot(time[span], air[span] / DEG, "--", color=style.VERMILLION, label="as the air sees it")
    ax.set(xlabel="time [s]", ylabel="elevator [deg]", title="the effect: surface")
    ax.legend(loc="best", fontsize=7.5)


def _curve(ax: Axes, found: Trace, record: Record, terms: tuple[AeroTerm, ...]) -> None:
    """Coefficient over its signal: the declared one, refitted, and with the effect."""
    first = terms[0]
    plant = record.plant
    c = plant.aircraft.constants
    over = plant.alpha_rad if first.signal == "alpha" else plant.elevator_rad
    at = {"alpha": plant.trim_alpha_rad, "elevator": plant.trim_elevator_rad}
    fine = np.linspace(over[0], over[-1], 201)
    middle = plant.values[:, :, int(np.argmin(np.abs(plant.qhat)))]
    other = plant.elevator_rad if first.signal == "alpha" else plant.alpha_rad
    j = int(np.argmin(np.abs(other - at["elevator" if first.signal == "alpha" else "alpha"])))
    slice_ = middle[:, j] if first.signal == "alpha" else middle[j]
    moment = first.coefficient == "Cm"
    table = slice_[:, 2] / (c.wing_area_m2 * c.chord_m) if moment else -slice_[:, 1] / c.wing_area_m2
    declared = np.interp(fine, over, table)
    place = (3 if moment else 0) + (0 if first.signal == "alpha" else 2)
    models = found.outcome.models
    offset = fine - at[first.signal]
    before = declared + models["before"].shared[place] * offset
    after = declared + models["after"].shared[place] * offset
    for term in terms:
        if term.signal == first.signal and term.coefficient == first.coefficient:
            after = after + term.amplitude * _shape(term, fine)
    unit = 1.0 / DEG
    ax.plot(fine * unit, declared, color=style.GREY, label="declared")
    ax.plot(fine * unit, before, ":", color=style.BLUE, label="before")
    ax.plot(fine * unit, after, "--", color=style.VERMILLION, label="after")
    flown = (
        record.signals.y[:, 0] - plant.alpha_shift_rad
        if first.signal == "alpha"
        else record.signals.elevator_rad
    )
    ax.axvspan(flown.min() * unit, flown.max() * unit, color=style.SKY, alpha=0.2, lw=0.0, label="flown")
    ax.set(xlabel=f"{first.signal} [deg]", ylabel=first.coefficient, title=f"the effect: {first.coefficient}")
    ax.legend(loc="best", fontsize=7.5)


def _shape(term: AeroTerm, signal: Array) -> Array:
    s = signal - term.at
    if term.shape == "quadratic":
        return np.asarray(s**2)
    if term.shape == "above":
        return np.asarray(np.maximum(s, 0.0))
    return np.asarray(np.minimum(s, 0.0)) if term.shape == "below" else s


def _sensor(ax: Axes, found: Trace, record: Record, own: Assessment, change: Change, time_s: Array) -> None:
    channel = next((t.channel for t in change.sensors if t.channel in CHANNELS), None)
    if channel is None:
        _declared(ax, found)
        return
    model = found.outcome.models["after"]
    i, factor = CHANNELS.index(channel), shown(channel)[1]
    full = model.hypothesis.change(model.sizes)
    rest = Change(
        full.surface, full.states, full.aero, full.declared, model.hypothesis.declared.sensors, full.air
    )
    with_ = _free_run(found, record, own, model, full)[:, i] * factor
    without = _free_run(found, record, own, model, rest)[:, i] * factor
    middle = float(time_s[int(np.argmax(np.abs(with_ - without)))])
    span = (time_s >= middle - 0.5 * _AROUND_S) & (time_s <= middle + 0.5 * _AROUND_S)
    ax.plot(time_s[span], record.signals.y[span, i] * factor, ".", color=style.GREY, ms=3.0, label="measured")
    ax.plot(time_s[span], without[span], ":", color=style.BLUE, label="sensor as declared")
    ax.plot(time_s[span], with_[span], "--", color=style.VERMILLION, label="with the effect")
    ax.set(xlabel="time [s]", ylabel=shown(channel)[0], title="the effect: sensor")
    ax.legend(loc="best", fontsize=7.5)


def _declared(ax: Axes, found: Trace) -> None:
    """Sizes over what is plausible: value and 95 % interval, beside the declared one."""
    names, y = [], 0
    for effect in found.answer["effects"]:
        for name, value in effect["parameters"].items():
            low, high = (value["value"] if x is None else x for x in value["ci95"])
            ax.plot([low, high], [y, y], color=style.VERMILLION, lw=2.0)
            ax.plot(value["value"], y, "o", color=style.VERMILLION)
            names.append(f"{effect['name']}\n{name} = {figures(value['value'])}")
            y += 1
    neutral = {
        p.neutral
        for e in found.outcome.models["after"].hypothesis.effects
        for p in e.parameters
        if not p.place
    }
    for x in neutral - {float("inf")}:
        ax.axvline(x, color=style.GREY, lw=1.0, label="as declared")
    ax.set_yticks(range(y), names)
    ax.set_ylim(-0.8, y - 0.2)
    ax.set_title("the effect: value and 95 % interval")
    ax.legend(loc="best", fontsize=7.5)


def _moment(ax: Axes, found: Trace, record: Record, own: Assessment, time_s: Array) -> None:
    """An effect with memory: the angle of attack of the free run with it and without."""
    model = found.outcome.models["after"]
    runs = {
        "without the effect": (
            _free_run(found, record, own, model, model.hypothesis.declared),
            ":",
            style.BLUE,
        ),
        "with the effect": (
            _free_run(found, record, own, model, model.hypothesis.change(model.sizes)),
            "--",
            style.VERMILLION,
        ),
    }
    factor = shown("q_rad_s")[1]
    ax.plot(time_s, record.signals.y[:, 1] * factor, ".", color=style.GREY, ms=2.5, label="measured")
    for label, (run, line, colour) in runs.items():
        ax.plot(time_s, run[:, 1] * factor, line, color=colour, label=label)
    ax.set(xlabel="time [s]", ylabel="pitch rate [deg/s]", title="the effect: motion with it and without")
    ax.legend(loc="best", fontsize=7.5)


__all__ = ["change_of", "contribution", "draw_effect"]
