"""Which errors explain the records: sets of causes compared by one statistic.

A set of errors costs its statistic (`airtruth.checks.kinematics_fit`), the improbability of its sizes and a price for
each error (`price`). The sets within a margin of the cheapest one explain the records as well. A size is no evidence of the
records: it ranks the sets, and no set is excluded for it alone. The same weight serves every set: it is assessed at the
cheapest set of the round before, until that set stays the same.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc, stdtrit

from airtruth.checks.kinematics_energy import absolute
from airtruth.checks.kinematics_fit import Fit, KinematicProblem, fit, problem_of

Array = NDArray[np.float64]

FALSE: Final = 1e-3
"""Probability of a further error that is absent, for each candidate [-]: judgement; 14 candidates then give a false one
in 1.4 % of the records."""
EQUAL: Final = 5e-3
"""Probability that noise alone makes the true set worse than another one by more than the margin [-]: judgement.
It is the level of one comparison if the noise is as modelled; over all comparisons of a flight, a check of six records excluded
the true cause in 6 of 100 (`studies.excluded_causes`)."""
BEAM: Final = 4
"""Sets that are continued with a further error [-]: judgement."""
TRIED: Final = 7
"""Fits of a set with a further error, of those that promise most [-]: judgement."""
ROUNDS: Final = 3
"""Largest number of weights [-]: judgement; two usually suffice."""
DOUBT: Final = 0.01
"""Probability of the motion that the best set leaves, below which the model is weighed as inexact [-]: judgement."""
STARTS: Final = (0.03, 0.2, 0.6)
"""Starts of a lag or a delay, as shares of its range [-]: judgement; from zero alone a large lag is not reached."""


@dataclass(frozen=True)
class ErrorSet:
    """A set of errors with its fit.

    Attributes
    ----------
    fit : sizes and statistic.
    cost : statistic, improbability of the sizes, and `price` for each error, as a difference of 2 log likelihood.
    improbability : part of the cost that the sizes make.
    """

    fit: Fit
    cost: float
    improbability: float = 0.0

    @property
    def names(self) -> frozenset[str]:
        """Errors of the set."""
        return frozenset(self.fit.names)

    def behind(self, best: ErrorSet) -> float:
        """Distance from the best set in 2 log likelihood: by the cost, or by the records alone if that is less."""
        whole = self.cost - best.cost
        return min(whole, whole - self.improbability + best.improbability)


@dataclass(frozen=True)
class ErrorSearch:
    """Outcome of a search.

    Attributes
    ----------
    problem : records with the final weight.
    best : the cheapest explanation.
    equals : explanations that the records do not distinguish from it, itself first; none contains another.
    tried : every explanation, the cheapest first.
    unsound : sets whose fit ended at a limit or unconverged, the cheapest first.
    enlargement : factor on variances, common to all sets, for motion that no set explains; at least 1.
    margin : `Explanation.behind` up to which sets are equal.
    statistic, degrees, p_value : absolute test of the best explanation, each record and equation by itself.
    stable : whether the weight was assessed at the best explanation itself.
    """

    problem: KinematicProblem
    best: ErrorSet
    equals: tuple[ErrorSet, ...]
    tried: tuple[ErrorSet, ...]
    unsound: tuple[ErrorSet, ...]
    enlargement: float
    margin: float
    statistic: float
    degrees: int
    p_value: float
    stable: bool


def search(problem: KinematicProblem, usual: Mapping[str, float]) -> ErrorSearch:
    """Find the errors that explain records.

    Parameters
    ----------
    problem : records, weighed at the declared errors.
    usual : candidates, name -> size that is not unusual [SI].
    """
    best: dict[frozenset[str], Fit] = {}
    chosen: Fit | None = None
    stable = False
    for _ in range(ROUNDS):
        hints = _hints(problem, usual)
        ranked = _ranked(problem, best, usual) if best else []
        seeds = [dict(zip(e.fit.names, e.fit.value, strict=True)) for e in ranked[:BEAM]]
        best = _pruned(problem, _sets(problem, usual, seeds, hints), usual, hints)
        before, chosen = chosen, _ranked(problem, best, usual)[0].fit
        if before is not None and before.names == chosen.names:
            stable = True
            break
        errors = dict(zip(chosen.names, chosen.value, strict=True))
        if not errors:
            stable = True
            break
        problem = problem_of(
            problem.records,
            problem.equations,
            problem.known,
            problem.limits,
            errors,
            problem.lines,
            problem.kinematics,
            problem.enlarged,
        )
    ranked = _ranked(problem, best, usual)
    scale, _ = _scale(problem, [f for f in best.values() if f.sound], usual)
    statistic, degrees = absolute(problem, ranked[0].fit)
    return ErrorSearch(
        problem=problem,
        best=ranked[0],
        equals=_equals(ranked, scale.margin),
        tried=tuple(ranked),
        unsound=tuple(_ranked(problem, best, usual, sound=False)),
        enlargement=scale.factor,
        margin=scale.margin,
        statistic=statistic,
        degrees=degrees,
        p_value=float(fdtrc(max(degrees, 1), _noise_degrees(problem), statistic / max(degrees, 1))),
        stable=stable,
    )


def _noise_degrees(problem: KinematicProblem) -> float:
    return len(problem.equations) * problem.weight.degrees


def price(problem: KinematicProblem) -> float:
    """Price of a further error: the squared quantile of Student's distribution at `FALSE`."""
    return float(stdtrit(problem.weight.degrees, 0.5 * FALSE) ** 2)


