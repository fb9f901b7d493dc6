"""The estimators of the lateral-directional motion, each with its source."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Final

from airtruth.identification.condition import AircraftConstants, OneOrEach, each_batch
from airtruth.identification.estimates import Estimates
from airtruth.identification.lateral import frequency, likelihood
from airtruth.identification.lateral.curvature import SIGNIFICANT, p_values
from airtruth.identification.lateral.solve import POSES, regress_batch, regress_joint
from airtruth.identification.options import TERMS, Options
from airtruth.identification.record_constants import EqualRuns, LateralValues, values_of
from airtruth.logs.flight_log import Batch
from airtruth.physics.motion import LATERAL


@dataclass(frozen=True)
class Estimator:
    """An estimator of each run of a batch, and of all runs of several batches together."""

    title: str
    source: str
    estimate: Callable[[Batch, AircraftConstants, Options], Estimates]
    estimate_joint: Callable[[Sequence[Batch], OneOrEach, Options], Estimates]


def lateral_values(constants: AircraftConstants) -> LateralValues:
    """The constants that the lateral-directional motion needs.

    Raises
    ------
    ConfigurationError
        If the aircraft lacks one.
    """
    values = values_of(constants, LATERAL)
    assert isinstance(values, LateralValues)
    return values


def curvature_of(parts: Sequence[EqualRuns], options: Options) -> Counter[tuple[str, str]]:
    """Number of runs that show a nonlinear term that is not free: (term, coefficient) -> runs (`lateral.curvature`)."""
    found: Counter[tuple[str, str]] = Counter()
    for part in parts:
        shown = p_values(part.batch, lateral_values(part.constants), options) < SIGNIFICANT
        for (i, term), (j, coefficient) in product(enumerate(TERMS), enumerate(LATERAL.coefficients)):
            if term not in options.terms:
                found[term, coefficient.name] += int(shown[:, i, j].sum())
    return found


def _all_values(parts: Sequence[Batch], constants: OneOrEach) -> list[LateralValues]:
    return [lateral_values(one) for _, one in each_batch(parts, constants)]


def _regression(title: str, source: str, name: str) -> Estimator:
    def each(batch: Batch, constants: AircraftConstants, options: Options) -> Estimates:
        return regress_batch(batch, lateral_values(constants), name, POSES[name], options)

    def joint(parts: Sequence[Batch], constants: OneOrEach, options: Options) -> Estimates:
        return regress_joint(parts, _all_values(parts, constants), name, POSES[name], options)

    return Estimator(title, source, each, joint)


def _likelihood(title: str, source: str, *, gusts: bool) -> Estimator:
    def each(batch: Batch, constants: AircraftConstants, options: Options) -> Estimates:
        return likelihood.estimate(batch, lateral_values(constants), constants, options, gusts=gusts)

    def joint(parts: Sequence[Batch], constants: OneOrEach, options: Options) -> Estimates:
        own = [one for _, one in each_batch(parts, constants)]
        return likelihood.estimate_joint(parts, _all_values(parts, constants), own, options, gusts=gusts)

    return Estimator(title, source, each, joint)


def _frequency() -> Estimator:
    def each(batch: Batch, constants: AircraftConstants, options: Options) -> Estimates:
        return frequency.estimate(batch, lateral_values(constants), options)

    def joint(parts: Sequence[Batch], constants: OneOrEach, options: Options) -> Estimates:
        return frequency.estimate_joint(parts, _all_values(parts, constants), options)

    return Estimator("Frequency", "Klein and Morelli, 2006, 7.2", each, joint)


ESTIMATORS: Final[Mapping[str, Estimator]] = {
    "ls": _regression("LS", "Klein and Morelli, 2006, 5.1", "ls"),
    "iv-lowpass": _regression("IV(da_f, dr_f)", "M. Brunot, eq. (9), IV.B", "iv-lowpass"),
    "iv-f1": _regression("IV(f1)", "M. Brunot, eqs (7), (9), (11)", "iv-f1"),
    "frequency": _frequency(),
    "filter-error": _likelihood("Filter error", "Maine and Iliff, NASA RP-1138", gusts=True),
    "output-error": _likelihood("Output error", "Maine and Iliff, NASA RP-1138", gusts=False),
}
"""Estimators by name, in the order of tables."""
LINEAR: Final = tuple(name for name in ESTIMATORS if name != "filter-error")
"""Estimators whose intervals do not allow for nonlinear terms that are not free."""

__all__ = ["ESTIMATORS", "LINEAR", "Estimator", "curvature_of", "lateral_values"]
