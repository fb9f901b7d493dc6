"""The best explanation of failed tests by the known mistakes of a log.

A log that fails its tests is corrected for each known mistake in turn and tested once more. The sum of the
squared distances is minus twice a log likelihood, so its decrease is the likelihood ratio of "this mistake was
made" against "none was". A mistake is certain if it explains nearly everything that failed; a log that no
mistake explains (a gust, a turn, an unstable aircraft) is not refused.

A sign or a unit belongs to the mapping, which serves every run, so the evidence of all runs is combined (`explain`). A run
that alone shows a mistake, beside runs that do not, is odd (`odd_ones`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.checks.corrections import Correction, catalogue
from airtruth.checks.evidence import relations
from airtruth.checks.excitation import turned
from airtruth.checks.means import LIMITS, ranges
from airtruth.checks.relation import Relation
from airtruth.checks.slopes import TYPICAL
from airtruth.checks.stated import Stated
from airtruth.checks.together import Runs
from airtruth.physics.motion import LONGITUDINAL, MOTIONS

Array = NDArray[np.float64]

SUSPECT: Final = 9.0
"""Sum of squared distances above which corrections are tried; the clean logs of the tests are mostly below it."""
GAIN: Final = 7.0
"""Least decrease of the sum for a certain mistake: a likelihood ratio of exp(3.5)."""
PASSED: Final = 1.0
"""Squared distance up to which a test has passed: one standard deviation."""
REST: Final = 0.4
"""Largest share of the sum that a certain mistake may leave."""
PARTIAL: Final = 6.0
"""Decrease of the sum beyond `GAIN` that a mistake in one of several runs has to bring: a likelihood ratio of exp(3).

