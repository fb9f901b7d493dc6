"""Log-posterior of derivatives, levels, biases, initial states and sizes over several records.

Fisher information; the parameters of each record are eliminated record by
record.

Source: R. E. Maine and K. W. Iliff, NASA RP-1138 (1985), sections 5 and 6.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Final, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from airtruth.physics.terms import DECLARED
from airtruth.tracing.inference.hypothesis import Hypothesis
from airtruth.tracing.inference.kinematic_likelihood import KinematicLikelihood
from airtruth.tracing.inference.sensitivities import InnovationDerivatives, Sensitivities
from airtruth.tracing.inference.whitening import Whitener
from airtruth.tracing.model.parameters import Layout, ParameterLayout, Parameters
from airtruth.tracing.model.records import TraceRecord
from airtruth.tracing.model.response import FilterInputs, filter_inputs, respond, respond_to
from airtruth.tracing.model.response_slopes import NO_SLOPES, respond_with_slopes
from airtruth.tracing.model.settings import (
    Settings,
    common_prior,
    declared_covariance_of,
    declared_derivatives_of,
    free_common,
    per_record_prior,
)

Array = NDArray[np.float64]
T = TypeVar("T")
R = TypeVar("R")

_LOCATION_STEP: Final = 0.02
"""Step of the differences in a size over `airtruth.effects.effect.Parameter.step`, where the effect is present or the
parameter is a location [-]; judgement: as of `Entry`."""


class LikelihoodTerms(NamedTuple):
    """Negative log-likelihood of one record, its gradient (parameters,) and Fisher information."""

    cost: float
    gradient: Array
    information: Array


@dataclass(frozen=True)
class KinematicPrior:
    """The likelihood of the kinematics for the effects of a hypothesis.

    Attributes
    ----------
    likelihood : of the fitted records; hypothesis : whose effects it tells of.
    """

    likelihood: KinematicLikelihood
    hypothesis: Hypothesis

    def terms(self, sizes: Array) -> LikelihoodTerms:
        """Value, gradient (sizes,) and information (sizes, sizes), as many times as a fit counts them."""
        effects, weight = self.hypothesis.effects, self.likelihood.weight
        rows = [self.hypothesis.span(e.key).start for e in effects]
        value, slope, information = self.likelihood.terms(effects, sizes[rows])
        gradient, total = np.zeros(len(sizes)), np.zeros((len(sizes), len(sizes)))
        gradient[rows], total[np.ix_(rows, rows)] = weight * slope, weight * information
        return LikelihoodTerms(weight * value, gradient, total)


class Priors(NamedTuple):
    """Normal priors of a hypothesis.

    Attributes
    ----------
    common : (common, common) precision of the common parameters about zero.
    sizes, pull : (sizes,) precision of each size, and precision times mean.
    per_record : mean (per-record,) and precision (per-record, per-record) of each record.
    kinematics : what the kinematics tells of the sizes; None for nothing.
    """

    common: Array
    sizes: Array
    pull: Array
    per_record: tuple[tuple[Array, Array], ...]
    kinematics: KinematicPrior | None = None


@dataclass(frozen=True)
class TraceProblem:
    """Records, what is declared of their sensors, how many threads work on them, and what their kinematics tells."""

    records: tuple[TraceRecord, ...]
    settings: Settings
    threads: int = 1
    kinematics: KinematicLikelihood | None = None

    def priors(self, hypothesis: Hypothesis) -> Priors:
        """Priors of a hypothesis; each record's own is that of its flight condition."""
        free = hypothesis.unconstrained
        own = tuple(per_record_prior(r, self.settings, free) for r in self.records)
        common = common_prior(self.records, self.settings, free, hypothesis.spread)
        told = self.kinematics
        is_shown = told is not None and told.weight > 0.0 and told.shows([e.key for e in hypothesis.effects])
        kinematics = KinematicPrior(told, hypothesis) if told is not None and is_shown else None
        return Priors(common, hypothesis.size_precision, hypothesis.size_pull, own, kinematics)

    @property
    def layout(self) -> ParameterLayout:
        """Free parameters of the motion."""
        return self.settings.layout

    @property
    def declared_derivatives(self) -> Array:
        """(derivatives,) declared, averaged over the records' flight conditions [-]."""
        return declared_derivatives_of(self.records)

    @property
    def declared_covariance(self) -> Array:
        """(derivatives, derivatives) covariance of the increments of the derivatives, averaged likewise [-]."""
        return declared_covariance_of(self.records)

    @property
    def alpha_shift_rad(self) -> float:
        """Mean angle of attack from which the filter counts alpha; zero but for the linear model [rad]."""
        return float(np.mean([r.plant.alpha_shift_rad for r in self.records]))

    def each(self, function: Callable[[T], R], arguments: Sequence[T]) -> list[R]:
        """Apply a function to each argument, in order."""
        if self.threads <= 1 or len(arguments) <= 1:
            return [function(a) for a in arguments]
        with ThreadPoolExecutor(self.threads) as pool:
            return list(pool.map(function, arguments))


