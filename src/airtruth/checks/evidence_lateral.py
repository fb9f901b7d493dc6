"""Physical tests of the lateral-directional channels: roll, yaw, sideslip, side force, aileron and rudder.

The relations of `airtruth.checks.rotation`:

    phi   = integral of p + (q sin phi + r cos phi) tan theta
    psi   = integral of (q sin phi + r cos phi)/cos theta
    beta' = (p sin a - r cos a) + g cos theta sin phi/V + ay/V

An aileron of positive sign rolls to the left and a rudder of positive sign yaws to the left; sideslip from the right pushes to
the left. A log whose every lateral channel has the opposite sense is the mirror image of a flight, which no test tells from one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.checks.excitation import moves, turns
from airtruth.checks.factors import command_test, factor_test, follows_test, of_moving, sign_test
from airtruth.checks.lateral_model import driven
from airtruth.checks.means import mean_test
from airtruth.checks.relation import Relation, finite
from airtruth.checks.rotation import banked, given, headed, rates, side_gravity, sideslip_turn
from airtruth.checks.spectra import Factors, regress, spectrum
from airtruth.checks.together import Runs
from airtruth.physics.motion import LATERAL, LONGITUDINAL
from airtruth.physics.motion_parts import Control
from airtruth.units import G0

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]
Channels = Mapping[str, Array]

ATTITUDE_STD: Final = 0.15
"""Tolerance of the factors of bank and heading on the integrals of their rates [-]: scale and lag of gyroscopes."""
BETA_STD: Final = (0.25, 0.35, 10.0)
"""Tolerances of the factors of the rate of beta on the turn, gravity and ay [-] (judgement).

Lag of a vane; that of ay is free, because an arm of 1 m of a vane or an accelerometer can change it by 2.
"""
_BETA, _P, _R, _PHI, SIDE_FORCE = LATERAL.output_channels
BALANCED: Final = {
    "aileron": (_P, float(np.log(6.0)), 0.9),
    "rudder": (_BETA, 0.0, 0.9),
}
"""Control -> channel whose derivative balances it, logarithm of the usual ratio of both derivatives and its tolerance.

