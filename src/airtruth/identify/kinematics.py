"""Are the channels of a log consistent with each other? Flight-path reconstruction without aerodynamics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.errors import LogError
from airtruth.identify.kinematics_fit import Fit, fit, instruments
from airtruth.identify.kinematics_model import ERRORS, Record, neutral
from airtruth.identify.kinematics_report import Cause, Consistency, Finding, sentences_of
from airtruth.identify.prefilter import butterworth, edge_samples
from airtruth.logs.flight_log import FlightLog
from airtruth.logs.validate import validate
from airtruth.signals import REQUIRED

Array = NDArray[np.float64]

TIMING: Final = (
    "vane_arm",
    "accelerometer_arm",
    "alpha_delay",
    "vane_lag",
    "gyro_delay",
    "az_delay",
)
"""Single causes of a disagreement between alpha, q and az that grows with pitch rate."""
CLASS: Final = 4.0
"""Causes within this much of the best statistic (scaled by what the best leaves) are not told apart."""
WEAK: Final = 10.0
"""First-stage F below which the manoeuvre does not show an error (J. H. Stock and M. Yogo, 2005)."""
SCALE_STD: Final = 0.05
"""How far a vane's scale is usually from the declared one (judgement); a cause that needs more loses by it."""
MOST_RECORDS: Final = 20
"""Records judged together: more add little, and time grows with them."""


def check_kinematics(log: FlightLog, declared: Mapping[str, float] | None = None) -> Consistency:
    """Judge the consistency of a log's channels, all its runs together.

    Parameters
    ----------
    log : flight log; of many runs the first `MOST_RECORDS` with an elevator that moves are taken.
    declared : instrument errors that are known, names of
        `airtruth.identify.kinematics_model.ERRORS` in SI; see `declared_errors`.

    Raises
    ------
    LogError
        If the log breaks its contract, or no run is long enough and has an elevator that moves.
    """
    validate(log)
    declared = dict(declared or {})
    records, sentences = _records(log)
    basis = [instruments(r) for r in records]
    findings: list[Finding] = []
    residual = {}
    gyro_bias: tuple[float, float] | None = None
    if records[0].theta is not None:
        theta = fit("theta", records, ("gyro_scale", "theta_delay"), declared, basis)
        findings += _findings(theta, declared)
        bias, std = _average(-theta.slope, theta.slope_std * theta.inflation)
        gyro_bias = bias, std
        if findings[1].seen:
            declared["theta_delay"] = findings[1].value
        findings.append(
            _bias(
                "gyro_bias",
                "rad/s",
                "constant in q, by the drift of its integral from theta",
                bias,
                std,
                theta,
            )
        )
        residual["theta_rad"] = theta.residual_rms
    causes, best = _causes(records, declared, basis)
    residual["alpha_rad"] = best.residual_rms
    findings.append(_vertical_bias(records, best, gyro_bias))
    if records[0].ax is not None and records[0].theta is not None:
        speed = fit("airspeed", records, ("airspeed_delay",), declared, basis)
        findings += _findings(speed, declared)
        bias, std = _average(-speed.slope, speed.slope_std * speed.inflation)
        meaning = (
            "constant in ax + az alpha - g (theta - alpha): biases that airspeed alone does not separate"
        )
        findings.append(_bias("forward_bias", "m/s2", meaning, bias, std, speed))
        residual["airspeed_m_s"] = speed.residual_rms
    sentences += sentences_of(findings, causes)
    return Consistency(
        run_ids=tuple(r.run_id for r in records),
        findings=tuple(findings),
        causes=causes,
        residual_rms=residual,
        sentences=tuple(sentences),
    )


def declared_errors(aircraft: Aircraft) -> dict[str, float]:
    """What aircraft.toml says of the instruments, as `check_kinematics` takes it."""
    keys = {
        ("alpha_rad", "x"): "vane_arm",
        ("alpha_rad", "scale"): "alpha_scale",
        ("alpha_rad", "delay"): "alpha_delay",
        ("alpha_rad", "lag"): "vane_lag",
        ("az_m_s2", "x"): "accelerometer_arm",
        ("az_m_s2", "scale"): "az_scale",
        ("az_m_s2", "delay"): "az_delay",
        ("q_rad_s", "scale"): "gyro_scale",
        ("q_rad_s", "delay"): "gyro_delay",
        ("theta_rad", "delay"): "theta_delay",
        ("airspeed_m_s", "scale"): "airspeed_scale",
        ("airspeed_m_s", "delay"): "airspeed_delay",
    }
    result = {}
    for (channel, key), name in keys.items():
        sensor = aircraft.file.sensors.get(channel)
        value = getattr(sensor, key).value if sensor else neutral(name)
        if value != neutral(name):
            result[name] = value
    return result


