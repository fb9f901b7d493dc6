"""Plan the flight that separates effects which explain the records of an earlier one equally well."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from airtruth.aircraft import Aircraft
from airtruth.aircraft import load as load_aircraft
from airtruth.aircraft.neutral import effective
from airtruth.design.bench import Bench, Flown
from airtruth.design.criterion import Criterion, criterion
from airtruth.design.limits import Limits
from airtruth.design.question import Hypothesised, at_point
from airtruth.design.search import REFERENCE, Rated, Search, run
from airtruth.design.separation import Model
from airtruth.design.split_result import InputRow, Prediction, SplitResult, split_probability
from airtruth.errors import AirtruthError, ConfigurationError
from airtruth.physics.gust_figures import gust_scales
from airtruth.simulation.campaign.file import (
    NO_GUST,
    Campaign,
    Choice,
    ConditionTable,
    Constant,
    Distribution,
    ManoeuvreTable,
    Normal,
    Uniform,
)
from airtruth.simulation.manoeuvres import Manoeuvre
from airtruth.simulation.resolution import point_of
from airtruth.simulation.simulator import Condition, jsbsim_model
from airtruth.tracing.model.settings import declared_change, settings_of

Array = NDArray[np.float64]
Step = Callable[[str], None]

LEAST_RECORDS: Final = 6
"""Least records of a planned campaign of which the number is not stated [-] (judgement: four to fit, two to hold out)."""
MOST_RECORDS: Final = 30
"""Most such records [-] (judgement: an afternoon of flying)."""
ENOUGH: Final = 0.95
"""Probability of one name at which more records are not planned [-] (convention)."""
_STILL_M_S: Final = 0.05
"""Vertical gust of air that a campaign calls still [m/s] (judgement: no air is)."""
_THRUST_STD: Final = 0.05
"""Relative standard deviation of the thrust, throttle logged [-] (judgement: as in a trace)."""
_PER_RAD: Final = 1e7
"""Digits of an amplitude in a campaign file [1/rad] (judgement); it is rounded down, so that limits hold."""
_MOST_CONDITIONS: Final = 3
"""Airspeeds that are compared [-] (judgement: the ends of a range and its middle)."""


@dataclass(frozen=True)
class SplitOptions:
    """Choices of a planned flight.

    Attributes
    ----------
    limits : of the input and of the motion.
    records : records of the campaign, of which a trace holds out every third; None for as many as give one name with
        `ENOUGH` probability, from `LEAST_RECORDS` to `MOST_RECORDS`.
    seed : seed of the search and of the draws.
    """

    limits: Limits = field(default_factory=Limits)
    records: int | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse values outside their range.

        Raises
        ------
        ConfigurationError
            Naming the option, its value and what is allowed.
        """
        if self.records is not None and self.records < 1:
            raise ConfigurationError(f"plan: {self.records} records; state 1 or more")


