"""What a user may choose about an identification; the defaults are the ones measured as best."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import ConfigurationError, choices
from airtruth.physics.short_period import Scale

Array = NDArray[np.float64]

AuxiliaryModel = Callable[[Array, Array, float, Scale], tuple[Array, ...]]
"""Noise-free deviations from trim: (theta (runs, 6), input (runs, samples) [rad], dt [s], scale) ->
alpha [rad], q [rad/s] and, where it is not the input (a simulated loop moves it), the elevator [rad], each
(runs, samples). The input is a deviation too. Only runs that still iterate are asked for."""

TRIMS: Final = ("intercept", "mean")
CONDITIONS: Final = ("motion", "record", "window")
PRESSURES: Final = ("method", "constant", "measured")
COVARIANCE_NAMES: Final = ("none", "printed", "white", "coloured", "corrected")


@dataclass(frozen=True)
class Options:
    """Choices shared by all estimators.

    Attributes
    ----------
    cutoff_hz, order : low-pass pre-filter, run forward and backward [Hz]; the paper has 5 Hz, order 4.
    tolerance : an estimator has converged once ||theta_i - theta_(i-1)|| <= tolerance ||theta_i||.
        The paper recommends 1 to 5 %; 1 % is taken.
    maximum_iterations : iterations after which a run is reported as not converged.
    covariance : "printed", "white", "coloured" or "corrected" (`airtruth.identify.covariance`); "none"
        saves the time.
    trim : "intercept" frees one constant per equation and record; "mean" takes the trim from the mean
        over the first ``trim_window_s`` of the record.
    trim_window_s : length of that window, which must end before the manoeuvre starts [s].
    condition : airspeed and density of the constant dynamic pressure, the mean over the "record",
        weighted by the square of the low-passed pitch rate ("motion": the pressure that acted while
        something moved), or plain ("record"), or over the trim "window".
    airspeed_m_s : true airspeed to use in place of the measured one [m/s], as the paper does; None
        measures it.
    pressure : dynamic pressure and airspeed in the regressors: "constant" over the record, as the paper
        has it, or "measured" at each sample (`airtruth.identify.pressure`); "method" is what the method has
        as its own: constant for ls and the IV methods of the paper, measured for the others.
    band_hz : lower and upper end of the frequencies that "frequency" uses [Hz]; None leaves the choice to
        the data (`airtruth.identify.frequency.band_of`).
    confidence : probability of the intervals [-].
    auxiliary : model that makes the instruments; None is the linear short-period model.
    """

    cutoff_hz: float = 5.0
    order: int = 4
    tolerance: float = 0.01
    maximum_iterations: int = 50
    covariance: str = "corrected"
    trim: str = "intercept"
    trim_window_s: float = 1.0
    condition: str = "motion"
    airspeed_m_s: float | None = None
    pressure: str = "method"
    band_hz: tuple[float, float] | None = None
    confidence: float = 0.95
    auxiliary: AuxiliaryModel | None = None

    def __post_init__(self) -> None:
        """Refuse values that mean nothing.

        Raises
        ------
        ConfigurationError
            Naming the option, its value and what is allowed.
        """
        for name, allowed in (
            ("trim", TRIMS),
            ("covariance", COVARIANCE_NAMES),
            ("condition", CONDITIONS),
            ("pressure", PRESSURES),
        ):
            value = getattr(self, name)
            if value not in allowed:
                raise ConfigurationError(f"option {name} = {value!r}: {choices(str(value), allowed)}")
        for name, low, high in (
            ("cutoff_hz", 0.0, np.inf),
            ("tolerance", 0.0, 1.0),
            ("trim_window_s", 0.0, np.inf),
            ("confidence", 0.0, 1.0),
            ("airspeed_m_s", 0.0, np.inf),
        ):
            value = getattr(self, name)
            if value is not None and not low < value < high:
                raise ConfigurationError(f"option {name} = {value!r}: must lie between {low:g} and {high:g}")
        if self.band_hz is not None and not 0.0 < self.band_hz[0] < self.band_hz[1] < np.inf:
            raise ConfigurationError(
                f"option band_hz = {self.band_hz!r}: must be a lower and a higher frequency, both above 0"
            )
        if self.pressure == "measured" and self.airspeed_m_s is not None:
            raise ConfigurationError(
                f"option airspeed_m_s = {self.airspeed_m_s:g} takes the place of the measured airspeed, which "
                "pressure = 'measured' asks for: leave one of them out"
            )
        for name in ("order", "maximum_iterations"):
            if getattr(self, name) < 1:
                raise ConfigurationError(f"option {name} = {getattr(self, name)!r}: must be at least 1")
