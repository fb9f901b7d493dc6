"""Kinematics of roll, yaw and sideslip: phi, psi and beta that follow from rates and specific forces.

No aerodynamic model enters. The equations are those of `airtruth.checks.rotation`, integrated, so that no measured channel is
differentiated. The errors of the instruments: a vane x ahead of the centre of gravity reads beta + x r/V, an accelerometer
at x, z reads ay + x r_dot - z p_dot. The integral of x r_dot/V is x r/V: the kinematics shows the place of the vane relative
to the accelerometer. An error of alpha turns roll into sideslip; its constant and its ramp are free in each record.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.checks.kinematics_record import InstrumentError, Kinematics, Samples
from airtruth.checks.lateral_model import fitted, simulated
from airtruth.checks.pitch_motions import smoothed_surface
from airtruth.checks.rotation import bank_coupling, heading_rate, side_gravity, sideslip_turn
from airtruth.checks.samples import derivative, earlier, integral, lagged
from airtruth.physics.motion import LATERAL as MOTION
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.sensor_errors import Kind, error_name
from airtruth.units import G0

Array = NDArray[np.float64]

_BETA, _P, _R, _PHI, _AY = MOTION.output_channels
EQUATIONS: Final = ("phi", "psi", "beta")
"""Equations that are integrated, by the channel that they predict."""
ALPHA_BIAS: Final = "vane_bias"
"""Name of the constant of alpha, which is free."""
ALPHA_DRIFT: Final = "vane_drift"
"""Name of the ramp of alpha, which is free."""
_SLOW: Final = (1.0, 3.0)
"""Time constants of the low-passes of the simulated motion, over the period of the motion per radian [-]."""


@dataclass(frozen=True)
class SideRecord(Samples):
    """Record of the lateral-directional motion; a channel that a log lacks has a stand-in where one serves.

    Attributes
    ----------
    airspeed, p, r, ay : (samples,) [m/s], [rad/s], [m/s2].
    aileron, rudder : (samples,) [rad]; zero where the log has none.
    alpha, theta, q : (samples,) [rad], [rad/s]; zero where the log has none.
    bank : (samples,) bank, or the integral of p [rad].
    path : (samples,) specific force along the path, ax cos a + az sin a [m/s2]; zero where the log has none.
    phi, psi, beta : (samples,) [rad]; None where the log has none.
    """

    airspeed: Array
    p: Array
    r: Array
    ay: Array
    aileron: Array
    rudder: Array
    alpha: Array
    theta: Array
    q: Array
    bank: Array
    path: Array
    phi: Array | None = None
    psi: Array | None = None
    beta: Array | None = None

    @cached_property
    def rolled(self) -> Array:
        """(samples,) integral of the measured roll rate [rad]."""
        return integral(self.p, self.dt_s)

    @cached_property
    def dots(self) -> tuple[Array, Array]:
        """(samples,) derivatives of the measured roll and yaw rates [rad/s2]."""
        return derivative(self.p, self.dt_s), derivative(self.r, self.dt_s)


_ALL: Final = (
    InstrumentError(_P, "scale", 0.05, 1e-3, "measured over true p"),
    InstrumentError(_P, "lag", 0.1, 1e-3, "time constant of the gyro"),
    InstrumentError(_P, "delay", 0.1, 1e-3, "delay of p against the other channels"),
    InstrumentError(_R, "scale", 0.05, 1e-3, "measured over true r"),
    InstrumentError(_R, "lag", 0.1, 1e-3, "time constant of the gyro"),
    InstrumentError(_R, "delay", 0.1, 1e-3, "delay of r against the other channels"),
    InstrumentError(_PHI, "delay", 0.1, 1e-3, "delay of phi against p"),
    InstrumentError("psi_rad", "delay", 0.1, 1e-3, "delay of psi against r"),
    InstrumentError(_BETA, "scale", 0.1, 1e-3, "measured over true beta, sidewash included"),
    InstrumentError(
        _BETA, "arm", 3.0, 1e-2, "position of the vane ahead of the CG: beta_vane = beta + x r/V"
    ),
    InstrumentError(_BETA, "lag", 0.3, 1e-3, "time constant of the vane"),
    InstrumentError(_BETA, "delay", 0.2, 1e-3, "delay of beta against r and ay"),
    InstrumentError(_AY, "scale", 0.05, 1e-3, "measured over true ay"),
    InstrumentError(
        _AY, "arm", 3.0, 1e-2, "position of the accelerometer ahead of the CG: ay = ay_cg + x r_dot"
    ),
    InstrumentError(
        _AY, "arm_down", 1.0, 1e-2, "position of the accelerometer below the CG: ay = ay_cg - z p_dot"
    ),
    InstrumentError(_AY, "delay", 0.1, 1e-3, "delay of ay against the other channels"),
)
"""Each error with its usual size and the step of its derivative (judgement, as in the longitudinal motion)."""
ERRORS: Final[dict[str, InstrumentError]] = {error.name: error for error in _ALL}
"""Errors that the kinematics can show, by name."""
_ERROR: Final = {(e.channel, e.kind): (name, e.neutral) for name, e in ERRORS.items()}
"""Channel and kind -> name and value without error."""
CONTROLS: Final = tuple(control.name for control in MOTION.controls)
"""Controls, each a field of a record."""
_GYRO: Final[tuple[Kind, ...]] = ("lag", "delay", "scale")
"""Kinds of errors of a gyroscope."""


def compare(
    record: SideRecord, errors: Mapping[str, float], equations: Sequence[str] = EQUATIONS
) -> dict[str, Array]:
    """Measured channel less the one that the other channels predict, of the shape of the channels, for each equation.

    The difference is a constant, a ramp (biases), moving air and noise.

    Parameters
    ----------
    record : channels.
    errors : instrument errors, names of `ERRORS`, `ALPHA_BIAS` [rad] and `ALPHA_DRIFT` [rad/s]; one without an entry is absent.
    equations : equations to evaluate; those whose channels the record lacks are left out.
    """
    dt = record.dt_s

    def of(channel: str, *kinds: Kind) -> tuple[float, ...]:
        return tuple(errors.get(name, neutral) for name, neutral in (_ERROR[channel, kind] for kind in kinds))

    def rate(channel: str, x: Array, dot: Array) -> Array:
        lag, delay, scale = at = of(channel, *_GYRO)
        return record.kept(channel, at, lambda: earlier(x + lag * dot, dt, delay) / scale)

    p_dot, r_dot = record.dots
    p, r = rate(_P, record.p, p_dot), rate(_R, record.r, r_dot)
    of_p, of_r = of(_P, *_GYRO), of(_R, *_GYRO)
    (phi_late,) = of_phi = of(_PHI, "delay")
    bank = record.kept("bank", of_phi, lambda: earlier(record.bank, dt, phi_late))
    result = {}
    if "phi" in equations and record.phi is not None:
        lag, delay, scale = of_p
        rolled = earlier(record.rolled + lag * (record.p - record.p[..., :1]), dt, delay) / scale
        coupled = record.kept(
            "coupled",
            of_r + of_phi,
            lambda: integral(bank_coupling(record.q, r, bank, record.theta), dt),
        )
        result["phi"] = record.phi - earlier(rolled + coupled, dt, -phi_late)
    if "psi" in equations and record.psi is not None:
        yawed = record.kept(
            "yawed", of_r + of_phi, lambda: integral(heading_rate(record.q, r, bank, record.theta), dt)
        )
        result["psi"] = record.psi - earlier(yawed, dt, -of("psi_rad", "delay")[0])
    if "beta" in equations and (beta := record.beta) is not None:
        of_air = tuple(float(errors.get(name, 0.0)) for name in (ALPHA_BIAS, ALPHA_DRIFT))
        of_ay = of(_AY, "delay", "scale", "arm", "arm_down")
        turned = record.kept(
            "turned",
            of_p + of_r + of_phi + of_air + of_ay,
            lambda: _turned(
                record,
                beta,
                p,
                r,
                record.kept("fall", of_phi, lambda: side_gravity(record.theta, bank)),
                of_air,
                of_ay,
            ),
        )
        scale, arm, lag, delay = of(_BETA, "scale", "arm", "lag", "delay")
        vane = lagged(earlier(turned + arm * r / record.airspeed, dt, -delay), dt, lag)
        result["beta"] = beta - scale * vane
    return result


def _turned(
    record: SideRecord,
    beta: Array,
    p: Array,
    r: Array,
    fall: Array,
    of_air: tuple[float, ...],
    of_ay: tuple[float, ...],
) -> Array:
    """Sideslip that rates and specific force make, up to a constant [rad], of the shape of the channels.

    Parameters
    ----------
    beta : measured sideslip [rad]; p, r : true rates [rad/s]; fall : gravity along body y [m/s2].
    of_air : constant [rad] and ramp [rad/s] of alpha.
    of_ay : delay [s], scale [-], and arms [m] of the accelerometer.
    """
    dt, (delay, scale, x, z) = record.dt_s, of_ay

    def air() -> tuple[Array, Array, Array]:
        ramp = record.t - record.t.mean()
        alpha, sine = record.alpha - of_air[0] - of_air[1] * ramp, np.sin(beta)
        forward = record.path + G0 * np.sin(alpha - record.theta)
        return alpha, forward * sine, np.sqrt(1.0 - sine**2)

    alpha, along, cosine = record.kept("air", of_air, air)
    ay = earlier(record.ay, dt, delay) / scale - record.q * (x * p + z * r)
    force = (ay + fall - along) / cosine
    # the integral of x r_dot/V is x r/V up to the change of V, which does not matter over a manoeuvre
    turned = integral(sideslip_turn(p, r, alpha) + force / record.airspeed, dt)
    return turned - (x * (r - r[..., :1]) - z * (p - p[..., :1])) / record.airspeed


def motions(record: SideRecord) -> Array:
    """(k, samples) motions that aileron and rudder cause.

    A linear model of the record, of beta (or its inertial part), p, r and phi, simulated from each surface: the states, the
    integrals of both rates; from both together: rates of change and low-passes; the surfaces.
    """
    dt = record.dt_s
    beta = record.beta if record.beta is not None else record.bank
    states, surfaces = tuple(s.channel for s in MOTION.states), MOTION.surfaces
    deflections = [getattr(record, name) for name in CONTROLS]
    values = (beta, record.p, record.r, record.bank, *deflections)
    every = {n: x[None] for n, x in zip((*states, *surfaces), values, strict=True)}
    a, b = fitted(every, dt, states, surfaces)
    smooth = np.stack([smoothed_surface(x, dt) for x in deflections])
    each = [simulated(a, b[:, [i]], smooth[None, [i]], dt)[0] for i in range(len(surfaces))]
    whole = each[0] + each[1]
    unit = 1.0 / max(float(np.abs(np.linalg.eigvals(a).imag).max()), 0.1)
    rows = [row for one in each for row in (*one[:3], *integral(one[1:3], dt))]
    rows += [*np.gradient(whole[1:3], dt, axis=1), *smooth]
    rows += [lagged(whole[0], dt, share * unit) for share in _SLOW]
    return np.array(rows)


def _errors_of(*channels: str) -> frozenset[str]:
    """Names of the errors of channels."""
    return frozenset(name for name, error in ERRORS.items() if error.channel in channels)


LATERAL: Final = Kinematics(
    errors=ERRORS,
    channels={"phi": _PHI, "psi": "psi_rad", "beta": _BETA},
    fields={"airspeed_m_s": "airspeed", "theta_rad": "theta", "psi_rad": "psi"}
    | {y.channel: y.name for y in (*MOTION.outputs, *LONGITUDINAL.outputs) if not y.late or y.channel == _AY},
    compare=compare,
    motions=motions,
    controls=" and ".join(CONTROLS),
    reference="span",
    longest=1.5,  # judgement; the nose boom of a T-38 is 1.2 spans ahead of the CG
    same=(frozenset({error_name(_BETA, "arm"), error_name(_AY, "arm")}),),
    telling={error_name(_BETA, "scale"): 0.15, error_name(_BETA, "lag"): 0.1},
    most=4,
    trends=2,
    offsets={ALPHA_BIAS: 1e-3, ALPHA_DRIFT: 1e-4},
    common=True,
    moved_by={
        "phi": _errors_of(_P, _R, _PHI),
        "psi": _errors_of(_R, _PHI, "psi_rad"),
        "beta": frozenset(ERRORS) - _errors_of("psi_rad") | {ALPHA_BIAS, ALPHA_DRIFT},
    },
)
"""The kinematics of the lateral-directional motion (`telling`: judgement, as in the longitudinal motion)."""

ONE_OF: Final = "{}, {} or {}".format(*sorted(LATERAL.channels.values()))
"""Channels of which a record has to have one, in words."""

__all__ = ["CONTROLS", "ERRORS", "LATERAL", "ONE_OF", "SideRecord", "compare", "motions"]
