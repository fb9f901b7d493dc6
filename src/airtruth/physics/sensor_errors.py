"""Errors of sensors: the one vocabulary of flying, checking, tracing and updating.

A reading y follows from the true motion in this order (`airtruth.physics.sensors.at_instrument` and `measure`):
position of the instrument, slope over alpha, lag, delay, scale, bias, noise, hold, quantisation, limits. aircraft.toml
declares these errors by their `ErrorKind.key`; an effect (`airtruth.physics.terms.SensorTerm`) adds to those of the kinds in
`Kind`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from airtruth.channels import LATERAL
from airtruth.physics.motion import MOTIONS

Array = NDArray[np.float64]

Kind = Literal["bias", "scale", "lag", "delay", "arm", "arm_down", "arm_right", "alpha_slope"]
"""Errors that an effect may add to those declared."""


@dataclass(frozen=True)
class ErrorKind:
    """One kind of error of a sensor.

    Attributes
    ----------
    key : its name in aircraft.toml.
    dimension : key of `airtruth.units.UNITS`; "" for the dimension of the channel.
    neutral : value without effect [SI].
    is_factor : whether two errors in series multiply; otherwise they add.
    may_be_negative : whether a value below zero has a meaning.
    """

    key: str
    dimension: str = ""
    neutral: float = 0.0
    is_factor: bool = False
    may_be_negative: bool = True

    @property
    def field(self) -> str:
        """Attribute of `SensorErrors` that holds the value."""
        return self.key + {"time": "_s", "length": "_m", "per_angle": "_per_rad"}.get(self.dimension, "")

    def combined(self, first: float, second: float) -> float:
        """Return two errors in series as one; two lags as one of their sum, to first order in their time constants.

        Examples
        --------
        >>> KINDS["scale"].combined(1.1, 2.0), KINDS["delay"].combined(0.25, 0.5)
        (2.2, 0.75)
        """
        return first * second if self.is_factor else first + second


KINDS: Final[Mapping[str, ErrorKind]] = {
    "noise": ErrorKind("noise_std", may_be_negative=False),
    "bias": ErrorKind("bias"),
    "scale": ErrorKind("scale", "ratio", neutral=1.0, is_factor=True),
    "lag": ErrorKind("lag", "time", may_be_negative=False),
    "delay": ErrorKind("delay", "time", may_be_negative=False),
    "hold": ErrorKind("hold", "time", may_be_negative=False),
    "quantum": ErrorKind("quantum", may_be_negative=False),
    "minimum": ErrorKind("minimum", neutral=-np.inf),
    "maximum": ErrorKind("maximum", neutral=np.inf),
    "arm": ErrorKind("x", "length"),
    "arm_down": ErrorKind("z", "length"),
    "arm_right": ErrorKind("y", "length"),
    "alpha_slope": ErrorKind("alpha_slope", "per_angle"),
}
"""Every kind of error by its name."""

INSTRUMENTS: Final[Mapping[str, str]] = {
    "airspeed_m_s": "airspeed",
    "theta_rad": "attitude",
    **{output.channel: output.instrument for motion in MOTIONS.values() for output in motion.outputs},
    "psi_rad": "attitude",
}
"""Instrument of a channel, as its errors are named."""


@dataclass(frozen=True)
class SensorErrors:
    """All errors of one channel; the defaults have no effect.

    Attributes
    ----------
    noise_std : standard deviation of white noise per sample [unit of the channel].
    bias : constant added [unit of the channel].
    scale : factor on the truth [-].
    lag_s : time constant of a first-order lag [s].
    delay_s : transport delay [s], at least 0.
    quantum : size of a quantisation step, rounding to nearest [unit of the channel]; 0 for none.
    minimum, maximum : ends of the range [unit of the channel].
    hold_s : update period of a slower instrument, which holds its value between updates [s]; 0 for none.
    x_m, y_m, z_m : position ahead of, right of and below the centre of gravity [m]; it matters to vanes and accelerometers.
    alpha_slope_per_rad : relative change of the reading with the angle of attack about its mean [1/rad]; of airspeed_m_s alone,
        the position error of a static source.
    """

    noise_std: float = 0.0
    bias: float = 0.0
    scale: float = 1.0
    lag_s: float = 0.0
    delay_s: float = 0.0
    quantum: float = 0.0
    minimum: float = -np.inf
    maximum: float = np.inf
    hold_s: float = 0.0
    x_m: float = 0.0
    z_m: float = 0.0
    alpha_slope_per_rad: float = 0.0
    y_m: float = 0.0

    @property
    def lead_s(self) -> float:
        """Time by which a reading has to be advanced to undo delay and lag, the lag to first order [s]."""
        return self.delay_s + self.lag_s

    def value(self, kind: str) -> float:
        """Return the error of one kind [SI].

        Raises
        ------
        KeyError
            If ``kind`` is not in `KINDS`.
        """
        return float(getattr(self, KINDS[kind].field))

    def slope(self, alpha_rad: Array) -> Array:
        """Factor that the angle of attack puts on a reading [-].

        Parameters
        ----------
        alpha_rad : (..., samples) of whole records [rad]; the factor is 1 at the mean of each.

        Examples
        --------
        >>> SensorErrors(alpha_slope_per_rad=-0.5).slope(np.array([0.0, 0.2])).tolist()
        [1.05, 0.95]
        """
        off = alpha_rad - alpha_rad.mean(axis=-1, keepdims=True)
        return np.asarray(1.0 + self.alpha_slope_per_rad * off)

    def scaled(self, truth: Array) -> Array:
        """Apply scale and bias [unit of the channel], any shape.

        Examples
        --------
        >>> SensorErrors(scale=2.0, bias=1.0).scaled(np.array([3.0])).tolist()
        [7.0]
        """
        return truth * self.scale + self.bias

    def unscaled(self, reading: Array) -> Array:
        """Undo scale and bias [unit of the channel], any shape; inverts `scaled`.

        Examples
        --------
        >>> SensorErrors(scale=2.0, bias=1.0).unscaled(np.array([7.0])).tolist()
        [3.0]
        """
        return (reading - self.bias) / self.scale


def error_name(channel: str, kind: Kind) -> str:
    """Name of an error wherever a user meets it: as an effect and as a result of `airtruth check`.

    Parameters
    ----------
    channel : column of a log.
    kind : kind of the error.

    Raises
    ------
    KeyError
        If the channel has no entry in `INSTRUMENTS`.

    Examples
    --------
    >>> error_name("alpha_rad", "scale"), error_name("q_rad_s", "delay"), error_name("beta_rad", "arm")
    ('vane_scale', 'sensor_delay:q_rad_s', 'vane_arm:beta_rad')
    >>> error_name("alpha_rad", "arm_right")
    'alpha_vane_roll_arm'
    """
    if kind == "delay":
        return f"sensor_delay:{channel}"
    if kind == "arm_right":
        return f"{channel.removesuffix('_rad')}_{INSTRUMENTS[channel]}_roll_arm"
    name = f"{INSTRUMENTS[channel]}_{kind.replace('arm_down', 'arm_z')}"
    return f"{name}:{channel}" if channel in LATERAL else name


__all__ = ["INSTRUMENTS", "KINDS", "ErrorKind", "Kind", "SensorErrors", "error_name"]
