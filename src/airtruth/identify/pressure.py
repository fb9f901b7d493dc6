"""Measured airspeed in the regression: equations divided by the dynamic pressure that acted.

With v = V(t)/V0 and p = q_bar(t)/q_bar0 the ratios to the constant flight condition of a record, eq. (4) of
M. Brunot, "An Instrumental Variable Approach for Aircraft Identification", holds sample by sample with the
whole lift, that of the trim included:

    alpha' - q - g/V = -lift0 (p/v) CL,   q' = moment0 p Cm,   az = -normal0 p CL,
    CL = CL0 + CLalpha alpha + (c/2V0) CLq q/v + CLde de, and Cm alike.

Divided by p/v, p and p they have the constant form: the same factors, the regressors alpha, q/v and de, one
free constant each, and on the left (x a)' - x' a for x a', so that a filter may take the derivative.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.identify.options import Options
from airtruth.physics.short_period import Scale
from airtruth.units import G0

Array = NDArray[np.float64]

NO_LEFT: Final = np.empty((0, 4, 0))
"""Left sides of the constant form: the signals themselves tell them."""


def measured_unless_given(options: Options) -> Options:
    """The options with the pressure "method" settled: measured, or constant if the airspeed is given."""
    if options.pressure != "method":
        return options
    return replace(options, pressure="measured" if options.airspeed_m_s is None else "constant")


def ratios(
    airspeed_m_s: Array, density_kg_m3: Array, wing_area_m2: float, mass_kg: float, scale: Scale
) -> tuple[Array, Array]:
    """Airspeed and dynamic pressure over those of the flight condition.

    Parameters
    ----------
    airspeed_m_s, density_kg_m3 : (runs, samples) measured.
    wing_area_m2, mass_kg : S and m.
    scale : constant flight condition, factors (runs,).

    Returns
    -------
    v, p : (runs, samples) [-].
    """
    force = 0.5 * density_kg_m3 * airspeed_m_s**2 * (wing_area_m2 / mass_kg)
    return airspeed_m_s / scale.airspeed_m_s[:, None], force / scale.normal[:, None]


def divide(signals: Array, v: Array, p: Array, airspeed_m_s: Array, dt_s: float) -> Array:
    """Divide q and az of ``signals`` by v and p, in place, and make the left sides.

    Parameters
    ----------
    signals : (runs, 4, samples) alpha [rad], q [rad/s], az [g], elevator [rad].
    v, p : (runs, samples) from `ratios`.
    airspeed_m_s : (runs,) V0.
    dt_s : sample period [s].

    Returns
    -------
    (runs, 4, samples) whose first two are differentiated and whose last two are added to make the left
    sides of lift and moment: x alpha [rad], q/p [rad/s], -x' alpha - x q - g/(V0 p) [rad/s],
    -(1/p)' q [rad/s2], with x = v/p and alpha relative to its mean.
    """
    by_lift, by_moment = v / p, 1.0 / p
    alpha = signals[:, 0] - signals[:, 0].mean(axis=1, keepdims=True)
    q = signals[:, 1].copy()
    signals[:, 1] /= v
    signals[:, 2] /= p
    slope_lift, slope_moment = (np.gradient(x, dt_s, axis=1) for x in (by_lift, by_moment))
    added = -slope_lift * alpha - by_lift * q - G0 / airspeed_m_s[:, None] * by_moment
    return np.stack([by_lift * alpha, by_moment * q, added, -slope_moment * q], axis=1)
