"""Increments of the axial force, learned from ax after the search.

The filter takes the airspeed from the record, so that an axial force through the CG moves none of its outputs: alpha, q and az
hold no information on CX, and ax holds all of it. The regression is linear,

    y = constant of the record + tolerances t + B(s) b + noise,

y of `airtruth.tracing.axial_series`, t normal with their stated standard deviations, b the bends of a penalised linear spline
over a signal s, as of every learned increment (`airtruth.effects.increment`).

Sources: S. N. Wood, Generalized Additive Models, 2nd ed., 2017, section 5.3; D. J. C. MacKay, Neural Computation 4 (1992),
section 3 (evidence); J. D. Sargan, Econometrica 26 (1958) (instruments); W. K. Newey and K. D. West, Econometrica 55 (1987),
eq. (5) (long-run variance).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from airtruth.aircraft import Aircraft
from airtruth.effects.increment import Increment, Shape, increment
from airtruth.effects.increment_shape import names_over
from airtruth.logs.flight_log import FlightLog
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.terms import Change, coefficients_of, factors_of
from airtruth.tracing.accepted import AcceptedEffect, ParameterEstimate
from airtruth.tracing.answer import Z95
from airtruth.tracing.axial_series import CHANNEL, AxialSeries, axial_series
from airtruth.tracing.increment_table import table_of
from airtruth.tracing.inference.direction import eliminated
from airtruth.tracing.inference.posterior import PosteriorFit
from airtruth.tracing.inference.robust import MEMORY_S, long_run
from airtruth.tracing.learning.increment_fit import LEAST_ODDS, effective_bends, is_apart_from_zero
from airtruth.tracing.learning.increments import CELLS, best_prior, covered, posterior_bends
from airtruth.tracing.learning.learn import LEAST_RECORDS
from airtruth.tracing.model.plant import FLOW
from airtruth.tracing.prepare import Case
from airtruth.tracing.stage_errors import AxialErrors, AxialRms
from airtruth.tracing.stages import Stages

Array = NDArray[np.float64]

_COEFFICIENT: Final = "CX"
"""Coefficient of the axial force."""
SIGNALS: Final = factors_of(LONGITUDINAL)
"""Signals over which an increment is learned."""
_FINER: Final = (12, 16, 24)
"""Further numbers of cells [-]; those of the other increments but for the finest."""
_MATERIAL: Final = 0.1
"""Least swing over that of the declared CX over the flown angles of attack [-] (judgement: an axial force of a wind tunnel is
known to some per cent)."""
_EXPLAINED: Final = 0.25
"""Least share of ax beyond the model, in squares, that an increment explains on records left out [-] (judgement: engines that
follow the motion leave a fifth in one propeller aircraft of ten; undeclared drags and wrong effects, three quarters)."""
_THROTTLE_STD: Final = 0.01
"""Standard deviation of a logged throttle from which a record is passed over [-] (judgement): the declared engines are taken at
their mean."""
_MEAN_S: Final = 0.1
"""Interval over which the series are averaged [s] (judgement: shorter than a manoeuvre, longer than delays between the channels,
which gusts would turn into an axial force)."""


@dataclass(frozen=True)
class AxialForce:
    """Result of the comparison of ax.

    Attributes
    ----------
    increments : accepted increments of CX; empty for none.
    change : the same as terms.
    errors : ax beyond the declared model, and beyond that with the increments.
    """

    increments: tuple[AcceptedEffect, ...]
    change: Change
    errors: AxialErrors


@dataclass(frozen=True)
class _Means:
    """Means of one record over `_MEAN_S`: of y (n,) and of the tolerances (n, tolerances)."""

    y: Array
    tolerances: Array


@dataclass(frozen=True)
class _Learned:
    """One shape at its estimate.

    Attributes
    ----------
    bends, covariance : (n,) and (n, n) [-].
    log_evidence : log of the posterior odds, all shapes equally probable beforehand [-].
    explained : share of ax beyond the model, in squares, that it explains on records left out in turn [-].
    """

    effect: Increment
    bends: Array
    covariance: Array
    log_evidence: float
    explained: float


def axial_force(
    stages: Stages, logs: Sequence[FlightLog], aircraft: Aircraft, last: PosteriorFit
) -> AxialForce | None:
    """Learn what ax shows beyond the declared axial force.

    Parameters
    ----------
    stages : assessed stages, whose best has the biases of the held-out records; logs : the records, checked.
    last : fit with the accepted effects; its biases and the accepted errors of sensors and surface are undone.

    Returns
    -------
    None where the motion has no axial force, a vane or a JSBSim model is missing, a fitted record has no ax or a throttle that
    moves, or there are fewer than three of them. A held-out record of this kind has no part in the errors.
    """
    case = stages.case
    has_axial = _COEFFICIENT in coefficients_of(case.fitted.layout.motion)
    usable = (
        has_axial and case.model == "aircraft" and case.has_vane and len(case.fitted.records) >= LEAST_RECORDS
    )
    steady = _steady_runs(logs)
    if not usable or not all(r.signals.run_id in steady for r in case.fitted.records):
        return None
    change = last.hypothesis.change(last.point.sizes)
    assessed = () if case.held is None else zip(case.held.records, stages.held[stages.best], strict=True)
    left_out = [(r, a.per_record) for r, a in assessed if r.signals.run_id in steady]
    own = [*last.point.per_record, *(per_record for _, per_record in left_out)]
    records = (*case.fitted.records, *(r for r, _ in left_out))
    series = axial_series([log for log in logs if CHANNEL in log.channels], records, own, change, aircraft)
    fitted, held = series[: len(case.fitted.records)], series[len(case.fitted.records) :]
    learned = _learned(fitted, _shapes(case, fitted))
    best = max(learned, key=lambda own: own.log_evidence, default=None)
    accepted = [best] if best is not None and _is_accepted(best, case, fitted) else []
    others = [o.log_evidence for o in learned if best and o.effect.shape.signal != best.effect.shape.signal]
    return AxialForce(
        increments=tuple(_stated(own, max([0.0, *others]), case, fitted) for own in accepted),
        change=sum((_terms(own) for own in accepted), Change()),
        errors=AxialErrors(_rms(fitted, held, []), _rms(fitted, held, accepted)),
    )


def _steady_runs(logs: Sequence[FlightLog]) -> set[str]:
    """Runs with ax in which the throttle rests; where it is not logged, the records' constants have to suffice."""
    return {
        name
        for log in logs
        if CHANNEL in log.channels
        for run, name in enumerate(log.run_ids)
        if (lever := log.channels.get("throttle")) is None
        or float(np.std(lever[log.rows(run)])) < _THROTTLE_STD
    }


