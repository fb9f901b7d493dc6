"""The input of each family that answers a question best: the separation of hypotheses, or the accuracy of an estimate.

Doublets, 1-2-1 and 3-2-1-1 are tried over their unit, once and repeated. The best of them, in either sign and at smaller
amplitudes, begin the search of a free multistep; spectra of one band and the flat one begin that of a multisine. Both are
evolution strategies of one parent and one child whose spread follows the share of successes.

Source: H.-G. Beyer and H.-P. Schwefel, Natural Computing 1 (2002) 3-52, section 4.2 (the 1/5 rule).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Final, Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from airtruth.design import waveforms
from airtruth.design.bench import Bench, Flown
from airtruth.design.flight import conditions
from airtruth.errors import AirtruthError, ConfigurationError
from airtruth.simulation.campaign.file import Campaign
from airtruth.simulation.manoeuvres import Manoeuvre
from airtruth.simulation.simulator import Condition

Array = NDArray[np.float64]
Step = Callable[[str], None]

REFERENCE: Final = "3-2-1-1 of equal length"
"""Name of the input with which every other is compared."""
MULTISTEP: Final = "optimised multistep"
"""Name of the family of free segments."""
MULTISINE: Final = "optimised multisine"
"""Name of the family of free spectra."""
_UNITS: Final = 6
"""Units tried per pattern [-] (judgement: a factor of about 1.6 between neighbours)."""
_SHARES: Final = (0.5, 0.25)
"""Amplitudes that are tried over the largest one [-] (judgement: a backlash shows at small ones)."""
_CHILDREN: Final = 36
"""Children of each evolution strategy [-] (judgement: later ones gain a few percent)."""
_SPREADS: Final = {MULTISTEP: 0.2, MULTISINE: 0.8}
"""First spread of the logarithms of a segment's length and of a weight [-] (judgement)."""
_SUCCESS, _FAILURE = 1.5, 0.9
_PEAKED: Final = 2.0
"""Logarithm of the weight of a peaked band over its neighbours [-] (judgement: most power in one band)."""
_SAMPLES_PER_UNIT: Final = 5
"""Samples of the log in the shortest unit [-] (judgement: the filter follows a surface between samples so far)."""
_LOWEST_PERIODS: Final = 1.0
"""Periods of the lowest frequency of a multisine in its length [-]."""


class Merit(Protocol):
    """A rule that rates inputs."""

    def rate(self, flown: Flown, *, final: bool = False) -> Array | None:
        """(parts,) merits of an input, all to be large; None if its motion is lost.

        Parameters
        ----------
        final : use all draws of what is not known, not the first two.
        """


C = TypeVar("C", bound=Merit)


@dataclass(frozen=True)
class Rated:
    """An input with its merits.

    Attributes
    ----------
    family : name of its family.
    flown : the input as flown.
    share : amplitude over the largest that the limits allow [-].
    merit : (parts,) as its `Merit` has them.
    """

    family: str
    flown: Flown
    share: float
    merit: Array

    @property
    def value(self) -> float:
        """The smallest merit."""
        return float(self.merit.min())


class InputSearch(Generic[C]):
    """Rates inputs at one flight condition.

    Parameters
    ----------
    bench, criterion : where inputs are flown, and what they are rated by.
    rise_s : time in which a multistep moves from one level to the next [s].
    """

    def __init__(self, bench: Bench, criterion: C, rise_s: float) -> None:
        self.bench, self.criterion, self.rise_s = bench, criterion, rise_s
        self.best: dict[str, Rated] = {}
        self.tried = 0

    def rate(
        self, family: str, manoeuvre: Manoeuvre, share: float = 1.0, *, final: bool = False
    ) -> Rated | None:
        """Rate an input and keep it if it is the best of its family; None if it cannot be flown."""
        self.tried += 1
        flown = self.bench.fly(manoeuvre, share)
        merit = None if flown is None else self.criterion.rate(flown, final=final)
        if flown is None or merit is None:
            return None
        rated = Rated(family, flown, share, merit)
        if not final and (family not in self.best or rated.value > self.best[family].value):
            self.best[family] = rated
        return rated

    def final(self, rated: Rated) -> Rated | None:
        """The same input with all draws."""
        return self.rate(rated.family, rated.flown.manoeuvre, rated.share, final=True)

    def reference(self) -> Manoeuvre:
        """The 3-2-1-1 whose segments fill the length.

        Raises
        ------
        ConfigurationError
            If its shortest segment is shorter than the surface needs from one level to the next.
        """
        length, dt = self.bench.limits.length_s, self.bench.dt_s
        units = waveforms.PATTERNS["3-2-1-1"]
        if length / sum(units) < max(self.rise_s, dt):
            raise ConfigurationError(
                f"plan: a 3-2-1-1 of {length:g} s has segments of {length / sum(units):.3g} s, and the surface needs "
                f"{max(self.rise_s, dt):.3g} s from one level to the next; lengthen the input, lower the amplitude, or "
                "allow a larger rate"
            )
        return waveforms.multistep(units, length / sum(units), self.rise_s, dt)

    @property
    def shortest_s(self) -> float:
        """Shortest unit [s]."""
        return max(_SAMPLES_PER_UNIT * self.bench.log_dt_s, self.rise_s)


