"""The lateral motion as known inputs of the pitch plane, for records of both motions.

    alpha' = q - (p cos(alpha) + r sin(alpha)) tan(beta) + (g/V) cos(theta') - lift/(m V)
    Iyy q' = M + (Izz - Ixx) p r - Ixz (p^2 - r^2)

Lift and M contain what sideslip, roll, yaw and the lateral surfaces add to them. The declared aircraft states no derivatives
of it, so that it is estimated: by equation error, from az and q', beside the longitudinal regressors.

Source: V. Klein and E. A. Morelli, Aircraft System Identification, AIAA, 2006, 3.2 (equations of motion), 3.4 (terms of the
aerodynamic model in both motions), 5.1.1 (equation error).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.checks.rotation import alpha_coupling
from airtruth.checks.spectra import integral
from airtruth.identification.excited import excites
from airtruth.identification.options import Options
from airtruth.identification.record_constants import stated_value
from airtruth.logs.flight_log import Batch
from airtruth.numerics.prefilter import butterworth, zero_phase
from airtruth.physics.atmosphere import air_density
from airtruth.physics.linear_model import Structure
from airtruth.physics.motion import LATERAL, LONGITUDINAL
from airtruth.physics.short_period import PitchConstants, scale_of, structure

Array = NDArray[np.float64]

_LEAST: Final = 0.02
"""Pitch rate that the lateral motion causes, over that of the record, from which the motion is an input [-]; judgement: below it
the derivatives move by less than their standard errors in a record."""
_RANK: Final = 0.01
"""Least singular value of the regressors over the largest, each of zero mean and unit length [-]; judgement: a regressor closer
to the others is noise of its sensor."""
ROLLS: Final = (
    "Note: the lateral motion causes part of the pitch rate. Roll, yaw, sideslip and bank are known inputs. The forces that they "
    "and the lateral surfaces cause in the pitch plane are estimated by equation error and taken out; the intervals do not "
    "contain the uncertainty of these forces."
)
"""Note about records in which the lateral motion is an input."""
_Q, _P, _R = (s.channel for m in (LONGITUDINAL, LATERAL) for s in m.signals if s.length is not None)
_NORMAL: Final = LONGITUDINAL.outputs[-1].channel
"""Channel of the specific force that shows lift."""


def lateral_rates(batch: Batch, constants: object) -> tuple[Array, Array]:
    """Parts of alpha' [rad/s] and q' [rad/s2] that rotation and inertia cause in the lateral motion, (runs, samples) each.

    Zero where the log lacks p, r or the sideslip, where the aircraft states no inertias, and in runs whose lateral motion causes
    less than `_LEAST` of the pitch rate.

    Parameters
    ----------
    batch : runs with alpha and q.
    constants : the aircraft; its inertias Iyy, Ixx, Izz and Ixz [kg m2].
    """
    turn, pitch = _rotation(batch, constants)
    counts = _counts(batch, pitch)
    return np.where(counts, turn, 0.0), np.where(counts, pitch, 0.0)


def beside_lateral(batch: Batch, constants: PitchConstants, options: Options) -> Batch:
    """The runs of the pitch plane with the rates that the lateral motion causes as known inputs, and without its normal force.

    A run stays as it is where the lateral motion causes less than `_LEAST` of the pitch rate.

    Parameters
    ----------
    batch : runs with the channels of the pitch plane, airspeed and density or altitude.
    constants : the aircraft; without its inertias in roll and yaw the products of the rates are left out.
    options : low-pass of the equation error.
    """
    rotation, excited = np.stack(_rotation(batch, constants)), excites(batch.channels, LATERAL)
    if not (rotation.any() or excited.any()):
        return batch
    own = structure(scale_of(constants, batch.channels["airspeed_m_s"], air_density(batch.channels)))
    added = _forces(batch, own, rotation, excited, options)
    rates = rotation + np.einsum("rksc,rkc->srk", own.forces, added)
    specific_force_m_s2 = np.einsum("rkc,rkc->rk", own.accelerations[..., -1, :], added)
    counts = _counts(batch, rates[-1])
    if not counts.any():
        return batch
    channels = {
        **batch.channels,
        _NORMAL: batch.channels[_NORMAL] - np.where(counts, specific_force_m_s2, 0.0),
    }
    return replace(batch, channels=channels, known_rates=np.where(counts, rates, 0.0))


def _rotation(batch: Batch, constants: object) -> tuple[Array, Array]:
    """Parts of alpha' [rad/s] and q' [rad/s2] by rotation and inertia; zero where a channel or an inertia is missing."""
    c = batch.channels
    alpha = c[LONGITUDINAL.vane]
    ixx, iyy, izz, ixz = (
        stated_value(constants, f"inertia_{axes}_kg_m2") for axes in ("xx", "yy", "zz", "xz")
    )
    if not ({_P, _R, LATERAL.vane} <= set(c) and ixx > 0.0 and izz > 0.0):
        return np.zeros_like(alpha), np.zeros_like(alpha)
    p, r = c[_P], c[_R]
    pitch = ((izz - ixx) * p * r - ixz * (p**2 - r**2)) / iyy
    return alpha_coupling(p, r, alpha, c[LATERAL.vane]), pitch


def _counts(batch: Batch, pitch_rad_s2: Array) -> NDArray[np.bool_]:
    """(runs, 1) whether a pitch acceleration causes at least `_LEAST` of the pitch rate."""
    q = batch.channels[_Q]
    caused = integral(pitch_rad_s2, batch.dt_s)
    # a constant moment is a trim: its integral is a trend
    time = np.linspace(-1.0, 1.0, q.shape[1])
    time /= np.linalg.norm(time)
    caused -= caused.mean(axis=1, keepdims=True)
    caused -= (caused @ time)[:, None] * time
    return np.asarray((caused.std(axis=1) > _LEAST * q.std(axis=1))[:, None])


def _forces(
    batch: Batch, own: Structure, rotation: Array, excited: NDArray[np.bool_], options: Options
) -> Array:
    """Coefficients that the lateral motion adds by equation error, (runs, samples, coefficients); zero in runs without it.

    Regressors: the signals of the longitudinal motion and those of the lateral one; squares and absolute values of sideslip and
    of the lateral surfaces, since the pitch plane of a symmetric aircraft is even in them.
    """
    c, dt_s = batch.channels, batch.dt_s
    speed = c["airspeed_m_s"]
    signals = [c[s.channel] * own.rates[..., i] for i, s in enumerate(LONGITUDINAL.signals)]
    logged = [s for s in LATERAL.signals if s.channel in c]
    even = [c[s.channel] for s in logged if s.length is None]
    lateral = [c[s.channel] / speed for s in logged if s.length is not None]
    lateral += [*even, *(np.abs(x) for x in even), *(x**2 for x in even)]
    left = [
        c[_NORMAL] / own.accelerations[..., -1, 0],
        (np.gradient(c[_Q], dt_s, axis=1) - rotation[-1]) / own.forces[..., -1, -1],
    ]
    added = np.zeros((*speed.shape, len(left)))
    if not excited.any():
        return added
    whole = np.stack([*signals, *lateral, *left], axis=1)[excited]
    smooth = zero_phase(whole, butterworth(options.cutoff_of(dt_s), options.order, dt_s))
    smooth -= smooth.mean(axis=2, keepdims=True)
    of_lateral = slice(len(signals), len(signals) + len(lateral))
    found = _least_squares(smooth[:, : -len(left)], smooth[:, -len(left) :])[:, of_lateral]
    added[excited] = np.einsum("rnk,rnc->rkc", whole[:, of_lateral], found)
    return added


def _least_squares(x: Array, y: Array) -> Array:
    """Coefficients (runs, regressors, left sides) of least length over the directions that `_RANK` keeps.

    Parameters
    ----------
    x, y : (runs, regressors, samples) and (runs, left sides, samples).
    """
    length = np.linalg.norm(x, axis=2, keepdims=True)
    length[length == 0.0] = np.inf
    x = x / length
    values, vectors = np.linalg.eigh(x @ x.swapaxes(1, 2))
    kept = values > _RANK**2 * values[:, -1:]
    inverse = np.divide(1.0, values, out=np.zeros_like(values), where=kept)
    scores = vectors.swapaxes(1, 2) @ (x @ y.swapaxes(1, 2))
    return np.asarray(vectors @ (inverse[:, :, None] * scores) / length)


__all__ = ["ROLLS", "beside_lateral", "lateral_rates"]
