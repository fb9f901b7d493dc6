"""Where a model can fly: trims over altitudes and airspeeds, and a flight from one of them."""

from __future__ import annotations

import re
import time
from dataclasses import dataclass
from typing import Final

import numpy as np

from airtruth.aircraft import Aircraft
from airtruth.errors import FlightError, TrimError
from airtruth.physics.expected import EXPECTED
from airtruth.physics.motion import LONGITUDINAL
from airtruth.simulation.flight import Flight, Inputs
from airtruth.simulation.linearise import linearise
from airtruth.simulation.simulator import Condition
from airtruth.simulation.survey.bench import STEP_S, ModelBench, eas_of
from airtruth.simulation.trim import Trim, trim
from airtruth.units import DEG

ALTITUDES_M: Final = (1500.0, 4000.0, 8000.0)
"""Altitudes of the envelope in the order of the trims [m] (judgement: from the pattern to the cruise of a jet)."""
LIFTS: Final = (0.45, 0.3, 0.2, 0.13, 0.7, 1.0, 1.4)
"""Lift coefficients whose airspeeds are trimmed, from the middle to the fast end, then to the slow end [-]
(judgement)."""
_MIDDLE: Final = 4
"""Number of lift coefficients before the slow ones [-]."""
_TIME_S: Final = 90.0
"""Time after which no further altitude is begun [s] (judgement: a user still waits)."""
_ALPHA_RAD: Final = 4.0 * DEG
"""Angle of attack of the condition that is proposed for a first flight, if there is a choice [rad] (judgement: away
from the stall and from zero lift)."""
STIFFNESS: Final = EXPECTED[LONGITUDINAL.name].stiffness
"""Derivative by which an aircraft is stable or not."""
_SLACK_DEG: Final = 4.0
"""Amplitude of the doublet where slack holds the surface [deg] (judgement: twice the slack of a light aircraft's cables)."""
_FOLLOWS: Final = 0.5
"""Share of a doublet that the surface has to follow [-] (judgement)."""
_RECORDS: Final = ((10.0, 1.5), (10.0, _SLACK_DEG), (6.0, 0.5), (4.0, 0.2))
"""Records that are tried: duration [s] and amplitude of the doublet [deg] (judgement: shorter and smaller for an unstable
aircraft)."""
_MOST_RANGE_DEG: Final = 20.0
"""Largest range of the angle of attack in a sound record [deg] (judgement)."""
_LIMIT: Final = re.compile(r"limit of ([a-z ]+?)(?:\.| and)")
"""The limit that a trim names."""


@dataclass(frozen=True)
class Point:
    """One attempt to trim.

    Attributes
    ----------
    altitude_m, eas_m_s : condition.
    trim : None where there is none; reason : why.
    """

    altitude_m: float
    eas_m_s: float
    trim: Trim | None
    reason: str = ""


@dataclass(frozen=True)
class EnvelopeRow:
    """Trims at one altitude; pairs are at the slow and the fast end, empty without any.

    Attributes
    ----------
    altitude_m : altitude [m].
    tried, trimmed : numbers of airspeeds.
    eas_m_s, alpha_rad, throttle, gamma_rad : airspeed [m/s], angle of attack [rad], lever [-], flight path [rad].
    """

    altitude_m: float
    tried: int
    trimmed: int
    eas_m_s: tuple[float, ...]
    alpha_rad: tuple[float, ...]
    throttle: tuple[float, ...]
    gamma_rad: tuple[float, ...]


@dataclass(frozen=True)
class FlightTest:
    """An aircraft at its first condition.

    Attributes
    ----------
    derivatives : by the names of ``LONGITUDINAL.parameters`` [1/rad].
    wn_rad_s, zeta : short period [rad/s], [-].
    duration_s, amplitude_deg : record and doublet in which it keeps to its range [s], [deg]; 0 for none.
    alpha_range_deg : range of the angle of attack in it, without input and with the doublet [deg].
    fault : why longer records or larger doublets fail; "" if they do not.
    """

    derivatives: dict[str, float]
    wn_rad_s: float
    zeta: float
    duration_s: float
    amplitude_deg: float
    alpha_range_deg: tuple[float, ...]
    fault: str


def envelope_of(bench: ModelBench) -> list[Point]:
    """Trim from the middle of the speeds to both ends, at one altitude after the other; each end stops after a failure.

    A trim starts from its neighbour; without any, from the usual starts.
    """
    aircraft, began = bench.aircraft, time.monotonic()
    points: list[Point] = []
    below: Trim | None = None
    for altitude in ALTITUDES_M:
        if points and time.monotonic() - began > _TIME_S:
            break
        here: list[Point] = []
        for lifts in (LIFTS[:_MIDDLE], LIFTS[_MIDDLE:]):
            near = next((p.trim for p in here if p.trim), below)
            for lift in lifts:
                point = _point(aircraft, altitude, eas_of(bench.constants, lift), near)
                here.append(point)
                if point.trim is None and near is not None:
                    break
                near = point.trim or near
        points += here
        below = next((p.trim for p in here if p.trim), None)
        if below is None:
            break
    return points


def _point(aircraft: Aircraft, altitude_m: float, eas_m_s: float, near: Trim | None) -> Point:
    try:
        return Point(altitude_m, eas_m_s, trim(aircraft, Condition(eas_m_s, altitude_m), near=near))
    except TrimError as error:
        return Point(altitude_m, eas_m_s, None, str(error))


