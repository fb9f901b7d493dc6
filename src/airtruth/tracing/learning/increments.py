"""Which increments the residual asks for: shapes over the flown ranges, and their evidence at a null without a refit.

With the bends' normal prior of standard deviation s, the evidence of a shape against the null is, to second order,

    log B = g' (H + 1/s^2)^-1 g / 2 - log det(1 + s^2 H) / 2,

g the gradient and H the information of its bends, both with the nuisance parameters eliminated.

Source: D. J. C. MacKay, Neural Computation 4 (1992) 415-447, section 3 (evidence of a linear model).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from airtruth.effects.increment import STEPS, Increment, Memory, Shape, increment
from airtruth.physics.motion import Motion
from airtruth.physics.terms import QBAR, factors_of
from airtruth.tracing.anomalies.flown import flown, known
from airtruth.tracing.inference.direction import projected
from airtruth.tracing.inference.posterior import PosteriorFit, TraceProblem
from airtruth.tracing.inference.whitening import Whitener
from airtruth.tracing.learning.increment_inputs import sensitivities_to
from airtruth.tracing.model.records import TraceRecord

Array = NDArray[np.float64]

CELLS: Final = 8
"""Number of cells of a function [-] (judgement: a six-record flight test resolves no finer function)."""
_QUANTILES: Final = (0.005, 0.995)
"""Quantiles of a signal between which an increment is learned [-] (judgement: a bend outside has no samples)."""
_LAGS_S: Final = (0.03, 0.08, 0.2, 0.5, 1.2)
"""Time constants of lags that are tried [s] (judgement: a refit moves them by up to a factor of three)."""
_LEAST_PRESSURE: Final = 0.04
"""Least range of the dynamic pressure over its mean in which an increment over it is tried [-] (judgement: an airspeed that
changes by 2 %)."""
_SENSOR_LAGS_S: Final = (0.03, 0.1, 0.3)
"""Time constants about which a lag of the vane that changes with the dynamic pressure is tried [s] (judgement)."""
_SLOW_S: Final = (0.08, 0.2, 0.5)
"""Time constants behind which functions are tried [s] (judgement: separation and hysteresis)."""
_MODES_HZ: Final = (0.7, 1.4, 2.8, 5.6, 10.0)
"""Natural frequencies of modes that are tried [Hz] (judgement: as `_LAGS_S`; the sampling ends the range)."""
_MODE_DAMPING: Final = 0.1
"""Damping ratio of the modes that are tried [-] (judgement)."""
_NEARBY: Final = tuple(np.geomspace(1.0 / 1.25, 1.25, 7).tolist())
"""Frequencies tried about that of a leading mode, over it [-] (judgement: half a step of `_STRUCTURE_HZ` to either side)."""
_DAMPINGS: Final = (0.02, 0.06, 0.2)
"""Damping ratios tried about a leading mode [-] (judgement)."""
_FINER: Final = (12, 16, 24, 36)
"""Numbers of cells tried for a leading function [-] (judgement: a break between two knots leaves a quarter of its change of
slope over a cell, and a finer function has its knots elsewhere)."""
_STRUCTURE_HZ: Final = (2.8, 4.0, 5.6, 8.0, 11.0)
"""Natural frequencies of modes that are tried at a sensor [Hz] (judgement: closer than `_MODES_HZ`, because the refit has
to find a narrow peak)."""
_PLAYS: Final = (0.01, 0.03, 0.1, 0.25)
"""Half widths of plays of the flow angle that are tried, over its range [-] (judgement: a refit moves them by up to a factor
of three)."""
_RELAYS: Final = (0.03, 0.06, 0.09, 0.13, 0.2)
"""Half widths of plays behind which steps are tried, over the range [-] (judgement: closer than `_PLAYS`, because a refit does
not move them)."""
_FINER_STEPS: Final = (12, 16, 24)
"""Numbers of cells tried for a leading step [-] (judgement: as `_FINER`)."""
_SENSED: Final = ("gyro", "accelerometer")
"""Instruments at which a mode is tried: they feel the structure, a vane does not (judgement)."""
_NYQUIST_SHARE: Final = 0.5
"""Highest frequency of a mode over the Nyquist frequency [-] (judgement)."""
_SCALES: Final = tuple(np.geomspace(1e-3, 1.0, 7).tolist())
"""Standard deviations of the bends' prior over the largest plausible bend that are tried [-] (judgement)."""


