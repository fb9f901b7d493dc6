"""Options of an identification; the defaults gave the least errors in docs/methods.md."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from numbers import Real
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.arguments import require_whole
from airtruth.errors import ConfigurationError, choices
from airtruth.physics.short_period import Scale

Array = NDArray[np.float64]

AuxiliaryModel = Callable[[Array, Array, float, Scale], tuple[Array, ...]]
"""Noise-free deviations from trim: (theta (runs, 6), input (runs, samples) [rad], dt [s], scale) ->
alpha [rad], q [rad/s] and, where it is not the input (a simulated loop moves it), the elevator [rad], each
(runs, samples). The input is a deviation too. The runs are those that still iterate."""

TRIMS: Final = ("intercept", "mean")
"""Values of ``trim``."""
CONDITIONS: Final = ("motion", "record", "window")
"""Values of ``condition``."""
PRESSURES: Final = ("method", "constant", "measured")
"""Values of ``pressure``."""
TERMS: Final = ("alpha", "beta")
"""Values in ``terms``."""
COVARIANCE_NAMES: Final = ("none", "paper", "white", "coloured", "corrected")
"""Values of ``covariance``."""


PAPER_CUTOFF_HZ: Final = 5.0
"""Cutoff of the pre-filter [Hz]: the paper, section III.C."""
CUTOFF_SHARE: Final = 0.25
"""Cutoff of a slow record as a share of its sample rate [-]: judgement; differences of samples lose 10 % of a motion at an
eighth of the rate, and the pre-filter has to end well below half of it."""


@dataclass(frozen=True)
class Options:
    """Choices shared by all estimators.

    Attributes
    ----------
    cutoff_hz, order : low-pass pre-filter, run forward and backward [Hz]; the paper has 5 Hz, order 4. None takes 5 Hz,
        or a quarter of the sample rate of a slow record (`cutoff_of`).
    tolerance : an estimator has converged once ||theta_i - theta_(i-1)|| <= tolerance ||theta_i||.
        The paper recommends 1 to 5 %; the default is 1 %.
    maximum_iterations : iterations after which a run is reported as not converged.
    covariance : "paper", "white", "coloured" or "corrected" (`airtruth.identification.regression.covariance`); "none"
        computes none.
    trim : "intercept" estimates one constant per equation and record; "mean" takes the trim from the mean
        over the first ``trim_window_s`` of the record.
    trim_window_s : length of that window, which must end before the manoeuvre starts [s].
    condition : airspeed and density of the constant dynamic pressure, the mean over the "record",
        weighted by the square of the low-passed pitch rate ("motion": the pressure during the manoeuvre), or
        unweighted ("record"), or over the trim "window".
    airspeed_m_s : true airspeed to use instead of the measured one [m/s], as the paper does; None uses the
        measured one.
    pressure : dynamic pressure and airspeed in the regressors: "constant" over the record, as the paper
        has it, or "measured" at each sample (`airtruth.identification.condition`); "method" is the default
        of the method: measured for iv-refined, frequency, iv-frequency, filter-error and output-error,
        constant for the others.
    band_hz : lower and upper end of the frequencies that "frequency" uses [Hz]; None leaves the choice to
        the data (`airtruth.identification.regression.frequency.band_of`).
    confidence : probability of the intervals [-].
    auxiliary : model that makes the instruments; None is the linear short-period model.
    terms : nonlinear terms that are free in each lateral coefficient: "alpha", the products of the signals with the angle of
        attack, and "beta", beta |beta|. They widen the intervals; the derivatives are then those at the mean angle of attack
        of the first ``trim_window_s`` and at small sideslip.
    """

    cutoff_hz: float | None = None
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
    terms: tuple[str, ...] = ()

    def cutoff_of(self, dt_s: float) -> float:
        """Cutoff of the pre-filter for a sample period [s]: the one that is set, or the automatic one [Hz].

        Examples
        --------
        >>> Options().cutoff_of(0.02), Options().cutoff_of(0.1), Options(cutoff_hz=3.0).cutoff_of(0.1)
        (5.0, 2.5, 3.0)
        """
        return min(PAPER_CUTOFF_HZ, CUTOFF_SHARE / dt_s) if self.cutoff_hz is None else self.cutoff_hz

    def __post_init__(self) -> None:
        """Refuse values outside their ranges.

        Raises
        ------
        ConfigurationError
            Naming the option, its value and the allowed values.
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
            if value is None and getattr(type(self), name) is None:
                continue
            if not _is_number(value) or not low < value < high:
                raise ConfigurationError(
                    f"option {name} = {value!r}: must be a number between {low:g} and {high:g}"
                )
        if isinstance(self.terms, str) or not set(self.terms) <= set(TERMS):
            raise ConfigurationError(
                f"option terms = {self.terms!r}: must be a tuple of some of {', '.join(TERMS)}"
            )
        if self.band_hz is not None and not _is_band(self.band_hz):
            raise ConfigurationError(
                f"option band_hz = {self.band_hz!r}: must be a lower and a higher frequency, both above 0"
            )
        if self.pressure == "measured" and self.airspeed_m_s is not None:
            raise ConfigurationError(
                f"option airspeed_m_s = {self.airspeed_m_s:g} replaces the measured airspeed, which "
                "pressure = 'measured' needs: leave one of them out"
            )
        for name in ("order", "maximum_iterations"):
            require_whole(f"option {name}", getattr(self, name), 1)


def _is_number(value: object) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)


def _is_band(value: object) -> bool:
    if not isinstance(value, Sequence) or len(value) != 2 or not all(map(_is_number, value)):
        return False
    return bool(0.0 < value[0] < value[1] < np.inf)
