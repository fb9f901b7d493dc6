"""Which motions a log supports, and the kinematic check of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from airtruth.aircraft import Aircraft
from airtruth.checks import kinematics_lateral, kinematics_model, kinematics_side, poor
from airtruth.checks.excitation import moves, turns
from airtruth.checks.gate import admit
from airtruth.checks.kinematics import check_kinematics
from airtruth.checks.kinematics_record import declared_biases, declared_errors
from airtruth.checks.kinematics_vaneless import untestable
from airtruth.checks.result import CheckResult
from airtruth.errors import LogError, choices
from airtruth.logs.flight_log import FlightLog, batches
from airtruth.physics.motion import LATERAL, LONGITUDINAL, MOTIONS, Motion


def unsupported(log: FlightLog, motion: Motion) -> str:
    """Why a log does not support the analysis of a motion, "" if it does: channels that it lacks, or no excitation.

    Parameters
    ----------
    log : flight log.
    motion : one of `airtruth.physics.motion.MOTIONS`.
    """
    missing = missing_channels(log, motion)
    if missing:
        return f"the log lacks {', '.join(missing)}"
    surfaces = motion.surfaces
    if not any(_moves(log, run, surfaces, motion) for run in range(len(log))):
        return f"{' and '.join(surfaces)} do not move in any run, or the aircraft does not answer"
    return ""


def missing_channels(log: FlightLog, motion: Motion) -> tuple[str, ...]:
    """Channels that the analysis of a motion needs and the log lacks; of alternatives, all of them as one."""
    missing = [n for n in motion.required if n not in log.channels]
    if not {"density_kg_m3", "altitude_m"} & set(log.channels):
        missing.append("density_kg_m3 or altitude_m")
    if motion is LATERAL and not set(kinematics_side.LATERAL.channels.values()) & set(log.channels):
        missing.append(kinematics_side.ONE_OF)
    return tuple(missing)


def _moves(log: FlightLog, run: int, surfaces: Sequence[str], motion: Motion) -> bool:
    """Whether a control surface of a motion moves in a run, and roll or yaw follow where they have to."""
    rows = log.rows(run)
    dt_s = float(np.mean(np.diff(log.t_s[rows])))
    channels = {n: x[rows][None] for n, x in log.channels.items()}
    excited = any(bool(moves(channels[n], dt_s)[0]) for n in surfaces)
    return excited and (motion is LONGITUDINAL or bool(turns(channels, dt_s)[0]))


def supported(logs: Sequence[FlightLog]) -> tuple[Motion, ...]:
    """Motions that logs support, in the order of answers; one log that excites a motion is enough, the channels all have."""
    return tuple(
        motion
        for motion in MOTIONS.values()
        if not any(missing_channels(log, motion) for log in logs)
        and any(not unsupported(log, motion) for log in logs)
    )


def chosen(logs: Sequence[FlightLog], wanted: str | None) -> tuple[Motion, ...]:
    """Motions to answer: the wanted one, or each that the logs support; the longitudinal one if they support none.

    Raises
    ------
    LogError
        If the wanted motion is unknown, or a log lacks its channels.
    """
    if wanted is None and (found := supported(logs)):
        return found
    if wanted is not None and wanted not in MOTIONS:
        raise LogError(f"motion {wanted!r}: unknown; {choices(wanted, MOTIONS)}")
    motion = LONGITUDINAL if wanted is None else MOTIONS[wanted]
    for log in logs:
        require(log, motion)
    return (motion,)


def require(log: FlightLog, motion: Motion, source: str = "flight log") -> None:
    """Refuse a log without the channels of a motion.

    Parameters
    ----------
    source : name of the log in the message, usually its file.

    Raises
    ------
    LogError
        Naming the channels.
    """
    if lacking := missing_channels(log, motion):
        raise LogError(
            f"{source}: the {motion.name} motion needs {', '.join(lacking)}, which the log lacks; map it on import"
        )


def check_motions(
    logs: Sequence[tuple[str, FlightLog]],
    aircraft: Aircraft | None = None,
    *,
    motion: str | None = None,
    force: bool = False,
) -> dict[str, CheckResult]:
    """Pass logs through the gate, then estimate the errors of their instruments for each motion.

    Parameters
    ----------
    logs : logs of one instrumentation, each with its name in messages, usually its file.
    aircraft : aircraft whose declared sensor errors are known; None assumes ideal sensors.
    motion : name of a motion; None for each that the logs support.
    force : continue although a log contradicts physics; the results list the faults.

    Returns
    -------
    Name of the motion -> result, in the order of answers.

    Raises
    ------
    LogError
        As `airtruth.checks.gate.admit` and the check of the motion.
    """
    admitted = [admit(log, aircraft, source=name, force=force) for name, log in logs]
    parts = [one.log for one in admitted]
    remarks = dict.fromkeys(sentence for one in admitted for sentence in one.remarks("aircraft"))
    forced = tuple(sentence for one in admitted for sentence in one.forced)
    found = {}
    for one in chosen(parts, motion):
        result = _check(one, parts, aircraft)
        pitching = [batch for log in parts for batch in batches(log)] if one is LONGITUDINAL else []
        doubts = poor.words([run for batch in pitching for run in poor.measured(batch)])
        found[one.name] = replace(result, sentences=(*doubts, *result.sentences, *remarks), forced=forced)
    return found


def _check(motion: Motion, logs: Sequence[FlightLog], aircraft: Aircraft | None) -> CheckResult:
    if motion is LONGITUDINAL:
        if aircraft is None:
            return check_kinematics(logs)
        known = kinematics_model.LONGITUDINAL
        errors, biases = declared_errors(aircraft, known), declared_biases(aircraft, known)
        return check_kinematics(logs, errors, aircraft.chord_m, biases)
    reasons = [unsupported(log, motion) for log in logs]
    if all(reasons):
        return _untold(logs, reasons[0])
    if aircraft is None:
        return kinematics_lateral.check_lateral(logs)
    return kinematics_lateral.check_lateral(
        logs,
        declared_errors(aircraft, kinematics_side.LATERAL),
        None if aircraft.file.geometry is None else aircraft.file.geometry.span.value,
        declared_biases(aircraft, kinematics_side.LATERAL),
    )


def _untold(logs: Sequence[FlightLog], reason: str) -> CheckResult:
    """The result of records without roll and yaw: nothing is compared."""
    return untestable(
        (run_id for log in logs for run_id in log.run_ids),
        f"These records cannot tell whether the channels of roll, yaw and sideslip agree: {reason}. Fly doublets of "
        f"{kinematics_side.LATERAL.controls}.",
    )


__all__ = ["check_motions", "chosen", "missing_channels", "require", "supported", "unsupported"]
