"""Full refits of the leading candidates of a round."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.effects.effect import Effect
from airtruth.tracing.inference.assess import likelihood_at
from airtruth.tracing.inference.hypothesis import Hypothesis
from airtruth.tracing.inference.posterior import PosteriorFit, TraceProblem
from airtruth.tracing.model.parameters import Parameters
from airtruth.tracing.selection.acceptance import IMPROBABLE, declared_probability, own_probability
from airtruth.tracing.selection.budget import Advance, may_begin
from airtruth.tracing.selection.score_test import Score, ScoreTable
from airtruth.tracing.selection.set_table import SetTable

LEADING: Final = 8
"""Largest number of candidates that a round refits [-] (judgement: a refit costs seconds to a minute)."""
LED: Final = 3
"""The same of a round whose leader is known beforehand [-] (judgement: its rivals are refitted at the end of the search)."""
_BY_SCORE: Final = 2
"""Refits reserved for candidates that lead by their score under the autoregression [-] (judgement)."""
_VISIBLE: Final = 2.0
"""Score in standard deviations, innovations taken as white, from which a candidate may be refitted [-] (judgement:
most effects of which less shows would not pass)."""
_ATTEMPTS: Final = 3
"""Number of further refits that the leader is given to converge [-] (judgement)."""
_SHARES: Final = (2.0, 1.0, 0.6, 0.3, 0.1, 0.02)
"""Multiples of the size that the score suggests at which a refit may begin [-] (judgement: a score extrapolates along a
straight line, and overstates a size that acts in a curve more often than it understates one)."""
_TWICE: Final = 3
"""Number of leading candidates whose refit begins a second time, at the declared aircraft [-] (judgement: a refit each)."""
_SAME: Final = 0.5
"""Difference in log L below which two refits have reached the same optimum [-] (judgement: one standard error)."""
_EXPLAINED: Final = 0.2
"""Share of its score that a refit has to gain in log L to be taken without another start [-] (judgement; a score
promises one half)."""
_BETTER: Final = 2.0
"""Gain in log L that counts as another optimum [-] (judgement)."""
_AGREES: Final = 0.2
"""Share of the size known beforehand by which a converged refit may differ from it without a second one that begins there
[-] (judgement: another optimum, in which the derivatives have absorbed the effect, has a fraction of its size)."""


@dataclass(frozen=True)
class Refit:
    """An effect's refit beside the round's null.

    Attributes
    ----------
    score, fit : the score that made it a leading candidate, and the fit with all parameters free.
    freedom_correction : log L that the null gains by the freedom alone that the effect gives to derivatives and trim
        coefficients.
    """

    score: Score
    fit: PosteriorFit
    freedom_correction: float

    @property
    def cost(self) -> float:
        """Negative log-posterior that compares between effects: one per parameter, the freedom corrected."""
        return self.fit.cost + self.freedom_correction + self.parameters

    @property
    def parameters(self) -> int:
        """Number of parameters of the effect."""
        return len(self.score.effect.parameters)

    @property
    def size(self) -> float:
        """Fitted first parameter of the effect, in its size coordinate."""
        return float(self.fit.point.sizes[self.fit.hypothesis.span(self.score.effect.key).start])


def refit_leaders(
    sets: SetTable,
    null: PosteriorFit,
    table: ScoreTable,
    significant: NDArray[np.bool_],
    advance: Advance,
    wanted: Collection[str] = (),
    skip: Collection[str] = (),
    rival: float = np.inf,
    most: int = LEADING,
) -> list[Refit]:
    """Refit the leading candidates, best first; none where no score is significant and none is wanted.

    Parameters
    ----------
    table : scores at the null; significant : (scores,) which of them pass the level.
    wanted : keys of effects that have to be among the refitted ones; skip : keys of those that are not.
    rival : cost of another explanation; refits that stay far behind end early.
    most : number of candidates that are refitted.
    """
    if not significant.any() and not wanted:
        return []
    fits: list[Refit] = []
    for i in _leading(sets.problem, null, table, significant, wanted)[:most]:
        s = table.scores[i]
        if s.effect.key in skip:
            continue
        if not may_begin(advance, f"refit {s.effect.key}"):
            continue
        ahead = min((r.fit.cost for r in fits), default=rival)
        best = refit_scored(sets, null, table, i, min(ahead, rival))
        if best is not None:
            fits.append(Refit(s, best, freedom_gain(sets, null, s.effect)))
    for _ in range(_ATTEMPTS):  # the leader at least has to converge
        fits.sort(key=lambda r: r.cost)
        if not fits or fits[0].fit.converged:
            break
        first = fits[0].fit
        fits[0] = replace(fits[0], fit=sets.fit_from(first.hypothesis, first.point, near=first) or first)
    started_twice = [_from_both(sets, null, r, advance) for r in fits[:_TWICE]]
    return sorted([*started_twice, *fits[_TWICE:]], key=lambda r: r.cost)


def _from_both(sets: SetTable, null: PosteriorFit, r: Refit, advance: Advance) -> Refit:
    """The better of a refit and of one that begins at the declared aircraft with its size, where none began there before.

    Derivatives that have absorbed an effect at the null may keep a part of it in another optimum.
    """
    effect = r.score.effect
    if _is_improbable(sets.problem, null) or len(effect.parameters) > 1:
        return r
    if not may_begin(advance, f"refit {effect.key} from the declared aircraft"):
        return r
    tried = with_effect(sets, null, r.score, r.size, r.fit.cost - _BETTER, only_better=True)
    if tried is None or tried.cost > r.fit.cost - _BETTER:
        return r
    return Refit(r.score, tried, r.freedom_correction)


def refit_known(
    sets: SetTable,
    null: PosteriorFit,
    table: ScoreTable,
    fits: Sequence[Refit],
    known: Mapping[str, float],
    advance: Advance,
) -> list[Refit]:
    """The refits with those of effects whose size is known beforehand, best first; each begins at the declared aircraft.

    Parameters
    ----------
    fits : refits of the leading candidates; the better of two refits of an effect remains.
    known : key of an effect -> value of its first parameter, from the kinematic check. A refit that has ended at this value
        is not repeated.
    """
    best = {r.score.effect.key: r for r in fits}
    for s in table.scores:
        key = s.effect.key
        if key not in known or len(s.effect.parameters) > 1:
            continue
        size = s.effect.parameters[0].size(known[key])
        if key in best and best[key].fit.converged and abs(best[key].size - size) < _AGREES * abs(size):
            continue
        if not may_begin(advance, f"refit {key} from the kinematic check"):
            break
        ahead = min((r.fit.cost for r in best.values()), default=np.inf)
        tried = with_effect(sets, null, s, size, ahead)
        if tried is not None and (key not in best or tried.cost < best[key].fit.cost):
            best[key] = Refit(s, tried, freedom_gain(sets, null, s.effect))
    return sorted(best.values(), key=lambda r: r.cost)


def _leading(
    problem: TraceProblem,
    null: PosteriorFit,
    table: ScoreTable,
    significant: NDArray[np.bool_],
    wanted: Collection[str],
) -> list[int]:
    """Indices of the scores whose effects are refitted.

    An autoregression of a large misfit inflates the other scores, so most candidates are chosen by their score with
    innovations taken as white; it includes the noise levels too: a lag in gusts shows in the scatter.
    """
    white = np.array(table.white)
    by_white = np.argsort(-white, kind="stable")[: LEADING - _BY_SCORE]
    order = [int(i) for i in by_white if white[i] > _VISIBLE]
    if _is_improbable(problem, null):
        # a null far from the declared aircraft has absorbed effects that then have no score
        loose = null.hypothesis.unconstrained
        absorbed = [
            i for i, s in enumerate(table.scores) if null.hypothesis.plus(s.effect).unconstrained != loose
        ]
        order = [*absorbed, *(i for i in order if i not in absorbed)]
    by_score = np.argsort([-abs(s.z) for s in table.scores], kind="stable")
    order += [int(i) for i in by_score if int(i) not in order and significant[i]][: LEADING - len(order)]
    first = [i for i, s in enumerate(table.scores) if s.effect.key in wanted]
    order = [*first, *(i for i in order if i not in first)]
    return order


def refit_without(
    sets: SetTable, fitted: PosteriorFit, effect: Effect, rival: float = np.inf
) -> PosteriorFit | None:
    """The fit without one of its effects; ``rival`` as of `fit`."""
    span = fitted.hypothesis.span(effect.key)
    rest = tuple(e for e in fitted.hypothesis.effects if e.key != effect.key)
    point = replace(fitted.point, sizes=np.delete(fitted.point.sizes, span))
    return sets.fit(replace(fitted.hypothesis, effects=rest), point, rival=rival)


def losses_without(
    sets: SetTable, fitted: PosteriorFit, effects: Sequence[Effect]
) -> list[tuple[float, PosteriorFit | None]]:
    """Loss in 2 log L by the removal of each effect, less 2 for each of its parameters, and the fit without it.

    The loss is infinite where there is no fit, and a large one is an upper bound.
    """
    found: list[tuple[float, PosteriorFit | None]] = []
    for effect in effects:
        less = refit_without(sets, fitted, effect, fitted.cost)
        loss = np.inf if less is None else 2.0 * (less.cost - fitted.cost - len(effect.parameters))
        found.append((loss, less))
    return found


def redundant_effect(sets: SetTable, fitted: PosteriorFit, least: float) -> int | None:
    """Index of an earlier effect that the last one makes redundant; None where each is needed.

    An effect is redundant if its size is immaterial, or if the fit without it loses less than ``least`` in 2 log L.
    """
    at = 0
    for i, effect in enumerate(fitted.hypothesis.effects[:-1]):
        if abs(fitted.point.sizes[at]) < effect.parameters[0].material:
            return i
        ((loss, _),) = losses_without(sets, fitted, (effect,))
        if loss < least:
            return i
        at += len(effect.parameters)
    return None


def better_null(sets: SetTable, null: PosteriorFit, fits: Sequence[Refit]) -> PosteriorFit | None:
    """The null fitted again from the end of the best refit, if that is a better optimum."""
    if not fits:
        return None
    best, to_beat = fits[0].fit, null.cost - _BETTER
    start = replace(best.point, sizes=best.point.sizes[: len(null.point.sizes)])
    again = sets.fit_from(null.hypothesis, start, rival=to_beat, only_better=True, near=best)
    return again if again is not None and again.cost < to_beat else None


def freedom_gain(sets: SetTable, null: PosteriorFit, effect: Effect) -> float:
    """Log L that a null gains by the freedom alone that an effect gives to derivatives and trim coefficients.

    A curvature of unknown vertex releases a slope and a constant from their declaration
    (`airtruth.tracing.inference.hypothesis.unconstrained_by`). The gain of its refit contains that of this release.
    """
    free = null.hypothesis.plus(effect).unconstrained
    if free == null.hypothesis.unconstrained:
        return 0.0
    end = sets.fit(replace(null.hypothesis, also_unconstrained=free), null.point, near=null)
    return 0.0 if end is None else max(0.0, null.cost - end.cost)


def refit_scored(
    sets: SetTable, null: PosteriorFit, table: ScoreTable, number: int, rival: float = np.inf
) -> PosteriorFit | None:
    """The null and one effect with all parameters free, from multiples of the size that the score suggests.

    An improbable null has absorbed part of a large effect, and the search from there can end in another optimum. So
    one more refit begins at the declared aircraft, with the size that the score has without an autoregression,
    because an autoregression can absorb such an effect as a whole.

    Parameters
    ----------
    table, number : scores at the null, and the index of the effect's; rival : as of `fit`.
    """
    s, white_size = table.scores[number], table.white_sizes[number]
    hypothesis = null.hypothesis.plus(s.effect)
    known = sets.best(hypothesis)
    if known is not None:
        return known
    is_limit = s.effect.parameters[0].is_limit
    best: PosteriorFit | None = None
    for share in _ordered_shares(sets.problem, null, hypothesis, s):
        tried = sets.fit_from(hypothesis, _at(null, s, share * s.size), rival=rival, near=null)
        if tried is None:
            continue
        again = best is not None and abs(tried.cost - best.cost) < _SAME
        if best is None or tried.cost < best.cost:
            best = tried
        gain = null.cost - best.cost
        # several starts may end at a limit too high to act
        if (best.converged and gain > _EXPLAINED * s.z**2) or (again and not (is_limit and gain < _BETTER)):
            break
    if _is_improbable(sets.problem, null):
        to_beat = np.inf if best is None else best.cost - _SAME
        tried = with_effect(sets, null, s, white_size, min(rival, to_beat), only_better=to_beat < rival)
        if tried is not None and (best is None or tried.cost < best.cost):
            best = tried
    return best


def with_effect(
    sets: SetTable, null: PosteriorFit, s: Score, size: float, rival: float, *, only_better: bool = False
) -> PosteriorFit | None:
    """A null's effects and one more, from the declared aircraft; None and options as of `SetTable.fit_from_declared`.

    Parameters
    ----------
    s, size : score of the further effect, and the size at which it begins.
    """
    sizes = _at(null, s, size).sizes
    hypothesis = null.hypothesis.plus(s.effect)
    return sets.fit_from_declared(hypothesis, sizes, null, rival=rival, only_better=only_better)


def _at(null: PosteriorFit, s: Score, size: float) -> Parameters:
    """The parameters of a null with an effect of a size beside them."""
    low, high = s.effect.parameters[0].reach
    sizes = s.direction.sizes(min(max(size, low), high))
    return replace(null.point, sizes=np.concatenate([null.point.sizes, sizes]))


def _is_improbable(problem: TraceProblem, null: PosteriorFit) -> bool:
    """Whether derivatives, biases or trim coefficients of a null contradict the declared ones."""
    return min(declared_probability(problem, null), own_probability(problem, null)) < IMPROBABLE


def _ordered_shares(
    problem: TraceProblem, null: PosteriorFit, hypothesis: Hypothesis, s: Score
) -> list[float]:
    """`_SHARES`, the most likely size first, all other parameters as in the null."""
    costs = [likelihood_at(problem, hypothesis, _at(null, s, share * s.size)) for share in _SHARES]
    return [_SHARES[i] for i in np.argsort(costs, kind="stable")]


__all__ = [
    "LEADING",
    "LED",
    "Refit",
    "better_null",
    "losses_without",
    "redundant_effect",
    "refit_leaders",
    "refit_scored",
    "refit_without",
    "with_effect",
]