@dataclass(frozen=True)
class PosteriorFit:
    """Where the posterior is largest.

    Attributes
    ----------
    hypothesis, point : what was fitted and where it ended.
    cost : negative log-posterior without constants; it compares hypotheses with the same unconstrained derivatives and
        trim coefficients.
    likelihood : (records,) negative log-likelihood of each record.
    sensitivities : of each record at ``point``.
    whitener : of the innovations.
    covariance : (common and sizes, common and sizes), per-record parameters free.
    converged : whether the search ended by its tolerance.
    shortfall : log-likelihood that an undamped step promises where it did not, else none.
    """

    hypothesis: Hypothesis
    point: Parameters
    cost: float
    likelihood: Array
    sensitivities: tuple[Sensitivities, ...]
    whitener: Whitener
    covariance: Array
    converged: bool
    shortfall: float = 0.0

    @property
    def layout(self) -> Layout:
        """Where its parameters are."""
        return self.point.layout

    @property
    def innovations(self) -> list[Array]:
        """(samples, outputs) whitened innovations of each record."""
        return [s.r for s in self.sensitivities]

    @property
    def common_std(self) -> Array:
        """(common,) standard deviations of the common parameters."""
        return np.asarray(np.sqrt(np.diag(self.covariance)[self.layout.common]))

    def size_std(self, number: int) -> float:
        """Standard deviation of a size."""
        i = self.layout.size(number)
        return float(np.sqrt(max(self.covariance[i, i], 0.0)))


def sensitivities_of(
    problem: TraceProblem,
    index: int,
    hypothesis: Hypothesis,
    point: Parameters,
    *,
    per_record_only: bool = False,
    with_levels: bool = True,
    old: Sensitivities | None = None,
) -> Sensitivities | None:
    """Innovations of one record and their derivatives; None where the motion is lost.

    Derivatives in sizes, and in parameters that `respond_with_slopes` passes over, are one-sided differences.

    Parameters
    ----------
    index : number of the record.
    per_record_only : differentiate in the record's own parameters alone.
    with_levels : differentiate in the levels of noise and gusts; else their derivatives are zero.
    old : derivatives at a nearby point, which are whitened again and kept; those in a size that are NaN are made.
    """
    record, settings = problem.records[index], problem.settings
    common, own, sizes = point.common, point.per_record[index], point.sizes
    given = filter_inputs(record, hypothesis.compiled(sizes))
    layout, entries = point.layout, settings.layout
    wanted = [] if old is not None else _free(given, settings, per_record_only, with_levels)
    base, slopes = (
        respond_with_slopes(given, settings, common, own, np.array(wanted, dtype=np.int64))
        if wanted
        else (respond_to(given, settings, common, own), NO_SLOPES)
    )
    if slopes is None or not np.isfinite(base.logdet):
        return None
    differences = InnovationDerivatives(base, layout.total)

    def put_size(k: int) -> None:
        p = hypothesis.parameter(k)
        h = _LOCATION_STEP * p.step if p.is_location or abs(sizes[k]) > p.step else p.step
        change = hypothesis.compiled(_moved(sizes, k, h))
        differences.put(layout.size(k), respond(record, settings, change, common, own), h)

    if old is not None:
        differences.take(old)
        for k in range(len(sizes)):
            if np.isnan(old.t[layout.size(k), 0, 0]):
                put_size(k)
        return differences.sensitivities if np.isfinite(differences.t).all() else None
    step = np.append(entries.common.step, entries.per_record.step)
    # behind the common parameters are the sizes
    place = np.append(
        np.arange(entries.common.size), layout.per_record.start + np.arange(entries.per_record.size)
    )
    differences.put_slopes(place[slopes.parameters], slopes, step[slopes.parameters])
    for i in {*wanted} - {*slopes.parameters.tolist()}:
        point_of = _moved(np.append(common, own), i, step[i])
        moved = respond_to(given, settings, point_of[: common.size], point_of[common.size :])
        differences.put(int(place[i]), moved, float(step[i]))
    if not per_record_only:
        for k in range(len(sizes)):
            put_size(k)
    if not (np.isfinite(differences.t).all() and np.isfinite(differences.w).all()):
        return None
    return differences.sensitivities


def _free(given: FilterInputs, settings: Settings, per_record_only: bool, with_levels: bool) -> list[int]:
    """Parameters that move the innovations, as indices in a vector of the common parameters and those of the record."""
    common, own = settings.layout.common, settings.layout.per_record
    level = common.size + own.log_gust
    free = [] if per_record_only else list(free_common(settings))
    held = set() if with_levels else {*common.noise.tolist(), level}
    if given.compiled.declared["cg"] == DECLARED["cg"]:
        held.add(common.mounting)
    return [i for i in (*free, *range(common.size, common.size + own.size)) if i not in held]


def _moved(x: Array, index: int, step: float) -> Array:
    moved = x.copy()
    moved[index] += step
    return moved


