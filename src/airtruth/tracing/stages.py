"""Stages of a trace: the models that its report compares, assessed on the fitted and on the held-out records."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airtruth.tracing.inference.assess import Assessment, assess, fitted_noise_floor
from airtruth.tracing.inference.feedback import responds_to_motion
from airtruth.tracing.inference.hypothesis import Hypothesis
from airtruth.tracing.inference.posterior import PosteriorFit, TraceProblem
from airtruth.tracing.model.settings import Settings, initial_per_record
from airtruth.tracing.prepare import Case
from airtruth.tracing.selection.candidate import Candidate
from airtruth.tracing.selection.rounds import SearchRound
from airtruth.tracing.stage_errors import STAGES, BySet, Errors, PerChannel, Rms

Array = NDArray[np.float64]


@dataclass(frozen=True)
class StageModel:
    """A stage: a hypothesis with its parameters.

    Attributes
    ----------
    hypothesis : the effects of the stage.
    common, sizes : parameters common to all records, and sizes of the effects.
    per_record : (records, n) parameters of each fitted record.
    fitted : whether ``per_record`` is optimal for the common parameters; else it is where to begin.
    """

    hypothesis: Hypothesis
    common: Array
    sizes: Array
    per_record: Array
    fitted: bool


@dataclass(frozen=True)
class Stages:
    """Every stage of the report on every record.

    Attributes
    ----------
    case : the records and the declared aircraft.
    models : stage -> model.
    fitted, held : stage -> assessment of each fitted and of each held-out record.
    """

    case: Case
    models: dict[str, StageModel]
    fitted: dict[str, list[Assessment]]
    held: dict[str, list[Assessment]]

    @property
    def best(self) -> str:
        """The stage that explains the records best: with the effects where any was accepted."""
        return "after" if "after" in self.models else "before"

    @property
    def reported(self) -> tuple[TraceProblem, dict[str, list[Assessment]]]:
        """Records that a report shows, held-out ones where there are any, and their assessments."""
        return (self.case.held, self.held) if self.case.held is not None else (self.case.fitted, self.fitted)


def in_closed_loop(stages: Stages) -> bool:
    """Whether a control of the records that a report shows responds to the motion."""
    problem, assessed = stages.reported
    return responds_to_motion(
        [r.signals.sampled_controls_rad for r in problem.records], [a.whitened for a in assessed["before"]]
    )


def accepted(rounds: Sequence[SearchRound]) -> list[tuple[Candidate, tuple[Candidate, ...]]]:
    """Each accepted effect with those that explain the records as well."""
    return [(r.tied[0], r.tied[1:]) for r in rounds if r.tied]


def assess_stages(case: Case, rounds: Sequence[SearchRound]) -> Stages:
    """Assess every stage on fitted and held-out records; each has the same free parameters of the records."""
    null, last = rounds[0].null, rounds[-1].null
    # noise levels are those of the stage before: with the declared ones only the declared model would be assessed
    declared = null.point.common.copy()
    own = case.fitted.layout.common
    declared[[*range(own.derivatives.stop), own.inertia]] = 0.0
    models = {
        "declared": StageModel(case.hypothesis, declared, np.zeros(0), null.point.per_record, False),
        "before": _model(null),
    }
    if last.hypothesis.effects or last.hypothesis.spread is not None:
        models["after"] = _model(last)
        tied = {c.score.effect.key for c in rounds[0].tied}
        others = [c for c in rounds[0].candidates if c.score.effect.key not in tied]
        if others:
            models["control"] = _model(others[0].fit)
    fitted = {name: _assess_all(case.fitted, m, fitted=True) for name, m in models.items()}
    held = {name: _assess_all(case.held, m, fitted=False) for name, m in models.items()} if case.held else {}
    return Stages(case, models, fitted, held)


def _model(fit: PosteriorFit) -> StageModel:
    point = fit.point
    return StageModel(fit.hypothesis, point.common, point.sizes, point.per_record, fit.converged)


def _assess_all(problem: TraceProblem, model: StageModel, fitted: bool) -> list[Assessment]:
    """Assess each record; held-out ones begin at the mean trim of the fitted ones, which an effect at rest has moved."""
    trim = problem.layout.per_record.trim

    def one(index: int) -> Assessment:
        if fitted:
            own = model.per_record[index]
        else:
            own = initial_per_record(problem.records[index], problem.settings)
            own[trim] = model.per_record[:, trim].mean(axis=0)
        settled = fitted and model.fitted
        return assess(problem, index, model.hypothesis, model.common, model.sizes, own, settled=settled)

    return problem.each(one, range(len(problem.records)))


def stage_errors(stages: Stages) -> Errors:
    """Root mean squares of every stage on the fitted and on the held-out records."""
    found: dict[str, BySet[Rms]] = {}
    case = stages.case
    settings = case.fitted.settings
    for name in STAGES:
        if name == "floor":
            held = None if case.held is None else _floor(case.held, stages, stages.held)
            found[name] = BySet(_floor(case.fitted, stages, stages.fitted), held)
        elif name in stages.fitted:
            held = _pooled(stages.held[name], settings) if name in stages.held else None
            found[name] = BySet(_pooled(stages.fitted[name], settings), held)
    return Errors(_signals(case), found)


def _signals(case: Case) -> PerChannel:
    """Standard deviation of each measured channel, the scale of the errors."""
    y = [r.signals.y - r.signals.y.mean(axis=0) for r in case.fitted.records]
    return _per_channel(np.concatenate(y) ** 2, case.fitted.settings)


def _pooled(assessed: Sequence[Assessment], settings: Settings) -> Rms:
    return Rms(
        free_run=_per_channel(np.array([a.free_run**2 for a in assessed]), settings),
        innovation=_per_channel(np.array([a.innovation**2 for a in assessed]), settings),
    )


def _floor(problem: TraceProblem, stages: Stages, assessed: dict[str, list[Assessment]]) -> Rms:
    """Errors that gusts and sensor noise alone explain, by the stage that explains these records best.

    A model that does not fit a record takes its misfit for gusts, and its floor is too high.
    """
    stage = min(("before", stages.best), key=lambda name: sum(a.likelihood for a in assessed[name]))
    own, settings = assessed[stage], problem.settings
    return Rms(
        free_run=_per_channel(free_run_floor(problem, stages.models[stage], own) ** 2, settings),
        innovation=_per_channel(np.array([a.expected**2 for a in own]), settings),
    )


def free_run_floor(problem: TraceProblem, model: StageModel, assessed: Sequence[Assessment]) -> Array:
    """(records, outputs) root mean squares of free runs that gusts and sensor noise alone explain."""
    compiled = model.hypothesis.compiled(model.sizes)
    return np.array(
        [
            fitted_noise_floor(
                record,
                problem.settings,
                compiled,
                model.common,
                a.per_record,
                number,
                model.hypothesis.unconstrained,
            )
            for number, (record, a) in enumerate(zip(problem.records, assessed, strict=True))
        ]
    )


def _per_channel(squares: Array, settings: Settings) -> PerChannel:
    """Root of the mean over the first axis, by measured channel."""
    roots = np.sqrt(np.mean(squares, axis=0)).tolist()
    rows = zip(settings.layout.motion.output_channels, roots, settings.measured, strict=True)
    return {channel: root for channel, root, known in rows if known}


__all__ = [
    "StageModel",
    "Stages",
    "accepted",
    "assess_stages",
    "free_run_floor",
    "stage_errors",
]