@dataclass(frozen=True)
class _Hint:
    """A candidate near one of its starts: the change of the moments there, and their derivative."""

    name: str
    start: float
    change: Array
    slope: Array


def _hints(problem: KinematicProblem, usual: Mapping[str, float]) -> list[_Hint]:
    """Every candidate at each of its starts, the others as declared."""
    base = problem.moments({})
    result = []
    for name in usual:
        declared, high = problem.start(name), problem.limits[name][1]
        shares = (0.0, *STARTS) if problem.kinematics.errors[name].kind in ("lag", "delay") else (0.0,)
        for share in shares:
            start = declared + share * (high - declared)
            moments = problem.moments({name: start}) if share else base
            slope = problem.slope(name, {name: start}, moments)
            result.append(_Hint(name, start, moments - base, slope))
    return result


def _promised(moments: Array, slopes: Sequence[Array], hints: Sequence[_Hint]) -> float:
    """Statistic that a set with further errors reaches where the errors add up."""
    left = moments + np.sum([h.change for h in hints], axis=0)
    free = np.array([*slopes, *(h.slope for h in hints)])
    size = np.maximum(np.linalg.norm(free, axis=1, keepdims=True), 1e-300)
    gram = (free / size) @ (free / size).T + 1e-9 * np.eye(len(free))
    along = (free / size) @ left
    return float(left @ left - along @ np.linalg.solve(gram, along))


def _sets(
    problem: KinematicProblem,
    usual: Mapping[str, float],
    seeds: Sequence[Mapping[str, float]],
    hints: Sequence[_Hint],
) -> dict[frozenset[str], Fit]:
    """Fits of all sets that were reached: seeds first, then ever larger ones; pairs at once, because two errors may
    hide each other.
    """
    known = {frozenset(s): fit(problem, tuple(s), s) for s in seeds}
    known[frozenset()] = fit(problem, ())
    _grow(problem, known, [known[frozenset()]], [(h,) for h in hints])
    pairs = [(a, b) for a, b in combinations(hints, 2) if a.name != b.name]
    _grow(problem, known, [known[frozenset()]], pairs)
    for size in range(1, problem.kinematics.most):
        sound = [f for k, f in known.items() if len(k) == size and f.sound]
        layer = sorted(sound, key=lambda f: f.statistic + _improbability(problem, f, usual))[:BEAM]
        if not layer:
            break
        _grow(problem, known, layer, [(h,) for h in hints])
        least = [
            min((f.statistic for k, f in known.items() if len(k) <= n and f.sound), default=np.inf)
            for n in (size, size + 1)
        ]
        if least[1] > least[0] - 0.5 * price(problem):
            break
    return known


