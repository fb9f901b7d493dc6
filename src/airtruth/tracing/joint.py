"""Causes of both motions: one size from the records of both.

Mass, centre of gravity and errors of the airspeed act in the pitch plane and in the lateral motion. The innovations of the two
motions are independent, so that their log-likelihoods of a size add. Each motion tells the size a normal likelihood, mean b and
variance s^2 with every other parameter eliminated. In the other motion it is a normal prior of the size, and the cost of the
cause there is, beside a constant,

    J(x) + (x - b)^2/(2 s^2) - b^2/(2 s^2)

with J the cost of that motion alone: what the cause gains in both. Two sizes a and b agree if (a - b)^2/(s_a^2 + s_b^2) is
chi-square with one degree of freedom.

Source: A. Gelman et al., Bayesian Data Analysis, 3rd ed., 2013, sections 2.5 and 4.1 (normal likelihoods combine by precision).
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc

from airtruth.effects.effect import Effect
from airtruth.tracing.anomalies.significance import significant_gain
from airtruth.tracing.criterion import CRITERION
from airtruth.tracing.inference.robust import robust_covariance
from airtruth.tracing.searched import Searched


@dataclass(frozen=True)
class Told:
    """Likelihood of the size of a cause by the records of one motion, its prior taken out.

    Attributes
    ----------
    size, std : mean and standard deviation of the likelihood in the size coordinate of the cause.
    """

    size: float
    std: float


def combined(told: Collection[Told]) -> Told:
    """Likelihood of a size by independent records together.

    Examples
    --------
    >>> combined([Told(1.0, 0.3), Told(2.0, 0.4)])
    Told(size=1.36, std=0.24)
    """
    precision = sum(t.std**-2.0 for t in told)
    return Told(sum(t.size * t.std**-2.0 for t in told) / precision, precision**-0.5)


@dataclass(frozen=True)
class SharedCause:
    """A cause of both motions.

    Attributes
    ----------
    effect : of the library, with the size of the first motion in its coordinate.
    alone : name of the motion -> what its records tell.
    statistic, p_value : chi-square of one degree, and probability of sizes as far apart [-].
    refused : whether the two sizes contradict each other, at the level of the declared model: the motions have no common one.
    """

    effect: Effect
    alone: dict[str, Told]
    statistic: float
    p_value: float
    refused: bool


def jointly(searches: Sequence[Searched]) -> tuple[tuple[Searched, ...], tuple[SharedCause, ...]]:
    """The searches of two motions with one size of each cause that acts in both.

    A cause that either search names is a cause of both, and one that is significant by the records of both together. Where the
    sizes agree, each motion is fitted again with the other's likelihood as a prior, and a search that had not named the cause
    begins with it. Where they do not, the search that named it is made again with that prior, so that another cause of its motion
    may explain the records of both; if it names the cause all the same, the motions keep their sizes.

    Parameters
    ----------
    searches : finished searches, one for each motion.

    Returns
    -------
    The searches in their order, and the causes of both.
    """
    if len(searches) != 2:
        return tuple(searches), ()
    found: list[SharedCause] = []
    own = (searches[0], searches[1])
    for key in _in_both(own):
        own, cause = _with_one_size(own, key)
        found += [] if cause is None else [cause]
    return own, tuple(found)


def _in_both(own: tuple[Searched, Searched]) -> list[str]:
    """Keys of the causes that act in both motions, those that a search names first, then the most significant one."""
    both = {e.key for e in own[0].case.effects} & {e.key for e in own[1].case.effects}
    keys = [e.key for e in own[0].case.effects if e.key in both and len(e.parameters) == 1]

    def rank(key: str) -> tuple[bool, float]:
        told = [t for t in (told_by(s, key) for s in own) if t is not None]
        return not any(_names(s, key) for s in own), -_errors(told) if told else 0.0

    return sorted(keys, key=rank)


def _errors(told: Collection[Told]) -> float:
    """Size by all motions over its standard deviation [-]."""
    both = combined(told)
    return abs(both.size) / both.std


def _with_one_size(
    own: tuple[Searched, Searched], key: str
) -> tuple[tuple[Searched, Searched], SharedCause | None]:
    """The searches with one size of a cause; None where no motion names it in the end."""
    names = [s.case.fitted.layout.motion.name for s in own]
    told = [told_by(s, key) for s in own]
    if told[0] is None or told[1] is None:
        return own, None
    first, second = told[0], told[1]
    statistic = (first.size - second.size) ** 2 / (first.std**2 + second.std**2)
    p_value = float(chdtrc(1, statistic))
    others = (_with_prior(own[0], key, second), _with_prior(own[1], key, first))
    cause = SharedCause(
        effect=next(e for e in own[0].case.effects if e.key == key),
        alone=dict(zip(names, (first, second), strict=True)),
        statistic=statistic,
        p_value=p_value,
        refused=p_value < CRITERION.declared,
    )
    if not any(_names(s, key) for s in own):
        least = significant_gain(max(len(s.case.effects) for s in own))
        if cause.refused or _errors((first, second)) ** 2 < least:
            return own, None
    if cause.refused:
        again = tuple(s.repeated({key: e}) if _names(s, key) else s for s, e in zip(own, others, strict=True))
        pair = (again[0], again[1])
        return (own, cause) if any(_names(s, key) for s in pair) else (pair, None)
    fitted = tuple(
        s.refitted({key: e}) if _names(s, key) else s.repeated({key: e}, (key,))
        for s, e in zip(own, others, strict=True)
    )
    pair = (fitted[0], fitted[1])
    return (pair, cause) if all(_names(s, key) for s in pair) else (own, None)


def _names(search: Searched, key: str) -> bool:
    return key in {e.key for e in search.rounds[-1].null.hypothesis.effects}


def told_by(search: Searched, key: str) -> Told | None:
    """Likelihood of a cause by one motion, beside the other effects that it names; None where no fit has it."""
    last = search.rounds[-1].null
    effect = next(e for e in search.case.effects if e.key == key)
    fitted = last
    if not _names(search, key):
        start = replace(last.point, sizes=np.append(last.point.sizes, 0.0))
        beside = search.sets.converged(last.hypothesis.plus(effect), start, near=last)
        if beside is None:
            return None
        fitted = beside
    at = fitted.hypothesis.span(key).start
    number = fitted.layout.size(at)
    variance = float(robust_covariance(search.case.fitted, fitted)[number, number])
    size, prior = float(fitted.point.sizes[at]), fitted.hypothesis.parameter(at)
    precision = 1.0 / variance - prior.prior_std**-2.0
    if not precision > 0.0:
        return None
    return Told((size / variance - prior.prior_mean * prior.prior_std**-2.0) / precision, precision**-0.5)


def _with_prior(search: Searched, key: str, told: Told) -> Effect:
    """The candidate of a motion with what another motion tells as a prior of its size."""
    effect = next(e for e in search.case.effects if e.key == key)
    first, *others = effect.parameters
    before, more = first.prior_std**-2.0, told.std**-2.0
    mean = (first.prior_mean * before + told.size * more) / (before + more)
    prior = replace(first, prior_mean=mean, prior_std=(before + more) ** -0.5)
    return replace(effect, parameters=(prior, *others))


def sentences(causes: Sequence[SharedCause]) -> Iterator[str]:
    """Each cause of both motions in words, without a final period."""
    for cause in causes:
        p = cause.effect.parameters[0]
        alone = ", ".join(
            f"{p.value(t.size):.4g} +- {t.std:.2g} by the {motion} records"
            for motion, t in cause.alone.items()
        )
        if cause.refused:
            yield (
                f"{cause.effect.key} acts in both motions, and their records contradict each other on its {p.name} ({alone}; p = "
                f"{cause.p_value:.2g}): each motion keeps its own, and the name is provisional"
            )
        else:
            yield (
                f"{cause.effect.key} is one cause of both motions, and its {p.name} is that by the records of both ({alone}; p = "
                f"{cause.p_value:.2g} that they agree)"
            )


__all__ = ["SharedCause", "Told", "combined", "jointly", "sentences", "told_by"]
