"""Sets of effects that a finished search leaves, with their posterior weights."""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Iterator, Sequence
from typing import Final

from airtruth.tracing.selection.ranking import TIE
from airtruth.tracing.selection.rounds import Rival, SearchRound

_MOST_SETS: Final = 400
"""Number of sets that explain the derivatives and enter the weights [-] (judgement: the others weigh nothing)."""
_LEAST_LOG: Final = -700.0
"""Least logarithm of a weight [-]: smaller ones underflow."""


def weights(rounds: Sequence[SearchRound]) -> dict[tuple[str, ...], float]:
    """Names of each set -> its weight beside the set that the search accepted.

    The sets combine the tied effects of every round with the sets that explain the derivatives, and contain those of the
    branches that lost.
    """
    found: dict[tuple[str, ...], float] = {}

    def add(names: Collection[str], log_weight: float) -> None:
        key = tuple(sorted(set(names)))
        found[key] = found.get(key, 0.0) + math.exp(max(_LEAST_LOG, min(0.0, log_weight)))

    tied = [
        [(c.score.effect.name, 0.5 * (c.gain - r.tied[0].gain)) for c in r.tied] for r in rounds if r.tied
    ]
    carried = _carried(rounds)
    for added in itertools.product(*tied):
        for explaining, log_weight in _explanations(rounds):
            every = [*(name for name, _ in added), *explaining, *carried]
            add(every, log_weight + sum(gain for _, gain in added))
    for r in rounds:
        for names, log_weight in () if r.rival is None else r.rival.sets.items():
            add(names, log_weight)
    return found


def _carried(rounds: Sequence[SearchRound]) -> set[str]:
    """Effects beside released derivatives that no round accepted: they explained derivatives that were released before."""
    last = rounds[-1].null.hypothesis
    leaders = {r.tied[0].score.effect.name for r in rounds if r.tied}
    return set() if last.spread is None else {e.name for e in last.effects} - leaders


def rival_of(lost: Sequence[SearchRound], excess: float) -> Rival:
    """A branch that lost, with every set that it leaves.

    Parameters
    ----------
    lost : its rounds; excess : its cost at its end less that of the branch that remains.
    """
    return Rival({names: math.log(w) - max(0.0, excess) for names, w in weights(lost).items()})


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
    """Sets that explain released derivatives, each with the logarithm of its weight."""
    release = next((r.release for r in reversed(rounds) if r.release is not None), None)
    if release is None:
        yield (), 0.0
        return
    for s in release.sets[:_MOST_SETS]:
        yield s.effects, release.cost - s.cost


__all__ = ["alike_in_rivals", "rival_of", "weights"]
