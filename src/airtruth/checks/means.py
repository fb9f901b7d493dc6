"""Physical tests of the values of a log: ranges, density against altitude, and the means of the accelerometers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.channels import BANK, SIGNALS
from airtruth.checks.relation import ATMOSPHERE_M, Relation, finite, informed_everywhere
from airtruth.checks.together import Runs
from airtruth.physics.atmosphere import density_kg_m3
from airtruth.physics.motion import LONGITUDINAL, MOTIONS
from airtruth.units import DEG, G0

Array = NDArray[np.float64]
Channels = Mapping[str, Array]

OUTSIDE: Final = 1000.0
"""Distance of a channel that leaves the range of flight [-]; larger than any sum of the others that matters."""
LIMITS: Final = {
    **{name: (-one.limit, one.limit) for name, one in SIGNALS.items()},
    **dict.fromkeys((n for m in MOTIONS.values() for n in m.surfaces), (-45.0 * DEG, 45.0 * DEG)),
    "throttle": (-0.05, 1.05),
}
"""Range of every sample, SI (judgement: no aircraft leaves it; one degree taken as one radian usually does)."""
MEANS: Final = {
    "airspeed_m_s": (5.0, 700.0),
    "density_kg_m3": (0.088, 1.478),
    "altitude_m": (-500.0, 20000.0),
}
"""Range of a run's mean, SI; the densities are those of the standard atmosphere at the ends of `ATMOSPHERE_M`."""


def ranges(runs: Runs) -> list[Relation]:
    """Samples and means that no flight has."""
    result = []
    for name in runs.channels:

        def extent(c: Channels, dt_s: float, name: str = name) -> Array:
            x = c[name]
            return np.stack([x.min(axis=1), x.mean(axis=1), x.max(axis=1)], axis=1)

        figures = runs.each(extent)
        lowest, mean, highest = figures.T
        low, high = LIMITS[name]
        mean_low, mean_high = MEANS.get(name, (-np.inf, np.inf))
        bad = (lowest < low) | (highest > high) | (mean < mean_low) | (mean > mean_high)
        if bad.any():
            distance = _with_all(OUTSIDE * bad)
            worst = figures[bad][:1]
            figures = np.concatenate([figures, worst])
            result.append(Relation("range", (name,), distance, figures, informed_everywhere(distance)))
    return result


DENSITY_STD: Final = 0.05
"""Standard deviation of the logarithm of density over that of the standard atmosphere [-].

15 K of 288 K; flight tests happen within 40 K of the standard temperature.
"""


def air(runs: Runs) -> list[Relation]:
    """Density against that of the standard atmosphere at the altitude."""
    if not {"density_kg_m3", "altitude_m"} <= set(runs.channels):
        return []
    density, altitude = (
        runs.each(lambda c, dt_s, name=name: c[name].mean(axis=1))  # type: ignore[misc]
        for name in ("density_kg_m3", "altitude_m")
    )
    standard = density_kg_m3(np.clip(altitude, *ATMOSPHERE_M))
    deviation = np.log(np.maximum(density, 1e-6) / standard)
    figures = np.stack([density, altitude, standard], axis=1)
    distance = _with_all((deviation / DENSITY_STD) ** 2)
    return [
        Relation(
            "air",
            ("density_kg_m3", "altitude_m"),
            distance,
            np.concatenate([figures, figures.mean(axis=0, keepdims=True)]),
            informed_everywhere(distance),
        )
    ]


LEVEL: Final = 4.0
"""Distance of the test "theta" below which the wings are level: in a turn the integral of q is not theta."""
LOAD_STD: Final = 0.1
"""Tolerance of the mean of az, as a share of gravity [-]: scale, bias and tilt of an accelerometer (judgement)."""
TURN_STD: Final = 0.4
"""The same towards more load where the wings may not be level [-]: 1.4 g is a turn of 45 deg."""
AXIAL_STD_M_S2: Final = 0.25
"""Tolerance of the mean of ax [m/s2]: 0.02 g of bias, 1 deg of error in theta and in the alignment (judgement)."""
GYRO_STD_RAD_S: Final = 0.01
"""Tolerance of the mean of q [rad/s], where no theta replaces its integral (0.6 deg/s, a MEMS gyroscope's bias)."""
PATH_SHARE: Final = 0.5
"""Tolerance of the curvature of the path as a share of itself [-]: slow gusts change alpha and not the path."""
BANKED: Final = 0.05
"""Sine of the bank above which the pitch rate replaces the change of pitch attitude [-] (judgement)."""
END_S: Final = 0.3
"""Samples at both ends of a run whose means are the end values [s]."""
SPREAD_LIMIT: Final = 1.0
"""Multiples of the standard deviation of a detrended channel by which the slope between its ends may err [-]."""


_ALPHA, _Q, _AZ = LONGITUDINAL.output_channels
PATH: Final = (_AZ, "theta_rad", _ALPHA, "airspeed_m_s", _Q)
"""Channels of the test "az_mean"."""


