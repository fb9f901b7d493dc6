"""Separation of hypotheses by an input, averaged over what is not yet known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.design.bench import Flown
from airtruth.design.question import Hypothesised, typical_sizes
from airtruth.design.separation import Distance, Experiment, FilterSetting, Member
from airtruth.tracing.model.records import TraceRecord

Array = NDArray[np.float64]

DRAWS: Final = 6
"""Draws of sizes and derivatives behind a stated separation [-] (judgement: its mean is known within a tenth)."""
_FIRST: Final = 2
"""Draws during the search [-] (judgement: a size to either side)."""
_MOST_SIZES: Final = 1.5
"""Largest draw of a size, in standard deviations [-] (judgement: no size changes its sign)."""
_STARTS: Final = (1.0, 0.3, 3.0)
"""Multiples of an imitation's first size at which its search begins [-] (judgement)."""


@dataclass(frozen=True)
class Unknown:
    """One draw of what is not yet known.

    Attributes
    ----------
    sizes : (members, parameters at most) standard normal, for the sizes.
    common : (common,) increments of the aircraft's parameters.
    """

    sizes: Array
    common: Array


@dataclass(frozen=True)
class Criterion:
    """Separations of some hypotheses.

    Attributes
    ----------
    model : what the hypotheses have in common.
    members : the hypotheses at their sizes.
    std : (parameters,) standard deviation of the sizes of each.
    unknowns : draws of what is not known, in pairs of opposite sign.
    """

    model: FilterSetting
    members: tuple[Member, ...]
    std: tuple[Array, ...]
    unknowns: tuple[Unknown, ...]

    def of_records(self, records: int) -> Criterion:
        """The same for another number of equal records."""
        return replace(self, model=replace(self.model, records=records))

    def rate(self, flown: Flown, *, final: bool = False) -> Array | None:
        """`separations` by an input."""
        return self.separations(flown.record, final=final)

    def separations(self, record: TraceRecord, *, final: bool = False) -> Array | None:
        """(members,) separation of each truth from the nearest rival, averaged over draws; None if a motion is lost.

        Parameters
        ----------
        record : of an input, as flown by the declared aircraft.
        final : use all draws, not the first two.
        """
        experiment = Experiment(self.model, record)
        if not experiment.sound:
            return None
        unknowns = self.unknowns if final else self.unknowns[:_FIRST]
        found = np.array(
            [[self._nearest(experiment, k, u) for u in unknowns] for k in range(len(self.members))]
        )
        return np.asarray(found.mean(axis=1)) if np.isfinite(found).all() else None

    def _nearest(self, experiment: Experiment, truth: int, unknown: Unknown) -> float:
        drawn = self._drawn(unknown)
        y = experiment.outputs(drawn[truth], unknown.common)
        if not np.isfinite(y).all():
            return float("nan")
        rivals = (m for k, m in enumerate(drawn) if k != truth)
        return min(experiment.distance(y, m.effect, m.sizes, unknown.common).sigma for m in rivals)

    def _drawn(self, unknown: Unknown) -> list[Member]:
        """The hypotheses at the sizes of a draw; all sizes are large or small together, because they imitate each other."""
        return [
            Hypothesised(m.effect).member(m.sizes + s * unknown.sizes[0])
            for m, s in zip(self.members, self.std, strict=True)
        ]

    def differences(self, record: TraceRecord) -> tuple[Array, Array]:
        """Predicted outputs under the first hypothesis, and under its nearest rival at its best-fitting size.

        Each is (samples, outputs).
        """
        experiment, still = Experiment(self.model, record), self.model.still
        y = experiment.outputs(self.members[0], still)
        tried = [(m, experiment.distance(y, m.effect, m.sizes, still)) for m in self.members[1:]]
        rival, nearest = min(tried, key=lambda pair: pair[1].sigma)
        return y, experiment.outputs(replace(rival, sizes=nearest.sizes), still)


def criterion(
    model: FilterSetting,
    hypotheses: Sequence[Hypothesised],
    reference: TraceRecord,
    covariance: Array,
    seed: int,
) -> Criterion:
    """Separations of hypotheses, of which those without sizes imitate the first on a record.

    Parameters
    ----------
    reference : record on which they imitate it.
    covariance : (derivatives, derivatives) of the increments of the derivatives [-].
    seed : seed of the draws.
    """
    first = hypotheses[0]
    assert first.sizes is not None
    assert first.std is not None
    leader = first.member(first.sizes)
    experiment, still = Experiment(model, reference), model.still
    y = experiment.outputs(leader, still)
    relative = float(first.std[0] / abs(first.sizes[0])) if first.sizes[0] else 0.0
    members, std = [leader], [first.std]
    for h in hypotheses[1:]:
        sizes = _imitation(experiment, y, h) if h.sizes is None else h.sizes
        spread = np.array([0.0 if p.is_location else 1.0 for p in h.effect.parameters])
        members.append(h.member(sizes))
        std.append(relative * np.abs(members[-1].sizes) * spread if h.std is None else h.std)
    rng = np.random.default_rng(seed)
    root = np.linalg.cholesky(covariance)
    unknowns = []
    for _ in range(DRAWS // 2):
        sizes = np.clip(rng.standard_normal(1), -_MOST_SIZES, _MOST_SIZES)
        common = model.still
        common[model.layout.common.derivatives] = root @ rng.standard_normal(len(root))
        unknowns += [Unknown(sizes, common), Unknown(-sizes, -common)]
    return Criterion(model, tuple(members), tuple(std), tuple(unknowns))


def _imitation(experiment: Experiment, y: Array, h: Hypothesised) -> Array:
    """Sizes of a hypothesis that fit outputs best, from several starts of either sign.

    Where the best fit is immaterial the effect does not imitate these outputs, and its typical size counts: at the neutral
    value it would be no effect, from which no input separates another.
    """
    still = experiment.model.still
    tried: list[Distance] = []
    for start in _starts(h):
        tried.append(experiment.distance(y, h.effect, start, still))
    best = min(tried, key=lambda d: d.sigma).sizes
    return best if abs(best[0]) >= h.effect.parameters[0].material else typical_sizes(h.effect)


def _starts(h: Hypothesised) -> list[Array]:
    first, *others = h.effect.parameters
    low, high = first.reach
    signs = (1.0,) if low >= 0.0 else (1.0, -1.0)
    size = min(
        10.0 * first.step if first.is_limit else 3.0 * max(first.step, first.material), max(high, -low)
    )
    grid = np.linspace(0.2, 0.8, 3) if others else np.array([0.5])
    starts = []
    for share in grid:
        locations = [p.reach[0] + share * (p.reach[1] - p.reach[0]) for p in others]
        starts += [np.array([sign * size * k, *locations]) for sign in signs for k in _STARTS]
    return starts


__all__ = ["DRAWS", "Criterion", "Unknown", "criterion"]