@dataclass(frozen=True)
class Setup(Generic[C]):
    """A search at a flight condition with the input that others are compared with."""

    search: InputSearch[C]
    reference: Rated

    def finals(self, rated: Iterable[Rated]) -> tuple[list[Rated], Rated]:
        """Some inputs with all draws, best first, and the reference.

        Raises
        ------
        ConfigurationError
            If none can be flown.
        """
        finals = [r for one in rated if (r := self.search.final(one)) is not None]
        reference = self.search.final(self.reference) or self.reference
        if not finals:
            raise ConfigurationError("plan: no input can be flown within the limits; widen them")
        return sorted(finals, key=lambda r: -r.value), reference


def best_setup(
    campaign: Campaign, made: Callable[[Condition], Setup[C]], words: Callable[[float], str], step: Step
) -> Setup[C]:
    """The search at the flight condition where the reference input has the largest value.

    Parameters
    ----------
    campaign : of its airspeed the ends and the middle of a range are tried, or each value of a choice.
    made : makes the search at a condition; a condition at which it fails is left out.
    words : value of a reference input -> what ``step`` receives of it where several conditions are compared.

    Raises
    ------
    AirtruthError
        Of the last condition, where all fail.
    """
    every = list(conditions(campaign))
    tried: list[Setup[C]] = []
    problem: AirtruthError | None = None
    for at in every:
        try:
            one = made(at)
        except AirtruthError as error:
            problem = error
            continue
        tried.append(one)
        if len(every) > 1:
            step(f"{at.eas_m_s:.4g} m/s EAS: {words(one.reference.value)}")
    if not tried:
        assert problem is not None
        raise problem
    return max(tried, key=lambda one: one.reference.value)


def run(search: InputSearch[C], seed: int, step: Step = lambda text: None) -> dict[str, Rated]:
    """Search every family; the best input of each.

    Parameters
    ----------
    seed : seed of the evolution strategies.
    step : receives the name of each family before its search.
    """
    limits, dt = search.bench.limits, search.bench.dt_s
    step("doublets, 1-2-1 and 3-2-1-1")
    for family, made in waveforms.patterns(limits.length_s, search.shortest_s, search.rise_s, dt, _UNITS):
        search.rate(family, made)
    leaders = sorted(search.best.values(), key=lambda r: -r.value)[:2]
    for leader in leaders:
        search.rate(leader.family, waveforms.mirrored(leader.flown.manoeuvre))
    for leader in leaders[:1]:
        for share in _SHARES:
            search.rate(leader.family, search.best[leader.family].flown.manoeuvre, share)
    step(MULTISTEP)
    _multisteps(search, seed)
    step(MULTISINE)
    _multisines(search, seed)
    return search.best


def _multisteps(search: InputSearch[C], seed: int) -> None:
    rng = np.random.default_rng([seed, 1])
    length, dt, shortest = search.bench.limits.length_s, search.bench.dt_s, search.shortest_s
    start = max(search.best.values(), key=lambda r: r.value, default=None)
    if start is None:
        return
    parent = search.rate(MULTISTEP, start.flown.manoeuvre, start.share)
    spread = _SPREADS[MULTISTEP]
    for _ in range(_CHILDREN):
        if parent is None:
            return
        made = waveforms.perturbed(parent.flown.manoeuvre, spread, length, shortest, dt, rng)
        child = search.rate(MULTISTEP, made, parent.share)
        better = child is not None and child.value > parent.value
        spread *= _SUCCESS if better else _FAILURE
        parent = child if better else parent


def _multisines(search: InputSearch[C], seed: int) -> None:
    rng = np.random.default_rng([seed, 2])
    length = search.bench.limits.length_s
    band = (_LOWEST_PERIODS / length, 0.5 / search.shortest_s)

    def rate(weights: Array) -> Rated | None:
        return search.rate(MULTISINE, waveforms.multisine(weights, length, band))

    starts = [np.zeros(waveforms.BANDS), *(_PEAKED * np.eye(waveforms.BANDS))]
    rated = [(r, w) for w in starts if (r := rate(w)) is not None]
    if not rated:
        return
    parent, weights = max(rated, key=lambda pair: pair[0].value)
    spread = _SPREADS[MULTISINE]
    for _ in range(_CHILDREN - len(starts)):
        tried = weights + spread * rng.standard_normal(waveforms.BANDS)
        child = rate(tried - tried.max())
        better = child is not None and child.value > parent.value
        spread *= _SUCCESS if better else _FAILURE
        if child is not None and better:
            parent, weights = child, tried


__all__ = [
    "MULTISINE",
    "MULTISTEP",
    "REFERENCE",
    "InputSearch",
    "Merit",
    "Rated",
    "Setup",
    "Step",
    "best_setup",
    "run",
]
