"""Two surfaces of one elevator whose servos are mirrored: their mean keeps the roll and cancels the pitch."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

STEP_S: Final = 0.1
"""Time over which samples are averaged [s] (judgement: elevator inputs last longer, and noise of samples is reduced)."""
CERTAIN: Final = 20.0
"""Twice the logarithm of the likelihood ratio beyond which the columns are mirrored [-]: a ratio of exp(10)."""


def are_mirrored(t_s: Array, surfaces: Array, q_t_s: Array, q: Array) -> bool:
    """Whether the pitch acceleration follows the difference of two surfaces and not their mean.

    With the squared partial correlations of q' with each, r_m^2 and r_d^2, twice the logarithm of the likelihood ratio of two
    regressions on N samples is N ln((1 - r_m^2) / (1 - r_d^2)). What q, its integral and a drift explain of q', the damping
    and stiffness of the aircraft, is taken out of all three.

    Parameters
    ----------
    t_s : (samples,) times of the surfaces [s].
    surfaces : (2, samples) columns, in any unit.
    q_t_s, q : (n,) times [s] and pitch rate, in any unit.
    """
    known = np.isfinite(t_s) & np.isfinite(surfaces).all(axis=0)
    turned = np.isfinite(q_t_s) & np.isfinite(q)
    if known.sum() < 2 or turned.sum() < 2:
        return False
    start, end = max(t_s[known].min(), q_t_s[turned].min()), min(t_s[known].max(), q_t_s[turned].max())
    count = int((end - start) / STEP_S)
    if count < 8 or (np.diff(t_s[known]) <= 0.0).any() or (np.diff(q_t_s[turned]) <= 0.0).any():
        return False
    edges = start + STEP_S * np.arange(count + 1)
    # q at the edges gives the mean of q' between them
    at_edges = np.interp(edges, q_t_s[turned], q[turned])
    slope, rate = np.diff(at_edges), 0.5 * (at_edges[1:] + at_edges[:-1])
    motion = np.stack(
        [np.ones(count), np.linspace(-1.0, 1.0, count), rate, np.cumsum(rate) - 0.5 * rate], axis=1
    )
    basis = np.linalg.qr(motion)[0]
    left, right = (_means(edges, t_s[known], one[known]) for one in surfaces)
    mean, difference = (
        _squared_correlation(x - basis @ (basis.T @ x), slope - basis @ (basis.T @ slope))
        for x in (left + right, left - right)
    )
    return bool(count * np.log((1.0 - mean) / max(1.0 - difference, 1e-12)) > CERTAIN)


def _means(edges: Array, t_s: Array, x: Array) -> Array:
    """Mean of a piecewise linear signal between edges."""
    area = np.concatenate([[0.0], np.cumsum(0.5 * (x[1:] + x[:-1]) * np.diff(t_s))])
    return np.asarray(np.diff(np.interp(edges, t_s, area)) / STEP_S)


def _squared_correlation(x: Array, y: Array) -> float:
    power = float(x @ x) * float(y @ y)
    return float(x @ y) ** 2 / power if power > 0.0 else 0.0


__all__ = ["are_mirrored"]
