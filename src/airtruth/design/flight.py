"""Common parts of every planned flight: options, flight conditions to compare, air, and the campaign that flies an input."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from threadpoolctl import threadpool_limits

from airtruth.aircraft import Aircraft
from airtruth.aircraft import load as load_aircraft
from airtruth.arguments import require_whole
from airtruth.design.bench import Bench
from airtruth.design.limits import Limits
from airtruth.design.separation import FilterSetting
from airtruth.errors import ConfigurationError
from airtruth.physics.gust_figures import GustScales, gust_scales
from airtruth.physics.motion import LONGITUDINAL, Motion
from airtruth.simulation.campaign.file import NO_GUST, Campaign, ConditionTable
from airtruth.simulation.campaign.manoeuvre_table import ManoeuvreTable
from airtruth.simulation.campaign.tables import Choice, Constant, Distribution, Normal, Uniform
from airtruth.simulation.manoeuvres import Manoeuvre
from airtruth.simulation.simulator import Condition, jsbsim_model
from airtruth.tracing.conditions import gust_length_m
from airtruth.tracing.model.settings import declared_change, settings_of

LEAST_RECORDS: Final = 6
"""Least records of a planned campaign of which the number is not stated [-] (judgement: four to fit, two to hold out)."""
_STILL_M_S: Final = 0.05
"""Standard deviations of the gusts of air that a campaign calls still [m/s] (judgement: no air is)."""
_THRUST_STD: Final = 0.05
"""Relative standard deviation of the thrust, throttle logged [-] (judgement: as in a trace)."""
_PER_RAD: Final = 1e7
"""Digits of an amplitude in a campaign file [1/rad] (judgement); it is rounded down, so that limits hold."""
_MOST_CONDITIONS: Final = 3
"""Airspeeds that are compared [-] (judgement: the ends of a range and its middle)."""


@dataclass(frozen=True)
class PlanOptions:
    """Choices of a planned flight.

    Attributes
    ----------
    limits : of the input and of the motion.
    records : records of the campaign, of which a trace holds out every third; None for `LEAST_RECORDS`, or to separate
        effects as many as give one name with 95 % probability.
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
        if self.records is not None:
            require_whole("records", self.records, 1)
        require_whole("seed", self.seed, 0)


def fitted_of(records: int) -> int:
    """Records that a trace fits: all but every third.

    Examples
    --------
    >>> fitted_of(2), fitted_of(6)
    (2, 4)
    """
    return records - (records // 3 if records >= 3 else 0)


@contextmanager
def planning(campaign: Campaign, aircraft: Aircraft | None) -> Iterator[Aircraft]:
    """Return the declared aircraft of a campaign that an input is planned for, within one thread of linear algebra.

    Parameters
    ----------
    campaign : flies in open loop; aircraft : None to load that of the campaign.

    Raises
    ------
    ConfigurationError
        If the campaign has a gain of the augmentation, or the aircraft has no JSBSim model.
    AircraftError
        If the aircraft cannot be loaded.
    """
    _require_open_loop(campaign)
    with threadpool_limits(limits=1, user_api="blas"):  # threads for small matrices wait for each other
        declared = load_aircraft(campaign.aircraft) if aircraft is None else aircraft
        jsbsim_model(declared)
        yield declared


def _require_open_loop(campaign: Campaign) -> None:
    gains = campaign.augmentation
    if gains.damper_gain_s or gains.attitude_gain:
        raise ConfigurationError(
            f"plan: campaign {campaign.name} flies with an augmentation, "
            "which a planned input does not take into account; set its "
            "gains to 0"
        )


def conditions(campaign: Campaign) -> Iterator[Condition]:
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


def gusts(campaign: Campaign, at: Condition) -> GustScales:
    """Gusts of a campaign at a condition; air that it calls still has gusts of `_STILL_M_S`."""
    gust = campaign.gust
    if gust.level == NO_GUST:
        length_m = gust_length_m(at.altitude_m)
        return GustScales(_STILL_M_S, _STILL_M_S, length_m, length_m)
    scales = gust_scales(gust.figures, gust.level, at.altitude_m, _middle(gust.factor))
    return scales._replace(
        sigma_u_m_s=max(float(scales.sigma_u_m_s), _STILL_M_S),
        sigma_w_m_s=max(float(scales.sigma_w_m_s), _STILL_M_S),
    )


def model_of(
    aircraft: Aircraft, campaign: Campaign, at: Condition, records: int, motion: Motion = LONGITUDINAL
) -> FilterSetting:
    """The tracer's filter for flights to come: sensors of a campaign, its gusts at a condition, and equal records.

    Parameters
    ----------
    records : records that are fitted together.
    motion : of the records; the lateral gusts are as strong as the vertical ones.
    """
    sensors = campaign.sensors.apply(aircraft.file.sensors)
    file = aircraft.file.model_copy(update={"sensors": sensors})
    flown_with = aircraft.model_copy(update={"file": file})
    return FilterSetting(
        settings=settings_of(flown_with, _THRUST_STD, motion),
        declared=declared_change(flown_with, motion),
        gust_m_s=gusts(campaign, at).sigma_w_m_s,
        records=records,
    )


def flying(campaign: Campaign, bench: Bench, manoeuvre: Manoeuvre, records: int, title: str) -> Campaign:
    """The campaign that flies an input at the condition of a bench.

    Parameters
    ----------
    campaign : aircraft, gusts, sensors and rates; its manoeuvres and effects are replaced.
    records : number of its runs.
    title : what the input does, in lower case.
    """
    at = bench.condition
    condition = ConditionTable.model_validate(
        {"eas_m_s": at.eas_m_s, "altitude_m": at.altitude_m, "flight_path_rad": at.gamma_rad}
    )
    return campaign.model_copy(
        update={
            "title": title,
            "runs": records,
            "duration": round(bench.duration_s, 9),
            "condition": condition,
            "manoeuvre": (_table(manoeuvre),),
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


def in_words(m: Manoeuvre) -> str:
    """Segments or spectrum of an input."""
    if m.kind == "multistep":
        return f"{len(m.segments_s)} segments of {min(m.segments_s):.3g} to {max(m.segments_s):.3g} s"
    weights = np.array(m.weights) ** 2
    middle = float(np.array(m.harmonics) @ weights / weights.sum()) / m.length_s
    return f"{len(m.harmonics)} harmonics about {middle:.3g} Hz"


__all__ = [
    "LEAST_RECORDS",
    "PlanOptions",
    "conditions",
    "fitted_of",
    "flying",
    "gusts",
    "in_words",
    "model_of",
    "planning",
]