Steady roll rate over aileron is 3 to 15 1/s, steady sideslip over rudder 0.4 to 1.6 (aircraft of Klein and Morelli and of
Jategaonkar; the GTM has 9 1/s and 0.8).
"""
CLEAR: Final = 200.0
"""First-stage F above which two causes of sideslip are told apart [-]: twenty times that of one (judgement)."""
SIGNIFICANT: Final = 3.0
"""Standard deviations by which both derivatives differ from zero where their ratio is tested [-]."""
SIDESLIP: Final = (
    _BETA, _R, _PHI, SIDE_FORCE, _P, "airspeed_m_s", LONGITUDINAL.vane, "theta_rad",
)  # fmt: skip
"""Channels of the test "beta", the likeliest culprit first."""
SIDE_SLOPE: Final = (float(np.log(2.0)), 0.8)
"""Logarithm of the usual slope of -ay on beta [g/rad], and its tolerance: -CYbeta/CL of 0.6 to 6 (judgement)."""
SIDE_OF_LIFT: Final = (float(np.log(0.16)), 0.6)
"""Logarithm of that slope over the slope of -az on alpha, -CYbeta/CLalpha, and its tolerance: 0.09 to 0.25."""
AT_RUDDER: Final = (float(np.log(0.6)), 0.3)
"""Logarithm of the slope with the yaw acceleration held over that with the rudder held, and its tolerance (judgement).
1 - CYdr Cnbeta/(Cndr CYbeta) is 0.57 to 0.73 for the five aircraft of the tests: the GTM, a transport, a jet, a light and a twin
aircraft."""
SIDE_LOAD_STD: Final = 0.25
"""Tolerance of the mean of ay, as a share of gravity [-]: a steady sideslip of 7 deg (judgement)."""
SIDE_SHARE: Final = 0.5
"""Squared multiple correlation of a specific force below which its slope is not tested: noise flattens it (judgement)."""


def lateral(runs: Runs) -> list[Relation]:
    """Every test that the lateral channels allow, in the runs that roll or yaw."""
    names = set(runs.channels)
    if not {*LATERAL.gyros, "airspeed_m_s"} <= names:
        return []
    turning = runs.each(lambda c, dt_s: turns(c, dt_s).astype(np.float64)) > 0.0
    if not turning.any():
        return []
    controls = tuple(c for c in LATERAL.controls if c.channel in names)
    surfaces = tuple(c.channel for c in controls)
    result = _attitudes(runs)
    if SIDE_FORCE in names:
        mean = runs.each(lambda c, dt_s: c[SIDE_FORCE].mean(axis=1))
        std = np.full_like(mean, SIDE_LOAD_STD * G0)
        result.append(mean_test("ay_mean", (SIDE_FORCE,), mean, np.zeros_like(mean), std, SIDE_LOAD_STD * G0))
    if LATERAL.vane in names and surfaces:
        result += [_sideslip(runs), _side_slope(runs, surfaces)]
    for control in controls:
        moving = runs.each(lambda c, dt_s, n=control.channel: moves(c[n], dt_s).astype(np.float64)) > 0.0  # type: ignore[misc]
        result += [of_moving(test, moving) for test in _surface(runs, control, surfaces)]
    result += [command_test(runs, control) for control in controls if control.command in names]
    return [of_moving(test, turning) for test in result]


def _attitudes(runs: Runs) -> list[Relation]:
    """Bank and heading against the integrals of their rates."""
    result = []
    for name, rate, of in zip(("phi", "psi"), LATERAL.gyros, (banked, headed), strict=True):
        if f"{name}_rad" not in runs.channels:
            continue
        measured = runs.spectra(lambda c, dt_s, n=name: np.unwrap(c[f"{n}_rad"], axis=1))  # type: ignore[misc]
        factors = regress(measured, runs.spectra(of)[:, None], lines=runs.lines())
        result.append(follows_test(name, (rate, f"{name}_rad"), factors, ATTITUDE_STD))
    return result


def _turn(c: Channels, dt_s: float) -> Array:
    p, _, r, _, _ = rates(c)
    return sideslip_turn(p, r, given(c, LONGITUDINAL.vane))


def _gravity(c: Channels, dt_s: float) -> Array:
    _, _, _, phi, theta = rates(c)
    return side_gravity(theta, phi if _PHI in c else banked(c, dt_s)) / c["airspeed_m_s"]


def _force(c: Channels, dt_s: float) -> Array:
    return given(c, SIDE_FORCE) / c["airspeed_m_s"]


def _sideslip(runs: Runs) -> Relation:
    """Rate of beta against its causes, the motion by the surfaces as the instruments.

    Causes that these do not tell apart are summed. A gust at the vane is nearly a random walk, so that its rate is white.
    """
    rate = runs.spectra(lambda c, dt_s: np.gradient(c[LATERAL.vane], dt_s, axis=1))
    turn, gravity, force = (runs.spectra(of) for of in (_turn, _gravity, _force))
    instruments = runs.padded(lambda c, dt_s: spectrum(driven(c, dt_s)[1], dt_s))
    used = tuple(n for n in SIDESLIP if n in runs.channels)
    for causes in ([turn, gravity, force], [turn, gravity + force], [turn + gravity + force]):
        factors = regress(rate, np.stack(causes, axis=1), instruments, runs.lines())
        if factors.strength[-1] > CLEAR or len(causes) == 1:
            break
    test = factor_test("beta", used, factors, BETA_STD[: len(causes)])
    none = np.full((len(test.distance), 3 - len(causes)), np.nan)
    value, std = test.figures[:, : len(causes)], test.figures[:, len(causes) : 2 * len(causes)]
    return replace(test, figures=np.concatenate([value, none, std, none], axis=1))


def _side_slope(runs: Runs, surfaces: tuple[str, ...]) -> Relation:
    """Slope of ay on beta, the rates and the surfaces held: its sign, and its size against the usual one.

    Where the rudder moves the nose, the yaw acceleration is held and not the rudder. The accelerometer's arm is then a factor of
    that acceleration and not of beta.
    """
    channels = (SIDE_FORCE, LATERAL.vane, *LATERAL.gyros, *surfaces)
    if SIDE_FORCE not in runs.channels:
        return _nothing("side_slope", channels[1:], runs)
    factors = _factors(runs, channels)
    value, std, clear = _slope(factors)
    usual, tolerance = (np.full_like(value, x) for x in SIDE_SLOPE)
    normal = LONGITUDINAL.outputs[-1].channel
    of_alpha = (normal, LONGITUDINAL.vane, *LONGITUDINAL.gyros, *LONGITUDINAL.surfaces)
    if set(of_alpha) <= set(runs.channels):
        slope, slope_std, clear_slope = _slope(_factors(runs, of_alpha))
        known = clear_slope & (slope > SIGNIFICANT * slope_std)
        usual = np.where(known, np.log(np.where(known, slope, 1.0)) + SIDE_OF_LIFT[0], usual)
        tolerance = np.where(known, SIDE_OF_LIFT[1], tolerance)
    free, free_std, turns_nose = _without_arm(runs, channels, factors)
    value, std = np.where(turns_nose, free, value), np.where(turns_nose, free_std, std)
    usual = usual + AT_RUDDER[0] * turns_nose
    tolerance = np.hypot(tolerance, AT_RUDDER[1] * turns_nose)
    clear &= np.abs(value) > SIGNIFICANT * std
    against = np.minimum(value, 0.0) / std
    size = np.log(np.maximum(np.abs(value), 1e-9)) - usual
    size = size / np.sqrt(tolerance**2 + (std / value) ** 2)
    distance = finite((against**2 + size**2) * clear)
    figures = np.stack([value, std, np.exp(usual), turns_nose], axis=1)
    return Relation("side_slope", channels, distance, figures, clear)


def _factors(runs: Runs, channels: tuple[str, ...]) -> Factors:
    """Factors of the first channel on the others."""
    return regress(runs.spectra_of(channels[0])[:, 0], runs.spectra_of(*channels[1:]), lines=runs.lines())


def _slope(factors: Factors) -> tuple[Array, Array, Bools]:
    """Less the first factor over gravity, the others held; its deviation; whether enough is explained."""
    std = np.sqrt(factors.covariance[:, 0, 0]) / G0
    return -factors.value[:, 0] / G0, std, factors.share > SIDE_SHARE


def _without_arm(runs: Runs, channels: tuple[str, ...], side: Factors) -> tuple[Array, Array, Bools]:
    """Less the factor of beta in ay over gravity, the yaw acceleration held and not the rudder; its deviation; whether the
    rudder moves the nose.

    Parameters
    ----------
    channels : ay and its causes, beta first; side : factors of ay on them.
    """
    yaw = LATERAL.gyros[-1]
    turning = next((c.channel for c in LATERAL.controls if c.damped == yaw), "")
    if turning not in channels:
        none = np.zeros(len(runs) + 1)
        return none, none, none > 0.0
    at = channels.index(turning) - 1
    turn = regress(runs.spectra_of(yaw)[:, 0], runs.integrals_of(*channels[1:]), lines=runs.lines())
    power, power_var = turn.value[:, at], turn.covariance[:, at, at]
    known = np.abs(power) > SIGNIFICANT * np.sqrt(power_var)
    power = np.where(known, power, 1.0)
    ratio = turn.value[:, 0] / power
    ratio_var = (turn.covariance[:, 0, 0] + ratio**2 * power_var) / power**2
    c, of_turning = side.covariance, side.value[:, at]
    variance = c[:, 0, 0] + ratio**2 * c[:, at, at] - 2.0 * ratio * c[:, 0, at] + of_turning**2 * ratio_var
    return -(side.value[:, 0] - ratio * of_turning) / G0, np.sqrt(variance) / G0, known


def _nothing(name: str, channels: tuple[str, ...], runs: Runs) -> Relation:
    none = np.zeros(len(runs) + 1)
    return Relation(name, channels, none, np.stack([none] * 4, axis=1), none > 0.0)


def _surface(runs: Runs, control: Control, surfaces: tuple[str, ...]) -> list[Relation]:
    """Effect of a surface on its rate, the other causes held: its sign, and its size against the derivative that balances it."""
    name, rate = control.channel, control.damped
    others = [n for n in surfaces if n != name]
    sideslip = [n for n in (LATERAL.vane,) if n in runs.channels]
    names = (name, *others, *sideslip, *LATERAL.gyros)
    factors = regress(runs.spectra_of(rate)[:, 0], runs.integrals_of(*names), lines=runs.lines())
    result = [sign_test(control.name, (name, rate, *sideslip), factors)]
    balance, usual, tolerance = BALANCED[control.name]
    if balance not in names:
        return result
    at = names.index(balance)
    value, std = factors.value, np.sqrt(np.diagonal(factors.covariance, axis1=1, axis2=2))
    clear = (np.abs(value[:, 0]) > SIGNIFICANT * std[:, 0]) & (
        np.abs(value[:, at]) > SIGNIFICANT * std[:, at]
    )
    ratio = np.abs(value[:, 0] / value[:, at])
    spread = np.sqrt(tolerance**2 + (std[:, 0] / value[:, 0]) ** 2 + (std[:, at] / value[:, at]) ** 2)
    distance = finite(((np.log(np.maximum(ratio, 1e-9)) - usual) / spread) ** 2 * clear)
    figures = np.stack([ratio, ratio * spread], axis=1)
    result.append(Relation(f"{control.name}_size", (name, balance), distance, figures, clear))
    return result


__all__ = ["lateral"]
