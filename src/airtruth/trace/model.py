"""A record, a change and a vector of parameters in; innovations and their covariance out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.effects.change import Change, SensorTerm
from airtruth.trace.kernel import F_INERTIA, Plane, evaluate
from airtruth.trace.lower import CHANNELS, Lowered, lower
from airtruth.trace.plant import Plant, inertia_std
from airtruth.trace.records import FINE, Record, nodes
from airtruth.trace.surface import through
from airtruth.units import G0

Array = NDArray[np.float64]

SHARED: Final = (
    "CLalpha",
    "CLq",
    "CLde",
    "Cmalpha",
    "Cmq",
    "Cmde",
    "log_noise_alpha",
    "log_noise_q",
    "log_noise_az",
    "rotary",
    "thrust",
    "rolloff",
    "inertia",
)
"""Parameters that all records share: increments of the derivatives [-], logarithms of noise over declared,
share of the rotary gust (1: all of the specification's; counted from 1/2), relative change of the thrust,
rolloff of the gusts (0: Dryden's, 1: von Karman's; counted from 1/2), relative change of the pitch inertia at
equal derivatives of the pitch acceleration: what it does to the curvature of the tables."""
LOCAL: Final = ("alpha0", "q0", "w1", "w2", "bias_alpha", "bias_q", "bias_az", "CL0", "Cm0", "log_sigma_w")
"""Parameters of one record: initial state, sensors' biases, trim coefficients, logarithm of the gust [m/s]."""
GUST_LEVEL: Final = LOCAL.index("log_sigma_w")
"""Place of the gust level among a record's own parameters."""
BOUNDS: Final = {SHARED.index("rotary"): (-0.75, 0.75), SHARED.index("rolloff"): (-0.75, 0.75)}
"""Shares of none to all, and a quarter beyond for what is no gust of either form."""
_LOOSE_STD: Final = 10.0
"""[1/rad] of a derivative in alpha of which nothing is declared: twice a lift slope."""
_ROTARY_STD: Final = 0.5
_ROLLOFF_STD: Final = 0.5
S, L = len(SHARED), len(LOCAL)
SHARED_STEP: Final = np.array([1e-3, 1e-1, 1e-3, 1e-4, 1e-2, 1e-4, 1e-4, 1e-4, 1e-4, 1e-3, 1e-3, 1e-3, 1e-3])
LOCAL_STEP: Final = np.array([1e-5, 1e-4, 1e-3, 1e-3, 1e-5, 1e-4, 1e-3, 1e-5, 1e-6, 1e-4])


@dataclass(frozen=True)
class Settings:
    """What is declared of sensors and air.

    Attributes
    ----------
    noise : (3,) standard deviation per sample of alpha [rad], q [rad/s], az [m/s2].
    noise_prior : standard deviation of its logarithm.
    bias_std : (3,) of the sensors' biases.
    sigma_w_m_s, sigma_w_prior : middle of the prior of a record's gust level, and standard deviation of its
        logarithm.
    length_w_m : scale length of the vertical gust [m].
    thrust_std : relative standard deviation of the engines' thrust.
    offset_std : (2,) of CL and Cm at trim, about those of the declared aircraft.
    derivatives : (6,) declared, the same for every record, about which the shared inertia turns.
    """

    noise: Array
    noise_prior: float
    bias_std: Array
    sigma_w_m_s: float
    sigma_w_prior: float
    length_w_m: float
    thrust_std: float
    offset_std: Array
    derivatives: Array


@dataclass(frozen=True)
class External:
    """Signals added to CL, Cm (points,) and to the outputs (samples, 3), for tests that name no effect."""

    lift: Array
    moment: Array
    output: Array


@dataclass(frozen=True)
class Response:
    """Innovations e (samples, 3), whitener W, covariance S (3, 3), log|S|; logdet is nan on failure."""

    e: Array
    white: Array
    covariance: Array
    logdet: float


def declared_change(aircraft: Aircraft) -> Change:
    """Position, lag, delay and scale of the sensors as aircraft.toml declares them."""
    terms = []
    for channel in CHANNELS:
        sensor = aircraft.file.sensors.get(channel)
        if sensor is None:
            continue
        for kind, value, neutral in (
            ("arm", sensor.x.value, 0.0),
            ("lag", sensor.lag.value, 0.0),
            ("delay", sensor.delay.value, 0.0),
            ("scale", sensor.scale.value, 1.0),
        ):
            if value != neutral:
                terms.append(SensorTerm(channel, kind, value))  # type: ignore[arg-type]
    return Change(sensors=tuple(terms))


@dataclass(frozen=True)
class Inputs:
    """A record as one change has it, whatever the parameters are.

    Attributes
    ----------
    record, low : the record and the change.
    y : (samples, 3) outputs; de, v, ground, theta : (points,) inputs on the filter's grid, sensors' errors undone.
    reference : (5,) where the gain is made, see `airtruth.trace.kernel.evaluate`.
    """

    record: Record
    low: Lowered
    y: Array
    de: Array
    v: Array
    ground: Array
    theta: Array
    reference: Array


def inputs(record: Record, change: Change | Lowered) -> Inputs:
    """What the filter is given of a record."""
    low = change if isinstance(change, Lowered) else lower(change)
    s, plant = record.signals, record.plant
    y, theta = s.y, s.theta_rad
    if plant.alpha_shift_rad != 0.0:
        y = y - np.array([plant.alpha_shift_rad, 0.0, 0.0])
        theta = theta - plant.alpha_shift_rad
    de, v = _input(low, "elevator_rad", s.elevator_rad), _input(low, "airspeed_m_s", s.airspeed_m_s)
    if low.surface:
        de = through(low.surface, de, s.dt_s / (s.sub * FINE), s.elevator_std_rad)
    de = nodes(de)
    reference = np.array([y[:, 0].mean(), de.mean(), v.mean(), s.density_kg_m3.mean(), theta.mean()])
    return Inputs(record, low, y, de, v, _input(low, "airspeed_m_s", s.ground_m_s), theta, reference)


def respond(
    record: Record,
    settings: Settings,
    change: Change | Lowered,
    shared: Array,
    local: Array,
    external: External | None = None,
    free_run: bool = False,
) -> Response:
    """Innovations, or with ``free_run`` the residuals of a simulation, of one record.

    Parameters
    ----------
    shared : (13,) see `SHARED`; local : (10,) see `LOCAL`.
    """
    return answered(inputs(record, change), settings, shared, local, external, free_run)


def answered(
    given: Inputs,
    settings: Settings,
    shared: Array,
    local: Array,
    external: External | None = None,
    free_run: bool = False,
) -> Response:
    """`respond` where the same inputs serve many parameters."""
    low, s = given.low, given.record.signals
    e = np.empty_like(given.y)
    white, covariance = np.eye(3), np.eye(3)
    if external is None:
        none = np.zeros(given.de.size)
        lift_more, moment_more, output_more = none, none, np.zeros_like(given.y)
    else:
        lift_more, moment_more, output_more = external.lift, external.moment, external.output
    logdet = _evaluated(
        given.y,
        given.de,
        given.v,
        given.ground,
        s.density_kg_m3,
        given.theta,
        lift_more,
        moment_more,
        output_more,
        given.reference,
        s.dt_s,
        s.sub,
        local[:4],
        local[4:7] + low.bias,
        local[7:9],
        (settings.noise * np.exp(shared[6:9])) ** 2,
        free_run,
        low.lags,
        low.delays,
        plane_of(given.record.plant, settings, low, shared, local, float(given.reference[2])),
        low.arms,
        low.scales,
        e,
        white,
        covariance,
    )
    return Response(e, white, covariance, logdet)


def _evaluated(*arguments: Any) -> float:
    try:
        return float(evaluate(*arguments))
    except np.linalg.LinAlgError:  # a covariance that is none
        return float("nan")


def plane_of(
    plant: Plant, settings: Settings, low: Lowered, shared: Array, local: Array, airspeed_m_s: float
) -> Plane:
    """The aircraft with its changes as the kernel reads it."""
    c = plant.aircraft.constants
    constants = np.array(
        [
            c.wing_area_m2,
            c.chord_m,
            c.mass_kg,
            c.inertia_yy_kg_m2,
            G0,
            plant.trim_alpha_rad,
            plant.trim_elevator_rad,
            settings.length_w_m,
            float(np.exp(local[9])),
            0.5 + shared[9],
            4.0 * c.span_m / (np.pi * airspeed_m_s),
            plant.neutral_elevator_rad,
            0.5 + shared[11],
        ]
    )
    declared = np.concatenate([low.declared, plant.thrust, plant.constant * (1.0 + shared[10])])
    declared[F_INERTIA] *= 1.0 + shared[12]
    increments = shared[:6].copy()
    increments[3:] += shared[12] * (settings.derivatives[3:] + shared[3:6])
    return (
        constants,
        declared,
        increments,
        plant.alpha_rad,
        plant.elevator_rad,
        plant.qhat,
        plant.values,
        low.aero_index,
        low.aero_value,
        low.state_index,
        low.state_value,
    )


def _input(low: Lowered, channel: str, x: Array) -> Array:
    """An input as it was before its sensor's undeclared scale and bias."""
    scale, bias = low.input_scale.get(channel, 1.0), low.input_bias.get(channel, 0.0)
    return x if scale == 1.0 and bias == 0.0 else (x - bias) / scale


def start(record: Record, settings: Settings) -> Array:
    """(10,) where the search for a record's own parameters begins."""
    local = np.zeros(L)
    y = record.signals.y
    local[0] = y[: min(5, len(y)), 0].mean() - record.plant.alpha_shift_rad
    local[1] = y[: min(5, len(y)), 1].mean()
    local[9] = np.log(settings.sigma_w_m_s)
    return local


def local_prior(record: Record, settings: Settings) -> tuple[Array, Array]:
    """Middle (10,) and precision (10, 10) of a record's own parameters."""
    middle = start(record, settings)
    std = np.concatenate(
        [
            [0.05, 0.2, 1.0, 1.0],
            settings.bias_std,
            settings.offset_std,
            [settings.sigma_w_prior],
        ]
    )
    precision = np.diag(std**-2.0)
    # w1, w2 of a stationary gust of unit variance: covariance [[1, 1/2], [1/2, 1/2]]
    precision[2:4, 2:4] = np.linalg.inv(np.array([[1.0, 0.5], [0.5, 0.5]]))
    return middle, precision


def shared_prior(record: Record, settings: Settings, loose: Sequence[int] = ()) -> Array:
    """(13, 13) precision of the shared parameters about zero.

    Parameters
    ----------
    loose : derivatives of whose value nothing is declared.
    """
    precision = np.zeros((S, S))
    # an inertia larger by i makes the derivatives of the moment look smaller by i
    std = inertia_std(record.plant)
    turn = np.concatenate([np.zeros(3), -settings.derivatives[3:]])
    covariance = record.plant.derivative_cov - std**2 * np.outer(turn, turn)
    covariance[list(loose), list(loose)] += _LOOSE_STD**2
    own = np.linalg.inv(covariance)
    precision[:6, :6] = own
    precision[12, :6] = precision[:6, 12] = -own @ turn
    precision[12, 12] = turn @ own @ turn + std**-2
    precision[6:9, 6:9] = np.eye(3) * settings.noise_prior**-2
    precision[9, 9] = _ROTARY_STD**-2
    precision[10, 10] = settings.thrust_std**-2
    precision[11, 11] = _ROLLOFF_STD**-2
    return precision


def settings_of(aircraft: Aircraft, length_w_m: float, thrust_std: float, derivatives: Array) -> Settings:
    """What aircraft.toml declares of the sensors, and where it is silent a judgement with a wide prior."""
    noise = np.array([0.1 * np.pi / 180.0, 0.3 * np.pi / 180.0, 0.1])
    bias = np.array([0.5 * np.pi / 180.0, 0.5 * np.pi / 180.0, 0.3])
    prior = 0.1
    for i, channel in enumerate(CHANNELS):
        sensor = aircraft.file.sensors.get(channel)
        if sensor is None or sensor.noise_std.value <= 0.0:
            prior = 1.0
            continue
        # quantisation and white noise add
        noise[i] = np.hypot(sensor.noise_std.value, sensor.quantum.value / np.sqrt(12.0))
        bias[i] = max(abs(sensor.bias.value) * 2.0, bias[i])
    return Settings(
        noise=noise,
        noise_prior=prior,
        bias_std=bias,
        sigma_w_m_s=0.2,
        sigma_w_prior=1.5,
        length_w_m=length_w_m,
        thrust_std=thrust_std,
        offset_std=np.array([0.1, 0.03]),
        derivatives=derivatives,
    )
