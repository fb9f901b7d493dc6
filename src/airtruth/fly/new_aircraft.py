"""A new aircraft from derivatives or estimates, written, trimmed and linearised again."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from airtruth import aircraft as planes
from airtruth.effects.new_aircraft import from_estimates, trim_point, write_new
from airtruth.effects.new_aircraft_xml import TrimPoint
from airtruth.errors import ConfigurationError, choices
from airtruth.fly.engine import Condition
from airtruth.fly.linearise import linearise
from airtruth.fly.trim import trim
from airtruth.logs.store import read_log, read_table
from airtruth.logs.validate import validate
from airtruth.physics import atmosphere
from airtruth.physics.short_period import PARAMETERS
from airtruth.quantity import Quantity
from airtruth.units import DEG


def make(
    aircraft: str | Path,
    out: Path,
    estimates: Path | None,
    method: str | None,
    stated: Sequence[str],
    log: Path | None,
    at: tuple[float | None, float | None, float, float],
) -> str:
    """Write the aircraft, and say what JSBSim makes of it.

    Parameters
    ----------
    aircraft : folder or name; out : folder to write.
    estimates, method : table of estimates and which method of it; None for the aircraft's [derivatives].
    stated : NAME=VALUE in place of those.
    log : flight log whose start is the trim; None to take ``at``.
    at : true airspeed [m/s], pressure altitude [m], alpha and elevator [deg] of the trim.

    Raises
    ------
    ConfigurationError, AircraftError, StoreError, LogError, TrimError
        Saying what is wrong, and what to do.
    """
    plane = planes.load(aircraft)
    derivatives = dict(plane.file.derivatives)
    if estimates is not None:
        derivatives |= from_estimates(read_table(estimates), method)
    derivatives |= dict(_stated(text) for text in stated)
    point = _from_log(log) if log is not None else _given(*at)
    note = f"Trim: {point.airspeed_m_s:.6g} m/s, {point.density_kg_m3:.6g} kg/m3, alpha {point.alpha_rad:.6g} rad."
    written = write_new(plane, derivatives, point, out, note)
    height = float(atmosphere.altitude_of_density_m(point.density_kg_m3))
    eas = float(atmosphere.equivalent_airspeed_m_s(point.airspeed_m_s, point.density_kg_m3))
    found = trim(written, Condition(eas, height, 0.0))
    flown = linearise(written, found)
    lines = [
        f"{out}: {written.name}, trimmed at {found.airspeed_m_s:.4g} m/s, {height:.0f} m, "
        f"alpha {found.alpha_rad / DEG:.3f} deg, elevator {found.elevator_rad / DEG:.3f} deg",
        f"short period {flown.wn_rad_s:.4g} rad/s, damping {flown.zeta:.3f}",
        "          written       flown",
    ]
    for name, value in zip(PARAMETERS, flown.central, strict=True):
        lines.append(f"{name:8s} {derivatives[name].value:10.5g}  {value:10.5g}")
    return "\n".join(lines)


def _stated(text: str) -> tuple[str, Quantity]:
    name, _, value = text.partition("=")
    if name not in PARAMETERS:
        raise ConfigurationError(f"--derivative {text!r}: {choices(name, PARAMETERS)}")
    try:
        number = float(value)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise ConfigurationError(f"--derivative {text!r}: write NAME=VALUE, for example Cmalpha=-1.2")
    return name, Quantity(value=number, source="stated")


def _from_log(path: Path) -> TrimPoint:
    log = read_log(path)
    validate(log, source=str(path))
    return trim_point(log)


def _given(
    airspeed_m_s: float | None, altitude_m: float | None, alpha_deg: float, elevator_deg: float
) -> TrimPoint:
    if airspeed_m_s is None or altitude_m is None:
        raise ConfigurationError("the trim: give --log LOG, or --airspeed-m-s and --altitude-m")
    density = float(atmosphere.density_kg_m3(altitude_m))
    if not math.isfinite(density):
        raise ConfigurationError(f"--altitude-m {altitude_m:g}: has to be between -5000 and 20000")
    return TrimPoint(airspeed_m_s, density, alpha_deg * DEG, elevator_deg * DEG)
