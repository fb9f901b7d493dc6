"""The bands of learned tables against the curve that the truth has.

A table is comparable where it acts as the truth does: on the same coefficient or reading, over the same signal, by the same
factor, without memory. The true curve counts from the trim of the table. For a coefficient it is that of an aircraft with
the declared mass and inertia, and with the slope by which the truth's derivative differs from the one that the answer
states beside the table: the updated aircraft has the sum of both.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from validation.blind.figures import ALPHA_TRIM_RAD
from validation.blind.scoring import Case, mean
from validation.blind.set_scoring import true_derivatives

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Curve:
    """A curve of the truth.

    Attributes
    ----------
    acts_on, over, by : as a trace states them; ``by`` is None for none.
    value : of the effect's values and the signal (points,).
    """

    acts_on: str
    over: str
    by: str | None
    value: Callable[[Mapping[str, float], Array], Array]


def _above(name: str) -> Callable[[Mapping[str, float], Array], Array]:
    return lambda v, x: v[name] * np.maximum(x - v["at_alpha_rad"], 0.0)


def _square(name: str) -> Callable[[Mapping[str, float], Array], Array]:
    return lambda v, x: v[name] * np.square(x - ALPHA_TRIM_RAD)


CURVES: Final[Mapping[str, Curve]] = {
    "cm_alpha_nonlinear:break": Curve("Cm", "alpha_rad", None, _above("dCmalpha")),
    "cm_alpha_nonlinear:quadratic": Curve("Cm", "alpha_rad", None, _square("Cmalpha2")),
    "cl_alpha_nonlinear:break": Curve("CL", "alpha_rad", None, _above("dCLalpha")),
    "cl_alpha_nonlinear:quadratic": Curve("CL", "alpha_rad", None, _square("CLalpha2")),
    "elevator_asymmetry": Curve("Cm", "elevator_rad", None, lambda v, x: v["dCmde"] * np.minimum(x, 0.0)),
    "hinge_blowback": Curve("Cm", "elevator_rad", None, lambda v, x: v["Cmde2"] * x * np.abs(x)),
    "elevator_in_wake": Curve(
        "Cm", "alpha_rad", "elevator_rad", lambda v, x: v["Cmalphade"] * (x - ALPHA_TRIM_RAD)
    ),
    "vane_curve": Curve("alpha_rad", "alpha_rad", None, _square("curve_per_rad")),
}
"""Effects of the truth that a table without memory represents; formulas of `truths.EFFECTS`."""
_SLOPES: Final = {
    ("CL", "alpha_rad"): "CLalpha",
    ("CL", "elevator_rad"): "CLde",
    ("Cm", "alpha_rad"): "Cmalpha",
    ("Cm", "elevator_rad"): "Cmde",
}


def covered(case: Case) -> list[float]:
    """For each comparable table, the share of its samples that lie about a point where the band holds the true curve [-]."""
    flown = case["truth"]["trial"]["effects"]
    curve = CURVES.get(flown[0]["key"]) if len(flown) == 1 else None
    if curve is None:
        return []
    return [
        _share(case, curve, flown[0]["values"], effect["table"])
        for effect in case["answer"].get("effects", ())
        if effect["name"] == "increment" and effect.get("table") and not effect.get("states")
        if (effect["acts_on"], effect["over"], effect.get("by")) == (curve.acts_on, curve.over, curve.by)
    ]


def score(cases: Iterable[Case]) -> tuple[float, int]:
    """Mean of `covered` over the tables of all cases, and their number."""
    return mean(share for case in cases if "failed" not in case["answer"] for share in covered(case))


def _share(case: Case, curve: Curve, values: Mapping[str, float], table: Mapping[str, Any]) -> float:
    at, samples = np.array(table["at"]), np.array(table["samples"], dtype=float)
    body = case["truth"]["trial"]["body"]
    factor = {"CL": 1.0 / body["mass"], "Cm": 1.0 / body["inertia"]}.get(curve.acts_on, 1.0)
    own = factor * (curve.value(values, at) - curve.value(values, np.array(table["trim"])))
    slope = _SLOPES.get((curve.acts_on, curve.over))
    if slope is not None and curve.by is None:
        stated = case["answer"]["derivatives"]["after"][slope]
        own += (true_derivatives(case)[slope] - stated) * (at - table["trim"])
    inside = (own >= np.array(table["low"])) & (own <= np.array(table["high"]))
    return float(samples @ inside / samples.sum())


__all__ = ["CURVES", "Curve", "covered", "score"]
