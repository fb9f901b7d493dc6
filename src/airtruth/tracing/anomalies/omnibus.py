"""Omnibus tests: whether the declared aircraft lacks anything, whichever effect it is.

Families of directions, each a chi-square test with the nuisance parameters eliminated, and a test of the spectrum
(`airtruth.tracing.anomalies.spectrum`). A direction is a series added to a coefficient or an output. Series of the motion are
functions of predicted outputs: a prediction does not contain the noise of its own sample, so that under the null the scores
are a martingale.

Source: C. R. Rao's score test as in `airtruth.tracing.anomalies.score_test`.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from airtruth.numerics.kept import Kept
from airtruth.numerics.recursion import low_pass
from airtruth.physics.motion import Motion
from airtruth.tracing.anomalies.families import Destinations, Series, View, families
from airtruth.tracing.anomalies.spectrum import lines
from airtruth.tracing.inference.direction import inserted, projected
from airtruth.tracing.inference.hypothesis_test import HypothesisTest
from airtruth.tracing.inference.posterior import PosteriorFit, TraceProblem
from airtruth.tracing.inference.whitening import Whitener
from airtruth.tracing.model.records import nodes
from airtruth.tracing.model.response import Response, filter_inputs, respond_to
from airtruth.tracing.model.settings import without
from airtruth.tracing.model.tangent import propagated, tangent_of

Array = NDArray[np.float64]

_MEMORY_S: Final = 0.05
"""Time constant of the low-pass before the rate of the predicted flow angle is taken [s] (judgement)."""
_DISTINCT: Final = 1e-3
"""Least eigenvalue, over the largest, of directions that count as distinct [-] (judgement: responses to a control
overlap)."""
_QUANTILES: Final = (0.02, 0.98)
"""Quantiles of the predicted flow angle that count as its range [-] (judgement)."""


_TESTED: Final = Kept[tuple[Whitener, tuple[HypothesisTest, ...]]]()
"""A fit -> an autoregression of its innovations, and the tests under it."""


def anomalies(null: PosteriorFit, problem: TraceProblem, whitener: Whitener) -> tuple[HypothesisTest, ...]:
    """Run every test at the optimum of a null hypothesis.

    Parameters
    ----------
    null : a fit; whitener : autoregression of its innovations.
    """
    known = _TESTED.of(null)
    if known is not None and np.array_equal(known[0].coefficients, whitener.coefficients):
        return known[1]
    return _TESTED.keep(null, (whitener, _anomalies(null, problem, whitener)))[1]


def _anomalies(null: PosteriorFit, problem: TraceProblem, whitener: Whitener) -> tuple[HypothesisTest, ...]:
    seen = views(null, problem)
    measured, motion = problem.settings.measured, problem.layout.motion
    to_outputs = Destinations.of(motion).output
    built = [
        {
            name: [x for x in family.series(view) if (i := to_outputs(x[0])) is None or measured[i]]
            for name, family in families(motion).items()
        }
        for view in seen
    ]

    def one(index: int) -> Array:
        return _tangents(null, problem, index, [s for series in built[index].values() for s in series])

    extra = problem.each(one, range(len(problem.records)))
    extended = [
        inserted(base, null.layout.sizes.stop, t, np.zeros((len(t), *base.white.shape)))
        for base, t in zip(null.sensitivities, extra, strict=True)
    ]
    gradient, information = projected(null, problem, extended, whitener)
    found, at = [], 0
    for name, series in built[0].items():
        span = slice(at, at + len(series))
        at += len(series)
        found.append(HypothesisTest(name, *chi_square(gradient[span], information[span, span])))
    residuals = [np.where(measured, t.r, 0.0) for t in null.sensitivities]
    periods = [r.signals.dt_s for r in problem.records]
    return (*found, lines(residuals, periods, motion.output_channels))


def chi_square(gradient: Array, information: Array) -> tuple[float, int, float]:
    """Statistic g' I^-1 g over the distinct directions, their number, and the p-value, 1 where there are none."""
    known = np.diag(information) > 0.0
    if not known.any():
        return 0.0, 0, 1.0
    gradient, information = gradient[known], information[np.ix_(known, known)]
    scale = np.sqrt(np.diag(information))
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    kept = values > _DISTINCT * values.max()
    amounts = (vectors.T @ (gradient / scale))[kept] / np.sqrt(values[kept])
    statistic, degrees = float(amounts @ amounts), int(kept.sum())
    return statistic, degrees, float(chdtrc(degrees, statistic))


