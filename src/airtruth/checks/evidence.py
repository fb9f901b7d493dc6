"""Physical tests of a log: how far each relation between channels is from the one that physics requires.

Body axes, wings level, air at rest (R. V. Jategaonkar, *Flight Vehicle System Identification*, 2006, eqs 10.7
and 10.8), with the specific forces ax, az and the flight-path angle gamma = theta - alpha:

    theta' = q
    alpha' = q + (az cos(alpha) - ax sin(alpha) + g cos(gamma))/V
    u'     = ax - q w - g sin(theta),  u = V cos(alpha),  w = V sin(alpha)

Each test returns a squared distance: the squared deviation of an estimate from its required value over its
variance, which is the sum of the sampling variance and of a tolerance for what a faultless log may show
(positions and lags of sensors, biases, gusts). About 1 is expected of a faultless log.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.channels import SIGNALS
from airtruth.checks.excitation import moves
from airtruth.checks.relation import ATMOSPHERE_M, Relation, finite
from airtruth.checks.slopes import slopes_near_trim
from airtruth.checks.spectra import Factors, instruments, integral, regress, spectrum
from airtruth.logs.flight_log import Batch
from airtruth.physics.atmosphere import density_kg_m3
from airtruth.physics.reconstruction import is_reconstructed
from airtruth.units import DEG, G0

Array = NDArray[np.float64]
Channels = Mapping[str, Array]

OUTSIDE: Final = 1000.0
"""Distance of a channel that leaves the range of flight [-]; larger than any sum of the others that matters."""
LIMITS: Final = {
    **{signal.name: (-signal.limit, signal.limit) for signal in SIGNALS.values()},
    "elevator_rad": (-45.0 * DEG, 45.0 * DEG),
    "throttle": (-0.05, 1.05),
}
"""Range of every sample, SI (judgement: no aircraft leaves it; one degree taken as one radian usually does)."""
MEANS: Final = {
    "airspeed_m_s": (5.0, 700.0),
    "density_kg_m3": (0.088, 1.478),
    "altitude_m": (-500.0, 20000.0),
}
"""Range of a run's mean, SI; the densities are those of the standard atmosphere at the ends of `ATMOSPHERE_M`."""


def relations(batch: Batch, aircraft: Aircraft | None = None) -> list[Relation]:
    """Every test that the channels allow.

    A reconstructed alpha lacks the gusts, which then bias the slopes of a regression: these are not compared.
    """
    if is_reconstructed(batch.channels):
        aircraft = None
    c = {name: values for name, values in batch.channels.items() if name in LIMITS}
    result = [*ranges(c), *air(c)]
    with np.errstate(all="ignore"):
        moved = motion(c, batch.dt_s, aircraft)
        level = next((t.distance[:-1] < LEVEL for t in moved if t.name == "theta"), None)
        return [*result, *gravity(c, batch.dt_s, level), *moved]


def ranges(c: Channels) -> list[Relation]:
    """Samples and means that no flight has."""
    result = []
    for name, values in c.items():
        low, high = LIMITS[name]
        mean = values.mean(axis=1)
        mean_low, mean_high = MEANS.get(name, (-np.inf, np.inf))
        bad = (
            (values.min(axis=1) < low) | (values.max(axis=1) > high) | (mean < mean_low) | (mean > mean_high)
        )
        if bad.any():
            figures = np.stack([values.min(axis=1), mean, values.max(axis=1)], axis=1)
            worst = figures[bad][:1]
            result.append(
                Relation("range", (name,), _with_all(OUTSIDE * bad), np.concatenate([figures, worst]))
            )
    return result


DENSITY_STD: Final = 0.05
"""Standard deviation of the logarithm of density over that of the standard atmosphere [-].

15 K of 288 K; flight tests happen within 40 K of the standard temperature.
"""


