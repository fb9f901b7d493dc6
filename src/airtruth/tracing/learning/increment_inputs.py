"""Increments along the motion that the filter flew, and the change of the innovations by a unit of each.

The increments of all shapes pass through one tangent linear model of a record, so that each bend costs a quarter of a
flight of the filter. An increment also changes the gain of the filter. At the record's mean it changes the derivatives, and
their sensitivities, which are differences of flights, give this part. Memories follow the motion, without updates of
their own by the filter.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.effects.increment import Memory, Shape
from airtruth.numerics.recursion import recursion
from airtruth.physics.motion import Motion
from airtruth.physics.terms import QBAR
from airtruth.tracing.inference.direction import inserted
from airtruth.tracing.inference.posterior import PosteriorFit, Sensitivities, TraceProblem
from airtruth.tracing.model.linearise import ANGLE_RAD, RATE_RAD_S
from airtruth.tracing.model.response import filter_inputs
from airtruth.tracing.model.tangent import POINTS, Tangent, flown_of, propagated, tangent_of

Array = NDArray[np.float64]

_BLOCK: Final = 200_000
"""Coefficients times samples that pass through the tangent linear model at once [-] (judgement: 30 MB)."""


@dataclass
class FlownMotion:
    """The flown motion of one record; memories are kept, because many shapes share them."""

    tangent: Tangent
    motion: Motion
    kept: dict[tuple[Memory, str], Array] = field(default_factory=dict)

    def signal(self, name: str) -> Array:
        """(steps, points) of a signal."""
        return self.tangent.matrices.flown[:, :, flown_of(self.motion).index(name)]

    def state(self, memory: Memory, name: str) -> Array:
        """(steps, points) of a memory that a signal drives."""
        key = (memory, name)
        if key not in self.kept:
            self.kept[key] = self._driven(memory, name)
        return self.kept[key]

    def felt(self, name: str) -> Array:
        """(steps, points) of a signal; a rate is that of the body, which a gyro feels."""
        return self.signal(f"body_{name}" if name in _rates(self.motion) else name)

    def _driven(self, memory: Memory, name: str) -> Array:
        at_first = (self.motion.flow, *(control.name for control in self.motion.controls))
        start = dict(zip(at_first, self.tangent.start, strict=True)).get(name, 0.0)
        if memory.kind == "play":
            return _play(self.felt(name)[:, -1], start, memory)
        return _linear(self.signal(name), start, memory, self.tangent.h_s)


def _rates(motion: Motion) -> set[str]:
    """Signals that are nondimensional rates."""
    return {s.name for s in motion.signals if s.length is not None}


def _play(ends: Array, start: float, memory: Memory) -> Array:
    """(steps, points) of a play, which moves at the end of each step."""
    state, held = np.empty((ends.size, POINTS)), start
    for i, s in enumerate(ends.tolist()):
        state[i, :-1] = held
        held = min(max(held, s - memory.half_width), s + memory.half_width)
        state[i, -1] = held
    return state


def _linear(signal: Array, start: float, memory: Memory, h_s: float) -> Array:
    """(steps, points) of a lag or a mode behind a signal that is linear over a step: z' = p z + s, one pole p."""
    if memory.kind == "mode":
        damping, wn = memory.damping, 1.0 / memory.time_s
        damped = wn * math.sqrt(1.0 - damping**2)
        pole = complex(-damping * wn, damped)
    else:
        pole = complex(-1.0 / memory.time_s)
    growth = np.exp(pole * h_s)
    whole = (growth - 1.0) / (pole * h_s)
    ramp = (whole - 1.0) / (pole * h_s)
    driven = h_s * ((whole - ramp) * signal[:, 0] + ramp * signal[:, -1])
    first = -start / pole
    after = recursion(complex(growth), driven, first)
    z = np.concatenate([[first], after])
    x = wn * wn / damped * z.imag if memory.kind == "mode" else (z / memory.time_s).real
    return np.stack([x[:-1], 0.5 * (x[:-1] + x[1:]), x[1:]], axis=1)


