"""Biases of gyro and accelerometers: the ramps that they leave in the integrated equations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import toeplitz

from airtruth.checks.kinematics_fit import Fit, KinematicProblem
from airtruth.checks.kinematics_record import Kinematics, Samples

Array = NDArray[np.float64]

SHARE: Final = 8
"""The autocovariance of a residual is taken up to this part of the record [-]: judgement."""


def ramps(
    problem: KinematicProblem, one: Fit, equation: str, enlargement: float = 1.0
) -> tuple[Array, Array]:
    """(records,) ramp of a difference and its standard error [unit of the channel over s].

    Integrated noise wanders; the autocovariance of the residual's increments shows how far. The uncertainty of the
    fitted errors is added.

    Parameters
    ----------
    problem, one : records and fitted errors.
    equation : of the kinematics.
    enlargement : factor on the variances of the fitted errors.
    """
    errors = dict(zip(one.names, one.value, strict=True))
    slopes, stds = [], []

    def step(name: str) -> float:
        return problem.kinematics.errors[name].step

    for record in problem.records:
        e = _difference(problem, record, errors, equation)
        n = len(e)
        weights = _weights(n, record.dt_s)
        steps = np.diff(e)
        # sum_t w(t) e(t) = sum_s W(s) step(s), W(s) the weights after s
        reach = np.cumsum(weights[::-1])[::-1][1:]
        own = _variance(steps - steps.mean(), reach)
        moved = [
            (_difference(problem, record, {**errors, n: errors[n] + step(n)}, equation) - e) / step(n)
            for n in one.names
        ]
        share = np.array(moved).reshape(len(moved), n) @ weights
        slopes.append(weights @ e)
        stds.append(np.sqrt(max(own, 0.0) + enlargement * float(share @ one.covariance @ share)))
    return np.array(slopes), np.array(stds)


def ramps_of(biases: Mapping[str, float], problem: KinematicProblem, one: Fit, equation: str) -> Array:
    """(records,) ramp that known biases leave in a difference [unit of the channel over s].

    Parameters
    ----------
    biases : channel -> bias of its reading [unit of the channel].
    problem, one, equation : as in `ramps`.
    """
    errors = dict(zip(one.names, one.value, strict=True))
    slopes = []
    for record in problem.records:
        left = _difference(problem, record, errors, equation) - _difference(
            problem, _unbiased(problem.kinematics, record, biases), errors, equation
        )
        slopes.append(_weights(len(left), record.dt_s) @ left)
    return np.array(slopes)


def _unbiased(kinematics: Kinematics, record: Samples, biases: Mapping[str, float]) -> Samples:
    own = {n: kinematics.fields[n] for n in biases if n in kinematics.fields}
    readings = {n: record.channel(name) for n, name in own.items()}
    changed: dict[str, Any] = {own[n]: x - biases[n] for n, x in readings.items() if x is not None}
    return replace(record, **changed)


def _weights(samples: int, dt_s: float) -> Array:
    """(samples,) weights of the slope of the least-squares line [1/s]."""
    t = np.arange(samples) - 0.5 * (samples - 1)
    return np.asarray(t / (t @ t) / dt_s)


def _difference(
    problem: KinematicProblem, record: Samples, errors: Mapping[str, float], equation: str
) -> Array:
    return problem.kinematics.compare(record, {**problem.known, **errors}, (equation,))[equation]


def _variance(e: Array, weights: Array) -> float:
    """Variance of the weighted sum of a stationary series, by its tapered autocovariance."""
    width = max(1, len(e) // SHARE)
    r = np.array([e[k:] @ e[: len(e) - k] for k in range(width)])
    column = np.zeros(len(e))
    column[:width] = r * (1.0 - np.arange(width) / width) / max(len(e) - 2, 1)
    return float(weights @ toeplitz(column) @ weights)


def mean_of(values: Array, stds: Array) -> tuple[float, float]:
    """Mean weighted by precision; its standard error allows for a spread beyond the stated ones."""
    weight = 1.0 / np.maximum(stds, 1e-300) ** 2
    mean = float(weight @ values / weight.sum())
    spread = float(weight @ (values - mean) ** 2) / max(len(values) - 1, 1)
    return mean, float(np.sqrt(max(spread, 1.0) / weight.sum()))


def rms(problem: KinematicProblem, one: Fit) -> dict[str, float]:
    """Root mean square of what is left of each channel, constant and ramp taken out [unit of the channel]."""
    errors = {**problem.known, **dict(zip(one.names, one.value, strict=True))}
    parts: dict[str, list[Array]] = {}
    for record in problem.records:
        compared = problem.kinematics.compare(record, errors, tuple(problem.kinematics.channels))
        for equation, e in compared.items():
            basis = np.stack([np.ones(len(e)), np.linspace(-1.0, 1.0, len(e))])
            parts.setdefault(problem.kinematics.channels[equation], []).append(
                e - (e @ np.linalg.pinv(basis)) @ basis
            )
    return {channel: float(np.sqrt(np.mean(np.concatenate(p) ** 2))) for channel, p in parts.items()}


__all__ = ["mean_of", "ramps", "ramps_of", "rms"]
