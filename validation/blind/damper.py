"""A pitch damper: it samples the logged gyro, and adds its gain times the reading to the pilot's command.

The reading is that of the log, with the gyro's faults, noise and steps; the damper subtracts the declared bias, holds
the reading until the next one, and acts through the delay and the servo of the command. The whole path is stepped with
the aircraft, on the grid of 8 kHz of `blind.surface`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import cont2discrete

from validation.blind.figures import BIAS, LOG_STEP_S, STEP_S
from validation.blind.sensors import MODE_DAMPING, Fault
from validation.blind.surface import COMMAND_DELAY_S, FINE, FINE_S, SERVO_POLE, Manoeuvre, command

Array = NDArray[np.float64]
Stepper = Callable[[float], float]
"""Called with each sample of a signal in turn; answers that of another."""

_EVERY: Final = round(LOG_STEP_S / STEP_S)
_LATE: Final = round(COMMAND_DELAY_S / FINE_S)
_CHANNEL: Final = "q_rad_s"


def delay(delay_s: float, step_s: float) -> Stepper:
    """The signal later, linear between its samples."""
    back = delay_s / step_s
    whole = int(back)
    share = back - whole
    history: list[float] = []

    def step(x: float) -> float:
        history.append(x)
        last = len(history) - 1
        return (1.0 - share) * history[max(last - whole, 0)] + share * history[max(last - whole - 1, 0)]

    return step


def lag(tau_s: float, step_s: float) -> Stepper:
    """First-order lag, exact for a signal that is linear between its samples."""
    ratio = step_s / tau_s
    pole = float(np.exp(-ratio))
    share = (1.0 - pole) / ratio
    before: list[float] = []

    def step(x: float) -> float:
        if not before:
            before[:] = [x, x]
        last, y = before
        y = pole * y + (share - pole) * last + (1.0 - share) * x
        before[:] = [x, y]
        return y

    return step


def rate_limit(rate_rad_s: float, step_s: float) -> Stepper:
    """The signal followed at no more than a rate."""
    reach = rate_rad_s * step_s
    at: list[float] = []

    def step(x: float) -> float:
        if not at:
            at.append(x)
        at[0] += min(max(x - at[0], -reach), reach)
        return at[0]

    return step


def play(width_rad: float, _: float) -> Stepper:
    """Play of a full width; starts in the middle."""
    half = width_rad / 2.0
    at: list[float] = []

    def step(x: float) -> float:
        if not at:
            at.append(x)
        at[0] = min(max(at[0], x - half), x + half)
        return at[0]

    return step


def scale(factor: float, _: float) -> Stepper:
    """The signal times a factor."""
    return lambda x: factor * x


def mode(gain_s: float, frequency_hz: float, step_s: float) -> Stepper:
    """The signal plus a bending rate; see `blind.sensors`."""
    wn = 2.0 * np.pi * frequency_hz
    b, a, _ = cont2discrete(
        ([gain_s * wn**2, 0.0], [1.0, 2.0 * MODE_DAMPING * wn, wn**2]), step_s, method="bilinear"
    )
    b0, b1, b2 = np.ravel(b).tolist()
    _, a1, a2 = np.ravel(a).tolist()
    x1 = x2 = y1 = y2 = 0.0
    first: list[float] = []

    def step(x: float) -> float:
        nonlocal x1, x2, y1, y2
        if not first:
            first.append(x)
        u = x - first[0]
        y = b0 * u + b1 * x1 + b2 * x2 - a1 * y1 - a2 * y2
        x1, x2, y1, y2 = u, x1, y, y1
        return x + y

    return step


_CHAIN: Final = {"delay": delay, "lag": lag, "rate_limit": rate_limit, "backlash": play}
_FAULTS: Final = {"delay": delay, "lag": lag, "scale": scale, "friction": play}


def gyro(faults: Sequence[Fault]) -> list[Stepper]:
    """The faults of the pitch-rate gyro, in order."""
    return [
        mode(f.value, f.at, STEP_S) if f.kind == "mode" else _FAULTS[f.kind](f.value, STEP_S)
        for f in faults
        if f.channel == _CHANNEL
    ]


class Damper:
    """Feedback of one record; see `blind.flight.Truth.fly`.

    Attributes
    ----------
    measured : surface at 8 kHz so far, deviation from trim [rad].
    readings : of the gyro at the log's period from the lead on, as logged [rad/s].
    """

    def __init__(
        self,
        manoeuvre: Manoeuvre,
        chain: Sequence[tuple[str, float]],
        faults: Sequence[Fault],
        lead_s: float,
        errors: Array,
        quantum: float,
    ) -> None:
        """Parameters: ``errors`` of each reading [rad/s]; ``quantum`` of the readings [rad/s], 0 for none."""
        steps = (len(errors) * _EVERY + 1) * FINE
        time = np.asarray(np.arange(steps) * FINE_S - lead_s - COMMAND_DELAY_S)
        self._pilot = command(manoeuvre, time).tolist()
        self._gain = manoeuvre.damper_s
        self._errors = errors.tolist()
        self._quantum = quantum
        self._chain = [_CHAIN[kind](value, FINE_S) for kind, value in chain]
        self._gyro = gyro(faults)
        self._step = 0
        self._added = [0.0, 0.0]
        self.measured = [0.0]
        self.readings: list[float] = []
        for part in self._chain:
            part(0.0)

    def __call__(self, q_rad_s: float) -> float:
        """Surface that the air sees after the next step, deviation from trim [rad]."""
        value = q_rad_s
        for part in self._gyro:
            value = part(value)
        if self._step % _EVERY == 0:
            self._sample(value)
        first = self._step * FINE
        acts = (self._step - self._step % _EVERY) * FINE + _LATE
        seen = 0.0
        for i in range(first, first + FINE):
            demand = self._pilot[i] + self._gain * self._added[i >= acts]
            seen = SERVO_POLE * self.measured[-1] + (1.0 - SERVO_POLE) * demand
            self.measured.append(seen)
            for part in self._chain:
                seen = part(seen)
        self._step += 1
        return seen

    def _sample(self, value: float) -> None:
        bias = BIAS[_CHANNEL]
        reading = value + bias + self._errors[len(self.readings)]
        if self._quantum:
            reading = self._quantum * round(reading / self._quantum)
        self.readings.append(reading)
        self._added = [self._added[1], reading - bias]
