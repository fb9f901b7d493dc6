"""A yaw damper and a bank hold beside the aircraft's model: sampled feedback to rudder and aileron.

    rudder = yaw_damper_gain_s h(r),   aileron = bank_gain (phi - phi_trim) + roll_damper_gain_s p

p, r and phi are the readings of the sensors, with their bias and noise. h is the high pass (washout) s T/(s T + 1) of the yaw
rate, so that a steady turn is not opposed, or 1 without a time constant. With the signs of the channels positive gains damp the
yaw, hold the bank and damp the roll: a rudder with the trailing edge left yaws to the left, an aileron (right - left)/2 with the
trailing edge down on the right rolls to the left. The feedback is held between two samples and added to the command; the command
of the log is that of the manoeuvre alone, as it is with the augmentation of the pitch plane.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.channels import BANK
from airtruth.physics.motion import LATERAL

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LateralFeedback:
    """Gains, sample period and sensor errors of one flight.

    Attributes
    ----------
    errors : (samples,) each, errors of the sensors of p, r [rad/s] and phi [rad] at the steps of the simulation.
    yaw_damper_gain_s, roll_damper_gain_s : rudder per yaw rate, aileron per roll rate [s].
    bank_gain : aileron per bank [-].
    washout_s : time constant of the high pass of the yaw rate [s]; 0 for none.
    every : simulation steps between two samples.
    """

    errors: tuple[Array, Array, Array]
    yaw_damper_gain_s: float = 0.0
    roll_damper_gain_s: float = 0.0
    bank_gain: float = 0.0
    washout_s: float = 0.0
    every: int = 1


FED: Final = (*LATERAL.gyros, BANK)
"""Channels whose sensors the feedback reads."""


class Loop:
    """The feedback in one flight; it keeps the state of the washout and the feedback until the next sample.

    Parameters
    ----------
    feedback : gains and sensor errors.
    dt_s : simulation step [s].
    bank_rad : bank to hold [rad].
    motion : functions that return p, r [rad/s] and phi [rad] of the present step.

    Attributes
    ----------
    angles_rad : present feedback to aileron and rudder [rad].
    setters : those that `added` returned.
    """

    def __init__(
        self, feedback: LateralFeedback, dt_s: float, bank_rad: float, motion: Sequence[Callable[[], float]]
    ) -> None:
        self._feedback, self._bank_rad, self._motion = feedback, bank_rad, motion
        period = dt_s * feedback.every
        self._forget = math.exp(-period / feedback.washout_s) if feedback.washout_s else 1.0
        self._slow_rad_s = 0.0
        self.angles_rad = (0.0, 0.0)
        self.setters: tuple[Callable[[float], object], ...] = ()

    def sample(self, step: int) -> None:
        """Renew the feedback at the multiples of ``every``.

        The low pass whose difference to the yaw rate is the high pass takes each sample as constant since the one before, exact
        for such a signal; it starts from a yaw rate of zero.

        Parameters
        ----------
        step : number of the present simulation step.
        """
        f = self._feedback
        if step % f.every:
            return
        p, r, phi = (read() + float(e[step]) for read, e in zip(self._motion, f.errors, strict=True))
        self._slow_rad_s = self._forget * self._slow_rad_s + (1.0 - self._forget) * r
        self.angles_rad = (
            f.bank_gain * (phi - self._bank_rad) + f.roll_damper_gain_s * p,
            f.yaw_damper_gain_s * (r - self._slow_rad_s),
        )

    def added(
        self, setters: Sequence[Callable[[float], object]], per_rad: Sequence[float]
    ) -> tuple[Callable[[float], object], ...]:
        """Setters of the commands of aileron and rudder that add the present feedback to what they are given.

        Parameters
        ----------
        setters : set the properties of the commands of aileron and rudder.
        per_rad : units of each property per radian.
        """
        numbered = enumerate(zip(setters, per_rad, strict=True))
        self.setters = tuple(
            lambda value, i=i, add=add, per=per: add(value + self.angles_rad[i] * per)  # type: ignore[misc]
            for i, (add, per) in numbered
        )
        return self.setters


__all__ = ["LateralFeedback", "Loop"]