Columns are mapped once for all runs of a log (judgement), and gusts shift the estimates of a single run.
"""


def _numbers(derivative: str) -> tuple[str, ...]:
    """Entries of aircraft.toml that a derivative and its slope in a record need."""
    coefficient = LONGITUDINAL.coefficients[LONGITUDINAL.derivatives[LONGITUDINAL.index(derivative)].row]
    inertias = (d.entry for d in LONGITUDINAL.declared if coefficient.name in d.divides)
    return (*inertias, "wing_area", *filter(None, [coefficient.length]), derivative)


DECLARED: Final = {derivative: _numbers(derivative) for derivative in TYPICAL}
"""Tests that compare a record with declared numbers -> those numbers in aircraft.toml."""
AERODYNAMIC: Final = (*(control.name for control in LONGITUDINAL.controls), "ax_slope")
"""Tests that take alpha and q as right; the others are kinematic."""
MOST_RUNS: Final = 12
"""Runs that are tested with each correction; more would cost time and add no certainty."""
MOST_FAULTS: Final = 4
"""Mistakes that are looked for in one log, one after another."""
LEAST_INPUT_RAD: Final = math.radians(0.2)
"""Least range of a surface that moves the aircraft, of the record that it moves most [rad] (judgement): flight-test inputs are
0.5 deg and more, and a unit that leaves less was not used."""
RIVAL: Final = 2.0
"""Difference of two sums below which both mistakes are named: a likelihood ratio of e."""


@dataclass(frozen=True)
class Trial:
    """A correction that was tried: the tests behind it, and their sums in each run and in all together (runs + 1,)."""

    correction: Correction
    after: list[Relation]
    sums: Array


@dataclass(frozen=True)
class Explanation:
    """A mistake that explains failed tests.

    Attributes
    ----------
    correction : its inverse; None if no known mistake explains them.
    failed : the test that failed most; of a mistake that several channels share, that of each of them.
    gain : decrease of the sum of squared distances.
    certain : whether hardly anything is left, see `GAIN` and `REST`.
    rival : the inverse of another mistake that explains the tests nearly as well, see `RIVAL`.
    row : row of the tests that the evidence is from: a run, or -1 for all together.
    declared : tests against declared numbers of the aircraft without which the mistake would not be certain.
    """

    correction: Correction | None
    failed: tuple[Relation, ...]
    gain: float
    certain: bool
    rival: Correction | None = None
    row: int = -1
    declared: tuple[str, ...] = ()

    @property
    def mistake(self) -> str:
        """The mistake in words, and its rival."""
        if self.correction is None or self.rival is None:
            return "" if self.correction is None else self.correction.mistake
        same = self.rival.channels == self.correction.channels
        other = self.rival.mistake if same else f"{self.rival.channels[0]}: {self.rival.mistake}"
        return f"{self.correction.mistake}, or {other}"

    @property
    def cure(self) -> str:
        """Lines to write in the mapping, for either."""
        words = [one.cure for one in (self.correction, self.rival) if one is not None]
        return "; or ".join(words)


def total(results: Sequence[Relation]) -> Array:
    """Sums of the squared distances (runs + 1,) of each run and of all together."""
    return np.asarray(sum(t.distance for t in results))


def _kept(after: Sequence[Relation], before: Sequence[Relation]) -> list[Relation]:
    """Tests after a correction; one that it leaves without information counts as before: to hide evidence explains nothing."""
    own = {t.name: t for t in before if t.name != "range"}
    result = []
    for test in after:
        if test.name in own:
            hidden = ~test.informed & (own[test.name].distance > test.distance)
            distance = np.where(hidden, own[test.name].distance, test.distance)
            figures = np.where(hidden[:, None], own[test.name].figures, test.figures)
            test = replace(test, distance=distance, figures=figures)
        result.append(test)
    return result


def _trials(
    runs: Runs,
    results: list[Relation],
    aircraft: Aircraft | None,
    stated: Mapping[str, Stated],
    made: Sequence[Correction] = (),
) -> list[Trial]:
    """Every correction that may be made beside those that were made already.

    Of a record in all axes those with a channel that no failed test has are left out: they are many. A sense that channels share
    is tried if one of them fails: a command that is reversed with its surface agrees with it.
    """
    found = []
    failing = {n for t in results if np.max(t.distance) > PASSED for n in t.channels}
    everything = not turned(runs)
    for correction in catalogue(runs, stated):
        shares_sense = correction.code == "sign" and not failing.isdisjoint(correction.channels)
        if not everything and not shares_sense and not failing.issuperset(correction.channels):
            continue
        if any(_excludes(one, correction) for one in made):
            continue
        changed = runs.changed(correction.apply)
        if _stills(changed, correction) or _leaves(changed, correction, results):
            continue
        after = _kept(relations(changed, aircraft), results)
        found.append(Trial(correction, after, total(after) + correction.penalty))
    return found


def explain(
    runs: Runs,
    aircraft: Aircraft | None = None,
    stated: Mapping[str, Stated] | None = None,
    *,
    partial: bool = False,
) -> list[Explanation]:
    """Mistakes that the mapping of all these runs made, the clearest first; empty if their tests pass.

    Parameters
    ----------
    stated : what the mapping states of the channels, as of `airtruth.checks.stated.stated_of`.
    partial : whether these are some runs of a log, see `PARTIAL`.
    """
    runs = runs.some(np.arange(min(len(runs), MOST_RUNS)))
    least = GAIN + (PARTIAL if partial else 0.0)
    results = relations(runs, aircraft)
    now = float(total(results)[-1])
    found: list[Explanation] = []
    while now > SUSPECT and len(found) < MOST_FAULTS:
        made = [e.correction for e in found if e.correction]
        trials = _trials(runs, results, aircraft, stated or {}, made)
        best = min(trials, key=lambda trial: float(trial.sums[-1]), default=None)
        if best is None or now - best.sums[-1] < least:
            found.append(Explanation(None, (_first_failed(results),), 0.0, False))
            break
        helped = _helped(best.correction, results, best.after)
        gain = now - float(best.sums[-1])
        resting = _resting(best, results, gain, least)
        found.append(
            Explanation(best.correction, helped, gain, False, _rival(best, trials), declared=resting)
        )
        runs, results = runs.changed(best.correction.apply), best.after
        now = float(best.sums[-1]) - best.correction.penalty
    explained = sum(e.gain for e in found)
    certain = now < max(SUSPECT, REST * explained)
    return [
        replace(e, certain=certain and e.correction is not None and not e.correction.sensor) for e in found
    ]


def odd_ones(
    runs: Runs, aircraft: Aircraft | None = None, stated: Mapping[str, Stated] | None = None
) -> dict[int, Explanation]:
    """Runs of several that alone show a mistake with certainty: index of the run -> the mistake.

    At most `MOST_RUNS` runs are looked at.
    """
    runs = runs.some(np.arange(min(len(runs), MOST_RUNS)))
    results = relations(runs, aircraft)
    now = total(results)
    trials = _trials(runs, results, aircraft, stated or {})
    found = {}
    for run in np.flatnonzero(now[:-1] > SUSPECT).tolist():
        best = min(trials, key=lambda trial: float(trial.sums[run]), default=None)
        if best is None or best.correction.sensor:
            continue
        gain = float(now[run] - best.sums[run])
        rest = float(best.sums[run]) - best.correction.penalty
        if gain >= GAIN + PARTIAL and rest < max(SUSPECT, REST * gain):
            helped = _helped(best.correction, results, best.after, run)
            resting = _resting(best, results, gain, GAIN + PARTIAL, run)
            found[run] = Explanation(best.correction, helped, gain, True, row=run, declared=resting)
    return found


def _stills(changed: Runs, correction: Correction) -> bool:
    """Whether a correction makes a surface too small to have moved the aircraft."""
    surfaces = [c.channel for m in MOTIONS.values() for c in m.controls if c.channel in correction.channels]
    ranges_rad = [changed.each(lambda c, dt_s, n=n: np.ptp(c[n], axis=1)).max() for n in surfaces]  # type: ignore[misc]
    return any(float(x) < LEAST_INPUT_RAD for x in ranges_rad)


def _leaves(changed: Runs, correction: Correction, results: Sequence[Relation]) -> bool:
    """Whether a correction moves one of its channels out of the range of flight, which no other test makes good."""
    outside = {t.channels for t in results if t.name == "range"}
    others = (n for n in changed.channels if n not in correction.channels or n not in LIMITS)
    left = [t for t in ranges(changed.without(*others)) if t.channels not in outside]
    return any(t.distance.min() > 0.0 for t in left)


def _excludes(made: Correction, other: Correction) -> bool:
    """Whether a further mistake cannot have been made beside one: of a channel, a wrong unit and a wrong sign can."""
    return bool(set(made.channels) & set(other.channels)) and {made.code, other.code} != {"unit", "sign"}


def _helped(
    best: Correction, results: Sequence[Relation], after: list[Relation], run: int = -1
) -> tuple[Relation, ...]:
    """The tests that a correction improves most, for each of its parts one of the part's channel if there is one."""

    def decrease(test: Relation) -> float:
        return _decrease(test, after, run)

    if not best.parts:
        own = [t for t in results if set(best.channels) & set(t.channels)]
        return (max(own or results, key=decrease),)
    owns = [[t for t in results if part.channels[0] in t.channels] for part in best.parts]
    return tuple(max(tests or results, key=decrease) for tests in owns)


