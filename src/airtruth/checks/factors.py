"""Factors of a regression between channels as tests: a factor of one, the sign of a surface, a surface and its command."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.checks.relation import Relation, finite, informed_everywhere
from airtruth.checks.spectra import Factors, integral, regress
from airtruth.checks.together import Runs
from airtruth.physics.motion_parts import Control

Array = NDArray[np.float64]

UNCLEAR: Final = 0.7
"""Squared correlation of theta with the integral of q below which they contradict each other."""
UNCLEAR_WEIGHT: Final = 20.0
"""Distance of theta from q where they have nothing in common [-] (judgement: a turn can do the same)."""
INFORMED: Final = 0.5
"""Standard deviation of a factor above which it tells nothing [-]."""
SIGNED: Final = 3.0
"""Standard deviations by which a surface's effect must differ from zero to have a sign."""
WEAK: Final = 10.0
"""First-stage F below which the manoeuvre does not move the regressors enough (D. Staiger and J. H. Stock,
*Econometrica* 65(3), 1997: the rule of thumb of 10)."""


def factor_test(
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


def follows_test(name: str, channels: tuple[str, ...], factors: Factors, std: float) -> Relation:
    """Distance of an attitude from the integral of its rate: of the factor from one, or of nothing in common."""
    test = factor_test(name, channels, factors, (std,))
    unclear = UNCLEAR_WEIGHT * (1.0 - factors.share) ** 2 * (factors.share < UNCLEAR)
    informed = test.informed & (factors.share > UNCLEAR)
    return replace(test, distance=np.maximum(test.distance, finite(unclear)), informed=informed)


def nearer(by_surface: Relation, by_command: Relation, is_strong: NDArray[np.bool_]) -> Relation:
    """The relation with the smaller distance of two instruments, where the command is a strong one.

    A damper moves the elevator with the gusts that move alpha. The elevator is no valid instrument then; the pilot's command is.
    """
    smaller = np.minimum(by_surface.distance, by_command.distance)
    return replace(by_surface, distance=np.where(is_strong, smaller, by_surface.distance))


def sign_test(name: str, channels: tuple[str, ...], control: Factors) -> Relation:
    """Squared t-statistic of a surface, the first cause, that turns the aircraft the wrong way: up, or to the right."""
    value, std = control.value[:, 0], np.sqrt(control.covariance[:, 0, 0])
    t = np.maximum(value, 0.0) / std
    informed = np.abs(value) > SIGNED * std
    return Relation(name, channels, finite(t**2), np.stack([value, std], axis=1), informed)


def command_test(runs: Runs, control: Control) -> Relation:
    """Surface against its command: factor and delay of the first-order expansion e = k c - k tau c'.

    A damper or an attitude hold adds parts of a rate, of its integral and of its derivative. The expansion with them counts
    where it fits the requirement better.
    """
    lines, rate = runs.lines(), control.damped
    surface = runs.spectra(lambda c, dt_s: c[control.channel])
    causes = [
        runs.spectra(cause)
        for cause in (
            lambda c, dt_s: c[control.command],
            lambda c, dt_s: np.gradient(c[control.command], dt_s, axis=1),
            lambda c, dt_s: c[rate],
            lambda c, dt_s: integral(c[rate], dt_s),
            lambda c, dt_s: np.gradient(c[rate], dt_s, axis=1),
        )
    ]
    plain, looped = (_command_figures(surface, used, lines) for used in (causes[:2], causes))
    better = looped[0] < plain[0]  # never where it is not finite
    distance = finite(np.where(better, looped[0], plain[0]))
    figures = np.where(better[:, None], looped[1], plain[1])
    channels = (control.command, control.channel)
    return Relation("command", channels, distance, figures, informed_everywhere(distance))


def _command_figures(
    surface: Array, causes: Sequence[Array], lines: NDArray[np.int64]
) -> tuple[Array, Array]:
    """Squared distance (runs + 1,), and factor and delay with their standard deviations (runs + 1, 4).

    Parameters
    ----------
    surface, causes : spectra of the surface, and of the command, its rate, and further causes of the surface's motion.
    """
    factors = regress(surface, np.stack(causes, axis=1), lines=lines)
    factor = factors.value[:, 0]
    std = np.sqrt(np.diagonal(factors.covariance, axis1=1, axis2=2))
    delay = -factors.value[:, 1] / factor
    delay_std = std[:, 1] / np.abs(factor)
    early = np.minimum(delay, 0.0) / np.sqrt(delay_std**2 + EARLY_STD_S**2)
    against = np.minimum(factor, 0.0) / std[:, 0]
    size = np.log(np.maximum(np.abs(factor), 1e-9)) / np.sqrt(COMMAND_STD**2 + (std[:, 0] / factor) ** 2)
    return early**2 + against**2 + size**2, np.stack([factor, std[:, 0], delay, delay_std], axis=1)


COMMAND_STD: Final = 0.7
"""Tolerance of the logarithm of a surface's factor on its command [-]: the slack of a cable leaves a third."""
EARLY_STD_S: Final = 0.003
"""Tolerance of a surface that leads its command [s]: time stamps (judgement)."""


def of_moving(test: Relation, moving: NDArray[np.bool_]) -> Relation:
    """A test without the runs in which nothing moves but the noise of a sensor, which agrees with any motion by chance."""
    counts = np.append(moving, moving.any())
    return replace(test, distance=np.where(counts, test.distance, 0.0), informed=test.informed & counts)


__all__ = ["WEAK", "command_test", "factor_test", "follows_test", "nearer", "of_moving", "sign_test"]