def _grow(
    problem: KinematicProblem,
    known: dict[frozenset[str], Fit],
    layer: Sequence[Fit],
    more: Sequence[tuple[_Hint, ...]],
) -> None:
    """Fit the sets of a layer with the further errors that promise most, and add them to those that are known."""
    for one in layer:
        errors = dict(zip(one.names, one.value, strict=True))
        moments, rows = problem.linearised(one.names, errors)
        slopes = list(rows)
        promises: dict[frozenset[str], tuple[float, int]] = {}
        for i, hints in enumerate(more):
            names = frozenset(h.name for h in hints)
            if names & errors.keys() or _doubled(problem, names | errors.keys()):
                continue
            promised = _promised(moments, slopes, hints), i
            promises[names] = min(promised, promises.get(names, promised))
        for _, i in sorted(promises.values())[:TRIED]:
            start = {**errors, **{h.name: h.start for h in more[i]}}
            better = fit(problem, tuple(start), start, [*slopes, *(h.slope for h in more[i])])
            key = frozenset(start)
            if key not in known or (better.sound, -better.statistic) > (
                known[key].sound,
                -known[key].statistic,
            ):
                known[key] = better


def _doubled(problem: KinematicProblem, names: frozenset[str]) -> bool:
    return any(len(group & names) > 1 for group in problem.kinematics.same)


def _pruned(
    problem: KinematicProblem,
    sets: dict[frozenset[str], Fit],
    usual: Mapping[str, float],
    hints: Sequence[_Hint],
) -> dict[frozenset[str], Fit]:
    """Add the leading sets less each of their errors, and the best one with each error exchanged for another."""
    sets = dict(sets)
    for _ in range(problem.kinematics.most):
        added = False
        best = _ranked(problem, sets, usual)[0]
        less = [sets[best.names - {n}] for n in best.names if best.names - {n} in sets]
        _grow(problem, sets, [f for f in less if f.names], [(h,) for h in hints])
        for one in _ranked(problem, sets, usual)[:BEAM]:
            errors = dict(zip(one.fit.names, one.fit.value, strict=True))
            for name in one.fit.names:
                if one.names - {name} not in sets:
                    rest = {n: v for n, v in errors.items() if n != name}
                    sets[one.names - {name}] = fit(problem, tuple(rest), rest)
                    added = True
        if not added:
            break
    return sets


def _improbability(problem: KinematicProblem, one: Fit, usual: Mapping[str, float]) -> float:
    """Improbability of the sizes: -2 log of a Cauchy distribution of the usual sizes, zero for no error."""
    sizes = [(v - problem.start(n)) / usual[n] for n, v in zip(one.names, one.value, strict=True)]
    return float(2.0 * np.sum(np.log1p(np.square(sizes))))


@dataclass(frozen=True)
class _Scale:
    """Level that counts as noise: the weight itself, or the motion that the chosen set leaves.

    Attributes
    ----------
    factor : factor on variances [-].
    margin : `Explanation.behind` up to which sets are equal.
    """

    factor: float
    margin: float


def _costs(problem: KinematicProblem, fits: Sequence[Fit], usual: Mapping[str, float], exact: bool) -> Array:
    """Costs of sets: their statistic, or, where the model is not exact, -2 log likelihood at the best noise level."""
    count = problem.weight.span.shape[1]
    rest = np.array([f.statistic for f in fits])
    sizes = np.array([_improbability(problem, f, usual) for f in fits])
    if exact:
        return np.asarray(rest + sizes + price(problem) * np.array([len(f.names) for f in fits]))
    steps = [_inexact(FALSE, count - k - 1, count) for k in range(problem.kinematics.most + 2)]
    prices = np.concatenate([[0.0], np.cumsum(steps)])
    level = count * (1.0 + np.log(np.maximum(rest / count, 1.0)))
    return np.asarray(level + sizes + price(problem) + prices[[len(f.names) for f in fits]])


