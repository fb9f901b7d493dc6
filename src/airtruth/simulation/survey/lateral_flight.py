"""A flight in six axes from the first condition of a surveyed model: trim, derivatives, doublets of aileron and rudder."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from airtruth.aircraft import Aircraft
from airtruth.channels import BANK
from airtruth.errors import FlightError, TrimError
from airtruth.physics.motion import LATERAL, LONGITUDINAL
from airtruth.simulation.flight import Flight, Inputs, LateralInputs
from airtruth.simulation.linearise import linearise
from airtruth.simulation.manoeuvres import LATERAL_CONTROLS, Manoeuvre, sample
from airtruth.simulation.simulator import Straight, jsbsim_model
from airtruth.simulation.survey.bench import STEP_S
from airtruth.simulation.trim import Trim, trim
from airtruth.units import DEG

_WAYS: Final[tuple[Straight, ...]] = ("wings-level", "no-sideslip")
"""Straight flights that are tried."""
_AMPLITUDES_DEG: Final = (5.0, 3.0, 1.5, 0.5, 0.2)
"""Amplitudes of the doublets that are tried [deg] (judgement: smaller for an aircraft that rolls or yaws fast)."""
_STICK: Final = 0.5
"""Largest doublet over the travel of the stick, from -1 to 1 [-] (judgement: the trim needs a part of it)."""
_TURN: Final = (1.6, 0.3, 1.2)
"""Step of a doublet: turn of the Dutch roll in it [rad], shortest and longest step [s] (judgement)."""
_START_S: Final = 1.0
"""Start of the doublet of the aileron [s]; that of the rudder starts in the middle of the record."""
_SECONDS: Final = (12.0, 6.0, 4.0)
"""Lengths of the record with both doublets that are tried [s] (judgement: shorter for an aircraft that is unstable in pitch)."""
_FOLLOWS: Final = 0.2
"""Share of a doublet that the surface has to follow [-] (judgement: feedback may take most of it)."""
_MOST: Final = {BANK: 45.0 * DEG, LATERAL.vane: 12.0 * DEG, LONGITUDINAL.vane: 10.0 * DEG}
"""Largest departures from the trim in a sound record [rad] (judgement: inside the range of most tables)."""


@dataclass(frozen=True)
class LateralTest:
    """A surveyed aircraft in six axes.

    Attributes
    ----------
    straight : how it is trimmed; "" without a trim.
    beta_deg, phi_deg : of the trim [deg]; surfaces_deg : control -> its surface [deg].
    derivatives, modes : by the names of ``LATERAL``.
    amplitude_deg : of the doublets of aileron and rudder [deg].
    step_s, duration_s : of the doublets and of the record [s].
    range_deg : range of sideslip and bank in the record [deg]; empty if it does not keep to its range.
    fault : why it cannot fly; "" if it can.
    """

    straight: str = ""
    beta_deg: float = 0.0
    phi_deg: float = 0.0
    surfaces_deg: Mapping[str, float] = field(default_factory=dict)
    derivatives: dict[str, float] | None = None
    modes: dict[str, float] | None = None
    amplitude_deg: tuple[float, ...] = ()
    step_s: float = 0.0
    duration_s: float = 0.0
    range_deg: tuple[float, ...] = ()
    fault: str = ""


def flown_laterally(aircraft: Aircraft, at: Trim) -> LateralTest:
    """Trim in six axes at the condition of a trim in the pitch plane, and fly doublets of aileron and rudder.

    Parameters
    ----------
    aircraft : with aileron and rudder; at : its trim in the pitch plane.
    """
    found, fault = _trimmed(aircraft, at)
    if found is None:
        return LateralTest(fault=fault)
    try:
        linear = linearise(aircraft, found, motion=LATERAL)
    except TrimError as error:
        return LateralTest(fault=str(error))
    turn, shortest, longest = _TURN
    wn = linear.modes[LATERAL.modal[0]]
    step_s = round(min(max(turn / wn, shortest), longest) if wn > 0.0 else longest, 2)
    c = found.controls
    known = LateralTest(
        straight=found.condition.straight,
        beta_deg=c.of(LATERAL.vane) / DEG,
        phi_deg=c.of(BANK) / DEG,
        surfaces_deg={name: found.surfaces_rad[name] / DEG for name in LATERAL_CONTROLS},
        derivatives=dict(zip(LATERAL.parameters, linear.central.tolist(), strict=True)),
        modes=dict(linear.modes),
    )
    for seconds in _SECONDS:
        test = replace(known, duration_s=seconds, step_s=min(step_s, 0.5 * (0.5 * seconds - _START_S)))
        for amplitude_deg in _AMPLITUDES_DEG:
            test = replace(test, amplitude_deg=_bounded(aircraft, amplitude_deg))
            try:
                ranges, fault = _ranges(aircraft, found, test)
            except FlightError as error:
                fault = str(error)
                continue
            if not fault:
                return replace(test, range_deg=ranges)
    return replace(known, fault=fault)


def _trimmed(aircraft: Aircraft, at: Trim) -> tuple[Trim | None, str]:
    fault = ""
    for straight in _WAYS:
        try:
            return trim(aircraft, replace(at.condition, straight=straight)), ""  # as a campaign trims
        except TrimError as error:
            fault = fault or str(error)
    return None, fault


def _bounded(aircraft: Aircraft, amplitude_deg: float) -> tuple[float, ...]:
    """Amplitudes of aileron and rudder within the travel of the stick [deg]."""
    surfaces = jsbsim_model(aircraft).surfaces(LATERAL).values()
    limits = (_STICK / abs(surface.command_per_rad) / DEG for surface in surfaces)
    return tuple(float(f"{min(amplitude_deg, limit):.2g}") for limit in limits)


def _ranges(aircraft: Aircraft, at: Trim, test: LateralTest) -> tuple[tuple[float, ...], str]:
    """Ranges of sideslip and bank in a record with both doublets [deg], and what leaves its range."""
    t = np.arange(round(test.duration_s / STEP_S) + 1, dtype=np.float64) * STEP_S
    still = np.zeros_like(t)
    doublets = [
        sample(Manoeuvre("doublet", a * DEG, start_s=start, step_s=test.step_s), t)
        for a, start in zip(test.amplitude_deg, (_START_S, 0.5 * test.duration_s), strict=True)
    ]
    lateral = LateralInputs(dict(zip(LATERAL_CONTROLS, doublets, strict=True)))
    flight = Flight(aircraft, at, STEP_S, 4)
    flown = flight.fly(Inputs(still, still, still, lateral=lateral))
    for name, most in _MOST.items():
        away = float(np.abs(flown[name] - flown[name][0]).max())
        if away > most:
            return (), f"{name.removesuffix('_rad')} moves by {away / DEG:.0f} deg in {test.duration_s:g} s"
    for control, amplitude_deg in zip(LATERAL.controls, test.amplitude_deg, strict=True):
        moved_deg = float(np.ptp(flown[control.channel])) / DEG
        if moved_deg < _FOLLOWS * 2.0 * amplitude_deg:
            return (), f"a doublet of {amplitude_deg:g} deg moves the {control.name} by {moved_deg:.2g} deg"
    return tuple(float(np.ptp(flown[name])) / DEG for name in (LATERAL.vane, BANK)), ""


__all__ = ["LateralTest", "flown_laterally"]
