"""Derivatives of the exact step of `airtruth.numerics.discretise.step`: those of its series and its doublings, term by term.

Arrays of derivatives have the parameter along their last axis, so that a product serves all parameters at once.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from airtruth.numerics.compiled import allocating, inner
from airtruth.numerics.discretise import ORDER, congruence, halvings, multiply

Array = NDArray[np.float64]


class StepSlopes(NamedTuple):
    """Derivatives of a step, (n, n, slopes) and (n, inputs, slopes), as the outputs of `step`."""

    phi: Array
    early: Array
    late: Array
    noise: Array


class _Flow(NamedTuple):
    """exp(A t), its integral and the integral of that, and int exp(A t) Q exp(A' t) dt, or their derivatives."""

    phi: Array
    once: Array
    twice: Array
    noise: Array


@inner
def _add_right(d: Array, b: Array, out: Array) -> None:
    """Add d b, with derivatives along the last axis of d (n, n, slopes), to out (n, columns of b, slopes)."""
    for i in range(d.shape[0]):
        for k in range(b.shape[0]):
            moves = False
            for f in range(d.shape[2]):
                moves |= d[i, k, f] != 0.0
            for j in range(b.shape[1]):
                factor = b[k, j]
                if moves and factor != 0.0:
                    for f in range(d.shape[2]):
                        out[i, j, f] += d[i, k, f] * factor


@inner
def _add_both(x: Array, share: float, out: Array) -> None:
    """Add share (x + x') to out, both (n, n, slopes)."""
    for i in range(x.shape[0]):
        for j in range(x.shape[0]):
            for f in range(x.shape[2]):
                out[i, j, f] += share * (x[i, j, f] + x[j, i, f])


@allocating
def _series(a: Array, d_a: Array, process: Array, d_process: Array, h: float, flow: _Flow, d: _Flow) -> None:
    """Fill flow and its derivatives, zero before, over a short time h; a and d_a are A h and its derivatives."""
    n, _, count = d_a.shape
    flat = (n, n * count)
    power, spread, work = np.eye(n), np.zeros((n, n)), np.empty((n, n))
    d_power, d_spread = np.zeros(d_a.shape), np.zeros(d_a.shape)
    d_work, d_other = np.empty(d_a.shape), np.empty(d_a.shape)
    for i in range(n):
        spread[i, i] = process[i] * h
        for f in range(count):
            d_spread[i, i, f] = d_process[i, f] * h
    for k in range(ORDER):
        first, second = h / (k + 1.0), h * h / ((k + 1.0) * (k + 2.0))
        for i in range(n):
            for j in range(n):
                flow.phi[i, j] += power[i, j]
                flow.once[i, j] += power[i, j] * first
                flow.twice[i, j] += power[i, j] * second
                flow.noise[i, j] += spread[i, j]
                for f in range(count):
                    d.phi[i, j, f] += d_power[i, j, f]
                    d.once[i, j, f] += d_power[i, j, f] * first
                    d.twice[i, j, f] += d_power[i, j, f] * second
                    d.noise[i, j, f] += d_spread[i, j, f]
        multiply(a, d_power.reshape(flat), d_work.reshape(flat))
        _add_right(d_a, power, d_work)
        multiply(a, power, work)
        for i in range(n):
            for j in range(n):
                power[i, j] = work[i, j] / (k + 1.0)
                for f in range(count):
                    d_power[i, j, f] = d_work[i, j, f] / (k + 1.0)
                    d_other[i, j, f], d_spread[i, j, f] = d_spread[i, j, f], 0.0
        multiply(a, d_other.reshape(flat), d_work.reshape(flat))
        _add_right(d_a, spread, d_work)
        _add_both(d_work, 1.0 / (k + 2.0), d_spread)
        multiply(a, spread, work)
        for i in range(n):
            for j in range(n):
                spread[i, j] = (work[i, j] + work[j, i]) / (k + 2.0)


@allocating
def _double(flow: _Flow, d: _Flow) -> None:
    """Flow and its derivatives over twice the time, in place."""
    n, _, count = d.phi.shape
    flat = (n, n * count)
    work, other = np.empty((n, n)), np.empty((n, n))
    d_work, d_other = np.empty(d.phi.shape), np.empty(d.phi.shape)
    multiply(flow.once, d.once.reshape(flat), d_work.reshape(flat))
    _add_right(d.once, flow.once, d_work)
    multiply(flow.phi, d.once.reshape(flat), d_other.reshape(flat))
    _add_right(d.phi, flow.once, d_other)
    multiply(flow.once, flow.once, work)
    multiply(flow.phi, flow.once, other)
    for i in range(n):
        for j in range(n):
            flow.twice[i, j] = 2.0 * flow.twice[i, j] + work[i, j]
            flow.once[i, j] += other[i, j]
            for f in range(count):
                d.twice[i, j, f] = 2.0 * d.twice[i, j, f] + d_work[i, j, f]
                d.once[i, j, f] += d_other[i, j, f]
                d_other[i, j, f] = 0.0
    multiply(flow.phi, flow.noise, work)
    for i in range(n):
        for j in range(n):
            other[j, i] = work[i, j]
    _add_right(d.phi, other, d_other)  # times noise phi'
    multiply(flow.phi, d.noise.reshape(flat), d_work.reshape(flat))
    for i in range(n):
        for j in range(n):
            other[j, i] = flow.phi[i, j]
    _add_right(d_work, other, d.noise)
    _add_both(d_other, 1.0, d.noise)
    congruence(flow.phi, flow.noise, work, other)
    multiply(flow.phi, d.phi.reshape(flat), d_work.reshape(flat))
    _add_right(d.phi, flow.phi, d_work)
    multiply(flow.phi, flow.phi, work)
    for i in range(n):
        for j in range(n):
            flow.noise[i, j] += other[i, j]
            flow.phi[i, j] = work[i, j]
            for f in range(count):
                d.phi[i, j, f] = d_work[i, j, f]


@allocating
def step_slopes(
    system: Array, process: Array, d_system: Array, d_process: Array, dt_s: float, made: StepSlopes
) -> None:
    """Derivatives of `airtruth.numerics.discretise.step`.

    Parameters
    ----------
    system, process, dt_s : as in `step`.
    d_system : (states, states + inputs, slopes) derivatives of the system; d_process : (states, slopes).
    made : written.
    """
    n, inputs, count = made.early.shape
    doublings = halvings(system, n, dt_s)
    h = dt_s * 0.5**doublings
    square, shape = (n, n), (n, n, count)
    flow = _Flow(np.zeros(square), np.zeros(square), np.zeros(square), np.zeros(square))
    d = _Flow(np.zeros(shape), np.zeros(shape), np.zeros(shape), np.zeros(shape))
    a, d_a = np.empty(square), np.empty(shape)
    inward, d_inward = np.empty((n, inputs)), np.empty((n, inputs, count))
    for i in range(n):
        for j in range(n + inputs):
            for f in range(count):
                if j < n:
                    d_a[i, j, f] = d_system[i, j, f] * h
                else:
                    d_inward[i, j - n, f] = d_system[i, j, f]
            if j < n:
                a[i, j] = system[i, j] * h
            else:
                inward[i, j - n] = system[i, j]
    _series(a, d_a, process, d_process, h, flow, d)
    for _ in range(doublings):
        _double(flow, d)
    flat = (n, inputs * count)
    multiply(flow.once, d_inward.reshape(flat), made.early.reshape(flat))
    multiply(flow.twice, d_inward.reshape(flat), made.late.reshape(flat))
    _add_right(d.once, inward, made.early)
    _add_right(d.twice, inward, made.late)
    for i in range(n):
        for f in range(count):
            for j in range(n):
                made.phi[i, j, f], made.noise[i, j, f] = d.phi[i, j, f], d.noise[i, j, f]
            for j in range(inputs):
                made.late[i, j, f] /= dt_s
                made.early[i, j, f] -= made.late[i, j, f]


__all__ = ["StepSlopes", "step_slopes"]
