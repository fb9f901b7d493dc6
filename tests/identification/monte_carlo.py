"""Spread and coverage of an estimator over many records in gusts, whose truth is known."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from airtruth.identification import Estimates, quantities
from airtruth.identification.likelihood.cramer_rao import experiment_bound
from airtruth.identification.likelihood.options import FilterOptions
from airtruth.physics.short_period import modal
from validation.linear_flight import GTM, LIGHT, NOISE, THETA, fly, gtm_scale

Array = NDArray[np.float64]
AIRSPEED_STD_M_S = 0.0309
"""Noise of the airspeed of records that measure it [m/s]."""


def efficiency_percent(estimates: Estimates, airspeed: bool) -> Array:
    """Cramer-Rao bound over the mean square error of each derivative [%], with the gust in the airspeed or without."""
    levels = (*NOISE[:3], LIGHT[0] * 2.0, LIGHT[1] * 2.0, LIGHT[2], LIGHT[3])
    more = {"airspeed_std_m_s": AIRSPEED_STD_M_S, "airspeed_m_s": 42.85} if airspeed else {}
    bound = experiment_bound(fly(), GTM, THETA, FilterOptions(*levels, **more))[0]
    return 100.0 * np.diag(bound) / ((estimates.theta - THETA) ** 2).mean(axis=0)


def coverage(estimates: Estimates, airspeed: bool) -> Array:
    """Share of 95 % intervals that hold the truth: derivatives, and with a constant airspeed also wn and zeta.

    With a measured airspeed wn refers to that of the record, which is not the reference's.
    """
    q = quantities(estimates)
    truth = np.append(THETA, modal(THETA, gtm_scale()))
    cover = ((q.lower < truth) & (truth < q.upper)).mean(axis=0)
    return cover[:6] if airspeed else cover
