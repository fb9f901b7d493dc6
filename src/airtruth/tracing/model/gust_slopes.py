"""Derivatives of a gust and of the rates of its states, see `airtruth.tracing.model.gust_states`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from airtruth.numerics.compiled import inner
from airtruth.tracing.model.gust_states import gust_of
from airtruth.tracing.model.kernel_input import FilterModel
from airtruth.tracing.model.parameters import GUST_1, LEAD, core_of

Array = NDArray[np.float64]


def gust_weights(states: int, rolloff: float) -> tuple[Array, Array]:
    """(core,) slopes of the gust of a motion in the states, and of what a unit of the rolloff adds to it [-].

    Parameters
    ----------
    states : number of states of the motion.
    """
    unit = np.eye(core_of(states))
    none = np.array([gust_of(x, states, 0.0) for x in unit])
    lead = np.array([gust_of(x, states, 1.0) for x in unit]) - none
    return none + rolloff * lead, lead


@inner
def slopes_of_gust(
    x: Array, d_x: Array, first: int, weight: Array, lead: Array, rolloff: int, out: Array
) -> None:
    """Derivatives of the gust into ``out``.

    Parameters
    ----------
    first : number of the first state of the gust; weight, lead : see `gust_weights`.
    rolloff : number of the rolloff among the parameters.
    """
    low, by_rolloff = first + LEAD - GUST_1, 0.0
    one, two, three, four, five = (
        weight[first],
        weight[first + 1],
        weight[low],
        weight[low + 1],
        weight[low + 2],
    )
    for p in range(out.size):
        copies = three * d_x[low, p] + four * d_x[low + 1, p] + five * d_x[low + 2, p]
        out[p] = one * d_x[first, p] + two * d_x[first + 1, p] + copies
    for j in range(lead.size):
        by_rolloff += lead[j] * x[j]
    out[rolloff] += by_rolloff


@inner
def gust_rate_slopes(v: float, first: int, d_x: Array, model: FilterModel, slope: Array) -> None:
    """Derivatives of the rates of the gusts, but for the late gust and the low-passed copies."""
    a = v / model.gusts.length_m
    for p in range(slope.shape[1]):
        slope[first, p] = -a * d_x[first, p]
    for p in range(slope.shape[1]):
        slope[first + 1, p] = a * (d_x[first, p] - d_x[first + 1, p])


__all__ = ["gust_rate_slopes", "gust_weights", "slopes_of_gust"]
