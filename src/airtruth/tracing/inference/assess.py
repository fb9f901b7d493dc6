"""Assess records that a model was not fitted to: innovations and free runs, only their own parameters free."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_continuous_lyapunov

from airtruth.numerics.discretise import step
from airtruth.numerics.levenberg_marquardt import minimise
from airtruth.numerics.levenberg_marquardt_options import Damping, SolverOptions, Stopping
from airtruth.numerics.normal_equations import scaled_step
from airtruth.tracing.inference.hypothesis import Hypothesis
from airtruth.tracing.inference.optimise import ROUGH_M_S
from airtruth.tracing.inference.posterior import TraceProblem, likelihood_terms, sensitivities_of
from airtruth.tracing.inference.whitening import NO_WHITENER
from airtruth.tracing.model.compile import CompiledChange
from airtruth.tracing.model.linearise import process_intensity
from airtruth.tracing.model.parameters import LEAD_COUNT, Parameters, core_of
from airtruth.tracing.model.records import TraceRecord
from airtruth.tracing.model.response import Response, filter_inputs, kernel_input, respond, respond_to
from airtruth.tracing.model.settings import GUST_COVARIANCE, Settings, initial_per_record, per_record_prior
from airtruth.tracing.model.steady import linearise_at_reference

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_SEARCH: Final = SolverOptions(
    iterations=30,
    damping=Damping(initial=1e-6, least=1e-6, most=np.inf, poor=0.1, fair=0.1),
    stopping=Stopping(decrease=0.003, decrease_confirm=0.05),
)
"""How a record's own parameters are searched; judgement: ten parameters that are well determined, so that steps are
nearly undamped. A search ends once a step gains less than 0.003 in log-likelihood, 0.08 standard errors, and an undamped step
promises less than 0.05. Derivatives that serve several steps end it early, by hundreds in log-likelihood, where it begins without
knowledge of the gusts."""
_MOST_LOG_STEP: Final = 1.0
"""Largest step of the logarithm of the gust level [-]: a factor of e (judgement)."""
_HELD: Final = 1e-6
"""Prior standard deviation that holds gusts [rad, -]; judgement: far less than the records show."""
_FREE_RUN_ITERATIONS: Final = 3
"""Most Gauss-Newton iterations of a free run [-]; judgement: the simulation is nearly linear in what is free."""
_FREE_RUN_GAIN: Final = 1e-3
"""Relative decrease of the squared residuals that ends them [-]; judgement."""
_UNSTABLE: Final = 10.0
"""Noise floor of an unstable model, in standard deviations of the sensors' noise [-]; judgement: it has none."""
_DRAWS: Final = 128
"""Simulated records behind `fitted_noise_floor` [-]; judgement: its relative error is 1/sqrt(2 draws), 6 %."""


@dataclass(frozen=True)
class Assessment:
    """Assessment of a model on one record.

    Attributes
    ----------
    likelihood : negative log-likelihood, own parameters at their best.
    innovation, free_run : (outputs,) root mean squares [units of the channels].
    residual : (samples, outputs) of the free run [same units]; whitened : (samples, outputs) innovations [-].
    expected : (outputs,) root mean squares of innovations that are gusts and noise alone.
    per_record : (per-record,) own parameters.
    """

    likelihood: float
    innovation: Array
    free_run: Array
    residual: Array
    whitened: Array
    expected: Array
    per_record: Array


