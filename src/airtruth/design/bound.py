"""Standard errors of the six derivatives that a campaign can reach, before it is flown.

Each kind of run is flown once in calm air. The Cramer-Rao bound of
`airtruth.identification.likelihood.cramer_rao` is evaluated for its elevator, its gusts and the noise of the sensors,
with unknown levels and biases. Information adds up over runs.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from airtruth.arguments import require_whole
from airtruth.design.information import LinearExperiment, sensor_noise
from airtruth.errors import ConfigurationError, choices, counted
from airtruth.identification.likelihood.options import PRESSURES
from airtruth.physics.gust_figures import GustScales
from airtruth.physics.short_period import PARAMETERS
from airtruth.result import shortened
from airtruth.simulation.campaign.chunk import flown_runs
from airtruth.simulation.campaign.file import Campaign
from airtruth.simulation.campaign.plan import Plan, PlannedRun, make, planned_runs
from airtruth.simulation.campaign.run import Progress
from airtruth.simulation.disposable import isolated_flight
from airtruth.simulation.manoeuvres import ELEVATOR
from airtruth.simulation.trim import Trim
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
"""Columns of the run table that define a kind of run, with the amplitudes of further inputs: the bound depends on no other."""


@dataclass(frozen=True)
class ForecastResult:
    """Least standard errors of the six derivatives, in the order of `airtruth.physics.short_period.PARAMETERS`.

    Attributes
    ----------
    campaign, aircraft : names.
    pressure : whether the dynamic pressure is held "constant" or "measured".
    records : number of records that ``together`` is for.
    kinds : number of kinds of runs that were evaluated.
    theta : (6,) derivatives of the campaign's aircraft, with its effects, mean over the kinds [-].
    single, together : (6,) least standard error of one record, and of all records jointly [-].
    noise : channel -> standard deviation of the noise of its sensor [SI].
    sigma_u_m_s, sigma_w_m_s : least and largest standard deviations of the gusts [m/s].
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
    sigma_u_m_s: tuple[float, float]
    sigma_w_m_s: tuple[float, float]
    with_effects: bool = False

    @property
    def percent(self) -> Array:
        """(2, 6) standard errors of one record and of all records, relative to the derivative [%]."""
        return 100.0 * np.stack([self.single, self.together]) / np.abs(self.theta)

    def table(self) -> Table:
        """One row per derivative, with the gusts and the assumptions as notes."""
        single, together = self.percent
        columns = (self.theta, self.single, single, self.together, together)
        gusts = ", ".join(
            f"{name} {low:.3g}" + (f" to {high:.3g}" if high > low else "")
            for name, (low, high) in (("sigma_u", self.sigma_u_m_s), ("sigma_w", self.sigma_w_m_s))
        )
        return flat(
            title=f"Least standard errors to expect of {self.campaign} ({self.aircraft}, {self.pressure} pressure)",
            columns=(
                "parameter",
                "with effects" if self.with_effects else "declared",
                "standard error, one record",
                "percent",
                f"standard error, {counted(self.records, 'record')}",
                "percent of these",
            ),
            rows=[(name, *(float(c[i]) for c in columns)) for i, name in enumerate(PARAMETERS)],
            notes=(
                f"Gusts [m/s]: {gusts}. Kinds of runs evaluated: {self.kinds}.",
                "Cramer-Rao bound with noise levels, gust levels, biases and initial states unknown; "
                "filter-error comes nearest to it (docs/plan.md).",
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
                "parameter": PARAMETERS,
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
            "sigma_u_m_s": list(self.sigma_u_m_s),
            "sigma_w_m_s": list(self.sigma_w_m_s),
            "noise": dict(self.noise),
            "parameters": {str(name): row for name, row in rows.items()},
        }

    def plot(self) -> Figure:
        """Relative standard errors of one record and of all records, as bars on a logarithmic scale [%]."""
        from airtruth import style

        with style.applied():
            figure = style.new_figure(6.6, 3.4)
            ax = figure.subplots()
            at = np.arange(len(PARAMETERS))
            labels = ("one record", f"{counted(self.records, 'record')} together")
            for offset, values, label, colour in zip(
                (-0.2, 0.2), self.percent, labels, (style.BLUE, style.ORANGE), strict=True
            ):
                bars = ax.bar(at + offset, values, width=0.4, label=label, color=colour)
                ax.bar_label(bars, [significant(v, 2) for v in values], fontsize=7.5)
            ax.set_yscale("log")
            ax.margins(y=0.1)  # the numbers above the bars
            ax.set_xticks(at, PARAMETERS)
            ax.grid(axis="x", visible=False)
            ax.set_ylabel("least standard error [%]")
            style.legend_above(figure, [ax], self.table().title)
        return figure

    def __repr__(self) -> str:
        """Return the first lines of the summary."""
        return shortened(self.summary())

    def _repr_html_(self) -> str:
        return as_html(self.table())


def forecast(
    campaign: Path | str | Campaign | Plan,
    records: int | None = None,
    pressure: str = "constant",
    advance: Progress = lambda done, total, failed: None,
) -> ForecastResult:
    """Least standard errors of the derivatives from the runs of a campaign, before they are flown.

    Parameters
    ----------
    campaign : campaign file, or a campaign that was read or planned.
    records : instead of the campaign's number of runs; they are of its kinds, in its proportions.
    pressure : "constant" uses nothing of the airspeed; "measured" makes it an output of the filter.
    advance : called after each kind of run with their number, the number of all, and 0.

    Raises
    ------
    ConfigurationError
        If the campaign cannot be flown as written or moves no elevator, ``pressure`` is not known, or a sensor has no noise.
    AircraftError, StoreError
        If the aircraft or a file cannot be loaded.
    TrimError, FlightError
        If a run cannot be flown.
    """
    if pressure not in PRESSURES:
        raise ConfigurationError(f"plan: pressure = {pressure!r}: {choices(pressure, PRESSURES)}")
    if records is not None:
        require_whole("records", records, 1)
    plan = campaign if isinstance(campaign, Plan) else make(campaign)
    if ELEVATOR not in plan.campaign.moved:
        raise ConfigurationError(
            f"plan: campaign {plan.campaign.name} moves no elevator, so it tells nothing of the six derivatives of the pitch "
            "plane; add a manoeuvre of the elevator, or plan another campaign"
        )
    noise = sensor_noise(plan.sensors, plan.aircraft, pressure)
    further = [name for name in plan.table.columns if name.startswith("amplitude_") and name not in _KIND]
    groups = plan.table.groupby([*_KIND, *further], sort=False, dropna=False)
    kinds = groups.head(1).head(MOST_KINDS)
    counts = groups.size().to_numpy()[: len(kinds)].astype(np.float64)
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
    for run, (at, linear, channels) in zip(runs, flown, strict=True):
        theta.append(linear.plus)
        covariance.append(_bound(plan, run, at, linear.plus, channels, noise))
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
        sigma_u_m_s=(float(kinds["sigma_u_m_s"].min()), float(kinds["sigma_u_m_s"].max())),
        sigma_w_m_s=(float(kinds["sigma_w_m_s"].min()), float(kinds["sigma_w_m_s"].max())),
        with_effects=bool(plan.campaign.effect),
    )


def _bound(
    plan: Plan,
    run: PlannedRun,
    at: Trim,
    theta: Array,
    flown: Mapping[str, Array],
    noise: Mapping[str, float],
) -> Array:
    """The bound (6, 6) of one run of the table, from its trim, derivatives (6,) and flight in calm air."""
    gusts = GustScales(run.sigma_u_m_s, run.sigma_w_m_s, run.length_u_m, run.length_w_m)
    experiment = LinearExperiment(
        plan.aircraft, noise, gusts, at.airspeed_m_s, plan.dt_s * plan.log_every, plan.campaign.gust.start
    )
    return experiment.least_covariance(flown, theta)
