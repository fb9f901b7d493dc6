"""The share of each accepted effect in the step from the declared aircraft to the answer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from airtruth.effects.registry import EFFECTS
from airtruth.tracing.answer import AcceptedEffect
from airtruth.tracing.inference.assess import own_likelihood
from airtruth.tracing.inference.causes import DERIVATIVES, size_in_derivatives
from airtruth.tracing.prepare import Case
from airtruth.tracing.stages import StageModel, Stages


def credit(effects: Sequence[AcceptedEffect], stages: Stages) -> dict[str, float]:
    """Key of each effect -> share of the log-likelihood that is lost without it [-].

    The share compares *after* without the effect, all else unchanged, with the step from *declared* to *after*, on
    held-out records where there are any. Shares of effects that act alike do not add up to one.
    """
    if "after" not in stages.models:
        return {}
    problem, assessed = stages.reported
    records = range(len(problem.records))
    after, declared = (sum(a.likelihood for a in assessed[name]) for name in ("after", "declared"))
    step = declared - after
    found = {}
    for effect in effects:
        less = _without(stages.models["after"], effect, stages.case)

        def one(i: int, model: StageModel = less) -> float:
            own = assessed["after"][i].per_record
            return own_likelihood(problem, i, model.hypothesis, model.common, model.sizes, own)

        lost = sum(problem.each(one, records)) - after
        if np.isfinite(lost) and np.isfinite(step) and step > 0.0:
            found[effect.key] = float(lost / step)
    return found


def _without(model: StageModel, effect: AcceptedEffect, case: Case) -> StageModel:
    """A model without one of its effects."""
    if effect.key in [e.key for e in model.hypothesis.effects]:
        rest = tuple(e for e in model.hypothesis.effects if e.key != effect.key)
        return replace(
            model,
            hypothesis=replace(model.hypothesis, effects=rest),
            sizes=np.delete(model.sizes, model.hypothesis.span(effect.key)),
        )
    common, layout = model.common.copy(), case.fitted.layout
    if effect.name == DERIVATIVES:
        common[[layout.motion.index(name[1:]) for name in effect.parameters]] = 0.0
        return replace(model, common=common)
    cause = next(c for c in case.declared.causes if c.key == effect.key)
    (estimate,) = effect.parameters.values()
    own = EFFECTS[cause.key]
    size = own.parameters[0].size(estimate.value)
    common[layout.common.derivatives] -= size_in_derivatives(own, size) * cause.direction
    return replace(model, common=common)


__all__ = ["credit"]
