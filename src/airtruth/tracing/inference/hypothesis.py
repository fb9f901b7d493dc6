"""A hypothesis: the declared aircraft and some effects of unknown size."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.effects.effect import Effect, Parameter
from airtruth.numerics.kept import Kept
from airtruth.physics.motion import LONGITUDINAL, Motion
from airtruth.physics.terms import AeroTerm, Change
from airtruth.tracing.model.compile import CompiledChange, compile_change

Array = NDArray[np.float64]

_KEPT: Final = 64
"""Number of compiled changes that are kept of a hypothesis [-] (judgement: more than a point and a step in each of its sizes)."""
_COMPILED: Final = Kept[dict[bytes, CompiledChange]]()
"""Hypothesis -> compiled change by the bytes of its sizes."""


@dataclass(frozen=True)
class Hypothesis:
    """The declared aircraft and some effects of free size.

    Attributes
    ----------
    declared : what aircraft.toml declares of sensors and dynamics.
    effects : the effects; none is the null hypothesis.
    also_unconstrained : indices of derivatives that the declaration does not constrain, besides those of the effects
        (`unconstrained_by`).
    trim_flow_rad : flow angle of the motion about which a curvature is counted [rad]. About any other angle it is a slope and a
        constant besides, which only the records can determine.
    spread : (derivatives, derivatives) covariance of the increments of the derivatives beyond the declared one, where the records
        contradict the declared derivatives; None where they do not.
    motion : the motion of the records.
    """

    declared: Change
    effects: tuple[Effect, ...] = ()
    also_unconstrained: tuple[int, ...] = ()
    trim_flow_rad: float = 0.0
    spread: Array | None = field(default=None, compare=False)
    motion: Motion = LONGITUDINAL

    @cached_property
    def unconstrained(self) -> tuple[int, ...]:
        """Indices of the derivatives that the declaration does not constrain; nor does it their coefficient at trim."""
        free = (i for e in self.effects for i in unconstrained_by(e, self.trim_flow_rad, self.motion))
        return tuple(sorted({*self.also_unconstrained, *free}))

    @cached_property
    def parameters(self) -> tuple[tuple[int, int], ...]:
        """(effect, parameter) of each element of the vector of sizes."""
        return tuple((i, j) for i, e in enumerate(self.effects) for j in range(len(e.parameters)))

    def parameter(self, size: int) -> Parameter:
        """The parameter that an element of the vector of sizes belongs to."""
        effect, j = self.parameters[size]
        return self.effects[effect].parameters[j]

    def span(self, key: str) -> slice:
        """Where the parameters of an effect are in the vector of sizes.

        Raises
        ------
        ValueError
            If the hypothesis has no such effect.
        """
        at = [e.key for e in self.effects].index(key)
        first = sum(len(e.parameters) for e in self.effects[:at])
        return slice(first, first + len(self.effects[at].parameters))

    def values(self, sizes: Array) -> list[dict[str, float]]:
        """Parameters of each effect, in their own units."""
        values: list[dict[str, float]] = [{} for _ in self.effects]
        for size, (i, j) in zip(sizes, self.parameters, strict=True):
            p = self.effects[i].parameters[j]
            values[i][p.name] = p.value(float(size))
        return values

    def change(self, sizes: Array) -> Change:
        """All that the hypothesis changes at these sizes."""
        return self.declared + self.added(sizes)

    def compiled(self, sizes: Array) -> CompiledChange:
        """`change` as the filter's arrays; the latest are kept, because each record asks for the same ones."""
        key = sizes.tobytes()
        latest = _COMPILED.of(self)
        if latest is None:
            latest = _COMPILED.keep(self, {})
        found = latest.get(key)
        if found is None:
            found = compile_change(self.change(sizes), self.motion)
            if len(latest) >= _KEPT:
                latest.clear()
            latest[key] = found
        return found

    def added(self, sizes: Array) -> Change:
        """Change by the effects at these sizes, without the declared one."""
        total = Change()
        for effect, values in zip(self.effects, self.values(sizes), strict=True):
            total = total + effect.change(values)
        return replace(total, aero=tuple(self._about_trim(t) for t in total.aero))

    def _about_trim(self, term: AeroTerm) -> AeroTerm:
        return replace(term, at=self.trim_flow_rad) if _is_quadratic(term, self.motion) else term

    @cached_property
    def fixed(self) -> tuple[int, ...]:
        """Numbers of the sizes whose range is a single value."""
        ends = [self.effects[i].parameters[j].ends for i, j in self.parameters]
        return tuple(k for k, (low, high) in enumerate(ends) if low == high)

    @cached_property
    def size_precision(self) -> Array:
        """(sizes,) precision of the normal prior of each size; zero for none."""
        every = (self.parameter(k) for k in range(len(self.parameters)))
        return np.array([p.prior_std**-2.0 for p in every])

    @cached_property
    def size_pull(self) -> Array:
        """(sizes,) precision of the normal prior of each size times its mean."""
        means = np.array([self.parameter(k).prior_mean for k in range(len(self.parameters))])
        return np.asarray(self.size_precision * means)

    def plus(self, effect: Effect) -> Hypothesis:
        """The hypothesis with one effect more."""
        return replace(self, effects=(*self.effects, effect))


def unconstrained_by(effect: Effect, trim_flow_rad: float, motion: Motion) -> tuple[int, ...]:
    """Indices of the derivatives that the declaration cannot constrain beside an effect.

    A curvature about a flow angle other than the trim's is a slope and a constant at the trim besides. They
    cannot be declared and present in addition, so that the records have to determine them.
    """
    bent = {t.coefficient for t in _curved(effect, motion) if t.at != trim_flow_rad}
    return tuple(motion.at(c.name, motion.flow) for c in motion.coefficients if c.name in bent)


def is_curvature(effect: Effect, motion: Motion) -> bool:
    """Whether an effect is a quadratic function of the flow angle."""
    return bool(_curved(effect, motion))


def _curved(effect: Effect, motion: Motion) -> list[AeroTerm]:
    """Its terms that are quadratic in the flow angle."""
    change = effect.change({p.name: p.high for p in effect.parameters})
    return [t for t in change.aero if _is_quadratic(t, motion)]


def _is_quadratic(term: AeroTerm, motion: Motion) -> bool:
    return term.signal == motion.flow and term.shape == "quadratic" and not term.factor


__all__ = ["Hypothesis", "is_curvature", "unconstrained_by"]