def assess(
    problem: TraceProblem,
    index: int,
    hypothesis: Hypothesis,
    common: Array,
    sizes: Array,
    per_record: Array | None = None,
    *,
    settled: bool = False,
) -> Assessment:
    """Innovations and free run of one record for given common parameters and sizes.

    Parameters
    ----------
    index : number of the record.
    per_record : own parameters to start from; None for `initial_per_record`.
    settled : they are at their best already.
    """
    record, settings = problem.records[index], problem.settings
    own = per_record
    if own is None or not settled:
        own = _fit_own(problem, index, hypothesis, common, sizes, own)
    compiled = hypothesis.compiled(sizes)
    response = respond(record, settings, compiled, common, own)
    residual = free_run(record, settings, compiled, common, own, hypothesis.unconstrained)
    with np.errstate(over="ignore", invalid="ignore"):  # the model may leave all bounds on this record
        innovation, free = (np.sqrt((x**2).mean(axis=0)) for x in (response.e, residual))
        whitened = response.e @ response.white.T
    return Assessment(
        likelihood=_negative_log_likelihood(response),
        innovation=innovation,
        free_run=free,
        residual=residual,
        whitened=whitened,
        expected=np.sqrt(np.diag(response.covariance)),
        per_record=own,
    )


def own_likelihood(
    problem: TraceProblem, index: int, hypothesis: Hypothesis, common: Array, sizes: Array, per_record: Array
) -> float:
    """Negative log-likelihood of one record, own parameters at their best; parameters as of `assess`."""
    own = _fit_own(problem, index, hypothesis, common, sizes, per_record)
    compiled = hypothesis.compiled(sizes)
    return _negative_log_likelihood(respond(problem.records[index], problem.settings, compiled, common, own))


def _negative_log_likelihood(response: Response) -> float:
    """Infinite where the motion leaves all bounds."""
    if not np.isfinite(response.logdet):
        return np.inf
    white = response.e @ response.white.T
    return 0.5 * (len(white) * response.logdet + float((white**2).sum()))


@dataclass(frozen=True)
class _OwnEvaluated:
    """Negative log-posterior of one record in its own parameters, gradient and information."""

    cost: float
    gradient: Array
    information: Array


@dataclass(frozen=True)
class _OwnSearch:
    """One minimisation problem over a record's own parameters; see `Problems`."""

    problem: TraceProblem
    hypothesis: Hypothesis
    common: Array
    sizes: Array
    mean: Array
    precision: Array

    def evaluate(
        self, x: Array, index: Ints, near: Sequence[_OwnEvaluated] | None
    ) -> list[_OwnEvaluated | None]:
        return [self._evaluate(row) for row in x]

    def _evaluate(self, own: Array) -> _OwnEvaluated | None:
        point = Parameters(self.common, own[None, :], self.sizes, self.problem.layout)
        at = sensitivities_of(self.problem, 0, self.hypothesis, point, per_record_only=True)
        if at is None:
            return None
        cost, gradient, information = likelihood_terms(at, NO_WHITENER, levels=True)
        rows, off = point.layout.per_record, own - self.mean
        return _OwnEvaluated(
            cost + 0.5 * float(off @ self.precision @ off),
            gradient[rows] + self.precision @ off,
            information[rows, rows] + self.precision,
        )

    def step(self, x: Array, at: Sequence[_OwnEvaluated], damping: Array, index: Ints) -> tuple[Array, Array]:
        gradient, information = np.array([a.gradient for a in at]), np.array([a.information for a in at])
        steps = scaled_step(gradient, information, damping)
        level = self.problem.layout.per_record.log_gust
        steps[:, level] = np.clip(steps[:, level], -_MOST_LOG_STEP, _MOST_LOG_STEP)
        bent = np.einsum("ni,nij,nj->n", steps, information, steps)
        return steps, -(gradient * steps).sum(axis=1) - 0.5 * bent

    def move(self, x: Array, step: Array, index: Ints) -> Array:
        return x + step


