"""Sentences about estimates that a reader should not trust: undetermined parameters, missing numbers, wrong signs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.identification.estimates import (
    SENTENCES,
    Estimates,
    Status,
    deviations,
    half_width,
    point_values,
)
from airtruth.physics.short_period import PARAMETERS

Array = NDArray[np.float64]

SIZES: Final = {"CLalpha": 5.0, "CLq": 30.0, "CLde": 1.0, "Cmalpha": 1.0, "Cmq": 30.0, "Cmde": 1.5}
"""Magnitudes of the derivatives of ordinary aircraft [-]: judgement. A derivative whose standard deviation exceeds its
magnitude is not determined."""
TERMS: Final = {
    "CLalpha": "lift by angle of attack",
    "CLq": "lift by pitch rate",
    "CLde": "lift of the elevator",
    "Cmalpha": "pitch stiffness",
    "Cmq": "pitch damping",
    "Cmde": "moment of the elevator",
}
"""Physical meaning of each derivative."""
SHARE: Final = 0.3
"""Least part of a direction that its sentence names [-]: judgement."""
APART: Final = 3.0
"""Standard deviations between methods above which they contradict each other [-]: judgement."""
LIKELY: Final = (
    "likely causes: a sensor that lags (`airtruth check` shows it), feedback from the motion to the elevator, a record "
    "too short for the motion, or an aircraft that is unstable by design"
)
"""Causes of a damping or stiffness of the wrong sign."""


def doubts(estimates: Sequence[Estimates]) -> list[str]:
    """Sentences about the estimates of one or more methods, none where nothing is in doubt.

    Parameters
    ----------
    estimates : one per method, of the same runs.
    """
    result: list[str] = []
    for one in estimates:
        result += _missing(one)
        result += _undetermined(one)
        result += _wrong_signs(one)
    return result + _contradictions(estimates)


def _some(count: int, runs: int) -> str:
    return "" if runs == 1 else f" in {count} of {runs} runs"


def _missing(one: Estimates) -> list[str]:
    """Reasons of numbers that are absent."""
    runs = len(one.run_ids)
    result = []
    absent = ~np.isfinite(one.theta).all(axis=1)
    for status in sorted({int(s) for s in one.status[absent]}):
        count = int((one.status[absent] == status).sum())
        reason = SENTENCES[Status(status)] if status != Status.CONVERGED else "no estimate was computed"
        result.append(f"{one.method}: no estimate{_some(count, runs)}: {reason}.")
    none = ~absent & ~np.isfinite(point_values(one)[:, len(PARAMETERS)])
    if none.any():
        result.append(
            f"{one.method}: no frequency and damping ratio{_some(int(none.sum()), runs)}: with these derivatives the short "
            "period is no oscillation about a stable trim (its stiffness is negative)."
        )
    bare = ~absent & ~np.isfinite(deviations(one)).all(axis=1)
    if bare.any():
        reason = (
            "covariance = none was asked for"
            if one.covariance_name == "none"
            else "the information of the record is singular, or the method did not converge"
        )
        result.append(f"{one.method}: no intervals{_some(int(bare.sum()), runs)}: {reason}.")
    return result


def _undetermined(one: Estimates) -> list[str]:
    """Parameters that most of the runs leave open, and the direction in which they may change together."""
    size = np.array([SIZES[n] for n in PARAMETERS])
    known = np.isfinite(one.covariance).all(axis=(1, 2)) & np.isfinite(one.theta).all(axis=1)
    if not known.any():
        return []
    variance = np.diagonal(one.covariance, axis1=1, axis2=2)[known]
    open_ones = variance / (size * size) > 1.0
    named = np.flatnonzero(open_ones.mean(axis=0) >= 0.5)
    if not named.size:
        return []
    relative = one.covariance[np.flatnonzero(known)[open_ones.any(axis=1)]] / np.outer(size, size)
    values, vectors = np.linalg.eigh(relative.mean(axis=0))
    direction = vectors[:, -1] / np.abs(vectors[:, -1]).max()
    std = np.sqrt(np.median(variance, axis=0))
    which = ", ".join(f"{PARAMETERS[i]} (standard deviation {std[i]:.2g})" for i in named)
    parts = [i for i in np.argsort(-np.abs(direction)) if abs(direction[i]) >= SHARE]
    together = " with ".join(
        f"{TERMS[PARAMETERS[i]]} ({direction[i] * np.sqrt(values[-1]) * size[i]:+.2g} in {PARAMETERS[i]})"
        for i in parts
    )
    count = int(open_ones.any(axis=1).sum())
    return [
        f"{one.method}: the records do not determine {which}{_some(count, int(known.sum()))}. Within one standard deviation "
        f"these change without a visible effect: {together}. Fly inputs of higher frequency and several "
        "amplitudes, or more records with --joint."
    ]


def _wrong_signs(one: Estimates) -> list[str]:
    """Stiffness or damping of the wrong sign whose interval excludes the right one."""
    half = half_width(one.confidence) * deviations(one)
    result = []
    for name, word in (("Cmalpha", "pitch stiffness"), ("Cmq", "pitch damping")):
        i = PARAMETERS.index(name)
        value, lower, upper = one.theta[:, i], one.theta[:, i] - half[:, i], one.theta[:, i] + half[:, i]
        with np.errstate(invalid="ignore"):
            wrong = lower > 0.0
        if wrong.any():
            first = int(np.argmax(wrong))
            result.append(
                f"Warning: {one.method}: {name} = {value[first]:.3g} ({lower[first]:.3g} to {upper[first]:.3g})"
                f"{_some(int(wrong.sum()), len(one.run_ids))}: a {word} of the wrong sign, whose interval excludes zero; "
                f"{LIKELY}."
            )
    return result


def _contradictions(estimates: Sequence[Estimates]) -> list[str]:
    """Derivatives on which methods contradict each other by more than the magnitude of the derivative."""
    result: list[str] = []
    if len(estimates) < 2 or any(e.run_ids != estimates[0].run_ids for e in estimates):
        return result
    deviation = [deviations(e) for e in estimates]
    runs = np.arange(len(estimates[0].run_ids))
    for i, name in enumerate(PARAMETERS):
        value = np.array([e.theta[:, i] for e in estimates])
        std = np.array([d[:, i] for d in deviation])
        known = np.isfinite(value) & np.isfinite(std)
        lowest = np.argmin(np.where(known, value, np.inf), axis=0)
        highest = np.argmax(np.where(known, value, -np.inf), axis=0)
        with np.errstate(invalid="ignore"):
            gap = value[highest, runs] - value[lowest, runs]
            apart = (gap > SIZES[name]) & (gap > APART * np.hypot(std[highest, runs], std[lowest, runs]))
        apart &= known.sum(axis=0) > 1
        count = int(apart.sum())
        if count and 2 * count >= runs.size:
            run = int(np.argmax(apart))
            low, high = lowest[run], highest[run]
            result.append(
                f"{name}: the methods contradict each other{_some(count, value.shape[1])}: {value[low, run]:.3g} by "
                f"{estimates[low].method}, {value[high, run]:.3g} by {estimates[high].method}. At least one of their "
                "assumptions fails: noise of the regressors, gusts, or an effect that the model lacks (`airtruth trace`)."
            )
    return result


__all__ = ["SIZES", "doubts"]
