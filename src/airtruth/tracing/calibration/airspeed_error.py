"""The error that a smoothed airspeed keeps, as far as the records show it.

The noise of a small aircraft's airspeed is smoothed (`airtruth.checks.airspeed`), and the filter takes the result for
exact. Its error is slow and small: 0.02 m/s for a noise of 0.25 m/s. It moves the lift by twice its share of the airspeed, and
six records of some seconds show that. The smoother states the variance of each cosine of its error. This module adds the most
probable error, beside derivatives, biases and motion that are all free.

An effect that the model lacks can look like an error of the airspeed. The correction is therefore limited to what the noise
allows.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from airtruth.numerics.local_level import error_variances
from airtruth.tracing.inference.direction import inserted, projected
from airtruth.tracing.inference.hypothesis import Hypothesis
from airtruth.tracing.inference.optimise import fit, initial_parameters
from airtruth.tracing.inference.posterior import PosteriorFit, TraceProblem
from airtruth.tracing.inference.whitening import NO_WHITENER
from airtruth.tracing.model.parameters import Parameters
from airtruth.tracing.model.records import TraceRecord
from airtruth.tracing.model.response import filter_inputs, respond_to
from airtruth.tracing.prepare import Case

Array = NDArray[np.float64]

_MOST_MODES: Final = 24
"""Most cosines of the error of a record [-] (judgement: below 1.3 Hz in a record of 9 s)."""
_LEAST_VARIANCE: Final = 0.01
"""Variance of a cosine over that of the noise down to which it counts [-] (judgement)."""
_STEP_M_S: Final = 1e-2
"""Amount for differences [m/s] (judgement: the response is linear in it, and it is large against rounding)."""
_PLAUSIBLE: Final = 0.99
"""Probability that an error within its limit has [-] (judgement)."""


def with_corrected_airspeed(case: Case, start: Parameters) -> Case:
    """The case with smoothed airspeeds less the most probable error; as it is where no airspeed is smoothed.

    Parameters
    ----------
    start : the fit of the declared aircraft.
    """
    fitted, held = case.fitted, case.held
    if _is_smoothed(fitted):
        fitted = corrected(fitted, case.hypothesis, start)
    if held is not None and _is_smoothed(held):
        held = corrected(held, case.hypothesis, initial_parameters(held, case.hypothesis))
    return case if fitted is case.fitted and held is case.held else replace(case, fitted=fitted, held=held)


def _is_smoothed(problem: TraceProblem) -> bool:
    return any(r.signals.airspeed_walk is not None for r in problem.records)


def corrected(problem: TraceProblem, hypothesis: Hypothesis, start: Parameters) -> TraceProblem:
    """A problem whose smoothed airspeeds have the most probable error under a hypothesis; the same one where no fit converges."""
    null = fit(problem, hypothesis, start)
    if null is None or not null.converged:
        return problem
    every = [modes(record) for record in problem.records]
    amounts = _most_probable(null, problem, every)
    records = tuple(
        replace(r, signals=r.signals.with_airspeed(r.signals.with_lead.airspeed_m_s + own @ series))
        for r, (series, _), own in zip(problem.records, every, amounts, strict=True)
    )
    return replace(problem, records=records)


def modes(record: TraceRecord) -> tuple[Array, Array]:
    """Cosines (modes, points) of the error on the filter's grid [-] and the standard deviation of each (modes,) [m/s]."""
    signals = record.signals.with_lead
    points = len(signals.airspeed_m_s)
    if signals.airspeed_walk is None:
        return np.zeros((0, points)), np.zeros(0)
    count = (points - 1) // signals.sub + 1
    shares = error_variances(count, signals.airspeed_walk.ratio)[:_MOST_MODES]
    shares = shares[shares >= _LEAST_VARIANCE]
    phase = np.pi / count * (np.arange(points) / signals.sub + 0.5)
    series = math.sqrt(2.0 / count) * np.cos(np.arange(len(shares))[:, None] * phase)
    series[0] = math.sqrt(1.0 / count)
    return series, np.sqrt(signals.airspeed_walk.noise_m2_s2 * shares)


def _most_probable(
    null: PosteriorFit, problem: TraceProblem, every: Sequence[tuple[Array, Array]]
) -> list[Array]:
    """Amounts of the modes of each record [m/s], all parameters of the fit refitted to first order."""
    stds = np.concatenate([std for _, std in every])
    spans = np.cumsum([0, *(len(std) for _, std in every)])

    def extended(index: int) -> Array:
        base = null.sensitivities[index]
        t = np.zeros((len(stds), *base.r.shape))
        t[spans[index] : spans[index + 1]] = _tangents(null, problem, index, every[index][0])
        return t

    further = problem.each(extended, range(len(problem.records)))
    sensitivities = [
        inserted(base, null.layout.sizes.stop, t, np.zeros((len(t), *base.white.shape)))
        for base, t in zip(null.sensitivities, further, strict=True)
    ]
    gradient, information = projected(null, problem, sensitivities, NO_WHITENER)
    scaled = information * np.outer(stds, stds) + np.eye(len(stds))
    amounts = -np.linalg.solve(scaled, stds * gradient)
    limit = float(chdtri(len(stds), 1.0 - _PLAUSIBLE))
    amounts *= min(1.0, math.sqrt(limit / max(float(amounts @ amounts), 1e-30)))
    return np.split(stds * amounts, spans[1:-1])


def _tangents(null: PosteriorFit, problem: TraceProblem, index: int, series: Array) -> Array:
    """Whitened derivatives of a record's innovations in the amounts of its cosines (modes, samples, 3)."""
    record, base = problem.records[index], null.sensitivities[index]
    change = null.hypothesis.compiled(null.point.sizes)
    common, own = null.point.common, null.point.per_record[index]
    plain = respond_to(filter_inputs(record, change), problem.settings, common, own).e
    airspeed = record.signals.with_lead.airspeed_m_s
    t = np.zeros((len(series), *base.r.shape))
    for i, mode in enumerate(series):
        scale = _STEP_M_S / float(np.abs(mode).max())
        moved = replace(record, signals=record.signals.with_airspeed(airspeed + scale * mode))
        response = respond_to(filter_inputs(moved, change), problem.settings, common, own)
        if np.isfinite(response.logdet):
            t[i] = (response.e - plain) @ base.white.T / scale
    return t


__all__ = ["corrected", "modes", "with_corrected_airspeed"]
