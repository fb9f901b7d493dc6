"""Evidence of every set of effects by one quadratic of the log-likelihood about a fit.

About a fit the negative log-likelihood is nearly quadratic in x, the increments of the derivatives and the sizes of all
effects, with every other parameter eliminated under its prior:

    f(x) = f_0 + g'x + x'H x / 2.

A set of effects is a prior of x. Sizes of other effects are zero. The derivatives have the declared covariance, wider where a
declaration is wrong. With the derivatives eliminated under this prior, the sizes s of a set have the log-evidence

    log Z = -f(s_m)/c + log det(2 pi c H_s^-1) / 2 + log p(s_m) + log odds,

where c is the long-run variance of the slopes of the likelihood over that of white innovations, and s_m the sizes of the largest
likelihood. A size without a stated prior is log-uniform between the smallest size that matters and the end of its range, so
that neither its unit nor its usual magnitude enters. What other records tell of a size, N(b, s), is a likelihood and multiplies
this density: it adds x^2/(2 s^2) - x b/s^2 to f.

Sources: D. J. C. MacKay, Neural Computation 4 (1992) 415-447 (evidence and its Occam factor); R. E. Kass and A. E. Raftery,
J. Am. Statist. Assoc. 90 (1995) 773-795, section 4.1 (Laplace's method); F. Pauli, W. Racugno and L. Ventura, Statist. Sinica 21
(2011) 149-164 (a likelihood divided by its ratio of variances).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr

from airtruth.tracing.criterion import CRITERION
from airtruth.tracing.inference.causes import DERIVATIVES
from airtruth.tracing.selection.columns import EffectColumn, SizePriors, size_priors

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_SINGULAR: Final = 1e-6
"""Least share of an information that remains beside the others of a set [-] (judgement: less is no other effect)."""
_NEGLIGIBLE: Final = 15.0
"""Log-evidence behind the best set of a size from which a set is left out [-] (judgement: a weight of 3e-7)."""
_EVERY: Final = 6
"""Number of derivatives of which every set of wrong declarations is compared [-] (judgement: 64 sets; of 15 there are 32768)."""
_WRONG_BESIDE: Final = 4
"""Number of sets of wrong declarations that are compared beside more than one effect [-] (judgement)."""


@dataclass(frozen=True)
class Declaration:
    """Which declarations of derivatives are wrong.

    Attributes
    ----------
    wrong : numbers of these derivatives.
    spread : (derivatives, derivatives) covariance of the increments beyond the declared one.
    log_odds : logarithm of the prior odds.
    """

    wrong: tuple[int, ...]
    spread: Array
    log_odds: float


@dataclass(frozen=True)
class Weighed:
    """A set of effects and its evidence.

    Attributes
    ----------
    columns, sizes : indices of its effects in the quadratic, and their estimates without the prior of the sizes.
    declaration : which declarations are wrong.
    log_evidence : with the prior odds [-].
    """

    columns: tuple[int, ...]
    sizes: Array
    declaration: Declaration
    log_evidence: float


@dataclass(frozen=True)
class Quadratic:
    """A negative log-likelihood as a quadratic of what is integrated under its prior, the derivatives first, and of sizes.

    Attributes
    ----------
    offset, slope, information : f_0, g (variables,) and H (variables, variables); the declared parameters come first.
    declared : (declared, declared) prior covariance of these, the derivatives first.
    derivatives : number of derivatives.
    columns : the effects, in the order of the sizes.
    temper : c of the module's formula [-].
    wrong_allowed : whether declarations of derivatives may be wrong.
    """

    offset: float
    slope: Array
    information: Array
    declared: Array
    derivatives: int
    columns: tuple[EffectColumn, ...]
    temper: float = 1.0
    wrong_allowed: bool = True

    @property
    def first(self) -> int:
        """Index of the first size."""
        return len(self.declared)

    @cached_property
    def _apart(self) -> NDArray[np.bool_]:
        return np.array([[a.may_join(b) for b in self.columns] for a in self.columns], dtype=np.bool_)

    @cached_property
    def _log_odds(self) -> Array:
        return np.array([c.log_odds for c in self.columns])

    @cached_property
    def _told(self) -> Array:
        return np.array([c.told for c in self.columns]).reshape(-1, 2).T

    @cached_property
    def _size_priors(self) -> SizePriors:
        return size_priors(self.columns)

    def given(self, spread: Array) -> tuple[Array, Array, Array]:
        """Log-evidence without any size, and slope and information of the sizes, the declared parameters eliminated.

        Parameters
        ----------
        spread : (..., derivatives, derivatives) covariance of the derivatives beyond the declared one.

        Returns
        -------
        (...,), (..., sizes) and (..., sizes, sizes).
        """
        k, g, h = self.first, self.slope / self.temper, self.information / self.temper
        turned, gain = self._gain(spread)
        across = h[k:, :k]
        precision, pull = self._told
        along = gain @ g[:k]
        own = -self.offset / self.temper + 0.5 * along @ g[:k] - 0.5 * np.linalg.slogdet(turned)[1]
        slope = g[k:] - along @ across.T - pull
        return np.asarray(own), slope, h[k:, k:] - across @ gain @ across.T + np.diag(precision)

    def most_probable(self, spread: Array, sizes: Array) -> Array:
        """(declared,) the most probable declared parameters at given sizes of all columns."""
        k = self.first
        slope = (self.slope[:k] + self.information[:k, k:] @ sizes) / self.temper
        return -self._gain(spread)[1] @ slope

    def _gain(self, spread: Array) -> tuple[Array, Array]:
        k, d = self.first, self.derivatives
        prior = np.broadcast_to(self.declared, (*spread.shape[:-2], k, k)).copy()
        prior[..., :d, :d] += spread
        turned = np.eye(k) + self.information[:k, :k] / self.temper @ prior
        return turned, prior @ np.linalg.inv(turned)

    def widening(self, column: int) -> Array:
        """Covariance that a column adds to the derivatives: the uncertain shape of a cause, or the freedom of a curvature."""
        c, spread = self.columns[column], np.zeros((self.derivatives, self.derivatives))
        if c.cause is not None and c.widens:
            prior = c.cause.prior
            _, slope, information = self.given(spread)
            size = -slope[column] / (information[column, column] + prior.std**-2)
            spread += np.diag((size * prior.shape * c.cause.direction) ** 2)
        for i in c.freed:
            spread[i, i] += (max(CRITERION.wrong_by) ** 2 - 1.0) * self.declared[i, i]
        return spread

    def sets(self, most: int) -> list[Weighed]:
        """Every set of up to ``most`` effects with its evidence, but for negligible ones; wrong declarations count as none."""
        special = [i for i, c in enumerate(self.columns) if c.widens]
        found: list[Weighed] = []
        for number in range(min(most, 2) + 1):
            for beside in itertools.combinations(special, number):
                found += self._sets(self._declaration(()), beside, most - number)
        alone = self._singly(self._wrong, min(most, 1))
        alone.sort(key=lambda pair: -max(w.log_evidence for w in pair[1]))
        for number, (declaration, own) in enumerate(alone):
            found += own
            if number < _WRONG_BESIDE and most > 1:
                found += [w for w in self._sets(declaration, (), 2) if len(w.columns) > 1]
                found += [w for i in special for w in self._sets(declaration, (i,), 1)]
        return found

    def grown(self, columns: Sequence[int]) -> list[Weighed]:
        """A set as the derivatives are declared, and the set with each further effect."""
        declaration, beside = self._declaration(()), tuple(columns)
        found = self._sets(declaration, beside, 1)
        for i, c in enumerate(self.columns):
            if c.widens and all(c.may_join(self.columns[k]) for k in beside):
                found += self._sets(declaration, (*beside, i), 0)
        return found

    def without(self, weighed: Weighed, column: int) -> Weighed:
        """A set without one of its effects."""
        columns = tuple(i for i in weighed.columns if i != column)
        spread = weighed.declaration.spread + self._widened(columns)
        alone, slope, information = self.given(spread)
        own = float(alone) + weighed.declaration.log_odds
        if not columns:
            return Weighed((), np.zeros(0), weighed.declaration, own)
        chosen = np.array([columns], dtype=np.int64)
        sizes, logs = self._laplace(slope[chosen], _of_pairs(information, chosen), chosen)
        total = own + float(logs[0] + self._odds(chosen)[0])
        return Weighed(columns, sizes[0], weighed.declaration, total)

    def _widened(self, columns: Sequence[int]) -> Array:
        """Covariance that the columns of a set add to the derivatives."""
        every = (self.widening(i) for i in columns if self.columns[i].widens)
        return np.asarray(sum(every, np.zeros((self.derivatives, self.derivatives))))

    def alone(self, weighed: Weighed) -> tuple[Array, Array]:
        """(number,) sizes of a set and their standard deviations, without any prior of the sizes."""
        _, slope, information = self.given(weighed.declaration.spread + self._widened(weighed.columns))
        rows = list(weighed.columns)
        covariance = np.linalg.pinv(information[np.ix_(rows, rows)], hermitian=True)
        return -covariance @ slope[rows], np.sqrt(np.maximum(np.diag(covariance), 0.0))

    def names(self, weighed: Weighed) -> tuple[str, ...]:
        """Names of a set, sorted; wrong declarations are one name."""
        names = {self.columns[i].label for i in weighed.columns}
        return tuple(sorted({*names, DERIVATIVES} if weighed.declaration.wrong else names))

    def in_filter(self, weighed: Weighed) -> frozenset[str]:
        """Keys of the effects of a set that the filter holds."""
        return frozenset(self.columns[i].key for i in weighed.columns if self.columns[i].effect is not None)

    @cached_property
    def _wrong(self) -> tuple[Declaration, ...]:
        """The wrong declarations that are compared, each by every factor of the mixture: every set of a few derivatives.

        Of many derivatives, they are all of them together, and the sets that add one to the best one as long as the evidence
        grows.
        """
        every = range(self.derivatives)
        if not self.wrong_allowed:
            return ()
        if self.derivatives <= _EVERY:
            subsets = (s for n in every for s in itertools.combinations(every, n + 1))
            return tuple(self._declaration(s, by) for s in subsets for by in CRITERION.wrong_by)
        found = [self._declaration(tuple(every), by) for by in CRITERION.wrong_by]
        wrong: tuple[int, ...] = ()
        least = -np.inf
        while len(wrong) < self.derivatives:
            grown = [
                self._declaration(tuple(sorted((*wrong, i))), by)
                for i in every
                if i not in wrong
                for by in CRITERION.wrong_by
            ]
            found += grown
            logs = self.given(np.array([d.spread for d in grown]))[0] + [d.log_odds for d in grown]
            best = int(np.argmax(logs))
            if not logs[best] > least:
                break
            least, wrong = logs[best], grown[best].wrong
        return tuple(found)

    def _declaration(self, wrong: tuple[int, ...], by: float = 1.0) -> Declaration:
        """A set of wrong declarations by a factor of their standard deviations; the declaration as it is for none."""
        spread = np.zeros((self.derivatives, self.derivatives))
        if not wrong:
            return Declaration((), spread, 0.0)
        at = list(wrong)
        spread[at, at] = (by**2 - 1.0) * np.diag(self.declared)[at]
        every = np.log(
            len(CRITERION.wrong_by) * ((1.0 + np.exp(CRITERION.log_same_event)) ** self.derivatives - 1.0)
        )
        further = CRITERION.log_same_event * len(wrong)
        return Declaration(wrong, spread, CRITERION.log_wrong + further - float(every))

    def _singly(
        self, declarations: Sequence[Declaration], most: int
    ) -> list[tuple[Declaration, list[Weighed]]]:
        """Each declaration with its sets of up to one column that does not widen the derivatives."""
        if not declarations:
            return []
        own, slope, information = self.given(np.array([d.spread for d in declarations]))
        own = own + [d.log_odds for d in declarations]
        pool = np.array([i for i, c in enumerate(self.columns) if not c.widens], dtype=np.int64)
        chosen = np.tile(pool if most else pool[:0], len(own))[:, None]
        pool = chosen[: len(chosen) // len(own), 0]
        pushes, variances = slope[:, pool].reshape(-1, 1), information[:, pool, pool].reshape(-1, 1, 1)
        sizes, logs = self._laplace(pushes, variances, chosen)
        total = own[:, None] + (logs + self._odds(chosen)).reshape(len(own), -1)
        kept = total > total.max(axis=1, initial=-np.inf)[:, None] - _NEGLIGIBLE
        found = []
        for k, declaration in enumerate(declarations):
            every = [Weighed((), np.zeros(0), declaration, float(own[k]))]
            for i in np.flatnonzero(kept[k]):
                size = sizes[k * len(pool) + i]
                every.append(Weighed((int(pool[i]),), size, declaration, float(total[k, i])))
            found.append((declaration, every))
        return found

    def _sets(self, declaration: Declaration, beside: tuple[int, ...], most: int) -> list[Weighed]:
        """Sets of columns that do not widen the derivatives, in addition to ``beside``."""
        spread = declaration.spread + self._widened(beside)
        alone, slope, information = self.given(spread)
        own = float(alone) + declaration.log_odds
        found: list[Weighed] = []
        if not beside:
            found.append(Weighed((), np.zeros(0), declaration, own))
        pool = [i for i, c in enumerate(self.columns) if not c.widens]
        for number in range(0 if beside else 1, most + 1):
            rows = [(*beside, *c) for c in itertools.combinations(pool, number)]
            if not rows:
                break
            chosen = np.array(rows, dtype=np.int64).reshape(len(rows), len(beside) + number)
            for a, b in itertools.combinations(range(chosen.shape[1]), 2):
                chosen = chosen[self._apart[chosen[:, a], chosen[:, b]]]
            sizes, logs = self._laplace(slope[chosen], _of_pairs(information, chosen), chosen)
            total = own + logs + self._odds(chosen)
            for i in np.flatnonzero(total > total.max(initial=-np.inf) - _NEGLIGIBLE):
                columns = tuple(chosen[i].tolist())
                found.append(Weighed(columns, sizes[i], declaration, float(total[i])))
        return found

    def _odds(self, chosen: Ints) -> Array:
        """(sets,) log prior odds; further causes of one event have those of an event that has happened."""
        total = self._log_odds[chosen].sum(axis=1)
        of_event = np.array([c.event != "" for c in self.columns])
        for row in np.flatnonzero(of_event[chosen].sum(axis=1) > 1):
            together = self._log_odds[[i for i in chosen[row] if of_event[i]]]
            total[row] += together.max() - together.sum() + CRITERION.log_same_event * (len(together) - 1)
        return np.asarray(total)

    def _laplace(self, slope: Array, own: Array, chosen: Ints) -> tuple[Array, Array]:
        """(sets, number) sizes and (sets,) log-evidence of these; NaN and minus infinity where they are nearly dependent.

        Parameters
        ----------
        slope, own : (sets, number), (sets, number, number) slope and information of the sizes of the sets.
        """
        number, own = chosen.shape[1], own.copy()
        sizes, logs = np.full(chosen.shape, np.nan), np.full(len(chosen), -np.inf)
        variance = np.diagonal(own, axis1=1, axis2=2)
        scale = np.sqrt(np.where(variance > 0.0, variance, np.inf))
        sound = np.linalg.det(own / (scale[:, :, None] * scale[:, None, :])) > _SINGULAR
        if not sound.any():
            return sizes, logs
        normal = np.array([0.0 if c.prior is None else c.prior.std**-2.0 for c in self.columns])
        own[:, range(number), range(number)] += normal[chosen]
        inverse = np.linalg.inv(own[sound])
        x = -np.einsum("nij,nj->ni", inverse, slope[sound])
        std = np.sqrt(np.diagonal(inverse, axis1=1, axis2=2))
        gain = -0.5 * (slope[sound] * x).sum(axis=1)
        occam = 0.5 * np.linalg.slogdet(inverse)[1] + 0.5 * number * np.log(2.0 * np.pi)
        sizes[sound] = x
        logs[sound] = gain + occam + self._log_prior(x, std, chosen[sound])
        return sizes, logs

    def _log_prior(self, x: Array, std: Array, chosen: Ints) -> Array:
        """(sets,) log-density of the sizes, with the share of their probability that lies within the range."""
        constant, falls, low, high, least, sign = (values[chosen] for values in self._size_priors)
        density = constant - falls * np.log(np.maximum(np.abs(x), np.where(falls > 0.0, least, 1.0)))
        beyond = np.where(sign == 0.0, np.abs(x), sign * x) - least
        inside = np.where(falls > 0.0, log_ndtr(beyond / std), 0.0)
        inside += log_ndtr((high - x) / std) + log_ndtr((x - low) / std)
        return np.asarray((density + inside).sum(axis=1))


def _of_pairs(information: Array, chosen: Ints) -> Array:
    """(sets, number, number) information of the columns of each set."""
    return information[chosen[:, :, None], chosen[:, None, :]]


__all__ = ["Declaration", "Quadratic", "Weighed"]
