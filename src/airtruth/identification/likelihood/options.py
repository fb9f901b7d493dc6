"""Options of filter error: noise of the sensors, the air, and how to search."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import ConfigurationError, choices
from airtruth.identification.likelihood.predictor import AIRSPEED, LEVELS, OUTPUTS
from airtruth.identification.options import Options
from airtruth.physics.motion import LONGITUDINAL

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

CHANNELS: Final = {output.name: output.channel for output in LONGITUDINAL.outputs} | {
    AIRSPEED: "airspeed_m_s"
}
"""Output of the predictor -> column of the log."""
PRESSURES: Final = ("constant", "measured")
"""Values of ``pressure``."""


@dataclass(frozen=True)
class FilterOptions:
    """Declared noise and air, and how to search.

    Attributes
    ----------
    alpha_std_rad, q_std_rad_s, az_std_m_s2 : standard deviation of the sensors' white noise per sample.
    sigma_u_m_s, sigma_w_m_s : standard deviations of the gusts [m/s]; both 0 is output error.
    length_u_m, length_w_m : their scale lengths [m].
    airspeed_std_m_s : noise of the airspeed [m/s]; None does not use airspeed as an output.
    level_prior : standard deviation of the logarithm of each level about its declared value [-]; None
        takes the declared values as known. A level declared 0 stays 0.
    gust_prior : the same for the gusts and the moment's noise, instead of ``level_prior``; None: the same.
    moment_noise : declared intensity of white noise in q_dot, the part that the linear moment does not explain
        [rad/s per root second]; a level like the others. 0: none.
    trim_moment_prior : standard deviation of the aerodynamic moment coefficient of the trim, which thrust
        balances and through which u pitches the aircraft [-]; None: there is none.
    pressure : "constant" dynamic pressure of the record, or "measured" at each sample
        (`airtruth.identification.likelihood.pressure`).
    tolerance : a fit has converged once a step would move it by less than this many standard errors,
        all parameters together; that last step is taken.
    maximum_iterations : steps after which a fit is reported as not converged.
    condition, airspeed_m_s : flight condition, as in `airtruth.identification.Options`.
    confidence : probability of the intervals [-].
    """

    alpha_std_rad: float
    q_std_rad_s: float
    az_std_m_s2: float
    sigma_u_m_s: float
    sigma_w_m_s: float
    length_u_m: float
    length_w_m: float
    airspeed_std_m_s: float | None = None
    level_prior: float | None = 0.2
    gust_prior: float | None = None
    moment_noise: float = 0.0
    trim_moment_prior: float | None = None
    pressure: str = "constant"
    tolerance: float = 0.02
    maximum_iterations: int = 50
    condition: str = "motion"
    airspeed_m_s: float | None = None
    confidence: float = 0.95

    def __post_init__(self) -> None:
        """Refuse values outside their ranges.

        Raises
        ------
        ConfigurationError
            Naming the option, its value and the allowed values.
        """
        positive = ("alpha_std_rad", "q_std_rad_s", "az_std_m_s2", "length_u_m", "length_w_m", "tolerance")
        for name in (
            *positive,
            "airspeed_std_m_s",
            "level_prior",
            "gust_prior",
            "sigma_u_m_s",
            "sigma_w_m_s",
        ):
            value = getattr(self, name)
            if value is None:
                continue
            zero = name.startswith("sigma")
            if not (value >= 0.0 if zero else value > 0.0) or value == np.inf:
                raise ConfigurationError(
                    f"filter option {name} = {value!r}: must be {'at least' if zero else 'above'} 0 and finite"
                )
        if self.maximum_iterations < 1:
            raise ConfigurationError(
                f"filter option maximum_iterations = {self.maximum_iterations!r}: must be at least 1"
            )
        if self.pressure not in PRESSURES:
            raise ConfigurationError(
                f"filter option pressure = {self.pressure!r}: {choices(self.pressure, PRESSURES)}"
            )
        Options(condition=self.condition, airspeed_m_s=self.airspeed_m_s, confidence=self.confidence)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Outputs of the predictor that are compared with the log."""
        return OUTPUTS[:-1] if self.airspeed_std_m_s is None else OUTPUTS

    @property
    def levels(self) -> Array:
        """(levels,) declared sigma_u, sigma_w [m/s], noise of each output and, unless 0, of the moment."""
        noise = [self.alpha_std_rad, self.q_std_rad_s, self.az_std_m_s2]
        if self.airspeed_std_m_s is not None:
            noise.append(self.airspeed_std_m_s)
        more = [self.moment_noise] if self.moment_noise > 0.0 else []
        return np.array([self.sigma_u_m_s, self.sigma_w_m_s, *noise, *more])


def free_parameters(options: FilterOptions) -> Ints:
    """Indices of the estimated parameters: derivatives, levels unless known or 0, moment of the trim."""
    count = len(LONGITUDINAL.parameters)
    free = [np.arange(count)]
    if options.level_prior is not None:
        free.append(count + np.flatnonzero(options.levels > 0.0))
    if options.trim_moment_prior is not None:
        free.append(np.array([count + options.levels.size]))
    return np.concatenate(free)


def prior_weights(options: FilterOptions) -> Array:
    """(free,) inverse prior variance of each of `free_parameters`; 0 for the derivatives."""
    weights = [np.zeros(len(LONGITUDINAL.parameters))]
    if options.level_prior is not None:
        gusts = options.level_prior if options.gust_prior is None else options.gust_prior
        prior = np.full(options.levels.size, gusts)
        prior[len(LEVELS) : len(LEVELS) + len(options.outputs)] = options.level_prior
        weights.append(prior[options.levels > 0.0] ** -2.0)
    if options.trim_moment_prior is not None:
        weights.append(np.array([options.trim_moment_prior**-2.0]))
    return np.concatenate(weights)


def declared_values(options: FilterOptions, levels: Array) -> Array:
    """Centres of the prior (groups, parameters): 0, logarithms of the levels (groups, levels), 0."""
    groups = levels.shape[0]
    with np.errstate(divide="ignore"):  # a level of 0 stays 0
        parts = [np.zeros((groups, len(LONGITUDINAL.parameters))), np.log(levels)]
    if options.trim_moment_prior is not None:
        parts.append(np.zeros((groups, 1)))
    return np.concatenate(parts, axis=1)
