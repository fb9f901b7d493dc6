"""Charts of a trace: residuals of the stages with the effect; candidates; shifts of the derivatives; innovations."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from airtruth.channels import shown
from airtruth.charts import Band, Bar, Chart, Colour, Mark, Panel, Rule, Stroke, colours_of
from airtruth.logs.histories import Histories, History
from airtruth.table import significant
from airtruth.tracing.answer import CandidateScore, TraceAnswer
from airtruth.tracing.presentation.candidates import ranked
from airtruth.tracing.presentation.effect_panel import line
from airtruth.tracing.presentation.error_table import MEANING, stages_of
from airtruth.tracing.presentation.text import FAR_SIGMA, headline
from airtruth.tracing.presentation.trace_histories import panel_of

Array = NDArray[np.float64]

LEVEL: Final = 0.05
"""Level of Holm's rule that the scores are drawn against [-]; that of the first round of the search."""
_COLOURS: Final[tuple[Colour, ...]] = ("blue", "vermillion", "green", "purple", "orange")
"""Colours of the channels, in their order, where one panel shows several."""
_STROKES: Final[tuple[Stroke, ...]] = ("solid", "dashed", "dotted", "solid", "dashed")
"""Strokes beside their colours."""
_SMALLEST: Final = 1e-290
"""Probability up to which a p-value is converted to a normal variable [-] (above underflow)."""
_LARGEST_SIGMA: Final = 36.0
"""Size of a normal variable with that probability [-], as -ndtri(0.5e-290) = 36.4."""
_MODEL_STROKES: Final[tuple[Stroke, ...]] = ("dashed", "solid", "dotted")
"""Strokes beside the colours of the models, in their order."""
_POINTS: Final = 600
"""Most points of a curve of a chart [-]; judgement: two per pixel of a panel."""
_LAGS: Final = 50
"""Most lags of an autocorrelation [-] (judgement)."""


def trace_chart(answer: TraceAnswer, histories: Histories) -> Chart:
    """Residuals of one record's free run: as declared; the effect; before and after.

    The first column shows the declared model alone, and the third has the same scales. Without an accepted effect, the
    record beside its simulations, and the residuals.
    """
    record = histories.first
    if not record.effect:
        return _without_effect(answer, histories)
    channels, colours = list(record.measured), colours_of(histories.models)
    best = histories.models[-1]
    left = [_residuals(record, channel, histories.models[:1], colours) for channel in channels]
    right = [_residuals(record, channel, histories.models[1:], colours) for channel in channels]
    middle = [panel_of(histories), _contribution(record), _stages(answer)]
    middle += [_control(record, name) for name in record.controls_rad][: len(channels) - len(middle)]
    panels = []
    for i, (first, centre, last) in enumerate(zip(left, middle, right, strict=True)):
        ends = (
            min(first.y_range()[0], last.y_range()[0]),
            max(first.y_range()[1], last.y_range()[1]),
        )
        titles = ("residual as declared", f"residual {best}") if i == 0 else ("", "")
        panels += [
            replace(first, y_limits=ends, title=titles[0]),
            centre,
            replace(last, y_limits=ends, title=titles[1]),
        ]
    group = f", {record.group}" if record.group else ""
    return Chart(
        name="trace",
        title=f"{headline(answer)}. Residual as declared, the effect, residual {best}",
        panels=tuple(panels),
        columns=3,
        caption=f"Free runs of record {record.run_id}{group}. Shaded: two standard deviations of the response to gusts "
        f"and sensor noise. {_meanings(stages_of(answer))}",
        legend=False,
    )


