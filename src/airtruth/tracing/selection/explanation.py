"""Why the derivatives differ from the declared ones: sets of physical causes and of wrong declarations, by evidence.

A cause k of size s adds s v_k to the derivatives, v_k by `airtruth.physics.composition`; a wrong declaration
leaves a derivative with a standard deviation ten times the declared one. Each set of causes is a normal prior of the
increments, so that its evidence over the likelihood of the derivatives is known in closed form.

Sources: D. J. C. MacKay, Neural Computation 4 (1992) 415-447 (evidence and its Occam factor); A. O'Hagan, J. R.
Statist. Soc. B 41 (1979) 358-367 (declarations with heavy tails).
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from airtruth.effects.registry import EFFECTS
from airtruth.physics.motion import Motion
from airtruth.tracing.inference.causes import DERIVATIVES, Cause
from airtruth.tracing.inference.derivative_likelihood import DerivativeLikelihood

Array = NDArray[np.float64]
Subset = tuple[int, ...]
"""Numbers of derivatives."""

WRONG_BY: Final = (3.0, 10.0)
"""Standard deviation of a derivative whose declaration is wrong, over the declared one [-]: equal parts of a mixture
(judgement: published uncertainties of derivatives are often too small by the first factor, and by up to the second)."""
MOST_CAUSES: Final = 3
"""Largest number of physical causes in a set, besides wrong declarations [-] (judgement: six derivatives do not tell
more apart)."""
LOG_SAME_EVENT: Final = -1.0
"""Logarithm of the prior odds of each further cause of the same event [-] (judgement: one in three)."""
LOG_WRONG: Final = -1.0
"""Logarithm of the prior odds of wrong declarations, and of each derivative that they concern [-] (judgement: they are
the most frequent cause)."""
REFERENCE: Final = 4.0
"""Log-evidence that a single cause of usual size costs beyond one for its parameter [-]: prior odds of 3.0 and an Occam
factor of 2.0; it makes sets comparable with the refit of an effect, whose size has no prior."""
AS_PROBABLE: Final = 0.1
"""Posterior weight over that of the most probable effects from which fewer effects are preferred [-] (judgement: a further cause
is named where the odds for it are strong, from ten to one by H. Jeffreys, Theory of Probability, 3rd ed. (1961), appendix B)."""
_AS_PROBABLE_IN_EVENT: Final = 0.5
"""Posterior weight over that of the most probable effects from which fewer effects of the same event are preferred [-]
(judgement: a changed loading changes CG, mass and inertia, as a rule)."""
_EVERY: Final = 6
"""Number of derivatives of which every set of wrong declarations is compared [-] (judgement: 64 sets; of 15 there are 32768)."""
_NEGLIGIBLE: Final = 60.0
"""Log-posterior behind the most probable set from which a set is left out [-] (judgement: twice what a refit may still change).
"""
_LEAST_SHARE: Final = 1e-15
"""Least probability of the plausible range of a size [-] (judgement: below it a set is out of the question)."""


@dataclass(frozen=True)
class CauseSet:
    """A set of causes and its evidence.

    Attributes
    ----------
    causes : keys of the physical causes; wrong : names of the derivatives whose declaration is wrong.
    sizes, size_std : (causes,) estimates without the prior of the sizes, and their standard deviations.
    covariance : (derivatives, derivatives) prior covariance of the increments under the set.
    cost : negative logarithm of posterior and prior odds; comparable with the cost of a refitted effect.
    """

    causes: tuple[str, ...]
    wrong: tuple[str, ...]
    sizes: tuple[float, ...]
    size_std: tuple[float, ...]
    covariance: Array
    cost: float

    @property
    def effects(self) -> tuple[str, ...]:
        """Keys of its effects: the causes, then `DERIVATIVES` where declarations are wrong."""
        return (*self.causes, *([DERIVATIVES] if self.wrong else []))

    def without(self, keys: Collection[str]) -> CauseSet:
        """The set without some of its physical causes."""
        kept = [i for i, key in enumerate(self.causes) if key not in keys]
        return replace(
            self,
            causes=tuple(self.causes[i] for i in kept),
            sizes=tuple(self.sizes[i] for i in kept),
            size_std=tuple(self.size_std[i] for i in kept),
        )


def explain(
    likelihood: DerivativeLikelihood, causes: Sequence[Cause], wrong_allowed: bool = True
) -> tuple[CauseSet, ...]:
    """Sets of up to `MOST_CAUSES` causes and wrong declarations, the most probable first.

    Those farther than `_NEGLIGIBLE` behind the first are not among them.

    Parameters
    ----------
    likelihood : of the derivatives; causes : physical causes.
    wrong_allowed : whether declarations may be wrong.
    """
    evidence: list[_Compared] = []
    so_far = np.inf
    for count in range(min(MOST_CAUSES, len(causes)) + 1):
        for chosen in combinations(causes, count):
            for compared in _compared(likelihood, chosen, wrong_allowed, so_far):
                evidence.append(compared)
                so_far = min(so_far, float(compared[2].min()))
    least = min(float(np.nanmin(cost, initial=np.inf)) for _, _, cost in evidence)
    found = (
        scales[best[i]].set_of(i, cost[i])
        for scales, best, cost in evidence
        for i in np.flatnonzero(cost <= least + _NEGLIGIBLE)
    )
    return tuple(sorted(found, key=lambda s: s.cost))


def simplest_first(sets: Sequence[CauseSet]) -> tuple[CauseSet, ...]:
    """The sets, that of the fewest events first against which the odds of the most probable ones are not strong.

    Of sets of as many events, the fewest effects are first that are half as probable as the best of them. Wrong declarations of
    any derivatives are one effect, whose weight is the sum over its sets.
    """
    if not sets:
        return ()
    least = least_cost(sets)
    weights: dict[tuple[str, ...], float] = {}
    for s in sets:
        weights[s.effects] = weights.get(s.effects, 0.0) + float(np.exp(least - s.cost))
    names = simplest(weights)
    first = min((s for s in sets if s.effects == names), key=lambda s: s.cost)
    return (first, *(s for s in sets if s is not first))


def simplest(weights: Mapping[tuple[str, ...], float]) -> tuple[str, ...]:
    """The set of the fewest events against which the odds of the most probable one are not strong.

    Of sets of as many events, it has the fewest effects that are half as probable as the best of them.

    Parameters
    ----------
    weights : names of each set -> its posterior weight; at least one set.
    """
    enough = AS_PROBABLE * max(weights.values())
    fewest = min(events(n) for n, w in weights.items() if w >= enough)
    among = {n: w for n, w in weights.items() if w >= enough and events(n) == fewest}
    likely = _AS_PROBABLE_IN_EVENT * max(among.values())
    return min((n for n, w in among.items() if w >= likely), key=lambda n: (len(n), -among[n]))


def events(effects: Sequence[str]) -> int:
    """Number of effects by their keys; those of one event come together."""
    own = [EFFECTS[key].event if key in EFFECTS else "" for key in effects]
    return own.count("") + len(set(own) - {""})


def least_cost(sets: Sequence[CauseSet]) -> float:
    """Cost of the most probable set."""
    return min(s.cost for s in sets)


def _mixed(scales: Sequence[_Evidence]) -> tuple[NDArray[np.int64], Array]:
    """Index of each set's best part, and the cost of its mixture: that of the best part where no declaration is wrong."""
    costs = np.stack([e.cost for e in scales])
    mean = np.logaddexp.reduce(-costs, axis=0) - np.log(len(scales))
    wrong = np.array([bool(subset) for subset in scales[0].subsets])
    return np.argmin(costs, axis=0), np.where(wrong, -mean, costs.min(axis=0))


