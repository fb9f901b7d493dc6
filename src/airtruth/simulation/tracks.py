"""Records on the grid of a simulation, and the fit of what is free when one is flown again."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.simulation import instruments as measure

Array = NDArray[np.float64]

STEP_S: Final = 0.005
"""Longest step of the simulation [s] (judgement: that of the campaigns)."""
_FIT_PASSES: Final = 2
"""Gauss-Newton steps with the same derivatives (judgement: the residual is nearly linear in the parameters, and each
step costs a simulation)."""


@dataclass(frozen=True)
class Track:
    """A record of a motion.

    Attributes
    ----------
    dt_s : sample period [s].
    substeps : steps of the simulation per sample, see `substeps`.
    outputs : channel -> (samples,) measured values to compare [SI].
    weight : channel -> standard deviation that scales its residual [SI].
    controls_rad : name of a control -> ((samples - 1) substeps + 1,) on the simulation's grid, the errors of its sensor undone
        [rad].
    airspeed_m_s : the same of the airspeed [m/s].
    """

    dt_s: float
    substeps: int
    outputs: Mapping[str, Array]
    weight: Mapping[str, float]
    controls_rad: Mapping[str, Array]
    airspeed_m_s: Array


def substeps(dt_s: float) -> int:
    """Number of steps of the simulation per sample of the log."""
    return max(1, math.ceil(dt_s / STEP_S - 1e-9))


def first_of(track: Track, channel: str, otherwise: float) -> float:
    """Mean of the first samples of an output; ``otherwise`` for one that was not measured."""
    return float(np.mean(track.outputs[channel][:5])) if channel in track.outputs else otherwise


def as_logged(aircraft: Aircraft, truth: Mapping[str, Array], track: Track) -> dict[str, Array]:
    """Readings of the aircraft's sensors in a motion, without noise.

    Parameters
    ----------
    truth : channel -> (steps,) at the CG [SI].
    """
    rows = {name: values[None, :] for name, values in truth.items()}
    sensors = {name: s.errors() for name, s in aircraft.file.sensors.items() if name in track.outputs}
    logged = measure.log_channels(
        rows, sensors, {}, track.dt_s / track.substeps, track.substeps, measure.readings_of(aircraft)
    )
    return {name: values[0] for name, values in logged.items()}


def fitted_outputs(
    fly: Callable[[Array], Array], free: Array, steps: Array, track: Track
) -> dict[str, Array]:
    """Outputs of a record flown again, its free parameters and a bias of each output fitted by least squares.

    Parameters
    ----------
    fly : free parameters -> (outputs, samples) in the order of ``track.outputs``.
    free : where the fit begins; steps : of the differences in each of them.
    """
    names = list(track.outputs)
    weight = np.array([[track.weight[n]] for n in names])
    measured = np.stack([track.outputs[n] for n in names])
    flown = fly(free)
    own = np.eye(free.size)
    tangents = np.stack(
        [(fly(free + row * step) - flown) / step for row, step in zip(own, steps, strict=True)]
    )
    best = _residual(measured, flown, weight)
    for _ in range(_FIT_PASSES):
        centred = (tangents - tangents.mean(axis=2, keepdims=True)) / weight
        step = np.linalg.lstsq(centred.reshape(free.size, -1).T, best.ravel(), rcond=None)[0]
        trial = fly(free + step)
        after = _residual(measured, trial, weight)
        if not float((after**2).sum()) < float((best**2).sum()):
            break
        free, flown, best = free + step, trial, after
    fitted = flown + (measured - flown).mean(axis=1, keepdims=True)
    return dict(zip(names, fitted, strict=True))


def _residual(measured: Array, flown: Array, weight: Array) -> Array:
    difference = (measured - flown) / weight
    return np.asarray(difference - difference.mean(axis=1, keepdims=True))


__all__ = [
    "STEP_S",
    "Track",
    "as_logged",
    "first_of",
    "fitted_outputs",
    "substeps",
]
