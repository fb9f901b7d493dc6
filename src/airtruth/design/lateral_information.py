"""The least covariance of the lateral derivatives from one record, by the Cramer-Rao bound of filter error."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.design.information import batch_of
from airtruth.identification.lateral.methods import lateral_values
from airtruth.identification.lateral.predictor import GUST, PROCESS, levels, outputs_of, records_of
from airtruth.identification.likelihood.cramer_rao import bound
from airtruth.identification.likelihood.predictor import W_START
from airtruth.identification.options import Options
from airtruth.physics.motion import LATERAL

Array = NDArray[np.float64]

_STATES: Final = len(LATERAL.states)
"""States of the aircraft, whose initial values the estimator does not know."""
_ZERO: Final = -np.inf
"""Logarithm of a level of zero."""


@dataclass(frozen=True)
class LateralExperiment:
    """Properties of a record of the linear lateral-directional motion besides its aileron and rudder.

    The model is exact: no noise drives p' and r', and the estimator knows that.

    Attributes
    ----------
    aircraft : with its inertias.
    noise : channel -> standard deviation of the noise of its sensor [SI].
    sigma_v_m_s, length_v_m : of the side gust [m/s], [m]; without rotation.
    dt_s : time between two samples [s].
    start : how the gust starts, "rest" or "stationary".
    """

    aircraft: Aircraft
    noise: Mapping[str, float]
    sigma_v_m_s: float
    length_v_m: float
    dt_s: float
    start: str

    def least_covariance(self, flown: Mapping[str, Array], theta: Array) -> Array:
        """Least covariance (15, 15) of unbiased derivatives; levels, biases and the initial state of the aircraft are unknown.

        Parameters
        ----------
        flown : channel -> (samples,) of a flight in calm air; the surfaces count, the flight condition, and the motion of the
            other axis, which is known.
        theta : (15,) true derivatives [-].
        """
        batch = batch_of(flown, self.dt_s)
        options = Options(pressure="constant", condition="record")
        data = records_of(batch, lateral_values(self.aircraft), options, self.length_v_m, gusts=True)
        outputs = {output.name: output.channel for output in LATERAL.outputs}
        true = {f"noise_{name}": np.log(self.noise[outputs[name]]) for name in outputs_of(batch)}
        true |= {GUST: np.log(self.sigma_v_m_s) if self.sigma_v_m_s > 0.0 else _ZERO}
        true |= dict.fromkeys(PROCESS, _ZERO)
        z = np.array([*theta, *(true[name] for name in levels(outputs_of(batch), gusts=True))])
        begin = np.zeros((_STATES + 2, _STATES + 2))
        if self.start == "stationary":
            begin[_STATES:, _STATES:] = W_START
        free = np.flatnonzero(np.isfinite(z))
        least = bound(data.layout, 0, z, free, data.signals, self.dt_s, begin, np.arange(_STATES))
        return least[: theta.size, : theta.size]


__all__ = ["LateralExperiment", "lateral_values"]