def _inexact(probability: float, degrees: int, count: int) -> float:
    """Gain of 2 log likelihood at the best noise level that noise exceeds with a probability: that of an F test."""
    degrees = max(degrees, 1)
    return float(count * np.log1p(stdtrit(degrees, 0.5 * probability) ** 2 / degrees))


def _scale(problem: KinematicProblem, fits: Sequence[Fit], usual: Mapping[str, float]) -> tuple[_Scale, bool]:
    """Whether the weight is the noise of the chosen set (exact), or what that set leaves.

    No kinematic model explains a real record exactly: sideslip, bending and the position of the instruments leave more
    than noise. A discrepancy that enlarges the noise (R. T. Birge, *Physical Review* 40, 1932) is one more hypothesis,
    with the price of an error, so that a handful of small errors is not named for it. It is weighed only where what
    the best set leaves is improbable (`DOUBT`).
    """
    by_noise, by_rest = (_costs(problem, fits, usual, exact) for exact in (True, False))
    best = fits[int(np.argmin(by_noise))]
    left = max(problem.weight.span.shape[1] - len(best.names), 1)
    doubtful = fdtrc(left, _noise_degrees(problem), best.statistic / left) < DOUBT
    if not doubtful or by_noise.min() <= by_rest.min():
        return _Scale(1.0, float(stdtrit(problem.weight.degrees, 0.5 * EQUAL) ** 2)), True
    chosen = fits[int(np.argmin(by_rest))]
    degrees = max(problem.weight.span.shape[1] - len(chosen.names), 1)
    factor = max(chosen.statistic / degrees, 1.0)
    return _Scale(factor, _inexact(EQUAL, degrees, problem.weight.span.shape[1])), False


def _ranked(
    problem: KinematicProblem,
    fits: Mapping[frozenset[str], Fit],
    usual: Mapping[str, float],
    sound: bool = True,
) -> list[ErrorSet]:
    _, exact = _scale(problem, [f for f in fits.values() if f.sound], usual)
    chosen = [f for f in fits.values() if f.sound is sound]
    costs = _costs(problem, chosen, usual, exact)
    return sorted(
        (
            ErrorSet(f, float(c), _improbability(problem, f, usual))
            for f, c in zip(chosen, costs, strict=True)
        ),
        key=lambda e: e.cost,
    )


def _equals(ranked: Sequence[ErrorSet], most: float) -> tuple[ErrorSet, ...]:
    best = ranked[0]
    near = [
        e for e in ranked if e.behind(best) <= most and not (e.names > best.names or e.names < best.names)
    ]
    return tuple(e for e in near if not any(o.names < e.names for o in near))


def completed(found: ErrorSearch, usual: Mapping[str, float]) -> ErrorSearch:
    """Search whose explanations were each fitted with every further candidate, in place of one of the same motion."""
    tried = {e.names: e.fit for e in (*found.unsound, *found.tried)}
    for one in found.equals[: found.problem.kinematics.most + 1]:
        errors = dict(zip(one.fit.names, one.fit.value, strict=True))
        for name in usual:
            same = found.problem.kinematics.same
            twins = {n for group in same if name in group for n in group} - {name}
            start = {n: v for n, v in errors.items() if n not in twins}
            key = frozenset(start) | {name}
            if key not in tried:
                tried[key] = fit(found.problem, tuple(dict.fromkeys((*start, name))), start)
    return replace(
        found,
        tried=tuple(_ranked(found.problem, tried, usual)),
        unsound=tuple(_ranked(found.problem, tried, usual, sound=False)),
    )


__all__ = ["DOUBT", "ErrorSearch", "ErrorSet", "absolute", "completed", "price", "search"]
