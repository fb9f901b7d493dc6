"""Filter error and output error as methods: default noise and gust priors for undocumented logs.

The noise of a sensor is that of aircraft.toml, or else that of the third differences of the record. Gusts have
Dryden's spectrum. Every level is estimated.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.identification.condition import AircraftConstants, Observation, OneOrEach, each_batch
from airtruth.identification.estimates import Estimates, concatenated
from airtruth.identification.likelihood.fit import fit, fit_joint
from airtruth.identification.likelihood.options import FilterOptions
from airtruth.identification.options import Options
from airtruth.identification.regression.dynamic import dynamic_problem, f1_numerator
from airtruth.identification.regression.rows import Problem
from airtruth.identification.regression.solve import chunks, regress_batch, regress_joint
from airtruth.logs.flight_log import Batch
from airtruth.physics.motion import LONGITUDINAL
from airtruth.units import FT

Array = NDArray[np.float64]

GUST_M_S: Final = 1.0
"""Declared level of both gusts [m/s]; judgement: between those of light turbulence in u and w at the GTM's altitude."""
UNSEEN: Final = 0.1
"""Share of the gust u that a measured airspeed does not show [-]; judgement."""
GUST_PRIOR: Final = 2.0
"""Prior standard deviation of the logarithm of the gusts' levels [-]; judgement: a factor of 7 either way."""
GUST_LENGTH_M: Final = 1750.0 * FT
"""Scale length of both gusts [m], MIL-F-8785C, 3.7.2, above 2000 ft."""
NOISE_PRIOR: Final = 0.5
"""Prior standard deviation of the logarithm of the sensors' noise [-]; judgement: a factor of 1.6 either way."""
STEPS: Final = 2
"""Steps of scoring allowed for each allowed iteration of the instrumental variables [-]; judgement: they are smaller."""
RESIDUAL_PRIOR: Final = 3.0
"""Prior standard deviation of the logarithm of the outputs' noise in output error [-]; judgement: that noise includes
the gusts."""
MOMENT_NOISE: Final = 0.005
"""Declared noise of the moment [rad/s per root second]; judgement: a kink of Cm(alpha) in gusts causes about 0.01."""
TRIM_MOMENT_PRIOR: Final = 0.03
"""Prior standard deviation of the trim's moment coefficient [-]; judgement: a thrust of a tenth of the lift, CL of 1,
an arm of a third of the chord."""
READ: Final = LONGITUDINAL.output_channels
"""Channels of the outputs of the predictor."""
_FLOOR: Final = 1e-4
"""Least noise of a sensor over the spread of its signal [-]; judgement."""
_GAUSSIAN: Final = 1.4826
"""Standard deviation over median absolute deviation of normal noise [-]."""


def estimate_filter_error(batch: Batch, constants: AircraftConstants, options: Options) -> Estimates:
    """Filter error of each run, started from iv-f1, or from least squares where that fails.

    Nothing is checked. A result does not depend on the other runs.

    Parameters
    ----------
    batch, constants, options : as in `airtruth.identification.identify_batch`.
    """
    return _each(batch, constants, options, GUST_M_S)


def estimate_output_error(batch: Batch, constants: AircraftConstants, options: Options) -> Estimates:
    """Output error of each run; see `estimate_filter_error`."""
    return _each(batch, constants, options, 0.0)


def joint_filter_error(parts: Sequence[Batch], constants: OneOrEach, options: Options) -> Estimates:
    """One estimate by filter error for all runs; they share the levels too."""
    return _all(parts, constants, options, GUST_M_S)


def joint_output_error(parts: Sequence[Batch], constants: OneOrEach, options: Options) -> Estimates:
    """One estimate by output error for all runs; they share the levels too."""
    return _all(parts, constants, options, 0.0)


def declare(options: Options, gust_m_s: float, noise: Array) -> FilterOptions:
    """Declared noise and air of an identification.

    Parameters
    ----------
    options : choices of an identification.
    gust_m_s : level of both gusts [m/s], 0 for output error. Where the dynamic pressure is measured, the
        gust u is the part that the airspeed does not show.
    noise : (3,) noise of alpha [rad], q [rad/s], az [m/s2].
    """
    held = options.pressure == "constant" or options.airspeed_m_s is not None
    alpha, q, az = noise.tolist()
    return FilterOptions(
        alpha,
        q,
        az,
        sigma_u_m_s=gust_m_s * (1.0 if held else UNSEEN),
        sigma_w_m_s=gust_m_s,
        length_u_m=GUST_LENGTH_M,
        length_w_m=GUST_LENGTH_M,
        level_prior=NOISE_PRIOR if gust_m_s > 0.0 else RESIDUAL_PRIOR,
        gust_prior=GUST_PRIOR,
        moment_noise=MOMENT_NOISE if gust_m_s > 0.0 else 0.0,
        trim_moment_prior=TRIM_MOMENT_PRIOR,
        pressure="constant" if held else "measured",
        maximum_iterations=STEPS * options.maximum_iterations,
        condition=options.condition,
        airspeed_m_s=options.airspeed_m_s,
        confidence=options.confidence,
    )


def sensor_noise(
    batch: Batch,
    constants: AircraftConstants,
    channels: Sequence[str] = READ,
) -> Array:
    """(runs, channels) standard deviation of the white noise of outputs [SI].

    From aircraft.toml, and where that states none from the median of the third differences of the record,
    which a motion slow against the sample rate does not enter.
    """
    stated = constants.file.sensors if isinstance(constants, Aircraft) else {}
    columns = []
    for channel in channels:
        values = batch.channels[channel]
        std = stated[channel].noise_std.value if channel in stated else 0.0
        if std > 0.0:
            columns.append(np.full(values.shape[0], std))
            continue
        third = np.diff(values, n=3, axis=1)
        shown = _GAUSSIAN * np.median(np.abs(third), axis=1) / math.sqrt(20.0)
        columns.append(np.maximum(shown, _FLOOR * values.std(axis=1)))
    return np.stack(columns, axis=1)


def _f1(observation: Observation, options: Options) -> Problem:
    return dynamic_problem(observation, options, f1_numerator)


def _each(batch: Batch, constants: AircraftConstants, options: Options, gust_m_s: float) -> Estimates:
    quick = replace(options, covariance="none")
    parts = []
    for part in chunks(batch):
        iv = regress_batch(part, constants, "iv-f1", _f1, quick)
        ls = regress_batch(part, constants, "ls", None, quick)
        noise = sensor_noise(part, constants)
        declared = declare(options, gust_m_s, noise.mean(axis=0))
        levels = np.tile(declared.levels, (noise.shape[0], 1))
        levels[:, 2 : 2 + noise.shape[1]] = noise
        start = np.where(iv.converged[:, None], iv.theta, ls.theta)
        parts.append(fit(part, constants, start, declared, levels))
    return concatenated(parts, batch.run_ids)


def _all(parts: Sequence[Batch], constants: OneOrEach, options: Options, gust_m_s: float) -> Estimates:
    quick = replace(options, covariance="none")
    start = regress_joint(parts, constants, "iv-f1", _f1, quick)
    if not start.converged[0]:
        start = regress_joint(parts, constants, "ls", None, quick)
    noise = np.concatenate([sensor_noise(part, own) for part, own in each_batch(parts, constants)])
    declared = declare(options, gust_m_s, np.median(noise, axis=0))
    return fit_joint(parts, constants, start.theta[0], declared)
