"""Declared sensors, gusts and aircraft of a trace: settings, priors, and the start of a search."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.aircraft.dynamics import declared_dynamics
from airtruth.physics.motion import LATERAL, LONGITUDINAL, Motion
from airtruth.physics.sensor_errors import KINDS, Kind
from airtruth.physics.terms import Change, SensorTerm
from airtruth.tracing.model.compile import CHANNELS
from airtruth.tracing.model.declared import inertia_std
from airtruth.tracing.model.parameters import SHORT_PERIOD, ParameterLayout
from airtruth.tracing.model.records import TraceRecord
from airtruth.units import DEG

Array = NDArray[np.float64]

LAYOUTS: Final[Mapping[str, ParameterLayout]] = {
    LONGITUDINAL.name: SHORT_PERIOD,
    LATERAL.name: ParameterLayout(LATERAL),
}
"""Motion -> its free parameters."""
VANE: Final = CHANNELS[0]
"""Output that a log without a vane does not have."""
_CARRIED: Final[Mapping[str, tuple[Kind, ...]]] = {
    LONGITUDINAL.name: ("arm", "lag", "delay", "scale"),
    LATERAL.name: ("arm", "arm_down", "lag", "delay", "scale"),
}
"""Motion -> declared errors of a sensor that the filter carries; its bias is a per-record parameter."""
_UNCONSTRAINED_STD: Final = 10.0
"""Prior standard deviation of an unconstrained derivative in alpha [1/rad]: twice a lift slope (judgement)."""
_UNCONSTRAINED_TRIM_STD: Final = 0.5
"""Prior standard deviation of the coefficient at the trim beside an unconstrained derivative [-]: a curvature of 40 about zero
gives 0.4 at 0.1 rad (judgement)."""
_NOISE_STD: Final = 0.1
"""Prior standard deviation of the logarithm of declared noise [-]: data sheets are right within 10 % (judgement)."""
_NOISE_UNKNOWN_STD: Final = 1.0
"""Prior standard deviation of the logarithm of the noise where none is declared [-]: a factor of e (judgement)."""
_NOISE: Final = {"vane": 0.1 * DEG, "gyro": 0.3 * DEG, "accelerometer": 0.1, "attitude": 0.1 * DEG}
"""Instrument -> noise where none is declared [rad], [rad/s], [m/s2]: small flight-test instruments (judgement)."""
_RESOLUTION: Final = 0.01
"""Least error of a model, as a share of a channel's standard deviation [-] (judgement): tables, steps of integration and
frames of a simulator. Sensors of flight tests have several times that noise, the GTM's 4 to 8 %."""
_UNMEASURED_RAD: Final = 1e3
"""Standard deviation that an angle without an instrument has as an output [rad]: large enough that it adds nothing to
the likelihood in double precision, small enough for the inverse of the covariance (judgement)."""
_BIAS_STD: Final = {"vane": 0.5 * DEG, "gyro": 0.5 * DEG, "accelerometer": 0.3, "attitude": 0.5 * DEG}
"""Prior standard deviations of their biases [same units] (judgement)."""
_TRIM_STD: Final[Mapping[str | None, float]] = {None: 0.1, "chord": 0.03, "span": 0.02}
"""Reference length of a coefficient, None for a force -> prior standard deviation at the trim about the declared aircraft's [-]
(judgement)."""
_GUST_M_S: Final = 0.2
"""Median of the prior of a record's gust level [m/s]: calm morning air (judgement)."""
_LOG_GUST_STD: Final = 1.5
"""Prior standard deviation of its logarithm [-]: a factor of 4.5 to either side (judgement)."""
_START_ANGLE_STD, _START_RATE_STD = 0.05, 0.2
"""Prior standard deviations of an initial angle [rad] and of a rate [rad/s] about the first samples (judgement)."""
_MEAN_GUST_STD: Final = 0.02
"""Prior standard deviation of the mean gust of a record over the airspeed, up [rad] or along the path [-] (judgement: light to
moderate gusts at 40 m/s, whose correlation time is longer than a record)."""
GUST_COVARIANCE: Final = np.array([[1.0, 0.5], [0.5, 0.5]])
"""Stationary covariance of the two states of Dryden's vertical filter at unit gust variance [-] (MIL-F-8785C,
3.7.1.2, by the Lyapunov equation)."""
_FIRST_SAMPLES: Final = 5
"""Samples whose mean starts the states [-]: less noise than one, less motion than many (judgement)."""


