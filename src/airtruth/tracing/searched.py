"""The search of one motion: its case, the fits of its sets of effects, and its rounds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from airtruth.checks.result import CheckResult
from airtruth.effects.effect import Effect
from airtruth.errors import LogError
from airtruth.tracing.calibration.calibrated import calibrated
from airtruth.tracing.calibration.noise_colour import beside, later_level
from airtruth.tracing.kinematic_start import sets_of, starts_of
from airtruth.tracing.model.parameters import Parameters
from airtruth.tracing.options import TraceOptions
from airtruth.tracing.prepare import Case
from airtruth.tracing.selection.budget import Advance, Budget, may_begin
from airtruth.tracing.selection.learn import with_increments
from airtruth.tracing.selection.look_alikes import with_look_alikes
from airtruth.tracing.selection.outcome import total_cost
from airtruth.tracing.selection.posterior_rounds import posterior_search
from airtruth.tracing.selection.pruning import pruned
from airtruth.tracing.selection.rounds import (
    NOTHING_KNOWN,
    RoundStart,
    SearchRound,
    scored_round,
    search_round,
)
from airtruth.tracing.selection.search import search
from airtruth.tracing.selection.set_table import SetTable
from airtruth.tracing.selection.significance import LEVEL
from airtruth.tracing.selection.weights import with_rival


@dataclass(frozen=True)
class Searched:
    """A search of one motion.

    Attributes
    ----------
    case : records and declared aircraft, with the correlated noise and the corners that the records show.
    sets : fits of the sets of effects; rounds : of the search.
    start : where the search for the parameters of the declared aircraft begins.
    kinematics : check of the fitted records; None where they do not allow one.
    options : choices of the trace; advance : receives the step that begins, or holds the time budget.
    """

    case: Case
    sets: SetTable
    rounds: tuple[SearchRound, ...]
    start: Parameters
    kinematics: CheckResult | None
    options: TraceOptions
    advance: Advance

    @property
    def longest_period_s(self) -> float:
        """Longest sample period of the fitted records [s]."""
        return max(r.signals.dt_s for r in self.case.fitted.records)

    def beginning(self, effects: Mapping[str, Effect], known: Mapping[str, float]) -> Searched:
        """The search again, with some effects accepted first.

        Parameters
        ----------
        effects : key -> candidate that takes the place of the one of its key, and leads a round of its own.
        known : key -> value at which its refit begins [unit of its first parameter].
        """
        candidates = tuple(effects.get(e.key, e) for e in self.case.effects)
        case = replace(self.case, effects=candidates)
        begin = RoundStart(case.hypothesis, self.start, candidates, settled=True)
        before: tuple[SearchRound, ...] = ()
        for key in effects:
            led = replace(begin, leader=key, in_set=True)
            seed, steps = self.options.seed, self.advance
            own = search_round(self.sets, led, len(before), seed, steps, known={key: known[key]})
            if own is None or not own.tied or own.tied[0].score.effect.key != key:
                return self
            before = (*before, replace(own, release=None))
            fit = own.tied[0].fit
            left = tuple(e for e in begin.effects if e.key != key)
            begin = RoundStart(fit.hypothesis, fit.point, left, settled=True, near=fit)
        return replace(self, case=case, rounds=(*before, *_rounds(replace(self, case=case), begin)))

    def repeated(self, effects: Mapping[str, Effect]) -> Searched:
        """The search again, with effects in the place of the candidates of their keys."""
        case = replace(self.case, effects=tuple(effects.get(e.key, e) for e in self.case.effects))
        again = replace(self, case=case)
        return replace(again, rounds=_rounds(again) or self.rounds)

    def refitted(self, effects: Mapping[str, Effect]) -> Searched:
        """The same rounds, with the last fit made again for effects in the place of those of their keys."""
        case = replace(self.case, effects=tuple(effects.get(e.key, e) for e in self.case.effects))
        last = self.rounds[-1]
        members = tuple(effects.get(e.key, e) for e in last.null.hypothesis.effects)
        hypothesis = replace(last.null.hypothesis, effects=members)
        fit = self.sets.fit(hypothesis, last.null.point, near=last.null)
        if fit is None:
            return self
        seed, before = self.options.seed, self.rounds[:-1]
        end = scored_round(self.sets, fit, case.effects, len(before), seed, self.advance)
        if end is None:
            return self
        end = replace(end, sets=last.sets, release=last.release, rival=last.rival)
        return replace(self, case=case, rounds=(*before, end))

    def finished(self) -> Searched:
        """The search with learned increments and with the effects that look like the accepted ones."""
        rounds, options, effects = self.rounds, self.options, self.case.effects
        if options.learns:
            declared = self.case.declared
            rounds = with_increments(self.sets, rounds, effects, options.seed, self.advance, declared)
        if not rounds[-1].posterior:
            rounds = with_look_alikes(self.sets, rounds, effects, self.advance)
        case = self.case
        if isinstance(self.advance, Budget):
            case = replace(case, left_out=self.advance.left_out)
        return replace(self, rounds=rounds, case=case)


def searched(case: Case, options: TraceOptions, advance: Advance, kinematics: CheckResult | None) -> Searched:
    """Search for the named effects that the declared aircraft lacks.

    Parameters
    ----------
    case : what is fitted; options, advance, kinematics : as of `Searched`.

    Raises
    ------
    LogError
        If the declared aircraft does not fly like the records at all.
    """
    advance("refit the declared aircraft")
    limited = None if options.time_budget_s is None else Budget(options.time_budget_s, advance)
    case, start = calibrated(case)
    own = Searched(case, SetTable(case.fitted), (), start, kinematics, options, limited or advance)
    own = replace(own, rounds=_rounds(own))
    if not own.rounds:
        raise LogError(
            f"the declared aircraft {case.fitted.records[0].plant.aircraft.name} does not fly like these records: its "
            "motion diverges; check units and signs with `airtruth check`, and that it is the right aircraft"
        )
    if own.rounds[-1].null.hypothesis.effects and not case.fitted.settings.coloured:
        return _with_later_colour(own)
    return own


def _rounds(
    own: Searched, begin: RoundStart | None = None, other: Sequence[Effect] = ()
) -> tuple[SearchRound, ...]:
    """The rounds of a search without the names that later ones make unnecessary.

    Parameters
    ----------
    begin : where the search begins; None for the declared aircraft.
    other : effects that another search accepted.
    """
    case, options = own.case, own.options
    at = begin or RoundStart(case.hypothesis, own.start, case.effects)
    if case.fitted.layout.motion.name == "longitudinal":
        return posterior_search(own.sets, at, options.seed, own.advance, case.declared)
    known = starts_of(own.kinematics) if begin is None else NOTHING_KNOWN
    rounds = search(
        own.sets,
        at.hypothesis,
        at.start,
        at.effects,
        options.seed,
        own.advance,
        case.declared,
        known,
        other,
        sets_of(own.kinematics, own.longest_period_s),
    )
    return rounds and pruned(own.sets, rounds, case.effects, options.seed, LEVEL, own.advance)


def _with_later_colour(own: Searched) -> Searched:
    """The search again with correlated noise that shows beside what it explained, where that explains more.

    At the declared aircraft a strong effect drives correlated noise to its limits, and it does not enter. Correlated noise can
    imitate a share of an effect too, so that the effects of the first search are tried beside it.
    """
    case, last = own.case, own.rounds[-1]
    level = later_level(sum(r.samples for r in case.fitted.records), len(case.fitted.settings.noise))
    coloured, point = beside(case, last.null, level)
    if not coloured.fitted.settings.coloured or not may_begin(own.advance, "search with correlated noise"):
        return own
    start = replace(point, sizes=np.empty(0))
    slow = replace(own, case=coloured, sets=SetTable(coloured.fitted), start=start)
    again = _rounds(slow, other=last.null.hypothesis.effects)
    if not again:
        return own
    if total_cost(again[-1]) < total_cost(last):
        return replace(slow, rounds=with_rival(again, own.rounds))
    return replace(own, rounds=with_rival(own.rounds, again))


__all__ = ["Searched", "searched"]
