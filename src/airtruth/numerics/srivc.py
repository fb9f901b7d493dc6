"""Continuous-time transfer functions from sampled records: the simplified refined IV method (SRIVC).

Source: P. C. Young, "Recursive Estimation and Time-Series Analysis", Springer, 2011, ch. 8 (SRIVC).

    y = B(p)/A(p) u + constant + noise,  A = p^na + a1 p^(na-1) + ... + a_na,  B = b1 p^(nb-1) + ... + b_nb

Each iteration filters u and y by 1/A of the last one and solves, by instruments from the simulated
output, p^na y_f = -a1 p^(na-1) y_f - ... + b1 p^(nb-1) u_f + ... + constant. At the fixed point its
residual is y minus the simulated output, whatever hold y is filtered with, so that only the hold of u
matters.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.linalg import expm

from airtruth.errors import ConfigurationError, choices

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

HOLDS: Final = ("zoh", "foh")
"""Behaviours of an input between samples: held, or linear."""
SINGULAR: Final = 1e13
"""Condition number of the scaled normal equations that counts as singular [-]; judgement, above rounding."""


@dataclass(frozen=True)
class TransferFunctions:
    """B(p)/A(p) of each run.

    Attributes
    ----------
    a : (runs, na) a1 ... a_na, powers of [1/s]; NaN without a stable model.
    b : (runs, nb) b1 ... b_nb.
    converged : (runs,) whether the relative change fell below the tolerance, with A stable.
    iterations : (runs,) iterations made.
    """

    a: Array
    b: Array
    converged: Bools
    iterations: NDArray[np.int32]


@njit(cache=True)
def _recursion(e: Array, g: Array, h: Array, u: Array, states: Array) -> None:
    runs, samples = u.shape
    order = g.shape[1]
    for r in range(runs):
        for k in range(1, samples):
            for i in range(order):
                value = g[r, i] * u[r, k - 1] + h[r, i] * u[r, k]
                for j in range(order):
                    value += e[r, i, j] * states[r, j, k - 1]
                states[r, i, k] = value


def filter_states(a: Array, u: Array, dt_s: float, hold: str) -> Array:
    """u/A, p u/A, ..., p^(na-1) u/A from rest, (runs, na, samples): exact for the stated hold of u.

    Parameters
    ----------
    a : (runs, na) coefficients of A.
    u : (runs, samples) input, zero before its first sample.
    dt_s : sample period [s].
    hold : "zoh", held between samples, or "foh", linear between samples.
    """
    runs, order = a.shape
    # [A b 0; 0 0 1; 0 0 0] dt: its exponential holds the integrals of exp(A t) b and of t exp(A t) b
    augmented = np.zeros((runs, order + 2, order + 2))
    augmented[:, np.arange(order - 1), np.arange(1, order)] = dt_s
    augmented[:, order - 1, :order] = -a[:, ::-1] * dt_s
    augmented[:, order - 1, order] = dt_s
    augmented[:, order, order + 1] = 1.0
    exponential = np.asarray(expm(augmented))
    e = np.ascontiguousarray(exponential[:, :order, :order])
    held = exponential[:, :order, order]
    late = exponential[:, :order, order + 1] if hold == "foh" else np.zeros((runs, order))
    states = np.zeros((runs, order, u.shape[1]))
    _recursion(e, np.ascontiguousarray(held - late), np.ascontiguousarray(late), u, states)
    return states


def simulate(model: TransferFunctions, u: Array, dt_s: float, hold: str = "zoh") -> Array:
    """B/A u from rest, (runs, samples).

    Parameters
    ----------
    model : transfer functions of the runs.
    u : (runs, samples), deviation from the equilibrium that the record starts in.
    dt_s, hold : as in `filter_states`.
    """
    states = filter_states(model.a, u, dt_s, hold)
    orders = model.b.shape[1]
    return np.asarray(np.einsum("rj,rjn->rn", model.b[:, ::-1], states[:, :orders]))


def srivc(
    u: Array,
    y: Array,
    dt_s: float,
    na: int,
    nb: int,
    start_rad_s: float,
    hold: str = "zoh",
    tolerance: float = 1e-4,
    maximum_iterations: int = 50,
) -> TransferFunctions:
    """Identify B/A of each run, for records that start in equilibrium.

    The first pass filters by 1/(p + start)^na and takes the regressors as instruments.

    Parameters
    ----------
    u, y : (runs, samples) input and output, relative to their first samples.
    dt_s : sample period [s].
    na, nb : orders, 1 <= nb <= na.
    start_rad_s : pole of the first filter [rad/s], of the order of the bandwidth.
    hold : of the input between samples, "zoh" or "foh".
    tolerance : relative change of the coefficients, each times its column's size, that ends the iteration.
    maximum_iterations : iterations after which a run counts as not converged.

    Raises
    ------
    ConfigurationError
        If the orders or the hold do not exist.
    """
    if not 1 <= nb <= na:
        raise ConfigurationError(f"SRIVC orders na = {na}, nb = {nb}: allowed is 1 <= nb <= na")
    if hold not in HOLDS:
        raise ConfigurationError(f"hold = {hold!r}: {choices(hold, HOLDS)}")
    u = u - u[:, :1]
    y = y - y[:, :1]
    runs = u.shape[0]
    step = np.ones_like(y)
    a = np.tile(np.poly(np.full(na, -start_rad_s))[1:], (runs, 1))
    b = np.zeros((runs, nb))
    converged = np.zeros(runs, dtype=np.bool_)
    iterations = np.zeros(runs, dtype=np.int32)
    active = np.arange(runs)
    for iteration in range(maximum_iterations + 1):
        filtered_y = filter_states(a[active], y[active], dt_s, "foh")
        filtered_u = filter_states(a[active], u[active], dt_s, hold)[:, :nb]
        offset = filter_states(a[active], step[active], dt_s, "zoh")[:, :1]
        left = y[active] - np.einsum("ri,rin->rn", a[active][:, ::-1], filtered_y)
        x = np.concatenate([-filtered_y, filtered_u, offset], axis=1)
        z = x
        if iteration > 0:
            model = TransferFunctions(a[active], b[active], converged[active], iterations[active])
            noise_free = filter_states(a[active], simulate(model, u[active], dt_s, hold), dt_s, "foh")
            z = np.concatenate([-noise_free, filtered_u, offset], axis=1)
        new, size = _instrumented(z, x, left)
        old = np.concatenate([a[active][:, ::-1], b[active][:, ::-1]], axis=1)
        stable: Bools = np.asarray(np.isfinite(new).all(axis=1))
        stable[stable] = _stable(new[stable, :na][:, ::-1])
        change = np.linalg.norm((new[:, :-1] - old) * size[:, :-1], axis=1)
        length = np.linalg.norm(new[:, :-1] * size[:, :-1], axis=1)
        a[active] = np.where(stable[:, None], new[:, :na][:, ::-1], np.nan)
        b[active] = np.where(stable[:, None], new[:, na:-1][:, ::-1], np.nan)
        iterations[active] = iteration
        done = stable & (iteration > 0) & (change <= tolerance * length)
        converged[active[done]] = True
        active = active[stable & ~done]
        if active.size == 0:
            break
    return TransferFunctions(a, b, converged, iterations)


def _instrumented(z: Array, x: Array, y: Array) -> tuple[Array, Array]:
    """(Z'X)^-1 Z'y (runs, k), NaN where singular, and the root sum of squares of each column of X."""
    size = np.sqrt(np.einsum("rin,rin->ri", x, x))
    reach = np.sqrt(np.einsum("rin,rin->ri", z, z))
    with np.errstate(divide="ignore", invalid="ignore"):
        matrix = np.einsum("rin,rjn->rij", z, x) / (reach[:, :, None] * size[:, None, :])
        right = np.einsum("rin,rn->ri", z, y) / reach
    solution = np.full(size.shape, np.nan)
    fine: Bools = np.isfinite(matrix).all(axis=(1, 2)) & np.isfinite(right).all(axis=1)
    fine[fine] = np.linalg.cond(matrix[fine]) < SINGULAR
    solution[fine] = np.linalg.solve(matrix[fine], right[fine][:, :, None])[:, :, 0] / size[fine]
    return solution, size


def _stable(a: Array) -> Bools:
    """(runs,) whether all roots of p^na + a1 p^(na-1) + ... lie in the left half plane."""
    runs, order = a.shape
    companion = np.zeros((runs, order, order))
    companion[:, np.arange(order - 1), np.arange(1, order)] = 1.0
    companion[:, order - 1, :] = -a[:, ::-1]
    return np.asarray(np.linalg.eigvals(companion).real.max(axis=1, initial=-np.inf) < 0.0)