def _fit_own(
    problem: TraceProblem,
    index: int,
    hypothesis: Hypothesis,
    common: Array,
    sizes: Array,
    start: Array | None,
) -> Array:
    """Own parameters of one record at their best, all else given; it begins at `initial_per_record` without a start.

    A mean gust that no fit has estimated is held first, and the level with it, in rough air: it multiplies the motion, which is
    not known yet.
    """
    record, settings = problem.records[index], problem.settings
    alone = TraceProblem((record,), settings)
    ((mean, precision),) = alone.priors(hypothesis).per_record
    search = _OwnSearch(alone, hypothesis, common, sizes, mean, precision)
    if start is None:
        start = initial_per_record(record, settings)
    gust, level = settings.layout.per_record.mean_gust, settings.layout.per_record.log_gust
    if start[gust].size and not start[gust].any():
        rough, held = start.copy(), precision.copy()
        rough[level] = np.log(ROUGH_M_S)
        for i in (level, *range(gust.start, gust.stop)):
            held[i, i] = _HELD**-2.0
        start = minimise(replace(search, mean=rough, precision=held), rough[None, :], _SEARCH).x[0]
    return np.asarray(minimise(search, start[None, :], _SEARCH).x[0])


def free_run(
    record: TraceRecord,
    settings: Settings,
    compiled: CompiledChange,
    common: Array,
    per_record: Array,
    unconstrained: Sequence[int] = (),
) -> Array:
    """(samples, outputs) residuals of a simulation, initial state, biases and trim coefficients at their best.

    Least squares with the channels weighted by `noise_floor`.

    Parameters
    ----------
    unconstrained : indices of the derivatives whose coefficient is not constrained by what is declared.
    """
    weight = 1.0 / noise_floor(record, settings, compiled, common, per_record)
    own = per_record.copy()
    own[settings.layout.per_record.gusts] = 0.0
    free = settings.layout.per_record.deterministic
    mean, precision = per_record_prior(record, settings, unconstrained)
    prior = np.diag(precision)[free]
    residual = respond(record, settings, compiled, common, own, free_run=True).e
    for _ in range(_FREE_RUN_ITERATIONS):
        residual, t = _free_run_slopes(record, settings, compiled, common, own, weight)
        off = (own - mean)[free]
        try:
            move = -np.linalg.solve(t @ t.T + np.diag(prior), t @ (residual * weight).ravel() + prior * off)
        except np.linalg.LinAlgError:  # the simulation diverges, and its slopes are beyond any prior
            break
        if not np.isfinite(move).all():
            break
        trial = own.copy()
        trial[free] += move
        after = respond(record, settings, compiled, common, trial, free_run=True).e
        better = float(((residual * weight) ** 2).sum() - ((after * weight) ** 2).sum())
        if not np.isfinite(better) or better < 0.0:
            break
        own, residual = trial, after
        if better < _FREE_RUN_GAIN * float(((residual * weight) ** 2).sum()):
            break
    return residual


def _free_run_slopes(
    record: TraceRecord,
    settings: Settings,
    compiled: CompiledChange,
    common: Array,
    own: Array,
    weight: Array,
) -> tuple[Array, Array]:
    """Residual of a free run (samples, outputs) and its weighted derivatives (own parameters but gusts, samples * outputs)."""
    given = filter_inputs(record, compiled)
    residual = respond_to(given, settings, common, own, free_run=True).e
    columns, entries = [], settings.layout.per_record
    for i in entries.deterministic:
        moved = own.copy()
        moved[i] += entries.step[i]
        e = respond_to(given, settings, common, moved, free_run=True).e
        columns.append(((e - residual) * weight / entries.step[i]).ravel())
    return residual, np.array(columns)


def noise_floor(
    record: TraceRecord, settings: Settings, compiled: CompiledChange, common: Array, per_record: Array
) -> Array:
    """Contribution of gusts and sensors to a free run to which nothing is fitted: (outputs,) standard deviations."""
    linear = _linear_model(record, settings, compiled, common, per_record)
    if np.linalg.eigvals(linear.a).real.max() >= 0.0:
        return np.asarray(_UNSTABLE * np.sqrt(linear.variance))
    spread = solve_continuous_lyapunov(linear.a, -np.diag(linear.process))
    variance = np.maximum(np.einsum("ij,jk,ik->i", linear.c, spread, linear.c), 0.0) + linear.variance
    return np.asarray(np.sqrt(variance))