@dataclass(frozen=True)
class Screened:
    """A shape with its evidence at a null.

    Attributes
    ----------
    effect : the increment, with the prior of largest evidence.
    log_evidence : log of the Bayes factor against the null, averaged over the priors tried [-].
    start : (bends,) where a refit begins.
    """

    effect: Increment
    log_evidence: float
    start: Array


@dataclass(frozen=True)
class _Flown:
    """Ranges that the records of a problem cover.

    Attributes
    ----------
    motion : of the records.
    ranges : signal -> lowest and highest value; trims : angle -> value at the trim [unit of the signal].
    pressure : range of the dynamic pressure [Pa].
    """

    motion: Motion
    ranges: Mapping[str, tuple[float, float]]
    trims: Mapping[str, float]
    pressure: tuple[float, float]

    @classmethod
    def of(cls, problem: TraceProblem) -> _Flown:
        """Ranges of a problem."""
        records, motion = problem.records, problem.layout.motion
        names = (*factors_of(motion), motion.flow_rate, *(s.name for s in motion.known_signals))
        origins = np.array([r.plant.trim_signals for r in records]).T
        trims = {
            s.name: float(np.mean(at))
            for s, at in zip(motion.signals, origins, strict=True)
            if s.length is None
        }
        trims |= {
            s.name: float(np.mean([known(r, s.name).mean() for r in records])) for s in motion.known_signals
        }
        ranges = {name: _range(records, name) for name in names}
        return cls(motion, ranges, trims, _range(records, QBAR))

    def trim(self, name: str) -> float:
        """The trim of a signal within its range."""
        low, high = self.ranges[name]
        return min(max(self.trims.get(name, 0.0), low), high)

    def excited(self, names: Sequence[str]) -> list[str]:
        """The signals that move."""
        return [name for name in names if self.ranges[name][1] > self.ranges[name][0]]

    @property
    def middle(self) -> float:
        """Middle of the range of the dynamic pressure [Pa]."""
        return 0.5 * (self.pressure[0] + self.pressure[1])

    @property
    def varies(self) -> bool:
        """Whether the dynamic pressure changes."""
        return self.pressure[1] - self.pressure[0] > _LEAST_PRESSURE * self.middle


def shapes(problem: TraceProblem) -> list[Shape]:
    """Every shape that the records can hold, over the range that they cover: of the coefficients, then of the readings."""
    covers = _Flown.of(problem)
    motion = covers.motion
    highest_hz = _NYQUIST_SHARE * 0.5 / max(r.signals.dt_s for r in problem.records)
    found: list[Shape] = []
    for coefficient in motion.coefficients:
        for name in covers.excited(list(covers.ranges)):
            low, high = covers.ranges[name]
            trim = covers.trim(name)

            def add(cells: int, memory: Memory | None = None) -> None:
                found.append(Shape(coefficient.name, name, low, high, cells, trim, memory))  # noqa: B023

            if name == motion.flow_rate:
                if (
                    coefficient.name != motion.implicit[0]
                ):  # over the rate that it drives is an implicit equation
                    add(CELLS)
                continue
            add(CELLS)
            if name in (s.name for s in motion.known_signals):
                continue
            for time_s in _LAGS_S:
                add(0, Memory("lag", time_s))
            for hz in _MODES_HZ:
                if hz < highest_hz:
                    add(0, _mode(hz))
            if name == motion.flow:
                for time_s in _SLOW_S:
                    add(CELLS, Memory("lag", time_s))
                for share in _PLAYS:
                    play = Memory("play", half_width=share * (high - low))
                    add(0, play)
                    add(CELLS, play)
                found += _relays(coefficient.name, name, low, high, trim)
    found += _over_pressure_and_pairs(covers)
    of_readings = [*_of_readings(covers, highest_hz), *_of_a_changing_lag(covers)]
    measured = dict(zip(motion.output_channels, problem.settings.measured, strict=True))
    return found + [shape for shape in of_readings if measured[shape.acts_on]]


