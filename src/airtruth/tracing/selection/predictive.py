"""The tests that a fitted set has to pass whatever its evidence: plausible sizes, and no worse on records left out."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft.dynamics import declared_dynamics
from airtruth.checks.poor import severe_m_s
from airtruth.effects.effect import Effect
from airtruth.effects.increment import Increment
from airtruth.physics.expected import EXPECTED
from airtruth.tracing.criterion import CRITERION
from airtruth.tracing.inference.assess import Assessment, noise_floor
from airtruth.tracing.inference.cross_validate import LeftOut, leave_one_out, one_by_the_other
from airtruth.tracing.inference.feedback import responds_to_motion
from airtruth.tracing.inference.posterior import PosteriorFit, TraceProblem
from airtruth.tracing.inference.robust import MEMORY_S, long_run
from airtruth.tracing.model.plant import alpha_dot
from airtruth.tracing.selection.candidate import Refusal

Array = NDArray[np.float64]

_ERRORS: Final = 2.0
"""Standard errors that count as a difference [-] (convention)."""
_SMALL_SHORTFALL: Final = 0.02
"""Share of its gain that a refit may still lack and count as converged [-] (judgement: rate limits and backlash give no
smooth cost)."""
_BEYOND_DOUBT: Final = 25.0
"""Gain in 2 log L from which the free run of a closed loop refuses no effect [-] (judgement: that of a later effect
beside an anomaly beyond doubt)."""
_DIVERGED: Final = 1e6
"""Residual over the share that gusts and sensors explain, beyond which a free run has diverged [-] (judgement)."""
_AT_END: Final = 1e-6
"""Distance from an end of the range, over the range, at which a size has ended there [-] (judgement: above rounding)."""


@dataclass(frozen=True)
class Reference:
    """The fit without the effect, on records left out.

    Attributes
    ----------
    left_out : one for each way of leaving records out: `leave_one_out`, and with two records `one_by_the_other`.
    weight : (outputs,) of each record, standard deviations of the free run that gusts and sensors explain.
    in_loop : whether a control responds to the motion, so that free runs do not judge a model.
    """

    left_out: tuple[LeftOut, ...]
    weight: tuple[Array, ...]
    in_loop: bool


def reference_of(problem: TraceProblem, null: PosteriorFit) -> Reference:
    """The null as the reference of every candidate of its round."""
    compiled = null.hypothesis.compiled(null.point.sizes)
    weight = tuple(
        noise_floor(record, problem.settings, compiled, null.point.common, local)
        for record, local in zip(problem.records, null.point.per_record, strict=True)
    )
    left_out = tuple(way(problem, null) for way in _ways(problem))
    controls = [r.signals.sampled_controls_rad for r in problem.records]
    in_loop = responds_to_motion(controls, [a.whitened for a in left_out[0].assessments])
    return Reference(left_out, weight, in_loop)


def _ways(problem: TraceProblem) -> tuple[Callable[[TraceProblem, PosteriorFit], LeftOut], ...]:
    return (leave_one_out, one_by_the_other) if len(problem.records) == 2 else (leave_one_out,)


@dataclass(frozen=True)
class LeftOutTest:
    """A fit against its reference, on records left out.

    Attributes
    ----------
    likelihood_gain, free_run_gain : (records,) gains in log L, and in squared residual over the share that gusts and sensors
        explain [-].
    reasons : what gets worse, in words.
    """

    likelihood_gain: Array
    free_run_gain: Array
    reasons: tuple[str, ...]


def tested_on_left_out(
    problem: TraceProblem, own: PosteriorFit, reference: Reference, gain: float
) -> LeftOutTest:
    """Whether a fit worsens likelihood or free run of records left out.

    In a closed loop the likelihood alone counts where the gain in 2 log L is beyond doubt: there a free run is no valid test, and
    refuses effects of little evidence all the same. The same holds for an airspeed that follows the measured angle of attack:
    uncorrected, it brings the gusts of the angle of attack into a free run.
    """
    for way, before in zip(_ways(problem), reference.left_out, strict=True):
        likelihood, after = way(problem, own)
        # where neither can follow a record the difference is no number, which counts as a loss
        with np.errstate(invalid="ignore"):
            likelihood_gain, unaided = before[0] - likelihood, before[1]
        if not _is_loss(likelihood_gain):
            break
    free, covariance = _free_run_gain(problem, unaided, after, reference.weight)
    loses = free.sum() < -CRITERION.far * np.sqrt(max(float(covariance.sum()), 0.0))
    in_channels = loses_in_two_channels(free.sum(axis=0), covariance)
    in_loop = reference.in_loop or reads_alpha(own)
    reasons = (
        *([Refusal.WORSE_LIKELIHOOD] if _is_loss(likelihood_gain) else []),
        *(
            [Refusal.WORSE_FREE_RUN]
            if (loses or in_channels) and not (in_loop and gain >= _BEYOND_DOUBT)
            else []
        ),
    )
    return LeftOutTest(likelihood_gain, free.sum(axis=1), reasons)


def reads_alpha(own: PosteriorFit) -> bool:
    """Whether a fit corrects an input by the measured angle of attack."""
    errors = own.hypothesis.compiled(own.point.sizes).inputs.values()
    return any(e.alpha_slope_per_rad != 0.0 for e in errors)


@dataclass(frozen=True)
class Soundness:
    """Whether fits pass the tests that count whatever their evidence; each fit is tested once.

    Attributes
    ----------
    problem, null : what is fitted, and the fit without any effect.
    """

    problem: TraceProblem
    null: PosteriorFit
    _known: dict[int, tuple[PosteriorFit, bool]] = field(default_factory=dict, repr=False)

    def __call__(self, fitted: PosteriorFit) -> bool:
        """Whether a fit has converged to plausible sizes, and is no worse than the null on records left out."""
        if id(fitted) not in self._known:
            is_sound = self.is_possible(fitted) and self._predicts(fitted)
            self._known[id(fitted)] = fitted, is_sound  # the fit lives as long as its number
        return self._known[id(fitted)][1]

    def is_possible(self, fitted: PosteriorFit) -> bool:
        """Whether a fit has converged to plausible sizes."""
        if not has_converged(fitted, self._gain(fitted)):
            return False
        return not fitted.hypothesis.effects or _is_plausible(self.problem, fitted)

    def _predicts(self, fitted: PosteriorFit) -> bool:
        if not fitted.hypothesis.effects:
            return True
        found = tested_on_left_out(self.problem, fitted, self._reference, self._gain(fitted))
        return not found.reasons

    def _gain(self, fitted: PosteriorFit) -> float:
        return 2.0 * (self.null.cost - fitted.cost)

    @cached_property
    def _reference(self) -> Reference:
        return reference_of(self.problem, self.null)


def loses_in_two_channels(gains: Array, covariance: Array) -> bool:
    """Whether two channels lose as much together as two independent ones that lose `_ERRORS` standard errors each.

    The free runs of the angle of attack and of the acceleration are nearly one; their losses must not count twice.

    Parameters
    ----------
    gains : (channels,) [-]; covariance : (channels, channels) of their errors; zero for channels that are not measured.
    """
    error = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    for a, b in itertools.combinations(np.flatnonzero(error > 0.0), 2):
        first, second = gains[a] / error[a], gains[b] / error[b]
        correlation = max(float(covariance[a, b] / (error[a] * error[b])), 0.0)
        if max(first, second) < 0.0 and first + second < -2.0 * _ERRORS * np.sqrt(1.0 + correlation):
            return True
    return False


def implausibility(problem: TraceProblem, effect: Effect, own: PosteriorFit) -> Iterator[str]:
    """Why the estimates of an effect of a fit are not accepted, whatever it gains, in words."""
    span_m = max(r.plant.aircraft.constants.span_m for r in problem.records)
    sizes = own.point.sizes[own.hypothesis.span(effect.key)]
    size = float(sizes[0])
    is_reversed = effect.parameters[0].sign * size < 0.0
    declared = declared_part(problem, effect) if is_reversed else 0.0
    yield from size_reasons(effect, size, span_m, declared)
    yield from shape_reasons(effect, sizes)


def _is_plausible(problem: TraceProblem, own: PosteriorFit) -> bool:
    """Whether the estimates of every effect of a fit are accepted, and its derivatives and gusts are possible."""
    named = (e for e in own.hypothesis.effects if not isinstance(e, Increment))
    is_possible = _has_possible_signs(problem, own) and _has_possible_gusts(problem, own)
    return is_possible and not any(why for e in named for why in implausibility(problem, e, own))


def _has_possible_signs(problem: TraceProblem, own: PosteriorFit) -> bool:
    """Whether no derivative is significantly of a sign that no aircraft has.

    A derivative that is declared so may have it, and a stiffness may be of either sign.
    """
    motion, rows = problem.layout.motion, own.layout.of.common.derivatives
    expected = EXPECTED.get(motion.name)
    if expected is None:
        return True
    declared = dict(zip(motion.parameters, problem.declared_derivatives.tolist(), strict=True))
    moved = dict(zip(motion.parameters, own.point.common[rows].tolist(), strict=True))
    std = dict(zip(motion.parameters, np.sqrt(np.diag(own.covariance)[rows]).tolist(), strict=True))
    return not any(
        sign * declared[name] > 0.0 and sign * (declared[name] + moved[name]) < -_ERRORS * std[name]
        for name, (sign, _) in expected.signs.items()
        if name != expected.stiffness
    )


def _has_possible_gusts(problem: TraceProblem, own: PosteriorFit) -> bool:
    """Whether the gusts of most records are no stronger than those of severe turbulence."""
    level_m_s = np.exp(own.point.per_record[:, problem.layout.per_record.log_gust])
    severe = [severe_m_s(r.signals.altitude_m) for r in problem.records]
    return bool(np.median(level_m_s / severe) <= 1.0)


def declared_part(problem: TraceProblem, effect: Effect) -> float:
    """Size that the declared aircraft has of an effect of the flow angle's rate, in its model and in [dynamics]; 0 for others."""
    plant, motion = problem.records[0].plant, problem.layout.motion
    stated = declared_dynamics(plant.aircraft.file.dynamics).aero
    for term in effect.change({p.name: 1.0 for p in effect.parameters}).aero:
        if term.signal == motion.flow_rate:
            like = (term.coefficient, term.signal)
            own = sum(t.amplitude for t in stated if (t.coefficient, t.signal) == like)
            row = [c.name for c in motion.coefficients].index(term.coefficient)
            return own + float(alpha_dot(plant)[row])
    return 0.0


