"""Short closed forms of a learned increment: a break, a step, a curve, or a part behind a state.

A form is as good as the table if its weighted residual is no larger than the band allows: chi-square over the points
that have samples, the standard deviations those of the band. Forms are compared with the table by their difference from
the trim: a constant belongs to the trim coefficients.

Sources: break and curve, as `airtruth.effects.aerodynamics`; a step behind a lag is the separation state of J. Fischenberg
and R. V. Jategaonkar, AIAA 95-3438 (1995), with a ramp in place of the hyperbolic tangent.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.stats import chi2

Array = NDArray[np.float64]

_LEVEL: Final = 0.05
"""Probability of the residual from which a form is as good as the table [-] (convention)."""


@dataclass(frozen=True)
class ClosedForm:
    """A closed form fitted to a table.

    Attributes
    ----------
    name : "break above", "break below", "step above", "step below" or "curve".
    values : parameter -> value; a slope [1/unit of the signal], a location [unit of the signal], a step [-], a curvature
        [1/unit^2].
    statistic, degrees : weighted sum of squares, and points less parameters [-].
    """

    name: str
    values: dict[str, float]
    statistic: float
    degrees: int

    @property
    def p_value(self) -> float:
        """Probability of a larger residual where the form is right [-]."""
        return float(chi2.sf(self.statistic, max(self.degrees, 1)))

    @property
    def is_as_good(self) -> bool:
        """Whether the band allows the form in place of the table."""
        return self.p_value > _LEVEL


def closed_forms(
    at: Sequence[float],
    value: Sequence[float],
    std: Sequence[float],
    trim: float,
    *,
    of_pair: bool = False,
) -> list[ClosedForm]:
    """Every closed form fitted to a table, the best first by the statistic with two for each parameter (AIC).

    Parameters
    ----------
    at, value, std : (points,) of the signal, of the increment, and its standard deviation; points whose standard
        deviation is zero are those where the increment is zero by definition, and do not count; nor do those of infinite
        standard deviation, which have no samples.
    trim : value of the signal at the trim, about which a curve is measured [unit of the signal].
    of_pair : whether another signal multiplies the table; a constant is then a derivative, and no form may add one.
    """
    x, y, s = (np.asarray(v, dtype=np.float64) for v in (at, value, std))
    counted = (s > 0.0) & np.isfinite(s)
    x, y, s = x[counted], y[counted], s[counted]
    found = []
    for name, (names, form) in _forms(trim).items():
        fitted = _fitted(x, y, s, form if of_pair else _from_trim(form, trim), len(names), min(at), max(at))
        if fitted is not None:
            p, statistic = fitted
            values = dict(zip(names, p.tolist(), strict=True))
            found.append(ClosedForm(name, values, statistic, len(x) - len(p)))
    return sorted(found, key=lambda f: f.statistic + 2.0 * len(f.values))


_Form = Callable[[Array, Array], Array]


def _forms(trim: float) -> dict[str, tuple[tuple[str, ...], _Form]]:
    def step(u: Array, p: Array) -> Array:
        return np.asarray(p[0] * np.clip((u - p[1]) / max(p[2], 1e-9), 0.0, 1.0))

    return {
        "break above": (("slope", "at"), lambda x, p: p[0] * np.maximum(x - p[1], 0.0)),
        "break below": (("slope", "at"), lambda x, p: p[0] * np.minimum(x - p[1], 0.0)),
        "step above": (("step", "at", "width"), step),
        "step below": (
            ("step", "at", "width"),
            lambda x, p: step(-x, np.array([p[0], -p[1], p[2]])),
        ),
        "curve": (("curvature",), lambda x, p: p[0] * (x - trim) ** 2),
    }


def _from_trim(form: _Form, trim: float) -> _Form:
    """A form less its value at the trim."""
    at = np.array([trim])
    return lambda x, p: form(x, p) - form(at, p)


def _fitted(
    x: Array, y: Array, s: Array, form: _Form, count: int, low: float, high: float
) -> tuple[Array, float] | None:
    """Parameters of least squares from several starts, and the weighted sum of squares; None for too few points.

    ``low`` and ``high`` are the ends of the table.
    """
    if len(x) <= count:
        return None
    best: tuple[Array, float] | None = None
    span = float(np.ptp(x))
    # a form that bends outside the table has lost its location
    bounds = (np.array([-np.inf, low, 0.0])[:count], np.array([np.inf, high, np.inf])[:count])
    for location in np.quantile(x, (0.2, 0.5, 0.8)):
        start = np.array([float(y[np.argmax(np.abs(y))]), float(location), 0.3 * span])[:count]
        scale = np.array([max(float(np.abs(y).max()), 1e-12), span, span])[:count]
        solved = least_squares(lambda p: (form(x, p) - y) / s, start, x_scale=scale, bounds=bounds)
        if best is None or 2.0 * solved.cost < best[1]:
            best = solved.x, 2.0 * float(solved.cost)
    return best


__all__ = ["ClosedForm", "closed_forms"]