def size_of(likelihood: DerivativeLikelihood, cause: Cause) -> tuple[float, float]:
    """Estimate of a cause's size, alone and without its prior, and its standard deviation.

    The declared derivatives keep their declared uncertainty, so that size over standard deviation is standard normal
    where they are right.
    """
    certain = replace(cause, prior=replace(cause.prior, shape=0.0, low=-np.inf, high=np.inf))
    only = _evidence(likelihood, (certain,), ((),), 1.0)
    return float(only.sizes[0, 0]), float(only.size_std[0, 0])


def predicted_cost(likelihood: DerivativeLikelihood, causes: Sequence[Cause]) -> float:
    """Negative log-posterior that a fit of these causes reaches, sizes without a prior, to first order in them."""
    turned = np.eye(len(likelihood.vector)) + likelihood.information @ likelihood.declared
    seen = np.linalg.solve(turned, likelihood.vector)
    directions = np.array([c.direction for c in causes])
    told = directions @ np.linalg.solve(turned, likelihood.information) @ directions.T
    along = directions @ seen
    gained = likelihood.vector @ likelihood.declared @ seen + along @ np.linalg.solve(told, along)
    return likelihood.cost - 0.5 * float(gained)


def _compared(
    likelihood: DerivativeLikelihood, chosen: Sequence[Cause], wrong_allowed: bool, so_far: float
) -> Iterator[_Compared]:
    """Evidence of some causes with sets of wrong declarations: every set of up to `_EVERY` derivatives.

    Of more derivatives, none, those of each coefficient and all; and from none on the sets that add one derivative to the best
    set so far, as long as the cost falls; none where the causes are negligible without.

    Parameters
    ----------
    so_far : least cost of the sets that were compared before.
    """
    count, motion = len(likelihood.vector), likelihood.motion

    def of(subsets: tuple[Subset, ...]) -> _Compared:
        scales = tuple(_evidence(likelihood, chosen, subsets, scale) for scale in WRONG_BY)
        return (scales, *_mixed(scales))

    if not wrong_allowed:
        yield of(((),))
        return
    if count <= _EVERY:
        yield of(tuple(s for n in range(count + 1) for s in combinations(range(count), n)))
        return
    rows = (tuple(range(*motion.row(c.name).indices(count))) for c in motion.coefficients)
    first: tuple[Subset, ...] = ((), *rows, tuple(range(count)))
    found = of(first)
    yield found
    if float(found[2].min()) > so_far + _NEGLIGIBLE:
        return
    best, least = first[0], float(found[2][0])
    while len(best) < count:
        grown = tuple(tuple(sorted((*best, i))) for i in range(count) if i not in best)
        grown = tuple(s for s in grown if s not in first)
        found = of(grown)
        yield found
        cost = found[2]
        if not float(cost.min()) < least:
            return
        least, best = float(cost.min()), grown[int(np.argmin(cost))]


