"""Sets of effects that may explain more than the one that a search has reached.

A search accepts one effect after another. Two causes that are alike at first may lead it to a set of three that together
imitate them: the delay of a gyro in place of its lag, then a lag of the surface in place of its delay, then the lag of the
gyro for what remains. The quadratic about the fit predicts the best sets of all effects (`subsets`), and these are refitted.
So are exchanges of one member for the best rival of its round, of delays for lags, and the set with an effect to which what
remains points. What becomes redundant is removed.

Source: P. Pudil, J. Novovicova and J. Kittler, Pattern Recognition Letters 15 (1994) 1119-1125 (floating search).
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.effects.effect import Effect
from airtruth.tracing.inference.posterior import PosteriorFit
from airtruth.tracing.model.parameters import Parameters
from airtruth.tracing.selection.acceptance import Candidate, is_plausible
from airtruth.tracing.selection.budget import Advance, may_begin
from airtruth.tracing.selection.refit import losses_without, refit_scored
from airtruth.tracing.selection.rounds import MOST_EFFECTS, SearchRound
from airtruth.tracing.selection.set_table import SetTable
from airtruth.tracing.selection.significance import REMAINS
from airtruth.tracing.selection.subsets import Subset, subsets

BETTER: Final = 5.0
"""Log-posterior by which another set has to lead [-] (judgement: a gain of 10 in 2 log L, as that of a first effect)."""
AHEAD: Final = 1.0
"""Log-posterior by which another set of no more parameters has to lead [-] (judgement: odds of 2.7)."""
_ADDED: Final = 2
"""Number of effects that are added for what remains [-] (judgement: each costs a refit)."""
_PREDICTED: Final = 6
"""Number of sets that the quadratic puts first, and that are refitted [-] (judgement: each costs a refit)."""
_NEARLY: Final = 3.0
"""Log-posterior by which the quadratic may put such a set behind the fitted one [-] (judgement: half of a tie's difference in
2 log L)."""


def better_set(
    sets: SetTable,
    rounds: Sequence[SearchRound],
    last: PosteriorFit,
    effects: Sequence[Effect],
    least: float,
    advance: Advance,
) -> tuple[Effect, ...] | None:
    """The effects of a better set, the one that explains most first; the table notes every exchange.

    There is no better set where none leads by `AHEAD`, with more parameters by `BETTER`.

    Parameters
    ----------
    rounds : a finished search that accepted effects; last : fit of these under the declaration of the derivatives.
    effects : candidates of the search.
    least : gain in 2 log L below which a member of the new set is removed.
    """
    best: PosteriorFit | None = None
    for phrase, refit in _tries(sets, rounds, last, effects):
        if not may_begin(advance, phrase):
            return None
        tried = refit()
        if tried is not None:
            sets.exchange(last, tried)
            lead = BETTER if len(tried.point.sizes) > len(last.point.sizes) else AHEAD
            leads = _cost(tried) < min(_cost(last) - lead, np.inf if best is None else _cost(best))
            if leads and is_plausible(sets.problem, tried):
                best = tried
    needed = () if best is None else _needed(sets, best, least)
    kept = {e.key for e in needed} != {e.key for e in last.hypothesis.effects}
    return needed if kept and 0 < len(needed) <= MOST_EFFECTS else None


def _tries(
    sets: SetTable,
    rounds: Sequence[SearchRound],
    last: PosteriorFit,
    effects: Sequence[Effect],
) -> Iterator[tuple[str, Callable[[], PosteriorFit | None]]]:
    """Each exchange as a phrase for the progress line, and the function that refits it."""
    for s in _predicted(sets, last, effects):
        phrase = f"{', '.join(e.key for e in s.effects)} as a set"
        hypothesis = replace(last.hypothesis, effects=s.effects)
        yield phrase, partial(sets.fit, hypothesis, s.start, rival=last.cost, near=last)
    for index, effect in enumerate(last.hypothesis.effects):
        own = next((r for r in rounds if r.tied and r.tied[0].score.effect.key == effect.key), None)
        rival = None if own is None else best_rival(own, last, effect)
        if rival is not None:
            phrase = f"{rival.score.effect.key} in place of {effect.key} beside the other effects"
            yield phrase, partial(_exchanged, sets, last, index, rival)
    for swapped, sizes in other_kinds(effects, last):
        phrase = f"{' and '.join(e.key for e in swapped)} beside the other effects"
        hypothesis, start = replace(last.hypothesis, effects=swapped), replace(last.point, sizes=sizes)
        yield phrase, partial(sets.fit, hypothesis, start, rival=last.cost, near=last)
    scored = _scored(rounds, last)
    for i in np.argsort(scored.adjusted, kind="stable")[:_ADDED]:
        if scored.adjusted[i] < REMAINS:
            phrase = f"{scored.table.scores[i].effect.key} beside the other effects"
            yield phrase, partial(refit_scored, sets, last, scored.table, int(i))


def _predicted(sets: SetTable, last: PosteriorFit, effects: Sequence[Effect]) -> list[Subset]:
    """The sets that the quadratic about a fit puts before it or next to it; of those that are late in the same places the best.

    What delays the same signal is tried by `other_kinds` and among the look-alikes.
    """
    found: list[Subset] = []
    own, behind = _places(last.hypothesis.effects), np.inf
    seen = {own}
    for s in subsets(sets.problem, last, effects, MOST_EFFECTS):
        places = _places(s.effects)
        if places == own and not np.isfinite(behind):
            behind = s.cost + _NEARLY
        if s.cost > min(behind, 0.0) or len(found) == _PREDICTED:
            break
        if places not in seen:
            seen.add(places)
            found.append(s)
    return found


def _places(effects: Sequence[Effect]) -> frozenset[str]:
    """Names of effects, those that delay a signal by its channel."""
    return frozenset(e.late_signal or e.label for e in effects)


def _scored(rounds: Sequence[SearchRound], last: PosteriorFit) -> SearchRound:
    """The round that scores beside the effects of a fit under the declaration of the derivatives; else the last one.

    Released derivatives absorb a part of what an effect would explain, and its score with it.
    """
    own = ((r, r.null.hypothesis) for r in reversed(rounds))
    effects = last.hypothesis.effects
    return next((r for r, h in own if h.spread is None and h.effects == effects), rounds[-1])


def other_kinds(
    effects: Sequence[Effect], last: PosteriorFit
) -> Iterator[tuple[tuple[Effect, ...], NDArray[np.float64]]]:
    """Sets that are late where the fitted one is, by a delay or by a lag each, and their sizes to begin with.

    A delay of the gyro and a lag of the surface are alike a lag of the gyro and a delay of the surface; each of the two
    exchanges alone explains less.
    """
    twins: dict[str, list[Effect]] = {}
    for effect in effects:
        signal = effect.late_signal
        if signal:
            twins.setdefault(signal, []).append(effect)
    own = last.hypothesis.effects
    late_s: dict[str, float] = {}
    for effect in own:
        signal = effect.late_signal
        if signal:
            late_s[signal] = late_s.get(signal, 0.0) + float(_sizes(last, effect.key).sum())
    if len(late_s) < 2:
        return
    rest = tuple(e for e in own if not e.late_signal)
    begin = [_sizes(last, e.key) for e in rest]
    for late in itertools.product(*(twins[signal] for signal in late_s)):
        if {e.key for e in (*late, *rest)} != {e.key for e in own}:
            yield (*late, *rest), np.concatenate([np.array(list(late_s.values())), *begin])


def best_rival(own: SearchRound, last: PosteriorFit, effect: Effect) -> Candidate | None:
    """The best candidate of another name that was refitted in the round of an effect; one, because each costs a refit."""
    taken = {e.label for e in last.hypothesis.effects if e.key != effect.key}
    others = (c for c in own.candidates if c.score.effect.label not in taken | {effect.label})
    return max(others, key=lambda c: c.gain, default=None)


def _exchanged(sets: SetTable, last: PosteriorFit, index: int, rival: Candidate) -> PosteriorFit | None:
    """The better of the fits with a rival in place of a member."""
    effects = last.hypothesis.effects
    hypothesis = replace(
        last.hypothesis, effects=(*effects[:index], rival.score.effect, *effects[index + 1 :])
    )
    starts = starts_in_place_of(last, effects[index], rival)
    return sets.best_from(hypothesis, starts, rival=last.cost, near=last)


def starts_in_place_of(last: PosteriorFit, member: Effect, rival: Candidate) -> list[Parameters]:
    """Where fits with a rival in place of a member begin: where the rival's refit ended, and at the last set.

    A refit that begins at the last set can end early or elsewhere, because the member to be replaced has moved the rest; one
    that begins where the rival's refit ended lacks what was accepted later.
    """
    effects = [rival.score.effect if e.key == member.key else e for e in last.hypothesis.effects]
    known = {e.key for e in rival.fit.hypothesis.effects}
    sizes = np.concatenate([_sizes(rival.fit if e.key in known else last, e.key) for e in effects])
    own = _sizes(rival.fit, rival.score.effect.key)
    late = np.concatenate([own if e is rival.score.effect else _sizes(last, e.key) for e in effects])
    return [replace(rival.fit.point, sizes=sizes), replace(last.point, sizes=late)]


def _sizes(fitted: PosteriorFit, key: str) -> NDArray[np.float64]:
    return fitted.point.sizes[fitted.hypothesis.span(key)]


def _cost(fitted: PosteriorFit) -> float:
    """Negative log-posterior with one for each parameter of an effect."""
    return fitted.cost + len(fitted.point.sizes)


def _needed(sets: SetTable, fitted: PosteriorFit, least: float) -> tuple[Effect, ...]:
    """The effects whose removal costs at least ``least`` in 2 log L, the one that costs most first."""
    while True:
        effects = fitted.hypothesis.effects
        removals = losses_without(sets, fitted, effects)
        order = sorted(range(len(effects)), key=lambda i: -removals[i][0])
        loss, less = removals[order[-1]]
        if less is None or loss >= least or len(effects) == 1:
            return tuple(effects[i] for i in order)
        fitted = less


__all__ = ["BETTER", "best_rival", "better_set", "other_kinds", "starts_in_place_of"]
