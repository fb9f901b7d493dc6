"""A learned increment fitted to records: its prior, its evidence, and the tests that it has to pass."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from airtruth.effects.increment import Increment
from airtruth.physics.motion import Motion
from airtruth.physics.readings import increments_over
from airtruth.physics.terms import QBAR
from airtruth.tracing.anomalies.flown import flown
from airtruth.tracing.anomalies.score_test import Score
from airtruth.tracing.inference.direction import Direction
from airtruth.tracing.inference.optimise import fit
from airtruth.tracing.inference.posterior import PosteriorFit, TraceProblem
from airtruth.tracing.inference.robust import inflation, robust_covariance
from airtruth.tracing.learning.increments import Screened
from airtruth.tracing.model.records import TraceRecord
from airtruth.tracing.selection.candidate import Candidate, Refusal
from airtruth.tracing.selection.predictive import Reference, has_converged, tested_on_left_out

Array = NDArray[np.float64]

_ITERATIONS: Final = 8
"""Iterations of an increment's refit, and half of it of the refit with another prior [-] (judgement: enough to rank
the shapes; the leader is refitted until it converges)."""
_ATTEMPTS: Final = 3
"""Number of further refits that the leader is given to converge [-] (judgement)."""
LEAST_ODDS: Final = 5.0
"""Log of the posterior odds, all shapes equally probable beforehand, from which an increment is accepted [-]
(judgement: the gain of a named effect has to be 10 in 2 log L)."""
_TWO_DEVIATIONS: Final = 0.0455
"""Probability beyond two standard deviations [-] (convention), as for the size of a named effect."""
_MATERIAL: Final = 0.02
"""Least swing of an increment over that of the declared derivative in the same range [-] (judgement: 2 % is about the
material size of the named effects)."""
_MATERIAL_READING: Final = 0.005
"""Least standard deviation of an increment of a reading over that of its channel [-] (judgement: half of the material
error of a gyro's scale)."""
_LEAST_DECLARED: Final = 1e-3
"""Least declared derivative with which an increment is compared [-] (judgement: one that is declared as zero)."""
_FLOWN: Final = (0.02, 0.98)
"""Quantiles of the flown signal between which the swing counts [-] (judgement)."""


@dataclass(frozen=True)
class FittedIncrement:
    """A refitted increment.

    Attributes
    ----------
    effect : the increment, with its prior.
    fit : with all parameters free.
    log_evidence : log of the posterior odds against the null [-].
    """

    effect: Increment
    fit: PosteriorFit
    log_evidence: float


def refitted(problem: TraceProblem, null: PosteriorFit, s: Screened, tried: float) -> FittedIncrement | None:
    """All parameters with the increment; the prior's standard deviation is estimated again, once."""
    effect = s.effect
    of_memory = list(effect.shape.estimated_memory.values())
    sizes = np.concatenate([null.point.sizes, s.start, of_memory])
    start = replace(null.point, sizes=sizes)
    own = fit(problem, null.hypothesis.plus(effect), start, iterations=_ITERATIONS)
    if own is None:
        return None
    best = FittedIncrement(effect, own, log_evidence(null, own, effect, tried))
    again = _restated(own, effect)
    if again is not None:
        own = fit(problem, null.hypothesis.plus(again), own.point, iterations=_ITERATIONS // 2)
        if own is not None:
            retried = FittedIncrement(again, own, log_evidence(null, own, again, tried))
            best = max(best, retried, key=lambda learned: learned.log_evidence)
    return best


def converged(
    problem: TraceProblem, null: PosteriorFit, learned: Sequence[FittedIncrement], tried: float
) -> list[FittedIncrement]:
    """The refits, best first, the best one converged if a few more refits achieve it."""
    ranked = sorted(learned, key=lambda own: -own.log_evidence)
    for _ in range(_ATTEMPTS):
        if not ranked or has_converged(ranked[0].fit, 2.0 * ranked[0].log_evidence):
            break
        effect, first = ranked[0].effect, ranked[0].fit
        own = fit(problem, first.hypothesis, first.point, near=first)
        if own is None:
            break
        ranked[0] = FittedIncrement(effect, own, log_evidence(null, own, effect, tried))
        ranked.sort(key=lambda other: -other.log_evidence)
    return ranked


def _restated(own: PosteriorFit, effect: Increment) -> Increment | None:
    """The increment with the prior that its bends ask for (MacKay's fixed point); None where that is the present one."""
    bends, covariance = fitted_bends(own, effect, own.covariance)
    old = effect.parameters[0].prior_std
    effective = effective_bends(covariance, old)
    if not effective > 0.0:
        return None
    new = float(np.sqrt(bends @ bends / effective))
    low, high = 1e-3 * effect.parameters[0].high, effect.parameters[0].high
    new = min(max(new, low), high)
    return effect.with_prior(new) if abs(np.log(new / old)) > np.log(1.5) else None


def effective_bends(covariance: Array, prior_std: float) -> float:
    """Number of bends that the records determine [-]: all less the share of the prior in their variance.

    Parameters
    ----------
    covariance : (bends, bends) of a fit with the prior; prior_std : standard deviation of the prior of each bend [-].

    Source: D. J. C. MacKay, Neural Computation 4 (1992) 415-447, section 4 (gamma, the number of well-determined
        parameters).
    """
    return float(len(covariance) - np.trace(covariance) / prior_std**2)


def fitted_bends(own: PosteriorFit, effect: Increment, covariance: Array) -> tuple[Array, Array]:
    """Bends of an increment (bends,) [-] and their covariance (bends, bends).

    Parameters
    ----------
    own : a fit with the increment; covariance : of its common parameters and sizes.
    """
    first = own.hypothesis.span(effect.key).start
    at = slice(own.layout.size(first), own.layout.size(first) + effect.bends)
    return own.point.sizes[first : first + effect.bends], covariance[at, at]


def log_evidence(null: PosteriorFit, own: PosteriorFit, effect: Increment, tried: float) -> float:
    """Log of the posterior odds of an increment (Laplace), one for each of its times.

    Parameters
    ----------
    tried : sum of the weights of all shapes tried, see `Shape.prior_weight`.
    """
    _, covariance = fitted_bends(own, effect, own.covariance)
    volume = np.linalg.slogdet(covariance)[1] - 2.0 * effect.bends * np.log(effect.parameters[0].prior_std)
    times = len(effect.parameters) - effect.bends
    log_prior = np.log(effect.shape.prior_weight / tried)
    return float(null.cost - own.cost + 0.5 * volume - times + log_prior)


def assessed(problem: TraceProblem, own: FittedIncrement, reference: Reference) -> Candidate:
    """A refitted increment with the tests that it fails."""
    gain = 2.0 * own.log_evidence
    ratios = inflation(problem, own.fit)
    first = own.fit.layout.size(own.fit.hypothesis.span(own.effect.key).start)
    excess = float(np.mean(ratios[first : first + own.effect.bends] ** 2))
    left_out = tested_on_left_out(problem, own.fit, reference, gain)
    swing = relative_swing(problem, own.fit, own.effect)
    degrees = effective_bends(
        fitted_bends(own.fit, own.effect, own.fit.covariance)[1], own.effect.parameters[0].prior_std
    )
    bends, covariance = fitted_bends(own.fit, own.effect, robust_covariance(problem, own.fit))
    reasons = (
        *([] if has_converged(own.fit, gain) else [Refusal.UNCONVERGED]),
        *([Refusal.WEAK_EVIDENCE] if own.log_evidence < LEAST_ODDS * excess else []),
        *([] if is_apart_from_zero(bends, covariance, degrees) else [Refusal.WITHIN_ERROR]),
        *left_out.reasons,
        *(
            [Refusal.IMMATERIAL]
            if swing < (_MATERIAL_READING if own.effect.shape.of_reading else _MATERIAL)
            else []
        ),
    )
    return Candidate(evidence_score(own), own.fit, gain, reasons)


def is_apart_from_zero(bends: Array, covariance: Array, degrees: float) -> bool:
    """Whether bends exceed two standard deviations (Wald).

    Parameters
    ----------
    bends : (bends,) estimates; covariance : (bends, bends) of their errors.
    degrees : number of bends that the records determine [-], at least one is counted: the prior holds the others at zero,
        where they add nothing to the statistic.
    """
    statistic = bends @ np.linalg.solve(covariance, bends)
    return bool(chdtrc(max(degrees, 1.0), statistic) < _TWO_DEVIATIONS)


def relative_swing(problem: TraceProblem, own: PosteriorFit, effect: Increment) -> float:
    """Size of an increment relative to what is declared [-].

    Its swing over that of the declared derivative in the flown range, of a linear one its share, of a derivative its swing
    over the declared value; of a reading, its standard deviation over that of the channel.
    """
    shape = effect.shape
    if shape.of_reading:
        return _share_of_channel(problem.records, own, effect)
    bends, _ = fitted_bends(own, effect, own.covariance)
    motion = problem.layout.motion
    index = motion.at(shape.acts_on, _compared(motion, shape.factor or shape.signal))
    declared = max(abs(float(problem.declared_derivatives[index])), _LEAST_DECLARED)
    if not shape.cells:
        return abs(float(bends[0])) / declared
    low, high = _flown_range(problem.records, shape.signal)
    values = shape.basis(np.linspace(low, high, 101)) @ bends
    if shape.factor:
        return float(np.ptp(values) / declared)
    if shape.signal == QBAR:
        low, high = _flown_range(problem.records, motion.flow)
    return float(np.ptp(values) / (declared * (high - low)))


def _compared(motion: Motion, signal: str) -> str:
    """Signal of the derivative with which an increment is compared.

    A moment by the rate of the flow angle is compared with the damping, and one by the dynamic pressure or a known input with
    what the flow angle does in the same records.
    """
    if signal == motion.flow_rate:
        return next(s.name for s in reversed(motion.signals) if s.length is not None)
    return signal if signal in (s.name for s in motion.signals) else motion.flow


def _flown_range(records: Sequence[TraceRecord], signal: str) -> tuple[float, float]:
    low, high = np.quantile(np.concatenate([flown(r, signal) for r in records]), _FLOWN)
    return float(low), float(high)


def _share_of_channel(records: Sequence[TraceRecord], own: PosteriorFit, effect: Increment) -> float:
    """Standard deviation of an increment of a reading over that of its channel [-]."""
    sizes = own.point.sizes[own.hypothesis.span(effect.key)]
    names = [p.name for p in effect.parameters]
    terms = effect.describe(dict(zip(names, sizes.tolist(), strict=True)))
    states = {state.name for state in terms.states}
    named = {name for t in terms.readings for name in (t.signal, t.behind)} - {"", *states}
    named |= {state.signal for state in terms.states}
    parts = []
    for r in records:
        s = r.signals
        signals = {name: flown(r, name)[None, :] for name in named}
        more = increments_over(terms.readings, terms.states, signals, s.dt_s)
        channel = s.motion.output_channels.index(effect.shape.acts_on)
        parts.append((more[effect.shape.acts_on].var(), s.y[:, channel].var()))
    added, whole = np.mean(parts, axis=0)
    return float(np.sqrt(added / whole))


def evidence_score(own: FittedIncrement) -> Score:
    """The evidence as a score; the inverse of a Bayes factor bounds the p-value (J. Ville, 1939)."""
    effect = own.effect
    return Score(
        effect=effect,
        z=float(np.sqrt(max(2.0 * own.log_evidence, 0.0))),
        p_value=float(np.exp(-max(own.log_evidence, 0.0))),
        size=float("nan"),
        direction=Direction(effect, (), effect.parameters[0].step),
        information=0.0,
        index=-1,
    )


__all__ = [
    "LEAST_ODDS",
    "FittedIncrement",
    "assessed",
    "converged",
    "effective_bends",
    "evidence_score",
    "fitted_bends",
    "is_apart_from_zero",
    "log_evidence",
    "refitted",
    "relative_swing",
]
