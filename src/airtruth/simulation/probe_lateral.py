"""Side force, rolling and yawing moment of an aircraft as a sum of tables, from JSBSim's response in six axes.

The forces over the angle of attack and the five signals of the motion are

    f(alpha, beta) + sum over p, r, aileron, rudder of [f(alpha, signal) - f(alpha, trim)],

each table at the trim's values of the other signals. A table of all six would need a thousand times as many states; the
products of two signals that the sum lacks are those that `airtruth.tracing.model.plant` states.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.physics.motion import LATERAL, LONGITUDINAL
from airtruth.simulation.probe import ForceGrid, HeldStates, with_breaks_of, with_point, with_surfaces
from airtruth.simulation.simulator import Executive
from airtruth.simulation.trim import Trim
from airtruth.units import FT, LBF

Array = NDArray[np.float64]

FORCES: Final = ("forces/fby-total-lbs", "moments/l-total-lbsft", "moments/n-total-lbsft")
"""Side force [lbf], rolling and yawing moment about the CG [lbf ft], without gravity."""
FRAMES: Final = 50
"""Frames of JSBSim for which filters and engines settle in one state [-] (`airtruth.simulation.probe`)."""
_PITCH_FORCES: Final = ("forces/fbz-total-lbs", "moments/m-total-lbsft")
"""Force along body z [lbf] and pitching moment about the CG [lbf ft], without gravity."""
_UNITS: Final = {"lbs": LBF, "lbsft": LBF * FT}
"""End of a property -> factor to N or N m."""


@dataclass(frozen=True)
class LateralTables:
    """Forces and moments of the aircraft at the trim's airspeed.

    Attributes
    ----------
    axes : (points,) of the angle of attack and of each signal of the motion, breaks added [rad], [rad/s].
    values : (signals,) of (alpha, points, 3) Y [N], L and N [N m] over each signal, the others at the trim.
    over_alpha : (speeds, alpha, 3) at the trim's signals and other airspeeds.
    """

    axes: tuple[Array, ...]
    values: tuple[Array, ...]
    over_alpha: Array


class LateralStates:
    """Forces and moments in states off a trim in six axes; ``forces``: their properties."""

    def __init__(
        self, aircraft: Aircraft, trim: Trim, dt_s: float = 1.0 / 200.0, forces: Sequence[str] = FORCES
    ) -> None:
        self.trim = trim
        executive = Executive(aircraft, dt_s)
        self.model = executive.model
        self._forces = executive.nodes(forces)
        self._units = np.array([_UNITS[name.rpartition("-")[2]] for name in forces])
        self._states = HeldStates(executive, trim)

    @property
    def origin(self) -> Array:
        """(signals,) of the trim [rad], [rad/s]."""
        return self.trim.origin(LATERAL)

    def at(self, attack_rad: float, signals: Array, ratio: float = 1.0) -> Array:
        """(forces,) Y [N], L and N [N m] unless others were asked for; the surfaces are where they are wanted, or at the end of
        their range.

        Parameters
        ----------
        signals : as `origin`; ratio : airspeed over that of the trim [-].
        """
        held, condition = self.trim.controls, self.trim.condition
        if ratio != 1.0:
            condition = replace(condition, eas_m_s=condition.eas_m_s * ratio)
        motion = dict(zip((s.channel for s in LATERAL.signals), signals.tolist(), strict=True))
        wanted = {c.name: motion.pop(c.channel) for c in LATERAL.controls}
        commands = {n: held.command(n) + x - self.trim.surfaces_rad[n] for n, x in wanted.items()}
        controls = held.moved(commands, **motion, **{LONGITUDINAL.vane: attack_rad})
        with_surfaces(lambda moved: self._states.respond(condition, moved), controls, wanted)
        return np.asarray(np.array([node.get_double_value() for node in self._forces]) * self._units)

    def each(self, attack_rad: Array, signals: Array) -> Array:
        """(states, forces) as `at`, of angles of attack (states,) and signals (states, signals)."""
        return np.array([self.at(float(a), row) for a, row in zip(attack_rad, signals, strict=True)])


def probe_lateral(aircraft: Aircraft, trim: Trim, grid: ForceGrid) -> LateralTables:
    """Tabulate the lateral forces and moments at the trim's throttle, elevator and altitude.

    Parameters
    ----------
    aircraft, trim : the aircraft and its equilibrium in six axes.
    grid : states to evaluate, the angle of attack first; breaks of the forces over each signal are added, and those over the
        angle of attack at the ends of the signals' ranges.
    """
    states = LateralStates(aircraft, trim)
    attack, *axes = grid.axes
    signals = [
        with_breaks_of(_along(states, number), with_point(axis, float(origin)))
        for number, (axis, origin) in enumerate(zip(axes, states.origin, strict=True))
    ]
    ends = [
        _moved(states, number, float(x)) for number, axis in enumerate(signals) for x in (axis[0], axis[-1])
    ]
    alphas = with_breaks_of(
        lambda alpha: np.concatenate([states.at(alpha, end) for end in ends]),
        with_point(attack, trim.alpha_rad),
    )
    values = []
    for number, axis in enumerate(signals):
        rows = [[states.at(float(a), _moved(states, number, float(x))) for x in axis] for a in alphas]
        values.append(np.array(rows))
    over = [[states.at(float(a), states.origin, float(v)) for a in alphas] for v in grid.airspeed]
    return LateralTables((alphas, *signals), tuple(values), np.array(over))


def lateral_forces(aircraft: Aircraft, trim: Trim, attack_rad: Array, signals: Array) -> Array:
    """(states, 3) Y [N], L and N [N m] in any states, to check tables.

    Parameters
    ----------
    attack_rad : (states,) [rad]; signals : (states, signals) as of `LateralStates.origin`.
    """
    return LateralStates(aircraft, trim).each(attack_rad, signals)


def pitch_forces(aircraft: Aircraft, trim: Trim, attack_rad: Array, signals: Array) -> Array:
    """(states, 2) what the lateral motion adds to Z [N] and M [N m], at the trim's elevator and no pitch rate.

    Parameters
    ----------
    attack_rad, signals : as of `lateral_forces`.
    """
    states = LateralStates(aircraft, trim, forces=_PITCH_FORCES)
    straight = np.tile(states.origin, (len(attack_rad), 1))
    return states.each(attack_rad, signals) - states.each(attack_rad, straight)


def _moved(states: LateralStates, number: int, value: float) -> Array:
    signals = states.origin
    signals[number] = value
    return signals


def _along(states: LateralStates, number: int) -> Callable[[float], Array]:
    """Forces and moments over one signal at the trim's angle of attack."""
    return lambda value: states.at(states.trim.alpha_rad, _moved(states, number, value))


__all__ = [
    "FORCES",
    "FRAMES",
    "LateralStates",
    "LateralTables",
    "lateral_forces",
    "pitch_forces",
    "probe_lateral",
]
