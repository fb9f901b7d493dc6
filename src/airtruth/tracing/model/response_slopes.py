"""Derivatives of the innovations of a record in the parameters, along its nominal flight."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airtruth.tracing.model.corners import Corners
from airtruth.tracing.model.effect_states import PLAY
from airtruth.tracing.model.filter import initial_state, innovations, path_of
from airtruth.tracing.model.flight_slopes import innovation_slopes
from airtruth.tracing.model.gain_slopes import Conditions, Moves, conditions
from airtruth.tracing.model.gains_along import slopes_along
from airtruth.tracing.model.kernel_input import KernelInput
from airtruth.tracing.model.lateral.slopes import LateralMoves
from airtruth.tracing.model.linearise import FirstUpdate
from airtruth.tracing.model.longitudinal.slopes import AircraftMoves
from airtruth.tracing.model.parameters import ParameterLayout
from airtruth.tracing.model.response import LOST, FilterInputs, Response, kernel_input, respond_to
from airtruth.tracing.model.sensor_slopes import Moved, width_of
from airtruth.tracing.model.settings import Settings
from airtruth.tracing.model.slopes import has_slopes, moves_of, moving
from airtruth.tracing.model.steady import SteadyCondition, common_of, conditions_of, equilibrium, joined

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_SHARE: Final = 0.001
"""Step of the differences of gains over that of differences of flights [-]; judgement: the linearisation moves linearly with it,
so that curvature counts a hundredth of what it does in a flight, and rounding is 1e-7 of the derivatives."""


class ResponseSlopes(NamedTuple):
    """Derivatives of a `Response`.

    Attributes
    ----------
    parameters : indices in a vector of the common parameters and those of the record.
    e : (parameters, samples, outputs) of the innovations.
    covariance : (parameters, outputs, outputs); more_logdet : (parameters,).
    """

    parameters: Ints
    e: Array
    covariance: Array
    more_logdet: Array


NO_SLOPES: Final = ResponseSlopes(np.zeros(0, dtype=np.int64), *(np.zeros((0, 0, 0)) for _ in range(3)))
"""No derivatives."""


class _Noise(NamedTuple):
    """Sensors' noise after small steps of the parameters, and its derivatives.

    Attributes
    ----------
    variance, slow_std, slow_time_s : see `airtruth.tracing.model.gain_slopes.Moves`.
    d_slow_std, d_forget : see `airtruth.tracing.model.flight_slopes.Moved`.
    """

    variance: Array
    slow_std: Array
    slow_time_s: Array
    d_slow_std: Array
    d_forget: Array


def _sloped(kernel: KernelInput, settings: Settings, common: Array, wanted: Ints) -> Ints:
    """The parameters that have derivatives along the nominal flight.

    Correlated noise that is absent adds states once it is there, a play has no slope where it reverses, and no motion states that
    in the mean gust.
    """
    model = kernel.model
    if not has_slopes(model) or (model.effects.state_index[:, 0] == PLAY).any():
        return wanted[:0]
    shares = settings.layout.common.colour_shares
    absent = np.arange(shares.start, shares.stop)[common[shares] <= 0.0]
    gust = common.size + np.arange(settings.layout.per_record.size)[settings.layout.per_record.mean_gust]
    return wanted[~np.isin(wanted, [*absent, *gust])]


def respond_with_slopes(
    given: FilterInputs, settings: Settings, common: Array, per_record: Array, wanted: Ints
) -> tuple[Response, ResponseSlopes | None]:
    """`airtruth.tracing.model.response.respond_to`, and its derivatives; None where the motion is lost.

    Parameters
    ----------
    common, per_record : see `CommonEntries` and `RecordEntries`.
    wanted : parameters in which it is differentiated where the motion states its derivatives, as indices in a vector of the
        common parameters and those of the record.
    """
    kernel = kernel_input(given, settings, common, per_record)
    parameters = _sloped(kernel, settings, common, wanted)
    if parameters.size == 0:
        return respond_to(given, settings, common, per_record), NO_SLOPES
    samples, count = kernel.y.shape
    e, none = np.full_like(kernel.y, LOST), np.eye(count)
    lost = Response(e[given.lead :], none, none, np.nan)
    aircraft = moves_of(kernel.model)(given.record, given.compiled, common, kernel.model.gusts.rolloff)
    places = _places(settings.layout, tuple(parameters.tolist()))
    noise = _noise(kernel, settings, common, places)
    moves = Moves(places.h, places.of_row, noise.variance, noise.slow_std, noise.slow_time_s)
    controls = len(kernel.corner_rad2) if kernel.corner_rad2.size else 0
    nodes = [
        conditions(
            equilibrium(alpha, air, kernel.model),
            air,
            kernel.model,
            aircraft,
            places.column.size,
            moves,
            kernel.dt_s,
            controls,
        )
        for alpha, air in conditions_of(kernel, given.along)
    ]
    moved = np.append(True, moves.h[1:] != 0.0)
    if not all(np.isfinite(node.logdet[moved]).all() for node in nodes):
        return lost, None
    steady = joined(kernel, [_condition(node, moves) for node in nodes], given.along)
    path = path_of(samples, kernel.model.states.size, count)
    sound, more = innovations(kernel, steady, e, path)
    if not sound:
        return lost, None
    at = common_of(kernel, given.along)
    gains, more_slopes = slopes_along(
        nodes, at, moves, samples, steady.lower, steady.share, kernel.corner_rad2
    )
    own = _moved(kernel, aircraft, noise, places)
    slopes = innovation_slopes(kernel, own, path, gains, steady.shown)
    h = np.where(moved, moves.h, 1.0)[1:, None, None]
    covariance = nodes[at].covariance
    by_covariance = np.where(moved[1:, None, None], (covariance[1:] - covariance[0]) / h, 0.0)
    e = e[given.lead :]
    response = Response(e, steady.white, steady.covariance, steady.logdet + more / len(e), more, steady)
    by_e = np.ascontiguousarray(np.moveaxis(slopes[given.lead :, :, : parameters.size], 2, 0))
    return response, ResponseSlopes(parameters, by_e, by_covariance, more_slopes)


@dataclass(frozen=True)
class _Places:
    """Where the parameters that a record is differentiated in are.

    Attributes
    ----------
    h : (parameters + 1,) small steps of those that move gains, else zero.
    column : (movers,) number of each among the parameters; -1 for none.
    of_row : (parameters + 1,) number of the mover; -1 for none.
    noise, colour, time : (parameter, output) of each logarithm of the noise, each share of correlated noise, and the correlation
        time.
    start, bias : (parameter, number) of the initial state and of the biases.
    """

    h: Array
    column: Ints
    of_row: Ints
    noise: tuple[tuple[int, int], ...]
    colour: tuple[tuple[int, int], ...]
    time: tuple[tuple[int, int], ...]
    start: tuple[tuple[int, int], ...]
    bias: tuple[tuple[int, int], ...]


@lru_cache
def _places(layout: ParameterLayout, parameters: tuple[int, ...]) -> _Places:
    entries, own = layout.common, layout.per_record
    number = {index: p for p, index in enumerate(parameters)}
    movers, level = moving(layout, 0).tolist(), entries.size + own.log_gust
    h, of_row = np.zeros(len(parameters) + 1), np.full(len(parameters) + 1, -1, dtype=np.int64)
    for index, p in number.items():
        # of what a record has for itself, the level alone moves gains
        if index < entries.size or index == level:
            h[p + 1] = _SHARE * np.append(entries.step, own.step)[index]
            of_row[p + 1] = movers.index(index) if index in movers else -1

    def span(first: int, part: slice) -> tuple[tuple[int, int], ...]:
        places = range(first + part.start, first + part.stop)
        return tuple((number[at], i) for i, at in enumerate(places) if at in number)

    return _Places(
        h=h,
        column=np.array([number.get(index, -1) for index in movers], dtype=np.int64),
        of_row=of_row,
        noise=span(0, entries.log_noise),
        colour=span(0, entries.colour_shares),
        time=span(0, slice(entries.log_colour_time, entries.log_colour_time + 1)),
        start=span(entries.size, own.start),
        bias=span(entries.size, own.bias),
    )


def _noise(kernel: KernelInput, settings: Settings, common: Array, places: _Places) -> _Noise:
    """Steps of the sensors' noise, see `airtruth.tracing.model.response.pack_sensors`."""
    sensors, rows, h = kernel.model.sensors, places.h.size, places.h
    width, count = width_of(rows - 1), sensors.scale.size
    made = _Noise(
        np.tile(sensors.variance, (rows, 1)),
        np.tile(sensors.slow_std, (rows, 1)),
        np.full(rows, sensors.slow_time_s),
        np.zeros((count, width)),
        np.zeros(width),
    )
    share = common[settings.layout.common.colour_shares]
    for p, i in places.noise:
        white = sensors.variance[i] - settings.resolution[i] ** 2
        made.variance[p + 1, i] += white * math.expm1(2.0 * h[p + 1])
        made.slow_std[p + 1, i] *= math.exp(h[p + 1])
        made.d_slow_std[i, p] = sensors.slow_std[i]
    for p, i in places.colour:
        made.variance[p + 1, i] -= sensors.slow_std[i] ** 2 / share[i] * h[p + 1]
        made.slow_std[p + 1, i] *= math.sqrt(1.0 + h[p + 1] / share[i])
        made.d_slow_std[i, p] = 0.5 * sensors.slow_std[i] / share[i]
    for p, _ in places.time:
        ratio = kernel.dt_s / sensors.slow_time_s
        made.slow_time_s[p + 1] *= math.exp(h[p + 1])
        made.d_forget[p] = ratio * math.exp(-ratio)
    return made


