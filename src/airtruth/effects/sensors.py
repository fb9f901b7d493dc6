"""Errors of sensors beyond those declared, generated from the outputs of a motion and the kinds of errors.

Kinds and names are those of `airtruth.physics.sensor_errors`. Airspeed, a known input of both motions, has a scale and a
position error; controls have a delay.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from airtruth.channels import LATERAL, SIGNALS
from airtruth.effects.effect import Effect, Parameter
from airtruth.physics.motion import MOTIONS, Motion
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


@dataclass(frozen=True)
class _Arm:
    """How a reading depends on the position of its instrument.

    Attributes
    ----------
    kind, parameter : of the error.
    equation : of the reading.
    reach, material : largest and material distance [m].
    distinguished_by : what tells it apart.
    """

    kind: Kind
    parameter: str
    equation: str
    reach: float
    material: float
    distinguished_by: str


_TURBULENCE: Final = (
    "Survey the position. Turbulence distinguishes it from a lag: a vane with a lag follows a gust late, an arm does not "
    "delay it."
)
"""Advice on telling the arm of a vane apart."""
_ARMS: Final[Mapping[str, tuple[_Arm, ...]]] = {
    "alpha_rad": (
        _Arm("arm", "x_m", "alpha_vane = alpha - q x/V, first order in q x/V", 30.0, 0.05, _TURBULENCE),
    ),
    "az_m_s2": (
        _Arm(
            "arm",
            "x_m",
            "az = az_cg - x q_dot",
            10.0,
            0.02,
            "Survey the position, or compare inertial alpha with the vane.",
        ),
    ),
    "beta_rad": (
        _Arm(
            "arm",
            "x_m",
            "beta_vane = beta + r x/V - p z/V, first order in the rates, z as declared",
            30.0,
            0.05,
            _TURBULENCE,
        ),
    ),
    "ay_m_s2": (
        _Arm(
            "arm",
            "x_m",
            "ay = ay_cg + x r_dot - z p_dot",
            10.0,
            0.02,
            "Survey the position, or a rudder input, which yaws more than it rolls.",
        ),
        _Arm(
            "arm_down",
            "z_m",
            "ay = ay_cg + x r_dot - z p_dot",
            10.0,
            0.02,
            "Survey the position, or an aileron input, which rolls more than it yaws.",
        ),
    ),
}
"""Output whose reading depends on the position of its instrument -> each coordinate."""
_ARMS_OF_KNOWN: Final[Mapping[str, tuple[_Arm, ...]]] = {
    "alpha_rad": (
        _Arm(
            "arm_right",
            "y_m",
            "alpha_vane = alpha + p y/V, first order in p y/V",
            30.0,
            0.05,
            "Survey the position; a roll at constant alpha shows it.",
        ),
    ),
}
"""Known input of a motion whose reading depends on the position of its instrument through that motion -> each coordinate."""
_DIRECTIONS: Final[Mapping[str, tuple[str, str, str]]] = {
    "arm": ("ahead of", "forward", "behind"),
    "arm_down": ("below", "down", "above"),
    "arm_right": ("right of", "to the right", "left of"),
}
"""Kind of an arm -> where the instrument is, its positive sense, and the opposite side."""
_LAGS: Final[Mapping[str, str]] = {
    "alpha_rad": "Turbulence, or a surveyed position of the vane.",
    "q_rad_s": "theta as a second measurement of q.",
    "az_m_s2": "A second accelerometer, or inertial lift from alpha.",
    "beta_rad": "Turbulence, or a surveyed position of the vane.",
    "p_rad_s": "phi as a second measurement of p.",
    "r_rad_s": "psi as a second measurement of r.",
    "phi_rad": "p as a second measurement of its rate.",
}
"""Output -> what tells a lag of its sensor apart."""
_SCALED: Final[Mapping[str, str]] = {
    "alpha_rad": "az, or theta minus the flight-path angle.",
    "q_rad_s": "theta as a second measurement of q.",
    "az_m_s2": "Gravity at the trim: az of level flight is known.",
    "beta_rad": "ay, or phi and psi with the flight path.",
    "p_rad_s": "phi as a second measurement of p.",
    "r_rad_s": "psi as a second measurement of r.",
    "phi_rad": "p as a second measurement of its rate.",
    "ay_m_s2": "Gravity in a steady sideslip with bank.",
    "airspeed_m_s": "A speed course.",
}
"""Channel -> what tells an error of its scale apart."""
_KINEMATICS: Final = "Kinematics: alpha, theta, q and az must agree (`airtruth check`)."
"""Advice on telling a delay apart in the pitch plane."""
_SIDE_KINEMATICS: Final = "Kinematics: beta, phi, p, r and ay must agree (`airtruth check`)."
"""Advice on telling a delay of a lateral channel apart."""
_SECOND: Final = "A second sensor of the same quantity."
"""Advice on telling an error apart where no other channel does."""
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
        _SIDE_KINEMATICS if channel in LATERAL else _KINEMATICS,
    )


def _arm(channel: str, arm: _Arm) -> Effect:
    where, sense, opposite = _DIRECTIONS[arm.kind]
    return _error(
        channel,
        arm.kind,
        Parameter(
            arm.parameter,
            "m",
            f"{where} the declared position, {sense} positive",
            low=-arm.reach,
            high=arm.reach,
            material=arm.material,
            step=0.01,
            spans=_MOST_SPANS,
        ),
        f"The sensor of {channel} is {where} its declared position, or {opposite} it.",
        f"{arm.equation}; {_SOURCE}.",
        arm.distinguished_by,
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
    yield from (_arm(channel, arm) for channel in outputs for arm in _ARMS.get(channel, ()))
    yield from (_arm(channel, arm) for channel in motion.known for arm in _ARMS_OF_KNOWN.get(channel, ()))
    yield from (_delay(channel) for channel in (*outputs, *(c.channel for c in motion.controls)))


EFFECTS: Final = tuple({e.key: e for m in MOTIONS.values() for e in sensor_effects(m)}.values())
"""Effects of this module."""
