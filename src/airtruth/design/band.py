"""The band of learned increments after a flight to come, averaged over what is not yet known.

A flight determines the bends of an increment with the information that remains once derivatives, trim, biases, initial
state, air and times of the increment are refitted. Its band and that of the trace are combined at each point by their
inverse variances. Both estimates as vectors give no wider band, so that the result is an upper bound for an increment
without a slope at the trim. The derivatives and the bends have next to no prior in the flight to come, because the band
of the trace has used it. A slope in the cell of the trim is held: it adds to a derivative, and the flight determines
their sum. A function of many cells is planned for with the fewest over its range.

Source: V. V. Fedorov, Theory of Optimal Experiments (1972), section 2.3 (the mean variance of a response over a range).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.design.bench import Bench, Flown
from airtruth.design.flight import fitted_of, model_of
from airtruth.design.narrow_result import ForecastQuantity
from airtruth.design.separation import FilterSetting, beyond, flown_by, refitted
from airtruth.effects.increment import Increment, Memory, Shape, increment
from airtruth.effects.increment_shape import signal_over
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.terms import Change
from airtruth.simulation.campaign.file import Campaign
from airtruth.tracing.accepted import IncrementTable
from airtruth.tracing.answer import Z95, AcceptedEffect
from airtruth.tracing.inference.hypothesis import Hypothesis
from airtruth.tracing.inference.posterior import TraceProblem, sensitivities_of
from airtruth.tracing.learning.increments import CELLS
from airtruth.tracing.model.parameters import SHORT_PERIOD, Parameters
from airtruth.tracing.model.plant import Plant
from airtruth.tracing.model.records import TraceRecord

Array = NDArray[np.float64]

DRAWS: Final = 6
"""Draws of the derivatives and of the size behind a stated band [-] (judgement, as for a separation)."""
_FIRST: Final = 2
"""Draws during the search [-] (judgement: a draw and its opposite)."""
COEFFICIENTS: Final = tuple(c.name for c in LONGITUDINAL.coefficients)
"""Coefficients whose increments are planned for."""
_SPREAD: Final = 0.3
"""Relative standard deviation of the size of an increment in the draws [-] (judgement, as of an effect)."""
_MOST: Final = 1.5
"""Largest draw of it, in standard deviations [-] (judgement: no increment changes its sign)."""
_FREE: Final = tuple(range(len(LONGITUDINAL.parameters)))
"""Derivatives that the declaration does not constrain."""


@dataclass(frozen=True)
class Learned:
    """A learned increment as a trace states it.

    Attributes
    ----------
    effect : the increment, its bends nearly without a prior.
    sizes : (parameters,) its bends or its share, and its times.
    at : (points,) of the signal where its band counts, outside the cell of the trim; empty for a linear one, whose share
        counts.
    value, known : (points,) or (1,) increment of the coefficient, or the share, and its standard deviation [-].
    """

    effect: Increment
    sizes: Array
    at: Array
    value: Array
    known: Array

    @property
    def basis(self) -> Array:
        """(points, bends) of the band, or (1, 1) of the share."""
        return self.effect.shape.basis(self.at) if self.at.size else np.eye(1)


def learned(accepted: AcceptedEffect, plant: Plant) -> Learned:
    """Read a learned increment from the answer of a trace.

    Parameters
    ----------
    accepted : the effect, with its table where it is a function.
    plant : trim of the flight to come, about which a linear increment counts.
    """
    acts_on = accepted.acts_on or ""
    signal = signal_over(acts_on, accepted.over or "")
    factor = signal_over(acts_on, accepted.by) if accepted.by else ""
    memory = next((Memory(s.kind, s.time_s, s.damping, s.half_width) for s in accepted.states), None)
    table = accepted.table
    at = np.zeros(1) if table is None else _points(table)
    shape = Shape(
        acts_on=acts_on if acts_on in COEFFICIENTS else COEFFICIENTS[0],
        signal=signal,
        low=float(at[0]),
        high=float(at[-1]),
        cells=len(at) - 1,
        trim=plant.trims.get(signal, 0.0) if table is None else table.origin,
        memory=memory,
        factor=factor,
        factor_trim=accepted.by_at,
    )
    effect = increment(shape)
    effect = effect.with_prior(effect.parameters[0].high).with_slope_held()
    others = effect.parameters[len(shape.coefficients) :]
    values = dict(shape.estimated_memory) | {name: own.value for name, own in accepted.parameters.items()}
    sizes = np.array([p.size(values[p.name]) for p in others])
    if table is None:
        share = accepted.parameters[effect.parameters[0].name]
        return Learned(effect, sizes, np.zeros(0), np.array([share.value]), np.array([share.std]))
    value, low, high = (np.interp(at, table.at, x) for x in (table.value, table.low, table.high))
    known = (high - low) / (2.0 * Z95)
    basis = shape.basis(at)
    counts = (known > 0.0) & (basis[:, : len(shape.knots)] != 0.0).any(axis=1)
    sizes = np.concatenate([np.linalg.lstsq(basis, value, rcond=None)[0], sizes])
    return Learned(effect, sizes, at[counts], value[counts], known[counts])


def _points(table: IncrementTable) -> Array:
    """Ends of the cells that a flight is planned for: those of the table, or of the coarsest one over its range.

    Finer cells locate a break. Without the prior of the trace a flight would determine none of them.
    """
    return np.linspace(table.at[0], table.at[-1], min(len(table.at) - 1, CELLS) + 1)


@dataclass(frozen=True)
class BandQuestion:
    """Learned increments whose bands a flight has to narrow.

    Attributes
    ----------
    accepted : the increments as a trace states them.
    """

    accepted: tuple[AcceptedEffect, ...]

    @property
    def title(self) -> str:
        """The purpose of the input."""
        return "the input that narrows the band of " + " and of ".join(e.variant for e in self.accepted)

    def at(self, bench: Bench, campaign: Campaign, records: int, seed: int) -> IncrementBand:
        """Their bands at a flight condition.

        Parameters
        ----------
        bench : of the condition.
        campaign : gusts and sensors.
        records : equal records, of which a trace holds out every third.
        seed : seed of the draws.
        """
        root, rng = np.linalg.cholesky(bench.plant.derivative_cov), np.random.default_rng(seed)
        draws = []
        for _ in range(DRAWS // 2):
            size = _SPREAD * float(np.clip(rng.standard_normal(), -_MOST, _MOST))
            common = np.zeros(SHORT_PERIOD.common.size)
            common[SHORT_PERIOD.common.derivatives] = root @ rng.standard_normal(6)
            draws += [(1.0 + size, common), (1.0 - size, -common)]
        return IncrementBand(
            model=model_of(bench.aircraft, campaign, bench.condition, fitted_of(records)),
            learned=tuple(learned(e, bench.plant) for e in self.accepted),
            draws=tuple(draws),
        )


@dataclass(frozen=True)
class IncrementBand:
    """Bands of learned increments at a flight condition; a `airtruth.design.search.Merit`.

    Attributes
    ----------
    model : the tracer's filter for the flight to come.
    learned : the increments.
    draws : factor on the increments and (common,) parameters of the aircraft each, in pairs about the declared ones.
    """

    model: FilterSetting
    learned: tuple[Learned, ...]
    draws: tuple[tuple[float, Array], ...]

    @property
    def targets(self) -> tuple[str, ...]:
        """Names of what is determined."""
        return tuple(own.effect.variant for own in self.learned)

    @property
    def known(self) -> Array:
        """(targets,) root mean square of the standard deviation of each increment by the trace [-]."""
        return np.array([_rms(own.known) for own in self.learned])

    @property
    def gust_m_s(self) -> float:
        """Standard deviation of the vertical gust [m/s]."""
        return self.model.gust_m_s

    @property
    def changes(self) -> tuple[Change, ...]:
        """The aircraft with the increments, with which the limits are kept besides."""
        total = Change()
        for own in self.learned:
            values = {
                p.name: p.value(float(s)) for p, s in zip(own.effect.parameters, own.sizes, strict=True)
            }
            total = total + own.effect.change(values)
        return (total,)

    def rate(self, flown: Flown, *, final: bool = False) -> Array | None:
        """(targets,) standard deviation by the trace over that with the flight, root mean squares [-]."""
        found = self.expected(flown, final=final)
        return None if found is None else self.known / np.array([_rms(std) for std in found])

    def expected(self, flown: Flown, *, final: bool) -> list[Array] | None:
        """For each increment the standard deviations (points,) with the flight [-]; None if a motion is lost."""
        variances: list[list[Array]] = [[] for _ in self.learned]
        for factor, common in self.draws if final else self.draws[:_FIRST]:
            covariance = self.covariance(flown.record, factor, common)
            if covariance is None:
                return None
            first = 0
            for own, found in zip(self.learned, variances, strict=True):
                span = slice(first, first + own.effect.bends)
                first += len(own.effect.parameters)
                new = np.einsum("pi,ij,pj->p", own.basis, covariance[span, span], own.basis)
                found.append(1.0 / (own.known**-2.0 + 1.0 / new))
        return [np.sqrt(np.mean(found, axis=0)) for found in variances]

    def covariance(self, record: TraceRecord, factor: float, common: Array) -> Array | None:
        """Covariance (sizes, sizes) of the increments by the flight alone; None if the motion is lost.

        Parameters
        ----------
        record : of the input; its outputs do not count.
        factor : on the bends and shares.
        common : (common,) true parameters of the aircraft.
        """
        model = self.model
        hypothesis = Hypothesis(
            model.declared,
            tuple(own.effect for own in self.learned),
            also_unconstrained=_FREE,
            trim_flow_rad=record.plant.trim_alpha_rad,
        )
        scale = [np.where(np.arange(len(own.sizes)) < own.effect.bends, factor, 1.0) for own in self.learned]
        sizes = np.concatenate([own.sizes for own in self.learned]) * np.concatenate(scale)
        flown = flown_by(model, record, hypothesis, sizes, common)
        if not np.isfinite(flown.signals.y).all():
            return None
        problem = TraceProblem((flown,), model.settings)
        found = sensitivities_of(problem, 0, hypothesis, Parameters(common, model.own(flown)[None], sizes))
        if found is None:
            return None
        basis = refitted(problem, hypothesis, found, model.records)
        directions = found.t[SHORT_PERIOD.common.size : SHORT_PERIOD.common.size + len(sizes)].reshape(
            len(sizes), -1
        )
        across = np.stack([beyond(basis, d) for d in directions])
        information = model.records * (across @ across.T) + np.diag(hypothesis.size_precision)
        return np.asarray(np.linalg.pinv(information, hermitian=True))

    def quantities(self, flown: Flown, reference: Flown) -> tuple[ForecastQuantity, ...]:
        """The points of the increments with their standard errors by an input and by the reference."""
        ends = [self.expected(f, final=True) for f in (flown, reference)]
        found = []
        for k, own in enumerate(self.learned):
            after, compared = (np.full(own.known.shape, np.nan) if e is None else e[k] for e in ends)
            for i in range(len(own.known)):
                at = float(own.at[i]) if own.at.size else None
                figures = (float(x[i]) for x in (own.value, own.known, after, compared))
                found.append(ForecastQuantity(own.effect.variant, at, *figures))
        return tuple(found)


def _rms(x: Array) -> float:
    return float(np.sqrt(np.mean(x**2)))


__all__ = ["COEFFICIENTS", "DRAWS", "BandQuestion", "IncrementBand", "Learned", "learned"]
