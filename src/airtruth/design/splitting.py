"""Plan the flight that separates effects which explain the records of an earlier one equally well."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.aircraft.neutral import effective
from airtruth.design.bench import Bench, Flown
from airtruth.design.criterion import Criterion, criterion
from airtruth.design.flight import (
    LEAST_RECORDS,
    PlanOptions,
    conditions,
    fitted_of,
    flying,
    in_words,
    model_of,
    planning,
)
from airtruth.design.question import Hypothesised, at_point
from airtruth.design.search import REFERENCE, InputSearch, Rated, Setup, Step, best_setup, run
from airtruth.design.separation import FilterSetting
from airtruth.design.split_result import InputRow, Prediction, SplitResult, split_probability
from airtruth.errors import ConfigurationError
from airtruth.simulation.campaign.file import Campaign
from airtruth.simulation.resolution import point_of
from airtruth.simulation.simulator import Condition

Array = NDArray[np.float64]

MOST_RECORDS: Final = 60
"""Most records of a planned campaign of which the number is not stated [-] (judgement: an hour at one record a minute)."""
ENOUGH: Final = 0.95
"""Probability of one name at which more records are not planned [-] (convention)."""


def split(
    campaign: Campaign,
    hypotheses: Sequence[Hypothesised],
    options: PlanOptions | None = None,
    aircraft: Aircraft | None = None,
    step: Step = lambda text: None,
) -> SplitResult:
    """Compute the input that separates hypotheses most, with the campaign that flies it.

    Parameters
    ----------
    campaign : aircraft, flight condition, gusts, sensors and rates; its manoeuvres and effects are replaced. Of an
        airspeed that is drawn, the ends and the middle are compared.
    hypotheses : two or more, the first with sizes (`airtruth.design.question`).
    options : limits, records and seed; None for the defaults.
    aircraft : the declared aircraft; None to load that of the campaign.
    step : receives each step of the computation.

    Raises
    ------
    ConfigurationError
        If the campaign flies in closed loop, the aircraft has no JSBSim model, or no input can be flown.
    AircraftError, TrimError
        If the aircraft cannot be loaded, or cannot fly at any condition.
    """
    options = options or PlanOptions()
    with planning(campaign, aircraft) as declared:
        return _split(campaign, hypotheses, options, declared, step)


def reference_separation(
    campaign: Campaign, hypotheses: Sequence[Hypothesised], options: PlanOptions, aircraft: Aircraft
) -> float:
    """Separation by the 3-2-1-1 that fills the length, whichever hypothesis is true [standard deviations].

    Parameters
    ----------
    campaign, hypotheses, options, aircraft : as in `split`; of several airspeeds the first counts.

    Raises
    ------
    ConfigurationError, TrimError
        If it cannot be flown.
    """
    return _at(campaign, next(conditions(campaign)), hypotheses, options, aircraft).reference.value


def _split(
    campaign: Campaign,
    hypotheses: Sequence[Hypothesised],
    options: PlanOptions,
    aircraft: Aircraft,
    step: Step,
) -> SplitResult:
    step("trim and probe the declared aircraft")
    chosen = best_setup(
        campaign,
        lambda at: _at(campaign, at, hypotheses, options, aircraft),
        lambda value: f"{value:.3g} standard deviations by the {REFERENCE}",
        step,
    )
    best = run(chosen.search, options.seed, step)
    step("rate the best inputs with all draws")
    finals, reference = chosen.finals(best.values())
    records = options.records or enough_records(finals[0].value)
    if fitted_of(records) != chosen.search.criterion.model.records:
        chosen.search.criterion = chosen.search.criterion.of_records(fitted_of(records))
        finals, reference = chosen.finals(finals)
    winner = finals[0] if finals[0].value > reference.value else reference
    members = chosen.search.criterion.members
    title = "the input that separates " + " from ".join(m.effect.key for m in members)
    planned, compared = (
        flying(campaign, chosen.search.bench, r.flown.manoeuvre, records, title) for r in (winner, reference)
    )
    return SplitResult(
        aircraft=aircraft.name,
        campaign=planned,
        reference_campaign=compared,
        hypotheses=members,
        limits=options.limits,
        reached=winner.flown.reached,
        condition=chosen.search.bench.condition,
        gust_m_s=chosen.search.criterion.model.gust_m_s,
        fitted=fitted_of(records),
        rows=tuple(_row(r) for r in (*finals, reference)),
        reference=_row(reference),
        tried=chosen.search.tried,
        prediction=_prediction(chosen.search.criterion, winner.flown, reference.flown),
    )


def enough_records(sigma: float) -> int:
    """Records that give one name with `ENOUGH` probability, where `LEAST_RECORDS` separate by ``sigma``."""
    first = fitted_of(LEAST_RECORDS)
    for records in range(LEAST_RECORDS, MOST_RECORDS):
        if split_probability(sigma * math.sqrt(fitted_of(records) / first)) >= ENOUGH:
            return records
    return MOST_RECORDS


def _at(
    campaign: Campaign,
    at: Condition,
    hypotheses: Sequence[Hypothesised],
    options: PlanOptions,
    aircraft: Aircraft,
) -> Setup[Criterion]:
    limits = options.limits
    bench = Bench(aircraft, campaign, at, limits)
    model = model_of(aircraft, campaign, at, fitted_of(options.records or LEAST_RECORDS))
    point = (
        point_of(aircraft, bench.trim, bench.linear)
        if any(h.effect.in_derivatives for h in hypotheses)
        else None
    )
    resolved = [h if point is None else at_point(h, point) for h in hypotheses]
    search = InputSearch(bench, _nothing(model), limits.rise_s)
    flown = bench.fly(search.reference())
    if flown is None:
        raise ConfigurationError(
            f"plan: a 3-2-1-1 of {limits.length_s:g} s cannot be flown at {at.eas_m_s:g} m/s EAS within the limits; "
            "shorten it, or widen the limits"
        )
    search.criterion = criterion(model, resolved, flown.record, bench.plant.derivative_cov, options.seed)
    bench.allow_for(effective(m.effect.change(m.values)) for m in search.criterion.members)
    reference = search.rate(REFERENCE, search.reference())
    if reference is None:
        raise ConfigurationError("plan: the tracer's model diverges in a 3-2-1-1; lower the amplitude")
    search.best.clear()
    return Setup(search, reference)


def _nothing(model: FilterSetting) -> Criterion:
    return Criterion(model, (), (), ())


def _row(rated: Rated) -> InputRow:
    m, reached = rated.flown.manoeuvre, rated.flown.reached
    return InputRow(
        family=rated.family,
        amplitude_rad=m.amplitude_rad,
        shape=in_words(m),
        sigma=tuple(float(x) for x in rated.merit),
        load_factor=reached.load_factor,
    )


def _prediction(judged: Criterion, flown: Flown, reference: Flown) -> Prediction:
    first, second = judged.differences(flown.record)
    noise = judged.model.settings.noise
    return Prediction(flown.t_s, flown.moved_rad, reference.moved_rad, first - second, noise)


__all__ = ["enough_records", "reference_separation", "split"]
