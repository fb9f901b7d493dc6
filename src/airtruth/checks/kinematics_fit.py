"""Sizes of instrument errors: the least energy of the control surfaces' motion in the whitened differences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.checks.kinematics_lines import Lines, Weight, lines_of, weigh, without
from airtruth.checks.kinematics_model import LONGITUDINAL
from airtruth.checks.kinematics_record import Kinematics, Samples, stacked
from airtruth.physics.sensor_errors import KINDS

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

STEPS: Final = 25
"""Largest number of Gauss-Newton steps of a fit [-]: judgement; a fit that needs more is reported as unconverged."""
CLOSE: Final = 0.02
"""Step below which a search ends, in standard errors [-]: judgement."""
SHORTENED: Final = 4
"""Largest number of times that a step is shortened to 30 % [-]: judgement; a hundredth of a step is left then."""
EDGE: Final = 1e-3
"""Share of the range within which an estimate counts as at its limit [-]: judgement."""
ALPHA_SLOPES: Final = (-2.0, 2.0)
"""Range of the slope of a position error [1/rad]: judgement; a static source far from a good position errs by 1 % of the airspeed
per degree."""
_KEPT: Final = 64
"""Number of differences that are kept [-] (judgement: those of a step of a fit in all equations and stacks)."""
SCALES: Final = (0.4, 2.5)
"""Range of a scale [-]: judgement; an error beyond is one of units, which the gate tests."""


@dataclass(frozen=True)
class Fit:
    """Errors that were fitted together.

    Attributes
    ----------
    names : errors that were free.
    value, covariance : (k,), (k, k).
    free : (k,) least value of the statistic to first order without the limits.
    statistic : energy of the elevator's motion that is left, chi-square where the errors explain all.
    converged : whether the search ended.
    at_limit : errors whose estimate is at an end of its range; a lag or a delay of zero is none, because none is shorter.
    """

    names: tuple[str, ...]
    value: Array
    free: Array
    covariance: Array
    statistic: float
    converged: bool
    at_limit: tuple[str, ...] = ()

    @property
    def std(self) -> Array:
        """(k,) standard errors."""
        return np.asarray(np.sqrt(np.maximum(np.diagonal(self.covariance), 0.0)))

    def of(self, name: str, otherwise: float) -> float:
        """Value of an error; another value where it was not free."""
        return float(self.value[self.names.index(name)]) if name in self.names else otherwise

    @property
    def sound(self) -> bool:
        """Whether the fit may be used: it converged inside its range."""
        return self.converged and not self.at_limit and bool(np.isfinite(self.covariance).all())


@dataclass(frozen=True)
class _Stack:
    """Records of one length, so that one evaluation serves all of them.

    Attributes
    ----------
    record, lines : the records as one, and the lines that they share.
    equations : of each record.
    std : (records, equations, lines) of `Weight`; trends : (records, equations, trends, lines).
    rows : (records, equations, lines) where each line is among all whitened ones.
    along : (equations, m, records x samples) components of differences along the pooled motions of the elevator.
    """

    record: Samples
    lines: Lines
    equations: tuple[str, ...]
    std: Array
    trends: Array
    rows: NDArray[np.int64]
    along: Array


def _stacks_of(records: Sequence[Samples], lines: Sequence[Lines], weight: Weight) -> list[_Stack]:
    sizes = [len(line.keep) * len(std) for line, std in zip(lines, weight.std, strict=True)]
    first = np.concatenate([[0], np.cumsum(sizes)])
    result = []
    for numbers, record in stacked(records):
        std = np.array([list(weight.std[i].values()) for i in numbers])
        own = np.arange(std[0].size).reshape(std.shape[1:])
        rows, trends = (
            np.array([first[i] + own for i in numbers]),
            np.array([weight.trends[i] for i in numbers]),
        )
        # the lines, whitening and the removal of trends are linear
        span = without(np.moveaxis(weight.span[rows], -1, 0), trends) / std
        along = np.moveaxis(lines[numbers[0]].samples_of(span, record.length), 2, 0)
        result.append(
            _Stack(
                record=record,
                lines=lines[numbers[0]],
                equations=tuple(weight.std[numbers[0]]),
                std=std,
                trends=trends,
                rows=rows,
                along=along.reshape(*along.shape[:2], -1),
            )
        )
    return result


@dataclass(frozen=True)
class KinematicProblem:
    """Records, their lines, the common weight, and the ranges of the errors.

    Attributes
    ----------
    records, lines : of each record.
    equations : equations that are used, of the kinematics.
    known : errors that are declared, name -> value.
    limits : name -> smallest and largest value.
    weight : common weight of all fits.
    kinematics : of the motion.
    enlarged : equation -> factor on its noise for motion that no error explains.
    """

    records: tuple[Samples, ...]
    lines: tuple[Lines, ...]
    equations: tuple[str, ...]
    known: Mapping[str, float]
    limits: Mapping[str, tuple[float, float]]
    weight: Weight
    kinematics: Kinematics = LONGITUDINAL
    enlarged: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def _stacks(self) -> list[_Stack]:
        return _stacks_of(self.records, self.lines, self.weight)

    @cached_property
    def _parts(self) -> dict[tuple[object, ...], Array]:
        """Moments of the last differences by stack, equation, and the errors that move it."""
        return {}

    def white(self, errors: Mapping[str, float]) -> Array:
        """(rows,) whitened lines at given errors, the others as declared; the trends of each difference are taken out."""
        white = np.empty(len(self.weight.span))
        for stack in self._stacks:
            every = self.kinematics.compare(stack.record, {**self.known, **errors}, self.equations)
            lines = (
                stack.lines.of(np.stack([every[equation] for equation in stack.equations], axis=1))
                / stack.std
            )
            white[stack.rows] = without(lines, stack.trends)
        return white

    def start(self, name: str) -> float:
        """Value without a further error: the declared one, or none."""
        return self.known.get(name, self.kinematics.errors[name].neutral)

    def moments(self, errors: Mapping[str, float]) -> Array:
        """(m,) components of the whitened lines along the pooled motions of the elevator."""
        every, parts, total = {**self.known, **errors}, self._parts, np.zeros(self.weight.span.shape[1])
        for number, stack in enumerate(self._stacks):
            at = {e: (number, e, *self._moving(e, every)) for e in stack.equations}
            new = [e for e, key in at.items() if key not in parts]
            found = self.kinematics.compare(stack.record, every, new) if new else {}
            for place, (equation, key) in enumerate(at.items()):
                if equation in new:
                    parts[key] = stack.along[place] @ found[equation].reshape(-1)
                total += parts[key]
        while len(parts) > _KEPT:
            del parts[next(iter(parts))]
        return total

    def _moving(self, equation: str, errors: Mapping[str, float]) -> tuple[object, ...]:
        """The errors that move the difference of an equation, in their order."""
        movers = self.kinematics.moved_by.get(equation)
        return tuple(pair for pair in sorted(errors.items()) if movers is None or pair[0] in movers)

    def slope(self, name: str, errors: Mapping[str, float], there: Array) -> Array:
        """(m,) derivative of the moments by one error; ``there`` are those at the errors."""
        value = errors.get(name, self.start(name))
        step = self.kinematics.errors[name].step
        step = step if value < self.limits[name][1] - step else -step
        return (self.moments({**errors, name: value + step}) - there) / step

    def linearised(self, names: Sequence[str], errors: Mapping[str, float]) -> tuple[Array, Array]:
        """(m,) moments at given errors, and (names, m) their derivatives in some of them."""
        there = self.moments(errors)
        return there, np.array([self.slope(name, errors, there) for name in names])


def problem_of(
    records: Sequence[Samples],
    equations: Sequence[str],
    known: Mapping[str, float],
    limits: Mapping[str, tuple[float, float]],
    errors: Mapping[str, float] | None = None,
    lines: Sequence[Lines] | None = None,
    kinematics: Kinematics = LONGITUDINAL,
    enlarged: Mapping[str, float] | None = None,
) -> KinematicProblem:
    """Weigh records at given errors.

    Parameters
    ----------
    records, equations, known, limits : see `KinematicProblem`.
    errors : errors at which the noise is assessed; None for those declared.
    lines : lines of the records; None makes them.
    kinematics : of the motion.
    enlarged : see `KinematicProblem`; None for no factor.
    """
    enlarged = dict(enlarged or {})
    lines = tuple(lines or (lines_of(r, kinematics) for r in records))
    at = {**known, **(errors or {})}
    differences = [kinematics.compare(r, at, equations) for r in records]
    slopes = [_offset_slopes(r, d, at, kinematics) for r, d in zip(records, differences, strict=True)]
    weight = weigh(records, lines, differences, slopes, equations, kinematics, enlarged)
    return KinematicProblem(
        tuple(records), lines, tuple(equations), known, limits, weight, kinematics, enlarged
    )


def _offset_slopes(
    record: Samples, difference: Mapping[str, Array], at: Mapping[str, float], kinematics: Kinematics
) -> dict[str, Array]:
    """Equation -> (offsets, samples) derivatives of its difference by the offsets of the kinematics."""
    moved = [
        kinematics.compare(record, {**at, name: at.get(name, 0.0) + step}, tuple(difference))
        for name, step in kinematics.offsets.items()
    ]
    steps = kinematics.offsets.values()
    return {
        equation: np.array([(m[equation] - d) / step for m, step in zip(moved, steps, strict=True)]).reshape(
            -1, record.length
        )
        for equation, d in difference.items()
    }


def fit(
    problem: KinematicProblem,
    names: Sequence[str],
    start: Mapping[str, float] | None = None,
    near: Sequence[Array] | None = None,
) -> Fit:
    """Fit errors by Gauss-Newton steps, shortened where the statistic would grow.

    The derivatives are updated between steps (C. G. Broyden, *Mathematics of Computation* 19, 1965) and renewed where
    a step fails and before the last step.

    Parameters
    ----------
    problem : records and weight.
    names : free errors; none gives the statistic as it is.
    start : values at which the search starts; an error without an entry starts at its declared value.
    near : (m,) derivative of the moments by each error near the start; None makes those at the start.
    """
    names = tuple(names)
    low, high = (np.array([problem.limits[n][i] for n in names]) for i in (0, 1))
    first = [(start or {}).get(n, problem.start(n)) for n in names]
    value = np.clip(np.array(first, dtype=np.float64), low, high)
    moments = problem.moments(dict(zip(names, value, strict=True)))
    if not names:
        return Fit((), value, value, np.zeros((0, 0)), float(moments @ moments), True)
    slopes = _slopes(problem, names, value, moments) if near is None else np.array(near)
    fresh, converged = near is None, False
    for _ in range(STEPS):
        normal = slopes @ slopes.T
        covariance = _inverse(normal)
        step = _step(normal, covariance, slopes @ moments, value <= low, value >= high)
        trial = np.clip(value + step, low, high)
        after = problem.moments(dict(zip(names, trial, strict=True)))
        for _ in range(SHORTENED):
            if after @ after <= moments @ moments + 1e-9:
                break
            trial = value + 0.3 * (trial - value)
            after = problem.moments(dict(zip(names, trial, strict=True)))
        moved, rise = trial - value, after - moments
        close = bool((np.abs(moved) <= CLOSE * np.sqrt(np.diagonal(covariance))).all())
        better = after @ after <= moments @ moments + 1e-9
        if better:
            value, moments = trial, after
        if (close or not better) and fresh:
            converged = close
            break
        fresh = close or not better
        if fresh:
            slopes = _slopes(problem, names, value, moments)
        else:
            slopes = slopes + np.outer(moved, rise - moved @ slopes) / max(float(moved @ moved), 1e-300)
    if not fresh:
        slopes = _slopes(problem, names, value, moments)
    edge = EDGE * (high - low)
    least = np.array([problem.kinematics.errors[n].kind in ("lag", "delay") for n in names])
    at = ((value <= low + edge) & ~least | (value >= high - edge)) & (
        np.abs(value - np.array([problem.start(n) for n in names])) > edge
    )
    covariance = _inverse(slopes @ slopes.T)
    return Fit(
        names,
        value,
        value - covariance @ (slopes @ moments),
        covariance,
        float(moments @ moments),
        converged,
        tuple(n for n, end in zip(names, at, strict=True) if end),
    )


def _slopes(problem: KinematicProblem, names: Sequence[str], value: Array, moments: Array) -> Array:
    errors = dict(zip(names, value, strict=True))
    return np.array([problem.slope(n, errors, moments) for n in names])


def _step(normal: Array, covariance: Array, gradient: Array, lowest: Bools, highest: Bools) -> Array:
    """Gauss-Newton step; an error at an end of its range that the step would move beyond it stays, and the others follow."""
    step, free = -covariance @ gradient, np.ones(len(gradient), dtype=bool)
    while (beyond := lowest & (step < 0.0) | highest & (step > 0.0)).any():
        free &= ~beyond
        step = np.zeros(len(gradient))
        step[free] = -_inverse(normal[np.ix_(free, free)]) @ gradient[free]
    return step


def _inverse(normal: Array) -> Array:
    size = np.sqrt(np.maximum(np.diagonal(normal), 1e-300))
    unit = normal / np.outer(size, size)
    return np.asarray(np.linalg.pinv(unit, rcond=1e-10, hermitian=True) / np.outer(size, size))


def limits_of(
    records: Sequence[Samples], longest_arm_m: float, kinematics: Kinematics = LONGITUDINAL
) -> dict[str, tuple[float, float]]:
    """Smallest and largest value of each error.

    A lag or a delay may last an eighth of the shortest record. An arm may be as long as ``longest_arm_m``.
    """
    longest = min(r.duration_s for r in records) / 8.0
    ranges = {
        "ratio": SCALES,
        "time": (0.0, longest),
        "length": (-longest_arm_m, longest_arm_m),
        "per_angle": ALPHA_SLOPES,
    }
    return {name: ranges[KINDS[error.kind].dimension] for name, error in kinematics.errors.items()}


__all__ = ["Fit", "KinematicProblem", "fit", "limits_of", "problem_of"]
