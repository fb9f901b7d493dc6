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
from scipy.signal import lfilter

from airtruth.effects.increment import Memory, Shape
from airtruth.physics.terms import READINGS
from airtruth.tracing.inference.posterior import PosteriorFit, Sensitivities, TraceProblem
from airtruth.tracing.model.linearise import ANGLE_RAD, RATE_RAD_S
from airtruth.tracing.model.parameters import OUTPUTS
from airtruth.tracing.model.response import filter_inputs
from airtruth.tracing.model.tangent import FLOWN, POINTS, Tangent, propagated, tangent_of
from airtruth.tracing.selection.direction import inserted

Array = NDArray[np.float64]

_COEFFICIENTS: Final = ("CL", "Cm")
"""Coefficients that the filter has."""
_FACTORS: Final = ("alpha", "qhat", "elevator")
"""Signals of the derivatives, in the order of `airtruth.physics.short_period.PARAMETERS`."""
_BLOCK: Final = 200_000
"""Coefficients times samples that pass through the tangent linear model at once [-] (judgement: 30 MB)."""


@dataclass
class Motion:
    """The flown motion of one record; memories are kept, because many shapes share them."""

    tangent: Tangent
    kept: dict[tuple[Memory, str], Array] = field(default_factory=dict)

    def signal(self, name: str) -> Array:
        """(steps, points) of a signal."""
        return self.tangent.matrices.flown[:, :, FLOWN.index(name)]

    def state(self, memory: Memory, name: str) -> Array:
        """(steps, points) of a memory that a signal drives."""
        key = (memory, name)
        if key not in self.kept:
            self.kept[key] = self._driven(memory, name)
        return self.kept[key]

    def _driven(self, memory: Memory, name: str) -> Array:
        start = dict(zip(("alpha", "elevator"), self.tangent.start, strict=True)).get(name, 0.0)
        if memory.kind == "play":
            return _play(self.signal("body_qhat" if name == "qhat" else name)[:, -1], start, memory)
        return _linear(self.signal(name), start, memory, self.tangent.h_s)


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
    after, _ = lfilter([1.0], [1.0, -growth], driven.astype(complex), zi=np.array([growth * first]))
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


def _along(shape: Shape, motion: Motion) -> Array:
    """(steps, points, coefficients) of an increment by a unit of each of its coefficients."""
    of_reading, memory = shape.of_reading, shape.memory
    named = "body_qhat" if of_reading and shape.signal == "qhat" else shape.signal
    signal = motion.signal(named)
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


def _slopes(shape: Shape, reference: Mapping[str, float], half_s: float, alpha_dot: Array) -> Array:
    """(coefficients, 2, derivatives of a coefficient) with which an increment begins at the reference of a record.

    Parameters
    ----------
    reference : values of the signals there.
    half_s : chord over twice the airspeed [s].
    alpha_dot : slopes of alpha_dot_hat in the signals of the derivatives.
    """
    every = np.zeros((_size(shape), 2, len(_FACTORS)))
    if shape.of_reading or not shape.cells or shape.memory is not None:
        return every
    slopes = every[:, _COEFFICIENTS.index(shape.acts_on)]
    if shape.factor:
        slopes[:, _FACTORS.index(shape.factor)] = shape.basis(reference[shape.signal])
        return every
    middle = reference.get(shape.signal, 0.0)
    h = ANGLE_RAD if shape.signal in ("alpha", "elevator") else RATE_RAD_S * half_s
    rise = (shape.basis(middle + h) - shape.basis(middle - h)) / (2.0 * h)
    if shape.signal in _FACTORS:
        slopes[:, _FACTORS.index(shape.signal)] = rise
    elif shape.signal == "alpha_dot_hat":
        slopes[:] = np.outer(rise, alpha_dot)
    return every


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
    motion = Motion(tangent)
    trims = {
        "alpha": record.plant.trim_alpha_rad,
        "qhat": 0.0,
        "elevator": record.pitch_plant.trim_elevator_rad,
    }
    linear = np.stack([motion.signal(name) - trims[name] for name in _FACTORS], axis=-1)
    count, derivatives = len(_FACTORS), base.t[null.point.of.common.derivatives]
    force = np.zeros((*linear.shape[:2], 2, 2 * count))
    for k in range(2):
        force[:, :, k, k * count : (k + 1) * count] = linear
    nothing = np.zeros((len(tangent.path.scale), OUTPUTS, 2 * count))
    by_gain = derivatives - propagated(tangent, force, nothing) @ base.white.T
    by_gain[~derivatives.any(axis=(1, 2))] = 0.0
    at, chord = given.reference, record.plant.aircraft.constants.chord_m
    reference = {"alpha": given.reference_flow_rad, "elevator": at.elevator_rad, "qbar": at.qbar_pa}
    alpha_dot = np.linalg.lstsq(
        np.column_stack([linear.reshape(-1, count), np.ones(linear.shape[0] * POINTS)]),
        motion.signal("alpha_dot_hat").ravel(),
        rcond=None,
    )[0][:count]
    parts = []
    for block in _blocks(tried, len(base.r)):
        slopes = [_slopes(shape, reference, 0.5 * chord / at.airspeed_m_s, alpha_dot) for shape in block]
        e = _changes(block, motion) @ base.white.T
        parts.append(e + np.tensordot(np.concatenate(slopes).reshape(-1, 2 * count), by_gain, axes=1))
    t = np.concatenate(parts) if parts else np.zeros((0, *base.r.shape))
    return inserted(base, point.layout.sizes.stop, t, np.zeros((len(t), OUTPUTS, OUTPUTS)))


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


def _changes(tried: Sequence[Shape], motion: Motion) -> Array:
    """(coefficients, samples, outputs) changes of the innovations by a unit of each coefficient, at the gain of the filter."""
    tangent, stops = motion.tangent, np.cumsum([_size(shape) for shape in tried])
    force = np.zeros((len(tangent.matrices.phi), POINTS, 2, stops[-1]))
    reading = np.zeros((len(tangent.path.scale), OUTPUTS, stops[-1]))
    for shape, stop in zip(tried, stops.tolist(), strict=True):
        span, values = slice(stop - _size(shape), stop), _along(shape, motion)
        if shape.of_reading:
            output, sensors = READINGS.index(shape.acts_on), tangent.sensors
            values = _late(values, sensors.lag_s[output], sensors.delay_s[output], tangent.h_s)
            ends = values[tangent.steps - 1 :: tangent.steps, -1]
            reading[:, output, span] = np.concatenate([values[:1, 0], ends])
        else:
            force[:, :, _COEFFICIENTS.index(shape.acts_on), span] = values
    return propagated(tangent, force, reading)


__all__ = ["Motion", "sensitivities_to"]
