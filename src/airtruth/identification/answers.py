"""Which motions an identification answers: the one that is named, or each that the records excite and have the channels for."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from airtruth.arguments import names
from airtruth.errors import ConfigurationError, choices
from airtruth.identification.condition import AircraftConstants
from airtruth.identification.excited import excited_motions
from airtruth.identification.methods import DEFAULT, METHODS, OF_MOTION, Method
from airtruth.identification.record_constants import values_of
from airtruth.logs.sources import Logs
from airtruth.physics.motion import LONGITUDINAL, MOTIONS, Motion

Given = Sequence[str | Method] | str | Method | None


@dataclass(frozen=True)
class Answer:
    """A motion to identify.

    Attributes
    ----------
    motion : whose derivatives are estimated.
    methods : its estimators.
    excited : whether runs that do not excite it are left alone.
    """

    motion: Motion
    methods: tuple[str | Method, ...]
    excited: bool


def answers(
    logs: Logs, aircraft: AircraftConstants, methods: Given = None, motion: str | None = None
) -> tuple[tuple[Answer, ...], tuple[str, ...]]:
    """Return the motions to answer, in the order of the answers, and sentences on one that is left out.

    Parameters
    ----------
    logs : the logs.
    aircraft : whose inertias the lateral-directional motion needs.
    methods : estimators; None for the default of each motion. Of several motions each takes those that it has.
    motion : name of the motion; None for each that the records excite and have the channels for.

    Raises
    ------
    ConfigurationError
        If there is no such motion.
    StoreError, LogError
        If a log cannot be read.
    """
    if motion is not None:
        if motion not in MOTIONS:
            raise ConfigurationError(f"motion {motion!r} does not exist: {choices(str(motion), MOTIONS)}")
        return (Answer(MOTIONS[motion], _of(methods, MOTIONS[motion]), False),), ()
    found = excited_motions(logs)
    if found == (LONGITUDINAL,):
        return (Answer(LONGITUDINAL, _of(methods, LONGITUDINAL), False),), ()
    made, notes = [], []
    for one in found:
        own = _of(methods, one) if len(found) == 1 else _some(methods, one)
        try:
            values_of(aircraft, one)
        except ConfigurationError as error:
            if len(found) == 1:
                raise
            notes.append(f"the records excite the {one.name} motion as well, which is not answered: {error}")
            continue
        if own:
            made.append(Answer(one, own, True))
    return tuple(made), tuple(notes)


def _of(methods: Given, motion: Motion) -> tuple[str | Method, ...]:
    if methods is None:
        return (DEFAULT[motion.name],)
    if not isinstance(methods, str | Method | Iterable):
        names("methods", methods, "ls")
    return (methods,) if isinstance(methods, str | Method) else tuple(methods)


def _some(methods: Given, motion: Motion) -> tuple[str | Method, ...]:
    """The estimators that the motion has; a name that no motion has stays, to be refused."""
    known = OF_MOTION[motion.name]
    every = _of(methods, motion)
    if motion is LONGITUDINAL:
        return every
    return tuple(m for m in every if isinstance(m, str) and (m in known or m not in METHODS))


__all__ = ["Answer", "answers"]
