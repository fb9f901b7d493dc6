"""The planned flight: the input, the separation to expect, and the campaign that flies it."""

from __future__ import annotations

import math
import textwrap
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from airtruth.channels import shown
from airtruth.design.planned_campaign import PlannedCampaign, draw_input
from airtruth.design.separation import Member
from airtruth.result import shortened
from airtruth.table import Table, as_html, as_text, flat
from airtruth.table.model import Number, Row, significant
from airtruth.tracing.criterion import CRITERION
from airtruth.tracing.model.compile import CHANNELS
from airtruth.units import DEG

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

_TIE: Final = -2.0 * math.log(CRITERION.level)
"""Difference in 2 log L up to which two hypotheses explain the records equally well [-]."""


@dataclass(frozen=True)
class InputRow:
    """An input with its separations.

    Attributes
    ----------
    family, shape : name of its family, and its segments or its spectrum in words.
    amplitude_rad : peak of the elevator command about the trim [rad].
    sigma : (hypotheses,) separation of each, where it is true, from the nearest other [standard deviations].
    load_factor : lowest and highest normal load factor, as declared and with each hypothesis [-].
    """

    family: str
    amplitude_rad: float
    shape: str
    sigma: tuple[float, ...]
    load_factor: tuple[float, float]

    @property
    def least(self) -> float:
        """Separation whichever hypothesis is true."""
        return min(self.sigma)


@dataclass(frozen=True)
class Prediction:
    """The planned flight as predicted, in calm air.

    Attributes
    ----------
    t_s : (samples,) [s].
    elevator_rad, reference_rad : (samples,) surface about its trim, of the input and of the 3-2-1-1 [rad].
    difference : (samples, 3) alpha [rad], q [rad/s], az [m/s2] under the first hypothesis less those under the nearest
        other, at the size that fits best.
    noise : (3,) standard deviation of the noise of a sample [same units].
    """

    t_s: Array
    elevator_rad: Array
    reference_rad: Array
    difference: Array
    noise: Array


def split_probability(sigma: float) -> float:
    """Probability that the true hypothesis leads by more than a tie in 2 log L [-].

    The difference in 2 log L of two hypotheses at a separation d is normal with mean d^2 and standard deviation 2 d (as
    of two simple hypotheses with normal errors).

    Examples
    --------
    >>> round(split_probability(6.0**0.5), 2)
    0.5
    """
    return float(ndtr((sigma**2 - _TIE) / (2.0 * sigma))) if sigma > 0.0 else 0.0