def _resting(
    best: Trial, results: Sequence[Relation], gain: float, least: float, run: int = -1
) -> tuple[str, ...]:
    """Tests against declared numbers, if the others alone gain less than is needed."""
    shares = {t.name: _decrease(t, best.after, run) for t in results if t.name in DECLARED}
    if gain - sum(shares.values()) >= least:
        return ()
    return tuple(name for name, share in shares.items() if share > 0.0)


def _rival(best: Trial, trials: Sequence[Trial]) -> Correction | None:
    """Another mistake that fits about as well: another unit or gravity of the channel, or a mistake beside a late sensor."""
    kinds, chosen = {"unit", "gravity"}, best.correction
    near = [
        trial
        for trial in trials
        if trial.sums[-1] - best.sums[-1] < RIVAL
        and (
            (trial.correction.channels == chosen.channels and {trial.correction.code, chosen.code} == kinds)
            or (chosen.sensor and not trial.correction.sensor)
        )
    ]
    return min(near, key=lambda trial: float(trial.sums[-1])).correction if near else None


def _first_failed(results: list[Relation]) -> Relation:
    """The test that fails most; a test of the elevator's effect holds alpha and q, so that theirs come first."""
    clear = [t for t in results if t.name not in AERODYNAMIC and t.distance[-1] > GAIN]
    return max(clear or results, key=lambda t: float(t.distance[-1]))


def _decrease(test: Relation, after: list[Relation], run: int) -> float:
    now = sum(
        float(t.distance[run])
        for t in after
        if t.name == test.name and (t.name != "range" or t.channels == test.channels)
    )
    return float(test.distance[run]) - now


__all__ = ["AERODYNAMIC", "DECLARED", "SUSPECT", "Explanation", "explain", "odd_ones", "total"]
