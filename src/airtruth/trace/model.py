"""A record, a change and a vector of parameters in; innovations and their covariance out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.effects.change import Change, SensorTerm
from airtruth.effects.dynamics import declared_dynamics
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
    "colour_alpha",
    "colour_q",
    "colour_az",
    "log_colour_time",
)
"""Parameters that all records share: increments of the derivatives [-], logarithms of noise over declared,
share of the rotary gust (1: all of the specification's; counted from 1/2), relative change of the thrust,
rolloff of the gusts (0: Dryden's, 1: von Karman's; counted from 1/2), relative change of the pitch inertia at
equal derivatives of the pitch acceleration: what it does to the curvature of the tables; share of the sensors'
noise variance that is slow, and the logarithm of its correlation time over 0.1 s."""
LOCAL: Final = ("alpha0", "q0", "w1", "w2", "bias_alpha", "bias_q", "bias_az", "CL0", "Cm0", "log_sigma_w")
"""Parameters of one record: initial state, sensors' biases, trim coefficients, logarithm of the gust [m/s]."""
OFFSETS: Final = (4, 5, 6, 7, 8)
"""Places of biases and trim coefficients among a record's own parameters."""
MOTION: Final = (0, 1, *OFFSETS)
"""Places of all but the gusts: initial alpha and q, biases, trim coefficients."""
GUST_LEVEL: Final = LOCAL.index("log_sigma_w")
"""Place of the gust level among a record's own parameters."""
COLOUR: Final = tuple(range(SHARED.index("colour_alpha"), len(SHARED)))
"""Places of the sensors' slow noise among the shared parameters."""
NOISE: Final = (*range(6, 9), *COLOUR)
"""Places of all that is noise of the sensors."""
COLOUR_TIME_S: Final = 0.1
BOUNDS: Final = {
    SHARED.index("rotary"): (-0.75, 0.75),
    SHARED.index("rolloff"): (-0.75, 0.75),
    **dict.fromkeys(COLOUR[:3], (0.0, 0.95)),
    COLOUR[3]: (-1.6, 1.0),
}
"""Shares of gusts of none to all, and a quarter beyond for what is no gust of either form; slow noise that leaves
some white noise, correlated over 20 to 270 ms: what is slower is motion."""
_LOOSE_STD: Final = 10.0
"""[1/rad] of a derivative in alpha of which nothing is declared: twice a lift slope."""
_LOOSE_OFFSET_STD: Final = 0.5
"""Of the coefficient at the trim: a curvature of 40 about zero has 0.4 at 0.1 rad."""
_ROTARY_STD: Final = 0.5
_ROLLOFF_STD: Final = 0.5
_NOISE_STD, _NOISE_UNKNOWN_STD = 0.1, 1.0
_MOST_SLOW: Final = 0.99
"""Share of slow noise beyond the search's bound, where differences have to see its slope."""
_COLOUR_STD: Final = (0.5, 0.5, 0.5, 0.7)
S, L = len(SHARED), len(LOCAL)
SHARED_STEP: Final = np.array(
    [1e-3, 1e-1, 1e-3, 1e-4, 1e-2, 1e-4, 1e-4, 1e-4, 1e-4, 1e-3, 1e-3, 1e-3, 1e-3] + [1e-3] * 4
)
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
    coloured : whether part of the sensors' noise may be slow.
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
    coloured: bool = False

    @property
    def noise_is_declared(self) -> bool:
        """Whether the sensors' noise levels are more than a judgement."""
        return self.noise_prior < _NOISE_UNKNOWN_STD


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
    """What aircraft.toml declares beyond forces at rest: the sensors' position, lag, delay and scale, the dynamics."""
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
    return Change(sensors=tuple(terms)) + declared_dynamics(aircraft.file.dynamics)


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
    shared : (17,) see `SHARED`; local : (10,) see `LOCAL`.
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
    variance, colour = sensor_noise(settings, shared)
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
        variance,
        free_run,
        low.lags,
        low.delays,
        colour,
        plane_of(given.record.plant, settings, low, shared, local, float(given.reference[2])),
        low.arms,
        low.scales,
        e,
        white,
        covariance,
    )
    return Response(e, white, covariance, logdet)


def sensor_noise(settings: Settings, shared: Array) -> tuple[Array, Array]:
    """Variances (3,) of the sensors' white noise, and of the slow one (4,) standard deviations and time [s]."""
    variance = (settings.noise * np.exp(shared[6:9])) ** 2
    share = np.clip(shared[list(COLOUR[:3])], 0.0, _MOST_SLOW)
    time_s = COLOUR_TIME_S * np.exp(shared[COLOUR[3]])
    return variance * (1.0 - share), np.append(np.sqrt(variance * share), time_s)


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


def active(settings: Settings) -> tuple[int, ...]:
    """Places of the shared parameters that are free."""
    return tuple(i for i in range(S) if settings.coloured or i not in COLOUR)


def start(record: Record, settings: Settings) -> Array:
    """(10,) where the search for a record's own parameters begins."""
    local = np.zeros(L)
    y = record.signals.y
    local[0] = y[: min(5, len(y)), 0].mean() - record.plant.alpha_shift_rad
    local[1] = y[: min(5, len(y)), 1].mean()
    local[9] = np.log(settings.sigma_w_m_s)
    return local


def local_prior(record: Record, settings: Settings, loose: Sequence[int] = ()) -> tuple[Array, Array]:
    """Middle (10,) and precision (10, 10) of a record's own parameters.

    Parameters
    ----------
    loose : derivatives of whose coefficient nothing is declared.
    """
    middle = start(record, settings)
    std = np.concatenate(
        [
            [0.05, 0.2, 1.0, 1.0],
            settings.bias_std,
            np.where([0 in loose, 3 in loose], _LOOSE_OFFSET_STD, settings.offset_std),
            [settings.sigma_w_prior],
        ]
    )
    precision = np.diag(std**-2.0)
    # w1, w2 of a stationary gust of unit variance: covariance [[1, 1/2], [1/2, 1/2]]
    precision[2:4, 2:4] = np.linalg.inv(np.array([[1.0, 0.5], [0.5, 0.5]]))
    return middle, precision


def shared_prior(record: Record, settings: Settings, loose: Sequence[int] = ()) -> Array:
    """(17, 17) precision of the shared parameters about zero.

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
    precision[COLOUR, COLOUR] = np.array(_COLOUR_STD) ** -2.0
    return precision


def settings_of(aircraft: Aircraft, length_w_m: float, thrust_std: float, derivatives: Array) -> Settings:
    """What aircraft.toml declares of the sensors, and where it is silent a judgement with a wide prior."""
    noise = np.array([0.1 * np.pi / 180.0, 0.3 * np.pi / 180.0, 0.1])
    bias = np.array([0.5 * np.pi / 180.0, 0.5 * np.pi / 180.0, 0.3])
    prior = _NOISE_STD
    for i, channel in enumerate(CHANNELS):
        sensor = aircraft.file.sensors.get(channel)
        if sensor is None or sensor.noise_std.value <= 0.0:
            prior = _NOISE_UNKNOWN_STD
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
