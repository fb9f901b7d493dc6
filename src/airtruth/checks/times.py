"""The times of a log: their unit, and samples that were not measured."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.checks.fault import Fault
from airtruth.checks.sentences import runs
from airtruth.logs.flight_log import RESAMPLED, FlightLog
from airtruth.physics.motion import LONGITUDINAL

Array = NDArray[np.float64]

SLOWEST_HZ: Final = 0.5
"""Sample rate below which no record shows the short period of an aircraft [Hz] (judgement: periods are 0.3 to 10 s)."""
FASTEST_HZ: Final = 5000.0
"""Sample rate above which no flight is recorded [Hz] (judgement: accelerometers reach 2 kHz)."""
DYNAMIC: Final = LONGITUDINAL.channels
"""Channels that show the short period."""
_LIKELY: Final = (
    ("milliseconds", 1e3),
    ("microseconds", 1e6),
    ("nanoseconds", 1e9),
    ("units of 1000 s", 1e-3),
)
"""Units of time -> factor on a sample rate that was computed as if they were seconds."""


def clock(log: FlightLog) -> Iterator[Fault]:
    """A sample rate that no flight test has: the times are in another unit."""
    rates = [(run, _rate_hz(log.t_s[log.rows(i)])) for i, run in enumerate(log.run_ids)]
    wrong = [(run, hz) for run, hz in rates if not SLOWEST_HZ <= hz <= FASTEST_HZ]
    if not wrong:
        return
    _, hz = wrong[0]
    likely = next(
        (
            f"; the rate would be {hz * factor:.3g} Hz if the times are in {unit}"
            for unit, factor in _LIKELY
            if _usual(hz * factor)
        ),
        "",
    )
    yield Fault(
        "t_s", tuple(one for one, _ in wrong), "unit",
        f"t_s: {hz:.3g} samples per second in {runs([one for one, _ in wrong], len(log))}, where a flight test has "
        f"{SLOWEST_HZ:g} to {FASTEST_HZ:g}{likely}; correct the unit of the times: t_s counts seconds, and a mapping states "
        "[time] unit", True, 1.0,
    )  # fmt: skip


def _usual(hz: float) -> bool:
    return 1.0 <= hz <= 1000.0


def _rate_hz(t_s: Array) -> float:
    return (len(t_s) - 1) / max(float(t_s[-1] - t_s[0]), 1e-300)


def interpolated(log: FlightLog) -> Iterator[Fault]:
    """Channels whose own samples are fewer than those of the log, which the import states."""
    stated = log.metadata.get(RESAMPLED)
    own = stated.get("from_hz") if isinstance(stated, Mapping) else None
    slow = (
        {name: float(hz) for name, hz in own.items() if name in DYNAMIC} if isinstance(own, Mapping) else {}
    )
    if not slow or not isinstance(stated, Mapping):
        return
    listed = ", ".join(f"{name} from {hz:.4g} Hz" for name, hz in slow.items())
    yield Fault(
        next(iter(slow)), log.run_ids, "interpolated",
        f"{listed}: interpolated to {float(stated['rate_hz']):.4g} Hz: the samples between were not measured, and estimates "
        f"can be biased by more than their intervals; import at {min(slow.values()):.4g} Hz or less, or record faster",
        False, float(stated["rate_hz"]) / min(slow.values()),
    )  # fmt: skip


__all__ = ["clock", "interpolated"]
