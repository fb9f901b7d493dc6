"""Sets of effects that a finished search leaves, with their posterior weights."""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from typing import Final

from airtruth.effects.increment import Increment
from airtruth.tracing.inference.posterior import PosteriorFit
from airtruth.tracing.selection.acceptance import has_converged
from airtruth.tracing.selection.explanation import REFERENCE
from airtruth.tracing.selection.outcome import total_cost
from airtruth.tracing.selection.ranking import TIE
from airtruth.tracing.selection.refusal import Refusal
from airtruth.tracing.selection.rounds import Rival, SearchRound

_POINTS: Final = 2.0
"""Score in standard deviations from which the residual points to one more effect [-] (convention)."""
_MOST_MORE: Final = 3
"""Number of sets of one effect more [-] (judgement: where the records are not explained, most effects have a score)."""
_REFUSED: Final = math.log(0.5)
"""Largest log-weight of a set with one effect more [-] (judgement: the search has refused the effect)."""
_MOST_SETS: Final = 400
"""Number of sets that explain the derivatives and enter the weights [-] (judgement: the others weigh nothing)."""
_LEAST_STD: Final = 1e-12
"""Least standard deviation of a size [-]: that of a size at the end of its range is zero."""
_LEAST_LOG: Final = -700.0
"""Least logarithm of a weight [-]: smaller ones underflow."""


def weights(rounds: Sequence[SearchRound]) -> dict[tuple[str, ...], float]:
    """Names of each set -> its weight beside the set that the search accepted.

    The sets combine the effects that could lead each round with the sets that explain the derivatives, and contain those of
    the branches and searches that lost, those without one of the accepted effects, those that the search has tried instead, and
    those with one effect more. A set that two searches reach has the larger of its weights. An effect is accepted by a test, so
    that no set is empty for want of the only one.
    """
    if rounds[-1].posterior:
        return dict(rounds[-1].posterior)
    found: dict[tuple[str, ...], float] = {}

    def add(names: Collection[str], log_weight: float) -> None:
        key = tuple(sorted(set(names)))
        found[key] = found.get(key, 0.0) + _weight(log_weight)

    accepted = {r.tied[0].score.effect.label for r in rounds if r.tied}
    leading = [list(_leading(r, accepted)) for r in rounds if r.tied]
    carried = _carried(rounds)
    combined = [([name for name, _ in c], sum(gain for _, gain in c)) for c in itertools.product(*leading)]
    for led, gain in combined:
        for explaining, log_weight in _explanations(rounds):
            add([*led, *explaining, *carried], log_weight + gain)
    for rest, lost in _without_one(rounds):
        for explaining, log_weight in _explanations(rounds):
            if rest or explaining or carried:
                add([*rest, *explaining, *carried], log_weight + lost)
    for r in rounds:
        for names, log_weight in () if r.rival is None else r.rival.sets.items():
            key = tuple(sorted(set(names)))
            found[key] = max(found.get(key, 0.0), _weight(log_weight))
    for tried in (_exchanged(rounds[-1]), _with_one_more(rounds[-1], combined)):
        known = set(found)
        for every, log_weight in tried:
            if tuple(sorted(set(every))) not in known:
                add(every, log_weight)
    return found


def _weight(log_weight: float) -> float:
    return math.exp(max(_LEAST_LOG, min(0.0, log_weight)))


def _exchanged(last: SearchRound) -> Iterator[tuple[list[str], float]]:
    """The sets that the search has tried in place of the last one, and the logarithm of the weight of each.

    The search has not accepted one of more effects, so that it weighs at most half as much.
    """
    own, effects = _cost(last.null), len(last.null.hypothesis.effects)
    for f in last.exchanged:
        if f.converged:
            names = [e.label for e in f.hypothesis.effects]
            yield names, min(own - _cost(f), _REFUSED if len(names) > effects else 0.0)


def _cost(fitted: PosteriorFit) -> float:
    """Negative log-posterior with one for each parameter, and the prior odds and Occam's factor of each effect."""
    return fitted.cost + len(fitted.point.sizes) + REFERENCE * len(fitted.hypothesis.effects)


def _with_one_more(
    last: SearchRound, combined: Sequence[tuple[Sequence[str], float]]
) -> Iterator[tuple[list[str], float]]:
    """The last set with one effect that its residual points to, and the logarithm of the weight of each.

    A score squared is the gain in 2 log L that a refit reaches to first order. The search has not accepted the effect, so that
    its set weighs at most half as much. The effect gains as much beside rivals of the accepted effects.

    Parameters
    ----------
    last : the round at the end.
    combined : the accepted effects, or rivals in their place, with the logarithm of the weight of each; the accepted first.
    """
    named = [*(e.label for e in last.null.hypothesis.effects), *(last.sets[0].effects if last.sets else ())]
    if not named:
        return
    beside = [name for name in named if name not in combined[0][0]]
    seen = [s for s in last.table.scores if abs(s.z) > _POINTS and s.effect.label not in named]
    for s in sorted(seen, key=lambda s: -abs(s.z))[:_MOST_MORE]:
        gained = 0.5 * s.z**2 - REFERENCE - len(s.effect.parameters)
        for names, log_weight in combined:
            if s.effect.label not in names:
                yield [*names, *beside, s.effect.label], log_weight + min(gained, _REFUSED)


