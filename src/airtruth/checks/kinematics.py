"""Are the channels of a log consistent with each other? Flight-path reconstruction without aerodynamics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.channels import BANK
from airtruth.checks.kinematics_findings import bias_of, concluded, drift, errors_of
from airtruth.checks.kinematics_fit import limits_of, problem_of
from airtruth.checks.kinematics_model import ERRORS, LONGITUDINAL, LongitudinalSamples, thinned
from airtruth.checks.kinematics_record import USUAL_ARM_M, records_of
from airtruth.checks.kinematics_search import ErrorSearch, completed, search
from airtruth.checks.kinematics_vaneless import COMPUTED, WITHOUT_ATTITUDE, untestable, without_vane
from airtruth.checks.kinematics_words import NAMED
from airtruth.checks.result import CheckResult, Finding
from airtruth.logs.flight_log import FlightLog
from airtruth.logs.validate import validate
from airtruth.physics.motion import LATERAL
from airtruth.physics.motion import LONGITUDINAL as MOTION
from airtruth.physics.reconstruction import is_reconstructed
from airtruth.units import G0

Array = NDArray[np.float64]

ROTATION: Final = (*LATERAL.gyros, BANK, LATERAL.vane)
"""Channels without one of which the wings count as level."""
AIRSPEED: Final = ("sensor_delay:airspeed_m_s", "airspeed_alpha_slope")
"""Errors that the equation of airspeed shows."""
ATTITUDE: Final = ("gyro_lag", "attitude_lag", "sensor_delay:theta_rad", "sensor_delay:q_rad_s", "gyro_scale")
"""Errors that need theta, because without it nothing predicts q but alpha, whose own errors are the same."""


def check_kinematics(
    log: FlightLog | Sequence[FlightLog],
    declared: Mapping[str, float] | None = None,
    length_m: float | None = None,
    biases: Mapping[str, float] | None = None,
) -> CheckResult:
    """Estimate the errors of sensors from all runs together; the gate is not passed.

    The errors are common to all runs. The noise is estimated for each run.

    Parameters
    ----------
    log : flight log, or several; of many runs the first `kinematics_record.MOST_RECORDS` with an elevator that moves are taken.
    declared : instrument errors that are known, names of
        `airtruth.checks.kinematics_model.ERRORS` in SI; see `airtruth.checks.kinematics_record.declared_errors`.
    length_m : reference length, which limits arms, see `airtruth.checks.kinematics_record.Kinematics.longest` [m]; None takes
        that of the log.
    biases : channel -> bias that is known [unit of the channel]; see `declared_biases` there.

    Raises
    ------
    LogError
        If a log breaks its contract, or no run is long enough and has an elevator that moves.
    """
    logs = [log] if isinstance(log, FlightLog) else list(log)
    for one in logs:
        validate(one)
    records, remarks = _records(logs)
    length = length_m or _length_of(logs)
    usual = _candidates(records, length)
    limits = limits_of(records, LONGITUDINAL.longest_arm_m(length))
    known = {n: v for n, v in (declared or {}).items() if n in ERRORS}
    computed = any(is_reconstructed(one.channels) for one in logs)
    if computed and records[0].theta is None:
        return untestable((r.run_id for r in records), COMPUTED, WITHOUT_ATTITUDE)
    equations = ("alpha",) if records[0].theta is None else ("theta",) if computed else ("theta", "alpha")
    if computed:
        usual = {name: size for name, size in usual.items() if name in ATTITUDE}
    found = completed(search(problem_of(records, equations, known, limits), usual), usual)
    airspeed = () if computed else _airspeed(found)
    findings = (*errors_of(found, usual), *airspeed, *_biases(found, biases or {}))
    findings = _scale_or_bias(findings)
    result = concluded(found, found, findings)
    if computed:
        result = without_vane(result)
    elif length is None:
        reference, longest = LONGITUDINAL.reference, LONGITUDINAL.longest_arm_m(None)
        remarks.append(
            f"No {reference} is known: arms up to {longest:g} m are allowed; --aircraft narrows them."
        )
    return replace(result, sentences=(*result.sentences, *remarks))


def _records(logs: Sequence[FlightLog]) -> tuple[list[LongitudinalSamples], list[str]]:
    """Runs worth judging, with the channels that all of them have, and remarks on absent ones."""

    def record(run_id: str, dt_s: float, c: Mapping[str, Array]) -> LongitudinalSamples | None:
        if min(np.ptp(c[n]) for n in (*MOTION.surfaces, *MOTION.gyros, MOTION.vane)) == 0.0:
            return None
        further = (c.get(n) for n in ("ax_m_s2", "theta_rad", *ROTATION))
        return thinned(LongitudinalSamples(run_id, dt_s, *(c[n] for n in MOTION.required), *further))

    records, remarks = records_of(logs, record, "elevator, q or alpha does not", "a manoeuvre")
    if records[0].theta is None:
        remarks.append(
            "theta_rad is absent: q is not assessed separately, the airspeed is not assessed, and the flight path is "
            "assumed level at the start."
        )
    if records[0].ax is None:
        remarks.append("ax_m_s2 is absent: the airspeed is not assessed, and ax alpha is omitted in alpha'.")
    return records, remarks


def _length_of(logs: Sequence[FlightLog]) -> float | None:
    """Reference length that the logs state for their runs [m]; None if none does."""
    for log in logs:
        table = log.metadata.get("record_constants", {})
        for constants in table.values() if isinstance(table, Mapping) else ():
            value = constants.get(f"{LONGITUDINAL.reference}_m") if isinstance(constants, Mapping) else None
            if isinstance(value, int | float) and value > 0.0:
                return float(value)
    return None


def _candidates(records: Sequence[LongitudinalSamples], length_m: float | None) -> dict[str, float]:
    """Errors that the channels can show, with their usual sizes [SI]."""
    result = {}
    for name, error in ERRORS.items():
        if name in AIRSPEED or (name in ATTITUDE and records[0].theta is None):
            continue
        arm = USUAL_ARM_M if length_m is None else error.usual * length_m
        result[name] = arm if error.kind == "arm" else error.usual
    return result


def _airspeed(found: ErrorSearch) -> list[Finding]:
    """Delay and position error of airspeed, by the equation of airspeed alone.

    That equation needs the vertical position of the longitudinal accelerometer, its alignment and the lag of the
    pneumatic lines, which no log states. It therefore has no part in the errors of the other instruments.
    """
    problem, one = found.problem, found.best.fit
    first = problem.records[0]
    if first.channel("ax") is None or first.channel("theta") is None:
        return []
    known = {**problem.known, **dict(zip(one.names, one.value, strict=True))}
    usual = {name: ERRORS[name].usual for name in AIRSPEED}
    alone = problem_of(problem.records, ("airspeed",), known, problem.limits, lines=problem.lines)
    return errors_of(completed(search(alone, usual), usual), usual)


def _biases(found: ErrorSearch, known: Mapping[str, float]) -> list[Finding]:
    """Biases of gyro, az and ax from the ramps of the equations, beside the sums that known ones make there."""
    problem = found.problem
    scale = found.best.fit.of("vane_scale", problem.start("vane_scale"))
    if "alpha" not in problem.equations:
        turn, turn_std = drift(found, "theta", known)
        meaning = "constant in q, by the drift of its integral from theta"
        return [bias_of(found, "gyro_bias", "rad/s", meaning, -turn, turn_std)]
    ramp, std = drift(found, "alpha", known)
    ramp, std = -ramp / scale, std / scale
    if "theta" not in problem.equations:
        meaning = "constants in q and az, which theta would separate"
        return [bias_of(found, "gyro_bias + accelerometer_bias/V", "rad/s", meaning, ramp, std)]
    turn, turn_std = drift(found, "theta", known)
    meaning = "constant in q, by the drift of its integral from theta"
    result = [bias_of(found, "gyro_bias", "rad/s", meaning, -turn, turn_std)]
    airspeed = float(np.mean([np.asarray(r.channel("airspeed")).mean() for r in problem.records]))
    meaning = "constant in az, by the drift of the integral of q + az/V from alpha"
    bias, spread = airspeed * (ramp + turn), airspeed * float(np.hypot(std, turn_std))
    result.append(bias_of(found, "accelerometer_bias", "m/s2", meaning, bias, spread))
    if problem.records[0].channel("ax") is not None:
        meaning = (
            "constant in ax + az alpha - g (theta - alpha): biases that airspeed alone does not separate"
        )
        slope, slope_std = drift(found, "airspeed", known)
        result.append(bias_of(found, "forward_bias", "m/s2", meaning, -slope, slope_std))
    return result


def _scale_or_bias(findings: tuple[Finding, ...]) -> tuple[Finding, ...]:
    """A scale of az multiplies gravity too: it leaves the ramp of a bias."""
    by_name = {f.name: f for f in findings}
    bias, scale = by_name.get("accelerometer_bias"), by_name.get("accelerometer_scale")
    if bias is None or scale is None or bias.state != "present" or scale.state == "present":
        return findings
    needed, std = scale.declared * (1.0 - (bias.value - bias.declared) / G0), scale.declared * bias.std / G0
    if abs(needed - scale.value) > 3.0 * float(np.hypot(scale.std, std)):
        return findings
    if scale.state != "one of":
        scale = replace(scale, value=needed, std=std, lower=needed - 1.96 * std, upper=needed + 1.96 * std)
    both = {bias.name: replace(bias, state="one of"), scale.name: replace(scale, state="one of")}
    return tuple(both.get(f.name, f) for f in findings)


__all__ = ["AIRSPEED", "NAMED", "check_kinematics"]
