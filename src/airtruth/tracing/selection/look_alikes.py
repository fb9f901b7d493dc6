"""Effects that explain as much as an accepted one, in its place and beside all others.

A round compares its candidates beside the effects that were accepted before it. What was accepted later can tell two of them
apart, or no longer tell them apart: a gyro that is 6 ms late by a delay or by a lag is one answer beside every other effect,
and each of them can lead a round in which another cause is still missing.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from airtruth.effects.effect import Effect
from airtruth.effects.increment import Increment
from airtruth.tracing.inference.optimise import fit
from airtruth.tracing.inference.posterior import PosteriorFit, TraceProblem
from airtruth.tracing.model.parameters import Parameters
from airtruth.tracing.selection.acceptance import OUTDONE, Candidate, has_converged
from airtruth.tracing.selection.budget import Advance, may_begin
from airtruth.tracing.selection.exchange import best_rival, cost_of, in_place_of, late_signal
from airtruth.tracing.selection.ranking import TIE
from airtruth.tracing.selection.rounds import SearchRound

_ATTEMPTS: Final = 2
"""Number of times that a refit may begin again where it ended [-] (judgement)."""


def with_look_alikes(
    problem: TraceProblem, rounds: tuple[SearchRound, ...], effects: Sequence[Effect], advance: Advance
) -> tuple[SearchRound, ...]:
    """The rounds, each accepted effect tied with those that explain as much in its place at the end of the search.

    A single effect keeps the ties of its round, which has no other effect beside it.

    Parameters
    ----------
    rounds : a finished search; effects : its candidates; advance : receives the step that begins.
    """
    last = rounds[-1]
    members = last.null.hypothesis.effects
    if len(members) + len(last.sets[:1]) < 2:
        return rounds
    found = list(rounds)
    for member in members:
        at = next(
            (i for i, r in enumerate(rounds) if r.tied and r.tied[0].score.effect.key == member.key), None
        )
        if at is not None and not isinstance(member, Increment):
            found[at] = _beside_the_others(problem, rounds, at, effects, advance)
    return tuple(found)


def _beside_the_others(
    problem: TraceProblem,
    rounds: Sequence[SearchRound],
    at: int,
    effects: Sequence[Effect],
    advance: Advance,
) -> SearchRound:
    """The round with the rivals of its effect as they are at the end of the search."""
    own, last = rounds[at], rounds[-1].null
    leader, member = own.tied[0], own.tied[0].score.effect
    tested: dict[str, Candidate] = {}
    for effect, start in _rivals(own, last, effects):
        if not may_begin(advance, f"{effect.key} in place of {member.key} beside the other effects"):
            return own
        score = next((s for s in own.table.scores if s.effect.key == effect.key), None)
        exchanged = tuple(effect if e.key == member.key else e for e in last.hypothesis.effects)
        tried = _converged(problem, last, exchanged, start)
        if score is None or tried is None:
            continue
        gain = leader.gain + 2.0 * (cost_of(last) - cost_of(tried))
        is_alike = gain >= leader.gain - TIE and has_converged(tried, gain)
        before = next((c for c in own.candidates if c.score.effect.key == effect.key), None)
        new = before or replace(leader, score=score, fit=tried)
        reasons = () if is_alike else new.reasons or (OUTDONE,)
        tested[effect.key] = replace(new, gain=gain, reasons=reasons)
    alike = (c for c in tested.values() if not c.reasons)
    known = {c.score.effect.key: c for c in own.candidates}
    return replace(own, candidates=tuple((known | tested).values()), tied=(leader, *alike))


def _rivals(
    own: SearchRound, last: PosteriorFit, effects: Sequence[Effect]
) -> Iterator[tuple[Effect, Parameters]]:
    """Rivals of a round's effect, and where the refit of each begins: its ties, its best rival, and what is as late."""
    member = own.tied[0].score.effect
    taken = {e.key for e in last.hypothesis.effects}
    best = best_rival(own, last, member)
    for c in (*own.tied[1:], *(() if best is None else (best,))):
        if c.score.effect.key not in taken:
            taken.add(c.score.effect.key)
            yield c.score.effect, in_place_of(last, member, c)
    for effect in effects:
        if effect.key not in taken and late_signal(member) and late_signal(effect) == late_signal(member):
            yield effect, last.point  # the size of either is a time


def _converged(
    problem: TraceProblem, last: PosteriorFit, effects: tuple[Effect, ...], start: Parameters
) -> PosteriorFit | None:
    hypothesis = replace(last.hypothesis, effects=effects)
    if len(start.sizes) != len(hypothesis.parameters) or not np.isfinite(start.sizes).all():
        return None
    own = fit(problem, hypothesis, start)
    for _ in range(_ATTEMPTS):
        if own is None or own.converged:
            break
        own = fit(problem, hypothesis, own.point)
    return own


__all__ = ["with_look_alikes"]