def _without_effect(answer: TraceAnswer, histories: Histories) -> Chart:
    """One record beside its simulations, and their residuals, where no effect was accepted."""
    record = histories.first
    step = max(1, -(-len(record.t_s) // _POINTS))
    colours = colours_of(histories.models)
    panels = []
    for i, channel in enumerate(record.measured):
        name, factor = shown(channel)
        measured = line(record.t_s[::step], record.measured[channel][::step] * factor)
        lines = [replace(measured, label="measured", colour="ink", stroke="points")]
        residuals = []
        # the declared model last and dashed: a refitted one that is the same would hide it
        for model, stroke in reversed(list(zip(histories.models, _MODEL_STROKES, strict=False))):
            colour = colours[model]
            y = record.models[model][channel][::step] * factor
            lines.append(replace(line(record.t_s[::step], y), label=model, colour=colour, stroke=stroke))
            residual = record.residual(model, channel)[::step] * factor
            residuals.append(replace(line(record.t_s[::step], residual), colour=colour, stroke=stroke))
        floor = 2.0 * record.floor.get(channel, np.nan) * factor
        time = "time [s]" if i == len(record.measured) - 1 else ""
        titles = ("measured and simulated", "residual") if i == 0 else ("", "")
        panels += [
            Panel(titles[0], time, name, tuple(lines)),
            Panel(
                titles[1],
                time,
                name.replace(" [", " residual ["),
                tuple(residuals),
                bands=(Band(-floor, floor, label="two standard deviations of gusts and noise"),),
            ),
        ]
    group = f", {record.group}" if record.group else ""
    return Chart(
        name="trace",
        title=f"{headline(answer)}. One record beside the declared and the refitted model",
        panels=tuple(panels),
        columns=2,
        caption=f"Free runs of record {record.run_id}{group}. {_meanings(histories.models)}",
    )


def _meanings(stages: Iterable[str]) -> str:
    """Explanation of the stages, as a sentence."""
    return "; ".join(MEANING[name] for name in stages if name in MEANING).capitalize() + "."


def _residuals(record: History, channel: str, models: Sequence[str], colours: Mapping[str, Colour]) -> Panel:
    name, factor = shown(channel)
    floor = 2.0 * record.floor.get(channel, np.nan) * factor
    step = max(1, -(-len(record.t_s) // _POINTS))
    lines = []
    for model in models:
        residual = record.residual(model, channel)[::step] * factor
        label = model if channel == next(iter(record.measured)) else ""
        lines.append(replace(line(record.t_s[::step], residual), label=label, colour=colours[model]))
    last = channel == list(record.measured)[-1]
    return Panel(
        x_label="time [s]" if last else "", y_label=name, lines=tuple(lines), bands=(Band(-floor, floor),)
    )


def _contribution(record: History) -> Panel:
    """The effects' part of the outputs, over the floor."""
    title = "effect on the outputs"
    if not record.effect:
        return Panel(title=title, words="no effect on this record")
    step = max(1, -(-len(record.t_s) // _POINTS))
    return Panel(
        title=title,
        x_label="time [s]",
        y_label="effect [σ of the floor]",
        lines=tuple(
            replace(
                line(record.t_s[::step], moved[::step] / (record.floor.get(channel) or np.nan)),
                label=_short(channel),
                colour=colour,
                stroke=stroke,
            )
            for (channel, moved), colour, stroke in zip(
                record.effect.items(), _COLOURS, _STROKES, strict=False
            )
        ),
    )


def _control(record: History, channel: str) -> Panel:
    """A control of the record."""
    name, factor = shown(channel)
    step = max(1, -(-len(record.t_s) // _POINTS))
    drawn = line(record.t_s[::step], record.controls_rad[channel][::step] * factor)
    return Panel(x_label="time [s]", y_label=name, lines=(replace(drawn, colour="ink"),))


def _short(channel: str) -> str:
    return shown(channel)[0].split(" ")[0]


def _stages(answer: TraceAnswer) -> Panel:
    """Root mean squares of every stage over the floor, free run and innovations."""
    records = "held_out" if answer.records.held_out else "fit"
    names = stages_of(answer)
    by_stage = {name: answer.error.stages[name].on(records) for name in names}
    floor = by_stage.get("floor")
    if floor is None:
        return Panel(title="rms over the floor", words="no floor recorded")
    marks = []
    for channel, colour in zip(answer.motion.output_channels, _COLOURS, strict=False):
        for row, rms in enumerate(by_stage.values()):
            if rms is not None and channel in rms.free_run and floor.free_run.get(channel):
                value = rms.free_run[channel] / floor.free_run[channel]
                marks.append(Mark(row - 0.15, value, label=_short(channel), colour=colour))
            if rms is not None and channel in rms.innovation and floor.innovation.get(channel):
                value = rms.innovation[channel] / floor.innovation[channel]
                marks.append(Mark(row + 0.2, value, colour=colour, small=True))
    return Panel(
        title="rms over the floor",
        x_label="ratio [-]; large: free run, small: innovation",
        rows=tuple(names),
        marks=tuple(marks),
        rules=(Rule(1.0),),
    )


def scores_chart(answer: TraceAnswer) -> Chart:
    """Significance of each candidate alone, and the level that Holm's rule asks for; accepted effects on top.

    The gain of the refit stands beside each accepted effect, because some are accepted on their refit.
    """
    rows = [r for r in ranked(answer) if r.candidate.testable]
    leading = {e.key for e in answer.effects}
    alike = {name for e in answer.effects for name in e.indistinguishable_from}
    sigma = [_sigma(r.candidate) for r in rows]
    needed = _needed(sigma)
    bars, refused = [], []
    for at, r in enumerate(rows):
        accepted, same = r.candidate.key in leading, r.candidate.name in alike
        colour: Colour = "vermillion" if accepted else "orange" if same else "blue"
        label = "accepted" if accepted else "looks the same" if same else "not accepted"
        words = [] if colour == "blue" else [label]
        if colour == "blue" and sigma[at] > needed[at]:
            refused.append(f"{r.candidate.key} ({r.outcome})")
        words += [] if r.gain is None else [f"refit gains {significant(r.gain)} in 2 log L"]
        bars.append(Bar(at, sigma[at], label, colour, ": ".join(words)))
    holm = replace(
        line(needed, np.arange(len(rows))),
        label=f"Holm, {100.0 * LEVEL:g} % over all",
        colour="ink",
        stroke="dashed",
    )
    panel = Panel(
        x_label="significance of the score [σ of a normal distribution]",
        rows=tuple(r.candidate.key for r in rows),
        bars=tuple(bars),
        lines=(holm,) if rows else (),
        words="" if rows else "no candidate can be tested",
    )
    return Chart(
        name="scores",
        title=f"{headline(answer)}. Candidates at the refitted aircraft without effects",
        panels=(panel,),
        columns=1,
        caption="An effect is accepted on the gain of its refit, which can be large although its score is small."
        + (f" Beyond the line and not accepted: {', '.join(refused)}." if refused else ""),
    )


def _needed(sigma: Sequence[float]) -> Array:
    """Significance that Holm's rule asks for in each row; it goes by significance, whatever the order of the rows."""
    order = np.argsort(-np.array(sigma), kind="stable")
    needed = np.empty(len(sigma))
    needed[order] = -ndtri(0.5 * LEVEL / (len(sigma) - np.arange(len(sigma))))
    return needed


def _sigma(candidate: CandidateScore) -> float:
    """The p-value as the size of a normal variable; where it underflows, the root of the score."""
    if candidate.p_value_alone > _SMALLEST:
        return float(-ndtri(0.5 * candidate.p_value_alone))
    return max(abs(candidate.z), _LARGEST_SIGMA)


def shifts_chart(answer: TraceAnswer) -> Chart | None:
    """Shift of each derivative over its declared standard deviation, with its 95 % interval; None without a test."""
    if answer.declared_model is None:
        return None
    shifts = answer.declared_model.shifts
    marks = []
    for row, s in enumerate(shifts.values()):
        scale = 1.0 / s.declared_std if s.declared_std else np.nan
        low, high = ((end - s.declared) * scale for end in s.ci95)
        marks.append(
            Mark(row, (s.estimate - s.declared) * scale, low, high, label="estimate and 95 % interval")
        )
    return chart_of_shifts(
        tuple(shifts), tuple(marks), "The declared standard deviation includes mass, inertia and CG."
    )


def chart_of_shifts(names: tuple[str, ...], marks: tuple[Mark, ...], caption: str) -> Chart:
    """Chart of shifts of the derivatives, in declared standard deviations.

    Parameters
    ----------
    names : one row each; marks : estimates in these rows; caption : what they are.
    """
    far = [name for row, name in enumerate(names) if any(_is_far(m) for m in marks if round(m.row) == row)]
    beyond = f"{', '.join(far)} beyond" if far else "all within"
    panel = Panel(
        x_label="shift [declared standard deviations]",
        rows=names,
        marks=marks,
        rules=(Rule(0.0, label="as declared"),),
        bands=(Band(-FAR_SIGMA, FAR_SIGMA, axis="x", label="two declared standard deviations"),),
    )
    return Chart(
        name="shifts",
        title=f"Shifts of the derivatives from their declaration: {beyond} two standard deviations",
        panels=(panel,),
        columns=1,
        caption=caption,
    )


def _is_far(mark: Mark) -> bool:
    return abs(mark.value) > FAR_SIGMA


def innovations_chart(histories: Histories) -> Chart:
    """Whitened innovations of one record as declared and of the last stage, and the autocorrelation of both."""
    record = histories.first
    models = list(dict.fromkeys((histories.models[0], histories.models[-1])))
    return Chart(
        name="innovations",
        title=f"Whitened innovations and their autocorrelation, {' and '.join(models)}",
        panels=tuple(
            p
            for channel in record.measured
            for p in _whiteness(record, channel, models, colours_of(histories.models))
        ),
        columns=len(models) + 1,
        caption=f"Record {record.run_id}. {_meanings(models)}",
    )


def _whiteness(
    record: History, channel: str, models: Sequence[str], colours: Mapping[str, Colour]
) -> Iterator[Panel]:
    """A panel of innovations for each model with one scale, so that none hides another; then the autocorrelations."""
    n = len(record.t_s)
    step = max(1, -(-n // _POINTS))
    lags = np.arange(1, min(_LAGS + 1, max(2, n // 4)))
    dt = float(record.t_s[1] - record.t_s[0]) if n > 1 else np.nan
    bound = float(-ndtri(0.025) / np.sqrt(n))
    series, correlations = [], []
    for model, stroke in zip(models, _MODEL_STROKES, strict=False):
        colour = colours[model]
        e = record.innovations.get(model, {}).get(channel)
        if e is None:
            continue
        series.append(replace(line(record.t_s[::step], e[::step]), label=model, colour=colour))
        correlations.append(
            replace(line(lags * dt, _correlation(e, lags)), label=model, colour=colour, stroke=stroke)
        )
    white = "95 % of white noise"
    panels = [
        Panel(
            title=own.label,
            x_label="time [s]",
            y_label=f"{_short(channel)} [\u03c3]",
            lines=(own,),
            bands=(Band(-1.96, 1.96, label=white),),
        )
        for own in series
    ]
    ends = [panel.y_range() for panel in panels]
    for panel in panels:
        both = (min(low for low, _ in ends), max(high for _, high in ends))
        yield replace(panel, y_limits=both)
    yield Panel(
        title="autocorrelation",
        x_label="lag [s]",
        y_label=f"{_short(channel)} [-]",
        lines=tuple(correlations),
        bands=(Band(-bound, bound, label=white),),
    )


def _correlation(e: Array, lags: NDArray[np.int64]) -> Array:
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        x = e - e.mean()
        total = float(x @ x)
        return np.array([float(x[k:] @ x[:-k]) / total if total else np.nan for k in lags])


def trace_charts(answer: TraceAnswer, histories: Histories | None) -> list[Chart]:
    """Every chart of a trace that its data allow, that of the answer first."""
    shifts = shifts_chart(answer)
    return [
        *([trace_chart(answer, histories)] if histories else []),
        *([shifts] if shifts else []),
        scores_chart(answer),
        *([innovations_chart(histories)] if histories else []),
    ]


__all__ = [
    "chart_of_shifts",
    "innovations_chart",
    "scores_chart",
    "shifts_chart",
    "trace_chart",
    "trace_charts",
]
