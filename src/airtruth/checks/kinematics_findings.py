"""Findings of a kinematic check: sizes of errors, biases from drifts, sets of causes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from airtruth.checks.kinematics_average import averaged
from airtruth.checks.kinematics_bias import mean_of, ramps, ramps_of, rms
from airtruth.checks.kinematics_search import ErrorSearch, price
from airtruth.checks.kinematics_words import NAMED, conclusions, verdict_of
from airtruth.checks.result import CheckResult, Finding, PossibleCause, State

Array = NDArray[np.float64]


def errors_of(found: ErrorSearch, usual: Mapping[str, float]) -> list[Finding]:
    """Every candidate with its size, averaged over the sets that contain it, and its state.

    Parameters
    ----------
    found : outcome of a search.
    usual : candidates, name -> size that is not unusual [SI].
    """
    result = []
    for name, size in usual.items():
        error = found.problem.kinematics.errors[name]
        one = averaged(found, name, usual)
        smallest = float(np.sqrt(price(found.problem)) * one.alone)
        inside = [name in e.names for e in found.equals]
        state: State = "present" if all(inside) else "one of" if any(inside) else "not needed"
        if state == "not needed" and smallest > size:
            state = "not shown"
        result.append(
            Finding(
                name,
                error.unit,
                error.meaning,
                one.value,
                one.std,
                one.lower,
                one.upper,
                found.problem.start(name),
                smallest,
                state,
            )
        )
    return result


def drift(found: ErrorSearch, equation: str, known: Mapping[str, float]) -> tuple[Array, float]:
    """Ramp of an equation and the one that known biases make, (2,), and the standard error of the first."""
    slopes, stds = ramps(found.problem, found.best.fit, equation, found.enlargement)
    mean, std = mean_of(slopes, stds)
    expected, _ = mean_of(ramps_of(known, found.problem, found.best.fit, equation), stds)
    return np.array([mean, expected]), std


def bias_of(found: ErrorSearch, name: str, unit: str, meaning: str, sizes: Array, std: float) -> Finding:
    """Finding of a bias; ``sizes`` are the estimated and the declared one."""
    value, declared = float(sizes[0]), float(sizes[1]) or 0.0  # not -0.0
    smallest = float(np.sqrt(price(found.problem))) * std
    state: State = "present" if abs(value - declared) > smallest else "not needed"
    half = 1.96 * std
    return Finding(name, unit, meaning, value, std, value - half, value + half, declared, smallest, state)


def cause_of(found: ErrorSearch, place: int, findings: Sequence[Finding]) -> PossibleCause:
    """The set of errors that a search tried at a place, its sizes as fitted together."""
    one = found.tried[place]
    of_name = {f.name: f for f in findings}
    errors = []
    for name, value, std in zip(one.fit.names, one.fit.value, one.fit.std, strict=True):
        spread = float(std) * float(np.sqrt(found.enlargement))
        half = 1.96 * spread
        errors.append(
            replace(
                of_name[name],
                value=float(value),
                std=spread,
                lower=float(value) - half,
                upper=float(value) + half,
            )
        )
    return PossibleCause(
        tuple(errors),
        one.fit.statistic,
        one.cost - found.best.cost,
        any(one.names == e.names for e in found.equals),
    )


def concluded(found: ErrorSearch, shown: ErrorSearch, findings: tuple[Finding, ...]) -> CheckResult:
    """Verdict, causes and conclusions of a search; ``shown`` has the statistic that they state."""
    verdict = verdict_of(shown, findings)
    if verdict == "failed":
        findings = tuple(replace(f, state="not assessed") if f.state in NAMED else f for f in findings)
    causes = tuple(cause_of(found, i, findings) for i in range(len(found.tried)))
    return CheckResult(
        verdict=verdict,
        run_ids=tuple(r.run_id for r in found.problem.records),
        findings=findings,
        causes=causes,
        statistic=shown.statistic,
        degrees=shown.degrees,
        p_value=shown.p_value,
        enlargement=shown.enlargement,
        residual_rms=rms(found.problem, found.best.fit),
        sentences=tuple(conclusions(verdict, shown, findings, causes)),
        search=found,
    )


__all__ = ["bias_of", "concluded", "drift", "errors_of"]
