"""Times as clocks write them: repeated stamps, counters that start again at their end, and restarts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.importers.mapping import TIME_UNITS
from airtruth.importers.series import Series
from airtruth.logs.validate import MINIMUM_SAMPLES

Array = NDArray[np.float64]

ENDS_S: Final = {
    **{f"{bits} bits of {unit}": 2.0**bits * s for unit, s in TIME_UNITS.items() for bits in (16, 24, 32)},
    "midnight": 86400.0,
    "the end of a GPS week": 604800.0,
}
"""Where a counter or a clock starts again -> time from its start [s]."""
NEAR: Final = 20.0
"""Steps that may lie between the last and the first time around the end of a counter [-] (judgement: some lost samples)."""


PAUSE_S: Final = 10.0
"""Least time that is put between the parts of a clock that starts again [s]: more than a gap that would be filled."""


@dataclass(frozen=True)
class Clocked:
    """Times that increase within each part, and how they were made.

    Attributes
    ----------
    t_s : (kept,) times [s].
    keep : (rows,) whether the sample of a row is used.
    notes : what was changed, in words.
    starts : indices of ``t_s`` at which the clock starts again.
    """

    t_s: Array
    keep: NDArray[np.bool_]
    notes: tuple[str, ...]
    starts: tuple[int, ...] = ()


@dataclass(frozen=True)
class Parts:
    """The parts of a record whose clock starts again, on one clock that is continued.

    Attributes
    ----------
    offsets_s : time that is added to those of each part [s]; the first one is 0.
    spans_s : first and last time of each part, continued [s].
    long : whether each part has as many samples as a run needs.
    """

    offsets_s: tuple[float, ...] = (0.0,)
    spans_s: tuple[tuple[float, float], ...] = ()
    long: tuple[bool, ...] = (True,)

    @property
    def several(self) -> bool:
        """Whether the clock starts again."""
        return len(self.offsets_s) > 1

    def continued(self, t_s: Array) -> Array:
        """Times of the file with the offsets of their parts (rows,) [s]; of another number of parts as they are."""
        starts = increasing(t_s).starts if self.several else ()
        if len(starts) + 1 != len(self.offsets_s):
            return t_s
        part = np.searchsorted(np.array(starts), np.arange(len(t_s)), side="right")
        return np.asarray(t_s + np.array(self.offsets_s)[part])


ONE: Final = Parts()
"""A record whose clock does not start again."""


def increasing(t_s: Array) -> Clocked:
    """Times without repeated stamps and without the jumps of a counter that starts again at its end.

    Of samples with one stamp the first is kept. A step back is the end of a counter if the step, with the length of the
    counter added, is at most `NEAR` usual steps. Otherwise a step back by more than `NEAR` usual steps is a recorder that
    started again: a part begins there. A smaller one is a row out of order and stays, for the caller to refuse.

    Parameters
    ----------
    t_s : (rows,) times [s].

    Examples
    --------
    >>> clocked = increasing(np.array([65.530, 65.533, 65.533, 0.0, 0.003]))
    >>> clocked.t_s.tolist()
    [65.53, 65.533, 65.536, 65.539]
    >>> clocked.notes
    ('1 repeated time is left out', 'the clock starts again once at 65.536 s (16 bits of ms), and is continued')
    """
    keep = np.ones(len(t_s), dtype=np.bool_)
    if len(t_s) < 3 or not np.isfinite(t_s).all() or (np.diff(t_s) > 0.0).all():
        return Clocked(t_s, keep, ())
    notes = []
    keep[1:] = np.diff(t_s) != 0.0
    kept = t_s[keep]
    if repeated := int((~keep).sum()):
        notes.append(
            "1 repeated time is left out" if repeated == 1 else f"{repeated} repeated times are left out"
        )
    steps = np.diff(kept)
    back = steps < 0.0
    if not back.any() or not (steps > 0.0).any():
        return Clocked(kept, keep, tuple(notes))
    usual = float(np.median(steps[steps > 0.0]))
    for name, end in ENDS_S.items():
        whole = steps[back] + end
        if kept.min() >= 0.0 and kept.max() <= end and ((whole > 0.0) & (whole <= NEAR * usual)).all():
            kept = kept + end * np.concatenate([[0.0], np.cumsum(back)])
            count = "once" if back.sum() == 1 else f"{int(back.sum())} times"
            notes.append(f"the clock starts again {count} at {end:.10g} s ({name}), and is continued")
            return Clocked(kept, keep, tuple(notes))
    starts = np.flatnonzero(back) + 1
    if (steps[back] >= -NEAR * usual).any() or len(kept) < MINIMUM_SAMPLES * (len(starts) + 1):
        return Clocked(kept, keep, tuple(notes))
    return Clocked(kept, keep, tuple(notes), tuple(starts.tolist()))


def with_increasing_times(
    series: Mapping[str, Series],
) -> tuple[dict[str, Series], tuple[str, ...], Parts]:
    """Channels on times that increase, what was changed of which channels, in words, and the parts of the record.

    Where the clock starts again in every channel as often, the times of a later part count on from the end of the part before
    it, after a pause of `PAUSE_S` or a little more. Otherwise they stay, for the caller to refuse.
    """
    clocked = {name: increasing(one.t_s) for name, one in series.items()}
    made = {
        name: replace(one, t_s=clocked[name].t_s, values=one.values[clocked[name].keep])
        for name, one in series.items()
    }
    names = dict[str, list[str]]()
    for name, one in clocked.items():
        for note in one.notes:
            names.setdefault(note, []).append(name)
    notes = [f"{', '.join(channels)}: {note}" for note, channels in names.items()]
    moving = [clocked[name] for name, one in series.items() if not one.constant]
    counts = {len(one.starts) for one in moving}
    if len(counts) != 1 or counts == {0}:
        return made, tuple(notes), ONE
    parts = _continued(moving)
    for name, own in made.items():
        if not own.constant:
            at = np.searchsorted(np.array(clocked[name].starts), np.arange(len(own.t_s)), side="right")
            made[name] = replace(own, t_s=own.t_s + np.array(parts.offsets_s)[at])
    for number, (offset, span) in enumerate(zip(parts.offsets_s[1:], parts.spans_s[1:], strict=True), 2):
        notes.append(
            f"the clock starts again at {span[0] - offset:.9g} s: part {number} counts on from {span[0]:.9g} s, and "
            + (
                "is a run of its own"
                if parts.long[number - 1]
                else "is left out, because it is shorter than a run"
            )
        )
    if not parts.long[0]:
        notes.append("part 1, before the clock starts again, is left out, because it is shorter than a run")
    return made, tuple(notes), parts


def _continued(moving: Sequence[Clocked]) -> Parts:
    """Offsets that all channels share, so that each part begins after the end of the one before it."""
    offsets, spans, long = [0.0], list[tuple[float, float]](), []
    for number in range(len(moving[0].starts) + 1):
        pieces = [np.split(one.t_s, one.starts)[number] for one in moving]
        low, high = min(float(t[0]) for t in pieces), max(float(t[-1]) for t in pieces)
        if number:
            offsets.append(float(np.ceil(spans[-1][1] + PAUSE_S - low)))  # math.ceil has no infinity
        spans.append((low + offsets[-1], high + offsets[-1]))
        long.append(max(len(t) for t in pieces) >= MINIMUM_SAMPLES)
    return Parts(tuple(offsets), tuple(spans), tuple(long))


__all__ = ["ONE", "Clocked", "Parts", "increasing", "with_increasing_times"]