@dataclass(frozen=True)
class Settings:
    """Declared sensors and gusts, the same for all records.

    Attributes
    ----------
    noise : (outputs,) standard deviation per sample [units of the outputs].
    noise_prior : prior standard deviation of its logarithm [-].
    bias_std : (outputs,) of the sensors' biases [same units].
    gust_m_s, log_gust_std : median of the prior of a record's gust level [m/s], and standard deviation of its
        logarithm [-].
    thrust_std : relative standard deviation of the engines' thrust [-].
    trim_std : (coefficients,) at the trim, about those of the declared aircraft [-].
    coloured : whether part of the sensors' noise may be slow.
    resolution : (outputs,) standard deviation of what the model does not resolve of the outputs, beside the noise [same units].
    layout : free parameters of the motion.
    """

    noise: Array
    noise_prior: float
    bias_std: Array
    gust_m_s: float
    log_gust_std: float
    thrust_std: float
    trim_std: Array
    coloured: bool = False
    resolution: Array = field(default_factory=lambda: np.zeros(len(LONGITUDINAL.outputs)))
    layout: ParameterLayout = SHORT_PERIOD

    @property
    def measured(self) -> NDArray[np.bool_]:
        """(outputs,) whether an instrument measured the output; an angle may be reconstructed."""
        return np.asarray(self.resolution < _UNMEASURED_RAD)

    @property
    def noise_is_declared(self) -> bool:
        """Whether the sensors' noise levels are declared, not assumed."""
        return self.noise_prior < _NOISE_UNKNOWN_STD


def settings_of(
    aircraft: Aircraft,
    thrust_std: float,
    motion: Motion = LONGITUDINAL,
    *,
    absent: Collection[str] = (),
) -> Settings:
    """Read what aircraft.toml declares of the sensors; where it is silent, assume judgements with wide priors.

    Parameters
    ----------
    thrust_std : relative standard deviation of the engines' thrust [-].
    motion : whose outputs are measured.
    absent : outputs that no instrument measured; each is a state of the filter and no output.
    """
    instruments = [output.instrument for output in motion.outputs]
    noise, bias = (np.array([table[name] for name in instruments]) for table in (_NOISE, _BIAS_STD))
    prior = _NOISE_STD
    for i, channel in enumerate(motion.output_channels):
        sensor = aircraft.file.sensors.get(channel)
        if channel in absent:
            continue
        if sensor is None or sensor.noise_std.value <= 0.0:
            prior = _NOISE_UNKNOWN_STD
            continue
        # quantisation and white noise add
        noise[i] = np.hypot(sensor.noise_std.value, sensor.quantum.value / np.sqrt(12.0))
        bias[i] = max(abs(sensor.bias.value) * 2.0, bias[i])
    settings = Settings(
        noise=noise,
        noise_prior=prior,
        bias_std=bias,
        gust_m_s=_GUST_M_S,
        log_gust_std=_LOG_GUST_STD,
        thrust_std=thrust_std,
        trim_std=np.array([_TRIM_STD[c.length] for c in motion.coefficients]),
        resolution=np.zeros(len(motion.outputs)),
        layout=LAYOUTS[motion.name],
    )
    for channel in absent:
        settings = without(settings, motion.output_channels.index(channel))
    return settings


def without(settings: Settings, output: int) -> Settings:
    """Settings under which an angle is a state of the filter and no output; ``output`` is its number."""
    number = np.arange(len(settings.resolution))
    return replace(settings, resolution=np.where(number == output, _UNMEASURED_RAD, settings.resolution))


def resolved(settings: Settings, records: Sequence[TraceRecord]) -> Settings:
    """Settings with a resolution of the model where the noise is not declared.

    Ideal sensors would otherwise have no noise, and gusts would explain them sample by sample.
    """
    if settings.noise_is_declared:
        return settings
    spread = np.sqrt(np.mean([r.signals.y.var(axis=0) for r in records], axis=0))
    return replace(
        settings, resolution=np.where(settings.measured, _RESOLUTION * spread, settings.resolution)
    )


def declared_change(
    aircraft: Aircraft, motion: Motion = LONGITUDINAL, *, absent: Collection[str] = ()
) -> Change:
    """Declarations of aircraft.toml beyond forces at rest: the sensors' position, lag, delay and scale, the dynamics.

    Parameters
    ----------
    motion : whose outputs count; the dynamics are those of the pitch plane.
    absent : outputs that no instrument measured; their declared errors are left out.
    """
    sensors = aircraft.file.sensors
    terms = [
        SensorTerm(channel, kind, sensors[channel].errors().value(kind))
        for channel in motion.output_channels
        if channel in sensors and channel not in absent
        for kind in _CARRIED[motion.name]
    ]
    effective = Change(sensors=tuple(t for t in terms if t.value != KINDS[t.kind].neutral))
    return effective if motion is LATERAL else effective + declared_dynamics(aircraft.file.dynamics)


def free_common(settings: Settings) -> tuple[int, ...]:
    """Indices of the common parameters that are free."""
    common = settings.layout.common
    return tuple(range(common.size if settings.coloured else common.colour.start))


