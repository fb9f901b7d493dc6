"""Records that determine little: the rest of the motion is larger than the elevator's, or the air is rougher than air is."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.checks.rotation import across_flow
from airtruth.checks.spectra import integral
from airtruth.logs.flight_log import Batch
from airtruth.numerics.srivc import filter_states
from airtruth.physics.atmosphere import altitude_of_density_m
from airtruth.physics.gust_figures import gust_scales
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.reconstruction import is_reconstructed
from airtruth.units import DEG, FT

Array = NDArray[np.float64]

MOST_RUNS: Final = 8
"""Runs of a log that are measured [-] (judgement: what drowns one manoeuvre of a flight drowns most)."""
FLOOR: Final = 0.5
"""Share of the variance of q below which the elevator moves the aircraft less than the rest does [-]."""
_NATURAL_RAD_S: Final = 2.0 * np.pi * np.geomspace(0.15, 2.5, 10)
"""Natural frequencies of the transfer functions that are tried [rad/s] (judgement: of short periods)."""
_DAMPING: Final = (0.15, 0.35, 0.6, 1.0)
"""Damping ratios that are tried [-] (judgement)."""
_BAND_HZ: Final = 1.0
"""Band of gusts as an aircraft follows them, which gives the number of independent samples [Hz] (judgement)."""
_FITTED: Final = 4.0
"""Coefficients of a transfer function [-], which explain as many samples by chance (the adjusted coefficient of determination,
H. Theil, *Economic Forecasts and Policy*, 2nd ed., 1961)."""
_LINES: Final = 3
"""Polynomials that are taken out of a difference of angles [-]: biases of q and az, and their drift."""
_COVERED_FT: Final = (10.0, 80000.0)
"""Altitudes that the figures of MIL-F-8785C cover [ft]."""


@dataclass(frozen=True)
class RunMeasures:
    """Measures of one run.

    Attributes
    ----------
    run_id : its name.
    share : share of the variance of q that a second-order transfer function of the elevator explains [-].
    rest_rad_s : root mean square of q without this motion [rad/s].
    gust_m_s : vertical gusts whose angle of attack is that which inertial motion leaves unexplained, rms [m/s]; 0 if alpha was
        computed from this motion.
    severe_m_s : rms of severe turbulence at the altitude (MIL-F-8785C, 3.7) [m/s].
    """

    run_id: str
    share: float
    rest_rad_s: float
    gust_m_s: float
    severe_m_s: float


def measured(batch: Batch) -> list[RunMeasures]:
    """Measures of the first runs of a batch.

    Parameters
    ----------
    batch : runs with elevator_rad, q_rad_s, alpha_rad, az_m_s2 and airspeed_m_s.
    """
    c = {name: values[:MOST_RUNS] for name, values in batch.channels.items()}
    (control,) = LONGITUDINAL.controls
    surface, q = (x - x[:, :1] for x in (c[control.channel], c[control.damped]))
    total = _without_line(q)
    rest = _unexplained(surface, total, batch.dt_s)
    left = (rest**2).mean(axis=1) / np.maximum((total**2).mean(axis=1), 1e-300)
    samples = max(2.0 * _BAND_HZ * batch.dt_s * q.shape[1], _FITTED + 1.0)
    share = np.maximum(1.0 - left * samples / (samples - _FITTED), 0.0)
    gusts = np.zeros(len(q)) if is_reconstructed(batch.channels) else _gusts_m_s(c, batch.dt_s)
    altitude = c["altitude_m"] if "altitude_m" in c else altitude_of_density_m(c["density_kg_m3"])
    severe = np.array([severe_m_s(float(one)) for one in np.nan_to_num(altitude).mean(axis=1)])
    rms = np.sqrt((rest**2).mean(axis=1))
    # a pitch rate that does not move has no share
    moving = np.ptp(c[control.damped], axis=1) > 0.0
    share = np.where(moving, share, 1.0)
    rows = zip(batch.run_ids, share.tolist(), rms.tolist(), gusts.tolist(), severe.tolist(), strict=False)
    return [RunMeasures(*row) for row in rows]


def _unexplained(surface: Array, q: Array, dt_s: float) -> Array:
    """q less the response of the transfer function (b1 p + b2)/(p^2 + 2 z w p + w^2) of the surface that explains most of it.

    For each w and z of a grid b1 and b2 follow by least squares; a search for the poles may end without a stable model.
    """
    best = q
    for natural in _NATURAL_RAD_S:
        for damping in _DAMPING:
            poles = np.tile([2.0 * damping * natural, natural**2], (len(q), 1))
            states = filter_states(poles, surface, dt_s, "foh")
            basis = np.linalg.qr(np.stack([_without_line(states[:, k]) for k in range(2)], axis=2))[0]
            rest = q - np.einsum("rnk,rk->rn", basis, np.einsum("rnk,rn->rk", basis, q))
            better = (rest**2).sum(axis=1) < (best**2).sum(axis=1)
            best = np.where(better[:, None], rest, best)
    return np.asarray(best)


def _gusts_m_s(c: dict[str, Array], dt_s: float) -> Array:
    """rms of V (alpha - integral of q + (az cos alpha - ax sin alpha + g cos(theta - alpha))/V), a parabola taken out [m/s]."""
    alpha, q, az = (c[name] for name in LONGITUDINAL.output_channels)
    speed = np.maximum(np.abs(c["airspeed_m_s"]), 1.0)
    turned = integral(q, dt_s)
    theta = c.get(
        "theta_rad", turned - turned.mean(axis=1, keepdims=True) + alpha.mean(axis=1, keepdims=True)
    )
    ax = c.get("ax_m_s2", np.zeros_like(alpha))
    force = across_flow(az, ax, alpha, theta)
    basis = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, alpha.shape[1]), _LINES))[0]
    left = alpha - turned - integral(force / speed, dt_s)
    left = left - (left @ basis) @ basis.T
    return np.asarray(speed.mean(axis=1) * left.std(axis=1))


def severe_m_s(altitude_m: float) -> float:
    """Vertical gusts of severe turbulence, rms [m/s] (MIL-F-8785C, 3.7).

    Parameters
    ----------
    altitude_m : above the sea, so that the gusts are not too low near the ground [m]; outside the range of the figures, the
        end of that range counts.
    """
    feet = float(np.clip(altitude_m / FT, *_COVERED_FT))
    return gust_scales("mil-f-8785c", "severe", feet * FT).sigma_w_m_s


def _without_line(x: Array) -> Array:
    line = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, x.shape[1]), 2))[0]
    return np.asarray(x - (x @ line) @ line.T)


def words(records: Sequence[RunMeasures]) -> Iterator[str]:
    """Sentences about runs that determine little: the reason, then the figures of the worst of them."""
    drowned = [one for one in records if one.share < FLOOR]
    if drowned:
        worst = min(drowned, key=lambda one: one.share)
        moved = worst.rest_rad_s / DEG * np.sqrt(worst.share / max(1.0 - worst.share, 1e-9))
        yield (
            f"Warning: the elevator moves the aircraft less than the rest does{_some(drowned, records)}: gusts, noise or a pilot "
            f"who reacts to the motion. The elevator explains {100.0 * worst.share:.0f} % of the variance of q in run "
            f"{worst.run_id!r}, {moved:.2g} deg/s beside {worst.rest_rad_s / DEG:.2g} deg/s; fly a larger input, or in calmer "
            "air."
        )
    rough = [one for one in records if one.gust_m_s > one.severe_m_s]
    if rough:
        worst = max(rough, key=lambda one: one.gust_m_s / one.severe_m_s)
        yield (
            "Warning: alpha_rad departs from the inertial motion by more than severe turbulence explains"
            f"{_some(rough, records)}: the vane, its calibration, its time, or the airspeed is wrong rather than the air. In run "
            f"{worst.run_id!r} the departure is that of gusts of {worst.gust_m_s:.2g} m/s, and severe turbulence has "
            f"{worst.severe_m_s:.2g} m/s there (MIL-F-8785C)."
        )


def _some(bad: Sequence[RunMeasures], all_of_them: Sequence[RunMeasures]) -> str:
    return "" if len(all_of_them) == 1 else f" in {len(bad)} of {len(all_of_them)} runs"


__all__ = ["FLOOR", "MOST_RUNS", "RunMeasures", "measured", "severe_m_s", "words"]