def air(c: Channels) -> list[Relation]:
    """Density against that of the standard atmosphere at the altitude."""
    if not {"density_kg_m3", "altitude_m"} <= c.keys():
        return []
    density, altitude = c["density_kg_m3"].mean(axis=1), c["altitude_m"].mean(axis=1)
    standard = density_kg_m3(np.clip(altitude, *ATMOSPHERE_M))
    deviation = np.log(np.maximum(density, 1e-6) / standard)
    figures = np.stack([density, altitude, standard], axis=1)
    return [
        Relation(
            "air",
            ("density_kg_m3", "altitude_m"),
            _with_all((deviation / DENSITY_STD) ** 2),
            np.concatenate([figures, figures.mean(axis=0, keepdims=True)]),
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
END_S: Final = 0.3
"""Samples at both ends of a run whose means are the end values [s]."""
SPREAD_LIMIT: Final = 1.0
"""Multiples of the standard deviation of a detrended channel by which the slope between its ends may err [-]."""


PATH: Final = ("az_m_s2", "theta_rad", "alpha_rad", "airspeed_m_s", "q_rad_s")
"""Channels of the test "az_mean"."""


def gravity(c: Channels, dt_s: float, level: NDArray[np.bool_] | None = None) -> list[Relation]:
    """Means of az and ax against those that gravity and the path require.

    Parameters
    ----------
    c : channels (runs, samples).
    dt_s : sample period [s].
    level : (runs,) whether the wings are known to be level; None if nothing is known.
    """
    if not {"airspeed_m_s", "alpha_rad", "q_rad_s", "az_m_s2"} <= c.keys():
        return []
    v, alpha, q, az = (c[n] for n in ("airspeed_m_s", "alpha_rad", "q_rad_s", "az_m_s2"))
    theta = c.get("theta_rad")
    samples = v.shape[1]
    head = max(1, min(round(END_S / dt_s), samples // 4))
    length_s = (samples - head) * dt_s

    def slope(x: Array) -> tuple[Array, Array]:
        """Mean rate between the ends, and its standard deviation if the channel is noise about a line."""
        rate = (x[:, -head:].mean(axis=1) - x[:, :head].mean(axis=1)) / length_s
        line = np.linspace(-1.0, 1.0, samples)
        rest = x - x.mean(axis=1, keepdims=True) - np.outer(x @ line / (line @ line), line)
        return rate, SPREAD_LIMIT * rest.std(axis=1) * np.sqrt(2.0) / length_s

    speed = v.mean(axis=1)
    path = theta - alpha if theta is not None else np.zeros_like(alpha)
    turn, turn_std = slope(alpha)
    pitch, gyro_std = (slope(theta)[0], 0.0) if theta is not None else (q.mean(axis=1), GYRO_STD_RAD_S)
    required = -G0 * np.cos(path).mean(axis=1) + speed * (turn - pitch)
    path_std = PATH_SHARE * speed * np.abs(turn - pitch)
    mean = az.mean(axis=1)
    turning = (mean < required) if level is None else (mean < required) & ~level
    load_std = np.where(turning, TURN_STD, LOAD_STD) * G0
    std = np.sqrt(load_std**2 + (speed * gyro_std) ** 2 + (speed * turn_std) ** 2 + path_std**2)
    result = [_mean_test("az_mean", PATH, mean, required, std, LOAD_STD * G0)]
    if theta is not None and "ax_m_s2" in c:
        rate, rate_std = slope(v * np.cos(alpha))
        required = rate + (G0 * np.sin(theta) + q * v * np.sin(alpha)).mean(axis=1)
        std = np.sqrt(AXIAL_STD_M_S2**2 + rate_std**2 + rate**2)
        channels = ("ax_m_s2", "theta_rad", "alpha_rad", "q_rad_s", "airspeed_m_s")
        result.append(
            _mean_test("ax_mean", channels, c["ax_m_s2"].mean(axis=1), required, std, AXIAL_STD_M_S2)
        )
    return result


def _mean_test(
    name: str, channels: tuple[str, ...], mean: Array, required: Array, std: Array, common: float
) -> Relation:
    """Distance of means from the required ones; ``common`` is the part of std that all runs share."""
    distance = ((mean - required) / std) ** 2
    figures = np.stack([mean, required, std], axis=1)
    together = figures.mean(axis=0, keepdims=True)
    own = max(float(np.mean(std**2)) - common**2, 0.0)
    together[0, 2] = np.sqrt(common**2 + own / len(mean))
    pooled = ((together[0, 0] - together[0, 1]) / together[0, 2]) ** 2
    return Relation(name, channels, finite(np.append(distance, pooled)), np.concatenate([figures, together]))


UNCLEAR: Final = 0.7
"""Squared correlation of theta with the integral of q below which they contradict each other."""
UNCLEAR_WEIGHT: Final = 20.0
"""Distance of theta from q where they have nothing in common [-] (judgement: a turn can do the same)."""
THETA_STD: Final = 0.15
"""Tolerance of the factor of theta on the integral of q [-]: scale and lag of a gyroscope."""
ALPHA_STD: Final = (0.25, 0.25)
"""Tolerances of the factors of alpha on the integrals of q and of the vertical acceleration [-]."""


def motion(c: Channels, dt_s: float, aircraft: Aircraft | None) -> list[Relation]:
    """Changes of the channels against each other."""
    if not {"airspeed_m_s", "alpha_rad", "q_rad_s", "az_m_s2", "elevator_rad"} <= c.keys():
        return []
    v, alpha, q, az, elevator = (
        c[n] for n in ("airspeed_m_s", "alpha_rad", "q_rad_s", "az_m_s2", "elevator_rad")
    )
    theta, ax = c.get("theta_rad"), c.get("ax_m_s2", np.zeros_like(az))
    turned, pitched = integral(q, dt_s), spectrum(integral(q, dt_s), dt_s)
    result = []
    if theta is not None:
        factors = regress(spectrum(theta, dt_s), pitched[:, None])
        test = _factor_test("theta", ("q_rad_s", "theta_rad"), factors, (THETA_STD,))
        unclear = UNCLEAR_WEIGHT * (1.0 - factors.share) ** 2 * (factors.share < UNCLEAR)
        informed = test.informed and bool(factors.share[-1] > UNCLEAR)
        result.append(replace(test, distance=np.maximum(test.distance, finite(unclear)), informed=informed))
    attitude = theta if theta is not None else turned - turned.mean(axis=1, keepdims=True) + alpha.mean()
    force = az * np.cos(alpha) - ax * np.sin(alpha) + G0 * np.cos(attitude - alpha)
    heave = spectrum(integral(force / v, dt_s), dt_s)
    angle = spectrum(alpha, dt_s)
    kinematic = np.stack([pitched, heave], axis=1)
    result.append(_alpha_test(regress(angle, kinematic, instruments(elevator, dt_s))))
    if "elevator_command_rad" in c:
        by_command = regress(angle, kinematic, instruments(c["elevator_command_rad"], dt_s))
        result[-1] = _nearer(result[-1], _alpha_test(by_command), by_command.strength > WEAK)
    causes = [spectrum(integral(x, dt_s), dt_s) for x in (elevator, alpha, q)]
    control = regress(spectrum(q, dt_s), np.stack(causes, axis=1))
    result.append(_sign_test(control))
    result += slopes_near_trim(c, dt_s, aircraft)
    if "elevator_command_rad" in c:
        result.append(_command_test(c, dt_s))
    moving = moves(elevator, dt_s)
    return [_of_moving(test, moving) if test.name in OF_ELEVATOR else test for test in result]


OF_ELEVATOR: Final = ("elevator", "Cmde")
"""Tests of what the elevator does, to which a record counts only if its elevator moves."""


def _of_moving(test: Relation, moving: NDArray[np.bool_]) -> Relation:
    """A test without the runs in which nothing moves but the noise of a sensor, which agrees with any motion by chance."""
    counts = np.append(moving, moving.any())
    informed = test.informed and bool(moving.any())
    return replace(test, distance=np.where(counts, test.distance, 0.0), informed=informed)


INFORMED: Final = 0.5
"""Standard deviation of a factor above which it tells nothing [-]."""
SIGNED: Final = 3.0
"""Standard deviations by which the elevator's effect must differ from zero to have a sign."""
WEAK: Final = 10.0
"""First-stage F below which the manoeuvre does not move the regressors enough (D. Staiger and J. H. Stock,
*Econometrica* 65(3), 1997: the rule of thumb of 10)."""


def _factor_test(
    name: str, channels: tuple[str, ...], factors: Factors, tolerance: Sequence[float]
) -> Relation:
    """Distance of factors from one."""
    off = factors.value - 1.0
    covariance = factors.covariance + np.diag(np.square(tolerance))
    ok = np.isfinite(factors.value).all(axis=1) & np.isfinite(covariance).all(axis=(1, 2))
    ok &= factors.strength > WEAK
    covariance = np.where(ok[:, None, None], covariance, np.eye(len(tolerance)))
    distance = np.einsum("rk,rk->r", off, np.linalg.solve(covariance, off[..., None])[..., 0])
    std = np.sqrt(np.diagonal(factors.covariance, axis1=1, axis2=2))
    figures = np.concatenate([factors.value, std, factors.share[:, None], factors.strength[:, None]], axis=1)
    informed = bool(ok[-1] and (std[-1] < INFORMED).all())
    return Relation(name, channels, np.where(ok, distance, 0.0), figures, informed)


def _alpha_test(factors: Factors) -> Relation:
    channels = ("alpha_rad", "airspeed_m_s", "az_m_s2", "q_rad_s", "theta_rad")
    return _factor_test("alpha", channels, factors, ALPHA_STD)


def _nearer(by_elevator: Relation, by_command: Relation, is_strong: NDArray[np.bool_]) -> Relation:
    """The relation with the smaller distance of two instruments, where the command is a strong one.

    A damper moves the elevator with the gusts that move alpha. The elevator is no valid instrument then; the pilot's command is.
    """
    smaller = np.minimum(by_elevator.distance, by_command.distance)
    return replace(by_elevator, distance=np.where(is_strong, smaller, by_elevator.distance))


def _sign_test(control: Factors) -> Relation:
    """Squared t-statistic of an elevator that pitches the nose up."""
    value, std = control.value[:, 0], np.sqrt(control.covariance[:, 0, 0])
    t = np.maximum(value, 0.0) / std
    informed = bool(abs(value[-1]) > SIGNED * std[-1])
    return Relation(
        "elevator",
        ("elevator_rad", "alpha_rad", "q_rad_s"),
        finite(t**2),
        np.stack([value, std], axis=1),
        informed,
    )


def _command_test(c: Channels, dt_s: float) -> Relation:
    """Elevator against its command: factor and delay of the first-order expansion e = k c - k tau c'.

    A pitch damper or an attitude hold adds parts of q, of its integral and of its rate. The expansion with them counts
    where it fits the requirement better.
    """
    command, elevator, q = c["elevator_command_rad"], c["elevator_rad"], c["q_rad_s"]
    rate = np.gradient(command, dt_s, axis=1)
    fed_back = [q, integral(q, dt_s), np.gradient(q, dt_s, axis=1)]
    plain, looped = (_command_figures(elevator, [command, rate, *more], dt_s) for more in ([], fed_back))
    better = looped[0] < plain[0]  # never where it is not finite
    distance = np.where(better, looped[0], plain[0])
    figures = np.where(better[:, None], looped[1], plain[1])
    return Relation("command", ("elevator_command_rad", "elevator_rad"), finite(distance), figures)


def _command_figures(elevator: Array, causes: Sequence[Array], dt_s: float) -> tuple[Array, Array]:
    """Squared distance (runs + 1,), and factor and delay with their standard deviations (runs + 1, 4).

    Parameters
    ----------
    causes : the command, its rate, and further causes of the elevator's motion.
    """
    factors = regress(spectrum(elevator, dt_s), np.stack([spectrum(x, dt_s) for x in causes], axis=1))
    factor = factors.value[:, 0]
    std = np.sqrt(np.diagonal(factors.covariance, axis1=1, axis2=2))
    delay = -factors.value[:, 1] / factor
    delay_std = std[:, 1] / np.abs(factor)
    early = np.minimum(delay, 0.0) / np.sqrt(delay_std**2 + EARLY_STD_S**2)
    against = np.minimum(factor, 0.0) / std[:, 0]
    size = np.log(np.maximum(np.abs(factor), 1e-9)) / np.sqrt(COMMAND_STD**2 + (std[:, 0] / factor) ** 2)
    return early**2 + against**2 + size**2, np.stack([factor, std[:, 0], delay, delay_std], axis=1)


COMMAND_STD: Final = 0.7
"""Tolerance of the logarithm of the elevator's factor on its command [-]: the slack of a cable leaves a third."""
EARLY_STD_S: Final = 0.003
"""Tolerance of an elevator that leads its command [s]: time stamps (judgement)."""


def _with_all(distance: Array) -> Array:
    """A row for all runs together: the median over the runs."""
    return finite(np.append(distance, np.median(distance)))


__all__ = ["LIMITS", "MEANS", "OUTSIDE", "air", "gravity", "motion", "ranges", "relations"]
