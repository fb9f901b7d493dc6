"""From a batch of logs to the regression of the lateral-directional coefficients.

With q_bar(t), V(t) and the rates of a record, the coefficients about the centre of gravity are

    CY = m ay/(q_bar S)
    Cl = [Ixx p' - Ixz (r' + p q) + (Izz - Iyy) q r]/(q_bar S b)
    Cn = [Izz r' - Ixz (p' - q r) + (Iyy - Ixx) p q]/(q_bar S b)

and each is a sum of derivatives times beta, p b/(2V), r b/(2V), aileron and rudder, and a constant. A left side x a' is
written as (x a)' - x' a, so that any filter takes the derivative and the equations hold exactly behind it.

Source: V. Klein and E. A. Morelli, Aircraft System Identification, AIAA, 2006, 5.1.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airtruth.channels import BANK
from airtruth.identification.condition import window_samples
from airtruth.identification.lateral.kernels import left_sides
from airtruth.identification.options import Options
from airtruth.logs.flight_log import Batch
from airtruth.numerics.intersample import servo_bend
from airtruth.numerics.prefilter import butterworth, zero_phase
from airtruth.physics.atmosphere import air_density
from airtruth.physics.lateral import LateralConstants, LateralScale, lateral_scale
from airtruth.physics.motion import LATERAL, LONGITUDINAL
from airtruth.units import G0

Array = NDArray[np.float64]
Each = LateralConstants | Sequence[LateralConstants]
"""Constants of all batches, or one entry for each of them."""

REGRESSORS: Final = tuple(signal.channel for signal in LATERAL.signals)
"""Channels of the regressors."""
CONTROLS: Final = tuple(control.channel for control in LATERAL.controls)
"""Channels of the controls."""
ROLL, YAW = LATERAL.gyros
"""Channels of the rates."""
_SIDE: Final = LATERAL.outputs[-1].channel
"""Channel of the specific force along body y."""
_ATTACK, _PITCH = LONGITUDINAL.vane, LONGITUDINAL.gyros[0]
"""Channels of the other axis."""
_BETA: Final = REGRESSORS.index(LATERAL.vane)
"""Number of the regressor whose square is a term."""
_RATES: Final = slice(REGRESSORS.index(ROLL), REGRESSORS.index(YAW) + 1)
"""Regressors that are angular rates."""


@dataclass(frozen=True)
class Known:
    """Channels of the other axis, and of the sideslip, in the log.

    Attributes
    ----------
    beta, phi : (runs, samples) sideslip and bank [rad], measured or reconstructed.
    alpha, theta, q : (runs, samples) [rad], [rad/s]; those of the steady flight where the log lacks them.
    trend : order of the polynomial that the error of a reconstructed beta has; 0 where it is measured.
    """

    beta: Array
    phi: Array
    alpha: Array
    theta: Array
    q: Array
    trend: int


@dataclass(frozen=True)
class LateralObservation:
    """Regression of runs of one length, unfiltered.

    Attributes
    ----------
    dt_s : sample period [s].
    regressors : (runs, signals, samples) beta, p b/(2V), r b/(2V), aileron, rudder [-], relative to the trim.
    slopes, added : (runs, coefficients, samples) left sides: the rate of ``slopes`` [s] plus ``added`` [-].
    bend : (runs, controls, samples) mean of the controls over the cell that ends at each sample, less that of the smooth
        interpolation [rad].
    trend : order of the polynomial in time that is free in each equation.
    terms : (runs, terms, samples) nonlinear terms that are free in each equation, by ``options.terms``.
    scale : factors (runs,) of the flight condition.
    """

    dt_s: float
    regressors: Array
    slopes: Array
    added: Array
    bend: Array
    trend: int
    terms: Array
    scale: LateralScale

    @property
    def controls(self) -> Array:
        """(runs, controls, samples) aileron and rudder [rad], relative to the trim."""
        return self.regressors[:, -len(CONTROLS) :]

    def nuisance(self) -> Array:
        """(runs, columns, samples) 1, powers of time beside a reconstructed sideslip, and nonlinear terms [-]."""
        runs, _, samples = self.regressors.shape
        t = np.linspace(-1.0, 1.0, samples)
        powers = np.stack([t**k for k in range(self.trend + 1)])
        return np.concatenate([np.broadcast_to(powers, (runs, *powers.shape)), self.terms], axis=1)


def nonlinear_columns(names: Collection[str]) -> tuple[tuple[str, int], ...]:
    """Terms of `nonlinear` in their order: name, and position of the signal."""
    signals = len(REGRESSORS)
    made = [("alpha", j) for j in range(signals)] if "alpha" in names else []
    return (*made, *([("beta", _BETA)] if "beta" in names else []))


def nonlinear(regressors: Array, alpha: Array, names: Collection[str]) -> Array:
    """Terms (runs, terms, samples) that a linear model lacks.

    Parameters
    ----------
    regressors : (runs, signals, samples), about the trim.
    alpha : (runs, samples) angle of attack about the one at which the derivatives hold [rad].
    names : "alpha": the product of each signal with alpha; "beta": beta |beta|.
    """
    runs, _, samples = regressors.shape
    made = [np.empty((runs, 0, samples))]
    if "alpha" in names:
        made.append(regressors * alpha[:, None])
    if "beta" in names:
        beta = regressors[:, [_BETA]]
        made.append(beta * np.abs(beta))
    return np.concatenate(made, axis=1)


class SteadyFlight(NamedTuple):
    """Flight before the manoeuvre.

    Attributes
    ----------
    attack : (runs,) measured angle of attack [rad].
    variance : (runs,) of it, because turbulence moves it [rad2].
    """

    attack: Array
    variance: Array


def steady_flight(batch: Batch, options: Options) -> SteadyFlight:
    """Mean over the first ``options.trim_window_s``, and the variance of means over pieces of that length.

    Both are zero where the log lacks the angle of attack.
    """
    attack = _attack(batch)
    samples = attack.shape[1]
    length = samples // max(2, samples // window_samples(options, batch.dt_s))
    means = attack[:, : samples // length * length].reshape(len(attack), -1, length).mean(axis=2)
    return SteadyFlight(means[:, 0], means.var(axis=1, ddof=1))


def change_of_attack(batch: Batch, steady: Array) -> Array:
    """(runs, samples) measured angle of attack about a steady one (runs,) [rad]; about zero where the log lacks it."""
    return np.asarray(_attack(batch) - steady[:, None])


def _attack(batch: Batch) -> Array:
    return np.asarray(batch.channels.get(_ATTACK, np.zeros_like(batch.t_s)))


def known_inputs(batch: Batch) -> Known:
    """Channels of the other axis and the sideslip, measured or reconstructed; nothing is checked.

    Without theta or alpha the flight is level: one stands for the other; without both, body and path are horizontal.
    Without q its products are left out. Without beta_rad, beta' = ay/V + p sin(alpha) - r cos(alpha) + (g/V) cos(theta)
    sin(phi) is integrated; without phi_rad, phi' = p + (q sin(phi) + r cos(phi)) tan(theta) is, from level wings.

    Source: V. Klein and E. A. Morelli, Aircraft System Identification, AIAA, 2006, 3.2.
    """
    c, dt_s = batch.channels, batch.dt_s
    p, r = c[ROLL], c[YAW]
    zero = np.zeros_like(p)
    alpha = c.get(_ATTACK, c.get("theta_rad", zero))
    theta, q = c.get("theta_rad", alpha), c.get(_PITCH, zero)
    phi, trend = c.get(BANK), 0
    if phi is None:
        phi, trend = integrated(p + r * np.tan(theta), dt_s), 1
        phi = integrated(p + (q * np.sin(phi) + r * np.cos(phi)) * np.tan(theta), dt_s)
    beta = c.get(LATERAL.vane)
    if beta is None:
        v, trend = c["airspeed_m_s"], trend + 1
        rate = (c[_SIDE] + G0 * np.cos(theta) * np.sin(phi)) / v + p * np.sin(alpha) - r * np.cos(alpha)
        beta = integrated(rate, dt_s)
    else:
        trend = 0
    return Known(beta, phi, alpha, theta, q, trend)


def assumed(channels: Collection[str]) -> list[str]:
    """Sentences on the channels that a lateral identification replaces by the steady flight or reconstructs."""
    notes = []
    if not {_ATTACK, "theta_rad"} & set(channels):
        notes.append(
            f"lateral motion: without {_ATTACK} and theta_rad the flight path and the body are taken as level"
        )
    elif _ATTACK not in channels:
        notes.append(f"lateral motion: without {_ATTACK} the path is taken as level, alpha as theta")
    elif "theta_rad" not in channels:
        notes.append("lateral motion: without theta_rad the path is taken as level, theta as alpha")
    if _PITCH not in channels:
        notes.append(f"lateral motion: without {_PITCH} the products of the rates are left out")
    if BANK not in channels and LATERAL.vane not in channels:
        notes.append("lateral motion: phi is integrated from p and r, from level wings")
    if LATERAL.vane not in channels:
        notes.append(
            "lateral motion: beta is reconstructed from ay, p, r and phi, and a trend in time is free in each equation; gusts "
            "are no part of it, so that the derivatives of beta err in turbulence"
        )
    return notes


def integrated(rate: Array, dt_s: float) -> Array:
    """(runs, samples) integral of a rate from 0, by the cubic through the four nearest samples of each cell."""
    edge = np.concatenate([rate[:, :1], rate, rate[:, -1:]], axis=1)
    cells = (13.0 * (rate[:, :-1] + rate[:, 1:]) - edge[:, :-3] - edge[:, 3:]) * (dt_s / 24.0)
    return np.concatenate([np.zeros_like(rate[:, :1]), np.cumsum(cells, axis=1)], axis=1)


def condition_of(batch: Batch, constants: LateralConstants, options: Options, known: Known) -> LateralScale:
    """Factors (runs,) of a constant flight condition, by ``options.condition``; "motion" weighs by the angular rates."""
    c = batch.channels
    signals = (c["airspeed_m_s"], air_density(c), known.alpha, known.theta)
    if options.condition == "motion":
        weight = np.zeros_like(c[ROLL])
        for name in LATERAL.gyros:
            weight += (c[name] - c[name].mean(axis=1, keepdims=True)) ** 2
        weight /= np.maximum(weight.sum(axis=1, keepdims=True), np.finfo(float).tiny)
        airspeed, density, alpha, theta = (np.einsum("rn,rn->r", x, weight) for x in signals)
    else:
        last = window_samples(options, batch.dt_s) if options.condition == "window" else None
        airspeed, density, alpha, theta = (x[:, :last].mean(axis=1) for x in signals)
    if options.airspeed_m_s is not None:
        airspeed = np.full_like(airspeed, options.airspeed_m_s)
    return lateral_scale(constants, airspeed, density, alpha, theta)


def observe(batch: Batch, constants: LateralConstants, options: Options) -> LateralObservation:
    """Return the regression of a batch; nothing is checked.

    Parameters
    ----------
    batch, constants : runs and aircraft.
    options : choices; the dynamic pressure is measured at each sample unless it is "constant" or an airspeed is given.
    """
    c, dt_s = batch.channels, batch.dt_s
    known = known_inputs(batch)
    scale = condition_of(batch, constants, options, known)
    shape = c[ROLL].shape
    force = np.broadcast_to(scale.force[:, None] * constants.mass_kg, shape)  # q_bar S
    half = np.broadcast_to(scale.half_span_time[:, None], shape)
    if options.pressure != "constant" and options.airspeed_m_s is None:
        # gusts that move the aircraft are slower than the low-pass
        sos = butterworth(options.cutoff_of(dt_s), options.order, dt_s)
        airspeed = zero_phase(c["airspeed_m_s"], sos)
        force = 0.5 * air_density(c) * airspeed**2 * constants.wing_area_m2
        half = constants.span_m / (2.0 * airspeed)
    regressors = np.empty((shape[0], len(REGRESSORS), shape[1]))
    slopes, added = (np.empty((shape[0], len(LATERAL.coefficients), shape[1])) for _ in range(2))
    left_sides(
        np.ascontiguousarray(force),
        np.ascontiguousarray(half),
        np.stack([c[ROLL], known.q, c[YAW], c[_SIDE]]),
        (
            dt_s,
            constants.mass_kg,
            constants.span_m,
            constants.inertia_xx_kg_m2,
            constants.inertia_yy_kg_m2,
            constants.inertia_zz_kg_m2,
            constants.inertia_xz_kg_m2,
        ),
        regressors[:, _RATES],
        slopes,
        added,
    )
    for number, name in enumerate(REGRESSORS):
        if number not in range(shape[1])[_RATES]:
            regressors[:, number] = known.beta if number == _BETA else c[name]
    window = window_samples(options, dt_s) if options.trim == "mean" else 1
    origin = regressors[..., :window].mean(axis=-1, keepdims=True)
    regressors -= origin
    surfaces = np.concatenate([c[name] for name in CONTROLS])
    terms = np.empty((shape[0], 0, shape[1]))
    if options.terms:
        attack = change_of_attack(batch, steady_flight(batch, options).attack)
        terms = nonlinear(regressors, attack, options.terms)
    return LateralObservation(
        dt_s=dt_s,
        regressors=regressors,
        slopes=slopes,
        added=added,
        bend=np.stack(np.split(servo_bend(surfaces), len(CONTROLS)), axis=1),
        trend=known.trend,
        terms=terms,
        scale=scale,
    )


__all__ = [
    "CONTROLS",
    "Each",
    "Known",
    "LateralObservation",
    "SteadyFlight",
    "assumed",
    "change_of_attack",
    "condition_of",
    "integrated",
    "known_inputs",
    "nonlinear",
    "nonlinear_columns",
    "observe",
    "steady_flight",
]
