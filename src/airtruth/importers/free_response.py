"""Free responses in a flight: the aircraft oscillates and settles while the elevator is at rest."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SHARE: Final = 0.95
"""Least share of the variance of q that one damped oscillation explains [-] (judgement: turbulence of two periods has less)."""
PERIODS: Final = 2.0
"""Fewest periods of the oscillation that are seen [-] (judgement: fewer are any bend)."""
LARGE: Final = 3.0
"""Least ratio of the largest value of q to the threshold at which the oscillation ends [-]: it decays."""
_FREQUENCIES_RAD_S: Final = 2.0 * np.pi * np.geomspace(0.1, 3.0, 30)
"""Natural frequencies that are tried [rad/s]: short periods of 0.3 to 10 s."""
_DAMPINGS: Final = np.linspace(0.02, 0.9, 12)
"""Damping ratios that are tried [-]."""


def free_spans(
    q: Array, busy: NDArray[np.bool_], threshold: float, reach: int, step_s: float
) -> list[tuple[int, int]]:
    """First and last sample of each free response, from the largest value of q on.

    Parameters
    ----------
    q : (samples,) pitch rate less its slow part [rad/s].
    busy : (samples,) whether the elevator moves there, or a manoeuvre has the sample already.
    threshold : value of q that an oscillation exceeds [rad/s].
    reach : samples over which the largest value counts [-]; step_s : their period [s].

    Examples
    --------
    >>> t = np.arange(600) / 20.0
    >>> q = np.where(t > 10.0, 0.1 * np.exp(-0.6 * (t - 10.0)) * np.cos(3.0 * (t - 10.0)), 0.0)
    >>> free_spans(q, np.zeros(600, dtype=bool), 0.01, 20, 0.05)
    [(201, 286)]
    """
    from scipy.ndimage import maximum_filter1d

    over = maximum_filter1d(np.abs(q), reach) > threshold
    edges = np.flatnonzero(np.diff(np.concatenate([[0], over.astype(np.int8), [0]])))
    spans = []
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        if busy[start:stop].any():
            continue
        peak = int(start + np.argmax(np.abs(q[start:stop])))
        if np.abs(q[peak]) > LARGE * threshold and settles(q[peak:stop], step_s):
            spans.append((peak, int(stop) - 1))
    return spans


def settles(q: Array, step_s: float) -> bool:
    """Whether one damped oscillation about a line explains a pitch rate.

    For each natural frequency w and damping ratio z the terms exp(-z w t) cos(w_d t), exp(-z w t) sin(w_d t), 1 and t are
    fitted by least squares, w_d = w sqrt(1 - z^2).

    Parameters
    ----------
    q : (samples,) at a uniform rate; step_s : its period [s].
    """
    t = step_s * np.arange(len(q))
    total = float(((q - q.mean()) ** 2).sum())
    if len(q) < 12 or total <= 0.0:
        return False
    line = np.linalg.qr(np.column_stack([np.ones_like(t), t]))[0]
    rest = q - line @ (line.T @ q)
    for natural in _FREQUENCIES_RAD_S:
        if natural * t[-1] < 2.0 * np.pi * PERIODS:
            continue
        for damping in _DAMPINGS:
            angle = natural * np.sqrt(1.0 - damping**2) * t
            terms = np.exp(-damping * natural * t)[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
            basis = np.linalg.qr(terms - line @ (line.T @ terms))[0]
            if float(((rest - basis @ (basis.T @ rest)) ** 2).sum()) < (1.0 - SHARE) * total:
                return True
    return False


__all__ = ["free_spans", "settles"]
