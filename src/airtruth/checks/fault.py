"""A physical fault of a flight log: the channel, the evidence and the cure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True)
class Fault:
    """A contradiction between a flight log and physics.

    Attributes
    ----------
    channel : name of the channel at fault.
    run_ids : runs that show the fault.
    code : kind of fault, one of `airtruth.checks.fault.CODES`.
    sentence : channel, runs, evidence with figures, and the cure.
    certain : whether no flight could produce these values; a log with a certain fault is refused.
    statistic : evidence behind the fault; its meaning and threshold are those of the test of ``code``.
    """

    channel: str
    run_ids: tuple[str, ...]
    code: str
    sentence: str
    certain: bool
    statistic: float

    @property
    def run_id(self) -> str:
        """First run that shows the fault."""
        return self.run_ids[0]


CODES: Final = {
    "sign": "the channel has the opposite sign",
    "unit": "the channel is in another unit",
    "unit_and_sign": "the channel is in another unit and has the opposite sign",
    "scale": "the channel is wrong by a factor of no known unit",
    "copy": "the channel holds the values of another channel, which the log has too",
    "swapped": "the channel and another one are exchanged",
    "gravity": "the accelerometer lacks gravity, or counts it twice",
    "constant": "the channel does not change while the aircraft moves",
    "dropout": "some samples are zero or frozen",
    "spike": "some samples are isolated outliers",
    "inconsistent": "the channel contradicts the others, by no known mistake",
    "impossible": "the values are outside the range of flight",
    "name": "the column has the name of no channel but resembles one",
    "lag": "the channel is late relative to the others",
    "reconstructed": "the channel was computed from others, and agrees with them by construction",
    "interpolated": "the channel has fewer samples of its own than the log",
    "aircraft": "the log is of another aircraft than the declared one",
    "metadata": "the unit in the file's metadata contradicts the column's name",
}
"""Kinds of fault and their meanings."""

__all__ = ["CODES", "Fault"]
