"""Kinematics in the vertical plane: what theta, alpha and airspeed must be, given rates and specific forces.

No aerodynamic model enters. In the plane of symmetry, wings level, in air at rest (R. V. Jategaonkar,
*Flight Vehicle System Identification*, 2006, eqs 10.7 and 10.8 without lateral motion, in wind axes):

    theta' = q
    alpha' = q + (az cos(alpha) - ax sin(alpha) + g cos(theta - alpha))/V
    V'     = ax cos(alpha) + az sin(alpha) - g sin(theta - alpha)

The errors of the instruments follow `airtruth.physics.sensors`: a vane x forward of the centre of gravity
reads alpha - q x/V, an accelerometer there reads az - q_dot x. Constants and ramps, which biases leave in
the integrals, are freed elsewhere (`airtruth.identify.kinematics_fit`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from airtruth.physics.sensors import lag
from airtruth.units import G0

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Record:
    """One run, channels of one length.

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


ERRORS: Final[dict[str, tuple[str, float, float, str]]] = {
    "gyro_scale": ("-", 1.0, 1e-3, "measured q over true q"),
    "gyro_delay": ("s", 0.0, 1e-3, "q is measured late by this, against the rest"),
    "theta_delay": ("s", 0.0, 1e-3, "theta is measured late by this, against q"),
    "alpha_scale": ("-", 1.0, 1e-3, "measured over true alpha"),
    "az_scale": ("-", 1.0, 1e-3, "measured over true az"),
    "airspeed_scale": ("-", 1.0, 1e-3, "measured over true airspeed"),
    "vane_arm": ("m", 0.0, 1e-2, "the vane sits this far forward of the CG: alpha_vane = alpha - q x/V"),
    "vane_lag": ("s", 0.02, 1e-3, "time constant of the vane"),
    "accelerometer_arm": (
        "m",
        0.0,
        1e-2,
        "the accelerometer sits this far forward of the CG: az = az_cg - x q_dot",
    ),
    "alpha_delay": ("s", 0.0, 1e-3, "alpha is measured late by this, against q and az"),
    "az_delay": ("s", 0.0, 1e-3, "az is measured late by this, against the rest"),
    "airspeed_delay": ("s", 0.0, 1e-3, "airspeed is measured late by this, against ax and theta"),
}
"""Instrument errors: unit, the value that the search starts from, the step of its derivative, and what it is."""


def neutral(name: str) -> float:
    """Value of an instrument error that is no error."""
    return 1.0 if name.endswith("_scale") else 0.0


def predicted(equation: str, record: Record, errors: Mapping[str, float]) -> tuple[Array, Array]:
    """Measured channel of an equation, and what the other channels say that it should read.

    Both (samples,); they differ by a constant, a ramp (biases), air that moves, and noise.

    Parameters
    ----------
    equation : "theta", "alpha" or "airspeed".
    record : channels; "theta" needs theta, "airspeed" needs ax and theta.
    errors : instrument errors, names of `ERRORS`; those left out are none.
    """
    e = {name: errors.get(name, neutral(name)) for name in ERRORS}
    dt = record.dt_s
    q = earlier(record.q, dt, e["gyro_delay"]) / e["gyro_scale"]
    if equation == "theta":
        assert record.theta is not None
        return record.theta, earlier(integral(q, dt), dt, -e["theta_delay"])
    airspeed = record.airspeed / e["airspeed_scale"]
    az = earlier(record.az, dt, e["az_delay"]) / e["az_scale"]
    if e["accelerometer_arm"] != 0.0:
        az = az + e["accelerometer_arm"] * np.gradient(q, dt)
    ax = record.ax if record.ax is not None else 0.0
    theta = earlier(attitude(record, q), dt, e["theta_delay"] if record.theta is not None else 0.0)
    if equation == "airspeed":
        rate = ax * np.cos(record.alpha) + az * np.sin(record.alpha) - G0 * np.sin(theta - record.alpha)
        true = integral(rate, dt)
        return record.airspeed, e["airspeed_scale"] * earlier(true, dt, -e["airspeed_delay"])
    force = az * np.cos(record.alpha) - ax * np.sin(record.alpha) + G0 * np.cos(theta - record.alpha)
    vane = integral(q + force / airspeed, dt) - e["vane_arm"] * q / airspeed
    vane = earlier(vane, dt, -e["alpha_delay"])
    if e["vane_lag"] > 0.0:
        vane = lag(vane, dt, e["vane_lag"])
    return record.alpha, e["alpha_scale"] * vane


def attitude(record: Record, q: Array) -> Array:
    """Measured theta, or where the log has none the integral of q from a level flight path [rad]."""
    if record.theta is not None:
        return record.theta
    return np.asarray(record.alpha.mean() + integral(q - q.mean(), record.dt_s))


def integral(x: Array, dt_s: float) -> Array:
    """Integral from the first sample of the cubic through the samples, (samples,)."""
    # a trapezoid loses 1 % of a motion at a sixth of the sample rate
    return np.asarray(CubicSpline(np.arange(len(x)) * dt_s, x).antiderivative()(np.arange(len(x)) * dt_s))


def earlier(x: Array, dt_s: float, delay_s: float) -> Array:
    """x(t + delay) by cubic interpolation, the end values held outside; a negative delay takes it later."""
    if delay_s == 0.0:
        return x
    t = np.arange(len(x)) * dt_s
    return np.asarray(CubicSpline(t, x)(np.clip(t + delay_s, t[0], t[-1])))


__all__ = ["ERRORS", "Record", "attitude", "earlier", "integral", "neutral", "predicted"]
