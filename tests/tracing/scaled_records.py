"""Records of sensors with wrong scales, and fits of effects to them."""

from dataclasses import replace

import numpy as np
import trace_records as tr

from airtruth.effects.registry import EFFECTS
from airtruth.tracing.inference.optimise import fit, initial_parameters
from airtruth.tracing.model.parameters import Parameters
from airtruth.units import DEG

VANE, GYRO, ACCELEROMETER = (EFFECTS[f"{name}_scale"] for name in ("vane", "gyro", "accelerometer"))


def scaled_problem(vane=1.3, gyro=1.1):
    """Two records; vane and gyro read these factors of the truth."""
    rng = np.random.default_rng(4)
    records = []
    for amplitude in (2.0, -2.0):
        one = tr.fly(rng, amplitude=amplitude * DEG, sigma_w=0.05, name=str(amplitude))
        y = one.signals.y * [vane, gyro, 1.0]
        records.append(replace(one, signals=replace(one.signals, y=y)))
    return tr.problem(records)


def disturbed_problem(scales, channel, amplitude):
    """Three records; vane, gyro and accelerometer read these factors of the truth, and one channel (0 to 2) has a sinusoid
    of 4 Hz besides, of this amplitude [rad, rad/s or m/s2], which no effect explains.
    """
    rng = np.random.default_rng(4)
    records = []
    for size in (2.0, -2.0, 1.5):
        one = tr.fly(rng, amplitude=size * DEG, sigma_w=0.05, name=str(size))
        y = one.signals.y * scales
        t_s = np.arange(len(y)) * one.signals.dt_s
        y[:, channel] += amplitude * np.sin(2.0 * np.pi * 4.0 * t_s + size)
        records.append(replace(one, signals=replace(one.signals, y=y)))
    return tr.problem(records)


def fitted(problem, *effects):
    """Fit of effects from the declared aircraft."""
    hypothesis = tr.NOTHING
    for effect in effects:
        hypothesis = hypothesis.plus(effect)
    start = initial_parameters(problem, hypothesis)
    return fit(problem, hypothesis, Parameters(start.common, start.per_record, np.zeros(len(effects))))