@dataclass(frozen=True)
class _Evidence:
    """Physical causes with each set of wrong declarations; attributes as of `CauseSet`, one row per set."""

    causes: tuple[str, ...]
    subsets: tuple[Subset, ...]
    motion: Motion
    sizes: Array
    size_std: Array
    covariance: Array
    cost: Array

    def set_of(self, number: int, cost: float) -> CauseSet:
        """One of the sets, with the cost of its mixture."""
        return CauseSet(
            causes=self.causes,
            wrong=tuple(self.motion.parameters[k] for k in self.subsets[number]),
            sizes=tuple(self.sizes[number].tolist()),
            size_std=tuple(self.size_std[number].tolist()),
            covariance=self.covariance[number],
            cost=float(cost),
        )


_Compared = tuple[tuple[_Evidence, ...], NDArray[np.int64], Array]
"""Evidence for each of `WRONG_BY`, number of the best of these of each set, and the cost of their mixture."""


def _evidence(
    likelihood: DerivativeLikelihood,
    chosen: Sequence[Cause],
    subsets: tuple[Subset, ...],
    wrong_by: float,
) -> _Evidence:
    """One set of physical causes with each set of wrong declarations, see `WRONG_BY`."""
    information, vector, declared = likelihood.information, likelihood.vector, likelihood.declared
    size, unit = len(vector), np.eye(len(vector))
    own = np.repeat(declared[None], len(subsets), axis=0)
    for i, subset in enumerate(subsets):
        at = list(subset)
        own[i, at, at] += (wrong_by**2 - 1.0) * np.diag(declared)[at]
    directions = np.array([c.direction for c in chosen]).reshape(len(chosen), size)
    shape = np.array([c.prior.shape for c in chosen])
    sizes = np.tile([c.prior.std for c in chosen], (len(subsets), 1))
    given = np.column_stack([information, vector])
    for _ in range(2):  # the uncertainty of a direction goes with the size
        about = own + np.einsum("nk,k,ki->ni", sizes**2, shape**2, directions**2)[:, :, None] * unit
        both = np.linalg.solve(
            unit + information @ about, np.broadcast_to(given, (len(subsets), *given.shape))
        )
        told, seen = both[..., :size], both[..., size]
        size_information = np.einsum("ki,nij,lj->nkl", directions, told, directions)
        size_covariance = np.linalg.pinv(size_information, hermitian=True)
        sizes = np.einsum("nkl,li,ni->nk", size_covariance, directions, seen)
    std = np.sqrt(np.maximum(np.diagonal(size_covariance, axis1=1, axis2=2), 0.0))
    prior = np.einsum("k,ki,kj->ij", np.array([c.prior.std**2 for c in chosen]), directions, directions)
    covariance = about + prior
    turned = unit + covariance @ information
    gained = 0.5 * np.einsum(
        "i,ni->n", vector, np.linalg.solve(turned, (covariance @ vector)[..., None])[..., 0]
    )
    least = np.linalg.slogdet(unit + declared @ information)[1]
    occam = 0.5 * (np.linalg.slogdet(turned)[1] - least)
    in_range = _in_range(chosen, sizes, std)
    wrong = np.array([len(subset) for subset in subsets])
    odds = _log_odds(chosen) + np.where(wrong > 0, LOG_WRONG * (1 + wrong), 0.0)
    several = (wrong > 0) | bool(chosen)
    cost = likelihood.cost - gained + occam - in_range - odds - np.where(several, REFERENCE, 0.0)
    return _Evidence(tuple(c.key for c in chosen), subsets, likelihood.motion, sizes, std, covariance, cost)


