"""A new aircraft from derivatives or estimates: written, trimmed and linearised in JSBSim."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from airtruth.aircraft import Aircraft, load
from airtruth.aircraft.create import TrimPoint, from_estimates, trim_point, write_new
from airtruth.errors import ConfigurationError, TrimError, choices
from airtruth.logs.atomic import remove_folder
from airtruth.logs.store import read_log, read_table
from airtruth.logs.tables import Kind, require_kinds
from airtruth.logs.validate import validate
from airtruth.physics import atmosphere
from airtruth.physics.late_surface import shift_of_a_delay
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.short_period import scale_of
from airtruth.quantity import Quantity
from airtruth.simulation.linearise import Linearisation
from airtruth.simulation.resolution import trimmed_and_linear
from airtruth.simulation.simulator import Condition
from airtruth.simulation.trim import Trim
from airtruth.units import DEG, G0


@dataclass(frozen=True)
class NewAircraft:
    """An aircraft that was written from derivatives, and its motion in JSBSim.

    Attributes
    ----------
    aircraft : as written and read back.
    derivatives : as written, by the names of ``LONGITUDINAL.parameters`` [1/rad].
    trim : its trim in JSBSim.
    linear : derivatives and modes of the written model at that trim.
    """

    aircraft: Aircraft
    derivatives: Mapping[str, Quantity]
    trim: Trim
    linear: Linearisation

    def summary(self) -> str:
        """Trim, modes, and the derivatives as written and as flown."""
        at, linear = self.trim, self.linear
        lines = [
            f"{self.aircraft.folder}: {self.aircraft.name}, trimmed at {at.airspeed_m_s:.4g} m/s, "
            f"{at.condition.altitude_m:.0f} m, "
            f"alpha {at.alpha_rad / DEG:.3f} deg, elevator {at.elevator_rad / DEG:.3f} deg",
            "short period {:.4g} rad/s, damping {:.3f}".format(*linear.modes.values()),
            "          written       flown",
        ]
        for name, value in zip(LONGITUDINAL.parameters, linear.central, strict=True):
            lines.append(f"{name:8s} {self.derivatives[name].value:10.5g}  {value:10.5g}")
        return "\n".join(lines)


def new_aircraft(
    aircraft: str | Path, out: Path, at: TrimPoint, derivatives: Mapping[str, Quantity] | None = None
) -> NewAircraft:
    """Write an aircraft that flies six derivatives about a trim, and fly it there.

    Parameters
    ----------
    aircraft : folder or name of the aircraft that geometry, mass, actuator and sensors come from.
    out : folder to write, new or empty.
    at : trim about which the derivatives hold.
    derivatives : instead of those that the aircraft declares, some or all [1/rad].

    Raises
    ------
    ConfigurationError
        If a derivative is missing or unknown, or the trim is not physical.
    AircraftError
        If the aircraft does not exist or cannot be loaded.
    StoreError
        If the folder is not empty or cannot be written.
    TrimError
        If the written aircraft cannot be trimmed.
    """
    source = load(aircraft)
    values = {**source.file.derivatives, **(derivatives or {})}
    note = f"Trim: {at.airspeed_m_s:.6g} m/s, {at.density_kg_m3:.6g} kg/m3, alpha {at.alpha_rad:.6g} rad."
    written = write_new(source, values, at, out, note)
    altitude = float(atmosphere.geometric_m(atmosphere.altitude_of_density_m(at.density_kg_m3)))
    eas = float(atmosphere.equivalent_airspeed_m_s(at.airspeed_m_s, at.density_kg_m3))
    try:
        level, linear = trimmed_and_linear(written, Condition(eas, altitude, 0.0))
    except TrimError:
        remove_folder(out)  # new, and of no use
        raise
    return NewAircraft(written, values, level, linear)


def estimated_derivatives(table: Path, method: str | None = None) -> dict[str, Quantity]:
    """Read derivatives from a table of estimates; see `airtruth.aircraft.create.from_estimates`.

    Raises
    ------
    ConfigurationError
        If the method is absent or ambiguous, or no run converged.
    StoreError
        If the table cannot be read.
    """
    frame = read_table(table)
    names = [name + end for name in LONGITUDINAL.parameters for end in ("", "_std")]
    kinds: dict[str, Kind] = {"method": "text", "converged": "flag", **dict.fromkeys(names, "number")}
    require_kinds(table, frame, kinds, "give a file that `airtruth identify` wrote")
    return from_estimates(frame, method)


@dataclass(frozen=True)
class Widened:
    """Estimates whose standard deviations allow for a late elevator.

    Attributes
    ----------
    derivatives : estimates with wider standard deviations [1/rad].
    sentence : how far the delay moves each estimate.
    """

    derivatives: dict[str, Quantity]
    sentence: str


def allowing_for_delay(
    aircraft: str | Path, estimates: Mapping[str, Quantity], at: TrimPoint, delay_s: float
) -> Widened:
    """Add what an undeclared delay of the elevator does to estimates to their standard deviations.

    The delay counts as a normal random number with this standard deviation, so that its shift of each estimate
    (`airtruth.physics.late_surface`) adds in squares.

    Parameters
    ----------
    aircraft : source of mass and geometry.
    estimates : all six derivatives [1/rad].
    at : trim of the records.
    delay_s : standard deviation of the delay [s].

    Raises
    ------
    AircraftError
        If the aircraft does not exist or cannot be loaded.
    ConfigurationError
        If the estimates have no stable short period.
    """
    factors = scale_of(load(aircraft).constants, at.airspeed_m_s, at.density_kg_m3)
    theta = np.array([estimates[name].value for name in LONGITUDINAL.parameters])
    shifts = dict(
        zip(LONGITUDINAL.parameters, shift_of_a_delay(theta, factors, delay_s).tolist(), strict=True)
    )
    widened = {
        name: q.model_copy(update={"std": math.hypot(q.std, shifts[name])}) for name, q in estimates.items()
    }
    moved = ", ".join(f"{name} by {shift:+.3g}" for name, shift in shifts.items())
    return Widened(
        widened,
        f"A delay of the elevator of {1e3 * delay_s:g} ms that is neither declared nor recorded moves these estimates: {moved}; "
        "their standard deviations contain it. `airtruth trace` tells a delay from the derivatives.",
    )


def stated_derivative(text: str) -> tuple[str, Quantity]:
    """Read NAME=VALUE.

    Raises
    ------
    ConfigurationError
        If the name is not a derivative, or the value not a finite number.

    Examples
    --------
    >>> name, value = stated_derivative("Cmalpha=-1.2")
    >>> name, value.value
    ('Cmalpha', -1.2)
    """
    name, _, value = text.partition("=")
    if name not in LONGITUDINAL.parameters:
        raise ConfigurationError(f"--derivative {text!r}: {choices(name, LONGITUDINAL.parameters)}")
    try:
        number = float(value)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise ConfigurationError(f"--derivative {text!r}: write NAME=VALUE, for example Cmalpha=-1.2")
    return name, Quantity(value=number, source="stated")


def logged_trim(path: Path) -> TrimPoint:
    """Read the trim from the first second of a log's runs.

    Raises
    ------
    LogError
        If the log breaks its contract.
    StoreError
        If it cannot be read.
    """
    log = read_log(path)
    validate(log, source=str(path))
    return trim_point(log)


def stated_trim(
    airspeed_m_s: float | None, altitude_m: float | None, alpha_deg: float, elevator_deg: float
) -> TrimPoint:
    """Return a trim in level flight from options of the command line.

    Parameters
    ----------
    airspeed_m_s, altitude_m : true airspeed [m/s] and pressure altitude [m]; both are needed.
    alpha_deg, elevator_deg : angle of attack and elevator [deg].

    Raises
    ------
    ConfigurationError
        If airspeed or altitude is absent, or the altitude outside the standard atmosphere.
    """
    if airspeed_m_s is None or altitude_m is None:
        raise ConfigurationError("the trim: give --log LOG, or --airspeed-m-s and --altitude-m")
    density = float(atmosphere.density_kg_m3(altitude_m))
    if not math.isfinite(density):
        raise ConfigurationError(
            f"--altitude-m {altitude_m:g}: has to be between {atmosphere.LOWEST_M:.0f} and {atmosphere.HIGHEST_M:.0f}"
        )
    alpha = alpha_deg * DEG
    return TrimPoint(airspeed_m_s, density, alpha, elevator_deg * DEG, -G0 * math.cos(alpha))


__all__ = [
    "NewAircraft",
    "Widened",
    "allowing_for_delay",
    "estimated_derivatives",
    "logged_trim",
    "new_aircraft",
    "stated_derivative",
    "stated_trim",
]
