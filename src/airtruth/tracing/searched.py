"""The search of one motion: its case, the fits of its sets of effects, and its rounds."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from airtruth.checks.result import CheckResult
from airtruth.effects.effect import Effect
from airtruth.errors import LogError
from airtruth.tracing.budget import Advance, Budget, may_begin
from airtruth.tracing.calibration.calibrated import calibrated
from airtruth.tracing.calibration.noise_colour import beside, later_level
from airtruth.tracing.kinematic_start import likelihood_of, starts_of
from airtruth.tracing.learning.learn import with_increments
from airtruth.tracing.model.parameters import Parameters
from airtruth.tracing.options import TraceOptions
from airtruth.tracing.prepare import Case
from airtruth.tracing.selection.rounds import SearchRound, scored
from airtruth.tracing.selection.search import search
from airtruth.tracing.selection.set_table import SetTable


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

    def repeated(self, effects: Mapping[str, Effect], required: Collection[str] = ()) -> Searched:
        """The search again, with effects in the place of the candidates of their keys.

        Parameters
        ----------
        required : keys of effects that the set has to hold.
        """
        case = replace(self.case, effects=tuple(effects.get(e.key, e) for e in self.case.effects))
        return _with_rounds(replace(self, case=case), required)

    def refitted(self, effects: Mapping[str, Effect]) -> Searched:
        """The same rounds, with the last fit made again for effects in the place of those of their keys."""
        case = replace(self.case, effects=tuple(effects.get(e.key, e) for e in self.case.effects))
        last = self.rounds[-1]
        members = tuple(effects.get(e.key, e) for e in last.null.hypothesis.effects)
        hypothesis = replace(last.null.hypothesis, effects=members)
        fit = self.sets.fit(hypothesis, last.null.point, near=last.null)
        if fit is None:
            return self
        end = scored(self.sets.problem, fit, case.effects, self.options.seed)
        end = replace(end, explanation=last.explanation, posterior=last.posterior)
        return replace(self, case=case, rounds=(*self.rounds[:-1], end))

    def finished(self) -> Searched:
        """The search with learned increments."""
        rounds, options, effects = self.rounds, self.options, self.case.effects
        if options.learns:
            rounds = with_increments(self.sets, rounds, effects, options.seed, self.advance)
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
    case = replace(case, fitted=replace(case.fitted, kinematics=likelihood_of(kinematics)))
    own = Searched(case, SetTable(case.fitted), (), start, kinematics, options, limited or advance)
    own = _with_rounds(own)
    if not own.rounds:
        raise LogError(
            f"the declared aircraft {case.fitted.records[0].plant.aircraft.name} does not fly like these records: its "
            "motion diverges; check units and signs with `airtruth check`, and that it is the right aircraft"
        )
    if own.rounds[-1].null.hypothesis.effects and not case.fitted.settings.coloured:
        return _with_later_colour(own)
    return own


def _with_rounds(
    own: Searched, required: Collection[str] = (), among: Collection[str] | None = None
) -> Searched:
    """A search with its rounds, or with those that it had where no set can be fitted.

    Parameters
    ----------
    among : keys of the errors of sensors at which the search may begin; None for those that the kinematics allows.
    """
    case = own.case
    starts = starts_of(own.kinematics, own.longest_period_s)
    rounds = search(
        own.sets,
        case.hypothesis,
        own.start,
        case.effects,
        own.options.seed,
        case.declared,
        own.advance,
        required,
        [one for one in starts if among is None or set(one) <= set(among)],
    )
    return replace(own, case=replace(case, fitted=own.sets.problem), rounds=rounds or own.rounds)


def _with_later_colour(own: Searched) -> Searched:
    """The search again with correlated noise that shows beside what it explained, where that explains more.

    At the declared aircraft a strong effect drives correlated noise to its limits, and it does not enter. Correlated noise can
    imitate a share of an effect too, so that the more probable of the two answers remains. The search begins at the errors of
    sensors that the first one named.
    """
    case, last = own.case, own.rounds[-1]
    level = later_level(sum(r.samples for r in case.fitted.records), len(case.fitted.settings.noise))
    coloured, point = beside(case, last.null, level)
    if not coloured.fitted.settings.coloured or not may_begin(own.advance, "search with correlated noise"):
        return own
    start = replace(point, sizes=np.empty(0))
    slow = replace(own, case=coloured, sets=SetTable(coloured.fitted), start=start)
    slow = _with_rounds(slow, among=[e.key for e in last.null.hypothesis.effects])
    return slow if slow.rounds and _cost(slow) < _cost(own) else own


def _cost(own: Searched) -> float:
    """Negative log-posterior of the answer, with one for each parameter of its effects."""
    last = own.rounds[-1].null
    return last.cost + len(last.point.sizes)


__all__ = ["Searched", "searched"]
