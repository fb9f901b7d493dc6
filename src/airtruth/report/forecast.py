"""What a campaign can tell before it is flown: Cramer-Rao standard errors of the six derivatives.

Each kind of run is flown once in still air, and the bound of `airtruth.identify.filter_bound` evaluated for
its elevator, its gusts and the sensors' noise, levels and biases unknown. Information adds up over runs.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import ConfigurationError, choices
from airtruth.fly.chunk import Pilot
from airtruth.fly.linearise import linearise
from airtruth.fly.plan import Plan, Row, condition
from airtruth.fly.trim import trim
from airtruth.identify import Table
from airtruth.identify.filter_bound import experiment_bound
from airtruth.identify.filter_options import CHANNELS, PRESSURES, FilterOptions
from airtruth.logs.flight_log import Batch
from airtruth.physics.short_period import PARAMETERS

Array = NDArray[np.float64]

MOST_KINDS: Final = 20
"""Kinds of runs that are evaluated; of a campaign with more, its first runs stand for the rest."""
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


@dataclass(frozen=True)
class Forecast:
    """Standard errors to expect.

    Attributes
    ----------
    campaign, aircraft : names.
    pressure : whether the dynamic pressure is held "constant" or "measured".
    records : number of records that ``together`` is for.
    kinds : kinds of runs that were evaluated.
    theta : (6,) declared derivatives, mean over the kinds [-].
    single, together : (6,) least standard error of one record, and of all of them jointly [-].
    noise : noise of the sensors that are used, channel -> [SI].
    sigma_u_m_s, sigma_w_m_s : (2,) least and largest gusts [m/s].
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


def forecast(plan: Plan, records: int | None = None, pressure: str = "constant") -> Forecast:
    """Least standard errors of the derivatives from the runs of a campaign, before they are flown.

    Parameters
    ----------
    plan : of `airtruth.fly.plan.make`.
    records : in place of the campaign's number of runs; they are of its kinds, in its proportions.
    pressure : "constant" takes nothing from the airspeed; "measured" has it as an output of the filter.

    Raises
    ------
    ConfigurationError
        If ``pressure`` is not known, or a sensor that is needed has no noise.
    TrimError, FlightError
        If a run cannot be flown.
    """
    if pressure not in PRESSURES:
        raise ConfigurationError(f"plan: pressure = {pressure!r}: {choices(pressure, PRESSURES)}")
    noise = _noise(plan, pressure)
    table = plan.table.head(plan.campaign.runs)
    groups = table.groupby(list(_KIND), sort=False)
    kinds = groups.head(1).head(MOST_KINDS)
    counts = groups.size().to_numpy()[: len(kinds)].astype(np.float64)
    pilot = Pilot(replace(plan, sensors={}))
    theta, covariance = [], []
    for raw in kinds.to_dict("records"):
        row = {str(key): value for key, value in raw.items()}
        value, least = _run(plan, pilot, row, noise)
        theta.append(value)
        covariance.append(least)
    share = counts / counts.sum()
    each = np.stack(covariance)
    information = np.tensordot(share, np.linalg.inv(each), axes=1)
    total = records or plan.campaign.runs
    return Forecast(
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
    )


def as_table(made: Forecast) -> Table:
    """The forecast for people."""
    rows = tuple(
        (
            name,
            float(made.theta[i]),
            float(made.single[i]),
            float(100.0 * made.single[i] / abs(made.theta[i])),
            float(made.together[i]),
            float(100.0 * made.together[i] / abs(made.theta[i])),
        )
        for i, name in enumerate(PARAMETERS)
    )
    gusts = ", ".join(
        f"{name} {low:.3g}" + (f" to {high:.3g}" if high > low else "")
        for name, (low, high) in (("sigma_u", made.sigma_u_m_s), ("sigma_w", made.sigma_w_m_s))
    )
    return Table(
        title=f"Least standard errors to expect of {made.campaign} ({made.aircraft}, {made.pressure} pressure)",
        columns=(
            "parameter",
            "declared",
            "std of a record",
            "percent",
            f"std of {made.records} records",
            "percent of these",
        ),
        rows=rows,
        notes=(
            f"Gusts [m/s]: {gusts}. Kinds of runs evaluated: {made.kinds}.",
            "Cramer-Rao bound with noise levels, gust levels, biases and initial states unknown; "
            "filter-error comes nearest to it (docs/plan.md).",
        ),
    )


def as_json(made: Forecast) -> str:
    """The forecast for programs."""
    facts: dict[str, Any] = {
        "campaign": made.campaign,
        "aircraft": made.aircraft,
        "pressure": made.pressure,
        "records": made.records,
        "kinds": made.kinds,
        "sigma_u_m_s": list(made.sigma_u_m_s),
        "sigma_w_m_s": list(made.sigma_w_m_s),
        "noise": dict(made.noise),
        "parameters": {
            name: {
                "declared": float(made.theta[i]),
                "std": float(made.single[i]),
                "percent": float(100.0 * made.single[i] / abs(made.theta[i])),
                "std_together": float(made.together[i]),
                "percent_together": float(100.0 * made.together[i] / abs(made.theta[i])),
            }
            for i, name in enumerate(PARAMETERS)
        },
    }
    return json.dumps(facts, indent=1)


def _noise(plan: Plan, pressure: str) -> dict[str, float]:
    wanted = [c for n, c in CHANNELS.items() if n != "airspeed" or pressure == "measured"]
    found = {c: plan.sensors[c].noise_std.value if c in plan.sensors else 0.0 for c in wanted}
    lacking = [c for c, std in found.items() if std <= 0.0]
    if lacking:
        raise ConfigurationError(
            f"plan: {plan.aircraft.name} states no noise of {', '.join(lacking)}, without which a bound is 0; "
            f"state noise_std in [sensors.{lacking[0]}] of {plan.aircraft.folder / 'aircraft.toml'}, "
            f"or in [sensors.channel.{lacking[0]}] of the campaign"
        )
    return found


def _run(plan: Plan, pilot: Pilot, row: Row, noise: Mapping[str, float]) -> tuple[Array, Array]:
    """Declared derivatives (6,) and the bound (6, 6) of one run of the table."""
    at = trim(plan.aircraft, condition(row), plan.dt_s)
    theta = linearise(plan.aircraft, at, plan.dt_s).plus
    flown = pilot.channels(row | {"sigma_u_m_s": 0.0, "sigma_w_m_s": 0.0})
    channels = {name: np.ascontiguousarray(values[None]) for name, values in flown.items()}
    samples = channels["alpha_rad"].shape[1]
    dt_s = plan.dt_s * plan.log_every
    t_s = dt_s * np.arange(samples, dtype=np.float64)[None]
    options = FilterOptions(
        noise["alpha_rad"],
        noise["q_rad_s"],
        noise["az_m_s2"],
        sigma_u_m_s=float(row["sigma_u_m_s"]),
        sigma_w_m_s=float(row["sigma_w_m_s"]),
        length_u_m=float(row["length_u_m"]),
        length_w_m=float(row["length_w_m"]),
        airspeed_std_m_s=noise.get("airspeed_m_s"),
        airspeed_m_s=at.airspeed_m_s,
    )
    batch = Batch((str(row["run_id"]),), dt_s, t_s, channels)
    least = experiment_bound(batch, plan.aircraft, theta, options, plan.campaign.gust.start)[0]
    return theta, least
