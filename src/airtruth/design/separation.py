"""Separation of two hypotheses by a record: the noncentrality that remains once everything else is refitted.

The outputs of a hypothesis, flown by the tracer's model through the elevator of the record in calm air, are filtered by
the tracer's filter under the other hypothesis. With r the whitened innovations (zero under the true hypothesis), T their
derivatives by the nuisance parameters x (derivatives, thrust, gust shape, inertia; biases, trim and initial state of the
record), S those by the sizes s of the other hypothesis, and P the prior precision of x, the separation d has

    d^2 = min over x, s of N |r + T x + S s|^2 + x' P x

for N equal records: the noncentrality of the difference in 2 log L of the two best fits, whose mean it is (R. E. Maine
and K. W. Iliff, NASA RP-1138 (1985), section 5, for the innovations; C. R. Rao, Linear Statistical Inference (1973),
6a.2, for the noncentrality). T is linear; s is searched until the innovations no longer fall.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.effects.effect import Effect, Parameter
from airtruth.physics.terms import Change
from airtruth.tracing.inference.hypothesis import Hypothesis
from airtruth.tracing.inference.posterior import Sensitivities, TraceProblem, sensitivities_of
from airtruth.tracing.model.parameters import Layout, ParameterLayout, Parameters
from airtruth.tracing.model.records import TraceRecord
from airtruth.tracing.model.response import respond
from airtruth.tracing.model.settings import Settings, initial_per_record

Array = NDArray[np.float64]

_LOCATION_STEP: Final = 0.02
"""Step of the differences in a size over `Parameter.step`, where the effect is present or the parameter is a location
[-] (judgement: as in the tracer's posterior)."""
_STEPS: Final = 4
"""Steps of the search for the sizes of the other hypothesis [-] (judgement: it begins near its end)."""
_HALVINGS: Final = 2
"""Times that a step which does not help is halved [-] (judgement)."""
_SETTLED: Final = 0.01
"""Relative fall of d^2 below which the search ends [-] (judgement: half a percent of the separation)."""


@dataclass(frozen=True)
class Member:
    """A hypothesis with its sizes.

    Attributes
    ----------
    effect : its effect.
    sizes : (parameters,) in the effect's size coordinates.
    """

    effect: Effect
    sizes: Array

    @property
    def values(self) -> dict[str, float]:
        """Parameters in their own units."""
        return {p.name: p.value(float(s)) for p, s in zip(self.effect.parameters, self.sizes, strict=True)}


@dataclass(frozen=True)
class FilterSetting:
    """Common part of the hypotheses.

    Attributes
    ----------
    settings : noise and priors of the sensors.
    declared : what aircraft.toml declares of sensors and dynamics.
    gust_m_s : standard deviation of the gust of the motion in the flights to come [m/s].
    records : number of equal records that are fitted together.
    """

    settings: Settings
    declared: Change
    gust_m_s: float
    records: int

    @property
    def layout(self) -> ParameterLayout:
        """Parameters of the motion."""
        return self.settings.layout

    @property
    def still(self) -> Array:
        """(common,) parameters of the declared aircraft."""
        return np.zeros(self.layout.common.size)

    def hypothesis(self, effects: Sequence[Effect], record: TraceRecord) -> Hypothesis:
        """The declared aircraft with some effects."""
        flow = float(record.plant.trim_signals[0])
        return Hypothesis(self.declared, tuple(effects), trim_flow_rad=flow, motion=self.layout.motion)

    def own(self, record: TraceRecord) -> Array:
        """(per-record,) parameters of a flight in these gusts."""
        values = initial_per_record(record, self.settings)
        values[self.layout.per_record.log_gust] = np.log(self.gust_m_s)
        return values


@dataclass(frozen=True)
class Distance:
    """Separation of one truth from the best-fitting member of another hypothesis.

    Attributes
    ----------
    sigma : separation of all records together [standard deviations].
    sizes : (parameters,) of that member.
    """

    sigma: float
    sizes: Array


class Experiment:
    """One record and what is refitted on it.

    Parameters
    ----------
    model : what the hypotheses have in common.
    record : the record; its outputs are not used.
    """

    def __init__(self, model: FilterSetting, record: TraceRecord) -> None:
        self.model = model
        self.record = flown_by(model, record, model.hypothesis((), record), np.zeros(0), model.still)
        problem = TraceProblem((self.record,), model.settings)
        self._problem = problem
        own = model.own(self.record)
        point = Parameters(model.still, own[None], np.zeros(0), model.layout)
        found = sensitivities_of(problem, 0, model.hypothesis((), self.record), point)
        self.sound = found is not None
        if found is None:
            return
        self._white, self._sensitivities = found.white, found
        self._bases: dict[tuple[int, ...], Array] = {}

    def outputs(self, truth: Member, common: Array) -> Array:
        """(samples, outputs) outputs of the record that the tracer's model has with an effect, in calm air."""
        hypothesis = self.model.hypothesis((truth.effect,), self.record)
        return flown_by(self.model, self.record, hypothesis, truth.sizes, common).signals.y

    def distance(self, y: Array, rival: Effect, start: Array, common: Array) -> Distance:
        """Separation of outputs from the best-fitting member of a hypothesis.

        Parameters
        ----------
        y : (samples, outputs) outputs under the truth.
        rival : effect of the other hypothesis; start : (parameters,) sizes at which its search begins.
        common : (common,) parameters of the aircraft under both hypotheses.
        """
        record = replace(self.record, signals=replace(self.record.signals, y=y))
        hypothesis = self.model.hypothesis((rival,), record)
        own = self.model.own(record)
        basis = self._basis(hypothesis)

        def innovations(sizes: Array) -> Array:
            change = hypothesis.change(sizes)
            moved = respond(record, self.model.settings, change, common, own)
            return (moved.e @ self._white.T).ravel()

        sizes = clipped(rival, start)
        r = innovations(sizes)
        rest = beyond(basis, r)
        best = float(rest @ rest)
        for _ in range(_STEPS):
            directions = np.stack(
                [(innovations(_moved(sizes, k, h)) - r) / h for k, h in enumerate(_steps(rival, sizes))]
            )
            across = np.stack([beyond(basis, d) for d in directions])
            scale = np.sqrt(np.maximum(np.sum(across**2, axis=1), 1e-300))
            move = -np.linalg.lstsq((across / scale[:, None]).T, rest, rcond=1e-9)[0] / scale
            before = best
            for halving in range(1 + _HALVINGS):
                tried = clipped(rival, sizes + move * 0.5**halving)
                moved = innovations(tried)
                left = beyond(basis, moved)
                if np.isfinite(left).all() and left @ left < best:
                    sizes, r, rest, best = tried, moved, left, float(left @ left)
                    break
            if best > before * (1.0 - _SETTLED):
                break
        return Distance(float(np.sqrt(self.model.records * best)), sizes)

    def _basis(self, hypothesis: Hypothesis) -> Array:
        known = self._bases.get(hypothesis.unconstrained)
        if known is not None:
            return known
        basis = refitted(self._problem, hypothesis, self._sensitivities, self.model.records)
        self._bases[hypothesis.unconstrained] = basis
        return basis


def flown_by(
    model: FilterSetting, record: TraceRecord, hypothesis: Hypothesis, sizes: Array, common: Array
) -> TraceRecord:
    """The record with the outputs that the tracer's model has under a hypothesis, in calm air.

    Parameters
    ----------
    sizes : of the hypothesis.
    common : (common,) parameters of the aircraft.
    """
    own, change = model.own(record), hypothesis.change(sizes)
    flown = respond(record, model.settings, change, common, own, free_run=True)
    return replace(record, signals=replace(record.signals, y=record.signals.y - flown.e))


def refitted(problem: TraceProblem, hypothesis: Hypothesis, found: Sensitivities, records: int) -> Array:
    """Orthonormal basis (samples * outputs + nuisance, nuisance) of what is refitted on equal records, priors as further rows.

    Parameters
    ----------
    problem : with one record.
    hypothesis : whose priors count.
    found : sensitivities of the record; those by sizes do not count.
    records : number of equal records that are fitted together.
    """
    every, each = problem.layout.common, problem.layout.per_record
    layout = Layout(problem.layout, len(found.t) - every.size - each.size)
    # the mean of the innovations does not depend on the noise, nor on the level of the gusts
    shared = np.setdiff1d(np.arange(every.colour.start), every.noise)
    own = np.setdiff1d(np.arange(each.size), each.log_gust)
    nuisance = np.concatenate([shared, layout.per_record.start + own])
    t = found.t[nuisance].reshape(len(nuisance), -1).T
    priors = problem.priors(hypothesis)
    rows = np.zeros((len(nuisance),) * 2)
    rows[: len(shared), : len(shared)] = np.linalg.cholesky(priors.common[np.ix_(shared, shared)] / records).T
    rows[len(shared) :, len(shared) :] = np.linalg.cholesky(priors.per_record[0][1][np.ix_(own, own)]).T
    return np.asarray(np.linalg.qr(np.vstack([t, rows]))[0])


def beyond(basis: Array, r: Array) -> Array:
    """The part of innovations, with the zeros of the priors' rows, that no nuisance parameter explains."""
    whole = np.concatenate([r, np.zeros(basis.shape[0] - r.size)])
    return np.asarray(whole - basis @ (basis.T @ whole))


def _moved(x: Array, index: int, step: float) -> Array:
    moved = x.copy()
    moved[index] += step
    return moved


def _steps(effect: Effect, sizes: Array) -> list[float]:
    def step(p: Parameter, size: float) -> float:
        return _LOCATION_STEP * p.step if p.is_location or abs(size) > p.step else p.step

    return [step(p, float(s)) for p, s in zip(effect.parameters, sizes, strict=True)]


def clipped(effect: Effect, sizes: Array) -> Array:
    """Sizes within the ranges of the effect's parameters."""
    low, high = np.array([p.reach for p in effect.parameters]).T
    return np.asarray(np.clip(sizes, low, high))


__all__ = ["Distance", "Experiment", "FilterSetting", "Member", "beyond", "clipped", "flown_by", "refitted"]