def likelihood_terms(sensitivities: Sensitivities, whitener: Whitener, levels: bool) -> LikelihoodTerms:
    """Negative log-likelihood, gradient and information (parameters,) of one record.

    Parameters
    ----------
    levels : whether noise and gust levels count; an autoregression is made at fixed levels.
    """
    r, t = whitener.apply(sensitivities.r), whitener.apply(sensitivities.t)
    w, samples = sensitivities.w, r.shape[0]
    flat = t.reshape(t.shape[0], -1)
    gradient = flat @ r.ravel()
    information = flat @ flat.T
    if levels:
        moment = sensitivities.r.T @ sensitivities.r
        gradient = gradient + 0.5 * (
            samples * np.trace(w, axis1=1, axis2=2) - np.einsum("pij,ij->p", w, moment) + sensitivities.more
        )
        information = information + 0.5 * samples * np.einsum("pij,qij->pq", w, w)
    cost = 0.5 * samples * sensitivities.logdet + 0.5 * float(r.ravel() @ r.ravel())
    return LikelihoodTerms(cost, gradient, information)


def prior_cost(priors: Priors, point: Parameters) -> float:
    """Negative logarithm of the prior density, without constants; that of a size is zero where its effect is absent."""
    total = 0.5 * float(point.common @ priors.common @ point.common + priors.sizes @ point.sizes**2)
    total -= float(priors.pull @ point.sizes)
    if priors.kinematics is not None:
        total += priors.kinematics.terms(point.sizes).cost
    for (mean, precision), own in zip(priors.per_record, point.per_record, strict=True):
        off = own - mean
        total += 0.5 * float(off @ precision @ off)
    return total


class Eliminated(NamedTuple):
    """Matrices that recover a record's own step from the step of the common parameters and sizes.

    Attributes
    ----------
    information : (per-record, per-record) with prior and damping.
    solved : (per-record, 1 + marginal) its inverse times the gradient, and times the mixed information.
    """

    information: Array
    solved: Array


class Marginal(NamedTuple):
    """Gradient and information of common parameters and sizes, per-record parameters eliminated, priors included."""

    gradient: Array
    information: Array
    eliminated: tuple[Eliminated, ...]


def marginal_information(
    priors: Priors,
    point: Parameters,
    terms: Sequence[LikelihoodTerms],
    *,
    levels: bool,
    damping: float = 0.0,
    fixed: Sequence[int] = (),
) -> Marginal:
    """Eliminate the parameters of each record.

    Parameters
    ----------
    point : where; further directions in ``terms`` behind its sizes are at zero.
    levels : whether noise and gust levels are free.
    damping : on the per-record parameters [-].
    fixed : indices among common parameters and sizes that do not move.
    """
    of = point.of
    layout = Layout(of, len(terms[0].gradient) - of.common.size - of.per_record.size)
    common, marginal, own = layout.common, layout.marginal, layout.per_record
    gradient, information = np.zeros(marginal.stop), np.zeros((marginal.stop, marginal.stop))
    information[common, common] = priors.common
    gradient[common] = priors.common @ point.common
    sizes = np.arange(len(priors.sizes)) + common.stop
    information[sizes, sizes] = priors.sizes
    gradient[sizes] = priors.sizes * point.sizes - priors.pull
    if priors.kinematics is not None:
        told = priors.kinematics.terms(point.sizes)
        gradient[sizes] += told.gradient
        information[np.ix_(sizes, sizes)] += told.information
    eliminated = []
    level = of.per_record.log_gust
    for (mean, precision), values, (_, g, h) in zip(priors.per_record, point.per_record, terms, strict=True):
        h_own = h[own, own] + precision
        g_own = g[own] + precision @ (values - mean)
        h_mixed = h[marginal, own].copy()
        if not levels:
            h_own[level], h_own[:, level], h_own[level, level] = 0.0, 0.0, 1.0
            g_own[level] = 0.0
            h_mixed[:, level] = 0.0
        else:
            # where the record puts the level at none, the observed information: J'' = 4 s^2 J_ss + 2 J' in log s
            h_own[level, level] += 2.0 * max(g[own][level], 0.0)
        h_own[np.diag_indices(of.per_record.size)] *= 1.0 + damping
        solved = np.linalg.solve(h_own, np.column_stack([g_own, h_mixed.T]))
        gradient += g[marginal] - h_mixed @ solved[:, 0]
        information += h[marginal, marginal] - h_mixed @ solved[:, 1:]
        eliminated.append(Eliminated(h_own, solved))
    for i in (*(() if levels else of.common.noise), *fixed):
        information[i], information[:, i] = 0.0, 0.0
        information[i, i] = 1.0
        gradient[i] = 0.0
    return Marginal(gradient, information, tuple(eliminated))


__all__ = [
    "Eliminated",
    "LikelihoodTerms",
    "Marginal",
    "PosteriorFit",
    "Priors",
    "Sensitivities",
    "TraceProblem",
    "likelihood_terms",
    "marginal_information",
    "prior_cost",
    "sensitivities_of",
]
