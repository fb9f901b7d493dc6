"""Commented campaign, aircraft and mapping files, which work as written."""

from __future__ import annotations

import math
from importlib import resources
from typing import Final

from airtruth.errors import ConfigurationError, choices

CONDITIONS: Final = {
    "gtm": (75.0, 7000.0, 1.0, "gtm"),
    "c172x": (100.0, 4000.0, 4.0, "mil-f-8785c"),
    "f16": (300.0, 10000.0, 0.5, "mil-f-8785c"),
    "T38": (300.0, 10000.0, 1.0, "mil-f-8785c"),
}
"""Shipped aircraft -> EAS [kt], altitude [ft], amplitude [deg] and gust figures of its template: those of the
campaigns in `data/campaigns`."""


def campaign_text(
    name: str, aircraft: str = "gtm", eas_kt: float | None = None, altitude_ft: float | None = None
) -> str:
    """A commented campaign of six runs in light turbulence.

    Parameters
    ----------
    name : name of the campaign.
    aircraft : shipped name, or folder of an aircraft.
    eas_kt, altitude_ft : equivalent airspeed [kt] and altitude [ft]; a shipped aircraft has defaults.

    Raises
    ------
    ConfigurationError
        If the aircraft is none of those with defaults, and airspeed or altitude is missing; or one is not finite.
    """
    for option, value in (("--eas-kt", eas_kt), ("--altitude-ft", altitude_ft)):
        if value is not None and not math.isfinite(value):
            raise ConfigurationError(f"{option} {value}: state a finite number")
    if aircraft not in CONDITIONS and (eas_kt is None or altitude_ft is None):
        raise ConfigurationError(
            f"aircraft {aircraft!r} has no default condition; state --eas-kt and --altitude-ft, or use a shipped aircraft "
            f"({choices(aircraft, CONDITIONS)})"
        )
    eas, altitude, amplitude, figures = CONDITIONS.get(aircraft, (0.0, 0.0, 1.0, "mil-f-8785c"))
    return filled(
        "campaign",
        name=name,
        aircraft=aircraft.replace("\\", "\\\\").replace('"', '\\"'),
        eas=f"{eas if eas_kt is None else eas_kt:.12g}",
        altitude=f"{altitude if altitude_ft is None else altitude_ft:.12g}",
        amplitude=f"{amplitude:.12g}",
        figures=figures,
    )


def aircraft_text(name: str) -> str:
    """A commented aircraft.toml without a JSBSim model: geometry, mass, derivatives and sensors.

    Parameters
    ----------
    name : name of the aircraft, as logs state it.
    """
    return filled("aircraft", name=name)


def mapping_text() -> str:
    """A commented mapping; `airtruth.importers.guess_mapping` writes one for a given file."""
    return filled("mapping")


def filled(kind: str, **values: str) -> str:
    """A template with its placeholders replaced.

    Parameters
    ----------
    kind : name of the template; values : placeholder -> text.
    """
    text = resources.files("airtruth.starting").joinpath(f"templates/{kind}.toml").read_text(encoding="utf-8")
    for key, value in values.items():
        text = text.replace(f"@{key}@", value)
    return text


__all__ = ["CONDITIONS", "aircraft_text", "campaign_text", "filled", "mapping_text"]
