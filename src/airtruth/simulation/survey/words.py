"""Findings of a survey, as lines of its report and as campaigns."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from airtruth.simulation.manoeuvres import LATERAL_CONTROLS
from airtruth.simulation.survey.envelope import STIFFNESS, EnvelopeRow, FlightTest
from airtruth.simulation.survey.lateral_flight import LateralTest
from airtruth.units import DEG, FT, KT

REPORT: Final = "SURVEY.txt"
"""Name of the report in the folder."""
_TURN: Final = (1.6, 0.3, 1.2)
"""Step of a manoeuvre: turn of the short period in it [rad], shortest and longest step [s] (judgement)."""


def rows(facts: Mapping[str, Any]) -> tuple[str, ...]:
    """Lines of the envelope."""
    return tuple(_row(EnvelopeRow(**row)) for row in facts["envelope"])


def _row(row: EnvelopeRow) -> str:
    text = f"{row.altitude_m / FT:6.0f} ft: {row.trimmed} of {row.tried} speeds trimmed"
    if not row.trimmed:
        return text
    slow, fast = (v / KT for v in row.eas_m_s)
    alpha = " to ".join(f"{a / DEG:.1f}" for a in row.alpha_rad)
    if any(row.throttle):
        lever = "throttle " + " to ".join(f"{x:.2f}" for x in row.throttle)
    else:
        lever = "flight path " + " to ".join(f"{x / DEG:.1f}" for x in row.gamma_rad) + " deg"
    return f"{text}, {slow:.0f} to {fast:.0f} kt EAS, alpha {alpha} deg, {lever}"


def flight(facts: Mapping[str, Any]) -> tuple[str, ...]:
    """Lines of the first condition."""
    at = facts["condition"]
    if at is None:
        return ()
    test = FlightTest(**facts["flight"])
    derivatives = ", ".join(f"{name} {value:.4g}" for name, value in test.derivatives.items())
    lines = [
        f"{at['eas_m_s'] / KT:.1f} kt EAS, {at['altitude_m'] / FT:.0f} ft, flight path {at['gamma_rad'] / DEG:.2f} deg",
        derivatives,
        f"short period {test.wn_rad_s:.3g} rad/s, damping {test.zeta:.2f}",
    ]
    if test.alpha_range_deg:
        still, moved = test.alpha_range_deg
        lines.append(
            f"{test.duration_s:g} s with fixed controls: alpha moves {still:.2g} deg; with a doublet of "
            f"{test.amplitude_deg:g} deg {moved:.2g} deg"
        )
    if test.derivatives[STIFFNESS] > 0.0:
        lines.append(
            f"the aircraft is unstable at every airspeed that was trimmed at this altitude ({STIFFNESS} above 0)"
        )
    if test.fault:
        lines.append(f"another record fails: {test.fault}")
    return tuple(lines)


def campaign(name: str, facts: Mapping[str, Any]) -> str:
    """A campaign at the first condition."""
    at, test = facts["condition"], FlightTest(**facts["flight"])
    wn, duration, amplitude = test.wn_rad_s, test.duration_s, test.amplitude_deg
    turn, shortest, longest = _TURN
    step = longest if not wn > 0.0 else min(max(turn / wn, shortest), longest)
    return f"""# Six records in light turbulence at the first condition of {REPORT}; every key: docs/campaigns.md
schema = 1
name = "{name}"
title = "{name}: doublets and 3-2-1-1 in light turbulence"
aircraft = "aircraft.toml" # beside this file
runs = 6
seed = 1
duration_s = {duration:g}

[condition]
eas_m_s = {at["eas_m_s"]:.6g}
altitude_m = {at["altitude_m"]:.6g}
flight_path_deg = {at["gamma_rad"] / DEG:.6g}

[[manoeuvre]]
kind = "doublet"
amplitude_deg = {amplitude:g}
start_s = 1.0
step_s = {step:.2f}

[[manoeuvre]]
kind = "3211"
amplitude_deg = {0.8 * amplitude:g}
start_s = 1.0
step_s = {0.6 * step:.2f}

[gust]
figures = "mil-f-8785c"
level = "light"
"""


def lateral(facts: Mapping[str, Any]) -> tuple[str, ...]:
    """Lines of the flight in six axes; none where it was not tried."""
    if facts["lateral_flight"] is None:
        return ()
    test = LateralTest(**facts["lateral_flight"])
    if not test.straight:
        return (f"no straight flight in six axes: {test.fault}",)
    assert test.derivatives is not None
    assert test.modes is not None
    trimmed = (
        ("sideslip", test.beta_deg),
        ("bank", test.phi_deg),
        *test.surfaces_deg.items(),
    )
    where = "wings level" if test.straight == "wings-level" else "no sideslip"
    lines = [
        f"{where}: " + ", ".join(f"{name} {round(value, 2) + 0.0:.2f} deg" for name, value in trimmed),
        ", ".join(f"{name} {round(value, 6) + 0.0:.4g}" for name, value in test.derivatives.items()),
        ", ".join(f"{name} {value:.3g}" for name, value in test.modes.items()),
    ]
    if test.range_deg:
        beta, phi = test.range_deg
        sizes = zip(test.amplitude_deg, LATERAL_CONTROLS, strict=True)
        doublets = " and ".join(f"{size_deg:g} deg {name}" for size_deg, name in sizes)
        lines.append(
            f"{test.duration_s:g} s with doublets of {doublets}: sideslip moves {beta:.2g} deg, bank {phi:.2g} deg"
        )
    else:
        lines.append(f"no record with doublets of {' and '.join(LATERAL_CONTROLS)}: {test.fault}")
    return tuple(lines)


def lateral_campaign(name: str, facts: Mapping[str, Any]) -> str:
    """A campaign of doublets of aileron and rudder; "" where no record with them keeps to its range."""
    at, found = facts["condition"], facts["lateral_flight"]
    test = None if found is None else LateralTest(**found)
    if test is None or not test.range_deg:
        return ""
    starts = ("1.0", f"{0.5 * test.duration_s:g}")
    inputs = [
        *zip(("manoeuvre", "manoeuvre.also"), LATERAL_CONTROLS, test.amplitude_deg, starts, strict=True)
    ]
    signs = "".join(
        f"""
[[{table}]]
control = "{control}"
kind = "doublet"
amplitude_deg = {sign * size_deg:g}
start_s = {start}
step_s = {test.step_s:g}
"""
        for sign in (1.0, -1.0)
        for table, control, size_deg, start in inputs
    )
    return f"""# Six records in six axes in light turbulence at the first condition of {REPORT}; every key: docs/campaigns.md
schema = 1
name = "{name}-lateral"
title = "{name}: doublets of aileron and rudder in light turbulence"
aircraft = "aircraft.toml" # beside this file
runs = 6
seed = 1
duration_s = {test.duration_s:g}

[condition]
eas_m_s = {at["eas_m_s"]:.6g}
altitude_m = {at["altitude_m"]:.6g}
flight_path_deg = {at["gamma_rad"] / DEG:.6g}
straight = "{test.straight}"
{signs}
[gust]
figures = "mil-f-8785c"
level = "light"
"""


__all__ = ["REPORT", "campaign", "flight", "lateral", "lateral_campaign", "rows"]
