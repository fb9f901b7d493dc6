"""Standard errors of the derivatives of a motion that a campaign can reach, before it is flown.

Each kind of run is flown once in calm air. The Cramer-Rao bound of
`airtruth.identification.likelihood.cramer_rao` is evaluated for its control surfaces, its gusts and the noise of the sensors,
with unknown levels and biases. Information adds up over runs.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from airtruth.arguments import require_whole
from airtruth.design.information import LinearExperiment, sensor_noise
from airtruth.design.lateral_information import LateralExperiment, lateral_values
from airtruth.errors import ConfigurationError, choices, counted
from airtruth.identification.likelihood.options import PRESSURES
from airtruth.physics.gust_figures import GustScales
from airtruth.physics.motion import LATERAL, LONGITUDINAL, MOTIONS, Motion
from airtruth.result import shortened
from airtruth.simulation.campaign.chunk import FlownRun, flown_runs
from airtruth.simulation.campaign.file import Campaign
from airtruth.simulation.campaign.plan import Plan, PlannedRun, make, planned_runs
from airtruth.simulation.campaign.run import Progress
from airtruth.simulation.disposable import isolated_flight
from airtruth.table import Table, as_html, as_text, flat, significant

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

MOST_KINDS: Final = 20
"""Largest number of kinds of runs that are evaluated (judgement: time against completeness); the first ones represent the
rest."""
_KIND: Final = (
    "eas_m_s",
    "altitude_m",
    "gamma_rad",
    "manoeuvre",
    "amplitude_rad",
    "sigma_u_m_s",
    "sigma_w_m_s",
    "length_u_m",
    "length_w_m",
)
"""Columns of the run table that define a kind of run: the bound depends on nothing else."""
_OF_KIND: Final = re.compile(r"amplitude_\d+_rad|sigma_v_m_s|length_v_m")
"""Further such columns, where the table has them."""


_NORMAL_95: Final = 1.959964
"""Quantile 0.975 of the normal distribution [-]."""


@dataclass(frozen=True)
class ForecastResult:
    """Least standard errors of the derivatives of a motion, in the order of its ``parameters``.

    Attributes
    ----------
    campaign, aircraft : names.
    pressure : whether the dynamic pressure is held "constant" or "measured".
    records : number of records that ``together`` is for.
    kinds : number of kinds of runs that were evaluated.
    theta : (n,) derivatives of the campaign's aircraft, with its effects, mean over the kinds [-].
    single, together : (n,) least standard error of one record, and of all records jointly [-].
    noise : channel -> standard deviation of the noise of its sensor [SI].
    gusts : name of each standard deviation of the gusts that acts on the motion -> its least and largest value [m/s].
    motion : name of the motion, key of `airtruth.physics.motion.MOTIONS`.
    with_effects : whether the campaign has effects, so that ``theta`` is not what the aircraft declares.
    """

    campaign: str
    aircraft: str
    pressure: str
    records: int
    kinds: int
    theta: Array
    single: Array
    together: Array
    noise: Mapping[str, float]
    gusts: Mapping[str, tuple[float, float]]
    motion: str = LONGITUDINAL.name
    with_effects: bool = False

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the derivatives."""
        return MOTIONS[self.motion].parameters

    @property
    def percent(self) -> Array:
        """(2, n) standard errors of one record and of all records, relative to the derivative [%]."""
        return 100.0 * np.stack([self.single, self.together]) / np.abs(self.theta)

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Derivatives that one record does not determine: their 95 % interval at the bound contains zero."""
        open_ = _NORMAL_95 * self.single > np.abs(self.theta)
        return tuple(name for name, own in zip(self.parameters, open_, strict=True) if own)

    def table(self) -> Table:
        """One row per derivative, with the gusts and the assumptions as notes."""
        single, together = self.percent
        columns = (self.theta, self.single, single, self.together, together)
        gusts = ", ".join(
            f"{name} {low:.3g}" + (f" to {high:.3g}" if high > low else "")
            for name, (low, high) in self.gusts.items()
        )
        airspeed = f", {self.pressure} pressure" if self.motion == LONGITUDINAL.name else ""
        return flat(
            title=f"Least standard errors to expect of {self.campaign} ({self.aircraft}{airspeed})",
            columns=(
                "parameter",
                "with effects" if self.with_effects else "declared",
                "standard error, one record",
                "percent",
                f"standard error, {counted(self.records, 'record')}",
                "percent of these",
            ),
            rows=[(name, *(float(c[i]) for c in columns)) for i, name in enumerate(self.parameters)],
            notes=(
                f"Gusts [m/s]: {gusts}. Kinds of runs evaluated: {self.kinds}.",
                "Cramer-Rao bound with noise levels, gust levels, biases and initial states unknown; "
                "filter-error comes nearest to it (docs/plan.md).",
                *(
                    [
                        f"One record does not determine {', '.join(self.undetermined)}: the 95 % interval contains zero."
                    ]
                    if self.undetermined
                    else []
                ),
            ),
        )

    def summary(self) -> str:
        """The table as text."""
        return as_text(self.table())

    def to_frame(self) -> pd.DataFrame:
        """One row per derivative: parameter, declared (with effects), std, percent, std_together, percent_together."""
        import pandas as pd

        single, together = self.percent
        return pd.DataFrame(
            {
                "parameter": self.parameters,
                "declared": self.theta,
                "std": self.single,
                "percent": single,
                "std_together": self.together,
                "percent_together": together,
            }
        )

    def to_dict(self) -> dict[str, Any]:
        """Facts of the campaign, and the rows of `to_frame` by parameter."""
        rows = self.to_frame().set_index("parameter").to_dict("index")
        return {
            "campaign": self.campaign,
            "aircraft": self.aircraft,
            "pressure": self.pressure,
            "records": self.records,
            "kinds": self.kinds,
            "motion": self.motion,
            **{f"{name}_m_s": list(ends) for name, ends in self.gusts.items()},
            "noise": dict(self.noise),
            "parameters": {str(name): row for name, row in rows.items()},
        }

    def plot(self) -> Figure:
        """Relative standard errors of one record and of all records, as bars on a logarithmic scale [%]."""
        from airtruth import style

        with style.applied():
            figure = style.new_figure(6.6 if len(self.parameters) <= 6 else 11.0, 3.4)
            ax = figure.subplots()
            at = np.arange(len(self.parameters))
            labels = ("one record", f"{counted(self.records, 'record')} together")
            for offset, values, label, colour in zip(
                (-0.2, 0.2), self.percent, labels, (style.BLUE, style.ORANGE), strict=True
            ):
                bars = ax.bar(at + offset, values, width=0.4, label=label, color=colour)
                ax.bar_label(bars, [significant(v, 2) for v in values], fontsize=7.5)
            ax.set_yscale("log")
            ax.margins(y=0.1)  # the numbers above the bars
            ax.set_xticks(at, self.parameters)
            ax.grid(axis="x", visible=False)
            ax.set_ylabel("least standard error [%]")
            style.legend_above(figure, [ax], self.table().title)
        return figure

    def __repr__(self) -> str:
        """Return the first lines of the summary."""
        return shortened(self.summary())

    def _repr_html_(self) -> str:
        return as_html(self.table())


def moved_motions(campaign: Campaign) -> tuple[str, ...]:
    """Names of the motions of which a campaign moves a control."""
    return tuple(
        motion.name
        for motion in MOTIONS.values()
        if campaign.moved & {control.name for control in motion.controls}
    )


def forecast(
    campaign: Path | str | Campaign | Plan,
    records: int | None = None,
    pressure: str = "constant",
    advance: Progress = lambda done, total, failed: None,
    motion: str | None = None,
) -> ForecastResult:
    """Least standard errors of the derivatives from the runs of a campaign, before they are flown.

    Parameters
    ----------
    campaign : campaign file, or a campaign that was read or planned.
    records : instead of the campaign's number of runs; they are of its kinds, in its proportions.
    pressure : "constant" uses nothing of the airspeed; "measured" makes it an output of the filter of the short period.
    advance : called after each kind of run with their number, the number of all, and 0.
    motion : "longitudinal" or "lateral"; None for the first of which the campaign moves a control.

    Raises
    ------
    ConfigurationError
        If the campaign cannot be flown as written or does not move each control of the motion, ``pressure`` or ``motion`` is not
        known, or a sensor has no noise.
    AircraftError, StoreError
        If the aircraft or a file cannot be loaded.
    TrimError, FlightError
        If a run cannot be flown.
    """
    if pressure not in PRESSURES:
        raise ConfigurationError(f"plan: pressure = {pressure!r}: {choices(pressure, PRESSURES)}")
    if motion is not None and motion not in MOTIONS:
        raise ConfigurationError(f"plan: motion = {motion!r}: {choices(motion, MOTIONS)}")
    if records is not None:
        require_whole("records", records, 1)
    plan = campaign if isinstance(campaign, Plan) else make(campaign)
    chosen = MOTIONS[motion or moved_motions(plan.campaign)[0]]
    _require_inputs(plan.campaign, chosen)
    lateral = chosen is LATERAL
    if lateral:
        lateral_values(plan.aircraft)  # refuses an aircraft without inertias before it flies
    channels = [output.channel for output in chosen.outputs]
    noise = sensor_noise(
        plan.sensors,
        plan.aircraft,
        [*channels, *(["airspeed_m_s"] if pressure == "measured" and not lateral else [])],
    )
    kinds, counts = _kinds(plan.table)
    runs = planned_runs(kinds)
    still = [replace(run, sigma_u_m_s=0.0, sigma_w_m_s=0.0, sigma_v_m_s=0.0) for run in runs]
    flown = isolated_flight(
        len(runs) * plan.samples,
        f"the flights of {plan.aircraft.name}",
        flown_runs,
        replace(plan, sensors={}, table=plan.table.iloc[:0]),
        still,
    )
    theta, covariance = [], []
    for run, flight in zip(runs, flown, strict=True):
        true, least = (_lateral_bound if lateral else _bound)(plan, run, flight, noise)
        theta.append(true)
        covariance.append(least)
        advance(len(theta), len(kinds), 0)
    share = counts / counts.sum()
    each = np.stack(covariance)
    information = np.tensordot(share, np.linalg.inv(each), axes=1)
    total = records or plan.campaign.runs
    return ForecastResult(
        campaign=plan.campaign.name,
        aircraft=plan.aircraft.name,
        pressure=pressure,
        records=total,
        kinds=len(kinds),
        theta=share @ np.stack(theta),
        single=np.sqrt(np.diag(np.tensordot(share, each, axes=1))),
        together=np.sqrt(np.diag(np.linalg.inv(information)) / total),
        noise=noise,
        gusts=_levels(kinds, ("sigma_v",) if lateral else ("sigma_u", "sigma_w")),
        motion=chosen.name,
        with_effects=bool(plan.campaign.effect),
    )


def _kinds(table: pd.DataFrame) -> tuple[pd.DataFrame, Array]:
    """A run of each of the first kinds, and how many runs of each there are."""
    further = [name for name in table.columns if _OF_KIND.fullmatch(name)]
    groups = table.groupby([*_KIND, *further], sort=False, dropna=False)
    kinds = groups.head(1).head(MOST_KINDS)
    return kinds, groups.size().to_numpy()[: len(kinds)].astype(np.float64)


def _require_inputs(campaign: Campaign, motion: Motion) -> None:
    """Refuse a campaign that leaves a control of the motion still: nothing is known of its derivatives."""
    still = [control.name for control in motion.controls if control.name not in campaign.moved]
    if still:
        raise ConfigurationError(
            f"plan: campaign {campaign.name} moves no {' and no '.join(still)}, so it cannot determine the derivatives of the "
            f"{motion.heading.lower()}; add a manoeuvre of the {' and of the '.join(still)}, or choose another motion"
        )


def _levels(kinds: pd.DataFrame, names: tuple[str, ...]) -> dict[str, tuple[float, float]]:
    """Least and largest standard deviations of gusts in a run table; zero where it has none [m/s]."""
    columns = {name: kinds.get(f"{name}_m_s") for name in names}
    return {
        name: (0.0, 0.0) if values is None else (float(values.min()), float(values.max()))
        for name, values in columns.items()
    }


def _bound(plan: Plan, run: PlannedRun, flown: FlownRun, noise: Mapping[str, float]) -> tuple[Array, Array]:
    """Derivatives (6,) of the short period, and the bound (6, 6) of one run of the table, from its flight in calm air."""
    gusts = GustScales(run.sigma_u_m_s, run.sigma_w_m_s, run.length_u_m, run.length_w_m)
    experiment = LinearExperiment(
        plan.aircraft,
        noise,
        gusts,
        flown.trim.airspeed_m_s,
        plan.dt_s * plan.log_every,
        plan.campaign.gust.start,
    )
    theta = flown.linear.plus
    return theta, experiment.least_covariance(flown.channels, theta)


def _lateral_bound(
    plan: Plan, run: PlannedRun, flown: FlownRun, noise: Mapping[str, float]
) -> tuple[Array, Array]:
    """The same of the lateral-directional motion, (15,) and (15, 15)."""
    assert flown.lateral is not None
    experiment = LateralExperiment(
        plan.aircraft,
        noise,
        run.sigma_v_m_s,
        run.length_v_m,
        plan.dt_s * plan.log_every,
        plan.campaign.gust.start,
    )
    theta = flown.lateral.central
    return theta, experiment.least_covariance(flown.channels, theta)
