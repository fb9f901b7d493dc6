"""Kinematics in the vertical plane: theta, alpha and airspeed that follow from rates and specific forces.

No aerodynamic model enters. In the plane of symmetry, here wings level, in air at rest (R. V. Jategaonkar,
*Flight Vehicle System Identification*, 2006, chapter 10, without lateral motion, in wind axes):

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
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.checks.kinematics_record import InstrumentError, Kinematics, Samples, stacked, thinned
from airtruth.checks.pitch_motions import pitch_motions
from airtruth.checks.rotation import across_flow, alpha_coupling, alpha_gravity, pitch_coupling
from airtruth.checks.samples import derivative, earlier, integral, lagged
from airtruth.physics.motion import LONGITUDINAL as MOTION
from airtruth.physics.sensor_errors import KINDS, Kind, error_name
from airtruth.physics.sensors import vane_equation
from airtruth.units import G0

Array = NDArray[np.float64]

_ALPHA, _Q, _AZ = MOTION.output_channels
EQUATIONS: Final = ("theta", "alpha", "airspeed")
"""Equations that are integrated, by the channel that they predict."""


@dataclass(frozen=True)
class LongitudinalSamples(Samples):
    """Record of the longitudinal motion.

    Attributes
    ----------
    airspeed, alpha, q, az, elevator : (samples,) [m/s], [rad], [rad/s], [m/s2], [rad].
    ax, theta : (samples,) [m/s2], [rad]; None where the log has none.
    p, r, phi, beta : (samples,) [rad/s], [rad]; without one of them the wings count as level.
    """

    airspeed: Array
    alpha: Array
    q: Array
    az: Array
    elevator: Array
    ax: Array | None = None
    theta: Array | None = None
    p: Array | None = None
    r: Array | None = None
    phi: Array | None = None
    beta: Array | None = None

    @cached_property
    def turned(self) -> Array:
        """(samples,) integral of the measured pitch rate [rad]."""
        return integral(self.q, self.dt_s)

    @cached_property
    def q_dot(self) -> Array:
        """(samples,) derivative of the measured pitch rate [rad/s2]."""
        return derivative(self.q, self.dt_s)

    @cached_property
    def rotated(self) -> tuple[Array, Array] | None:
        """(samples,) parts of theta and alpha that roll, yaw and bank make [rad]; None with the wings level."""
        p, r, phi, beta = self.p, self.r, self.phi, self.beta
        if p is None or r is None or phi is None or beta is None:
            return None
        theta = self.theta if self.theta is not None else self.alpha
        sink = alpha_gravity(self.alpha, theta, phi) / self.airspeed
        alpha = alpha_coupling(p, r, self.alpha, beta) + sink
        return integral(pitch_coupling(self.q, r, phi), self.dt_s), integral(alpha, self.dt_s)


_ALL: Final = (
    InstrumentError(_Q, "scale", 0.05, 1e-3, "measured over true q"),
    InstrumentError(_Q, "lag", 0.1, 1e-3, "time constant of the gyro"),
    InstrumentError(_Q, "delay", 0.1, 1e-3, "delay of q against the other channels"),
    InstrumentError(
        "theta_rad", "lag", 0.1, 1e-3, "time constant of the attitude: its gain falls with frequency"
    ),
    InstrumentError("theta_rad", "delay", 0.1, 1e-3, "delay of theta against q"),
    InstrumentError(_ALPHA, "scale", 0.1, 1e-3, "measured over true alpha"),
    InstrumentError(_AZ, "scale", 0.05, 1e-3, "measured over true az"),
    InstrumentError("airspeed_m_s", "scale", 0.1, 1e-3, "measured over true airspeed"),
    InstrumentError(
        _ALPHA, "arm", 3.0, 1e-2, "position of the vane ahead of the CG: alpha_vane = alpha - q x/V"
    ),
    InstrumentError(_ALPHA, "lag", 0.3, 1e-3, "time constant of the vane"),
    InstrumentError(
        _AZ, "arm", 3.0, 1e-2, "position of the accelerometer ahead of the CG: az = az_cg - x q_dot"
    ),
    InstrumentError(_ALPHA, "delay", 0.2, 1e-3, "delay of alpha against q and az"),
    InstrumentError(_AZ, "delay", 0.1, 1e-3, "delay of az against the other channels"),
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
    record: LongitudinalSamples, errors: Mapping[str, float], equations: Sequence[str] = EQUATIONS
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

    q_lag, q_delay, q_scale = (error(_Q, k) for k in ("lag", "delay", "scale"))
    turned = earlier(record.turned + q_lag * (record.q - record.q[..., :1]), dt, q_delay) / q_scale
    result = {}
    if record.theta is not None:
        attitude = _late(turned, dt, error("theta_rad", "delay"), error("theta_rad", "lag"))
        result["theta"] = record.theta - attitude
        if record.rotated is not None:
            result["theta"] = result["theta"] - record.rotated[0]
    q = earlier(record.q + q_lag * record.q_dot, dt, q_delay) / q_scale
    # the mean of alpha stays, because a constant of it is not determined
    middle = _mean(record.alpha)
    swing = (record.alpha - middle) / error(_ALPHA, "scale")
    slope = 1.0 + error("airspeed_m_s", "alpha_slope") * swing
    airspeed = record.airspeed / (error("airspeed_m_s", "scale") * slope)
    az = earlier(record.az, dt, error(_AZ, "delay")) / error(_AZ, "scale")
    arm = error(_AZ, "arm")
    ax = record.ax if record.ax is not None else 0.0
    if record.theta is None:
        theta = middle + turned - _mean(turned) - (_mean(q) - _mean(record.q)) * record.t
    else:
        theta = earlier(record.theta, dt, error("theta_rad", "delay")) + error("theta_rad", "lag") * q
    alpha = swing + middle + error(_ALPHA, "arm") * q / record.airspeed
    force = across_flow(az, ax, alpha, theta)
    # the integral of x q_dot/V is x q/V up to the change of V, which does not matter over a manoeuvre
    turning = turned + arm * (q - q[..., :1]) / airspeed + integral(force / airspeed, dt)
    if record.rotated is not None:
        turning = turning + record.rotated[1]
    vane = vane_equation(turning, q, error(_ALPHA, "arm"), airspeed)
    vane = _late(vane, dt, error(_ALPHA, "delay"), error(_ALPHA, "lag"))
    result["alpha"] = record.alpha - error(_ALPHA, "scale") * vane
    if record.ax is not None and record.theta is not None and "airspeed" in equations:
        lead = error(_ALPHA, "lag") + error(_ALPHA, "delay")
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


LONGITUDINAL: Final = Kinematics(
    errors=ERRORS,
    channels={"theta": "theta_rad", "alpha": _ALPHA, "airspeed": "airspeed_m_s"},
    fields={"airspeed_m_s": "airspeed", "theta_rad": "theta", "ax_m_s2": "ax"}
    | {y.channel: y.name for y in MOTION.outputs},
    compare=compare,
    motions=lambda record: pitch_motions(record.elevator, record.q, record.dt_s),
    controls=f"the {MOTION.controls[0].name}",
    reference="chord",
    longest=7.0,  # judgement; the nose boom of ATTAS is 4.1 chords ahead of the CG, a Boeing 747 is 8.5 chords long
    same=(
        frozenset({"vane_arm", "accelerometer_arm"}),
        frozenset({"accelerometer_scale", "airspeed_scale"}),
    ),
    telling={"gyro_scale": 0.05, "vane_scale": 0.15, "vane_lag": 0.1},
)
"""The kinematics of the longitudinal motion (`telling`: judgement; a smaller error does not change a derivative by more than its
usual uncertainty)."""

__all__ = [
    "ERRORS",
    "LONGITUDINAL",
    "InstrumentError",
    "LongitudinalSamples",
    "compare",
    "stacked",
    "thinned",
]