def initial_per_record(record: TraceRecord, settings: Settings) -> Array:
    """(per-record,) where the search for a record's own parameters starts."""
    entries, motion = settings.layout.per_record, settings.layout.motion
    values = np.zeros(entries.size)
    y = record.signals.with_lead.y
    first = y[: min(_FIRST_SAMPLES, len(y))]
    channels = [motion.output_channels.index(state.channel) for state in motion.states]
    values[entries.motion_start] = [first[:, i].mean() for i in channels]
    values[0] -= record.plant.alpha_shift_rad
    values[entries.log_gust] = np.log(settings.gust_m_s)
    return values


def per_record_prior(
    record: TraceRecord, settings: Settings, unconstrained: Sequence[int] = ()
) -> tuple[Array, Array]:
    """Mean (per-record,) and precision (per-record, per-record) of the prior of a record's own parameters.

    Parameters
    ----------
    unconstrained : indices of the derivatives whose coefficient is not constrained by what is declared.
    """
    entries, motion = settings.layout.per_record, settings.layout.motion
    std = np.ones(entries.size)
    std[entries.motion_start] = [
        _START_RATE_STD if state.channel.endswith("_rad_s") else _START_ANGLE_STD for state in motion.states
    ]
    std[entries.bias] = settings.bias_std
    free = [
        bool({*range(*motion.row(c.name).indices(len(motion.parameters)))} & {*unconstrained})
        for c in motion.coefficients
    ]
    std[entries.trim] = np.where(free, _UNCONSTRAINED_TRIM_STD, settings.trim_std)
    std[entries.log_gust] = settings.log_gust_std
    std[entries.mean_gust] = _MEAN_GUST_STD
    precision = np.diag(std**-2.0)
    precision[entries.gusts, entries.gusts] = np.linalg.inv(GUST_COVARIANCE)
    return initial_per_record(record, settings), precision


def declared_derivatives_of(records: Sequence[TraceRecord]) -> Array:
    """(derivatives,) declared values, averaged over the records' flight conditions [-]."""
    return np.asarray(np.mean([r.plant.derivatives for r in records], axis=0))


def declared_covariance_of(records: Sequence[TraceRecord]) -> Array:
    """(6, 6) covariance of the increments of the derivatives by what is declared.

    The declaration states one uncertainty, relative to derivatives that depend on the flight condition. Its values at
    several conditions are not independent statements about the common increments, so that their covariances are
    averaged over the records; precisions are not added.
    """
    return np.asarray(np.mean([r.plant.derivative_cov for r in records], axis=0))


def common_prior(
    records: Sequence[TraceRecord],
    settings: Settings,
    unconstrained: Sequence[int] = (),
    spread: Array | None = None,
) -> Array:
    """(common, common) precision of the common parameters about zero.

    Parameters
    ----------
    records : records whose flight conditions count, see `declared_covariance_of`.
    unconstrained : indices of the derivatives that are not constrained by what is declared.
    spread : (6, 6) covariance of the increments of the derivatives beyond the declared one; None for none.
    """
    entries, motion = settings.layout.common, settings.layout.motion
    precision = np.zeros((entries.size, entries.size))
    derivatives, inertia = entries.derivatives, entries.inertia
    # an inertia larger by i makes the derivatives of the moment look smaller by i
    std = inertia_std(records[0].plant.aircraft, motion)
    turn = np.zeros(derivatives.stop)
    for row in (motion.row(c.name) for c in motion.coefficients if c.length is not None):
        turn[row] = -declared_derivatives_of(records)[row]
    covariance = declared_covariance_of(records) - std**2 * np.outer(turn, turn)
    covariance[list(unconstrained), list(unconstrained)] += _UNCONSTRAINED_STD**2
    if spread is not None:
        covariance += spread
    own = np.linalg.inv(covariance)
    precision[derivatives, derivatives] = own
    precision[inertia, derivatives] = precision[derivatives, inertia] = -own @ turn
    precision[inertia, inertia] = turn @ own @ turn + std**-2
    diagonal = np.zeros(entries.size)
    diagonal[entries.log_noise] = settings.noise_prior**-2
    diagonal[entries.thrust] = settings.thrust_std**-2
    diagonal[list(entries.std)] = np.array(list(entries.std.values())) ** -2.0
    return precision + np.diag(diagonal)


__all__ = [
    "GUST_COVARIANCE",
    "LAYOUTS",
    "VANE",
    "Settings",
    "common_prior",
    "declared_change",
    "declared_covariance_of",
    "declared_derivatives_of",
    "free_common",
    "initial_per_record",
    "per_record_prior",
    "resolved",
    "settings_of",
    "without",
]
