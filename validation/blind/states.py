"""Effects of a truth that have states of their own, each stepped beside JSBSim."""

from __future__ import annotations

import math
from typing import Final

from validation.blind.figures import ALPHA_TRIM_RAD, DEG, DERIVATIVES
from validation.blind.flight import Start, State

_SEPARATION_RAD: Final = ALPHA_TRIM_RAD + 2.0 * DEG  # half of the flow has separated
_STEEPNESS: Final = 30.0  # 1/rad
_SEPARATION_S: Final = 0.15  # about 25 chords of flight
_AFT_MAC: Final = 0.15  # the centre of pressure moves aft by as much as the flow separates
_CL_TRIM: Final = 0.51  # 57.75 lb at 75 kt


def hysteresis(amplitude: float, width_rad: float) -> Start:
    """Cm by play in alpha: amplitude (play - alpha)."""

    def start(alpha: float) -> State:
        y = alpha

        def state(alpha: float, q: float, v: float, dt: float) -> tuple[float, float]:
            nonlocal y
            y = min(max(y, alpha - width_rad / 2.0), alpha + width_rad / 2.0)
            return 0.0, amplitude * (y - alpha)

        return state

    return start


def slosh(gain: float, frequency_hz: float) -> Start:
    """A moment by a fuel mass that swings with the pitch rate: x'' + 0.1 wn x' + wn^2 x = wn^2 q, Cm += gain x c/(2V)."""
    wn = 2.0 * math.pi * frequency_hz

    def start(_: float) -> State:
        x = rate = 0.0

        def state(alpha: float, q: float, v: float, dt: float) -> tuple[float, float]:
            nonlocal x, rate
            rate += dt * (wn * wn * (q - x) - 0.1 * wn * rate)
            x += dt * rate
            return 0.0, gain * x * 0.1395 / v

        return state

    return start


def thrust_lag(gain: float, tau_s: float) -> Start:
    """Thrust that follows the intake's angle of attack late: Cm += gain (x - alpha at the start), tau x' = alpha - x."""

    def start(first: float) -> State:
        x = first

        def state(alpha: float, q: float, v: float, dt: float) -> tuple[float, float]:
            nonlocal x
            x += dt * (alpha - x) / tau_s
            return 0.0, gain * (x - first)

        return state

    return start


def switch(moment: float, lift: float) -> Start:
    """Separation that comes above 1.2 deg over trim and goes below 0.4 deg: a step in Cm and CL."""

    def start(_: float) -> State:
        on = False

        def state(alpha: float, q: float, v: float, dt: float) -> tuple[float, float]:
            nonlocal on
            on = alpha > ALPHA_TRIM_RAD + (0.4 if on else 1.2) * DEG
            return (lift, moment) if on else (0.0, 0.0)

        return state

    return start


def stall(lift: float) -> Start:
    """Lift and moment by Kirchhoff's separation point x with its lag; both are zero at the start.

    T x' = (1 - tanh(a (alpha - alpha*)))/2 - x, CL -= lift (1 - ((1 + sqrt(x))/2)^2), Cm += 0.15 times the lost lift.
    (D. Fischenberg, AIAA 95-3438; R. V. Jategaonkar, Flight Vehicle System Identification, 2nd ed., 2015, sec. 12.5.)
    """

    def settled(alpha: float) -> float:
        return 0.5 * (1.0 - math.tanh(_STEEPNESS * (alpha - _SEPARATION_RAD)))

    def lost(x: float) -> float:
        return lift * (1.0 - (0.5 * (1.0 + math.sqrt(x))) ** 2)

    def start(first: float) -> State:
        x = settled(first)
        before = lost(x)

        def state(alpha: float, q: float, v: float, dt: float) -> tuple[float, float]:
            nonlocal x
            x += dt * (settled(alpha) - x) / _SEPARATION_S
            more = lost(x) - before
            return -more, -_AFT_MAC * more

        return state

    return start


def drifting_cg(rate_mac_s: float) -> Start:
    """A CG that moves aft at a constant rate [chords/s], as fuel flows: Cm += rate t CL about the declared CG."""

    def start(_: float) -> State:
        time = 0.0

        def state(alpha: float, q: float, v: float, dt: float) -> tuple[float, float]:
            nonlocal time
            time += dt
            return 0.0, rate_mac_s * time * (_CL_TRIM + DERIVATIVES["CLalpha"][0] * (alpha - ALPHA_TRIM_RAD))

        return state

    return start
