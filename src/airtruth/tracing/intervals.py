"""95 % intervals of the parameters of an accepted effect."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from airtruth.effects.effect import Effect
from airtruth.physics.motion import LONGITUDINAL
from airtruth.tracing.accepted import ParameterEstimate
from airtruth.tracing.answer import Z95
from airtruth.tracing.inference.profile import Profile, location_index

Array = NDArray[np.float64]


def estimates(effect: Effect, sizes: Array, covariance: Array) -> dict[str, ParameterEstimate]:
    """Value, standard deviation and 95 % interval of each parameter of an effect.

    The direction of a cause is known to a share of each element (`airtruth.effects.effect.Prior.shape`). Its size is known no
    better, because all elements may err together.

    Parameters
    ----------
    sizes, covariance : (parameters,) in the size coordinates of the effect, and their covariance.
    """
    found = {}
    for i, p in enumerate(effect.parameters):
        size, std = float(sizes[i]), float(np.sqrt(max(covariance[i, i], 0.0)))
        if i == 0 and effect.prior is not None:
            std = math.hypot(std, effect.prior.shape * size)
        value = p.value(size)
        low, high = sorted((p.value(size - Z95 * std), p.value(size + Z95 * std)))
        slope = abs(p.value(size + 0.01 * std) - value) / 0.01 if math.isfinite(value) else math.inf
        found[p.name] = ParameterEstimate(value, slope, (_finite(low), _finite(high)))
    return found


def at_measured_alpha(
    effect: Effect, stated: dict[str, ParameterEstimate], shift_rad: float
) -> dict[str, ParameterEstimate]:
    """Estimates whose angles of attack count from zero; the linear model counts them from the trim.

    Parameters
    ----------
    stated : estimates of an effect; shift_rad : angle of attack of the trim [rad].
    """
    angles = {p.name for p in effect.parameters if p.is_location and p.name.endswith(LONGITUDINAL.vane)}
    return {name: _moved(e, shift_rad) if name in angles else e for name, e in stated.items()}


def _moved(stated: ParameterEstimate, by: float) -> ParameterEstimate:
    low, high = (None if end is None else end + by for end in stated.ci95)
    return replace(stated, value=stated.value + by, ci95=(low, high))


def _finite(end: float) -> float | None:
    return max(end, -1e300) if math.isfinite(end) else None


def widened_by_profile(
    effect: Effect, stated: dict[str, ParameterEstimate], profile: Profile
) -> dict[str, ParameterEstimate]:
    """Estimates whose intervals of size and location contain those of the profile likelihood."""
    widened = dict(stated)
    at = location_index(effect) or 0
    for j, ends in ((0, profile.size_interval()), (at, profile.location_interval())):
        p = effect.parameters[j]
        widened[p.name] = _containing(widened[p.name], map(p.value, ends))
    return widened


def _containing(stated: ParameterEstimate, ends: Iterable[float]) -> ParameterEstimate:
    """The estimate with an interval that contains more ends; an end at infinity is open."""
    low, high = stated.ci95
    more = list(ends)
    bottom = min(-math.inf if low is None else low, *more)
    top = max(math.inf if high is None else high, *more)
    return replace(stated, ci95=(_finite(bottom), _finite(top)))


__all__ = ["at_measured_alpha", "estimates", "widened_by_profile"]
