"""Side force, rolling and yawing moment of an aircraft as a sum of tables, from JSBSim's response in six axes.

The forces over the angle of attack and the five signals of the motion are

    f(alpha, beta) + sum over p, r, aileron, rudder of [f(alpha, signal) - f(alpha, trim)],

each table at the trim's values of the other signals. A table of all six would need a thousand times as many states; the
products of two signals that the sum lacks are those that `airtruth.tracing.model.plant` states.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.physics.motion import LATERAL
from airtruth.simulation.manoeuvres import LATERAL_CONTROLS
from airtruth.simulation.probe import HeldStates, with_breaks_of
from airtruth.simulation.simulator import Executive
from airtruth.simulation.trim import Trim
from airtruth.units import FT, LBF

Array = NDArray[np.float64]

FORCES: Final = ("forces/fby-total-lbs", "moments/l-total-lbsft", "moments/n-total-lbsft")
"""Side force [lbf], rolling and yawing moment about the CG [lbf ft], without gravity."""
_UNITS: Final = np.array([LBF, LBF * FT, LBF * FT])
"""Factors of `FORCES` to N and N m."""
_SAME_SURFACE_RAD: Final = 1e-6
"""Largest difference of a surface from where it is wanted [rad] (rounding)."""
_HOLDS: Final = 12
"""Largest number of commands that hold the surfaces against feedback [-] (judgement: each reduces the error tenfold)."""


@dataclass(frozen=True)
class LateralForceGrid:
    """States to evaluate; the trim's own value is added to each axis.

    Attributes
    ----------
    alpha_rad : (alpha,) angle of attack [rad].
    signals : beta [rad], p, r [rad/s], aileron and rudder surface [rad], in the order of the motion; (points,) each.
    ratios : airspeed over that of the trim, of the forces that do not go with the dynamic pressure (speeds,) [-].
    """

    alpha_rad: Array
    signals: tuple[Array, ...]
    ratios: Array


@dataclass(frozen=True)
class LateralTables:
    """Forces and moments of the aircraft at the trim's airspeed.

    Attributes
    ----------
    alpha_rad : (alpha,) [rad]; signals : (points,) of each signal, breaks added, as in `LateralForceGrid`.
    values : (signals,) of (alpha, points, 3) Y [N], L and N [N m] over each signal, the others at the trim.
    over_alpha : (speeds, alpha, 3) at the trim's signals and other airspeeds.
    """

    alpha_rad: Array
    signals: tuple[Array, ...]
    values: tuple[Array, ...]
    over_alpha: Array


class LateralStates:
    """Forces and moments in states off a trim in six axes."""

    def __init__(self, aircraft: Aircraft, trim: Trim, dt_s: float = 1.0 / 200.0) -> None:
        self.trim = trim
        executive = Executive(aircraft, dt_s)
        self.model = executive.model
        self._forces = executive.nodes(FORCES)
        self._states = HeldStates(executive, trim)

    @property
    def origin(self) -> Array:
        """(5,) beta [rad], p, r [rad/s], aileron and rudder [rad] of the trim."""
        surfaces = (self.trim.surfaces_rad[name] for name in LATERAL_CONTROLS)
        return np.array([self.trim.controls.sideslip_rad, 0.0, 0.0, *surfaces])

    def at(self, alpha_rad: float, signals: Array, ratio: float = 1.0) -> Array:
        """(3,) Y [N], L and N [N m] with the surfaces where they are wanted, or at the end of their range.

        Parameters
        ----------
        signals : (5,) as `origin`; ratio : airspeed over that of the trim [-].
        """
        beta, *rates = map(float, signals[:3])
        wanted = signals[3:]
        held, condition = self.trim.controls, self.trim.condition
        if ratio != 1.0:
            condition = replace(condition, eas_m_s=condition.eas_m_s * ratio)
        command = np.array([held.command(name) for name in LATERAL_CONTROLS]) + wanted - self.origin[3:]
        for _ in range(_HOLDS):
            controls = held.moved(
                dict(zip(LATERAL_CONTROLS, command.tolist(), strict=True)), sideslip_rad=beta
            )
            answer = self._states.respond(
                condition, alpha_rad, controls, dict(zip(LATERAL.gyros, rates, strict=True))
            )
            error = wanted - np.array([answer.surfaces_rad[name] for name in LATERAL_CONTROLS])
            if np.abs(error).max() < _SAME_SURFACE_RAD:
                break
            command = command + error
        return np.asarray(np.array([node.get_double_value() for node in self._forces]) * _UNITS)


def probe_lateral(aircraft: Aircraft, trim: Trim, grid: LateralForceGrid) -> LateralTables:
    """Tabulate the lateral forces and moments at the trim's throttle, elevator and altitude.

    Parameters
    ----------
    aircraft, trim : the aircraft and its equilibrium in six axes.
    grid : states to evaluate; breaks of the forces over each signal are added, and those over the angle of attack at the
        ends of the signals' ranges.
    """
    states = LateralStates(aircraft, trim)
    signals = tuple(
        with_breaks_of(_along(states, number), _with(axis, float(origin)))
        for number, (axis, origin) in enumerate(zip(grid.signals, states.origin, strict=True))
    )
    ends = [
        _moved(states, number, float(x)) for number, axis in enumerate(signals) for x in (axis[0], axis[-1])
    ]
    alphas = with_breaks_of(
        lambda alpha: np.concatenate([states.at(alpha, end) for end in ends]),
        _with(grid.alpha_rad, trim.alpha_rad),
    )
    values = []
    for number, axis in enumerate(signals):
        rows = [[states.at(float(a), _moved(states, number, float(x))) for x in axis] for a in alphas]
        values.append(np.array(rows))
    over = [[states.at(float(a), states.origin, float(v)) for a in alphas] for v in grid.ratios]
    return LateralTables(alphas, signals, tuple(values), np.array(over))


def lateral_forces(aircraft: Aircraft, trim: Trim, alpha_rad: Array, signals: Array) -> Array:
    """(states, 3) Y [N], L and N [N m] in any states, to check tables.

    Parameters
    ----------
    alpha_rad : (states,) [rad]; signals : (states, 5) as of `LateralStates.origin`.
    """
    states = LateralStates(aircraft, trim)
    return np.array([states.at(float(a), row) for a, row in zip(alpha_rad, signals, strict=True)])


def _moved(states: LateralStates, number: int, value: float) -> Array:
    signals = states.origin
    signals[number] = value
    return signals


def _along(states: LateralStates, number: int) -> Callable[[float], Array]:
    """Forces and moments over one signal at the trim's angle of attack."""
    return lambda value: states.at(states.trim.alpha_rad, _moved(states, number, value))


def _with(axis: Array, value: float) -> Array:
    """The axis and one value more, unless a point is there already."""
    kept = axis[np.abs(axis - value) > 1e-9 * (1.0 + abs(value))]
    return np.sort(np.append(kept, value))


__all__ = ["FORCES", "LateralForceGrid", "LateralStates", "LateralTables", "lateral_forces", "probe_lateral"]