def _late(values: Array, lag_s: float, delay_s: float, h_s: float) -> Array:
    """(steps, points, coefficients) of increments behind the lag and the delay of their sensor."""
    if lag_s > 0.0:
        lag = Memory("lag", lag_s)
        columns = [_linear(column, float(column[0, 0]), lag, h_s) for column in np.moveaxis(values, 2, 0)]
        values = np.stack(columns, axis=2)
    if delay_s > 0.0:
        t = h_s * np.arange(len(values) + 1)
        ends = np.concatenate([values[:1, 0], values[:, -1]])
        columns = [np.interp(t - delay_s, t, column) for column in ends.T]
        held = np.stack(columns, axis=1)
        values = np.stack([held[:-1], 0.5 * (held[:-1] + held[1:]), held[1:]], axis=1)
    return values


def _along(shape: Shape, motion: FlownMotion) -> Array:
    """(steps, points, coefficients) of an increment by a unit of each of its coefficients."""
    memory = shape.memory
    signal = motion.felt(shape.signal) if shape.of_reading else motion.signal(shape.signal)
    if shape.factor and memory is not None:
        behind = motion.state(memory, shape.factor) - motion.signal(shape.factor)
        return shape.basis(signal) * behind[..., None]
    driver = signal if memory is None else motion.state(memory, shape.signal)
    if not shape.cells:
        return (driver - signal)[..., None]
    values = shape.basis(driver)
    if shape.factor:
        values = values * (motion.signal(shape.factor) - shape.factor_trim)[..., None]
    return values


def _slopes(
    shape: Shape, motion: Motion, reference: Mapping[str, float], half_s: float, flow_rate: Array
) -> Array:
    """(coefficients, coefficients of the motion, signals) with which an increment begins at the reference of a record.

    Parameters
    ----------
    reference : values of the signals there.
    half_s : reference length of the rates over twice the airspeed [s].
    flow_rate : slopes of the rate of the flow angle in the signals of the derivatives.
    """
    factors = [s.name for s in motion.signals]
    every = np.zeros((_size(shape), *motion.shape))
    if shape.of_reading or not shape.cells or shape.memory is not None:
        return every
    slopes = every[:, _row(shape, motion)]
    if shape.factor:
        slopes[:, factors.index(shape.factor)] = shape.basis(reference[shape.signal])
        return every
    middle = reference.get(shape.signal, 0.0)
    angle = shape.signal in factors and shape.signal not in _rates(motion)
    h = ANGLE_RAD if angle else RATE_RAD_S * half_s
    rise = (shape.basis(middle + h) - shape.basis(middle - h)) / (2.0 * h)
    if shape.signal in factors:
        slopes[:, factors.index(shape.signal)] = rise
    elif shape.signal == motion.flow_rate:
        slopes[:] = np.outer(rise, flow_rate)
    return every


def _row(shape: Shape, motion: Motion) -> int:
    """Number of the coefficient that an increment changes."""
    return [c.name for c in motion.coefficients].index(shape.acts_on)


def sensitivities_to(
    null: PosteriorFit, problem: TraceProblem, tried: Sequence[Shape]
) -> list[Sensitivities] | None:
    """Sensitivities of each record at the null, with the coefficients of shapes as further common parameters.

    The covariance of the innovations is taken for constant. None where a filter loses the motion.
    """
    made = problem.each(lambda i: _of_record(null, problem, i, tried), range(len(problem.records)))
    found = [m for m in made if m is not None]
    return found if len(found) == len(made) else None


