"""The lateral coefficients of the GTM's tables for many runs at once, with parts of them made linear.

The figures are those of `validation.lateral_flight`; forces act at the aerodynamic reference, coefficients are about the CG.
Nothing of airtruth is imported.
"""

from collections.abc import Collection
from functools import cache

import numpy as np

from validation.lateral_flight import CG, FT, IN, MIRROR, REFERENCE, B, figures

PARTS = ("sideslip", "aileron", "rudder", "rates", "alpha", "trim")
"""Parts that can be made linear: a table by its slope at zero, "alpha" by the tables at the angle of the trim, and "trim" without
the coefficients at zero sideslip, rates and deflections."""
STEPS = np.array([0.5, 1.0, 1.0, 0.5, 0.5])
"""Steps of the slopes at zero: beta [deg], p, r [deg/s] at `SPEED`, aileron, rudder [deg], as for the declared derivatives."""
SPEED = 42.85
_SIDE = slice(1, 6, 2)
"""CY is 1, Cl 3 and Cn 5 of the coefficients of a table."""


@cache
def _table(name):
    points, values = figures(name)
    return points, np.ascontiguousarray(values[..., [1, 3, 5]])


def interpolated(name, *x):
    """(runs, 3) CY, Cl, Cn of a table, linear between its points and held outside."""
    points, values = _table(name)
    runs = np.broadcast(*x).size
    made = values
    corners = []
    for grid, place in zip(points, x, strict=True):
        place = np.clip(np.broadcast_to(place, (runs,)), grid[0], grid[-1])
        at = np.clip(np.searchsorted(grid, place, side="right") - 1, 0, len(grid) - 2)
        corners.append((at, (place - grid[at]) / (grid[at + 1] - grid[at])))
    total = np.zeros((runs, 3))
    for number in range(2 ** len(points)):
        index, weight = [], np.ones(runs)
        for axis, (at, share) in enumerate(corners):
            upper = number >> axis & 1
            index.append(at + upper)
            weight = weight * (share if upper else 1.0 - share)
        total += weight[:, None] * made[tuple(index)]
    return total


def _aileron(alpha, beta, deflection):
    mirror = MIRROR[[1, 3, 5]]
    return interpolated("right_aileron", alpha, beta, deflection) + mirror * interpolated(
        "right_aileron", alpha, -beta, -deflection
    )


def _rudder(alpha, beta, deflection):
    """The table holds negative deflections."""
    mirror = MIRROR[[1, 3, 5]]
    right = interpolated("rudder", alpha, np.where(deflection > 0.0, -beta, beta), -np.abs(deflection))
    return np.where((deflection > 0.0)[:, None], mirror * right, right)


def coefficients(alpha, signals, linear: Collection[str] = ()):
    """(3, runs) CY, Cl, Cn about the CG.

    Parameters
    ----------
    alpha : (runs,) angle of attack [deg].
    signals : (5, runs) beta [rad], p b/(2V), r b/(2V), aileron, rudder [rad].
    linear : of `PARTS`; "alpha" is the caller's.
    """
    beta, aileron, rudder = np.rad2deg(signals[[0, 3, 4]])
    zero = np.zeros_like(beta)
    side, steps = (
        {"sideslip": beta, "aileron": aileron, "rudder": rudder},
        dict(zip(("sideslip", "aileron", "rudder"), STEPS[[0, 3, 4]], strict=True)),
    )
    tables = {
        "sideslip": lambda b, x: interpolated("sideslip", alpha, x),
        "aileron": lambda b, x: _aileron(alpha, b, x),
        "rudder": lambda b, x: _rudder(alpha, b, x),
    }
    total = np.zeros((beta.size, 3))
    for name, table in tables.items():
        step = np.full_like(beta, steps[name])
        if name in linear:
            total += (table(zero, step) - table(zero, -step)) / (2.0 * steps[name]) * side[name][:, None]
        else:
            total += table(beta, side[name])
    for name, rate in zip(("roll_rate", "yaw_rate"), signals[1:3], strict=True):
        size = np.deg2rad(STEPS[1]) * B / (2.0 * SPEED)
        offset = interpolated(name, alpha, zero)
        if "rates" in linear:
            step = np.full_like(beta, size)
            slope = (interpolated(name, alpha, step) - interpolated(name, alpha, -step)) / (2.0 * size)
            total += offset + slope * rate[:, None]
        else:
            total += interpolated(name, alpha, rate)
        if "trim" in linear:
            total -= offset
    return _about_cg(total.T)


def _about_cg(made):
    """Moments of the side force at the reference, x aft and z up of the structure."""
    x, z = (np.array(CG) - np.array(REFERENCE)) * IN
    made[1] -= made[0] * z / B
    made[2] += made[0] * x / B
    return made


def slopes(alpha):
    """(15,) derivatives by central differences at an angle of attack [deg]."""
    sizes = np.concatenate(
        [np.deg2rad(STEPS[:1]), np.deg2rad(STEPS[1:3]) * B / (2.0 * SPEED), np.deg2rad(STEPS[3:])]
    )
    columns = []
    for j, size in enumerate(sizes):
        step = np.zeros((5, 1))
        step[j] = size
        at = np.array([alpha])
        columns.append((coefficients(at, step) - coefficients(at, -step))[:, 0] / (2.0 * size))
    return np.stack(columns, axis=1).ravel()


__all__ = ["FT", "PARTS", "coefficients", "interpolated", "slopes"]