def _log_odds(chosen: Sequence[Cause]) -> float:
    """Logarithm of the prior odds of physical causes."""
    total = sum(c.prior.log_odds for c in chosen if not c.event)
    for event in dict.fromkeys(c.event for c in chosen if c.event):
        together = [c.prior.log_odds for c in chosen if c.event == event]
        total += together[0] + LOG_SAME_EVENT * (len(together) - 1)
    return total


def _in_range(chosen: Sequence[Cause], sizes: Array, std: Array) -> Array:
    """(sets,) logarithm of the ratio of posterior to prior probability that every size lies in its plausible range.

    It turns the evidence of normal sizes into that of sizes limited to the range, the sizes taken as independent.

    Parameters
    ----------
    sizes, std : (sets, causes) estimates without the prior of the sizes.
    """
    total = np.zeros(len(sizes))
    for k, c in enumerate(chosen):
        weight = np.zeros(len(sizes))
        np.divide(1.0, std[:, k] ** 2, out=weight, where=std[:, k] > 0.0)
        prior = c.prior
        spread = 1.0 / np.sqrt(weight + prior.std**-2)
        middle = weight * sizes[:, k] * spread**2
        after = ndtr((prior.high - middle) / spread) - ndtr((prior.low - middle) / spread)
        before = ndtr(prior.high / prior.std) - ndtr(prior.low / prior.std)
        total += np.log(np.maximum(after, _LEAST_SHARE) / before)
    return total


__all__ = [
    "AS_PROBABLE",
    "LOG_SAME_EVENT",
    "LOG_WRONG",
    "MOST_CAUSES",
    "REFERENCE",
    "WRONG_BY",
    "CauseSet",
    "events",
    "explain",
    "least_cost",
    "simplest",
    "simplest_first",
]
