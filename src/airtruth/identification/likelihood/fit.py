"""Filter error: the derivatives by maximum likelihood with turbulence in the model.

Kalman innovations of the linear short period in Dryden gusts (`airtruth.identification.likelihood.predictor`), their
likelihood maximised by scoring with a Levenberg-Marquardt damping. Output biases and initial states are
each record's own and exact at every step; noise and gust levels are known, or estimated about declared
values. Without gusts it is output error.

Source: R. E. Maine and K. W. Iliff, "Identification of Dynamic Systems", NASA RP-1138 (1985).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Generic

import numpy as np
from numpy.typing import NDArray

from airtruth.identification.condition import AircraftConstants, OneOrEach, each_batch, observe
from airtruth.identification.estimates import JOINT, AnyScale, Estimates, S, mean_scale
from airtruth.identification.likelihood.kalman import score
from airtruth.identification.likelihood.kalman_kernel import KalmanSignals
from airtruth.identification.likelihood.options import (
    CHANNELS,
    FilterOptions,
    declared_values,
    free_parameters,
    prior_weights,
)
from airtruth.identification.likelihood.predictor import (
    LevelLayout,
    Term,
    extended,
    floor_terms,
    layout,
    short_period,
)
from airtruth.identification.likelihood.pressure import (
    products,
    with_known_rates,
    with_pressure,
    with_trim_moment,
)
from airtruth.identification.likelihood.scoring import Maxima, Scored, Search, maximise
from airtruth.identification.options import Options
from airtruth.logs.flight_log import Batch
from airtruth.numerics.intersample import decay_of, servo_bend, smooth_bend
from airtruth.physics.motion import LONGITUDINAL, Motion
from airtruth.physics.short_period import Scale

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

MOMENT_NOISE: Final = "noise_moment"
"""Name of the parameter: intensity of the noise in q_dot [rad/s per root second]."""


@dataclass(frozen=True)
class Records(Generic[S]):
    """Runs of one length as the filter reads them.

    Attributes
    ----------
    dt_s : sample period [s].
    signals : outputs and surfaces relative to their first sample, and further inputs.
    layout : the predictor's arrays.
    scale : factors of shape (runs,).
    """

    dt_s: float
    signals: KalmanSignals
    layout: LevelLayout
    scale: S


def records(batch: Batch, constants: AircraftConstants, options: FilterOptions) -> Records[Scale]:
    """Signals and predictor of a batch; nothing is checked.

    The surface between samples has the area of the cubic through the four nearest samples, and the
    corners of a first-order servo behind a held command where the record shows one
    (`airtruth.numerics.intersample`).
    """
    condition = Options(condition=options.condition, airspeed_m_s=options.airspeed_m_s)
    scale = observe(batch, constants, condition).scale
    y = np.stack([batch.channels[CHANNELS[name]] for name in options.outputs], axis=2)
    surface = batch.channels[LONGITUDINAL.surfaces[0]]
    u = surface - surface[:, :1]
    bend = servo_bend(u, declared_decay=decay_of(batch.servo_s, batch.dt_s))
    predictor = short_period(scale, options.length_u_m, options.length_w_m, options.outputs)
    u, bend = u[:, :, None], bend[:, :, None]
    if options.pressure == "measured":
        u = np.concatenate([u, products(batch, constants, scale)], axis=2)
        predictor = with_pressure(predictor, scale, batch, constants)
    if batch.known_rates is not None:
        u = np.concatenate([u, np.moveaxis(batch.known_rates, 0, 2)], axis=2)
        predictor = with_known_rates(predictor)
    bend = np.concatenate([bend, np.zeros_like(u[:, :, 1:])], axis=2)
    if options.moment_noise > 0.0:
        noise = (MOMENT_NOISE,)
        predictor = extended(predictor, [Term("Q", "q", "", 1.0, noise * 2)], (), (), noise, noise)
    if options.trim_moment_prior is not None:
        predictor = with_trim_moment(predictor, scale)
    return Records(
        dt_s=batch.dt_s,
        signals=KalmanSignals(
            y - y[:, :1], np.ascontiguousarray(u), np.ascontiguousarray(bend + smooth_bend(u, 1))
        ),
        layout=layout(extended(predictor, floor_terms(options.outputs, y)), y.shape[0]),
        scale=scale,
    )


def fit(
    batch: Batch,
    constants: AircraftConstants,
    start: Array,
    options: FilterOptions,
    levels: Array | None = None,
) -> Estimates:
    """Estimate the six derivatives of each run; nothing is checked.

    A result does not depend on the other runs of the batch.

    Parameters
    ----------
    batch : runs of one length and sample period, with density, airspeed, the outputs and the elevator.
    constants : aircraft, any object with wing_area_m2, chord_m, mass_kg, inertia_yy_kg_m2.
    start : (runs, 6) start of the search, such as the estimates of iv-f1; a row that is not finite has no
        estimate (DIVERGED).
    options : declared noise and air, and how to search.
    levels : (runs, levels) declared levels of each run; None: those of the options. A level that the options
        declare 0 stays 0.
    """
    data = records(batch, constants, options)
    each = np.tile(options.levels, (start.shape[0], 1)) if levels is None else levels
    maxima = maximum_of_each(data, start, _search(options, each))
    return _estimates(maxima, batch.run_ids, data.scale, options)


def fit_joint(
    parts: Sequence[Batch], constants: OneOrEach, start: Array, options: FilterOptions
) -> Estimates:
    """One estimate for all runs together: derivatives and levels are shared, nothing is checked.

    Flight condition, biases and initial states stay each run's own. All runs are held in memory.

    Parameters
    ----------
    parts : batches; lengths and rates may differ.
    constants, options : as in `fit`.
    start : (6,) start of the search.
    """
    data = [records(batch, own, options) for batch, own in each_batch(parts, constants)]
    maxima = joint_maximum(data, start, _search(options, options.levels[None, :]))
    return _estimates(maxima, (JOINT,), mean_scale([part.scale for part in data]), options)


def _search(options: FilterOptions, levels: Array) -> Search:
    """Search of the derivatives and the levels about their declared values (groups, levels)."""
    count, free = len(LONGITUDINAL.parameters), free_parameters(options)
    return Search(
        declared=declared_values(options, levels),
        free=free,
        weight=prior_weights(options),
        # all between the derivatives and the moment of the trim
        level=slice(count, int(np.searchsorted(free, count + levels.shape[1]))),
        tolerance=options.tolerance,
        maximum_iterations=options.maximum_iterations,
    )


def maximum_of_each(data: Records[S], start: Array, search: Search) -> Maxima:
    """Maximum of the likelihood of each run, from its start (runs, derivatives)."""

    def evaluate(z: Array, active: Ints, informed: bool) -> Scored:
        return scored(data, z, active, search.free, informed=informed)

    return maximise(evaluate, start, search)


def joint_maximum(data: Sequence[Records[S]], start: Array, search: Search) -> Maxima:
    """Maximum of the likelihood of all runs, which share derivatives and levels, from a start (derivatives,)."""

    def evaluate(z: Array, active: Ints, informed: bool) -> Scored:
        cost, gradient, information = scored_each(data, z, search.free, informed=informed)
        return cost.sum(keepdims=True), gradient.sum(axis=0)[None], information.sum(axis=0)[None]

    return maximise(evaluate, start[None, :], search)


def scored_each(data: Sequence[Records[S]], z: Array, free: Ints, *, informed: bool = True) -> Scored:
    """`scored` for all runs of several batches at one point z (1, parameters)."""
    made = []
    for part in data:
        runs = part.signals.y.shape[0]
        made.append(scored(part, np.repeat(z, runs, axis=0), np.arange(runs), free, informed=informed))
    cost, gradient, information = (np.concatenate(parts) for parts in zip(*made, strict=True))
    return cost, gradient, information


def memory_of(data: Records[S], z: Array) -> Array:
    """(runs,) largest correlation of neighbouring innovations of an output [-]: near zero for a sound model.

    Parameters
    ----------
    z : (runs, parameters) as in `scored`; a run whose row is not finite has NaN.
    """
    result = np.full(len(z), np.nan)
    known = np.flatnonzero(np.isfinite(z).any(axis=1))
    # a level of zero has no logarithm
    free = np.empty(0, dtype=np.int64)
    made = score(data.layout, known, z[known], free, data.signals, data.dt_s)
    result[known] = correlation_of(made.innovations)
    return result


def correlation_of(innovations: Array) -> Array:
    """(runs,) largest correlation of neighbouring innovations (runs, samples, outputs) of an output [-]."""
    e = innovations
    with np.errstate(invalid="ignore"):
        product = (e[:, 1:] * e[:, :-1]).mean(axis=1) / (e * e).mean(axis=1)
    return np.asarray(product.max(axis=1))


def scored(data: Records[S], z: Array, active: Ints, free: Ints, *, informed: bool = True) -> Scored:
    """Negative log-likelihood, gradient and information of the runs ``active``, no prior.

    Parameters
    ----------
    z : (active, parameters) derivatives, then logarithms of the levels.
    active, free : runs; parameters to differentiate for.
    informed : whether the information is wanted; NaN otherwise.

    Returns
    -------
    (active,), (active, free), (active, free, free).
    """
    made = score(data.layout, active, z, free, data.signals, data.dt_s, informed=informed)
    return made.cost, made.gradient, made.information


def _estimates(maxima: Maxima, run_ids: tuple[str, ...], scale: Scale, options: FilterOptions) -> Estimates:
    gusts = options.sigma_u_m_s > 0.0 or options.sigma_w_m_s > 0.0
    return estimates_of(maxima, run_ids, scale, LONGITUDINAL, options.confidence, gusts)


def estimates_of(
    maxima: Maxima, run_ids: tuple[str, ...], scale: AnyScale, motion: Motion, confidence: float, gusts: bool
) -> Estimates:
    """Estimates of the derivatives of a motion, the first parameters; without gusts they are those of output error."""
    count = len(motion.parameters)
    return Estimates(
        method="filter-error" if gusts else "output-error",
        run_ids=run_ids,
        theta=maxima.z[:, :count],
        covariance=maxima.covariance[:, :count, :count],
        covariance_name="fisher",
        status=maxima.status,
        iterations=maxima.iterations,
        scale=scale,
        confidence=confidence,
        motion=motion,
    )