def _records(log: FlightLog) -> tuple[list[Record], list[str]]:
    """Runs worth judging, and what has to be said of what is absent."""
    sentences = []
    records: list[Record] = []
    channels = {name: log.channels.get(name) for name in ("ax_m_s2", "theta_rad")}
    for run, run_id in enumerate(log.run_ids):
        rows = log.rows(run)
        dt = float(np.mean(np.diff(log.t_s[rows])))
        needed = {name: log.channels[name][rows] for name in REQUIRED}
        ax, theta = (x[rows] if x is not None else None for x in channels.values())
        long_enough = rows.stop - rows.start >= 4 * edge_samples(butterworth(min(5.0, 0.2 / dt), 4, dt))
        if not long_enough or min(np.ptp(needed[n]) for n in ("elevator_rad", "q_rad_s", "alpha_rad")) == 0.0:
            continue
        if len(records) < MOST_RECORDS:
            airspeed, alpha, q, az, elevator = (needed[name] for name in REQUIRED)
            records.append(Record(run_id, dt, airspeed, alpha, q, az, elevator, ax, theta))
    if not records:
        raise LogError(
            f"no run can be judged: {len(log.run_ids)} runs are shorter than two seconds or so, or elevator, "
            "q or alpha does not move in them; give a record with a manoeuvre"
        )
    if len(records) < len(log.run_ids):
        sentences.append(f"{len(records)} of {len(log.run_ids)} runs were judged.")
    if theta is None:
        sentences.append(
            "theta_rad is absent: q is not judged by itself, airspeed is not judged, and the flight path is "
            "taken as level at the start."
        )
    if ax is None:
        sentences.append("ax_m_s2 is absent: airspeed is not judged, and ax alpha is left out of alpha'.")
    return records, sentences


def _causes(
    records: Sequence[Record], declared: Mapping[str, float], basis: Sequence[Array]
) -> tuple[tuple[Cause, ...], Fit]:
    """Explanations of alpha, the best first, and the fit of the best."""
    fits = [fit("alpha", records, ("alpha_scale",), declared, basis)]
    for name in TIMING:
        other = fit("alpha", records, ("alpha_scale", name), declared, basis)
        if other.converged and other.strength > WEAK:
            fits.append(other)
    allowed = max(1.0, min(f.overidentification / max(f.degrees, 1) for f in fits))
    losses = np.array([f.overidentification / allowed + _scale_loss(f, declared) for f in fits])
    causes = []
    for one, loss in zip(fits, losses, strict=True):
        scale, *cause = _findings(one, declared)
        distance = float(loss - losses.min())
        causes.append(
            Cause(
                cause=cause[0] if cause else None,
                alpha_scale=scale,
                statistic=one.overidentification,
                degrees=one.degrees,
                distance=distance,
                possible=distance <= CLASS,
            )
        )
    order = np.argsort(losses, kind="stable")
    return tuple(causes[i] for i in order), fits[order[0]]


def _scale_loss(one: Fit, declared: Mapping[str, float]) -> float:
    off = float(one.value[0]) - declared.get("alpha_scale", 1.0)
    return off**2 / (SCALE_STD**2 + float(one.covariance[0, 0]))


def _findings(one: Fit, declared: Mapping[str, float]) -> list[Finding]:
    result = []
    for name, value, std in zip(one.names, one.value, one.std, strict=True):
        unit, _, _, meaning = ERRORS[name]
        result.append(
            Finding(
                name=name,
                unit=unit,
                meaning=meaning,
                value=float(value),
                std=float(std),
                lower=float(value - one.quantile * std),
                upper=float(value + one.quantile * std),
                declared=declared.get(name, neutral(name)),
                seen=one.converged and one.strength > WEAK,
            )
        )
    return result


def _bias(name: str, unit: str, meaning: str, value: float, std: float, one: Fit) -> Finding:
    half = one.quantile * std
    return Finding(name, unit, meaning, value, std, value - half, value + half, 0.0, True)


def _vertical_bias(records: Sequence[Record], best: Fit, gyro: tuple[float, float] | None) -> Finding:
    """Bias of az from the ramp of alpha, the gyro's own taken out where theta shows it."""
    scale = float(best.value[best.names.index("alpha_scale")])
    ramp, std = _average(-best.slope / scale, best.slope_std * best.inflation / scale)
    if gyro is None:
        return _bias(
            "gyro_bias + az_bias/V",
            "rad/s",
            "constants in q and az, which theta would separate",
            ramp,
            std,
            best,
        )
    airspeed = float(np.mean([r.airspeed.mean() for r in records]))
    meaning = "constant in az, by the drift of the integral of q + az/V from alpha"
    return _bias(
        "az_bias",
        "m/s2",
        meaning,
        airspeed * (ramp - gyro[0]),
        airspeed * float(np.hypot(std, gyro[1])),
        best,
    )


def _average(values: Array, stds: Array) -> tuple[float, float]:
    """Mean weighted by precision; its standard error allows for a spread beyond the stated ones."""
    weight = 1.0 / np.maximum(stds, 1e-300) ** 2
    mean = float(weight @ values / weight.sum())
    spread = float(weight @ (values - mean) ** 2) / max(len(values) - 1, 1)
    return mean, float(np.sqrt(max(spread, 1.0) / weight.sum()))


__all__ = ["check_kinematics", "declared_errors"]
