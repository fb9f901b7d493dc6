"""The figures of `make campaign`: one flight, the paper's filters and outputs, and the spread of the estimates."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from airtruth import style
from airtruth.aircraft import Aircraft
from airtruth.channels import PITCH_PLANE
from airtruth.identification import Options, identify_batch, residuals
from airtruth.logs.flight_log import Batch, batches
from airtruth.logs.store import log_paths, read_log
from airtruth.physics import short_period
from airtruth.reporting import read_campaign
from airtruth.reporting.paper import published
from airtruth.simulation import manoeuvres
from airtruth.simulation.campaign import plan
from airtruth.simulation.campaign.chunk import Pilot
from airtruth.simulation.flight import Flight, Inputs
from airtruth.simulation.linearise import linearise
from airtruth.simulation.trim import trim
from studies import paper_distribution as distribution
from studies import paper_figures as figures

Array = NDArray[np.float64]

CAMPAIGN_FILES: Final = Path(__file__).resolve().parents[1] / "data" / "campaigns"
"""Folder of the campaign files."""

PAPER: Final = Options(airspeed_m_s=42.852)
"""Options of the paper: its dynamic pressure is that of the trim at 75 kt EAS and 7000 ft (docs/paper.md)."""

FIGURE_4_S: Final = (1.0, 7.0)
"""Part of the record in the figure of the outputs [s]: the doublet at 2 s and the free response after it."""

FIGURE_4_METHODS: Final = {"ls": "LS", "iv-f1": "IV(f1)"}
"""Method -> heading of its column in the figure of the outputs, as in the paper's Fig. 4."""

SPREAD_METHODS: Final = ("ls", "iv-lowpass", "iv-f1", "iv-f2")
"""Methods in the figure of the estimates' spread."""


def write_figures(campaigns: Path, names: Iterable[str], gtm: Aircraft) -> list[Path]:
    """Draw the figures of flown and identified campaigns and write them to the folder "figures".

    Parameters
    ----------
    campaigns : folder of the campaign folders, among them "moderate" and "light-fit".
    names : campaigns whose estimates are drawn.
    gtm : aircraft of the campaigns.

    Returns
    -------
    The files.

    Raises
    ------
    StoreError
        If a file cannot be read or written.
    """
    folder = campaigns / "figures"
    folder.mkdir(exist_ok=True)
    drawn = {
        "flight.png": flight_figure(campaigns / "moderate", gtm),
        "figure1.png": filter_figure(gtm),
        "figure4.png": output_figure(campaigns / "light-fit", gtm),
        **{f"estimates-{name}.png": spread_figure(campaigns / name) for name in names},
    }
    for name, figure in drawn.items():
        style.save(figure, folder / name)
    return [folder / name for name in drawn]


def flight_figure(moderate: Path, gtm: Aircraft) -> Figure:
    """Draw the first run of the moderate campaign: as logged, without sensor errors, and in calm air."""
    batch = next(batches(read_log(log_paths(moderate)[0])))
    planned = plan.make(CAMPAIGN_FILES / "moderate.toml")
    run = plan.planned_runs(planned.table.head(1))[0]
    noise_free = Pilot(replace(planned, sensors={})).channels(run)
    t = np.arange(planned.samples) * planned.dt_s
    command = run.amplitude_rad * manoeuvres.sample(planned.inputs[run.manoeuvre][0], t)
    at = trim(gtm, run.condition, planned.dt_s)
    calm = Flight(gtm, at, planned.dt_s, planned.log_every).fly(Inputs(command, 0.0 * t, 0.0 * t))
    measured = {name: values[0] for name, values in batch.channels.items()}
    versions = {"measured": measured, "without sensor errors": noise_free, "calm air": calm}
    return figures.flight(
        batch.t_s[0],
        {label: {name: channels[name] for name in PITCH_PLANE} for label, channels in versions.items()},
        "One flight in moderate turbulence",
    )


def filter_figure(gtm: Aircraft) -> Figure:
    """Draw the paper's Fig. 1 for the trim of the light campaign."""
    run = plan.planned_runs(plan.make(CAMPAIGN_FILES / "light.toml").table.head(1))[0]
    linear = linearise(gtm, trim(gtm, run.condition))
    a, b = short_period.system(linear.plus, linear.scale)
    return figures.filters(a, b, "Dynamic filters (the paper's Fig. 1)")


def output_figure(light_fit: Path, gtm: Aircraft) -> Figure:
    """Draw the paper's Fig. 4 from the last run of the last log."""
    batch = next(batches(read_log(log_paths(light_fit)[-1])))
    last = Batch(
        batch.run_ids[-1:], batch.dt_s, batch.t_s[-1:], {n: v[-1:] for n, v in batch.channels.items()}
    )
    t = last.t_s[0, 1:-1]
    shown = (t >= FIGURE_4_S[0]) & (t <= FIGURE_4_S[1])
    fits = {heading: _output_fit(last, gtm, name, shown) for name, heading in FIGURE_4_METHODS.items()}
    return figures.outputs(t[shown], fits, "Outputs (the paper's Fig. 4)")


def _output_fit(batch: Batch, gtm: Aircraft, method: str, shown: NDArray[np.bool_]) -> figures.OutputFit:
    """Low-passed outputs of one run against those of an estimate; its equations are those of LS."""
    estimates = replace(identify_batch(batch, gtm, method, PAPER), method="ls")
    nothing = replace(estimates, theta=np.zeros_like(estimates.theta))
    measured = residuals(batch, gtm, nothing, PAPER)[0]
    error = residuals(batch, gtm, estimates, PAPER)[0]
    bound = 3.0 * error.std(axis=1, keepdims=True)
    return figures.OutputFit(measured[:, shown], (measured - error)[:, shown], bound)


def spread_figure(folder: Path) -> Figure:
    """Draw the spread of the estimates of a campaign beside the published means."""
    campaign = read_campaign(folder)
    printed = published.load().tables
    names = ("table1", "table2") if campaign.name.startswith("light") else ("table3",)
    return distribution.estimates(
        campaign,
        SPREAD_METHODS,
        printed=[printed[name] for name in names],
        title=f"Estimates, campaign {campaign.name}",
    )
