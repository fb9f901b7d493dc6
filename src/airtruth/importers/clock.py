"""Times as clocks write them: repeated stamps, counters that start again at their end, and restarts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.importers.mapping import TIME_UNITS
from airtruth.importers.series import Series

Array = NDArray[np.float64]

ENDS_S: Final = {
    **{f"{bits} bits of {unit}": 2.0**bits * s for unit, s in TIME_UNITS.items() for bits in (16, 24, 32)},
    "midnight": 86400.0,
    "the end of a GPS week": 604800.0,
}
"""Where a counter or a clock starts again -> time from its start [s]."""
NEAR: Final = 20.0
"""Steps that may lie between the last and the first time around the end of a counter [-] (judgement: some lost samples)."""


@dataclass(frozen=True)
class Clocked:
    """Times that increase, and how they were made.

    Attributes
    ----------
    t_s : (kept,) times [s].
    keep : (rows,) whether the sample of a row is used.
    notes : what was changed, in words.
    """

    t_s: Array
    keep: NDArray[np.bool_]
    notes: tuple[str, ...]


def increasing(t_s: Array) -> Clocked:
    """Times without repeated stamps and without the jumps of a counter that starts again.

    Of samples with one stamp the first is kept. A step back is the end of a counter if the step, with the length of the
    counter added, is at most `NEAR` usual steps. Any other step back stays, for the caller to refuse.

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
    if back.any() and (steps > 0.0).any():
        usual = float(np.median(steps[steps > 0.0]))
        for name, end in ENDS_S.items():
            whole = steps[back] + end
            if kept.min() >= 0.0 and kept.max() <= end and ((whole > 0.0) & (whole <= NEAR * usual)).all():
                kept = kept + end * np.concatenate([[0.0], np.cumsum(back)])
                count = "once" if back.sum() == 1 else f"{int(back.sum())} times"
                notes.append(f"the clock starts again {count} at {end:.10g} s ({name}), and is continued")
                break
    return Clocked(kept, keep, tuple(notes))


def with_increasing_times(series: Mapping[str, Series]) -> tuple[dict[str, Series], tuple[str, ...]]:
    """Channels on times that increase, and what was changed of which channels, in words."""
    made, names = {}, dict[str, list[str]]()
    for name, one in series.items():
        clocked = increasing(one.t_s)
        made[name] = replace(one, t_s=clocked.t_s, values=one.values[clocked.keep])
        for note in clocked.notes:
            names.setdefault(note, []).append(name)
    return made, tuple(f"{', '.join(channels)}: {note}" for note, channels in names.items())


__all__ = ["Clocked", "increasing", "with_increasing_times"]
