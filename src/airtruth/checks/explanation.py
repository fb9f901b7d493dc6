"""The best explanation of failed tests by the known mistakes of a log.

A log that fails its tests is corrected for each known mistake in turn and tested once more. The sum of the
squared distances is minus twice a log likelihood, so its decrease is the likelihood ratio of "this mistake was
made" against "none was". A mistake is certain if it explains nearly everything that failed; a log that no
mistake explains (a gust, a turn, an unstable aircraft) is not refused.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.channels import SIGNALS
from airtruth.checks.corrections import Correction, catalogue
from airtruth.checks.evidence import relations
from airtruth.checks.relation import Relation
from airtruth.logs.flight_log import Batch

SUSPECT: Final = 9.0
"""Sum of squared distances above which corrections are tried; the clean logs of the tests are mostly below it."""
GAIN: Final = 7.0
"""Least decrease of the sum for a certain mistake: a likelihood ratio of exp(3.5)."""
REST: Final = 0.4
"""Largest share of the sum that a certain mistake may leave."""
PARTIAL: Final = 6.0
"""Decrease of the sum beyond `GAIN` that a mistake in a part of the runs has to bring: a likelihood ratio of exp(3).

Columns are mapped once for all runs of a log (judgement), and gusts shift the estimates of a single run.
"""
AERODYNAMIC: Final = ("elevator", "ax_slope")
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
class Explanation:
    """A mistake that explains failed tests.

    Attributes
    ----------
    correction : its inverse; None if no known mistake explains them.
    failed : the test that failed most; of a mistake that several channels share, that of each of them.
    gain : decrease of the sum of squared distances.
    certain : whether hardly anything is left, see `GAIN` and `REST`.
    rival : the inverse of another mistake that explains the tests nearly as well, see `RIVAL`.
    """

    correction: Correction | None
    failed: tuple[Relation, ...]
    gain: float
    certain: bool
    rival: Correction | None = None

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
        """What to write in the mapping, for either."""
        words = [one.cure for one in (self.correction, self.rival) if one is not None]
        return "; or ".join(words)


def total(results: list[Relation], before: list[Relation] | None = None) -> float:
    """Sum of the squared distances of all runs together.

    With ``before``, a test that a correction leaves without information counts as before the correction: to
    hide the evidence is no explanation.
    """
    own = {t.name: t for t in before or () if t.name != "range"}
    return float(
        sum(
            max(t.distance[-1], own[t.name].distance[-1])
            if t.name in own and not t.informed
            else t.distance[-1]
            for t in results
        )
    )


def explain(batch: Batch, aircraft: Aircraft | None = None, *, partial: bool = False) -> list[Explanation]:
    """Mistakes that were made in a batch, the clearest first; empty if its tests pass.

    Parameters
    ----------
    partial : whether the batch is a part of the runs of a log, see `PARTIAL`.
    """
    batch = _first(batch, MOST_RUNS)
    least = GAIN + (PARTIAL if partial else 0.0)
    results = relations(batch, aircraft)
    now = total(results)
    found: list[Explanation] = []
    while now > SUSPECT and len(found) < MOST_FAULTS:
        names = tuple(n for n in batch.channels if n in SIGNALS)
        made = [e.correction for e in found if e.correction]
        best: tuple[float, Correction, Batch, list[Relation]] | None = None
        values: list[tuple[float, Correction]] = []
        for correction in catalogue(names, batch.dt_s):
            if any(_excludes(one, correction) for one in made):
                continue
            corrected = correction.apply(batch.channels)
            if _stills(corrected):
                continue
            changed = replace(batch, channels={**batch.channels, **corrected})
            after = relations(changed, aircraft)
            value = total(after, results) + correction.penalty
            values.append((value, correction))
            if best is None or value < best[0]:
                best = value, correction, changed, after
        failed = _first_failed(results)
        if best is None or now - best[0] < least:
            found.append(Explanation(None, (failed,), 0.0, False))
            break
        helped = _helped(best[1], results, best[3])
        found.append(Explanation(best[1], helped, now - best[0], False, _rival(best[1], best[0], values)))
        batch, results, now = best[2], best[3], best[0] - best[1].penalty
    explained = sum(e.gain for e in found)
    certain = now < max(SUSPECT, REST * explained)
    return [
        replace(e, certain=certain and e.correction is not None and not e.correction.sensor) for e in found
    ]


def _stills(corrected: Mapping[str, NDArray[np.float64]]) -> bool:
    """Whether a correction makes a surface too small to have moved the aircraft."""
    surface = corrected.get("elevator_rad")
    return surface is not None and float(np.ptp(surface, axis=1).max()) < LEAST_INPUT_RAD


def _excludes(made: Correction, other: Correction) -> bool:
    """Whether a further mistake cannot have been made beside one: of a channel, a wrong unit and a wrong sign can."""
    return bool(set(made.channels) & set(other.channels)) and {made.code, other.code} != {"unit", "sign"}


def _helped(best: Correction, results: Sequence[Relation], after: list[Relation]) -> tuple[Relation, ...]:
    """The tests that a correction improves most, for each of its parts one of the part's channel if there is one."""
    if not best.parts:
        return (max(results, key=lambda t: _decrease(t, after)),)
    own = [[t for t in results if part.channels[0] in t.channels] for part in best.parts]
    return tuple(max(tests or results, key=lambda t: _decrease(t, after)) for tests in own)


def _rival(best: Correction, value: float, values: list[tuple[float, Correction]]) -> Correction | None:
    """Another mistake that fits about as well: another unit or gravity of the channel, or a mistake beside a late sensor."""
    kinds = {"unit", "gravity"}
    near = [
        (v, one)
        for v, one in values
        if v - value < RIVAL
        and (
            (one.channels == best.channels and {one.code, best.code} == kinds)
            or (best.sensor and not one.sensor)
        )
    ]
    return min(near, key=lambda pair: pair[0])[1] if near else None


def _first_failed(results: list[Relation]) -> Relation:
    """The test that fails most; a test of the elevator's effect holds alpha and q, so that theirs come first."""
    clear = [t for t in results if t.name not in AERODYNAMIC and t.distance[-1] > GAIN]
    return max(clear or results, key=lambda t: float(t.distance[-1]))


def _decrease(test: Relation, after: list[Relation]) -> float:
    now = sum(
        float(t.distance[-1])
        for t in after
        if t.name == test.name and (t.name != "range" or t.channels == test.channels)
    )
    return float(test.distance[-1]) - now


def _first(batch: Batch, count: int) -> Batch:
    if len(batch.run_ids) <= count:
        return batch
    channels = {name: values[:count] for name, values in batch.channels.items()}
    return replace(batch, run_ids=batch.run_ids[:count], t_s=batch.t_s[:count], channels=channels)


__all__ = ["SUSPECT", "Explanation", "explain", "total"]
