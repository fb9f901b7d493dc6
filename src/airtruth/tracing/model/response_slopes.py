"""Derivatives of the innovations of a record in the parameters, along its nominal flight."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airtruth.tracing.model.corners import Corners
from airtruth.tracing.model.equation_slopes import AircraftMoves
from airtruth.tracing.model.equations import PLAY
from airtruth.tracing.model.filter import initial_state, innovations, path_of
from airtruth.tracing.model.flight_slopes import Moved, innovation_slopes, width_of
from airtruth.tracing.model.gain_slopes import Conditions, Moves, conditions
from airtruth.tracing.model.gains_along import slopes_along
from airtruth.tracing.model.kernel_input import KernelInput
from airtruth.tracing.model.linearise import FirstUpdate
from airtruth.tracing.model.response import LOST, FilterInputs, Response, kernel_input, respond_to
from airtruth.tracing.model.settings import Settings
from airtruth.tracing.model.slopes import has_slopes, moves_of, moving
from airtruth.tracing.model.steady import Condition, common_of, conditions_of, equilibrium, joined

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_SHARE: Final = 0.01
"""Step of the differences of gains over that of differences of flights [-]; judgement: the linearisation moves linearly with it,
so that curvature counts a tenth, and rounding is 1e-8 of the derivatives."""


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
    """Sensors' noise after small steps of the parameters (parameters + 1, outputs), and its derivatives.

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

    Correlated noise that is absent adds states once it is there, and a play has no slope where it reverses.
    """
    model = kernel.model
    if not has_slopes(model) or (model.effects.state_index[:, 0] == PLAY).any():
        return wanted[:0]
    shares = settings.layout.common.colour_shares
    absent = np.arange(shares.start, shares.stop)[common[shares] <= 0.0]
    return wanted[~np.isin(wanted, absent)]


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
    aircraft = moves_of(kernel.model)(given.record.pitch_plant, given.compiled, common, kernel.model.gusts.rolloff)
    noise = _noise(kernel, settings, common, parameters)
    moves, column = _moves(settings, noise, parameters)
    uncertain = kernel.corner_rad2.size > 0
    nodes = [
        conditions(
            equilibrium(alpha, air, kernel.model),
            air,
            kernel.model,
            aircraft,
            column.size,
            moves,
            kernel.dt_s,
            uncertain,
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
    gains, more_slopes = slopes_along(nodes, at, moves, steady.lower, steady.share, kernel.corner_rad2)
    own = _moved(kernel, settings, parameters, aircraft, noise, column)
    slopes = innovation_slopes(kernel, own, path, gains, steady.shown)
    h = np.where(moved, moves.h, 1.0)[1:, None, None]
    covariance = nodes[at].covariance
    by_covariance = np.where(moved[1:, None, None], (covariance[1:] - covariance[0]) / h, 0.0)
    e = e[given.lead :]
    response = Response(e, steady.white, steady.covariance, steady.logdet + more / len(e), more, steady)
    by_e = np.ascontiguousarray(np.moveaxis(slopes[given.lead :, :, : parameters.size], 2, 0))
    return response, ResponseSlopes(parameters, by_e, by_covariance, more_slopes)


def _moves(settings: Settings, noise: _Noise, parameters: Ints) -> tuple[Moves, Ints]:
    """Small steps of the parameters that move gains, and the number of each mover among the parameters; -1 for none."""
    entries, own = settings.layout.common, settings.layout.per_record
    number = np.full(entries.size + own.size, -1, dtype=np.int64)
    number[parameters] = np.arange(parameters.size)
    movers = moving(settings.layout, 0)
    column = number[movers]
    moves_gain = np.append(np.ones(entries.size), np.zeros(own.size))
    moves_gain[entries.size + own.log_gust] = 1.0
    step = _SHARE * np.append(entries.step, own.step) * moves_gain
    of_row = np.full(parameters.size + 1, -1, dtype=np.int64)
    for q in np.flatnonzero(column >= 0):
        # the trim moves the motion and no gain
        if moves_gain[movers[q]]:
            of_row[1 + column[q]] = q
    h = np.append(0.0, step[parameters])
    return Moves(h, of_row, noise.variance, noise.slow_std, noise.slow_time_s), column


def _noise(kernel: KernelInput, settings: Settings, common: Array, parameters: Ints) -> _Noise:
    """Steps of the sensors' noise, see `airtruth.tracing.model.response.pack_sensors`."""
    entries, sensors = settings.layout.common, kernel.model.sensors
    rows, count = parameters.size + 1, sensors.scale.size
    made = _Noise(
        np.tile(sensors.variance, (rows, 1)),
        np.tile(sensors.slow_std, (rows, 1)),
        np.full(rows, sensors.slow_time_s),
        np.zeros((count, parameters.size)),
        np.zeros(parameters.size),
    )
    white, share = sensors.variance - settings.resolution**2, common[entries.colour_shares]
    for p, index in enumerate(parameters):
        h = _SHARE * entries.step[index] if index < entries.size else 0.0
        if entries.log_noise.start <= index < entries.log_noise.stop:
            i = index - entries.log_noise.start
            made.variance[p + 1, i] += white[i] * np.expm1(2.0 * h)
            made.slow_std[p + 1, i] *= np.exp(h)
            made.d_slow_std[i, p] = sensors.slow_std[i]
        elif entries.colour_shares.start <= index < entries.colour_shares.stop:
            i = index - entries.colour_shares.start
            variance = sensors.slow_std[i] ** 2 / share[i]
            made.variance[p + 1, i] -= variance * h
            made.slow_std[p + 1, i] *= np.sqrt(1.0 + h / share[i])
            made.d_slow_std[i, p] = 0.5 * sensors.slow_std[i] / share[i]
        elif index == entries.log_colour_time:
            made.slow_time_s[p + 1] *= np.exp(h)
            ratio = kernel.dt_s / sensors.slow_time_s
            made.d_forget[p] = ratio * np.exp(-ratio)
    return made


def _condition(own: Conditions, moves: Moves) -> Condition:
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
    return Condition(
        own.k_gain[0], first, own.white[0], own.covariance[0], float(own.logdet[0]), corners, own.direct[0]
    )


def _moved(
    kernel: KernelInput, settings: Settings, parameters: Ints, aircraft: AircraftMoves, noise: _Noise, column: Ints
) -> Moved:
    """What the parameters move beside the gains."""
    entries, own, spare = settings.layout.common, settings.layout.per_record, parameters.size
    n, count = kernel.model.states.size, kernel.model.sensors.scale.size
    start, bias = np.zeros((n, width_of(spare))), np.full(count, spare, dtype=np.int64)
    slow_std, forget = np.zeros((count, start.shape[1])), np.zeros(start.shape[1])
    slow_std[:, :spare], forget[:spare] = noise.d_slow_std, noise.d_forget
    at_rest = initial_state(kernel)
    for p, index in enumerate(parameters - entries.size):
        if 0 <= index < own.start.stop:
            # the initial state is linear in it
            shifted = kernel._replace(start=kernel.start + np.eye(kernel.start.size)[index])
            start[:, p] = initial_state(shifted) - at_rest
        elif own.bias.start <= index < own.bias.stop:
            bias[index - own.bias.start] = p
    return Moved(aircraft, np.where(column < 0, spare, column), bias, slow_std, forget, start)


__all__ = ["ResponseSlopes", "respond_with_slopes"]