def size_reasons(effect: Effect, size: float, span_m: float, declared: float = 0.0) -> Iterator[str]:
    """Why the size of an effect is not accepted, in words.

    Parameters
    ----------
    span_m : wing span of the aircraft [m]; declared : size that the declared aircraft has already.
    """
    first = effect.parameters[0]
    if first.sign * size < 0.0 and first.sign * (declared + size) < -CRITERION.slight * abs(declared):
        yield Refusal.WRONG_SIGN
    if abs(size) > first.spans * span_m:
        yield Refusal.BEYOND_ENDS
    if abs(size) < first.material:
        yield Refusal.IMMATERIAL
    low, high = first.reach
    span = high - low
    if high - size < _AT_END * span or (size - low < _AT_END * span and low != 0.0):
        yield Refusal.AT_LIMIT


def shape_reasons(effect: Effect, sizes: Array) -> Iterator[str]:
    """Why the times, frequencies and damping ratios of an effect are not accepted, in words.

    A location in an angle may end anywhere: beyond the range of the records its effect is that of a slope.

    Parameters
    ----------
    sizes : (parameters,) in their size coordinates.
    """
    for p, size in zip(effect.parameters[1:], sizes[1:], strict=True):
        low, high = p.reach
        if p.unit != "rad" and min(high - size, size - low) < _AT_END * (high - low):
            yield f"its {p.meaning} ends at the limit of the plausible range"


