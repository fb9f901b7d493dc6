"""Angle of attack without a vane, from inertial measurements and airspeed, with the directions of its errors.

Wings level, air at rest (R. V. Jategaonkar, *Flight Vehicle System Identification*, 2006, chapter 10), with
the flight-path angle gamma = theta - alpha:

    theta' = q,   gamma' = -(az cos(alpha) - ax sin(alpha) + g cos(gamma))/V,   h' = V sin(gamma)

theta and gamma are integrated. The start of gamma, constant errors of az and q, and a relative error of V are estimated
from measured altitude and attitude and from their assumed standard deviations. A vertical gust w changes the true alpha
by w/V and is not seen.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.physics.motion import LONGITUDINAL
from airtruth.units import DEG, G0

Array = NDArray[np.float64]

NEEDED: Final = ("airspeed_m_s", *LONGITUDINAL.gyros, LONGITUDINAL.outputs[-1].channel)
"""Channels that the reconstruction needs."""
_, _RATE, _NORMAL = NEEDED
ERRORS: Final = ("path", "az", "q", "airspeed")
"""Unknowns: start of gamma [rad], errors of az [m/s2], of q [rad/s], and relative error of V [-]."""
COLUMNS: Final = tuple(f"alpha_error_{i}_rad" for i in range(1, len(ERRORS) + 1))
"""Columns of a flight log with the directions of the errors of a reconstructed alpha [rad]."""
PATH_STD_RAD: Final = (3.0 * DEG, 15.0 * DEG)
"""Standard deviation of gamma at the start [rad]: without an altitude, where flight is taken as level, and with one."""
UNKNOWN_ALPHA_RAD: Final = 3.0 * DEG
"""Alpha at the start where no attitude is measured [rad] (judgement: its constant enters through its cosine alone)."""
ROUNDS: Final = 12
"""Iterations of gamma; its rate depends on gamma weakly, and each adds three digits."""
STEP: Final = 1e-4
"""Share of a standard deviation by which an unknown is changed for a derivative [-]."""
LEAST_ALTITUDE_STD_M: Final = 0.02
"""Least standard deviation of an altitude [m] (judgement: resolution of a barometer)."""
LEAST_ATTITUDE_STD_RAD: Final = 1e-4
"""Least standard deviation of an attitude [rad] (judgement)."""


def is_reconstructed(channels: Collection[str]) -> bool:
    """Whether the columns of a log hold the errors of a reconstructed alpha, so that no vane measured it."""
    return any(name in channels for name in COLUMNS)


@dataclass(frozen=True)
class ReconstructionPriors:
    """Standard deviations of constant errors: az [m/s2], q [rad/s], relative error of V [-]."""

    acceleration_m_s2: float
    rate_rad_s: float
    airspeed: float


@dataclass(frozen=True)
class Reconstruction:
    """A reconstructed angle of attack.

    Attributes
    ----------
    alpha_rad : (samples,) [rad].
    directions_rad : (4, samples) independent errors of one standard deviation [rad].
    """

    alpha_rad: Array
    directions_rad: Array

    @property
    def drift_std_rad(self) -> float:
        """Largest standard deviation of alpha against its mean over the record [rad]."""
        centred = self.directions_rad - self.directions_rad.mean(axis=1, keepdims=True)
        return float(np.sqrt((centred**2).sum(axis=0)).max())


def reconstruct(channels: Mapping[str, Array], dt_s: float, priors: ReconstructionPriors) -> Reconstruction:
    """Angle of attack of one run.

    Parameters
    ----------
    channels : (samples,) each: `NEEDED`, and ax_m_s2, theta_rad and altitude_m where they are measured.
    dt_s : sample period [s].
    priors : assumed standard deviations of the errors of the instruments.
    """
    level = PATH_STD_RAD["altitude_m" in channels]
    scale = np.array([level, priors.acceleration_m_s2, priors.rate_rad_s, priors.airspeed])
    p = np.zeros(len(ERRORS))
    covariance = np.diag(scale**2)
    for _ in range(3):
        alpha, predicted = _motion(channels, dt_s, p)
        slopes, outputs = _derivatives(channels, dt_s, p, scale)
        information, right = np.diag(1.0 / scale**2), -p / scale**2
        for name, model in predicted.items():
            residual = channels[name] - model
            weight = 1.0 / _variance(residual - outputs[name].T @ _fit(outputs[name], residual), name)
            information = information + weight * outputs[name] @ outputs[name].T
            right = right + weight * outputs[name] @ residual
        covariance = np.linalg.inv(information)
        p = p + covariance @ right
    alpha, _ = _motion(channels, dt_s, p)
    slopes, _ = _derivatives(channels, dt_s, p, scale)
    return Reconstruction(alpha, np.linalg.cholesky(covariance).T @ slopes)


def _motion(c: Mapping[str, Array], dt_s: float, p: Array) -> tuple[Array, dict[str, Array]]:
    """Alpha, and altitude and attitude as measured would be, for the unknowns p; constants of both are those measured."""
    speed = c["airspeed_m_s"] * (1.0 + p[3])
    az, ax = c[_NORMAL] + p[1], c.get("ax_m_s2")
    turned = _integral(c[_RATE] + p[2], dt_s)
    turned = turned - turned.mean()
    mean = c["theta_rad"].mean() if "theta_rad" in c else UNKNOWN_ALPHA_RAD + p[0] - turned[0]
    theta = mean + turned
    gamma = np.full_like(speed, p[0])
    for _ in range(ROUNDS):
        alpha = theta - gamma
        force = az * np.cos(alpha) + G0 * np.cos(gamma)
        if ax is not None:
            force = force - ax * np.sin(alpha)
        gamma = p[0] - _integral(force / speed, dt_s)
    predicted = {}
    if "altitude_m" in c:
        climbed = _integral(speed * np.sin(gamma), dt_s)
        predicted["altitude_m"] = c["altitude_m"].mean() + climbed - climbed.mean()
    if "theta_rad" in c:
        predicted["theta_rad"] = theta
    return theta - gamma, predicted


def _derivatives(
    c: Mapping[str, Array], dt_s: float, p: Array, scale: Array
) -> tuple[Array, dict[str, Array]]:
    """Derivatives (4, samples) of alpha and of each measured output by the unknowns."""
    rows: list[Array] = []
    outputs: dict[str, list[Array]] = {}
    for i, unit in enumerate(scale):
        step = np.zeros(len(p))
        step[i] = STEP * unit
        (above, high), (below, low) = _motion(c, dt_s, p + step), _motion(c, dt_s, p - step)
        rows.append((above - below) / (2.0 * step[i]))
        for name in high:
            outputs.setdefault(name, []).append((high[name] - low[name]) / (2.0 * step[i]))
    return np.array(rows), {name: np.array(values) for name, values in outputs.items()}


def _fit(slopes: Array, residual: Array) -> Array:
    return np.asarray(np.linalg.lstsq(slopes.T, residual, rcond=None)[0])


def _variance(residual: Array, name: str) -> float:
    """Variance of a residual times the samples that count as one: the integral of its autocorrelation."""
    x = residual - residual.mean()
    own = np.fft.irfft(np.abs(np.fft.rfft(x, 2 * len(x))) ** 2)[: len(x)] / len(x)
    end = int(np.argmax(own <= 0.0)) or len(own)
    least = LEAST_ALTITUDE_STD_M if name == "altitude_m" else LEAST_ATTITUDE_STD_RAD
    return float(max(own[0] + 2.0 * own[1:end].sum(), least**2))


def _integral(x: Array, dt_s: float) -> Array:
    from scipy.integrate import cumulative_simpson, cumulative_trapezoid  # slow to import

    rule = cumulative_simpson if len(x) > 2 else cumulative_trapezoid
    return np.asarray(rule(x, dx=dt_s, initial=0.0))


__all__ = [
    "COLUMNS",
    "ERRORS",
    "NEEDED",
    "Reconstruction",
    "ReconstructionPriors",
    "is_reconstructed",
    "reconstruct",
]