def _shapes(case: Case, fitted: Sequence[AxialSeries]) -> list[Shape]:
    """Functions of each signal that the records excite, over the range that they cover, with more and more cells."""
    plants = [r.plant for r in case.fitted.records]
    trims = {name: float(np.mean([plant.trims[name] for plant in plants])) for name in plants[0].trims}
    found = []
    for name in SIGNALS:
        low, high = covered(np.concatenate([s.signals[name] for s in fitted]))
        if high > low:
            trim = float(np.clip(trims.get(name, 0.0), low, high))
            found += [Shape(_COEFFICIENT, name, low, high, cells, trim) for cells in (CELLS, *_FINER)]
    return found


def _learned(fitted: Sequence[AxialSeries], shapes: Sequence[Shape]) -> list[_Learned]:
    """Every shape at its estimate."""
    records = [_Means(_means(s.y, s.dt_s), _means(s.tolerances, s.dt_s)) for s in fitted]
    weights = _weights(records)
    found = []
    for shape in shapes:
        effect = increment(shape)
        bases = _bases(fitted, shape)
        gradient, information = _normal(records, bases, weights)
        std, evidence = best_prior(effect, gradient, information)
        bends, inverse = posterior_bends(gradient, information, std)
        excess = _excess(records, bases, weights, bends, inverse)
        gain = 0.0
        for i in range(len(records)):
            rest = [k for k in range(len(records)) if k != i]
            without = _normal([records[k] for k in rest], [bases[k] for k in rest], weights[rest])
            b, _ = posterior_bends(*without, std)
            gain += _gain(records[i].y, bases[i] @ b, float(weights[i]))
        found.append(
            _Learned(
                effect=effect.with_prior(std),
                bends=bends,
                covariance=inverse * excess,
                log_evidence=evidence / excess - float(np.log(len(shapes))),
                explained=gain / _squares(records, weights),
            )
        )
    return found