def fitted_noise_floor(
    record: TraceRecord,
    settings: Settings,
    compiled: CompiledChange,
    common: Array,
    per_record: Array,
    seed: int,
    unconstrained: Sequence[int] = (),
) -> Array:
    """Residual of gusts and sensors in a free run to which initial state, biases and trim are fitted: (outputs,) rms.

    The mean over `_DRAWS` records of the linear model in its gusts, treated as `free_run` treats the measured one. An
    output that no instrument measured has the noise that the settings state of a vane.

    Parameters
    ----------
    seed : of the draws.
    unconstrained : see `free_run`.
    """
    linear = _linear_model(record, settings, compiled, common, per_record)
    seen = linear._replace(variance=np.where(settings.measured, linear.variance, settings.noise**2))
    y = _gust_records(record, seen, len(settings.layout.motion.states), seed)
    samples = record.samples
    weight = 1.0 / noise_floor(record, settings, compiled, common, per_record)
    t = _free_run_slopes(record, settings, compiled, common, per_record, weight)[1]
    free = settings.layout.per_record.deterministic
    prior = np.diag(np.diag(per_record_prior(record, settings, unconstrained)[1])[free])
    flat = (y * weight[:, None]).reshape(-1, _DRAWS)
    left = flat - t.T @ np.linalg.solve(t @ t.T + prior, t @ flat)
    return np.asarray(np.sqrt((left.reshape(samples, -1, _DRAWS) ** 2).mean(axis=(0, 2))) / weight)


class _LinearModel(NamedTuple):
    """The linearised filter.

    Attributes
    ----------
    a, c : (n, n) and (outputs, n); process : (n,) intensities [1/s]; variance : (outputs,) of the white noise.
    noise : first state of the sensors' correlated noise; -1 for none.
    """

    a: Array
    c: Array
    process: Array
    variance: Array
    noise: int


def _gust_records(record: TraceRecord, linear: _LinearModel, states: int, seed: int) -> Array:
    """Outputs (samples, outputs, draws) of the linear model in gusts, with noise; ``states``: number of those of the motion."""
    n, samples = linear.a.shape[0], record.samples
    phi, spread = np.empty((n, n)), np.empty((n, n))
    early, late = np.empty((n, 1)), np.empty((n, 1))
    system = np.hstack([linear.a, np.zeros((n, 1))])
    step(system, linear.process, n, record.signals.dt_s, phi, early, late, spread)
    values, vectors = np.linalg.eigh(spread)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    rng = np.random.default_rng([seed, samples])
    x = np.zeros((n, _DRAWS))
    x[states : states + 2] = np.linalg.cholesky(GUST_COVARIANCE) @ rng.standard_normal((2, _DRAWS))
    x[core_of(states) - LEAD_COUNT : core_of(states)] = x[states]
    if linear.noise >= 0:
        x[linear.noise :] = rng.standard_normal((len(linear.c), _DRAWS))
    y = np.empty((samples, len(linear.c), _DRAWS))
    for k in range(samples):
        y[k] = linear.c @ x
        x = phi @ x + root @ rng.standard_normal((n, _DRAWS))
    y += np.sqrt(linear.variance)[:, None] * rng.standard_normal(y.shape)
    return y


def _linear_model(
    record: TraceRecord, settings: Settings, compiled: CompiledChange, common: Array, per_record: Array
) -> _LinearModel:
    """The filter's linearisation about the record's mean."""
    kernel = kernel_input(filter_inputs(record, compiled), settings, common, per_record)
    n = kernel.model.states.size
    a, c = np.empty((n, n)), np.empty((len(settings.noise), n))
    linearise_at_reference(kernel, a, c)
    process = process_intensity(kernel.reference.airspeed_m_s, kernel.model)
    return _LinearModel(a, c, process, kernel.model.sensors.variance, kernel.model.states.noise)


__all__ = [
    "Assessment",
    "assess",
    "fitted_noise_floor",
    "free_run",
    "noise_floor",
    "own_likelihood",
]
