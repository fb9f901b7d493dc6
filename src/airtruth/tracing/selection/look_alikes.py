"""Effects that explain as much as an accepted one, in its place and beside all others.

A round compares its candidates beside the effects that were accepted before it. What was accepted later can tell two of them
apart, or no longer tell them apart: a gyro that is 6 ms late by a delay or by a lag is one answer beside every other effect,
and each of them can lead a round in which another cause is still missing.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace

from airtruth.effects.effect import Effect
from airtruth.effects.increment import Increment
from airtruth.tracing.inference.posterior import PosteriorFit
from airtruth.tracing.model.parameters import Parameters
from airtruth.tracing.selection.acceptance import Candidate, has_converged
from airtruth.tracing.selection.budget import Advance, may_begin
from airtruth.tracing.selection.exchange import best_rival, starts_in_place_of
from airtruth.tracing.selection.ranking import TIE, gains_of
from airtruth.tracing.selection.refit import Refit
from airtruth.tracing.selection.refusal import Refusal
from airtruth.tracing.selection.rounds import SearchRound
from airtruth.tracing.selection.set_table import SetTable


def with_look_alikes(
    sets: SetTable, rounds: tuple[SearchRound, ...], effects: Sequence[Effect], advance: Advance
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
            found[at] = _beside_the_others(sets, rounds, at, effects, advance)
    return tuple(found)


def _beside_the_others(
    sets: SetTable,
    rounds: Sequence[SearchRound],
    at: int,
    effects: Sequence[Effect],
    advance: Advance,
) -> SearchRound:
    """The round with the rivals of its effect as they are at the end of the search."""
    own, last = rounds[at], rounds[-1].null
    leader, member = own.tied[0], own.tied[0].score.effect
    fits = [Refit(leader.score, last, 0.0)]
    waiting = list(_rivals(own, rounds[-1], effects))
    known_keys = {e.key for e in last.hypothesis.effects} | {effect.key for effect, _ in waiting}
    while waiting:
        effect, starts = waiting.pop(0)
        if not may_begin(advance, f"{effect.key} in place of {member.key} beside the other effects"):
            return own
        score = next((s for s in own.table.scores if s.effect.key == effect.key), None)
        exchanged = tuple(effect if e.key == member.key else e for e in last.hypothesis.effects)
        hypothesis = replace(last.hypothesis, effects=exchanged)
        tried = sets.best_from(hypothesis, starts, rival=last.cost)
        if score is not None and tried is not None:
            fits.append(Refit(score, tried, 0.0))
            near = tried.cost - last.cost < TIE
            for twin in list(_twins(effect, effects, known_keys)) if near else ():
                known_keys.add(twin.key)
                waiting.append((twin, [tried.point]))
    gains = gains_of(sets.problem, last, sorted(fits, key=lambda r: r.cost))
    tested: dict[str, Candidate] = {}
    for r in fits[1:]:
        key = r.score.effect.key
        gain = leader.gain + gains[key] - gains[member.key]
        is_alike = gain >= leader.gain - TIE and has_converged(r.fit, gain)
        before = next((c for c in own.candidates if c.score.effect.key == key), None)
        new = before or replace(leader, score=r.score, fit=r.fit)
        reasons = () if is_alike else new.reasons or (Refusal.OUTDONE,)
        tested[key] = replace(new, gain=gain, reasons=reasons)
    alike = (c for c in tested.values() if not c.reasons)
    known = {c.score.effect.key: c for c in own.candidates}
    return replace(own, candidates=tuple((known | tested).values()), tied=(leader, *alike))


def _twins(one: Effect, effects: Sequence[Effect], taken: Collection[str]) -> Iterator[Effect]:
    """Effects that delay the same signal as another: what one explains the others explain nearly as well."""
    late = one.late_signal
    for effect in effects:
        is_twin = late != "" and effect.late_signal == late
        if is_twin and effect.key not in taken and len(effect.parameters) == len(one.parameters):
            yield effect


def _keys(fitted: PosteriorFit) -> set[str]:
    return {e.key for e in fitted.hypothesis.effects}


def _rivals(
    own: SearchRound, end: SearchRound, effects: Sequence[Effect]
) -> Iterator[tuple[Effect, list[Parameters]]]:
    """Rivals of a round's effect, and where their refits begin: what is as late, the ties, the best rival, and what the
    search has exchanged with the effect.

    A delay and a lag of one signal have the same size, a time.
    """
    last, member = end.null, own.tied[0].score.effect
    taken = {e.key for e in last.hypothesis.effects}
    for twin in list(_twins(member, effects, taken)):
        taken.add(twin.key)
        yield twin, [last.point]
    best = best_rival(own, last, member)
    for c in (*own.tied[1:], *(() if best is None else (best,))):
        key = c.score.effect.key
        if key not in taken:
            taken.add(key)
            yield c.score.effect, starts_in_place_of(last, member, c)
    rest = _keys(last) - {member.key}
    for f in end.exchanged:
        others = [e for e in f.hypothesis.effects if e.key not in rest]
        if f.converged and rest <= _keys(f) and len(others) == 1 and others[0].key not in taken:
            taken.add(others[0].key)
            yield others[0], []


__all__ = ["with_look_alikes"]
