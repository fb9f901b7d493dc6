"""Biases of gyro and accelerometers: the ramps that they leave in the integrated equations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import toeplitz

from airtruth.checks.kinematics_fit import Fit, Problem
from airtruth.checks.kinematics_model import ERRORS, Record, compare

Array = NDArray[np.float64]

SHARE: Final = 8
"""The autocovariance of a residual is taken up to this part of the record [-]: judgement."""

CHANNELS: Final = {"theta": "theta_rad", "alpha": "alpha_rad", "airspeed": "airspeed_m_s"}
"""Channel that an equation predicts."""
FIELDS: Final = {
    "airspeed_m_s": "airspeed",
    "alpha_rad": "alpha",
    "theta_rad": "theta",
    "q_rad_s": "q",
    "ax_m_s2": "ax",
    "az_m_s2": "az",
}
"""Field of a record that holds a channel whose bias the equations show."""


def ramps(problem: Problem, one: Fit, equation: str, enlargement: float = 1.0) -> tuple[Array, Array]:
    """(records,) ramp of a difference and its standard error [unit of the channel over s].

    Integrated noise wanders; the autocovariance of the residual's increments shows how far. The uncertainty of the
    fitted errors is added.

    Parameters
    ----------
    problem, one : records and fitted errors.
    equation : "theta", "alpha" or "airspeed".
    enlargement : factor on the variances of the fitted errors.
    """
    errors = dict(zip(one.names, one.value, strict=True))
    slopes, stds = [], []
    for record in problem.records:
        e = _difference(problem, record, errors, equation)
        n = len(e)
        weights = _weights(n, record.dt_s)
        steps = np.diff(e)
        # sum_t w(t) e(t) = sum_s W(s) step(s), W(s) the weights after s
        reach = np.cumsum(weights[::-1])[::-1][1:]
        own = _variance(steps - steps.mean(), reach)
        moved = [
            (_difference(problem, record, {**errors, n: errors[n] + ERRORS[n].step}, equation) - e)
            / ERRORS[n].step
            for n in one.names
        ]
        share = np.array(moved).reshape(len(moved), n) @ weights
        slopes.append(weights @ e)
        stds.append(np.sqrt(max(own, 0.0) + enlargement * float(share @ one.covariance @ share)))
    return np.array(slopes), np.array(stds)


def ramps_of(biases: Mapping[str, float], problem: Problem, one: Fit, equation: str) -> Array:
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
            problem, _unbiased(record, biases), errors, equation
        )
        slopes.append(_weights(len(left), record.dt_s) @ left)
    return np.array(slopes)


def _unbiased(record: Record, biases: Mapping[str, float]) -> Record:
    readings = {n: getattr(record, FIELDS[n]) for n in biases}
    return replace(record, **{FIELDS[n]: x - biases[n] for n, x in readings.items() if x is not None})


def _weights(samples: int, dt_s: float) -> Array:
    """(samples,) weights of the slope of the least-squares line [1/s]."""
    t = np.arange(samples) - 0.5 * (samples - 1)
    return np.asarray(t / (t @ t) / dt_s)


def _difference(problem: Problem, record: Record, errors: Mapping[str, float], equation: str) -> Array:
    return compare(record, {**problem.known, **errors})[equation]


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


def rms(problem: Problem, one: Fit) -> dict[str, float]:
    """Root mean square of what is left of each channel, constant and ramp taken out [unit of the channel]."""
    errors = {**problem.known, **dict(zip(one.names, one.value, strict=True))}
    parts: dict[str, list[Array]] = {}
    for record in problem.records:
        for equation, e in compare(record, errors).items():
            basis = np.stack([np.ones(len(e)), np.linspace(-1.0, 1.0, len(e))])
            parts.setdefault(CHANNELS[equation], []).append(e - (e @ np.linalg.pinv(basis)) @ basis)
    return {channel: float(np.sqrt(np.mean(np.concatenate(p) ** 2))) for channel, p in parts.items()}


__all__ = ["FIELDS", "mean_of", "ramps", "ramps_of", "rms"]
