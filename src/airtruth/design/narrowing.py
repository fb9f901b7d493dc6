"""Plan the flight that determines derivatives, or that narrows the band of learned increments."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.aircraft.neutral import effective
from airtruth.design.bench import Bench, Flown
from airtruth.design.flight import LEAST_RECORDS, PlanOptions, flying, in_words, planning
from airtruth.design.narrow_result import BandHistories, ForecastQuantity, NarrowResult, NarrowRow
from airtruth.design.search import REFERENCE, InputSearch, Rated, Setup, Step, best_setup, run
from airtruth.errors import ConfigurationError
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.terms import Change
from airtruth.simulation.campaign.file import Campaign
from airtruth.simulation.simulator import Condition

Array = NDArray[np.float64]


class Targets(Protocol):
    """A question at a flight condition: it gives the merits of inputs from expected standard errors."""

    @property
    def targets(self) -> tuple[str, ...]:
        """Names."""

    @property
    def known(self) -> Array:
        """(targets,) standard errors before the flight [-]."""

    @property
    def gust_m_s(self) -> float:
        """Standard deviation of the vertical gust [m/s]."""

    @property
    def changes(self) -> tuple[Change, ...]:
        """Changes of the aircraft with which the limits are kept besides."""

    def rate(self, flown: Flown, *, final: bool = False) -> Array | None:
        """(targets,) known over expected standard error [-]; None if a motion is lost."""

    def quantities(self, flown: Flown, reference: Flown) -> tuple[ForecastQuantity, ...]:
        """The standard errors by an input and by the reference."""


class Question(Protocol):
    """A question to a flight: `airtruth.design.precision.DerivativeQuestion`, `airtruth.design.band.BandQuestion`."""

    @property
    def title(self) -> str:
        """The purpose of the input, in lower case."""

    def at(self, bench: Bench, campaign: Campaign, records: int, seed: int) -> Targets:
        """The question at a flight condition."""


@dataclass(frozen=True)
class _Asked:
    """Everything that is the same at all flight conditions."""

    campaign: Campaign
    question: Question
    options: PlanOptions
    aircraft: Aircraft

    @property
    def records(self) -> int:
        return self.options.records or LEAST_RECORDS

    def at(self, condition: Condition) -> Setup[Targets]:
        """The question at a flight condition, with its reference input."""
        limits = self.options.limits
        bench = Bench(self.aircraft, self.campaign, condition, limits)
        targets = self.question.at(bench, self.campaign, self.records, self.options.seed)
        bench.allow_for(effective(change) for change in targets.changes)
        search = InputSearch(bench, targets, limits.rise_s)
        reference = search.rate(REFERENCE, search.reference())
        if reference is None:
            raise ConfigurationError(
                f"plan: a 3-2-1-1 of {limits.length_s:g} s cannot be flown at {condition.eas_m_s:g} m/s EAS within the "
                "limits; shorten it, lower the amplitude, or widen the limits"
            )
        search.best.clear()
        return Setup(search, reference)


def narrow(
    campaign: Campaign,
    question: Question,
    options: PlanOptions | None = None,
    aircraft: Aircraft | None = None,
    step: Step = lambda text: None,
) -> NarrowResult:
    """Compute the input after which the standard errors are smallest, with the campaign that flies it.

    Parameters
    ----------
    campaign : aircraft, flight condition, gusts, sensors and rates; its manoeuvres and effects are replaced. Of an
        airspeed that is drawn, the ends and the middle are compared.
    question : derivatives or learned increments; of several the one that improves least counts.
    options : limits, records and seed; None for the defaults.
    aircraft : the declared aircraft; None to load that of the campaign.
    step : receives each step of the computation.

    Raises
    ------
    ConfigurationError
        If the campaign flies in closed loop, the aircraft has no JSBSim model, a sensor has no noise, or no input can be
        flown.
    AircraftError, TrimError
        If the aircraft cannot be loaded, or cannot fly at any condition.
    """
    with planning(campaign, aircraft) as declared:
        return _narrow(_Asked(campaign, question, options or PlanOptions(), declared), step)


def _narrow(asked: _Asked, step: Step) -> NarrowResult:
    step("trim and probe the declared aircraft")
    chosen = best_setup(
        asked.campaign,
        asked.at,
        lambda value: f"the {REFERENCE} divides standard errors by {value:.3g}",
        step,
    )
    best = run(chosen.search, asked.options.seed, step)
    step("rate the best inputs with all draws")
    finals, reference = chosen.finals(best.values())
    winner = finals[0] if finals[0].value > reference.value else reference
    bench, targets = chosen.search.bench, chosen.search.criterion
    planned, compared = (
        flying(asked.campaign, bench, r.flown.manoeuvre, asked.records, asked.question.title)
        for r in (winner, reference)
    )
    return NarrowResult(
        aircraft=asked.aircraft.name,
        campaign=planned,
        reference_campaign=compared,
        targets=targets.targets,
        known=tuple(targets.known.tolist()),
        quantities=targets.quantities(winner.flown, reference.flown),
        limits=asked.options.limits,
        reached=winner.flown.reached,
        condition=bench.condition,
        gust_m_s=targets.gust_m_s,
        rows=tuple(_row(r, targets) for r in (*finals, reference)),
        reference=_row(reference, targets),
        tried=chosen.search.tried,
        histories=_histories(winner.flown, reference.flown),
    )


def _row(rated: Rated, targets: Targets) -> NarrowRow:
    m = rated.flown.manoeuvre
    return NarrowRow(
        family=rated.family,
        shape=in_words(m),
        amplitude_rad=m.amplitude_rad,
        std=tuple((targets.known / rated.merit).tolist()),
        merit=rated.value,
    )


def _histories(flown: Flown, reference: Flown) -> BandHistories:
    alpha = flown.channels[LONGITUDINAL.vane]
    return BandHistories(flown.t_s, flown.moved_rad, reference.moved_rad, alpha)


__all__ = ["Question", "Targets", "narrow"]
