"""Motion of the surfaces that a fit of instrument errors leaves: the absolute test, of all and of each equation."""

from __future__ import annotations

import numpy as np

from airtruth.checks.kinematics_fit import Fit, Problem


def absolute(problem: Problem, one: Fit) -> tuple[float, int]:
    """Energy of the surfaces' motion that a fit leaves in each record and equation, and its degrees of freedom."""
    parts = _parts(problem, one)
    return sum((energy for _, energy, _ in parts), 0.0), sum(n for _, _, n in parts) - len(one.names)


def by_equation(problem: Problem, one: Fit) -> dict[str, tuple[float, int]]:
    """The same energy for each equation, and the number of its components."""
    parts = _parts(problem, one)
    return {
        equation: (sum(e for n, e, _ in parts if n == equation), sum(k for n, _, k in parts if n == equation))
        for equation in problem.equations
    }


def _parts(problem: Problem, one: Fit) -> list[tuple[str, float, int]]:
    """Equation, energy and number of components of each record and equation."""
    white = problem.white(dict(zip(one.names, one.value, strict=True)))
    start, parts = 0, []
    for own in problem.weight.own:
        for equation, columns in zip(problem.equations, own, strict=True):
            stop = start + columns.shape[0]
            energy = float(np.sum((columns.T @ white[start:stop]) ** 2))
            parts.append((equation, energy, columns.shape[1]))
            start = stop
    return parts


__all__ = ["absolute", "by_equation"]