def _bases(fitted: Sequence[AxialSeries], shape: Shape) -> list[Array]:
    """Means of the increments by a unit of each bend (n, bends) of each record, without the noise that is in y.

    Where the signal has an instrument, they are projected on those of the instrument: two-stage least squares.
    """
    name = shape.signal
    measured = [_means(shape.basis(s.signals[name]), s.dt_s) for s in fitted]
    if not all(name in s.instruments for s in fitted):
        return measured
    shown = [_means(shape.basis(s.instruments[name]), s.dt_s) for s in fitted]
    design = np.hstack([block_diag(*(np.ones((len(z), 1)) for z in shown)), np.concatenate(shown)])
    projected = design @ np.linalg.lstsq(design, np.concatenate(measured), rcond=None)[0]
    return np.split(projected, np.cumsum([len(z) for z in shown])[:-1])


def _means(x: Array, dt_s: float) -> Array:
    """Means (n, ...) of a series (samples, ...) over consecutive intervals; an incomplete last one is left out."""
    width = max(round(_MEAN_S / dt_s), 1)
    n = len(x) // width
    return np.asarray(x[: n * width].reshape(n, width, *x.shape[1:]).mean(axis=1))


def _weights(records: Sequence[_Means]) -> Array:
    """(records,) inverse standard deviations of the noise, from what constants and tolerances leave."""
    found = []
    for s in records:
        design = np.column_stack([np.ones(len(s.y)), s.tolerances])
        left = _residual(design, s.y)
        found.append(1.0 / max(float(left.std()), 1e-12))
    return np.array(found)


def _residual(design: Array, x: Array) -> Array:
    """Residual of x after a least-squares fit of the columns of a design."""
    return np.asarray(x - design @ np.linalg.lstsq(design, x, rcond=None)[0])


def _design(records: Sequence[_Means], bases: Sequence[Array], weights: Array) -> list[Array]:
    """Weighted regressors of each record: constants of the records, tolerances, bends."""
    rows = []
    for i, (s, basis, weight) in enumerate(zip(records, bases, weights, strict=True)):
        constants = np.zeros((len(s.y), len(records)))
        constants[:, i] = 1.0
        rows.append(weight * np.hstack([constants, s.tolerances, basis]))
    return rows


def _normal(records: Sequence[_Means], bases: Sequence[Array], weights: Array) -> tuple[Array, Array]:
    """Gradient (bends,) and information (bends, bends) at no increment, constants and tolerances eliminated."""
    rows = _design(records, bases, weights)
    count, tolerances = len(records), records[0].tolerances.shape[1]
    information = sum((r.T @ r for r in rows), np.zeros((rows[0].shape[1],) * 2))
    of_tolerances = np.arange(count, count + tolerances)
    information[of_tolerances, of_tolerances] += 1.0
    pairs = zip(rows, records, weights, strict=True)
    gradient = -sum((r.T @ (weight * s.y) for r, s, weight in pairs), np.zeros(rows[0].shape[1]))
    return eliminated(gradient, information, range(count + tolerances, len(gradient)))


def _gain(y: Array, more: Array, weight: float) -> float:
    """Gain in log L of a record by an increment, its constant free and the declared slopes as they are."""
    before, after = y - y.mean(), y - more - (y - more).mean()
    return float(0.5 * weight**2 * (before @ before - after @ after))


def _squares(records: Sequence[_Means], weights: Array) -> float:
    """Gain in log L of all records if nothing beyond their constants were left."""
    return sum(_gain(r.y, r.y, float(w)) for r, w in zip(records, weights, strict=True))


