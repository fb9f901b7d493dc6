"""The flight conditions along a record at which the filter's gain is made.

A gust w moves the angle of attack by w/V. The gain of one mean condition expects half of that where the airspeed falls to
half of it. The gain therefore follows the airspeed of a record that slows down or speeds up by much, and is interpolated
between a few airspeeds.

Source: W. J. Rugh and J. S. Shamma, Automatica 36 (2000) 1401-1425, section 2 (gain scheduling by linearisations).
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airtruth.tracing.model.by_motion import coefficients_of, equations_of_grid
from airtruth.tracing.model.kernel_input import AnyGrid, AnyPoint

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

RATIO: Final = 1.25
"""Ratio of the largest airspeed of a record to its least up to which one gain serves, and largest ratio of two airspeeds between
which gains are interpolated [-] (judgement: w/V within 12 % of its mean)."""
_WIDEST: Final = 4.0
"""Ratio of the largest airspeed to the least that has a gain of its own [-] (judgement: below a quarter of it nothing flies; an
airspeed of zero is a dropout or a take-off)."""


class Schedule(NamedTuple):
    """Flight conditions at which the gain is made.

    Attributes
    ----------
    flow_rad : (nodes,) mean flow angle near each airspeed [rad]; empty where the mean of the record serves.
    air : (nodes,) means of the other inputs there.
    lower : (samples,) number of the node below the airspeed of each sample.
    share : (samples,) of the next node in the interpolation, linear in log V [-].
    """

    flow_rad: tuple[float, ...]
    air: tuple[AnyPoint, ...]
    lower: Ints
    share: Array


UNSCHEDULED: Final = Schedule((), (), np.zeros(0, dtype=np.int64), np.zeros(0))
"""The mean of the record serves."""


def schedule(flow_rad: Array, grid: AnyGrid, sub: int) -> Schedule:
    """The flight conditions of a record, by its airspeed.

    Parameters
    ----------
    flow_rad : (samples,) measured angle of attack, or sideslip of the lateral-directional motion [rad].
    grid : inputs on the filter's grid, ``sub`` cells to a sample.
    """
    measured = grid.airspeed_m_s[::sub]
    fastest = float(measured.max())
    if not fastest > 0.0:
        return UNSCHEDULED
    airspeed = np.maximum(measured, fastest / _WIDEST)
    log_v = np.log(airspeed)
    low, high = float(log_v.min()), float(log_v.max())
    if not high - low > math.log(RATIO):
        return UNSCHEDULED
    cells = math.ceil((high - low) / math.log(RATIO))
    at = (log_v - low) * (cells / (high - low))
    lower = np.minimum(at.astype(np.int64), cells - 1)
    share = at - lower
    weights = np.maximum(1.0 - np.abs(at[:, None] - np.arange(cells + 1)), 0.0)
    nodes = {name: _nodes(weights, x[::sub]) for name, x in grid._asdict().items()}
    v = _nodes(weights, airspeed)
    density = 2.0 * float(grid.qbar_pa[::sub].sum() / (measured**2).sum())
    nodes |= {"airspeed_m_s": v, "qbar_pa": 0.5 * density * v * v}
    nodes |= dict.fromkeys(coefficients_of(grid), np.zeros(cells + 1))
    points = zip(*(nodes[name].tolist() for name in grid._fields), strict=True)
    air = tuple(equations_of_grid(grid).point(*point) for point in points)
    return Schedule(tuple(_nodes(weights, flow_rad).tolist()), air, lower, share)


def _nodes(weights: Array, x: Array) -> Array:
    """Means of samples near each node, which no single angle of attack decides; at a node that none is near, of all samples."""
    near = weights + 1e-9
    return np.asarray((near * x[:, None]).sum(axis=0) / near.sum(axis=0))


__all__ = ["RATIO", "UNSCHEDULED", "Schedule", "schedule"]
