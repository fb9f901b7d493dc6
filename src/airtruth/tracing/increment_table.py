"""A learned increment in physical terms: its table with a band, and how large it is."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from airtruth.effects.increment import Increment, Shape
from airtruth.effects.increment_shape import names_over
from airtruth.physics.motion import LONGITUDINAL
from airtruth.tracing.accepted import AcceptedEffect, IncrementState, IncrementTable
from airtruth.tracing.anomalies.flown import flown
from airtruth.tracing.answer import Z95, CandidateScore
from airtruth.tracing.inference.posterior import PosteriorFit, TraceProblem
from airtruth.tracing.learning.increment_fit import fitted_bends, relative_swing
from airtruth.tracing.selection.rounds import SearchRound

Array = NDArray[np.float64]


def in_physical_terms(
    problem: TraceProblem, fitted: PosteriorFit, covariance: Array, effect: Increment, stated: AcceptedEffect
) -> AcceptedEffect:
    """The effect with coefficient, signal, states and table of a learned increment.

    Parameters
    ----------
    fitted : the fit whose sizes are reported; covariance : of its common parameters and sizes.
    effect, stated : the increment, and what is stated of its parameters.
    """
    shape, names = effect.shape, names_over(effect.shape.acts_on)
    values = {name: estimate.value for name, estimate in stated.parameters.items()}
    states = tuple(
        IncrementState(s.kind, names[s.signal], s.time_s, s.damping, s.half_width)
        for s in shape.terms(values).states
    )
    return replace(
        stated,
        acts_on=shape.acts_on,
        over=names[shape.signal],
        by=names[shape.factor] if shape.factor else None,
        by_at=shape.factor_trim
        + (problem.alpha_shift_rad if shape.factor == problem.layout.motion.flow else 0.0),
        relative_size=relative_swing(problem, fitted, effect),
        table=increment_table(problem, fitted, covariance, effect) if shape.cells else None,
        states=states,
    )


def increment_table(
    problem: TraceProblem, fitted: PosteriorFit, covariance: Array, effect: Increment
) -> IncrementTable:
    """The increment at the ends of its cells, with its pointwise 95 % band and the samples about each point.

    Angles of attack count from zero.
    """
    shape = effect.shape
    signal = np.concatenate([flown(r, shape.signal) for r in problem.records])
    table = table_of(shape, *fitted_bends(fitted, effect, covariance), signal)
    shift_rad = problem.alpha_shift_rad if shape.signal == problem.layout.motion.flow else 0.0
    at, trim = tuple(x + shift_rad for x in table.at), shape.trim + shift_rad
    return replace(table, at=at, trim=trim) if shift_rad else table


def table_of(shape: Shape, bends: Array, spread: Array, signal: Array) -> IncrementTable:
    """The table of a shape.

    Parameters
    ----------
    bends, spread : (bends,) and their covariance (bends, bends); signal : (samples,) of the fitted records.
    """
    at = np.linspace(shape.low, shape.high, shape.cells + 1)
    basis = shape.basis(at)
    value = basis @ bends
    half = Z95 * np.sqrt(np.maximum(np.einsum("pi,ij,pj->p", basis, spread, basis), 0.0))
    edges = np.concatenate([[-np.inf], at[:-1] + 0.5 * shape.width, [np.inf]])
    samples = np.histogram(signal, edges)[0]
    return IncrementTable(
        at=tuple(at.tolist()),
        value=tuple(value.tolist()),
        low=tuple((value - half).tolist()),
        high=tuple((value + half).tolist()),
        samples=tuple(int(n) for n in samples),
        trim=shape.trim,
    )


def least_certain(effects: Sequence[AcceptedEffect]) -> Iterator[str]:
    """For each learned table: where its band is widest, as a sentence."""
    for effect in effects:
        table = effect.table
        if table is None:
            continue
        planned = effect.acts_on in {c.name for c in LONGITUDINAL.coefficients}
        computed = " `airtruth plan --from` computes the input." if planned else ""
        widths = [high - low for low, high in zip(table.low, table.high, strict=True)]
        i = int(np.argmax(widths))
        yield (
            f"The increment of {effect.variant} is least certain at {table.at[i]:.3g} ({table.samples[i]} samples): "
            f"records that hold the signal there narrow its band.{computed}"
        )


def increment_rows(rounds: Sequence[SearchRound]) -> Iterator[CandidateScore]:
    """Increments that were refitted, each as it was last assessed."""
    last = {
        c.score.effect.key: (c, c in r.tied)
        for r in rounds
        for c in r.candidates
        if isinstance(c.score.effect, Increment)
    }
    for c, is_accepted in last.values():
        s = c.score
        yield CandidateScore(
            name=s.effect.name,
            variant=s.effect.variant,
            score=s.z**2,
            z=s.z,
            p_value=s.p_value,
            p_value_alone=s.p_value,
            testable=True,
            why_not="" if is_accepted else "; ".join(c.reasons) or "another increment explains as much",
        )


__all__ = ["in_physical_terms", "increment_rows", "increment_table", "least_certain", "table_of"]