def _excess(
    records: Sequence[_Means], bases: Sequence[Array], weights: Array, bends: Array, inverse: Array
) -> float:
    """Long-run over plain variance of the bends, mean over them, at least one [-]: the noise is not white."""
    middle = np.zeros_like(inverse)
    plain = np.zeros_like(inverse)
    for s, basis, weight in zip(records, bases, weights, strict=True):
        design = np.column_stack([np.ones(len(s.y)), s.tolerances])
        own, left = _residual(design, basis), _residual(design, s.y - basis @ bends)
        slopes = weight**2 * own * left[:, None]
        middle += long_run(slopes - slopes.mean(axis=0), round(MEMORY_S / _MEAN_S))
        plain += weight**2 * own.T @ own
    ratio = np.diag(inverse @ middle @ inverse) / np.maximum(np.diag(inverse @ plain @ inverse), 1e-300)
    return max(float(np.mean(ratio)), 1.0)


def _is_accepted(own: _Learned, case: Case, fitted: Sequence[AxialSeries]) -> bool:
    """Whether it has evidence, exceeds two standard deviations, explains records left out and is material."""
    degrees = effective_bends(own.covariance, own.effect.parameters[0].prior_std)
    return (
        own.log_evidence >= LEAST_ODDS
        and is_apart_from_zero(own.bends, own.covariance, degrees)
        and own.explained >= _EXPLAINED
        and _relative_swing(own, case, fitted) >= _MATERIAL
    )


def _relative_swing(own: _Learned, case: Case, fitted: Sequence[AxialSeries]) -> float:
    """Swing over that of the declared CX over the flown angles of attack [-]."""
    shape = own.effect.shape
    swing = float(np.ptp(shape.basis(np.linspace(shape.low, shape.high, 101)) @ own.bends))
    low, high = covered(np.concatenate([s.signals["alpha"] for s in fitted]))
    plant = case.fitted.records[0].plant
    at = np.linspace(low, high, 101)
    axis, forces = plant.along(FLOW)
    declared = np.interp(at, axis, forces[:, 0]) / plant.aircraft.constants.wing_area_m2
    return swing / max(float(np.ptp(declared)), 1e-9)


def _terms(own: _Learned) -> Change:
    return own.effect.describe(
        {p.name: b for p, b in zip(own.effect.parameters, own.bends.tolist(), strict=True)}
    )


def _stated(own: _Learned, next_best: float, case: Case, fitted: Sequence[AxialSeries]) -> AcceptedEffect:
    shape = own.effect.shape
    signal = np.concatenate([s.signals[shape.signal] for s in fitted])
    stds = np.sqrt(np.diag(own.covariance))
    return AcceptedEffect(
        name=own.effect.name,
        variant=shape.variant,
        parameters={
            p.name: ParameterEstimate(b, s, (b - Z95 * s, b + Z95 * s))
            for p, b, s in zip(own.effect.parameters, own.bends.tolist(), stds.tolist(), strict=True)
        },
        p_value=float(np.exp(-own.log_evidence)),
        separation_sigma=float(np.sqrt(2.0 * max(own.log_evidence - next_best, 0.0))),
        gain_2_log_likelihood=2.0 * own.log_evidence,
        acts_on=shape.acts_on,
        over=names_over(shape.acts_on)[shape.signal],
        relative_size=_relative_swing(own, case, fitted),
        table=table_of(shape, own.bends, own.covariance, signal),
    )


def _rms(
    fitted: Sequence[AxialSeries], held: Sequence[AxialSeries], accepted: Sequence[_Learned]
) -> AxialRms:
    """Root mean squares of ax beyond the model with the accepted increments."""

    def rms(records: Sequence[AxialSeries]) -> float:
        squares = []
        for s in records:
            left = s.y.copy()
            for own in accepted:
                left -= own.effect.shape.basis(s.signals[own.effect.shape.signal]) @ own.bends
            left *= s.unit_m_s2
            squares.append(np.mean((left - left.mean()) ** 2))
        return float(np.sqrt(np.mean(squares)))

    return AxialRms(rms(fitted), rms(held) if held else None)


__all__ = ["SIGNALS", "AxialForce", "axial_force"]
