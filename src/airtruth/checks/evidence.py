"""Physical tests of a log: how far each relation between channels is from the one that physics requires.

Body axes, air at rest, here wings level (R. V. Jategaonkar, *Flight Vehicle System Identification*, 2006, chapter
10; `airtruth.checks.rotation` where bank, roll and yaw are recorded), with the specific forces ax, az and the flight-path
angle gamma = theta - alpha:

    theta' = q
    alpha' = q + (az cos(alpha) - ax sin(alpha) + g cos(gamma))/V
    u'     = ax - q w - g sin(theta),  u = V cos(alpha),  w = V sin(alpha)

Each test returns a squared distance: the squared deviation of an estimate from its required value over its
variance, which is the sum of the sampling variance and of a tolerance for what a faultless log may show
(positions and lags of sensors, biases, gusts). About 1 is expected of a faultless log.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.channels import BANK
from airtruth.checks.evidence_lateral import lateral
from airtruth.checks.excitation import LEAST_TURN_RAD, moves, swing
from airtruth.checks.factors import (
    WEAK,
    command_test,
    factor_test,
    follows_test,
    nearer,
    of_moving,
    sign_test,
)
from airtruth.checks.means import LEVEL, LIMITS, air, gravity, ranges
from airtruth.checks.relation import Relation
from airtruth.checks.rotation import across_flow, alpha_coupling, pitched
from airtruth.checks.slopes import CONTROL_POWER, slopes_near_trim
from airtruth.checks.spectra import Factors, instruments, integral, regress
from airtruth.checks.together import Runs
from airtruth.physics.motion import LATERAL, LONGITUDINAL
from airtruth.units import G0

Array = NDArray[np.float64]
Channels = Mapping[str, Array]


def relations(runs: Runs, aircraft: Aircraft | None = None) -> list[Relation]:
    """Every test that the channels allow.

    Without alpha, because none was measured, the tests that remain are those of theta, q, the accelerometers, the surfaces and
    the air; aerodynamic slopes are not compared.
    """
    runs = runs.without(*(name for name in runs.channels if name not in LIMITS))
    result = [*ranges(runs), *air(runs)]
    with np.errstate(all="ignore"):
        moved = motion(runs, aircraft)
        level = next((t.distance[:-1] < LEVEL for t in moved if t.name == "theta"), None)
        return [*result, *gravity(runs, level), *moved, *lateral(runs)]


THETA_STD: Final = 0.15
"""Tolerance of the factor of theta on the integral of q [-]: scale and lag of a gyroscope."""
ALPHA_STD: Final = (0.25, 0.25)
"""Tolerances of the factors of alpha on the integrals of q and of the vertical acceleration [-]."""


def motion(runs: Runs, aircraft: Aircraft | None) -> list[Relation]:
    """Changes of the channels against each other."""
    names = set(runs.channels)
    vane, control = LONGITUDINAL.vane, LONGITUDINAL.controls[0]
    surface, rate = control.channel, control.damped
    if not set(LONGITUDINAL.required) - {vane} <= names:
        return []
    lines = runs.lines()
    result = []
    if "theta_rad" in names:
        turned = runs.spectra(pitched)
        factors = regress(runs.spectra_of("theta_rad")[:, 0], turned[:, None], lines=lines)
        turning = (BANK, LATERAL.gyros[-1])
        banked = turning if names.issuperset(turning) else ()
        test = follows_test("theta", (rate, "theta_rad", *banked), factors, THETA_STD)
        result.append(of_moving(test, _pitches(runs)) if banked else test)
    if vane in names:
        result.append(_alpha_relation(runs, lines))
    if vane in names:
        causes = runs.integrals_of(surface, vane, rate)
    else:
        angle = runs.spectra(lambda c, dt_s: integral(_inertial_alpha(c, dt_s), dt_s))
        causes = np.insert(runs.integrals_of(surface, rate), 1, angle, axis=1)
    effect = regress(runs.spectra_of(rate)[:, 0], causes, lines=lines)
    result.append(sign_test(control.name, (surface, vane, rate), effect))
    if vane in names:
        result += slopes_near_trim(runs, aircraft)
    if control.command in names:
        result.append(command_test(runs, control))
    moving = runs.each(lambda c, dt_s: moves(c[surface], dt_s).astype(np.float64)) > 0.0
    return [of_moving(test, moving) if test.name in OF_ELEVATOR else test for test in result]


def _pitches(runs: Runs) -> NDArray[np.bool_]:
    """(runs,) whether the pitch attitude changes, by theta or by the rates: in a manoeuvre of roll or yaw it may not."""

    def changes(c: Channels, dt_s: float) -> Array:
        return np.asarray(np.maximum(swing(c["theta_rad"]), swing(pitched(c, dt_s))))

    return np.asarray(runs.each(changes) > LEAST_TURN_RAD)


def _rotated(c: Channels, dt_s: float) -> Array:
    """Change of alpha by rotation; without sideslip where none is known."""
    turned = integral(c[LONGITUDINAL.gyros[0]], dt_s)
    side = (*LATERAL.gyros, LATERAL.vane)
    if not c.keys() >= set(side):
        return turned
    p, r, beta = (c[name] for name in side)
    return turned + integral(alpha_coupling(p, r, c[LONGITUDINAL.vane], beta), dt_s)


def _inertial_alpha(c: Channels, dt_s: float) -> Array:
    """Change of alpha without a vane: the integral of q and of the vertical acceleration over the airspeed.

    A regression of q' on elevator and q alone gives the elevator the pitching moment of alpha, and with it the wrong sign.
    """
    pitch = pitched(c, dt_s)
    attitude = c.get("theta_rad", pitch)
    return pitch + integral(
        (c[LONGITUDINAL.outputs[-1].channel] + G0 * np.cos(attitude)) / c["airspeed_m_s"], dt_s
    )


def _alpha_relation(runs: Runs, lines: NDArray[np.int64]) -> Relation:
    """Alpha against the integrals of q and of the vertical acceleration, the elevator or its command as the instrument."""

    def heave(c: Channels, dt_s: float) -> Array:
        alpha, _, az = (c[name] for name in LONGITUDINAL.output_channels)
        theta = c.get("theta_rad")
        ax = c.get("ax_m_s2", np.zeros_like(az))
        pitch = pitched(c, dt_s)
        level = alpha.mean(axis=1, keepdims=True) - pitch.mean(axis=1, keepdims=True)
        attitude = theta if theta is not None else pitch + level
        force = across_flow(az, ax, alpha, attitude)
        if BANK in c:
            force = force - G0 * np.cos(alpha) * np.cos(attitude) * (1.0 - np.cos(c[BANK]))
        return integral(force / c["airspeed_m_s"], dt_s)

    angle = runs.spectra_of(LONGITUDINAL.vane)[:, 0]
    kinematic = np.stack([runs.spectra(_rotated), runs.spectra(heave)], axis=1)

    def by(name: str) -> Factors:
        return regress(angle, kinematic, runs.padded(lambda c, dt_s: instruments(c[name], dt_s)), lines)

    control = LONGITUDINAL.controls[0]
    found = _alpha_test(by(control.channel))
    if control.command in runs.channels:
        by_command = by(control.command)
        found = nearer(found, _alpha_test(by_command), by_command.strength > WEAK)
    return found


OF_ELEVATOR: Final = (*(control.name for control in LONGITUDINAL.controls), CONTROL_POWER)
"""Tests of what the elevator does, to which a record counts only if its elevator moves."""


def _alpha_test(factors: Factors) -> Relation:
    vane, rate, normal = LONGITUDINAL.output_channels
    channels = (vane, "airspeed_m_s", normal, rate, "theta_rad")
    return factor_test("alpha", channels, factors, ALPHA_STD)


__all__ = ["motion", "relations"]
