"""Is a mapping possible? A log held against gravity, plausible sizes, the atmosphere and kinematics."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from airtruth.logs.flight_log import FlightLog
from airtruth.logs.importers.mistakes import Mistake, Problem, nearest
from airtruth.logs.importers.motion import attitude, elevator_sign, path
from airtruth.physics.atmosphere import density_kg_m3
from airtruth.units import DEG, FT, G0, SLUG

_AZ: Final = (
    Mistake(-1.0, "gravity with the other sign", "sign = -1"),
    Mistake(1.0 / G0, "g in place of m/s2", 'unit = "g"'),
    Mistake(-1.0 / G0, "g in place of m/s2, and the other sign", 'unit = "g" and sign = -1'),
    Mistake(1.0 / FT, "ft/s2 in place of m/s2", 'unit = "ft_s2"'),
    Mistake(-1.0 / FT, "ft/s2 in place of m/s2, and the other sign", 'unit = "ft_s2" and sign = -1'),
    Mistake(G0, "m/s2 stated as g", 'unit = "m_s2"'),
    Mistake(-G0, "m/s2 stated as g, and the other sign", 'unit = "m_s2" and sign = -1'),
)


def problems(log: FlightLog) -> list[Problem]:
    """Everything in a log that physics contradicts; what cannot be judged is left alone.

    Parameters
    ----------
    log : runs with uniform times; channels may break the limits of the contract.
    """
    found = [*_gravity(log), *_magnitudes(log), *_air(log)]
    if any(p.certain and p.channel in ("az_m_s2", "alpha_rad", "q_rad_s", "theta_rad") for p in found):
        return found  # kinematics would only repeat it
    for law in (attitude, path, elevator_sign):
        found += law(log)
        if any(p.certain and p.channel != "altitude_m" for p in found):
            break  # the next law would find the same mistake again
    return found


def _gravity(log: FlightLog) -> Iterator[Problem]:
    az = log.channels.get("az_m_s2")
    if az is None:
        return
    mean = float(np.mean(az))
    ax = log.channels.get("ax_m_s2")
    if abs(mean) < 0.3 * G0 and ax is not None and abs(abs(np.mean(ax)) - G0) < 0.3 * G0:
        yield Problem(
            True, "az_m_s2", f"az_m_s2 averages {mean:.3g} m/s2 and ax_m_s2 {np.mean(ax):.3g}: swapped axes; "
            "exchange the columns of the two"
        )  # fmt: skip
        return
    ratio = mean / -G0
    mistake = nearest(ratio, _AZ)
    if mistake:
        yield Problem(
            True, "az_m_s2", f"az_m_s2 averages {mean:.3g} m/s2 where flight has about {-G0:.1f}: {mistake.found}; "
            f"set channels.az_m_s2 {mistake.remedy}"
        )  # fmt: skip
    elif not 0.5 < ratio < 2.0:
        what = (
            "gravity was taken out (add offset), or it is another axis"
            if abs(ratio) < 0.5
            else "a wrong unit"
        )
        yield Problem(
            abs(ratio) < 0.2 or ratio < 0.0 or ratio > 5.0, "az_m_s2",
            f"az_m_s2 averages {mean:.3g} m/s2 where flight has about {-G0:.1f}: {what}; correct channels.az_m_s2",
        )  # fmt: skip


def _magnitudes(log: FlightLog) -> Iterator[Problem]:
    for name, most in (
        ("alpha_rad", 1.6),
        ("theta_rad", 1.6),
        ("elevator_rad", 45.0 * DEG),
        ("elevator_command_rad", 1.6),
    ):
        values = log.channels.get(name)
        if values is not None and (peak := float(np.abs(values).max())) > most:
            yield Problem(
                True, name, f"{name} reaches {peak:.3g} rad ({peak / DEG:.0f} deg): degrees taken as radians; "
                f'set channels.{name} unit = "deg"'
            )  # fmt: skip
    q = log.channels.get("q_rad_s")
    if q is not None and (peak := float(np.abs(q).max())) > 10.0:
        yield Problem(
            True, "q_rad_s", f"q_rad_s reaches {peak:.3g} rad/s: degrees taken as radians; "
            'set channels.q_rad_s unit = "deg_s"'
        )  # fmt: skip
    elevator = log.channels.get("elevator_rad")
    if (
        elevator is not None
        and 0.0 < np.ptp(elevator) < 0.05 * DEG
        and q is not None
        and np.ptp(q) > 2.0 * DEG
    ):
        yield Problem(
            False, "elevator_rad", f"elevator_rad moves by {np.ptp(elevator) / DEG:.2g} deg in all while the aircraft "
            'pitches: radians taken as degrees? then set channels.elevator_rad unit = "rad"'
        )  # fmt: skip
    airspeed = log.channels.get("airspeed_m_s")
    if airspeed is not None and not 5.0 < float(np.median(airspeed)) < 700.0:
        yield Problem(
            False,
            "airspeed_m_s",
            f"airspeed_m_s has a median of {np.median(airspeed):.3g} m/s; check its unit",
        )


def _air(log: FlightLog) -> Iterator[Problem]:
    density, altitude = log.channels.get("density_kg_m3"), log.channels.get("altitude_m")
    if density is not None:
        mean = float(np.mean(density))
        if nearest(mean, (Mistake(1.0 / SLUG * FT**3, "", ""),)) or mean < 0.004:
            yield Problem(
                True, "density_kg_m3", f"density_kg_m3 averages {mean:.3g} kg/m3: slug/ft3 taken as kg/m3; "
                'set channels.density_kg_m3 unit = "slug_ft3"'
            )  # fmt: skip
            return
        if not 0.01 < mean < 1.5:
            yield Problem(
                mean > 2.0, "density_kg_m3", f"density_kg_m3 averages {mean:.3g} kg/m3; check its unit"
            )
    if altitude is None:
        return
    height = float(np.mean(altitude))
    if not -500.0 < height < 30000.0:
        yield Problem(
            True, "altitude_m", f"altitude_m averages {height:.5g} m: feet taken as metres? "
            'set channels.altitude_m unit = "ft"'
        )  # fmt: skip
    elif density is not None:
        standard = float(density_kg_m3(np.array([height]))[0])
        if abs(mean / standard - 1.0) > 0.3:
            other = float(density_kg_m3(np.array([height * FT]))[0])
            feet = abs(mean / other - 1.0) < 0.15
            sentence = f"density_kg_m3 averages {mean:.3g} where {height:.5g} m has {standard:.3g} kg/m3"
            remedy = (
                'feet taken as metres? set channels.altitude_m unit = "ft"' if feet else "check both units"
            )
            yield Problem(feet, "altitude_m", f"{sentence}: {remedy}")


__all__ = ["Problem", "problems"]
