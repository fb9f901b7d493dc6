"""Records of a model without noise and gusts, simulated through the inputs of measured records.

A method that assumes a linear model errs on a nonlinear aircraft, by an amount that depends on the inputs. The same method on
simulated records of the same inputs has this error too, so the simulated estimates are what a measured one is compared with.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.identification import Options
from airtruth.identification.checks import check_channels, unfit
from airtruth.logs.flight_log import FlightLog, batches
from airtruth.logs.histories import Histories, History
from airtruth.physics.motion import LONGITUDINAL, Motion, motion_with

Array = NDArray[np.float64]

_ALWAYS: Final = ("airspeed_m_s", "altitude_m", "density_kg_m3", "throttle")
"""Channels that a simulated record of every motion takes from the measured one."""
_FLOWN: Final = {LONGITUDINAL.name: ("theta_rad",)}
"""Motion -> known inputs that contain the measured motion all the same."""


def inputs_of(motion: Motion) -> tuple[str, ...]:
    """Channels that a simulated record takes from the measured one; other channels contain the measured motion."""
    controls = [name for c in motion.controls for name in (c.channel, c.command)]
    known = [name for name in motion.known if name not in _FLOWN.get(motion.name, ())]
    outputs = {output.channel for output in motion.outputs}
    of_every_log = [name for name in LONGITUDINAL.required if name not in outputs]
    return tuple(dict.fromkeys((*_ALWAYS, *controls, *known, *of_every_log)))


def simulated_logs(logs: Sequence[FlightLog], histories: Histories, model: str) -> list[FlightLog]:
    """Return the measured inputs with the outputs of a model.

    Parameters
    ----------
    logs : the measured records.
    histories : simulations of the records by the stages of a trace: initial state and biases at their best, no gusts.
    model : name of the stage.

    Returns
    -------
    One log for each of ``logs`` that has such a record; a run without a finite simulation of its whole length is left out.
    """
    known = {record.run_id: record for record in histories.records}
    inputs = inputs_of(motion_with(histories.first.measured))
    found = []
    for log in logs:
        whole = [
            run_id
            for run, run_id in enumerate(log.run_ids)
            if run_id in known and _is_whole(known[run_id], model, log.rows(run))
        ]
        if whole:
            found.append(
                _simulated(log.select(whole, [c for c in log.channels if c in inputs]), known, model)
            )
    return found


def identifiable(logs: Sequence[FlightLog], options: Options, motion: Motion) -> list[FlightLog]:
    """Return simulated records without the runs that hold no information, such as those of a model that does not move.

    Raises
    ------
    LogError
        If a log lacks a channel of the motion.
    """
    found = []
    for log in logs:
        check_channels(log, (), motion)
        still = {run_id for b in batches(log) for one in unfit(b, options, motion) for run_id in one.run_ids}
        moving = [run_id for run_id in log.run_ids if run_id not in still]
        if moving:
            found.append(log.select(moving))
    return found


def _is_whole(record: History, model: str, rows: slice) -> bool:
    outputs = record.models[model].values()
    return all(len(y) == rows.stop - rows.start and bool(np.isfinite(y).all()) for y in outputs)


def _simulated(log: FlightLog, known: dict[str, History], model: str) -> FlightLog:
    records = [known[run_id] for run_id in log.run_ids]
    outputs = {
        channel: np.concatenate([record.models[model][channel] for record in records])
        for channel in records[0].models[model]
    }
    return replace(log, channels={**log.channels, **outputs})


__all__ = ["identifiable", "inputs_of", "simulated_logs"]
