"""Derivatives of one fit for another that begins near it, with other effects."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from airtruth.tracing.inference.hypothesis import Hypothesis
from airtruth.tracing.inference.posterior import PosteriorFit, Sensitivities
from airtruth.tracing.model.parameters import Layout, ParameterLayout, Parameters


def nearby(fitted: PosteriorFit, hypothesis: Hypothesis) -> tuple[Sensitivities, ...]:
    """The derivatives of each record at a fit, in the order of another hypothesis.

    Those in the parameters of an effect that the fit lacks are NaN, for `sensitivities_of` to make.

    Parameters
    ----------
    fitted : a fit of the same records under the same settings.
    """
    return reordered(fitted.sensitivities, fitted.layout.of, fitted.hypothesis, hypothesis)


def reordered(
    sensitivities: Sequence[Sensitivities], entries: ParameterLayout, of: Hypothesis, hypothesis: Hypothesis
) -> tuple[Sensitivities, ...]:
    """`nearby` of the derivatives of each record under a hypothesis ``of``."""
    rows = rows_of(entries, of, hypothesis)
    return tuple(_ordered(s, rows) for s in sensitivities)


def rows_of(
    entries: ParameterLayout, of: Hypothesis, hypothesis: Hypothesis
) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """(parameters,) number that each parameter of a hypothesis has under another one ``of``; -1 for what that lacks."""
    old, new = Layout(entries, len(of.parameters)), Layout(entries, len(hypothesis.parameters))
    rows = np.full(new.total, -1)
    rows[new.common] = np.arange(old.total)[old.common]
    rows[new.per_record] = np.arange(old.total)[old.per_record]
    known = {e.key for e in of.effects}
    for effect in hypothesis.effects:
        if effect.key in known:
            own, there = hypothesis.span(effect.key), of.span(effect.key)
            first, last = new.sizes.start, old.sizes.start
            rows[first + own.start : first + own.stop] = np.arange(last + there.start, last + there.stop)
    return rows


def begins_at(fitted: PosteriorFit, hypothesis: Hypothesis, start: Parameters) -> bool:
    """Whether a start is where the fit ended, with the same effects."""
    return fitted.hypothesis.effects == hypothesis.effects and np.array_equal(
        fitted.point.vector, start.vector
    )


def _ordered(s: Sensitivities, rows: np.ndarray[tuple[int], np.dtype[np.int64]]) -> Sensitivities:
    lacking = rows < 0
    t, w = s.t[rows], s.w[rows]
    t[lacking], w[lacking] = np.nan, np.nan
    more = s.more if s.more.size == 1 else np.where(lacking, 0.0, s.more[rows])
    return Sensitivities(s.r, s.logdet, t, w, s.white, more)


__all__ = ["begins_at", "nearby", "reordered", "rows_of"]