def _relays(coefficient: str, flow: str, low: float, high: float, trim: float) -> Iterator[Shape]:
    """Steps behind a play of the flow angle: what switches on at one angle and off at a smaller one."""
    for share in _RELAYS:
        play = Memory("play", half_width=share * (high - low))
        for cell in range(STEPS):
            yield Shape(coefficient, flow, low, high, STEPS, trim, play, step_cell=cell)


def _finer_steps(shape: Shape) -> Iterator[Shape]:
    """A step about its location and about the half width of its play."""
    cell, memory = shape.step_cell, shape.memory
    if cell is None or memory is None:
        return
    for cells in _FINER_STEPS:
        width = (shape.high - shape.low) / cells
        first, last = (cell - 0.5) * shape.width, (cell + 1.5) * shape.width
        near = [k for k in range(cells) if first <= (k + 0.5) * width <= last]
        for k, ratio in itertools.product(near, _NEARBY):
            play = replace(memory, half_width=ratio * memory.half_width)
            yield replace(shape, cells=cells, step_cell=k, memory=play)


def _over_pressure_and_pairs(covers: _Flown) -> Iterator[Shape]:
    """Coefficients over the dynamic pressure, and derivatives over an angle and the dynamic pressure.

    The angle is the flow angle, or a known one. The derivative in the flow angle over itself is the coefficient over it, which
    is tried without a factor.
    """
    motion = covers.motion
    over = covers.excited([s.name for s in motion.known_signals] or [motion.flow])
    for coefficient in (c.name for c in motion.coefficients):
        if covers.varies:
            yield Shape(coefficient, QBAR, *covers.pressure, CELLS, covers.middle)
        for name in covers.excited(factors_of(motion)):
            by = (name, covers.trims.get(name, 0.0))
            for angle in over:
                if name != angle:
                    yield Shape(
                        coefficient, angle, *covers.ranges[angle], CELLS, covers.trim(angle), None, *by
                    )
            if covers.varies:
                yield Shape(coefficient, QBAR, *covers.pressure, CELLS, covers.middle, None, *by)


def _of_readings(covers: _Flown, highest_hz: float) -> Iterator[Shape]:
    """A curve and a friction of the vane, gyros that feel the load, and modes of the structure at gyros and accelerometer.

    The load factor follows the flow angle, so that the increment of a gyro is a function of it.
    """
    outputs = covers.motion.outputs
    vane = next(y.channel for y in outputs if y.instrument == "vane")
    for name in covers.excited(factors_of(covers.motion)):
        low, high = covers.ranges[name]
        trim = covers.trim(name)
        if name == covers.motion.flow:
            for channel in (vane, *(y.channel for y in outputs if y.instrument == "gyro")):
                yield Shape(channel, name, low, high, CELLS, trim)
            for share in _PLAYS:
                yield Shape(vane, name, low, high, 0, trim, Memory("play", half_width=share * (high - low)))
        for channel in (y.channel for y in outputs if y.instrument in _SENSED):
            for hz in _STRUCTURE_HZ:
                if hz < highest_hz:
                    yield Shape(channel, name, low, high, 0, trim, _mode(hz))


def _of_a_changing_lag(covers: _Flown) -> Iterator[Shape]:
    """A lag of the vane over the dynamic pressure: a vane turns into the wind the faster, the faster the wind is."""
    vane = next(y.channel for y in covers.motion.outputs if y.instrument == "vane")
    flow = covers.motion.flow
    if covers.varies:
        for time_s in _SENSOR_LAGS_S:
            memory = Memory("lag", time_s)
            yield Shape(vane, QBAR, *covers.pressure, CELLS, covers.middle, memory, flow, covers.trims[flow])


def _mode(hz: float) -> Memory:
    return Memory("mode", 1.0 / (2.0 * np.pi * hz), _MODE_DAMPING)


def _range(records: Sequence[TraceRecord], signal: str) -> tuple[float, float]:
    return covered(np.concatenate([flown(r, signal) for r in records]))