@dataclass(frozen=True, kw_only=True)
class SplitResult(PlannedCampaign):
    """A planned flight that separates effects; satisfies `airtruth.result.Result`.

    Attributes
    ----------
    hypotheses : the effects at the sizes that are planned for.
    fitted : records that count: those that a trace does not hold out.
    rows : the best input of each family, best first, then the 3-2-1-1 of equal length and limits, ``reference``.
    prediction : time histories.
    """

    hypotheses: tuple[Member, ...]
    fitted: int
    rows: tuple[InputRow, ...]
    reference: InputRow
    prediction: Prediction

    @property
    def best(self) -> InputRow:
        """The input that is flown."""
        return max(self.rows, key=lambda row: row.least)

    @property
    def ratio(self) -> float:
        """Separation over that of the 3-2-1-1 of equal length and limits [-]."""
        return self.best.least / self.reference.least if self.reference.least > 0.0 else float("inf")

    def table(self) -> Table:
        """One row per family, best first."""
        keys = [m.effect.key for m in self.hypotheses]
        rows: list[Row] = [
            (
                row.family,
                row.shape,
                Number(row.amplitude_rad / DEG, digits=3),
                *(Number(s, digits=3) for s in row.sigma),
                Number(row.least / self.reference.least if self.reference.least else np.nan, digits=3),
            )
            for row in self.rows
        ]
        return flat(
            title=f"Inputs that separate {', '.join(keys)} ({self.aircraft})",
            columns=("input", "shape", "peak [deg]", *(f"sigma, {key} true" for key in keys), "over 3-2-1-1"),
            rows=rows,
            notes=self._notes(),
        )

    def _notes(self) -> tuple[str, ...]:
        at = self.condition
        sizes = "; ".join(
            f"{m.effect.key} " + ", ".join(f"{k} = {significant(v)}" for k, v in m.values.items())
            for m in self.hypotheses
        )
        return (
            f"The input separates by {significant(self.best.least)} standard deviations or more, "
            f"{significant(self.ratio)} times the 3-2-1-1 of equal length and limits; a trace then has one name with a "
            f"probability of {significant(split_probability(self.best.least), 2)}.",
            f"Sizes: {sizes}.",
            f"Separation of {self.fitted} fitted of {self.campaign.runs} records at {at.eas_m_s:.4g} m/s EAS, "
            f"{at.altitude_m:.4g} m, in vertical gusts of {significant(self.gust_m_s)} m/s; mean over draws of sizes and "
            "derivatives.",
            f"Reached in calm air, as declared and with each effect: {self.reached.beside(self.limits)}.",
        )

    def summary(self) -> str:
        """The table as text."""
        return as_text(self.table())

    def to_frame(self) -> pd.DataFrame:
        """One row per input: family, shape, amplitude_rad, sigma_KEY for each hypothesis, least, over_reference."""
        import pandas as pd

        return pd.DataFrame([self._row(row) for row in self.rows])

    def _row(self, row: InputRow) -> dict[str, Any]:
        sigma = {f"sigma_{m.effect.key}": s for m, s in zip(self.hypotheses, row.sigma, strict=True)}
        share = row.least / self.reference.least if self.reference.least > 0.0 else None
        return {
            "family": row.family,
            "shape": row.shape,
            "amplitude_rad": row.amplitude_rad,
            **sigma,
            "least": row.least,
            "over_reference": share,
        }

    def to_dict(self) -> dict[str, Any]:
        """Hypotheses with their sizes, limits, what is reached, and the rows of `to_frame`."""
        return {
            **self._flight_dict(),
            "hypotheses": [{"name": m.effect.key, "parameters": m.values} for m in self.hypotheses],
            "separation_sigma": self.best.least,
            "reference_sigma": self.reference.least,
            "probability_of_one_name": split_probability(self.best.least),
            "fitted": self.fitted,
            "inputs": [self._row(row) for row in self.rows],
        }

    def plot(self) -> Figure:
        """The elevator beside that of the 3-2-1-1, and the predicted differences over the noise of a sample."""
        from airtruth import style

        p = self.prediction
        with style.applied():
            figure, axes = style.panels(4, 1, width_in=6.5, height_in=7.2, sharex=True)
            draw_input(axes[0, 0], p.t_s, p.reference_rad, p.elevator_rad, self.best.family)
            for k, (label, scale) in enumerate(map(shown, CHANNELS)):
                ax = axes[k + 1, 0]
                ax.axhspan(
                    -scale * p.noise[k], scale * p.noise[k], color="#EEEEEE", label="noise of a sample"
                )
                ax.plot(
                    p.t_s,
                    scale * p.difference[:, k],
                    color=style.VERMILLION,
                    label="difference of the outputs",
                )
                ax.set_ylabel(label)
            axes[-1, 0].set_xlabel("time [s]")
            names = ", ".join(m.effect.key for m in self.hypotheses)
            style.legend_above(
                figure,
                axes.ravel(),
                textwrap.fill(
                    f"{names}: separated by {significant(self.best.least)} standard deviations or more", 70
                ),
                columns=2,
            )
        return figure

    def __repr__(self) -> str:
        """Return the first lines of the summary."""
        return shortened(self.summary())

    def _repr_html_(self) -> str:
        return as_html(self.table())


__all__ = ["InputRow", "Prediction", "SplitResult", "split_probability"]
