"""Named effects, and derivatives released from their declaration, that what was accepted later makes unnecessary.

The first accepted effect may be an approximation that later effects make unnecessary. Beside released derivatives or a learned
increment it may have nothing left to describe, and an answer that kept it would name an effect that the aircraft lacks.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from airtruth.effects.effect import Effect
from airtruth.effects.increment import Increment
from airtruth.tracing.inference.derivative_likelihood import contradiction
from airtruth.tracing.inference.posterior import PosteriorFit
from airtruth.tracing.selection.budget import Advance, may_begin
from airtruth.tracing.selection.explanation import REFERENCE, CauseSet
from airtruth.tracing.selection.outcome import STRONG_ODDS, total_cost
from airtruth.tracing.selection.refit import losses_without
from airtruth.tracing.selection.refusal import Refusal
from airtruth.tracing.selection.release import CONTRADICTED
from airtruth.tracing.selection.rounds import SearchRound, scored_round
from airtruth.tracing.selection.set_table import SetTable
from airtruth.tracing.selection.significance import FAMILY_LEVEL, MISFIT_FAMILY_LEVEL, significant_gain
from airtruth.tracing.selection.weights import with_rival

_ALIKE: Final = 0.01
"""Ratio of two probabilities of an anomaly that is left from which they count as alike [-] (judgement: where something is
missing anyway, two decades do not keep a name that explains nothing)."""


def pruned(
    sets: SetTable,
    rounds: tuple[SearchRound, ...],
    effects: Sequence[Effect],
    seed: int,
    remains: float,
    advance: Advance,
) -> tuple[SearchRound, ...]:
    """The rounds without the names, and without the release, that the rest makes unnecessary.

    Beside names alone the release remains where the odds for what explains it are strong. Where it is given up, its sets are
    rivals. Beside increments a name needs the gain of an effect beside an anomaly beyond doubt, otherwise that of a first one.

    Parameters
    ----------
    rounds : a finished search; one effect alone remains.
    effects : candidates, whose scores the last round states.
    seed : seed of the draws behind p-values; advance : receives the step that begins.
    remains : probability of the remaining anomaly [-] from which the records count as explained; a far larger anomaly than
        before is not accepted below it.
    """
    last = rounds[-1]
    members = last.null.hypothesis.effects
    if not members or len(members) + len(last.sets[:1]) < 2:
        return rounds
    if not may_begin(advance, "remove what later effects make unnecessary"):
        return rounds
    learned = any(isinstance(e, Increment) for e in members)
    declared = _as_declared(sets, last, learned)
    least = significant_gain(len(effects), MISFIT_FAMILY_LEVEL if learned else FAMILY_LEVEL)
    fitted = _with_needed_names(sets, declared or last.null, least, _latest_causes(rounds))
    if fitted is last.null:
        return rounds
    end = scored_round(sets, fitted, effects, len(rounds), seed, advance)
    if end is None or end.anomaly.p_value < min(remains, _ALIKE * last.anomaly.p_value):
        return rounds
    if declared is None:
        end = replace(end, sets=last.sets, release=last.release)
    gone = {e.key for e in last.null.hypothesis.effects} - {e.key for e in fitted.hypothesis.effects}
    before = (_kept(r, gone, declared is not None) for r in rounds[:-1])
    kept = (*before, end)
    return kept if declared is None or learned else with_rival(kept, rounds)


def _as_declared(sets: SetTable, last: SearchRound, learned: bool) -> PosteriorFit | None:
    """A released fit under the declaration again; None where it was not released, where the records contradict that, or, beside
    names alone, where the odds for what explains the release are strong.

    Parameters
    ----------
    learned : whether increments are among the effects.
    """
    if last.null.hypothesis.spread is None:
        return None
    own = sets.declared(last.null)
    if own is None or contradiction(sets.problem, own).p_value <= CONTRADICTED:
        return None
    behind = own.cost + len(own.point.sizes) - REFERENCE - total_cost(last)
    return own if learned or behind <= -STRONG_ODDS else None


def _latest_causes(rounds: Sequence[SearchRound]) -> Collection[str]:
    """Names of the causes that explain released derivatives, where nothing was accepted after them.

    The evidence of their sets has weighed each of them already.
    """
    for r in reversed(rounds):
        if r.tied:
            return ()
        if r.release is not None:
            return r.release.sets[0].effects
    return ()


def _with_needed_names(
    sets: SetTable, fitted: PosteriorFit, least: float, kept: Collection[str]
) -> PosteriorFit:
    """The fit without the names whose absence costs less than ``least`` in 2 log L, the cheapest one first.

    Parameters
    ----------
    kept : names that remain.
    """
    while True:
        effects = fitted.hypothesis.effects
        names = [e for e in effects if not isinstance(e, Increment) and e.label not in kept]
        loss, less = min(
            losses_without(sets, fitted, names), key=lambda removal: removal[0], default=(np.inf, None)
        )
        if less is None or loss >= least:
            return fitted
        fitted = less


def _kept(own: SearchRound, gone: set[str], is_declared: bool) -> SearchRound:
    """A round without the effects that are gone, and without its release where nothing of its explanation is left."""
    if own.tied and own.tied[0].score.effect.key in gone:
        first = own.tied[0]
        others = (replace(c, reasons=(Refusal.SUPERSEDED,)) if c is first else c for c in own.candidates)
        own = replace(own, tied=(), profile=None, candidates=tuple(others))
    if is_declared:
        return replace(own, release=None, sets=(), rival=None)
    if own.release is None:
        return own
    if not own.release.sets[0].without(gone).effects:
        return replace(own, release=None)
    sets: dict[tuple[str, ...], CauseSet] = {}
    for s in own.release.sets:
        left = s.without(gone)
        if left.effects:
            sets.setdefault(left.effects, left)
    return replace(own, release=replace(own.release, sets=tuple(sets.values())))


__all__ = ["pruned"]