def fitted_of(records: int) -> int:
    """Records that a trace fits: all but every third.

    Examples
    --------
    >>> fitted_of(2), fitted_of(6)
    (2, 4)
    """
    return records - (records // 3 if records >= 3 else 0)


@dataclass(frozen=True)
class _Condition:
    """A flight condition with its bench, its criterion and the reference input."""

    at: Condition
    search: Search
    reference: Rated


def split(
    campaign: Campaign,
    hypotheses: Sequence[Hypothesised],
    options: SplitOptions | None = None,
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
    options = options or SplitOptions()
    gains = campaign.augmentation
    if gains.damper_gain_s or gains.attitude_gain:
        raise ConfigurationError(
            f"plan: campaign {campaign.name} flies with an augmentation, which the planned input does not know; set its "
            "gains to 0"
        )
    with threadpool_limits(limits=1, user_api="blas"):  # threads for small matrices wait for each other
        declared = load_aircraft(campaign.aircraft) if aircraft is None else aircraft
        jsbsim_model(declared)
        return _split(campaign, hypotheses, options, declared, step)


def reference_separation(
    campaign: Campaign, hypotheses: Sequence[Hypothesised], options: SplitOptions, aircraft: Aircraft
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
    return _at(campaign, next(_conditions(campaign)), hypotheses, options, aircraft).reference.value


def _split(
    campaign: Campaign,
    hypotheses: Sequence[Hypothesised],
    options: SplitOptions,
    aircraft: Aircraft,
    step: Step,
) -> SplitResult:
    step("trim and probe the declared aircraft")
    chosen = _best_condition(campaign, hypotheses, options, aircraft, step)
    best = run(chosen.search, options.seed, step)
    step("rate the best inputs with all draws")
    finals, reference = _finals(chosen, best.values())
    records = options.records or _enough(finals[0].value)
    if fitted_of(records) != chosen.search.criterion.model.records:
        chosen.search.criterion = chosen.search.criterion.of_records(fitted_of(records))
        finals, reference = _finals(chosen, finals)
    winner = finals[0] if finals[0].value > reference.value else reference
    planned = _campaign(campaign, chosen, winner, records)
    compared = _campaign(campaign, chosen, reference, records)
    members = chosen.search.criterion.members
    return SplitResult(
        aircraft=aircraft.name,
        campaign=planned,
        reference_campaign=compared,
        hypotheses=members,
        limits=options.limits,
        reached=winner.flown.reached,
        condition=chosen.at,
        gust_m_s=chosen.search.criterion.model.gust_m_s,
        fitted=fitted_of(records),
        rows=tuple(_row(r) for r in (*finals, reference)),
        reference=_row(reference),
        tried=chosen.search.tried,
        prediction=_prediction(chosen.search.criterion, winner.flown, reference.flown),
    )


def _finals(chosen: _Condition, rated: Iterable[Rated]) -> tuple[list[Rated], Rated]:
    """The inputs with all draws, best first, and the reference."""
    finals = [r for one in rated if (r := chosen.search.final(one)) is not None]
    reference = chosen.search.final(chosen.reference) or chosen.reference
    if not finals:
        raise ConfigurationError("plan: no input can be flown within the limits; widen them")
    return sorted(finals, key=lambda r: -r.value), reference


def _enough(sigma: float) -> int:
    """Records that give one name with `ENOUGH` probability, where `LEAST_RECORDS` separate by ``sigma``."""
    first = fitted_of(LEAST_RECORDS)
    for records in range(LEAST_RECORDS, MOST_RECORDS):
        if split_probability(sigma * math.sqrt(fitted_of(records) / first)) >= ENOUGH:
            return records
    return MOST_RECORDS


def _best_condition(
    campaign: Campaign,
    hypotheses: Sequence[Hypothesised],
    options: SplitOptions,
    aircraft: Aircraft,
    step: Step,
) -> _Condition:
    """The condition at which the reference input and two faster ones separate most."""
    conditions = list(_conditions(campaign))
    tried: list[_Condition] = []
    problem: AirtruthError | None = None
    for at in conditions:
        try:
            made = _at(campaign, at, hypotheses, options, aircraft)
        except AirtruthError as error:
            problem = error
            continue
        tried.append(made)
        if len(conditions) > 1:
            step(
                f"{at.eas_m_s:.4g} m/s EAS: {made.reference.value:.3g} standard deviations by the {REFERENCE}"
            )
    if not tried:
        assert problem is not None
        raise problem
    return max(tried, key=lambda c: c.reference.value)


def _at(
    campaign: Campaign,
    at: Condition,
    hypotheses: Sequence[Hypothesised],
    options: SplitOptions,
    aircraft: Aircraft,
) -> _Condition:
    limits = options.limits
    bench = Bench(aircraft, campaign, at, limits)
    rise_s = 2.0 * limits.amplitude_rad / limits.rate_rad_s
    sensors = campaign.sensors.apply(aircraft.file.sensors)
    file = aircraft.file.model_copy(update={"sensors": sensors})
    flown_with = aircraft.model_copy(update={"file": file})
    model = Model(
        settings=settings_of(flown_with, _THRUST_STD),
        declared=declared_change(flown_with),
        gust_m_s=_gust_m_s(campaign, at),
        records=fitted_of(options.records or LEAST_RECORDS),
    )
    point = (
        point_of(aircraft, bench.trim, bench.linear)
        if any(h.effect.in_derivatives for h in hypotheses)
        else None
    )
    resolved = [h if point is None else at_point(h, point) for h in hypotheses]
    search = Search(bench, _nothing(model), rise_s)
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
        raise ConfigurationError(
            "plan: the tracer's model loses the motion of a 3-2-1-1; lower the amplitude"
        )
    search.best.clear()
    return _Condition(at, search, reference)


def _nothing(model: Model) -> Criterion:
    return Criterion(model, (), (), ())


def _conditions(campaign: Campaign) -> Iterator[Condition]:
    """Flight conditions to compare: each airspeed of a choice, or the ends and the middle of a range."""
    table = campaign.condition
    altitude, gamma = _middle(table.altitude), _middle(table.flight_path)
    eas = table.eas
    if isinstance(eas, Uniform):
        speeds = np.linspace(eas.low, eas.high, _MOST_CONDITIONS).tolist()
    elif isinstance(eas, Choice):
        speeds = list(eas.choose)[:_MOST_CONDITIONS]
    else:
        speeds = [_middle(eas)]
    yield from (Condition(speed, altitude, gamma) for speed in dict.fromkeys(speeds))


def _middle(draw: Distribution) -> float:
    if isinstance(draw, Constant):
        return draw.value
    if isinstance(draw, Normal):
        return draw.mean
    if isinstance(draw, Uniform):
        return 0.5 * (draw.low + draw.high)
    return float(np.median(draw.choose))


def _gust_m_s(campaign: Campaign, at: Condition) -> float:
    gust = campaign.gust
    if gust.level == NO_GUST:
        return _STILL_M_S
    scales = gust_scales(gust.figures, gust.level, at.altitude_m, _middle(gust.factor))
    return max(float(scales.sigma_w_m_s), _STILL_M_S)


def _campaign(campaign: Campaign, chosen: _Condition, winner: Rated, records: int) -> Campaign:
    """The campaign that flies the input at its condition."""
    at = chosen.at
    condition = ConditionTable.model_validate(
        {"eas_m_s": at.eas_m_s, "altitude_m": at.altitude_m, "flight_path_rad": at.gamma_rad}
    )
    return campaign.model_copy(
        update={
            "title": "the input that separates "
            + " from ".join(m.effect.key for m in chosen.search.criterion.members),
            "runs": records,
            "duration": round(chosen.search.bench.duration_s, 9),
            "condition": condition,
            "manoeuvre": (_table(winner.flown.manoeuvre),),
            "effect": (),
        }
    )


def _table(m: Manoeuvre) -> ManoeuvreTable:
    shape: dict[str, object] = (
        {"segments_s": m.segments_s, "levels": m.levels, "rise_s": m.rise_s}
        if m.kind == "multistep"
        else {
            "length_s": m.length_s,
            "harmonics": m.harmonics,
            "weights": m.weights,
            "phases_rad": m.phases_rad,
        }
    )
    amplitude = {"amplitude_rad": math.floor(m.amplitude_rad * _PER_RAD) / _PER_RAD}
    return ManoeuvreTable.model_validate({"kind": m.kind, **amplitude, "start_s": m.start_s, **shape})


def _row(rated: Rated) -> InputRow:
    m, reached = rated.flown.manoeuvre, rated.flown.reached
    return InputRow(
        family=rated.family,
        amplitude_rad=m.amplitude_rad,
        shape=_shape(m),
        sigma=tuple(float(x) for x in rated.sigma),
        load_factor=reached.load_factor,
    )


def _shape(m: Manoeuvre) -> str:
    if m.kind == "multistep":
        return f"{len(m.segments_s)} segments of {min(m.segments_s):.3g} to {max(m.segments_s):.3g} s"
    weights = np.array(m.weights) ** 2
    middle = float(np.array(m.harmonics) @ weights / weights.sum()) / m.length_s
    return f"{len(m.harmonics)} harmonics about {middle:.3g} Hz"


def _prediction(judged: Criterion, flown: Flown, reference: Flown) -> Prediction:
    first, second = judged.differences(flown.record)
    dt = flown.record.signals.dt_s
    return Prediction(
        t_s=dt * np.arange(len(first), dtype=np.float64),
        elevator_rad=flown.channels["elevator_rad"] - flown.channels["elevator_rad"][0],
        reference_rad=reference.channels["elevator_rad"] - reference.channels["elevator_rad"][0],
        difference=first - second,
        noise=judged.model.settings.noise,
    )


__all__ = ["SplitOptions", "fitted_of", "reference_separation", "split"]
