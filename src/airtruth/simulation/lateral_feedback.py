"""A yaw damper and a bank hold beside the aircraft's model: sampled feedback to rudder and aileron.

    rudder = yaw_damper_gain_s h(r),   aileron = bank_gain (phi - phi_trim) + roll_damper_gain_s p

p, r and phi are the readings of the sensors, with their bias and noise. h is the high pass (washout) s T/(s T + 1) of the yaw
rate, so that a steady turn is not opposed, or 1 without a time constant. With the signs of the channels positive gains damp the
yaw, hold the bank and damp the roll: a rudder with the trailing edge left yaws to the left, an aileron (right - left)/2 with the
trailing edge down on the right rolls to the left. The commands are held between two samples.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LateralFeedback:
    """Gains, sample period and sensor errors of one flight.

    Attributes
    ----------
    p_error_rad_s, r_error_rad_s, phi_error_rad : (samples,) errors of the sensors at the steps of the simulation.
    yaw_damper_gain_s, roll_damper_gain_s : rudder per yaw rate, aileron per roll rate [s].
    bank_gain : aileron per bank [-].
    washout_s : time constant of the high pass of the yaw rate [s]; 0 for none.
    every : simulation steps between two samples.
    """

    p_error_rad_s: Array
    r_error_rad_s: Array
    phi_error_rad: Array
    yaw_damper_gain_s: float = 0.0
    roll_damper_gain_s: float = 0.0
    bank_gain: float = 0.0
    washout_s: float = 0.0
    every: int = 1


class Loop:
    """The feedback in one flight; it keeps the state of the washout and the commands until the next sample.

    Parameters
    ----------
    feedback : gains and sensor errors.
    dt_s : simulation step [s].
    bank_rad : bank to hold [rad].
    motion : functions that return p, r [rad/s] and phi [rad] of the present step.
    """

    def __init__(
        self,
        feedback: LateralFeedback,
        dt_s: float,
        bank_rad: float,
        motion: Sequence[Callable[[], float]],
    ) -> None:
        self._feedback, self._bank_rad, self._motion = feedback, bank_rad, motion
        period = dt_s * feedback.every
        self._forget = math.exp(-period / feedback.washout_s) if feedback.washout_s else 1.0
        self._slow_rad_s = 0.0
        self._commands_rad = {"aileron": 0.0, "rudder": 0.0}

    def at(self, step: int) -> tuple[float, float]:
        """Commands of aileron and rudder from a simulation step on, deviations from the trim [rad].

        The commands change at the multiples of the feedback's ``every``. The low pass whose difference to the yaw rate is the
        high pass takes each sample as constant since the one before, exact for such a signal; it starts from a yaw rate of zero.

        Parameters
        ----------
        step : number of the present step.
        """
        f = self._feedback
        if step % f.every == 0:
            p, r, phi = (read() for read in self._motion)
            p += float(f.p_error_rad_s[step])
            r += float(f.r_error_rad_s[step])
            phi += float(f.phi_error_rad[step])
            self._slow_rad_s = self._forget * self._slow_rad_s + (1.0 - self._forget) * r
            self._commands_rad["rudder"] = f.yaw_damper_gain_s * (r - self._slow_rad_s)
            self._commands_rad["aileron"] = f.bank_gain * (phi - self._bank_rad) + f.roll_damper_gain_s * p
        return self._commands_rad["aileron"], self._commands_rad["rudder"]

    def added(self, control: str, setter: Callable[[float], None], per_rad: float) -> Callable[[float], None]:
        """Return a setter that adds the present command of a control to what it is given.

        Parameters
        ----------
        control : "aileron" or "rudder".
        setter : sets the property of the command.
        per_rad : units of the property per radian.
        """
        commands = self._commands_rad

        def set_sum(value: float) -> None:
            setter(value + commands[control] * per_rad)

        return set_sum


__all__ = ["LateralFeedback", "Loop"]
