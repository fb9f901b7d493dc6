"""The result of flying a campaign."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from airtruth.channels import SIGNALS
from airtruth.errors import LogError, choices, counted
from airtruth.logs.names import chunk_file
from airtruth.physics.motion import LATERAL, LONGITUDINAL, MOTIONS
from airtruth.physics.terms import ELEVATOR
from airtruth.result import shortened
from airtruth.simulation.campaign.chunk import FAILED, INTERRUPTED, OK, Outcome
from airtruth.simulation.campaign.plan import Plan

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

PLOTTED: Final = {
    motion.name: {c.channel: c.name for c in motion.controls} | {y.channel: y.name for y in motion.outputs}
    for motion in MOTIONS.values()
}
"""Motion -> channels, with their labels, that `CampaignResult.plot` shows: its inputs and its measured outputs."""
SHOWN_REASONS: Final = 5
"""Reasons of failure that a summary lists (judgement: it stays on one screen); `to_frame` has them all."""


@dataclass(frozen=True)
class CampaignResult:
    """A flown campaign.

    Attributes
    ----------
    folder : its folder: logs/, plan.parquet, truth.parquet, manifest.jsonl, campaign.json.
    plan : the campaign with its table of runs.
    unflown : runs without a log, in the order of ``plan.table``: failed or interrupted, with the reasons.
    flown_now : number of runs that this call flew; the others were in the folder already.
    repaired : a sentence for each file that was damaged or missing, and that this call wrote again.
    """

    folder: Path
    plan: Plan
    unflown: tuple[Outcome, ...]
    flown_now: int
    repaired: tuple[str, ...] = ()

    @property
    def runs(self) -> int:
        """Number of runs."""
        return len(self.plan.table)

    @property
    def outcomes(self) -> tuple[Outcome, ...]:
        """End of each run, in the order of ``plan.table``."""
        unflown = {outcome.run_id: outcome for outcome in self.unflown}
        return tuple(unflown.get(run_id) or Outcome(run_id, OK) for run_id in self.plan.table["run_id"])

    @property
    def failures(self) -> tuple[Outcome, ...]:
        """Runs that failed by themselves, with their reasons."""
        return tuple(outcome for outcome in self.unflown if outcome.status == FAILED)

    @property
    def interrupted(self) -> tuple[Outcome, ...]:
        """Runs whose process was killed, with the reasons; the same call flies them again."""
        return tuple(outcome for outcome in self.unflown if outcome.status == INTERRUPTED)

    def summary(self) -> str:
        """Numbers of runs, and the most frequent reasons of failure."""
        failures, interrupted = self.failures, self.interrupted
        numbers = f"{self.flown_now} flown now, {len(failures)} failed"
        if interrupted:
            numbers += f", {len(interrupted)} interrupted"
        lines = [f"{counted(self.runs, 'run')} in {self.folder} ({numbers})"]
        reasons = Counter(outcome.reason for outcome in failures).most_common(SHOWN_REASONS)
        return "\n".join([*lines, *(f"{count} failed: {reason}" for reason, count in reasons)])

    def to_frame(self) -> pd.DataFrame:
        """One row per run: the columns of `airtruth.simulation.campaign.plan.Plan.table`, status and reason."""
        outcomes = self.outcomes
        return self.plan.table.assign(
            status=[outcome.status for outcome in outcomes], reason=[outcome.reason for outcome in outcomes]
        )

    def to_dict(self) -> dict[str, Any]:
        """Facts of the campaign and its failures, in types that JSON has."""
        return {
            "folder": str(self.folder),
            "campaign": self.plan.campaign.name,
            "aircraft": self.plan.aircraft.name,
            "seed": self.plan.seed,
            "runs": self.runs,
            "flown_now": self.flown_now,
            "failures": [{"run_id": f.run_id, "reason": f.reason} for f in self.failures],
            "interrupted": [{"run_id": f.run_id, "reason": f.reason} for f in self.interrupted],
            "repaired": list(self.repaired),
        }

    def plot(self, run_id: str | None = None) -> Figure:
        """Time histories of one run, as logged: of each motion whose controls the campaign moves.

        Parameters
        ----------
        run_id : run to show; None for the first that was flown.

        Raises
        ------
        LogError
            If the run was not flown.
        StoreError
            If its log cannot be read.
        """
        from airtruth import style
        from airtruth.logs.store import read_log

        flown = {o.run_id: k for k, o in enumerate(self.outcomes) if o.status == "ok"}
        shown = next(iter(flown), "") if run_id is None else run_id
        if shown not in flown:
            raise LogError(f"{self.folder}: run {shown!r} was not flown; {choices(shown, flown)}")
        chunk = int(self.plan.table["chunk"].iloc[flown[shown]])
        campaign = self.plan.campaign
        plotted = PLOTTED[LONGITUDINAL.name] if ELEVATOR in campaign.moved or not campaign.lateral else {}
        plotted = plotted | (PLOTTED[LATERAL.name] if campaign.lateral else {})
        log = read_log(self.folder / "logs" / chunk_file(chunk), run_ids=[shown], columns=list(plotted))
        rows = math.ceil(len(plotted) / 2)
        with style.applied():
            figure = style.new_figure(7.0, 5.0 if rows == 2 else 1.9 * rows)
            axes = np.asarray(figure.subplots(rows, 2, sharex=True)).ravel()
            for ax in axes[len(plotted) :]:
                ax.set_axis_off()
            for ax, (channel, label) in zip(axes, plotted.items(), strict=False):
                ax.plot(log.t_s, log.channels[channel], color=style.BLUE)
                ax.set_ylabel(f"{label} [{SIGNALS[channel].unit}]")
            for ax in axes[-2:]:
                ax.set_xlabel("time [s]")
            figure.suptitle(f"{self.plan.campaign.name}: run {shown}")
        return figure

    def __repr__(self) -> str:
        """Return the first lines of the summary."""
        return shortened(self.summary())

    def _repr_html_(self) -> str:
        from html import escape

        return f"<pre>{escape(self.summary())}</pre>\n{self.to_frame().to_html(max_rows=10)}"
