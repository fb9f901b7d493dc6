"""The aircraft as flown against its declaration: how far its derivatives lie outside their declared uncertainty."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from scipy.stats import chi2

from validation.blind.figures import BODY, DERIVATIVES

LEVEL: Final = 0.0025
"""Level of the tracer's test of the six declared derivatives: half of 0.005, the other half is for everything else."""
_LIFT: Final = ("CLalpha", "CLq", "CLde")
_MOMENT: Final = ("Cmalpha", "Cmq", "Cmde")


def on_declared_body(derivatives: Mapping[str, float], body: Mapping[str, float]) -> dict[str, float]:
    """Derivatives as a motion shows them to an observer who knows the declared mass, inertia and CG alone.

    Parameters
    ----------
    derivatives : of the aircraft as flown, about the declared CG.
    body : factors of mass and inertia, and the CG aft of the declared one [chords].
    """
    lift = {name: derivatives[name] / body["mass"] for name in _LIFT}
    moment = {
        name: (derivatives[name] + body["cg"] * derivatives[of_lift]) / body["inertia"]
        for name, of_lift in zip(_MOMENT, _LIFT, strict=True)
    }
    return lift | moment


def p_value(flown: Mapping[str, float], declared: Mapping[str, float]) -> float:
    """Probability of derivatives farther from the declared ones within the declared uncertainty [-].

    Chi-square with six degrees of freedom; mass, inertia and CG move several derivatives together, to first order.

    Parameters
    ----------
    flown : of `on_declared_body`; declared : declared values.
    """
    value = np.array([declared[name] for name in (*_LIFT, *_MOMENT)])
    own = np.array([DERIVATIVES[name][1] for name in (*_LIFT, *_MOMENT)]) * value
    zero = np.zeros(3)
    covariance = np.diag(own**2)
    for std, direction in (
        (BODY["mass"], np.concatenate([value[:3], zero])),
        (BODY["inertia"], np.concatenate([zero, value[3:]])),
        (BODY["cg"], np.concatenate([zero, value[:3]])),
    ):
        covariance += std**2 * np.outer(direction, direction)
    off = np.array([flown[name] for name in (*_LIFT, *_MOMENT)]) - value
    return float(chi2.sf(off @ np.linalg.solve(covariance, off), len(off)))
