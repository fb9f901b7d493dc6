"""The lateral flight that separates effects of the lateral-directional motion: the inputs of `airtruth.design.lateral_flight`.

Each input is flown in calm air by the declared aircraft, and `airtruth.design.criterion` gives the separation of the effects by
its record. The input with the largest separation, whichever effect is true, is written as a campaign in both signs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from airtruth.aircraft import Aircraft
from airtruth.design.criterion import Criterion, criterion
from airtruth.design.flight import LEAST_RECORDS, PlanOptions, conditions, fitted_of, model_of, planning
from airtruth.design.lateral_flight import LateralFlight, LateralInput, every_input, with_input
from airtruth.design.question import Hypothesised, at_point
from airtruth.design.separation import Member
from airtruth.design.split_result import split_probability
from airtruth.design.splitting import enough_records
from airtruth.errors import ConfigurationError
from airtruth.logs.flight_log import FlightLog
from airtruth.physics.motion import LATERAL
from airtruth.simulation.campaign.chunk import flown_runs
from airtruth.simulation.campaign.file import Campaign
from airtruth.simulation.campaign.plan import make, planned_runs
from airtruth.simulation.disposable import isolated_flight
from airtruth.simulation.resolution import linear_point
from airtruth.table.model import significant
from airtruth.tracing.model.records import TraceRecord
from airtruth.tracing.options import TraceOptions
from airtruth.tracing.prepare import prepare


@dataclass(frozen=True, repr=False)
class LateralSplit(LateralFlight):
    """The flight that separates effects; the values of an input are separations [standard deviations].

    Attributes
    ----------
    hypotheses : the effects at the sizes that are planned for.
    fitted : records that count: those that a trace does not hold out.
    gust_m_s : standard deviation of the side gust [m/s].
    """

    hypotheses: tuple[Member, ...]
    fitted: int
    gust_m_s: float

    @property
    def columns(self) -> tuple[str, ...]:
        """Separation where each effect is the truth."""
        return tuple(f"sigma, {m.effect.key} true" for m in self.hypotheses)

    @property
    def purpose(self) -> str:
        """The effects."""
        return f"separates {', '.join(m.effect.key for m in self.hypotheses)}"

    @property
    def least(self) -> float:
        """Separation by the input that is flown, whichever effect is true."""
        return min(self.inputs[0].values)

    @property
    def notes(self) -> tuple[str, ...]:
        """The probability of one name, and the sizes."""
        sizes = "; ".join(
            f"{m.effect.key} " + ", ".join(f"{k} = {significant(v)}" for k, v in m.values.items())
            for m in self.hypotheses
        )
        return (
            f"The first input separates by {significant(self.least)} standard deviations or more; a trace then has one name "
            f"with a probability of {significant(split_probability(self.least), 2)}.",
            f"Sizes: {sizes}.",
            f"Separation of {self.fitted} fitted of {self.campaign.runs} records in side gusts of {significant(self.gust_m_s)} "
            "m/s; mean over draws of sizes and derivatives.",
        )

    def to_dict(self) -> dict[str, Any]:
        """Aircraft, campaign, inputs, effects with their sizes, and the separation."""
        return super().to_dict() | {
            "hypotheses": [{"name": m.effect.key, "parameters": m.values} for m in self.hypotheses],
            "separation_sigma": self.least,
            "probability_of_one_name": split_probability(self.least),
            "fitted": self.fitted,
        }


def split_lateral(
    base: Campaign,
    hypotheses: Sequence[Hypothesised],
    options: PlanOptions,
    aircraft: Aircraft | None = None,
    step: Callable[[str], None] = lambda text: None,
) -> LateralSplit:
    """Compare the inputs, and return the campaign of the one that separates hypotheses most.

    Parameters
    ----------
    base : aircraft, condition, gusts and sensors; its manoeuvres are replaced.
    hypotheses : two or more, the first with sizes.
    options : amplitude, records and seed.
    aircraft : the declared aircraft; None to load that of the campaign.
    step : receives each step.

    Raises
    ------
    ConfigurationError, AircraftError, TrimError, FlightError
        If the campaign flies in closed loop, or the aircraft cannot be loaded or flown, or no input can be rated.
    """
    amplitude_rad = options.limits.amplitude_rad
    with planning(base, aircraft) as declared:
        at = next(conditions(base))
        resolved = list(hypotheses)
        if any(h.effect.in_derivatives for h in hypotheses):
            point = linear_point(declared, at, motion=LATERAL)
            resolved = [at_point(h, point) for h in hypotheses]
        model = model_of(declared, base, at, fitted_of(options.records or LEAST_RECORDS), LATERAL)
        judged: Criterion | None = None
        found: list[LateralInput] = []
        for kind, steps_s in every_input():
            step(f"evaluate {kind} with steps of {steps_s[0]:g} and {steps_s[1]:g} s")
            record = _record(with_input(base, kind, steps_s, amplitude_rad, 2), declared)
            if judged is None:
                judged = criterion(model, resolved, record, record.plant.derivative_cov, options.seed)
            sigma = judged.separations(record)
            if sigma is not None:
                found.append(LateralInput(kind, steps_s, tuple(sigma.tolist())))
        if judged is None or not found:
            raise ConfigurationError(
                "plan: the tracer's model diverges with every lateral input; lower the amplitude"
            )
        found.sort(key=lambda one: -min(one.values))
        records = options.records or enough_records(min(found[0].values))
        more = np.sqrt(fitted_of(records) / model.records)
        found = [replace(one, values=tuple((more * np.array(one.values)).tolist())) for one in found]
        best = found[0]
        campaign = with_input(base, best.kind, best.steps_s, amplitude_rad, records)
        return LateralSplit(
            declared.name,
            campaign,
            tuple(found),
            judged.members,
            fitted_of(records),
            model.gust_m_s,
        )


def _record(campaign: Campaign, aircraft: Aircraft) -> TraceRecord:
    """The first run of a campaign, flown in calm air by exact sensors, as a trace of the lateral motion has it.

    The second run is there for the trace alone, which divides a single one.
    """
    plan = replace(make(campaign), aircraft=aircraft)
    still = [
        replace(run, sigma_u_m_s=0.0, sigma_w_m_s=0.0, sigma_v_m_s=0.0) for run in planned_runs(plan.table)
    ]
    flown = isolated_flight(
        len(still) * plan.samples,
        f"the flights of {aircraft.name}",
        flown_runs,
        replace(plan, sensors={}, table=plan.table.iloc[:0]),
        still,
    )
    columns = {*LATERAL.channels, *LATERAL.known, "altitude_m", "density_kg_m3"}
    channels = {
        name: np.concatenate([run.channels[name] for run in flown])
        for name in flown[0].channels
        if name in columns
    }
    samples = len(next(iter(flown[0].channels.values())))
    log = FlightLog(
        metadata={"aircraft": aircraft.name},
        run_ids=tuple(f"plan-{k}" for k in range(len(flown))),
        offsets=samples * np.arange(len(flown) + 1),
        t_s=np.tile(np.arange(samples) / campaign.log_hz, len(flown)),
        channels=channels,
    )
    options = TraceOptions(hold_out=(), motion=LATERAL.name)
    return prepare([log], aircraft, (), options).fitted.records[0]


__all__ = ["LateralSplit", "split_lateral"]
