"""Effects in the sensors: what an instrument does that is not declared of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final, Literal

from airtruth.effects.change import Change, SensorTerm
from airtruth.effects.effect import Effect, Parameter
from airtruth.signals import SIGNALS
from airtruth.units import DEG, UNITS

Values = Mapping[str, float]
Kind = Literal["bias", "scale", "lag", "delay", "arm"]

_SOURCE: Final = "Klein and Morelli, Aircraft System Identification, 2006, ch. 10 (data compatibility)"


def _term(channel: str, kind: Kind, parameter: str) -> Callable[[Values], Change]:
    def describe(values: Values) -> Change:
        return Change(sensors=(SensorTerm(channel, kind, values[parameter]),))

    return describe


def _scale(name: str, channel: str, material: float, splits: str) -> Effect:
    return Effect(
        name=name,
        where="sensor",
        parameters=(
            Parameter(
                "factor",
                "-",
                f"on {channel}",
                low=0.7,
                high=1.4,
                material=material,
                neutral=1.0,
                prior_std=0.1,
                step=1e-3,
            ),
        ),
        describe=_term(channel, "scale", "factor"),
        explanation=f"The reading of {channel} is a factor of the truth.",
        source=f"y = factor x; {_SOURCE}. Material: {100.0 * material:g} %.",
        splits=splits,
    )


def _bias(name: str, channel: str, reach: float, material: float) -> Effect:
    unit = next(iter(UNITS[SIGNALS[channel].dimension]))
    return Effect(
        name=name,
        where="sensor",
        parameters=(
            Parameter(
                "value",
                unit,
                f"added to {channel}",
                low=-reach,
                high=reach,
                material=material,
                prior_std=reach / 2.0,
                step=reach / 100.0,
            ),
        ),
        describe=_term(channel, "bias", "value"),
        explanation=f"A constant in {channel}.",
        source=f"y = x + value; {_SOURCE}. An estimator that frees an intercept per record does not see it.",
        splits="The trim's equations with theta, airspeed and accelerations (`airtruth check`).",
    )


def _lag(name: str, channel: str, splits: str) -> Effect:
    return Effect(
        name=name,
        where="sensor",
        parameters=(
            Parameter(
                "tau_s",
                "s",
                f"time constant of {channel}",
                low=0.0,
                high=0.5,
                material=0.002,
                one_sided=True,
                prior_std=0.05,
                step=1e-3,
            ),
        ),
        describe=_term(channel, "lag", "tau_s"),
        explanation=f"The reading of {channel} follows the truth with a first-order lag.",
        source=f"tau y' = x - y; {_SOURCE}. Material: a tenth of a sample at 50 Hz.",
        splits=splits,
    )


def _delay(channel: str) -> Effect:
    return Effect(
        name="sensor_delay",
        variant=channel,
        where="sensor",
        parameters=(
            Parameter(
                "delay_s",
                "s",
                f"of {channel} behind the other channels",
                low=0.0,
                high=0.3,
                material=0.002,
                one_sided=True,
                prior_std=0.05,
                step=1e-3,
            ),
        ),
        describe=_term(channel, "delay", "delay_s"),
        explanation=f"The reading of {channel} is late: a time stamp, a bus, a filter.",
        source="y(t) = x(t - delay). Material: a tenth of a sample at 50 Hz.",
        splits="Kinematics: alpha, theta, q and az must agree (`airtruth check`).",
    )


def _arm(name: str, channel: str, equation: str, reach: float, material: float, splits: str) -> Effect:
    return Effect(
        name=name,
        where="sensor",
        parameters=(
            Parameter(
                "x_m",
                "m",
                "ahead of its declared place, forward positive",
                low=-reach,
                high=reach,
                material=material,
                prior_std=reach / 4.0,
                step=0.01,
            ),
        ),
        describe=_term(channel, "arm", "x_m"),
        explanation=f"The sensor of {channel} sits ahead of where it is declared.",
        source=f"{equation}, first order in q x/V; {_SOURCE}.",
        splits=splits,
    )


EFFECTS: Final = (
    _arm(
        "vane_arm",
        "alpha_rad",
        "alpha_vane = alpha - q x/V",
        30.0,
        0.05,
        "A surveyed arm. Turbulence tells it from a lag: a vane lags the gust, an arm does not.",
    ),
    _lag("vane_lag", "alpha_rad", "Turbulence, or a declared arm."),
    _lag("gyro_lag", "q_rad_s", "theta as a second witness of q."),
    _lag("accelerometer_lag", "az_m_s2", "A second accelerometer, or inertial lift from alpha."),
    _scale("vane_scale", "alpha_rad", 0.02, "az, or theta less flight path."),
    _scale("gyro_scale", "q_rad_s", 0.01, "theta as a second witness of q."),
    _scale("accelerometer_scale", "az_m_s2", 0.01, "Gravity at the trim: az of level flight is known."),
    _scale("airspeed_scale", "airspeed_m_s", 0.02, "A speed course."),
    _bias("vane_bias", "alpha_rad", 5.0 * DEG, 0.1 * DEG),
    _bias("gyro_bias", "q_rad_s", 5.0 * DEG, 0.1 * DEG),
    _bias("accelerometer_bias", "az_m_s2", 1.0, 0.02),
    _arm(
        "accelerometer_arm",
        "az_m_s2",
        "az = az_cg - x q_dot",
        10.0,
        0.02,
        "A surveyed position; inertial alpha against the vane.",
    ),
    *(_delay(channel) for channel in ("alpha_rad", "q_rad_s", "az_m_s2")),
)
"""Effects of this family."""