def _leading(own: SearchRound, accepted: Collection[str]) -> Iterator[tuple[str, float]]:
    """Names of the accepted effect of a round and of its rivals, each with the logarithm of its weight.

    Rivals tie with it or gain less. An effect that another round accepts is no rival: what it gains here it gains there too.
    """
    first = own.tied[0]
    yield first.score.effect.label, 0.0
    outdone = (c for c in own.candidates if c.reasons == (Refusal.OUTDONE,) and has_converged(c.fit, c.gain))
    for c in (*own.tied[1:], *(c for c in outdone if c.gain < first.gain - TIE)):
        if c.score.effect.label not in accepted:
            yield c.score.effect.label, 0.5 * (c.gain - first.gain)


def _carried(rounds: Sequence[SearchRound]) -> set[str]:
    """Effects beside the derivatives released last that no round accepted: they explained derivatives released before."""
    last = rounds[-1].null.hypothesis
    leaders = {r.tied[0].score.effect.label for r in rounds if r.tied}
    released = next((r.null.hypothesis for r in reversed(rounds) if r.release is not None), None)
    beside = released if last.spread is None else last
    if beside is None:
        return set()
    kept = {e.key for e in last.effects}
    return {e.label for e in beside.effects if e.key in kept} - leaders


def _without_one(rounds: Sequence[SearchRound]) -> Iterator[tuple[list[str], float]]:
    """The accepted effects without each one of them, and the logarithm of the weight of that set.

    What is lost is the smaller of its gain when it was accepted and of A. Wald's statistic of its size at the end (Trans. Am.
    Math. Soc. 54 (1943) 426-482). Of an increment, which has many sizes, it is the gain.
    """
    last = rounds[-1].null
    leaders = [r.tied[0] for r in rounds if r.tied]
    for leader in leaders:
        lost = leader.gain
        if not isinstance(leader.score.effect, Increment):
            at = last.hypothesis.span(leader.score.effect.key).start
            lost = min(lost, (float(last.point.sizes[at]) / max(last.size_std(at), _LEAST_STD)) ** 2)
        others = [c.score.effect.label for c in leaders if c is not leader]
        yield others, REFERENCE + 1.0 - 0.5 * lost


def rival_of(lost: Sequence[SearchRound], excess: float) -> Rival:
    """A branch that lost, with every set that it leaves.

    Parameters
    ----------
    lost : its rounds; excess : its cost at its end less that of the branch that remains.
    """
    return Rival({names: math.log(w) - max(0.0, excess) for names, w in weights(lost).items()})


def with_rival(won: tuple[SearchRound, ...], lost: Sequence[SearchRound]) -> tuple[SearchRound, ...]:
    """A finished search that names effects, with the sets of another one, which lost to it, as rivals in its first round.

    Where it lost by another rule than its posterior, its most probable set counts as equally probable. The empty set of one
    that names nothing is no rival, and a search that names nothing has none.
    """
    if () in weights(won):
        return won
    excess = total_cost(lost[-1]) - total_cost(won[-1])
    left = {names: log_weight for names, log_weight in rival_of(lost, excess).sets.items() if names}
    beyond = max([0.0, *left.values()])
    sets = {names: log_weight - beyond for names, log_weight in left.items()}
    for names, log_weight in () if won[0].rival is None else won[0].rival.sets.items():
        sets[names] = max(sets.get(names, -math.inf), log_weight)
    return (replace(won[0], rival=Rival(sets)), *won[1:])


def alike_in_rivals(rounds: Sequence[SearchRound], key: str, accepted: Collection[str]) -> set[str]:
    """Effects that, in a set of a branch that lost, explain the records as well in place of one accepted effect.

    Parameters
    ----------
    key : name of that effect; accepted : names of all accepted effects.
    """
    others = set(accepted) - {key}
    return {
        extra
        for r in rounds
        for names, log_weight in (() if r.rival is None else r.rival.sets.items())
        if 2.0 * log_weight >= -TIE and len(names) == len(set(accepted)) and others <= set(names)
        for extra in set(names) - set(accepted)
    }


def _explanations(rounds: Sequence[SearchRound]) -> Iterator[tuple[tuple[str, ...], float]]:
    """Sets that explain released derivatives, each with the logarithm of its weight.

    Beside accepted effects one more set is that of these alone: the declared derivatives are right.
    """
    released = next((r for r in reversed(rounds) if r.release is not None), None)
    if released is None or released.release is None:
        yield (), 0.0
        return
    release, null = released.release, released.null
    for s in release.sets[:_MOST_SETS]:
        yield s.effects, release.cost - s.cost
    if null.hypothesis.spread is None and any(r.tied for r in rounds):
        yield (), release.cost - null.cost + REFERENCE


__all__ = ["alike_in_rivals", "rival_of", "weights", "with_rival"]