def first_condition(aircraft: Aircraft, points: list[Point]) -> Trim | None:
    """The trim for a first flight: at the first altitude that has one, the angle of attack nearest to 4 deg that is stable.

    Where none is stable, that with the least Cmalpha.
    """
    for altitude in ALTITUDES_M:
        trims = [p.trim for p in points if p.trim is not None and p.altitude_m == altitude]
        trims.sort(key=lambda t: abs(t.alpha_rad - _ALPHA_RAD))
        slopes: list[float] = []
        for at in trims:
            slopes.append(float(linearise(aircraft, at).central[LONGITUDINAL.index(STIFFNESS)]))
            if slopes[-1] < 0.0:
                return at
        if trims:
            return trims[int(np.argmin(slopes))]
    return None


def flown(aircraft: Aircraft, at: Trim) -> FlightTest:
    """Derivatives at a trim, and the longest record with the largest doublet in which the aircraft keeps to its range.

    Where slack or hysteresis holds the surface, a larger doublet is tried.
    """
    linear = linearise(aircraft, at)
    derivatives = dict(zip(LONGITUDINAL.parameters, linear.central.tolist(), strict=True))
    fault, slack = "", False
    for seconds, amplitude_deg in _RECORDS:
        if amplitude_deg == _SLACK_DEG and not slack:
            continue
        try:
            still, _ = _ranges_deg(aircraft, at, seconds, 0.0)
            moved, surface = _ranges_deg(aircraft, at, seconds, amplitude_deg)
        except FlightError as error:
            fault = fault or str(error)
            continue
        slack = surface < _FOLLOWS * 2.0 * amplitude_deg and amplitude_deg < _SLACK_DEG
        if slack:
            fault = f"a doublet of {amplitude_deg:g} deg moves the surface by {0.5 * surface:.2g} deg: slack in the controls"
        elif max(still, moved) <= _MOST_RANGE_DEG:
            return FlightTest(
                derivatives,
                linear.modes["wn_rad_s"],
                linear.modes["zeta"],
                seconds,
                amplitude_deg,
                (still, moved),
                fault,
            )
        else:
            fault = fault or f"the angle of attack moves by {max(still, moved):.0f} deg in {seconds:g} s"
    return FlightTest(derivatives, linear.modes["wn_rad_s"], linear.modes["zeta"], 0.0, 0.0, (), fault)


def _ranges_deg(aircraft: Aircraft, at: Trim, seconds: float, amplitude_deg: float) -> tuple[float, float]:
    """Ranges of the angle of attack and of the surface in a doublet that starts at 1 s [deg]."""
    steps, half = round(seconds / STEP_S), round(0.5 / STEP_S)
    command, still = np.zeros(steps + 1), np.zeros(steps + 1)
    command[2 * half : 3 * half] = amplitude_deg * DEG
    command[3 * half : 4 * half] = -amplitude_deg * DEG
    channels = Flight(aircraft, at, STEP_S, 4).fly(Inputs(command, still, still))
    alpha, surface = (
        float(np.ptp(channels[name])) / DEG for name in (LONGITUDINAL.vane, *LONGITUDINAL.surfaces)
    )
    return alpha, surface


def cause(points: list[Point], feedback: bool) -> str:
    """Why no point of an envelope has a trim: augmentation that no property switches off, or the limits that trims met."""
    if feedback:
        return (
            "the fly-by-wire of the model moves the surface at a held command and no property switches it off, so that no "
            f"state is at rest; {points[0].reason}"
        )
    limits = [found for p in points if (found := _LIMIT.findall(p.reason))]
    named = [name for found in limits for name in found]
    if not named:
        return points[-1].reason if points else "nothing was tried"
    most = max(set(named), key=named.count)
    reasons = {
        "throttle": "the thrust does not balance the drag at any speed",
        "flight path": "no glide between 30 deg down and 5 deg up is steady",
        "elevator command": "the elevator does not balance the pitching moment",
        "angle of attack": "no angle of attack up to 40 deg carries the weight",
    }
    return (
        reasons.get(most, f"the {most} is not enough to hold the aircraft straight") + f"; {points[0].reason}"
    )


def summary_rows(points: list[Point]) -> list[EnvelopeRow]:
    """One row per altitude, lowest first."""
    rows = []
    for altitude in sorted({p.altitude_m for p in points}):
        here = sorted((p for p in points if p.altitude_m == altitude), key=lambda p: p.eas_m_s)
        good = [p.trim for p in here if p.trim is not None]
        ends = [good[0], good[-1]] if good else []
        rows.append(
            EnvelopeRow(
                altitude_m=altitude,
                tried=len(here),
                trimmed=len(good),
                eas_m_s=tuple(t.condition.eas_m_s for t in ends),
                alpha_rad=tuple(t.alpha_rad for t in ends),
                throttle=tuple(t.controls.throttle for t in ends),
                gamma_rad=tuple(t.condition.gamma_rad for t in ends),
            )
        )
    return rows


__all__ = [
    "EnvelopeRow",
    "FlightTest",
    "Point",
    "cause",
    "envelope_of",
    "first_condition",
    "flown",
    "summary_rows",
]
