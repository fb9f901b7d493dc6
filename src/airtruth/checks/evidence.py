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
from airtruth.checks.excitation import moves
from airtruth.checks.means import LEVEL, LIMITS, air, gravity, ranges
from airtruth.checks.relation import Relation, finite, informed_everywhere
from airtruth.checks.slopes import slopes_near_trim
from airtruth.checks.spectra import Factors, instruments, integral, regress
from airtruth.checks.together import Runs
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
        return [*result, *gravity(runs, level), *moved]


UNCLEAR: Final = 0.7
"""Squared correlation of theta with the integral of q below which they contradict each other."""
UNCLEAR_WEIGHT: Final = 20.0
"""Distance of theta from q where they have nothing in common [-] (judgement: a turn can do the same)."""
THETA_STD: Final = 0.15
"""Tolerance of the factor of theta on the integral of q [-]: scale and lag of a gyroscope."""
ALPHA_STD: Final = (0.25, 0.25)
"""Tolerances of the factors of alpha on the integrals of q and of the vertical acceleration [-]."""


def motion(runs: Runs, aircraft: Aircraft | None) -> list[Relation]:
    """Changes of the channels against each other."""
    names = set(runs.channels)
    if not {"airspeed_m_s", "q_rad_s", "az_m_s2", "elevator_rad"} <= names:
        return []
    lines = runs.lines()
    turned = runs.spectra(_turned)
    result = []
    if "theta_rad" in names:
        factors = regress(runs.spectra(lambda c, dt_s: c["theta_rad"]), turned[:, None], lines=lines)
        test = _factor_test("theta", ("q_rad_s", "theta_rad"), factors, (THETA_STD,))
        unclear = UNCLEAR_WEIGHT * (1.0 - factors.share) ** 2 * (factors.share < UNCLEAR)
        informed = test.informed & (factors.share > UNCLEAR)
        result.append(replace(test, distance=np.maximum(test.distance, finite(unclear)), informed=informed))
    if "alpha_rad" in names:
        result.append(_alpha_relation(runs, turned, lines))
    angle = (lambda c, dt_s: c["alpha_rad"]) if "alpha_rad" in names else _inertial_alpha
    causes = [
        runs.spectra(lambda c, dt_s, of=of: integral(of(c, dt_s), dt_s))  # type: ignore[misc]
        for of in (lambda c, dt_s: c["elevator_rad"], angle, lambda c, dt_s: c["q_rad_s"])
    ]
    control = regress(runs.spectra(lambda c, dt_s: c["q_rad_s"]), np.stack(causes, axis=1), lines=lines)
    result.append(_sign_test(control))
    if "alpha_rad" in names:
        result += slopes_near_trim(runs, aircraft)
    if "elevator_command_rad" in names:
        result.append(_command_test(runs, lines))
    moving = runs.each(lambda c, dt_s: moves(c["elevator_rad"], dt_s).astype(np.float64)) > 0.0
    return [_of_moving(test, moving) if test.name in OF_ELEVATOR else test for test in result]


def _turned(c: Channels, dt_s: float) -> Array:
    return integral(c["q_rad_s"], dt_s)


def _inertial_alpha(c: Channels, dt_s: float) -> Array:
    """Change of alpha without a vane: the integral of q and of the vertical acceleration over the airspeed.

    A regression of q' on elevator and q alone gives the elevator the pitching moment of alpha, and with it the wrong sign.
    """
    pitch = _turned(c, dt_s)
    attitude = c.get("theta_rad", pitch)
    return pitch + integral((c["az_m_s2"] + G0 * np.cos(attitude)) / c["airspeed_m_s"], dt_s)


def _alpha_relation(runs: Runs, turned: Array, lines: NDArray[np.int64]) -> Relation:
    """Alpha against the integrals of q and of the vertical acceleration, the elevator or its command as the instrument."""

    def heave(c: Channels, dt_s: float) -> Array:
        az, alpha, theta = c["az_m_s2"], c["alpha_rad"], c.get("theta_rad")
        ax = c.get("ax_m_s2", np.zeros_like(az))
        pitch = _turned(c, dt_s)
        level = alpha.mean(axis=1, keepdims=True) - pitch.mean(axis=1, keepdims=True)
        attitude = theta if theta is not None else pitch + level
        force = az * np.cos(alpha) - ax * np.sin(alpha) + G0 * np.cos(attitude - alpha)
        return integral(force / c["airspeed_m_s"], dt_s)

    angle = runs.spectra(lambda c, dt_s: c["alpha_rad"])
    kinematic = np.stack([turned, runs.spectra(heave)], axis=1)

    def by(name: str) -> Factors:
        return regress(angle, kinematic, runs.padded(lambda c, dt_s: instruments(c[name], dt_s)), lines)

    found = _alpha_test(by("elevator_rad"))
    if "elevator_command_rad" in runs.channels:
        by_command = by("elevator_command_rad")
        found = _nearer(found, _alpha_test(by_command), by_command.strength > WEAK)
    return found


OF_ELEVATOR: Final = ("elevator", "Cmde")
"""Tests of what the elevator does, to which a record counts only if its elevator moves."""


def _of_moving(test: Relation, moving: NDArray[np.bool_]) -> Relation:
    """A test without the runs in which nothing moves but the noise of a sensor, which agrees with any motion by chance."""
    counts = np.append(moving, moving.any())
    return replace(test, distance=np.where(counts, test.distance, 0.0), informed=test.informed & counts)


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
    informed = ok & (std < INFORMED).all(axis=1)
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
    informed = np.abs(value) > SIGNED * std
    return Relation(
        "elevator",
        ("elevator_rad", "alpha_rad", "q_rad_s"),
        finite(t**2),
        np.stack([value, std], axis=1),
        informed,
    )


def _command_test(runs: Runs, lines: NDArray[np.int64]) -> Relation:
    """Elevator against its command: factor and delay of the first-order expansion e = k c - k tau c'.

    A pitch damper or an attitude hold adds parts of q, of its integral and of its rate. The expansion with them counts
    where it fits the requirement better.
    """
    elevator = runs.spectra(lambda c, dt_s: c["elevator_rad"])
    causes = [
        runs.spectra(cause)
        for cause in (
            lambda c, dt_s: c["elevator_command_rad"],
            lambda c, dt_s: np.gradient(c["elevator_command_rad"], dt_s, axis=1),
            lambda c, dt_s: c["q_rad_s"],
            _turned,
            lambda c, dt_s: np.gradient(c["q_rad_s"], dt_s, axis=1),
        )
    ]
    plain, looped = (_command_figures(elevator, used, lines) for used in (causes[:2], causes))
    better = looped[0] < plain[0]  # never where it is not finite
    distance = finite(np.where(better, looped[0], plain[0]))
    figures = np.where(better[:, None], looped[1], plain[1])
    channels = ("elevator_command_rad", "elevator_rad")
    return Relation("command", channels, distance, figures, informed_everywhere(distance))


def _command_figures(
    elevator: Array, causes: Sequence[Array], lines: NDArray[np.int64]
) -> tuple[Array, Array]:
    """Squared distance (runs + 1,), and factor and delay with their standard deviations (runs + 1, 4).

    Parameters
    ----------
    elevator, causes : spectra of the elevator, and of the command, its rate, and further causes of the elevator's motion.
    """
    factors = regress(elevator, np.stack(causes, axis=1), lines=lines)
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


__all__ = ["motion", "relations"]
