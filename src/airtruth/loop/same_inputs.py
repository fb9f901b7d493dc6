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

from airtruth.logs.flight_log import FlightLog
from airtruth.logs.histories import Histories, History

Array = NDArray[np.float64]

INPUTS: Final = (
    "airspeed_m_s",
    "altitude_m",
    "density_kg_m3",
    "elevator_rad",
    "elevator_command_rad",
    "throttle",
)
"""Channels that a simulated record takes from the measured one; other channels contain the measured motion."""


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
    found = []
    for log in logs:
        whole = [
            run_id
            for run, run_id in enumerate(log.run_ids)
            if run_id in known and _is_whole(known[run_id], model, log.rows(run))
        ]
        if whole:
            found.append(
                _simulated(log.select(whole, [c for c in log.channels if c in INPUTS]), known, model)
            )
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


__all__ = ["INPUTS", "simulated_logs"]