def gravity(runs: Runs, level: NDArray[np.bool_] | None = None) -> list[Relation]:
    """Means of az and ax against those that gravity and the path require.

    Without alpha the path is taken as straight, with the tolerance of a turn. In a bank that is recorded the turn is known.

    Parameters
    ----------
    level : (runs,) whether the wings are known to be level; None if nothing is known.
    """
    names = set(runs.channels)
    if not {"airspeed_m_s", _Q, _AZ} <= names:
        return []
    vane = _ALPHA in names

    def required_az(c: Channels, dt_s: float) -> Array:
        """Mean of az, the required one, and its standard deviation beside that of the load."""
        v, q, theta = c["airspeed_m_s"], c[_Q], c.get("theta_rad")
        speed = v.mean(axis=1)
        if not vane:
            gravity = -G0 * np.cos(theta if theta is not None else np.zeros_like(q)).mean(axis=1)
            return np.stack([c[_AZ].mean(axis=1), gravity, np.zeros_like(speed)], axis=1)
        alpha = c[_ALPHA]
        path = theta - alpha if theta is not None else np.zeros_like(alpha)
        phi = c.get(BANK)
        upright = np.cos(path) if phi is None else np.cos(path) * np.cos(phi)
        turn, turn_std = _slope(alpha, dt_s)
        pitch, gyro_std = (
            (_slope(theta, dt_s)[0], 0.0)
            if theta is not None and (phi is None or _is_level(phi))
            else (q.mean(axis=1), GYRO_STD_RAD_S)
        )
        required = -G0 * upright.mean(axis=1) + speed * (turn - pitch)
        path_std = PATH_SHARE * speed * np.abs(turn - pitch)
        std = np.sqrt((speed * gyro_std) ** 2 + (speed * turn_std) ** 2 + path_std**2)
        return np.stack([c[_AZ].mean(axis=1), required, std], axis=1)

    mean, required, std = runs.each(required_az).T
    turning = (mean < required) if level is None else (mean < required) & ~level
    load_std = np.where(turning | (not vane), TURN_STD, LOAD_STD) * G0
    path = tuple(name for name in PATH if name in names)
    result = [mean_test("az_mean", path, mean, required, np.sqrt(load_std**2 + std**2), LOAD_STD * G0)]
    if {"theta_rad", "ax_m_s2"} <= names:

        def required_ax(c: Channels, dt_s: float) -> Array:
            v, q, theta = c["airspeed_m_s"], c[_Q], c["theta_rad"]
            alpha = c[_ALPHA] if vane else np.zeros_like(v)
            rate, rate_std = _slope(v * np.cos(alpha), dt_s)
            required = rate + (G0 * np.sin(theta) + q * v * np.sin(alpha)).mean(axis=1)
            return np.stack([c["ax_m_s2"].mean(axis=1), required, np.hypot(rate_std, rate)], axis=1)

        mean, required, std = runs.each(required_ax).T
        channels = ("ax_m_s2", "theta_rad", _ALPHA, _Q, "airspeed_m_s")
        used = tuple(name for name in channels if name in names)
        result.append(
            mean_test("ax_mean", used, mean, required, np.hypot(AXIAL_STD_M_S2, std), AXIAL_STD_M_S2)
        )
    return result


def _is_level(phi: Array) -> bool:
    """Whether no bank matters to the pitch rate."""
    return bool(np.abs(np.sin(phi)).max() < BANKED)


def _slope(x: Array, dt_s: float) -> tuple[Array, Array]:
    """Mean rate between the ends (runs,), and its standard deviation if the channel is noise about a line."""
    samples = x.shape[1]
    head = max(1, min(round(END_S / dt_s), samples // 4))
    length_s = (samples - head) * dt_s
    rate = (x[:, -head:].mean(axis=1) - x[:, :head].mean(axis=1)) / length_s
    line = np.linspace(-1.0, 1.0, samples)
    rest = x - x.mean(axis=1, keepdims=True) - np.outer(x @ line / (line @ line), line)
    return rate, SPREAD_LIMIT * rest.std(axis=1) * np.sqrt(2.0) / length_s


def mean_test(
    name: str, channels: tuple[str, ...], mean: Array, required: Array, std: Array, common: float
) -> Relation:
    """Distance of means from the required ones; ``common`` is the part of std that all runs share."""
    distance = ((mean - required) / std) ** 2
    figures = np.stack([mean, required, std], axis=1)
    together = figures.mean(axis=0, keepdims=True)
    own = max(float(np.mean(std**2)) - common**2, 0.0)
    together[0, 2] = np.sqrt(common**2 + own / len(mean))
    pooled = ((together[0, 0] - together[0, 1]) / together[0, 2]) ** 2
    distance = finite(np.append(distance, pooled))
    return Relation(
        name, channels, distance, np.concatenate([figures, together]), informed_everywhere(distance)
    )


def _with_all(distance: Array) -> Array:
    """A row for all runs together: the median over the runs."""
    return finite(np.append(distance, np.median(distance)))


__all__ = ["LEVEL", "LIMITS", "MEANS", "OUTSIDE", "air", "gravity", "mean_test", "ranges"]
