"""Sentences about estimates that a reader should not trust: undetermined parameters, missing numbers, wrong signs, coarse
differences.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.identification.estimates import (
    SENTENCES,
    Estimates,
    Parts,
    Status,
    deviations,
    half_width,
    point_values,
)
from airtruth.numerics.order_statistics import Blocks, medians
from airtruth.physics.expected import EXPECTED
from airtruth.physics.motion import LONGITUDINAL, Motion

Array = NDArray[np.float64]

SHARE: Final = 0.3
"""Least part of a direction that its sentence names [-]: judgement."""
APART: Final = 3.0
"""Standard deviations between methods above which they contradict each other [-]: judgement."""
DIFFERENCING: Final = (
    "ls",
    "iv-lowpass",
    "iv-reference",
    "iv-reference-regressor",
    "iv-actuator",
    "iv-actuator-regressor",
    "iv-kalman",
)
"""Methods whose derivatives of alpha and q are central differences."""
CONSISTENT: Final = "iv-f1 or output-error"
"""Methods for the same records that take no differences."""
DULLED: Final = 0.01
"""Share of the motion at the natural frequency that central differences may lose [-] (judgement: steps move an aircraft above
that frequency, and in a doublet of the GTM at 20 or 25 Hz Cmq, Cmde and Cmalpha err by 5, 4 and 1.5 times the share)."""
CHANGES: Final = 0.2
"""Range of the dynamic pressure in a record over its mean from which a method that takes it for constant is in doubt [-]. In 180
records of a small aircraft, the 95 % intervals of Cmalpha by iv-f1 contain the truth in 0.90 of those with a smaller range and in
0.27 of the others (`python -m studies.small_aircraft_intervals --flights 30 --method iv-f1`)."""
COLOURED: Final = 0.2
"""Correlation of neighbouring innovations from which they count as coloured [-] (judgement: intervals of a white noise are then
too narrow by a factor of sqrt(1.2/0.8), 1.2)."""
SOME: Final = 0.1
"""Least share of the records that the sentence about it needs [-] (judgement)."""
LIKELY: Final = (
    "likely causes: a sensor that lags (`airtruth check` shows it), feedback from the motion to the elevator, a record "
    "too short for the motion, or an aircraft that is unstable by design"
)
"""Causes of a damping or stiffness of the wrong sign."""


def doubts(parts: Parts, dt_s: float = 0.0) -> list[str]:
    """Sentences about the estimates of one or more methods, none where nothing is in doubt.

    Parameters
    ----------
    parts : estimates of the runs, each run in one part; a part has one entry for each method.
    dt_s : longest sample period of the records [s]; with 0 no differences are in doubt.
    """
    own: list[_Method] = []
    contradictions: list[_Contradiction] = []
    for part in parts():
        contradictions = contradictions or [
            _Contradiction(part[0].motion, name) for name in part[0].motion.parameters
        ]
        own = own or [_Method(estimates) for estimates in part]
        for method, estimates in zip(own, part, strict=True):
            method.add(estimates)
        for contradiction in contradictions:
            contradiction.add(part)
    result: list[str] = []
    for i, method in enumerate(own):
        result += method.missing()
        result += method.not_white()
        result += method.undetermined(_variances(parts, i))
        result += method.dulled(dt_s)
    result = [sentence for method in own for sentence in method.wrong_signs()] + result
    return result + [sentence for one in contradictions for sentence in one.sentences()]


def smoothed_airspeed(noisy: Sequence[str], runs: int) -> Iterator[str]:
    """A sentence about runs whose airspeed is smoothed.

    Parameters
    ----------
    noisy : their names; runs : number of all runs.
    """
    if noisy:
        which = f"run {noisy[0]!r}" if len(noisy) == 1 else f"{len(noisy)} of {runs} runs"
        yield (
            f"the noise of the airspeed is taken out of {which}: the airspeed is the speed over ground by the accelerometers and "
            "the most probable random walk of the rest"
        )


def changing_pressure(
    methods: Sequence[str], changes: Sequence[tuple[str, float]], runs: int
) -> Iterator[str]:
    """A sentence about methods that take a dynamic pressure for constant which is not.

    Parameters
    ----------
    methods : their names.
    changes : name and range over the mean of each run whose range exceeds `CHANGES`.
    runs : number of all runs.
    """
    if not methods or len(changes) < max(SOME * runs, 1):
        return
    run_id, largest = max(changes, key=lambda one: one[1])
    often = (
        "" if runs == 1 else f", and by more than {100.0 * CHANGES:.0f} % in {len(changes)} of {runs} runs"
    )
    yield (
        f"{', '.join(methods)}: the dynamic pressure changes by {100.0 * largest:.0f} % of its mean in run {run_id!r}{often}. "
        "These estimates take it for constant, and their intervals do not allow for it; use --pressure measured."
    )


def curvature(methods: Sequence[str], curved: Mapping[tuple[str, str], int], runs: int) -> Iterator[str]:
    """Sentences about coefficients that are not linear in at least a share `SOME` of the records.

    Parameters
    ----------
    methods : names of those whose intervals do not allow for it.
    curved : number of runs that show a term of a coefficient: (term, coefficient) -> runs.
    runs : number of all runs.
    """
    words = {"alpha": "with the angle of attack", "beta": "with sideslip"}
    for term, change in words.items():
        names = [
            name for (own, name), count in curved.items() if own == term and count >= max(SOME * runs, 1)
        ]
        if names and methods:
            most = max(curved[term, name] for name in names)
            yield (
                f"{', '.join(methods)}: the derivatives of {' and '.join(names)} change {change}{_some(most, runs)}. "
                "The intervals of these estimates do not allow for it; use filter-error, or "
                f"--term {term}, which frees the change."
            )


def _variances(parts: Parts, method: int) -> Blocks:
    """Blocks of the variances of a method, of the runs that have a covariance."""
    return lambda: (_variance(part[method])[_known(part[method])] for part in parts())


def _variance(one: Estimates) -> Array:
    return np.diagonal(one.covariance, axis1=1, axis2=2)


def _known(one: Estimates) -> NDArray[np.bool_]:
    """(runs,) whether a run has an estimate and a covariance."""
    return np.asarray(np.isfinite(one.covariance).all(axis=(1, 2)) & np.isfinite(one.theta).all(axis=1))


def _some(count: int, runs: int) -> str:
    return "" if runs == 1 else f" in {count} of {runs} runs"


class _Method:
    """Common part of the runs of one method: counts, sums, and the first run of each kind."""

    def __init__(self, first: Estimates) -> None:
        self.name, self.covariance_name = first.method, first.covariance_name
        self.names, self.expected = first.motion.parameters, EXPECTED[first.motion.name]
        self.size = np.array([self.expected.sizes[name] for name in self.names])
        self.coloured, self.memory = 0, 0.0
        self.runs = self.bare = self.aperiodic = self.known = self.open = 0
        self.absent: Counter[int] = Counter()
        self.periodic, self.summed_rad_s = 0, 0.0
        self.open_ones = np.zeros(len(self.names))
        self.relative = np.zeros((len(self.names),) * 2)
        self.wrong = dict.fromkeys(self.expected.signs, 0)
        self.example: dict[str, tuple[float, float, float]] = {}

    def add(self, one: Estimates) -> None:
        """Add a part."""
        self.runs += len(one.run_ids)
        absent = ~np.isfinite(one.theta).all(axis=1)
        self.absent.update(int(s) for s in one.status[absent])
        frequency = point_values(one)[:, len(self.names)]
        periodic = np.isfinite(frequency)
        self.aperiodic += int((~absent & ~periodic).sum())
        sound = periodic & one.converged
        self.periodic += int(sound.sum())
        self.summed_rad_s += float(frequency[sound].sum())
        self.bare += int((~absent & ~np.isfinite(deviations(one)).all(axis=1)).sum())
        known = _known(one)
        self.known += int(known.sum())
        limit = np.broadcast_to(self.size, one.theta.shape)
        if self.expected.by_interval:
            limit = np.abs(one.theta) / half_width(one.confidence)
        open_ones = _variance(one)[known] > limit[known] ** 2
        self.open_ones += open_ones.sum(axis=0)
        self.open += int(open_ones.any(axis=1).sum())
        chosen = np.flatnonzero(known)[open_ones.any(axis=1)]
        self.relative += (one.covariance[chosen] / np.outer(self.size, self.size)).sum(axis=0)
        if one.memory is not None:
            with np.errstate(invalid="ignore"):
                coloured = one.memory > COLOURED
            self.coloured += int(coloured.sum())
            self.memory += float(one.memory[coloured].sum())
        half = half_width(one.confidence) * deviations(one)
        for name, (sign, _) in self.expected.signs.items():
            i = self.names.index(name)
            value, width = one.theta[:, i], half[:, i]
            with np.errstate(invalid="ignore"):
                wrong = sign * value + width < 0.0
            self.wrong[name] += int(wrong.sum())
            if wrong.any():
                k = int(np.argmax(wrong))
                self.example.setdefault(
                    name, (float(value[k]), float(value[k] - width[k]), float(value[k] + width[k]))
                )

    def missing(self) -> Iterator[str]:
        """Reasons of numbers that are absent."""
        for status, count in sorted(self.absent.items()):
            why = SENTENCES[Status(status)] if status != Status.CONVERGED else "no estimate was computed"
            yield f"{self.name}: no estimate{_some(count, self.runs)}: {why}."
        if self.aperiodic:
            yield (
                f"{self.name}: no frequency and damping ratio{_some(self.aperiodic, self.runs)}: with these derivatives "
                f"{self.expected.modal}."
            )
        if self.bare:
            why = (
                "covariance = none was asked for"
                if self.covariance_name == "none"
                else "the information of the record is singular, or the method did not converge"
            )
            yield f"{self.name}: no intervals{_some(self.bare, self.runs)}: {why}."

    def not_white(self) -> Iterator[str]:
        """Innovations with a memory in at least half of the runs: the model lacks what they hold."""
        if self.coloured and 2 * self.coloured >= self.runs:
            still = self.name == "output-error"
            cause = "turbulence, which this method lacks, or " if still else ""
            cure = "Use filter-error, or look" if still else "Look"
            yield (
                f"Warning: {self.name}: the residuals are not white{_some(self.coloured, self.runs)}: neighbouring ones have a "
                f"correlation of {self.memory / self.coloured:.2g} on average. The cause is {cause}aerodynamics that the linear "
                f"model lacks; the intervals are too narrow, and the estimates can be wrong. {cure} for the cause "
                "(`airtruth trace`)."
            )

    def undetermined(self, variances: Blocks) -> Iterator[str]:
        """Parameters that most of the runs leave open, and the direction in which they may change together."""
        named = np.flatnonzero(2.0 * self.open_ones >= max(self.known, 1))
        if not named.size:
            return
        std = np.sqrt(medians(variances))
        which = ", ".join(f"{self.names[i]} (standard deviation {std[i]:.2g})" for i in named)
        if self.expected.by_interval:
            yield (
                f"{self.name}: the records do not determine {which}{_some(self.open, self.known)}: the interval contains zero. "
                "Do not use these values; more or longer records with --joint determine them better."
            )
            return
        values, vectors = np.linalg.eigh(self.relative / self.open)
        direction = vectors[:, -1] / np.abs(vectors[:, -1]).max()
        parts = [i for i in np.argsort(-np.abs(direction)) if abs(direction[i]) >= SHARE]
        together = " with ".join(
            f"{self.expected.terms[self.names[i]]} "
            f"({direction[i] * np.sqrt(values[-1]) * self.size[i]:+.2g} in {self.names[i]})"
            for i in parts
        )
        yield (
            f"{self.name}: the records do not determine {which}{_some(self.open, self.known)}. Within one standard deviation "
            f"these change without a visible effect: {together}. Fly inputs of higher frequency and several "
            "amplitudes, or more records with --joint."
        )

    def wrong_signs(self) -> Iterator[str]:
        """Derivatives whose interval excludes the sign that physics requires: the reason first, then the number."""
        for name, (_, words) in self.expected.signs.items():
            if name in self.example:
                value, lower, upper = self.example[name]
                yield (
                    f"Warning: {self.name}: not credible{_some(self.wrong[name], self.runs)}: a {words}: "
                    f"{name} = {value:.3g} ({lower:.3g} to {upper:.3g}); {LIKELY}."
                )

    def dulled(self, dt_s: float) -> Iterator[str]:
        """Share of the motion that central differences lose, where it is more than `DULLED`."""
        if self.name not in DIFFERENCING or not self.periodic or self.names != LONGITUDINAL.parameters:
            return
        wn_rad_s = self.summed_rad_s / self.periodic
        share = 1.0 - float(np.sinc(wn_rad_s * dt_s / np.pi))
        if share > DULLED:
            yield (
                f"{self.name}: central differences at {1.0 / dt_s:.3g} Hz lose {100.0 * share:.2g} % of the motion at the "
                f"natural frequency of {wn_rad_s:.3g} rad/s and more above it. Cmalpha, Cmq and Cmde are too small, by up to "
                f"several times that, and their intervals do not allow for it; use {CONSISTENT}, or records of a higher rate."
            )


class _Contradiction:
    """Runs whose methods contradict each other on a derivative by more than the magnitude of the derivative."""

    def __init__(self, motion: Motion, name: str) -> None:
        self.name, self.index, self.runs, self.count = name, motion.index(name), 0, 0
        self.size = EXPECTED[motion.name].sizes[name]
        self.example = ""

    def add(self, estimates: Sequence[Estimates]) -> None:
        """Add a part."""
        if len(estimates) < 2 or any(e.run_ids != estimates[0].run_ids for e in estimates):
            return
        i = self.index
        runs = np.arange(len(estimates[0].run_ids))
        value = np.array([e.theta[:, i] for e in estimates])
        std = np.array([deviations(e)[:, i] for e in estimates])
        known = np.isfinite(value) & np.isfinite(std)
        lowest = np.argmin(np.where(known, value, np.inf), axis=0)
        highest = np.argmax(np.where(known, value, -np.inf), axis=0)
        with np.errstate(invalid="ignore"):
            gap = value[highest, runs] - value[lowest, runs]
            apart = (gap > self.size) & (gap > APART * np.hypot(std[highest, runs], std[lowest, runs]))
        apart &= known.sum(axis=0) > 1
        self.runs += runs.size
        self.count += int(apart.sum())
        if apart.any() and not self.example:
            run = int(np.argmax(apart))
            low, high = lowest[run], highest[run]
            self.example = f"{value[low, run]:.3g} by {estimates[low].method}, {value[high, run]:.3g} by {estimates[high].method}"

    def sentences(self) -> Iterator[str]:
        """The sentence, if at least half of the runs contradict."""
        if self.count and 2 * self.count >= self.runs:
            yield (
                f"{self.name}: the methods contradict each other{_some(self.count, self.runs)}: {self.example}. At least one "
                "of their assumptions fails: noise of the regressors, gusts, or an effect that the model lacks "
                "(`airtruth trace`)."
            )


__all__ = ["DIFFERENCING", "doubts"]
