"""Errors of sensors beyond those declared; kinds and names are those of `airtruth.physics.sensor_errors`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from airtruth.channels import SIGNALS
from airtruth.effects.effect import Effect, Parameter
from airtruth.physics.sensor_errors import Kind, error_name
from airtruth.physics.terms import Change, SensorTerm
from airtruth.units import DEG, UNITS

Values = Mapping[str, float]

_SOURCE: Final = "Klein and Morelli, Aircraft System Identification, 2006, ch. 10 (data compatibility)"
"""Source of the equations of sensors."""


def _error(
    channel: str, kind: Kind, parameter: Parameter, explanation: str, source: str, distinguished_by: str
) -> Effect:
    """One kind of error of one channel, with one parameter."""
    name, _, variant = error_name(channel, kind).partition(":")
    return Effect(
        name=name,
        variant=variant,
        where="sensor",
        parameters=(parameter,),
        describe=_description(channel, kind, parameter.name),
        explanation=explanation,
        source=source,
        distinguished_by=distinguished_by,
    )


def _description(channel: str, kind: Kind, parameter: str) -> Callable[[Values], Change]:
    def describe(values: Values) -> Change:
        return Change(sensors=(SensorTerm(channel, kind, values[parameter]),))

    return describe


def _scale(channel: str, material: float, distinguished_by: str) -> Effect:
    return _error(
        channel,
        "scale",
        Parameter(
            "factor", "-", f"on {channel}", low=0.7, high=1.4, material=material, neutral=1.0, step=1e-3
        ),
        f"{channel} reads a multiple of the truth.",
        f"y = factor x; {_SOURCE}. Material: {100.0 * material:g} %.",
        distinguished_by,
    )


def _bias(channel: str, reach: float, material: float) -> Effect:
    unit = next(iter(UNITS[SIGNALS[channel].dimension]))
    return _error(
        channel,
        "bias",
        Parameter(
            "value",
            unit,
            f"added to {channel}",
            low=-reach,
            high=reach,
            material=material,
            step=reach / 100.0,
        ),
        f"{channel} has a constant error.",
        f"y = x + value; {_SOURCE}. An estimator with a free intercept per record absorbs it.",
        "The trim's equations with theta, airspeed and accelerations (`airtruth check`).",
    )


def _lag(channel: str, distinguished_by: str) -> Effect:
    return _error(
        channel,
        "lag",
        Parameter(
            "tau_s",
            "s",
            f"time constant of {channel}",
            low=0.0,
            high=0.5,
            material=0.002,
            one_sided=True,
            step=1e-3,
        ),
        f"{channel} follows the truth with a first-order lag.",
        f"tau y' = x - y; {_SOURCE}. Material: a tenth of a sample at 50 Hz.",
        distinguished_by,
    )


def _delay(channel: str) -> Effect:
    return _error(
        channel,
        "delay",
        Parameter(
            "delay_s",
            "s",
            f"of {channel} against the other channels",
            low=0.0,
            high=0.3,
            material=0.002,
            one_sided=True,
            step=1e-3,
        ),
        f"{channel} is recorded late: a wrong time stamp, a data bus, a filter.",
        "y(t) = x(t - delay). Material: a tenth of a sample at 50 Hz.",
        "Kinematics: alpha, theta, q and az must agree (`airtruth check`).",
    )


_MOST_SPANS: Final = 1.5
"""Largest distance of a sensor from the CG in wing spans [-] (judgement: the nose boom of a T-38 or an F-104 is 1.2 to 1.4
spans ahead, that of a transport half a span)."""


def _arm(channel: str, equation: str, reach: float, material: float, distinguished_by: str) -> Effect:
    return _error(
        channel,
        "arm",
        Parameter(
            "x_m",
            "m",
            "ahead of the declared position, forward positive",
            low=-reach,
            high=reach,
            material=material,
            step=0.01,
            spans=_MOST_SPANS,
        ),
        f"The sensor of {channel} is ahead of its declared position, or behind it.",
        f"{equation}; {_SOURCE}.",
        distinguished_by,
    )


EFFECTS: Final = (
    _arm(
        "alpha_rad",
        "alpha_vane = alpha - q x/V, first order in q x/V",
        30.0,
        0.05,
        "Survey the position. Turbulence distinguishes it from a lag: a vane with a lag follows a gust late, an arm "
        "does not delay it.",
    ),
    _lag("alpha_rad", "Turbulence, or a surveyed position of the vane."),
    _lag("q_rad_s", "theta as a second measurement of q."),
    _lag("az_m_s2", "A second accelerometer, or inertial lift from alpha."),
    _scale("alpha_rad", 0.02, "az, or theta minus the flight-path angle."),
    _scale("q_rad_s", 0.01, "theta as a second measurement of q."),
    _scale("az_m_s2", 0.01, "Gravity at the trim: az of level flight is known."),
    _scale("airspeed_m_s", 0.02, "A speed course."),
    _error(
        "airspeed_m_s",
        "alpha_slope",
        Parameter(
            "slope_per_rad",
            "per_rad",
            "relative, of airspeed_m_s over alpha",
            low=-2.0,
            high=2.0,
            material=0.1,
            step=0.01,
        ),
        "airspeed_m_s changes with the angle of attack: the position error of its static source, or the angle of a Pitot tube.",
        "V_reading = V (1 + slope (alpha - mean alpha)); W. Gracey, Measurement of Aircraft Speed and Altitude, NASA RP-1046, "
        "1980, ch. 7 (static-pressure error over lift coefficient). Material: 0.2 % of the airspeed per degree.",
        "ax, az and theta give the change of the airspeed (`airtruth check`).",
    ),
    _bias("alpha_rad", 5.0 * DEG, 0.1 * DEG),
    _bias("q_rad_s", 5.0 * DEG, 0.1 * DEG),
    _bias("az_m_s2", 1.0, 0.02),
    _arm(
        "az_m_s2",
        "az = az_cg - x q_dot",
        10.0,
        0.02,
        "Survey the position, or compare inertial alpha with the vane.",
    ),
    *(_delay(channel) for channel in ("alpha_rad", "q_rad_s", "az_m_s2", "elevator_rad")),
)
"""Effects of this module."""
