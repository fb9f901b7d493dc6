"""The steady filter of a record: its linearisations, their gains, and the innovations that it expects.

Source: R. E. Maine and K. W. Iliff, NASA RP-1138 (1985), for the filter.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airtruth.tracing.model.by_motion import equations_of
from airtruth.tracing.model.corners import CornerNodes, Corners, input_columns, spread_of, stack, stacked
from airtruth.tracing.model.kernel_input import AnyPoint, FilterModel, KernelInput
from airtruth.tracing.model.linearise import (
    FirstUpdate,
    discrete,
    gain_of,
    linearise,
    process_intensity,
)
from airtruth.tracing.model.schedule import UNSCHEDULED, Schedule

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


_NONE: Final = np.zeros((0, 0))
"""A matrix that is not used."""
_CERTAIN: Final = stacked([Corners(_NONE, _NONE, _NONE[None], _NONE, _NONE, np.zeros(0), _NONE, _NONE, 0.0)])
"""The recursion of a surface that is known everywhere."""


class SteadyFilter(NamedTuple):
    """Gains of the filter along a record, and the innovations that it expects.

    Attributes
    ----------
    k_gain : (nodes, states, outputs) of the update at each flight condition; first : the part of it that the early outputs
        have alone, stacked likewise.
    scale : (nodes, outputs, outputs) lower triangular, from the innovations of a condition to those of the common one, whose
        airspeed is nearest to the mean.
    white, covariance : (outputs, outputs) whitener W with W S W' = I, and S, of the common condition; logdet : log|S|.
    corners : recursion where the surface is uncertain.
    direct : (nodes, states) slope of the late output at the CG's accelerometer before its lag and delay.
    shown : share of a change of the late output since the last sample that its reading shows [-].
    lower, share : see `airtruth.tracing.model.schedule.Schedule`; empty with a single node.
    """

    k_gain: Array
    first: FirstUpdate
    scale: Array
    white: Array
    covariance: Array
    logdet: float
    corners: CornerNodes
    direct: Array
    shown: float
    lower: Ints
    share: Array


class SteadyCondition(NamedTuple):
    """The filter at one flight condition; attributes as of `SteadyFilter`, without nodes.

    It has no corners where the surface is known.
    """

    k_gain: Array
    first: FirstUpdate
    white: Array
    covariance: Array
    logdet: float
    corners: Corners | None
    direct: Array


def steady_filter(given: KernelInput, along: Schedule) -> SteadyFilter | None:
    """The steady filter of a record; None where its innovations have no covariance.

    It depends on neither the initial state, nor the biases, nor the trim.
    """
    nodes = [_at(given, *point) for point in conditions_of(given, along)]
    sound = [node for node in nodes if node is not None]
    return joined(given, sound, along) if len(sound) == len(nodes) else None


def conditions_of(given: KernelInput, along: Schedule) -> list[tuple[float, AnyPoint]]:
    """Flow angle and inputs at the flight conditions of a record."""
    if not along.flow_rad:
        return [(given.reference_flow_rad, given.reference)]
    return list(zip(along.flow_rad, along.air, strict=True))


def common_of(given: KernelInput, along: Schedule) -> int:
    """Number of the flight condition whose airspeed is nearest to the mean."""
    away = [abs(air.airspeed_m_s - given.reference.airspeed_m_s) for _, air in conditions_of(given, along)]
    return away.index(min(away))


def joined(given: KernelInput, nodes: Sequence[SteadyCondition], along: Schedule) -> SteadyFilter:
    """The filters of the flight conditions as one."""
    common, scale = nodes[0], _unit(given.model)
    if len(nodes) > 1:
        common = nodes[common_of(given, along)]
        root, unit = np.linalg.inv(common.white), scale[0]
        scale = np.array([unit if node is common else np.tril(root @ node.white) for node in nodes])
    sensors = given.model.sensors
    corners = [node.corners for node in nodes if node.corners is not None]
    return SteadyFilter(
        k_gain=stack([node.k_gain for node in nodes]),
        first=FirstUpdate(
            stack([node.first.gain for node in nodes]), stack([node.first.share for node in nodes])
        ),
        scale=scale,
        white=common.white,
        covariance=common.covariance,
        logdet=common.logdet,
        corners=stacked(corners) if corners else _CERTAIN,
        direct=stack([node.direct for node in nodes]),
        shown=_shown(float(sensors.lag_s[-1]), float(sensors.delay_s[-1]), given.dt_s),
        lower=along.lower,
        share=along.share,
    )


def _unit(model: FilterModel) -> Array:
    """Scale of a single flight condition."""
    return np.eye(model.sensors.scale.size)[None]


def _at(given: KernelInput, flow_rad: float, air: AnyPoint) -> SteadyCondition | None:
    """The filter at one flight condition; None where its innovations have no covariance."""
    model = given.model
    n = model.states.size
    a, c = np.empty((n, n)), np.empty((model.sensors.scale.size, n))
    x = equilibrium(flow_rad, air, model)
    direct = linearise(x, air, model, a, c)
    phi, noise = discrete(a, process_intensity(air.airspeed_m_s, model), given.dt_s)
    k_gain, white, covariance, logdet, p, first = gain_of(phi, c, noise, model.sensors.variance)
    if not math.isfinite(logdet):
        return None
    corners = None
    if given.corner_rad2.size > 0:
        columns = input_columns(x, air, model, len(given.corner_rad2))
        spread = np.stack([spread_of(a, column, given.dt_s) for column in columns])
        root = np.asarray(np.linalg.inv(white))
        corners = Corners(phi, noise, spread, p, c, model.sensors.variance, covariance, root, logdet)
    return SteadyCondition(k_gain, first, white, covariance, logdet, corners, direct)


def _shown(lag_s: float, delay_s: float, dt_s: float) -> float:
    """Share of a ramp over one sample period that a lag and a delay show at its end [-]."""
    ratio = lag_s / dt_s
    behind = ratio * -math.expm1(-1.0 / ratio) if ratio > 0.0 else 0.0
    return (1.0 - behind) * max(0.0, 1.0 - delay_s / dt_s)


def without_update(model: FilterModel) -> SteadyFilter:
    """The filter of a free run, whose state no measurement corrects."""
    n, unit = model.states.size, _unit(model)
    count = len(unit[0])
    return SteadyFilter(
        k_gain=np.zeros((1, n, count)),
        first=FirstUpdate(np.zeros((1, n, count - 1)), np.zeros((1, count - 1))),
        scale=unit,
        white=unit[0],
        covariance=unit[0],
        logdet=0.0,
        corners=_CERTAIN,
        direct=np.zeros((1, n)),
        shown=1.0,
        lower=UNSCHEDULED.lower,
        share=UNSCHEDULED.share,
    )


def equilibrium(flow_rad: float, air: AnyPoint, model: FilterModel) -> Array:
    """(states,) at a flow angle, effects' states in equilibrium with it."""
    x = np.zeros(model.states.size)
    x[0] = flow_rad
    equations_of(model).settle(x, air, model)
    return x


def linearise_at_reference(given: KernelInput, a: Array, c: Array) -> Array:
    """`linearise` at the record's mean, effects' states in equilibrium with it."""
    x = equilibrium(given.reference_flow_rad, given.reference, given.model)
    return linearise(x, given.reference, given.model, a, c)


__all__ = [
    "SteadyCondition",
    "SteadyFilter",
    "common_of",
    "conditions_of",
    "equilibrium",
    "joined",
    "linearise_at_reference",
    "steady_filter",
    "without_update",
]
