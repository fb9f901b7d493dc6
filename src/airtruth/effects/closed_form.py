"""Short closed forms of a learned increment: a line, a break, a step, a curve, or a part behind a state.

A form is as good as the table if its weighted residual is no larger than the band allows: chi-square over the points
that have samples, the standard deviations those of the band. Forms are compared with the table by their difference from
the trim: a constant belongs to the trim coefficients.

Sources: break and curve, as `airtruth.effects.aerodynamics`; a step behind a lag is the separation state of J. Fischenberg
and R. V. Jategaonkar, AIAA 95-3438 (1995), with a ramp in place of the hyperbolic tangent.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

Array = NDArray[np.float64]

_LOCATIONS: Final = 49
"""Number of locations that are tried [-] (judgement: finer than the finest table)."""
_WIDTHS: Final = 9
"""Number of widths that are tried [-] (judgement: each 1.6 times the one before)."""
_LEVEL: Final = 0.05
"""Probability of the residual from which a form is as good as the table [-] (convention)."""


@dataclass(frozen=True)
class ClosedForm:
    """A closed form fitted to a table.

    Attributes
    ----------
    name : "line", "break above", "break below", "step above", "step below" or "curve".
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
        return float(chdtrc(max(self.degrees, 1), self.statistic))

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
    trim : value of the signal at the trim, about which a curve and a line are measured [unit of the signal].
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
    return sorted(found, key=lambda f: (round(f.statistic + 2.0 * len(f.values), 6), _is_beyond(f, trim)))


def _is_beyond(form: ClosedForm, trim: float) -> bool:
    """Whether a form has its location on the other side of the trim.

    A step above and a step below differ by a constant alone; the one on its own side of the trim is preferred.
    """
    above = form.name.endswith("above")
    return form.values.get("at", trim) < trim if above else form.values.get("at", trim) > trim


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
        "line": (("slope",), lambda x, p: p[0] * (x - trim)),
    }


def _from_trim(form: _Form, trim: float) -> _Form:
    """A form less its value at the trim."""
    at = np.array([trim])
    return lambda x, p: form(x, p) - form(at, p)


def _fitted(
    x: Array, y: Array, s: Array, form: _Form, count: int, low: float, high: float
) -> tuple[Array, float] | None:
    """Parameters of least squares, and the weighted sum of squares; None for too few points.

    Every form is linear in its first parameter. The search begins at the best of a grid of the others, because a form that is
    compared by its difference from the trim has a kink where its location passes the trim.

    Parameters
    ----------
    low, high : ends of the table, between which a location lies.
    """
    from scipy.optimize import least_squares  # slow to import, and only learned increments need it

    if len(x) <= count:
        return None
    span = high - low
    grids = (np.linspace(low, high, _LOCATIONS), span * np.geomspace(1.0 / _LOCATIONS, 1.0, _WIDTHS))
    starts, aim = [], y / s
    for others in itertools.product(*grids[: count - 1]):
        unit = form(x, np.array([1.0, *others])) / s
        power = float(unit @ unit)
        size = float(unit @ aim) / power if power > 0.0 else 0.0
        starts.append((float(np.sum((size * unit - aim) ** 2)), np.array([size, *others])))
    start = min(starts, key=lambda found: found[0])[1]
    bounds = (np.array([-np.inf, low, 0.0])[:count], np.array([np.inf, high, np.inf])[:count])
    scale = np.array([max(abs(start[0]), 1e-12), span, span])[:count]
    solved = least_squares(lambda p: (form(x, p) - y) / s, start, x_scale=scale, bounds=bounds)
    return solved.x, 2.0 * float(solved.cost)


__all__ = ["ClosedForm", "closed_forms"]
