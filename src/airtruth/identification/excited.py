"""Which motions the runs of a log excite: those whose surfaces move, beside the surfaces of the other motions."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.logs.flight_log import FlightLog
from airtruth.logs.sources import Logs, sources
from airtruth.logs.store import read_log
from airtruth.logs.tables import opened
from airtruth.physics.motion import LATERAL, LONGITUDINAL, MOTIONS, Motion

Array = NDArray[np.float64]

SHARE: Final = 0.1
"""Motion of a surface over that of the surface that moves most, from which it excites its motion [-] (judgement: a damper or the
hold of an attitude moves the other surfaces by less)."""


def _surfaces(motion: Motion) -> list[str]:
    return [control.channel for control in motion.controls]


def excites(channels: Mapping[str, Array], motion: Motion) -> NDArray[np.bool_]:
    """Whether a surface of the motion moves by at least `SHARE` of the one that moves most.

    Parameters
    ----------
    channels : column name -> (..., samples); a surface that is missing does not move.

    Returns
    -------
    (...)
    """
    moved = {
        name: channels[name].std(axis=-1)
        for m in MOTIONS.values()
        for name in _surfaces(m)
        if name in channels
    }
    own = [moved[name] for name in _surfaces(motion) if name in moved]
    if not own:
        return np.zeros(next(iter(channels.values())).shape[:-1], dtype=np.bool_)
    most = np.max(own, axis=0)
    return np.asarray((most > 0.0) & (most >= SHARE * np.max(list(moved.values()), axis=0)))


def excited_runs(log: FlightLog, motion: Motion) -> list[str]:
    """Runs that excite the motion, see `excites`."""
    surfaces = [name for m in MOTIONS.values() for name in _surfaces(m) if name in log.channels]
    return [
        run_id
        for run, run_id in enumerate(log.run_ids)
        if surfaces and excites({name: log.channels[name][log.rows(run)] for name in surfaces}, motion)
    ]


def _channels(source: Path | FlightLog) -> Collection[str]:
    """Columns of a log; no row is read."""
    if isinstance(source, FlightLog):
        return source.channels
    with opened(source) as file:
        return list(file.schema_arrow.names)


def excited_motions(logs: Logs) -> tuple[Motion, ...]:
    """Motions that at least one run of the logs excites and whose channels its log has.

    Logs without the channels of the lateral motion are not read; where none has them it is the longitudinal motion.

    Raises
    ------
    StoreError, LogError
        If a log cannot be read.
    """
    found = set()
    for source in sources(logs):
        names = _channels(source)
        if not set(LATERAL.required) <= set(names):
            found |= {LONGITUDINAL.name}
            continue
        surfaces = [name for m in MOTIONS.values() for name in _surfaces(m) if name in names]
        log = source if isinstance(source, FlightLog) else read_log(source, columns=surfaces)
        for motion in MOTIONS.values():
            if set(motion.required) <= set(names) and excited_runs(log, motion):
                found.add(motion.name)
        if len(found) == len(MOTIONS):
            break
    return tuple(m for m in MOTIONS.values() if m.name in found) or (LONGITUDINAL,)


__all__ = ["SHARE", "excited_motions", "excited_runs", "excites"]
