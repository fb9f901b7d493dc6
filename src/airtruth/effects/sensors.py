"""Errors of sensors beyond those declared, generated from the outputs of a motion and the kinds of errors.

Kinds and names are those of `airtruth.physics.sensor_errors`. Airspeed, a known input of both motions, has a scale and a
position error; controls have a delay.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Final

from airtruth.channels import SIGNALS
from airtruth.effects.effect import Effect, Parameter
from airtruth.physics.motion import LONGITUDINAL, Motion
from airtruth.physics.sensor_errors import Kind, error_name
from airtruth.physics.terms import Change, SensorTerm
from airtruth.units import DEG, UNITS

Values = Mapping[str, float]

_SOURCE: Final = "Klein and Morelli, Aircraft System Identification, 2006, ch. 10 (data compatibility)"
"""Source of the equations of sensors."""
_SCALES: Final[Mapping[str, float]] = {
    "angle": 0.02,
    "angular_rate": 0.01,
    "acceleration": 0.01,
    "speed": 0.02,
}
"""Dimension of a channel -> material error of its scale [-] (judgement)."""
_BIASES: Final[Mapping[str, tuple[float, float]]] = {
    "angle": (5.0 * DEG, 0.1 * DEG),
    "angular_rate": (5.0 * DEG, 0.1 * DEG),
    "acceleration": (1.0, 0.02),
}
"""Dimension of a channel -> largest and material bias [SI] (judgement)."""
_ARMS: Final[Mapping[str, tuple[str, float, float, str]]] = {
    "alpha_rad": (
        "alpha_vane = alpha - q x/V, first order in q x/V",
        30.0,
        0.05,
        "Survey the position. Turbulence distinguishes it from a lag: a vane with a lag follows a gust late, an arm "
        "does not delay it.",
    ),
    "az_m_s2": (
        "az = az_cg - x q_dot",
        10.0,
        0.02,
        "Survey the position, or compare inertial alpha with the vane.",
    ),
}
"""Output whose reading depends on the position of its instrument -> equation, largest and material distance [m], and what
tells it apart."""
_LAGS: Final[Mapping[str, str]] = {
    "alpha_rad": "Turbulence, or a surveyed position of the vane.",
    "q_rad_s": "theta as a second measurement of q.",
    "az_m_s2": "A second accelerometer, or inertial lift from alpha.",
}
"""Output -> what tells a lag of its sensor apart."""
_SCALED: Final[Mapping[str, str]] = {
    "alpha_rad": "az, or theta minus the flight-path angle.",
    "q_rad_s": "theta as a second measurement of q.",
    "az_m_s2": "Gravity at the trim: az of level flight is known.",
    "airspeed_m_s": "A speed course.",
}
"""Channel -> what tells an error of its scale apart."""
_SECOND: Final = "A second sensor of the same quantity."
"""What tells an error apart where no other channel does."""
_MOST_SPANS: Final = 1.5
"""Largest distance of a sensor from the CG in wing spans [-] (judgement: the nose boom of a T-38 or an F-104 is 1.2 to 1.4
spans ahead, that of a transport half a span)."""


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


def _scale(channel: str) -> Effect:
    material = _SCALES[SIGNALS[channel].dimension]
    return _error(
        channel,
        "scale",
        Parameter(
            "factor", "-", f"on {channel}", low=0.7, high=1.4, material=material, neutral=1.0, step=1e-3
        ),
        f"{channel} reads a multiple of the truth.",
        f"y = factor x; {_SOURCE}. Material: {100.0 * material:g} %.",
        _SCALED.get(channel, _SECOND),
    )


def _bias(channel: str) -> Effect:
    reach, material = _BIASES[SIGNALS[channel].dimension]
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


def _lag(channel: str) -> Effect:
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
        _LAGS.get(channel, _SECOND),
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


def _arm(channel: str) -> Effect:
    equation, reach, material, distinguished_by = _ARMS[channel]
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


_POSITION_ERROR: Final = _error(
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
)
"""The position error of the static source."""


def sensor_effects(motion: Motion) -> Iterator[Effect]:
    """Each kind of error of each output of a motion, of the airspeed and of the controls."""
    outputs = motion.output_channels
    yield from (_lag(channel) for channel in outputs)
    yield from (_scale(channel) for channel in (*outputs, "airspeed_m_s"))
    yield _POSITION_ERROR
    yield from (_bias(channel) for channel in outputs)
    yield from (_arm(channel) for channel in outputs if channel in _ARMS)
    yield from (_delay(channel) for channel in (*outputs, *(c.channel for c in motion.controls)))


EFFECTS: Final = tuple(sensor_effects(LONGITUDINAL))
"""Effects of this module."""
