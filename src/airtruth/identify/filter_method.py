"""Filter error and output error as methods: what they declare of a log that nobody described to them.

Noise of the sensors is that of aircraft.toml where it states one, else what the third differences of the
record show; gusts are Dryden's at a level that the record has to tell. Every level is estimated.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.identify.condition import AircraftConstants
from airtruth.identify.dynamic import dynamic_problem, f1_numerator
from airtruth.identify.filter_error import fit, fit_joint
from airtruth.identify.filter_options import CHANNELS, FilterOptions
from airtruth.identify.options import Options
from airtruth.identify.problem import Observation, Problem
from airtruth.identify.regression import chunks, joined, regress_batch, regress_joint
from airtruth.identify.results import Estimates
from airtruth.logs.flight_log import Batch
from airtruth.units import FT

Array = NDArray[np.float64]

GUST_M_S: Final = 1.0
"""Declared level of both gusts: between those of light turbulence in u and w at the GTM's altitude."""
UNSEEN: Final = 0.1
"""Share of it in u that a measured airspeed does not show."""
GUST_PRIOR: Final = 2.0
"""Standard deviation of the logarithm of the gusts' levels: a factor of 7 either way."""
GUST_LENGTH_M: Final = 1750.0 * FT
"""Scale length of both gusts, MIL-F-8785C, 3.7.2, above 2000 ft."""
NOISE_PRIOR: Final = 0.5
STEPS: Final = 2
"""Steps of scoring allowed per iteration allowed to the instrumental variables: they are smaller."""
RESIDUAL_PRIOR: Final = 3.0
"""Of the outputs' noise in output error, which stands for the gusts too."""
MOMENT_NOISE: Final = 0.005
"""Declared noise of the moment [rad/s per root second]: a kink of Cm(alpha) in gusts leaves about 0.01."""
TRIM_MOMENT_PRIOR: Final = 0.03
"""Thrust of a tenth of the lift, CL of 1, an arm of a third of the chord."""
OUTPUTS: Final = ("alpha", "q", "az")
_FLOOR: Final = 1e-4  # of the spread of a signal: less noise is not worth telling
_GAUSSIAN: Final = 1.4826  # standard deviation over median absolute deviation


def estimate_filter_error(batch: Batch, constants: AircraftConstants, options: Options) -> Estimates:
    """Filter error of each run, started from iv-f1, or from least squares where that fails.

    Nothing is checked. A result does not depend on the other runs.

    Parameters
    ----------
    batch, constants, options : as in `airtruth.identify.identify_batch`.
    """
    return _each(batch, constants, options, GUST_M_S)


def estimate_output_error(batch: Batch, constants: AircraftConstants, options: Options) -> Estimates:
    """Output error of each run; see `estimate_filter_error`."""
    return _each(batch, constants, options, 0.0)


def joint_filter_error(parts: Sequence[Batch], constants: AircraftConstants, options: Options) -> Estimates:
    """One estimate by filter error for all runs; they share the levels too."""
    return _all(parts, constants, options, GUST_M_S)


def joint_output_error(parts: Sequence[Batch], constants: AircraftConstants, options: Options) -> Estimates:
    """One estimate by output error for all runs; they share the levels too."""
    return _all(parts, constants, options, 0.0)


def declare(options: Options, gust_m_s: float, noise: Array) -> FilterOptions:
    """What is declared to the filter.

    Parameters
    ----------
    options : choices of an identification.
    gust_m_s : level of both gusts [m/s], 0 for output error. Where the dynamic pressure is measured, the
        gust u is what the airspeed does not show.
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


def sensor_noise(batch: Batch, constants: AircraftConstants) -> Array:
    """(runs, 3) standard deviation of the white noise of alpha [rad], q [rad/s], az [m/s2].

    From aircraft.toml, and where that states none from the median of the third differences of the record,
    which a motion slow against the sample rate does not enter.
    """
    stated = constants.file.sensors if isinstance(constants, Aircraft) else {}
    columns = []
    for name in OUTPUTS:
        channel = CHANNELS[name]
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
    found = []
    for part in chunks(batch):
        iv = regress_batch(part, constants, "iv-f1", _f1, quick)
        ls = regress_batch(part, constants, "ls", None, quick)
        noise = sensor_noise(part, constants)
        declared = declare(options, gust_m_s, noise.mean(axis=0))
        levels = np.tile(declared.levels, (noise.shape[0], 1))
        levels[:, 2 : 2 + noise.shape[1]] = noise
        start = np.where(iv.converged[:, None], iv.theta, ls.theta)
        found.append(fit(part, constants, start, declared, levels))
    return replace(
        found[0],
        run_ids=batch.run_ids,
        theta=np.concatenate([e.theta for e in found]),
        covariance=np.concatenate([e.covariance for e in found]),
        status=np.concatenate([e.status for e in found]),
        iterations=np.concatenate([e.iterations for e in found]),
        scale=joined([e.scale for e in found]),
    )


def _all(
    parts: Sequence[Batch], constants: AircraftConstants, options: Options, gust_m_s: float
) -> Estimates:
    quick = replace(options, covariance="none")
    start = regress_joint(parts, constants, "iv-f1", _f1, quick)
    if not start.converged[0]:
        start = regress_joint(parts, constants, "ls", None, quick)
    noise = np.concatenate([sensor_noise(part, constants) for part in parts])
    declared = declare(options, gust_m_s, np.median(noise, axis=0))
    return fit_joint(parts, constants, start.theta[0], declared)