def _condition(own: Conditions, moves: Moves) -> SteadyCondition:
    """The filter at one flight condition before the steps."""
    corners = None
    if own.spread.size:
        root = np.asarray(np.linalg.inv(own.white[0]))
        corners = Corners(
            own.phi[0],
            own.noise[0],
            own.spread[0],
            own.steady[0],
            own.c[0],
            moves.variance[0],
            own.covariance[0],
            root,
            float(own.logdet[0]),
        )
    first = FirstUpdate(own.first.gain[0], own.first.share[0])
    return SteadyCondition(
        own.k_gain[0], first, own.white[0], own.covariance[0], float(own.logdet[0]), corners, own.direct[0]
    )


def _moved(
    kernel: KernelInput, aircraft: AircraftMoves | LateralMoves, noise: _Noise, places: _Places
) -> Moved:
    """Derivatives in the parameters of everything but the gains."""
    spare, n, count = places.h.size - 1, kernel.model.states.size, kernel.model.sensors.scale.size
    start, bias = np.zeros((n, width_of(spare))), np.full(count, spare, dtype=np.int64)
    at_rest, none = initial_state(kernel, np.zeros(kernel.start.size)), np.zeros(kernel.start.size)
    for p, i in places.start:
        none[i] = 1.0
        start[:, p] = initial_state(kernel, none) - at_rest  # it is linear
        none[i] = 0.0
    for p, i in places.bias:
        bias[i] = p
    column = np.where(places.column < 0, spare, places.column)
    return Moved(aircraft, column, bias, noise.d_slow_std, noise.d_forget, start)


__all__ = ["ResponseSlopes", "respond_with_slopes"]