def _free_run_gain(
    problem: TraceProblem, unaided: list[Assessment], after: list[Assessment], weights: tuple[Array, ...]
) -> tuple[Array, Array]:
    """(records, outputs) gains in squared residual over the weight, and (outputs, outputs) covariance of their sums."""
    outputs = len(problem.settings.noise)
    free, covariance = np.zeros((len(after), outputs)), np.zeros((outputs, outputs))
    for i, (old, new, weight) in enumerate(zip(unaided, after, weights, strict=True)):
        if not (np.abs(old.residual) < _DIVERGED * weight).all():
            free[i] = 0.0 if (np.abs(new.residual) < _DIVERGED * weight).all() else -np.inf
            continue
        gains = ((old.residual / weight) ** 2) - ((new.residual / weight) ** 2)
        gains[:, ~problem.settings.measured] = 0.0
        free[i] = gains.sum(axis=0)
        lags = round(MEMORY_S / problem.records[i].signals.dt_s)
        covariance += long_run(gains - gains.mean(axis=0), lags)
    return free, covariance


def has_converged(own: PosteriorFit, gain: float) -> bool:
    """Whether a fit has converged, or lacks next to nothing of its gain."""
    return own.converged or 2.0 * own.shortfall < _SMALL_SHORTFALL * gain


def _is_loss(gains: Array) -> bool:
    """Whether the records together are less likely than without the effect by odds that count.

    Free derivatives predict as well as a cause that explains why they are not as declared, so that a gain by the declaration
    shows in no record. A record that only the null can follow is a loss, and one that only the effect can follow a gain.
    """
    return not float(gains.sum()) >= np.log(CRITERION.level)


__all__ = [
    "Reference",
    "Soundness",
    "has_converged",
    "implausibility",
    "reference_of",
    "tested_on_left_out",
]