def _of_record(
    null: PosteriorFit, problem: TraceProblem, index: int, tried: Sequence[Shape]
) -> Sensitivities | None:
    record, base, point = problem.records[index], null.sensitivities[index], null.point
    given = filter_inputs(record, null.hypothesis.compiled(point.sizes))
    tangent = tangent_of(given, problem.settings, point.common, point.per_record[index])
    if tangent is None:
        return None
    described = problem.layout.motion
    motion = FlownMotion(tangent, described)
    pairs = zip(described.signals, record.plant.trim_signals.tolist(), strict=True)
    linear = np.stack([motion.signal(s.name) - trim for s, trim in pairs], axis=-1)
    (rows, count), derivatives = described.shape, base.t[null.point.of.common.derivatives]
    force = np.zeros((*linear.shape[:2], rows, rows * count))
    for k in range(rows):
        force[:, :, k, k * count : (k + 1) * count] = linear
    nothing = np.zeros((len(tangent.path.scale), len(base.white), rows * count))
    by_gain = derivatives - propagated(tangent, force, nothing) @ base.white.T
    by_gain[~derivatives.any(axis=(1, 2))] = 0.0
    at = given.reference
    inputs = [(c.name, c.channel) for c in described.controls]
    inputs += [(s.name, s.channel) for s in described.known_signals]
    reference = {name: float(getattr(at, channel)) for name, channel in inputs}
    reference |= {described.flow: given.reference_flow_rad, QBAR: at.qbar_pa}
    flow_rate = np.linalg.lstsq(
        np.column_stack([linear.reshape(-1, count), np.ones(linear.shape[0] * POINTS)]),
        motion.signal(described.flow_rate).ravel(),
        rcond=None,
    )[0][:count]
    length = next(s.length for s in described.signals if s.length is not None)
    half_s = 0.5 * float(getattr(record.plant.aircraft.constants, f"{length}_m")) / at.airspeed_m_s
    parts = []
    for block in _blocks(tried, len(base.r)):
        slopes = [_slopes(shape, described, reference, half_s, flow_rate) for shape in block]
        e = _changes(block, motion) @ base.white.T
        parts.append(e + np.tensordot(np.concatenate(slopes).reshape(-1, rows * count), by_gain, axes=1))
    t = np.concatenate(parts) if parts else np.zeros((0, *base.r.shape))
    return inserted(base, point.layout.sizes.stop, t, np.zeros((len(t), *base.white.shape)))


def _size(shape: Shape) -> int:
    """Number of coefficients; one of a linear increment."""
    return max(len(shape.coefficients), 1)


def _blocks(tried: Sequence[Shape], samples: int) -> Iterator[list[Shape]]:
    """Shapes of which no more than `_BLOCK` coefficients times samples are in memory at once."""
    block: list[Shape] = []
    held = 0
    for shape in tried:
        held += _size(shape)
        if block and held * samples > _BLOCK:
            yield block
            block, held = [], _size(shape)
        block.append(shape)
    if block:
        yield block


def _changes(tried: Sequence[Shape], motion: FlownMotion) -> Array:
    """(coefficients, samples, outputs) changes of the innovations by a unit of each coefficient, at the gain of the filter."""
    tangent, stops = motion.tangent, np.cumsum([_size(shape) for shape in tried])
    described = motion.motion
    force = np.zeros((len(tangent.matrices.phi), POINTS, len(described.coefficients), stops[-1]))
    reading = np.zeros((len(tangent.path.scale), len(described.outputs), stops[-1]))
    for shape, stop in zip(tried, stops.tolist(), strict=True):
        span, values = slice(stop - _size(shape), stop), _along(shape, motion)
        if shape.of_reading:
            output, sensors = described.output_channels.index(shape.acts_on), tangent.sensors
            values = _late(values, sensors.lag_s[output], sensors.delay_s[output], tangent.h_s)
            ends = values[tangent.steps - 1 :: tangent.steps, -1]
            reading[:, output, span] = np.concatenate([values[:1, 0], ends])
        else:
            force[:, :, _row(shape, described), span] = values
    return propagated(tangent, force, reading)


__all__ = ["FlownMotion", "sensitivities_to"]