def views(null: PosteriorFit, problem: TraceProblem) -> list[View]:
    """Each record as the families of directions use it, at the optimum of a null hypothesis."""
    change = null.hypothesis.compiled(null.point.sizes)
    vane = _vane_number(problem.layout.motion)
    controls = [np.array([nodes(row) for row in r.signals.controls_rad]) for r in problem.records]
    controls = [c - c[:, :1] for c in controls]
    largest = np.maximum(np.max([np.abs(c).max(axis=1) for c in controls], axis=0), 1e-9)
    settings = without(problem.settings, vane)
    predicted, rates, others = [], [], []
    for i, (record, tangent) in enumerate(zip(problem.records, null.sensitivities, strict=True)):
        given = filter_inputs(record, change)
        y = given.y[given.lead :, vane]
        predicted.append(y - np.linalg.solve(tangent.white, tangent.r.T)[vane])
        rates.append(_rate(predicted[-1], record.signals.dt_s))
        unread = respond_to(given, settings, null.point.common, null.point.per_record[i])
        lost = not np.isfinite(unread.logdet)
        others.append(predicted[-1] if lost else y - unread.e[:, vane] + _from_others(unread, vane))
    low, high = np.quantile(np.concatenate(predicted), _QUANTILES)
    spread = max(float(np.std(np.concatenate(rates))), 1e-9)
    return [
        View(
            controls_rad=control,
            largest_rad=largest,
            flow_rad=flow,
            rate_rad_s=rate,
            without_vane_rad=other,
            low_rad=float(low),
            high_rad=max(float(high), float(low) + 1e-6),
            rate_std_rad_s=spread,
            dt_s=record.signals.dt_s,
            sub=record.signals.sub,
        )
        for record, control, flow, rate, other in zip(
            problem.records, controls, predicted, rates, others, strict=True
        )
    ]


def _vane_number(motion: Motion) -> int:
    """Number of the vane among the outputs."""
    return next(i for i, y in enumerate(motion.outputs) if y.instrument == "vane")


def _from_others(without_vane: Response, vane: int) -> Array:
    """Innovation of the vane that those of the other sensors lead to expect, (samples,) [rad].

    A reading that rests on the other sensors' current samples, and on all earlier ones, is independent of the current
    residual of the vane given them, so that its score is a martingale too.
    """
    s, rest = without_vane.covariance, np.arange(len(without_vane.covariance)) != vane
    return np.asarray(without_vane.e[:, rest] @ np.linalg.solve(s[np.ix_(rest, rest)], s[rest, vane]))


def _rate(x: Array, dt_s: float) -> Array:
    pole = np.exp(-dt_s / _MEMORY_S)
    smooth = low_pass(float(pole), x - x[0])
    return np.asarray(np.diff(smooth, prepend=0.0) / dt_s)


def _tangents(null: PosteriorFit, problem: TraceProblem, index: int, series: Series) -> Array:
    """Whitened derivatives of a record's innovations in the amounts of some series, (series, samples, outputs)."""
    base, to = null.sensitivities[index], Destinations.of(problem.layout.motion)
    given = filter_inputs(problem.records[index], null.hypothesis.compiled(null.point.sizes))
    tangent = tangent_of(given, problem.settings, null.point.common, null.point.per_record[index])
    if tangent is None:  # the motion diverges, and no direction has evidence
        return np.zeros((len(series), *base.r.shape))
    force = np.zeros((2 * len(tangent.matrices.phi) + 1, len(to.forces), len(series)))
    reading = np.zeros((*given.y.shape, len(series)))
    for number, (where, x) in enumerate(series):
        column = to.output(where)
        if column is None:
            force[-len(x) :, where, number] = x
        else:
            reading[given.lead :, column, number] = x / tangent.sensors.scale[column]
    at_points = np.stack([force[:-2:2], force[1:-1:2], force[2::2]], axis=1)
    return np.asarray(propagated(tangent, at_points, reading) @ base.white.T)


__all__ = ["anomalies", "chi_square", "views"]
