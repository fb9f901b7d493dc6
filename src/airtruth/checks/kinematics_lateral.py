"""Are the channels of roll, yaw and sideslip of a log consistent with each other?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc

from airtruth.channels import ATTITUDE
from airtruth.checks.kinematics_energy import by_equation
from airtruth.checks.kinematics_findings import bias_of, concluded, drift, errors_of
from airtruth.checks.kinematics_fit import KinematicProblem, limits_of, problem_of
from airtruth.checks.kinematics_lines import lines_of
from airtruth.checks.kinematics_record import USUAL_ARM_M, records_of, thinned
from airtruth.checks.kinematics_search import DOUBT, ROUNDS, ErrorSearch, completed, search
from airtruth.checks.kinematics_side import CONTROLS, ERRORS, LATERAL, ONE_OF, SideRecord
from airtruth.checks.result import CheckResult, Finding
from airtruth.checks.rotation import given, rates
from airtruth.checks.samples import integral
from airtruth.errors import LogError
from airtruth.logs.flight_log import FlightLog
from airtruth.physics.motion import LATERAL as MOTION
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.sensor_errors import error_name
from airtruth.units import G0

Array = NDArray[np.float64]

USUAL_ARM_SPANS: Final = 0.4
"""Arm that is not unusual [spans]: judgement; the nose of a transport is that far ahead."""
STEADY: Final = 0.1
"""Relative change of an enlargement below which it is settled [-]: judgement."""
_BETA, _P, _R, _PHI, _AY = MOTION.output_channels
OF_EQUATION: Final = {"phi": (_PHI, _P), "psi": ("psi_rad", _R), "beta": (_BETA, _R, _AY)}
"""Equation -> channels whose errors it shows."""
BY_GUSTS: Final = (error_name(_R, "scale"), error_name(_AY, "scale"))
"""Errors that a gust at the vane hides."""
ARMS: Final = (error_name(_BETA, "arm"), error_name(_AY, "arm"))
"""Errors that enter as their difference."""


def check_lateral(
    logs: Sequence[FlightLog],
    declared: Mapping[str, float] | None = None,
    length_m: float | None = None,
    biases: Mapping[str, float] | None = None,
) -> CheckResult:
    """Estimate the errors of the sensors of roll, yaw and sideslip from all runs together; the gate is not passed.

    The errors are common to all runs. The noise is estimated for each run.

    Parameters
    ----------
    logs : flight logs; of many runs the first `MOST_RECORDS` in which aileron or rudder moves are taken.
    declared : instrument errors that are known, names of `airtruth.checks.kinematics_side.ERRORS` in SI.
    length_m : reference length, which limits arms as in `airtruth.checks.kinematics.check_kinematics` [m]; None if it is not
        known.
    biases : channel -> bias that is known [unit of the channel].

    Raises
    ------
    LogError
        If a channel is missing, or no run is long enough and has an aileron or rudder that moves.
    """
    records, remarks = side_records(logs)
    known = {n: v for n, v in (declared or {}).items() if n in ERRORS}
    equations = tuple(
        e for e, c in LATERAL.channels.items() if records[0].channel(LATERAL.fields[c]) is not None
    )
    usual = _candidates(equations, known, length_m)
    limits = limits_of(records, LATERAL.longest_arm_m(length_m), LATERAL)
    problem = problem_of(records, equations, known, limits, kinematics=LATERAL)
    found, shown = _searched(problem, usual)
    findings = (*errors_of(found, usual), *_biases(found, biases or {}))
    result = concluded(found, shown, findings)
    further = (*_of_arms(findings, known), *_of_gusts(findings), *remarks)
    return replace(result, sentences=(*result.sentences, *further))


def _searched(problem: KinematicProblem, usual: Mapping[str, float]) -> tuple[ErrorSearch, ErrorSearch]:
    """Outcome of a search, and the same with the test of its best set against the noise alone.

    The equations differ in what they leave: a good attitude shows every imperfection of a gyroscope, and a vane in the air does
    not. What an equation leaves beyond noise enlarges its own noise, not that of the others.
    """
    first = found = search(problem, usual)
    enlarged: dict[str, float] = {}
    for _ in range(ROUNDS):
        left = {}
        for equation, (energy, count) in by_equation(found.problem, found.best.fit).items():
            whole = energy * enlarged.get(equation, 1.0) ** 2 / max(count, 1)
            if fdtrc(max(count, 1), found.problem.weight.degrees, whole) < DOUBT:
                left[equation] = float(np.sqrt(whole))
        if left.keys() == enlarged.keys() and all(abs(left[e] / enlarged[e] - 1.0) < STEADY for e in left):
            break
        enlarged = left
        again = problem_of(
            problem.records,
            problem.equations,
            problem.known,
            problem.limits,
            None,
            problem.lines,
            LATERAL,
            enlarged,
        )
        found = search(again, usual)
    final = completed(found, usual)
    if not enlarged:
        return final, final
    factor = max(max(enlarged.values()) ** 2, final.enlargement)
    return final, replace(
        final, statistic=first.statistic, degrees=first.degrees, p_value=first.p_value, enlargement=factor
    )


_NEEDED: Final = tuple(n for n in MOTION.required if n not in MOTION.surfaces)
"""Channels of every lateral record."""
_INPUTS: Final = (LONGITUDINAL.vane, "theta_rad", *LONGITUDINAL.gyros)
"""Channels of the other motion that are known inputs."""


def side_records(logs: Sequence[FlightLog]) -> tuple[list[SideRecord], list[str]]:
    """Runs worth judging, with the channels that all of them have, and remarks on absent ones.

    Raises
    ------
    LogError
        As `check_lateral`.
    """
    shared = set.intersection(*(set(log.channels) for log in logs))
    missing = [n for n in _NEEDED if n not in shared]
    if missing or not shared & set(MOTION.surfaces) or not set(LATERAL.channels.values()) & shared:
        wanted = missing or [f"{' or '.join(MOTION.surfaces)}, and {ONE_OF}"]
        raise LogError(
            f"the lateral motion cannot be assessed: {', '.join(wanted)} is missing; map it on import"
        )
    records, remarks = records_of(
        logs, _record, f"{LATERAL.controls}, p or r do not", "a manoeuvre of roll and yaw"
    )
    absent = [n for n in _INPUTS if n not in shared]
    if absent:
        remarks.append(f"{', '.join(absent)} is absent: zero is taken, a constant of alpha is free.")
    for channel, loss in (
        (_BETA, "the vane, r and ay are not assessed"),
        (_PHI, "p is not assessed, and the bank is the integral of p"),
        ("psi_rad", "r is assessed by sideslip alone"),
    ):
        if channel not in shared:
            remarks.append(f"{channel} is absent: {loss}.")
    return records, remarks


def _shows_noise(record: SideRecord) -> bool:
    """Whether a record has more lines than its trends and the motions of its surfaces, so that some are noise alone."""
    lines = lines_of(record, LATERAL)
    return bool(lines.keep.size > len(lines.basis) + len(lines.trends))


def _record(run_id: str, dt_s: float, c: Mapping[str, Array]) -> SideRecord | None:
    """The record of a run; None where nothing moves but noise."""
    moved = max(np.ptp(c[n]) for n in MOTION.surfaces if n in c)
    if min(moved, *(np.ptp(c[n]) for n in MOTION.gyros)) == 0.0:
        return None
    airspeed, p, r, ay = (c[n] for n in _NEEDED)
    _, q, _, _, theta = rates(c)
    alpha = given(c, LONGITUDINAL.vane)
    forward, normal = "ax_m_s2", LONGITUDINAL.outputs[-1].channel
    path = given(c, forward) * np.cos(alpha) + given(c, normal) * np.sin(alpha)
    phi, psi = (np.unwrap(c[n]) if n in c else None for n in ATTITUDE[1:])
    record = thinned(
        SideRecord(
            run_id=run_id,
            dt_s=dt_s,
            airspeed=airspeed,
            p=p,
            r=r,
            ay=ay,
            **dict(zip(CONTROLS, (given(c, n) for n in MOTION.surfaces), strict=True)),
            alpha=alpha,
            theta=theta if "theta_rad" in c else alpha,
            q=q,
            bank=integral(p, dt_s) if phi is None else phi,
            path=path if {forward, normal} <= c.keys() else np.zeros_like(path),
            phi=phi,
            psi=psi,
            beta=c.get(MOTION.vane),
        )
    )
    return record if _shows_noise(record) else None


def _candidates(
    equations: Sequence[str], known: Mapping[str, float], length_m: float | None
) -> dict[str, float]:
    """Errors that the equations can show, with their usual sizes [SI]; of two arms the one that is not declared."""
    shown = {channel for equation in equations for channel in OF_EQUATION[equation]}
    arm = USUAL_ARM_M if length_m is None else USUAL_ARM_SPANS * length_m
    result = {}
    for name, error in ERRORS.items():
        if error.channel not in shown or (name == ARMS[1] and name in known):
            continue
        result[name] = error.usual if not error.is_arm else arm if error.kind == "arm" else 0.3 * arm
    return result


def _biases(found: ErrorSearch, known: Mapping[str, float]) -> list[Finding]:
    """Biases of p, r and ay from the ramps of the equations, beside the sums that known ones make there."""
    problem = found.problem
    meanings = {
        "phi": (f"gyro_bias:{_P}", "constant in p, by the drift of its integral from phi"),
        "psi": (f"gyro_bias:{_R}", "constant in r, by the drift of its integral from psi"),
    }
    drifts = {equation: drift(found, equation, known) for equation in problem.equations}
    result = []
    for equation, (name, meaning) in meanings.items():
        if equation in drifts:
            ramp, std = drifts[equation]
            result.append(bias_of(found, name, "rad/s", meaning, -ramp, std))
    if "beta" not in drifts:
        return result
    scale = found.best.fit.of(vane := error_name(_BETA, "scale"), problem.start(vane))
    speed = float(np.mean([r.channel("airspeed") for r in problem.records[:1]]))
    ramp, std = drifts["beta"]
    ramp, std = ramp / scale, std / scale
    if "psi" not in drifts:
        meaning = "constants in r, ay and phi, which psi would separate"
        return [*result, bias_of(found, meanings["psi"][0], "rad/s", meaning, ramp, std)]
    alpha = float(np.mean([r.channel("alpha") for r in problem.records[:1]]))
    yaw, yaw_std = drifts["psi"]
    roll, roll_std = drifts.get("phi", (np.zeros(2), 0.0))
    # beta's ramp is -(ay/V + p sin a - r cos a); those of phi and psi are -p and -r
    side = speed * (-ramp + roll * np.sin(alpha) - yaw * np.cos(alpha))
    spread = speed * float(np.sqrt(std**2 + (yaw_std * np.cos(alpha)) ** 2 + (roll_std * np.sin(alpha)) ** 2))
    meaning = f"constant in ay, and {G0:.3g} m/s2 per rad of a constant in phi, by the drift of beta: one does not show the other"
    return [*result, bias_of(found, f"accelerometer_bias:{_AY}", "m/s2", meaning, side, spread)]


def _of_arms(findings: Sequence[Finding], known: Mapping[str, float]) -> list[str]:
    """Origin of an arm, in words."""
    if not any(f.name in ARMS for f in findings):
        return []
    if ARMS[1] in known:
        return [
            f"The arm of the vane is measured from the CG, with the accelerometer {known[ARMS[1]]:.4g} m ahead as declared."
        ]
    return [
        "The arms of the beta vane and of the accelerometer of ay enter as their difference: each stands for the distance of the "
        "vane ahead of the accelerometer, and is that from the CG if the other instrument is there. Declare the place of one."
    ]


def _of_gusts(findings: Sequence[Finding]) -> list[str]:
    """Errors that moving air hides."""
    hidden = [f.name for f in findings if f.name in BY_GUSTS and f.state == "not shown"]
    if not hidden:
        return []
    return [
        f"{' and '.join(hidden)} cannot be determined by the kinematics of these records: the vane of beta measures moving "
        "air as well, or the manoeuvre is weak."
    ]


__all__ = ["check_lateral", "side_records"]
