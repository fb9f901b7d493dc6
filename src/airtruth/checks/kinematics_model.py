"""Kinematics in the vertical plane: theta, alpha and airspeed that follow from rates and specific forces.

No aerodynamic model enters. In the plane of symmetry, wings level, in air at rest (R. V. Jategaonkar,
*Flight Vehicle System Identification*, 2006, eqs 10.7 and 10.8 without lateral motion, in wind axes):

    theta' = q
    alpha' = q + (az cos(alpha) - ax sin(alpha) + g cos(theta - alpha))/V
    V'     = ax cos(alpha) + az sin(alpha) - g sin(theta - alpha)

The errors of the instruments follow `airtruth.physics.sensors`: a vane x forward of the centre of gravity
reads alpha - q x/V, an accelerometer there reads az - q_dot x. Each equation is integrated, so that no measured
channel is differentiated: the integral of a rate that lags by tau is that of the true rate less tau times the
measured one. Constants and ramps, which biases leave in the integrals, are freed elsewhere
(`airtruth.checks.kinematics_lines`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.checks.samples import derivative, earlier, integral, lagged
from airtruth.numerics.prefilter import butterworth, zero_phase
from airtruth.physics.sensor_errors import KINDS, Kind, error_name
from airtruth.physics.sensors import vane_equation
from airtruth.units import G0, UNITS, printed

Array = NDArray[np.float64]

EQUATIONS: Final = ("theta", "alpha", "airspeed")
"""Equations that are integrated, by the channel that they predict."""
RATE_HZ: Final = 25.0
"""Smallest sample rate after thinning [Hz]: judgement; the motion of a pitching aircraft lies below 5 Hz."""


@dataclass(frozen=True)
class Record:
    """One run, channels of one length; or several runs of one length and period, channels (runs, samples).

    Attributes
    ----------
    run_id : name of the run.
    dt_s : sample period [s].
    airspeed, alpha, q, az, elevator : (samples,) [m/s], [rad], [rad/s], [m/s2], [rad].
    ax, theta : (samples,) [m/s2], [rad]; None where the log has none.
    """

    run_id: str
    dt_s: float
    airspeed: Array
    alpha: Array
    q: Array
    az: Array
    elevator: Array
    ax: Array | None = None
    theta: Array | None = None

    @property
    def duration_s(self) -> float:
        """Length of the record [s]."""
        return float(self.dt_s * self.q.shape[-1])

    @cached_property
    def t(self) -> Array:
        """(samples,) time from the first sample [s]."""
        return np.asarray(np.arange(self.q.shape[-1]) * self.dt_s)

    @cached_property
    def turned(self) -> Array:
        """(samples,) integral of the measured pitch rate [rad]."""
        return integral(self.q, self.dt_s)

    @cached_property
    def q_dot(self) -> Array:
        """(samples,) derivative of the measured pitch rate [rad/s2]."""
        return derivative(self.q, self.dt_s)


_CHANNELS: Final = ("airspeed", "alpha", "q", "az", "elevator", "ax", "theta")
"""Channels of a record."""


def stacked(records: Sequence[Record]) -> list[tuple[tuple[int, ...], Record]]:
    """Records of one length, period and set of channels as one, each with the numbers of its runs."""
    alike: dict[tuple[object, ...], list[int]] = {}
    for i, r in enumerate(records):
        alike.setdefault((r.dt_s, len(r.q), r.ax is None, r.theta is None), []).append(i)
    result = []
    for numbers in alike.values():
        own = [records[i] for i in numbers]
        joined = {
            n: None if getattr(own[0], n) is None else np.stack([getattr(r, n) for r in own])
            for n in _CHANNELS
        }
        result.append((tuple(numbers), replace(own[0], **joined)))  # type: ignore[arg-type]
    return result


def thinned(record: Record) -> Record:
    """Record with every k-th sample, at least `RATE_HZ`, all channels through one low-pass without lag."""
    every = int(1.0 / (record.dt_s * RATE_HZ) + 1e-6)
    if every < 2:
        return record
    period = every * record.dt_s
    sos = butterworth(0.4 / period, 4, record.dt_s)

    def thin(x: Array | None) -> Array | None:
        return None if x is None else np.ascontiguousarray(zero_phase(x[None], sos)[0, ::every])

    channels = {n: thin(getattr(record, n)) for n in _CHANNELS}
    return replace(record, dt_s=period, **channels)  # type: ignore[arg-type]


@dataclass(frozen=True)
class InstrumentError:
    """An error that the kinematics can show.

    Attributes
    ----------
    channel, kind : of `airtruth.physics.sensor_errors`, which name it.
    usual : size that is not unusual, the standard deviation of its prior [SI; of an arm in chords].
    step : step of its derivative [SI].
    meaning : definition, for people.
    """

    channel: str
    kind: Kind
    usual: float
    step: float
    meaning: str

    @property
    def name(self) -> str:
        """Name that effects and results share."""
        return error_name(self.channel, self.kind)

    @property
    def unit(self) -> str:
        """Unit as it is printed, "-" for none."""
        return printed(next(iter(UNITS[KINDS[self.kind].dimension]))) or "-"

    @property
    def neutral(self) -> float:
        """Value without error."""
        return KINDS[self.kind].neutral


_ALL: Final = (
    InstrumentError("q_rad_s", "scale", 0.05, 1e-3, "measured over true q"),
    InstrumentError("q_rad_s", "lag", 0.1, 1e-3, "time constant of the gyro"),
    InstrumentError("q_rad_s", "delay", 0.1, 1e-3, "delay of q against the other channels"),
    InstrumentError(
        "theta_rad", "lag", 0.1, 1e-3, "time constant of the attitude: its gain falls with frequency"
    ),
    InstrumentError("theta_rad", "delay", 0.1, 1e-3, "delay of theta against q"),
    InstrumentError("alpha_rad", "scale", 0.1, 1e-3, "measured over true alpha"),
    InstrumentError("az_m_s2", "scale", 0.05, 1e-3, "measured over true az"),
    InstrumentError("airspeed_m_s", "scale", 0.1, 1e-3, "measured over true airspeed"),
    InstrumentError(
        "alpha_rad", "arm", 3.0, 1e-2, "position of the vane ahead of the CG: alpha_vane = alpha - q x/V"
    ),
    InstrumentError("alpha_rad", "lag", 0.3, 1e-3, "time constant of the vane"),
    InstrumentError(
        "az_m_s2", "arm", 3.0, 1e-2, "position of the accelerometer ahead of the CG: az = az_cg - x q_dot"
    ),
    InstrumentError("alpha_rad", "delay", 0.2, 1e-3, "delay of alpha against q and az"),
    InstrumentError("az_m_s2", "delay", 0.1, 1e-3, "delay of az against the other channels"),
    InstrumentError("airspeed_m_s", "delay", 0.3, 1e-3, "delay of airspeed against ax and theta"),
    InstrumentError(
        "airspeed_m_s", "alpha_slope", 0.3, 1e-3, "relative change of the airspeed with alpha about its mean"
    ),
)
"""Each error with its usual size and the step of its derivative (judgement: usual sizes are those of flight-test
instruments; steps are small against any error that matters)."""
ERRORS: Final[dict[str, InstrumentError]] = {error.name: error for error in _ALL}
"""Errors that the kinematics can show, by name."""


def compare(
    record: Record, errors: Mapping[str, float], equations: Sequence[str] = EQUATIONS
) -> dict[str, Array]:
    """Measured channel less the one that the other channels predict, of the shape of the channels, for each equation.

    The difference is a constant, a ramp (biases), moving air and noise.

    Parameters
    ----------
    record : channels.
    errors : instrument errors, names of `ERRORS`; an error without an entry is absent.
    equations : equations to evaluate; those whose channels the record lacks are left out.
    """
    dt = record.dt_s

    def error(channel: str, kind: Kind) -> float:
        return float(errors.get(error_name(channel, kind), KINDS[kind].neutral))

    q_lag, q_delay, q_scale = (error("q_rad_s", k) for k in ("lag", "delay", "scale"))
    turned = earlier(record.turned + q_lag * (record.q - record.q[..., :1]), dt, q_delay) / q_scale
    result = {}
    if record.theta is not None:
        attitude = _late(turned, dt, error("theta_rad", "delay"), error("theta_rad", "lag"))
        result["theta"] = record.theta - attitude
    q = earlier(record.q + q_lag * record.q_dot, dt, q_delay) / q_scale
    # the mean of alpha stays, because a constant of it is not determined
    middle = _mean(record.alpha)
    swing = (record.alpha - middle) / error("alpha_rad", "scale")
    slope = 1.0 + error("airspeed_m_s", "alpha_slope") * swing
    airspeed = record.airspeed / (error("airspeed_m_s", "scale") * slope)
    az = earlier(record.az, dt, error("az_m_s2", "delay")) / error("az_m_s2", "scale")
    arm = error("az_m_s2", "arm")
    ax = record.ax if record.ax is not None else 0.0
    if record.theta is None:
        theta = middle + turned - _mean(turned) - (_mean(q) - _mean(record.q)) * record.t
    else:
        theta = earlier(record.theta, dt, error("theta_rad", "delay")) + error("theta_rad", "lag") * q
    alpha = swing + middle + error("alpha_rad", "arm") * q / record.airspeed
    force = az * np.cos(alpha) - ax * np.sin(alpha) + G0 * np.cos(theta - alpha)
    # the integral of x q_dot/V is x q/V up to the change of V, which does not matter over a manoeuvre
    turning = turned + arm * (q - q[..., :1]) / airspeed + integral(force / airspeed, dt)
    vane = vane_equation(turning, q, error("alpha_rad", "arm"), airspeed)
    vane = _late(vane, dt, error("alpha_rad", "delay"), error("alpha_rad", "lag"))
    result["alpha"] = record.alpha - error("alpha_rad", "scale") * vane
    if record.ax is not None and record.theta is not None and "airspeed" in equations:
        lead = error("alpha_rad", "lag") + error("alpha_rad", "delay")
        alpha = alpha + lead * (q + force / airspeed)
        rate = ax * np.cos(alpha) + (az + arm * record.q_dot) * np.sin(alpha) - G0 * np.sin(theta - alpha)
        late = earlier(integral(rate, dt), dt, -error("airspeed_m_s", "delay"))
        result["airspeed"] = error("airspeed_m_s", "scale") * (airspeed - late)
    return result


def _mean(x: Array) -> Array:
    """Mean along the last axis, which stays."""
    return np.asarray(x.mean(axis=-1, keepdims=True))


def _late(x: Array, dt_s: float, delay_s: float, lag_s: float) -> Array:
    return lagged(earlier(x, dt_s, -delay_s), dt_s, lag_s)


__all__ = ["ERRORS", "InstrumentError", "Record", "compare", "stacked", "thinned"]
