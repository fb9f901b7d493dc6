"""Where the numbers of a change come from: the text and the standard deviations that its files state beside them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final

from airtruth.physics.terms import AeroTerm, DeclaredTerm, ReadingTerm, SensorTerm, StateTerm, SurfaceTerm
from airtruth.quantity import Quantity

MARK: Final = "changed by airtruth"
"""In the heads of both files of a changed aircraft, and the source of a number that has no other."""

SHARE: Final = 1e-3
"""Rounding of an estimated number, as a share of its standard deviation [-] (judgement: no reader can tell)."""
Term = AeroTerm | DeclaredTerm | ReadingTerm | SensorTerm | StateTerm | SurfaceTerm
"""A term with a number of its own, see `number_of`."""


def number_of(term: Term) -> float:
    """The number that sizes a term [its unit]: its value, its amplitude, or the time constant or half width of a state.

    Examples
    --------
    >>> number_of(SurfaceTerm("delay", 0.06)), number_of(StateTerm("wake", "lag", "alpha", time_s=0.1))
    (0.06, 0.1)
    """
    if isinstance(term, AeroTerm | ReadingTerm):
        return term.amplitude
    if isinstance(term, StateTerm):
        return term.half_width if term.kind == "play" else term.time_s
    return term.value


def with_number(term: Term, number: float) -> Term:
    """The term with another number, see `number_of`."""
    if isinstance(term, AeroTerm | ReadingTerm):
        return replace(term, amplitude=number)
    if isinstance(term, StateTerm):
        return replace(term, half_width=number) if term.kind == "play" else replace(term, time_s=number)
    return replace(term, value=number)


def rounded(value: float, std: float) -> float:
    """A value to a thousandth of its standard deviation; unchanged where that is zero or not finite.

    Examples
    --------
    >>> rounded(-0.2609194432367406, 0.022), rounded(1.5, 0.0)
    (-0.26092, 1.5)
    """
    if not 0.0 < std < math.inf or not math.isfinite(value):
        return value
    return round(value, -math.floor(math.log10(std) + math.log10(SHARE)))


@dataclass(frozen=True)
class Origin:
    """Source of the numbers of a change.

    Attributes
    ----------
    source : method, date and records, e.g. "airtruth trace of 2026-11-28, records r1, r2"; empty if nobody stated it.
    std : standard deviation of the number of a term, of those that have one [unit of the number].
    """

    source: str = ""
    std: Mapping[Term, float] = field(default_factory=dict)

    def words(self, term: Term) -> str:
        """Standard deviation and source as the end of a description; empty where there is neither."""
        std = [f"std {self.std[term]:.3g}"] if term in self.std else []
        return "".join(f"; {part}" for part in (*std, *([self.source] if self.source else [])))

    def of_declared(self, quantity: str) -> str:
        """`words` for the terms of a declared quantity."""
        found = (t for t in self.std if isinstance(t, DeclaredTerm) and t.quantity == quantity)
        return "".join(self.words(term) for term in found)

    def std_of(self, quantity: str, scale: float) -> float | None:
        """Standard deviation of the terms of a declared quantity together, times a scale; None where none is known."""
        found = [std for t, std in self.std.items() if isinstance(t, DeclaredTerm) and t.quantity == quantity]
        return scale * math.hypot(*found) if found else None

    def stated(self, declared: Quantity, value: float, std: float | None) -> Quantity:
        """A declared quantity with another value, the standard deviation of that value where there is one, and its source.

        Parameters
        ----------
        declared : quantity before.
        value, std : after [SI]; None keeps the declared standard deviation.
        """
        kept = declared.std if std is None else std
        return Quantity(value=value, std=kept, source=self.source or MARK)


UNKNOWN: Final = Origin()
"""Origin of a change of which nothing is stated."""

__all__ = ["MARK", "SHARE", "UNKNOWN", "Origin", "Term", "number_of", "rounded", "with_number"]
