"""Errors of the stages of a trace: root mean squares, tolerances of a training simulator, flights in JSBSim."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Final, Generic, Protocol, TypeVar

STAGES: Final = ("declared", "before", "after", "control", "floor")
"""Stages of the report in their order: the declared aircraft; its derivatives and noise levels refitted; the accepted
effects added; the runner-up added instead; the error that gusts and sensor noise alone explain."""
SETS: Final = ("held_out", "fit")
"""Sets of records that a stage is assessed on, in the order of the report."""

PerChannel = dict[str, float]
"""Channel -> value in the channel's SI unit."""


class _Row(Protocol):
    def to_dict(self) -> dict[str, Any]: ...


T = TypeVar("T", bound=_Row)


@dataclass(frozen=True)
class BySet(Generic[T]):
    """One quantity on the fitted and on the held-out records; None where there are no such records."""

    fit: T | None = None
    held_out: T | None = None

    def on(self, records: str) -> T | None:
        """The quantity on one of `SETS`."""
        return self.held_out if records == "held_out" else self.fit

    def to_dict(self) -> dict[str, Any]:
        """The sets that there are."""
        both = {"fit": self.fit, "held_out": self.held_out}
        return {name: row.to_dict() for name, row in both.items() if row is not None}


@dataclass(frozen=True)
class Rms:
    """Root mean squares of a stage over some records.

    Attributes
    ----------
    free_run : errors of the simulation from the initial state, per channel.
    innovation : errors of the one-step prediction, per channel.
    """

    free_run: PerChannel
    innovation: PerChannel

    def to_dict(self) -> dict[str, Any]:
        """Both kinds."""
        return {"free_run": dict(self.free_run), "innovation": dict(self.innovation)}


@dataclass(frozen=True)
class Errors:
    """Errors of every stage.

    Attributes
    ----------
    channels : standard deviation of each measured channel.
    stages : stage, one of `STAGES` -> errors.
    """

    channels: PerChannel
    stages: dict[str, BySet[Rms]]

    def to_dict(self) -> dict[str, Any]:
        """Channels and stages side by side."""
        return {"channels": dict(self.channels)} | {name: e.to_dict() for name, e in self.stages.items()}


@dataclass(frozen=True)
class AxialRms:
    """Root mean squares of ax beyond a model, each record about its mean [m/s2]; None where no record is held out."""

    fit: float
    held_out: float | None = None

    def to_dict(self) -> dict[str, float]:
        """The sets that there are."""
        return {"fit": self.fit} | ({} if self.held_out is None else {"held_out": self.held_out})


@dataclass(frozen=True)
class AxialErrors:
    """Errors of the axial force: as declared, and with the learned increments of CX."""

    declared: AxialRms
    after: AxialRms

    def to_dict(self) -> dict[str, Any]:
        """Both stages."""
        return {"declared": self.declared.to_dict(), "after": self.after.to_dict()}


@dataclass(frozen=True)
class Excursions:
    """Free runs of some records against the tolerances of a training simulator.

    Attributes
    ----------
    distances : quantity -> largest distance over the records, in SI; in JSON side by side with the others.
    share_inside : mean share of the samples inside the tolerances [-].
    records_within, records : number of records inside throughout, and in all.
    """

    distances: PerChannel
    share_inside: float
    records_within: int
    records: int

    def to_dict(self) -> dict[str, Any]:
        """The distances side by side with the counts."""
        counts = {name: getattr(self, name) for name in COUNTS}
        return {**self.distances, **counts}


COUNTS: Final = ("share_inside", "records_within", "records")
"""Fields of `Excursions` beside the distances."""


@dataclass(frozen=True)
class Tolerances:
    """Every stage against the tolerances of a training simulator.

    Attributes
    ----------
    source : regulation.
    limits : quantity -> largest allowed distance, in SI; a tolerance may also state a share of the measured value.
    stages : stage -> distances.
    modes : stage -> quantity of `airtruth.physics.proof_of_lateral.LateralProof` -> value, null where the motion has none;
        of the lateral-directional motion.
    """

    source: str
    limits: dict[str, float]
    stages: dict[str, BySet[Excursions]]
    modes: dict[str, dict[str, float | None]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuse sets of records whose distances are of different quantities.

        Raises
        ------
        ValueError
            If they are.
        """
        every = [own for stage in self.stages.values() for own in (stage.fit, stage.held_out) if own]
        if len({tuple(own.distances) for own in every}) > 1:
            raise ValueError("the distances of all stages have to be of the same quantities")

    def to_dict(self) -> dict[str, Any]:
        """Source, limits and stages side by side."""
        rows = {name: e.to_dict() for name, e in self.stages.items()}
        modes = {"modes": {name: dict(own) for name, own in self.modes.items()}} if self.modes else {}
        return {"source": self.source, "limits": dict(self.limits), **modes, **rows}


MOST_RECORDS: Final = 6
"""Largest number of records that are flown again [-] (judgement: each costs about a second)."""


@dataclass(frozen=True)
class Replay:
    """Root mean square errors of records flown again in JSBSim, by the declared and by the updated aircraft.

    Both are None where nothing could be flown.
    """

    declared: PerChannel | None = None
    updated: PerChannel | None = None

    def to_dict(self) -> dict[str, Any]:
        """Those aircraft that flew."""
        both = {"declared": self.declared, "updated": self.updated}
        return {name: dict(rms) for name, rms in both.items() if rms is not None}


__all__ = [
    "SETS",
    "STAGES",
    "AxialErrors",
    "AxialRms",
    "BySet",
    "Errors",
    "Excursions",
    "PerChannel",
    "Replay",
    "Rms",
    "Tolerances",
]