def screen(
    problem: TraceProblem, null: PosteriorFit, whitener: Whitener, tried: Sequence[Shape]
) -> list[Screened]:
    """Shapes by their evidence at a null, best first; those that the records do not excite are left out."""
    sensitivities = sensitivities_to(null, problem, tried)
    if sensitivities is None:
        return []
    effects = [increment(s) for s in tried]
    gradient, information = projected(null, problem, sensitivities, whitener)
    found, first = [], 0
    for e in effects:
        span = slice(first, first + e.bends)
        first = span.stop
        g, h = gradient[span], information[span, span]
        if not np.isfinite(h).all() or not np.trace(h) > 0.0:
            continue
        best, mean = best_prior(e, g, h)
        found.append(Screened(e.with_prior(best), mean, posterior_bends(g, h, best)[0]))
    return sorted(found, key=lambda s: -s.log_evidence)


def sharpened(
    problem: TraceProblem, null: PosteriorFit, whitener: Whitener, leading: Sequence[Screened]
) -> list[Screened]:
    """The shapes with the detail of largest evidence, best first: cells of a function, frequency and damping of a mode,
    location and half width of a step.

    A lightly damped mode is narrower than the steps of the grid, and a refit that begins beside its peak ends there.
    """
    functions = [s.effect.shape for s in leading if s.effect.shape.cells and s.effect.shape.step_cell is None]
    near = [replace(shape, cells=n) for shape in functions for n in _FINER]
    near += [shape for s in leading for shape in _finer_steps(s.effect.shape)]
    near += [
        replace(shape, memory=replace(shape.memory, time_s=shape.memory.time_s / ratio, damping=damping))
        for shape in (s.effect.shape for s in leading)
        if shape.memory is not None and shape.memory.kind == "mode"
        for ratio in _NEARBY
        for damping in _DAMPINGS
    ]
    best: dict[str, Screened] = {}
    for s in sorted((*leading, *screen(problem, null, whitener, near)), key=lambda s: -s.log_evidence):
        best.setdefault(s.effect.variant, s)
    return list(best.values())


def best_prior(effect: Increment, gradient: Array, information: Array) -> tuple[float, float]:
    """Standard deviation of the bends' prior with the largest evidence, and the log Bayes factor averaged over those tried [-].

    Parameters
    ----------
    gradient, information : as of `log_evidences`.
    """
    stds = np.array(_SCALES) * effect.parameters[0].high
    evidence = log_evidences(gradient, information, stds)
    mean = float(logsumexp(evidence) - np.log(len(stds)))
    return float(stds[int(np.argmax(evidence))]), mean


def covered(x: Array) -> tuple[float, float]:
    """Range of a flown signal in which an increment is learned [unit of the signal]."""
    low, high = np.quantile(x, _QUANTILES)
    return float(low), float(high)


def log_evidences(gradient: Array, information: Array, stds: Array) -> Array:
    """Log Bayes factor of bends against none, for each standard deviation of their prior; see the module's formula.

    Parameters
    ----------
    gradient, information : (bends,) and (bends, bends), nuisance parameters eliminated.
    stds : (priors,) standard deviations.

    Returns
    -------
    (priors,) [-].
    """
    values, vectors = _directions(information)
    g = vectors.T @ gradient
    spread = 1.0 + np.outer(stds**2, values)
    gain = (g**2 * stds[:, None] ** 2 / spread).sum(axis=1)
    return np.asarray(0.5 * gain - 0.5 * np.log(spread).sum(axis=1))


def posterior_bends(gradient: Array, information: Array, std: float) -> tuple[Array, Array]:
    """The most probable bends (bends,), -(H + 1/s^2)^-1 g, and their covariance (bends, bends), (H + 1/s^2)^-1.

    Parameters
    ----------
    gradient, information : as of `log_evidences`; std : standard deviation of the bends' prior, s.
    """
    values, vectors = _directions(information)
    covariance = np.asarray((vectors / (values + 1.0 / std**2)) @ vectors.T)
    return -covariance @ gradient, covariance


def _directions(information: Array) -> tuple[Array, Array]:
    """Information of independent directions and these as columns; what rounding made negative is none."""
    values, vectors = np.linalg.eigh(0.5 * (information + information.T))
    return np.maximum(values, 0.0), vectors


__all__ = [
    "CELLS",
    "Screened",
    "best_prior",
    "covered",
    "log_evidences",
    "posterior_bends",
    "screen",
    "shapes",
    "sharpened",
]
