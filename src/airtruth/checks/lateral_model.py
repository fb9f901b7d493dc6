"""The lateral motion that aileron and rudder alone would cause: instruments that know nothing of gusts and noise.

A linear model x' = A x + B u of the channels that were recorded, x of beta, p, r and phi and u of aileron and rudder, is fitted
to integrals (`airtruth.checks.spectra.regress`), whatever the units and signs of the channels, and simulated from u. An error
of the model makes the instruments weaker, not wrong (P. C. Young, *Recursive Estimation and Time-Series Analysis*, 2011, ch. 6).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from airtruth.checks.spectra import integral, regress, spectrum
from airtruth.physics.motion import LATERAL

Array = NDArray[np.float64]


def fitted(
    channels: Mapping[str, Array], dt_s: float, states: Sequence[str], surfaces: Sequence[str]
) -> tuple[Array, Array]:
    """A (n, n) and B (n, m) of the runs together; rows of zeros where the channels do not move.

    A is shifted so that no motion grows: a simulation of minutes has to stay finite.

    Parameters
    ----------
    channels : channels (runs, samples).
    dt_s : sample period [s].
    states, surfaces : channels of the states and of the inputs.
    """
    names = (*states, *surfaces)
    causes = np.stack([spectrum(integral(channels[n], dt_s), dt_s) for n in names], axis=1)
    rows = [regress(spectrum(channels[n], dt_s), causes).value[-1] for n in states]
    model = np.nan_to_num(np.array(rows))
    a, b = model[:, : len(states)], model[:, len(states) :]
    growth = float(np.linalg.eigvals(a).real.max())
    return a - max(growth, 0.0) * np.eye(len(states)), b


def simulated(a: Array, b: Array, inputs: Array, dt_s: float) -> Array:
    """States (..., n, samples) from rest, the inputs (..., m, samples) linear between samples; exact at the samples."""
    n, m = b.shape
    big = np.zeros((n + 2 * m, n + 2 * m))
    big[:n, :n], big[:n, n : n + m], big[n : n + m, n + m :] = a * dt_s, b * dt_s, np.eye(m)
    exponential = expm(big)
    step, both, late = exponential[:n, :n], exponential[:n, n : n + m], exponential[:n, n + m :]
    u = np.moveaxis(inputs, -1, 0)
    u = u - u[:1]
    drive = u[:-1] @ (both - late).T + u[1:] @ late.T
    x = np.zeros((*u.shape[:-1], n))
    for k, push in enumerate(drive):
        x[k + 1] = x[k] @ step.T + push
    return np.asarray(np.moveaxis(x, 0, -1))


def driven(channels: Mapping[str, Array], dt_s: float) -> tuple[tuple[str, ...], Array]:
    """Names of the recorded states and their motion (runs, states, samples) by the recorded surfaces together."""
    states = tuple(s.channel for s in LATERAL.states if s.channel in channels)
    surfaces = tuple(n for n in LATERAL.surfaces if n in channels)
    a, b = fitted(channels, dt_s, states, surfaces)
    return states, simulated(a, b, np.stack([channels[n] for n in surfaces], axis=1), dt_s)


__all__ = ["driven", "fitted", "simulated"]
