"""The planned flight that determines derivatives or narrows bands: the input, the standard errors to expect, the campaign."""

from __future__ import annotations

import textwrap
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from airtruth.design.planned_campaign import PlannedCampaign, draw_input
from airtruth.physics.motion import LONGITUDINAL
from airtruth.result import shortened
from airtruth.table import Table, as_html, as_text, flat
from airtruth.table.model import Number, Row, significant
from airtruth.tracing.answer import Z95
from airtruth.units import DEG

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ForecastQuantity:
    """A derivative, or a point of a learned increment.

    Attributes
    ----------
    target : name of the derivative, or variant of the increment.
    at : where [unit of its signal]; None for a derivative or a share.
    value : declared derivative, or what the trace learned [-].
    known : its standard deviation before the flight [-].
    expected, reference : with the planned flight, and with the 3-2-1-1 of equal length and limits [-].
    bias, reference_bias : of a derivative the error that the linear model of filter error has in either flight, which more
        records do not reduce; nan where there is none [-].
    """

    target: str
    at: float | None
    value: float
    known: float
    expected: float
    reference: float
    bias: float = float("nan")
    reference_bias: float = float("nan")


@dataclass(frozen=True)
class NarrowRow:
    """An input with its standard errors.

    Attributes
    ----------
    family, shape : name of its family, and its segments or its spectrum in words.
    amplitude_rad : peak of the elevator command about the trim [rad].
    std : (targets,) expected standard error; of an increment the root mean square over its points [-].
    merit : smallest ratio of a known to an expected standard error [-].
    """

    family: str
    shape: str
    amplitude_rad: float
    std: tuple[float, ...]
    merit: float


@dataclass(frozen=True)
class BandHistories:
    """The planned flight in calm air.

    Attributes
    ----------
    t_s : (samples,) [s].
    elevator_rad, reference_rad : (samples,) surface about its trim, of the input and of the 3-2-1-1 [rad].
    alpha_rad : (samples,) angle of attack with the input [rad].
    """

    t_s: Array
    elevator_rad: Array
    reference_rad: Array
    alpha_rad: Array


@dataclass(frozen=True, kw_only=True)
class NarrowResult(PlannedCampaign):
    """A planned flight that determines quantities; satisfies `airtruth.result.Result`.

    Attributes
    ----------
    targets : derivatives, or variants of learned increments.
    known : (targets,) standard deviation before the flight, of an increment the root mean square over its points [-].
    quantities : the derivatives, or the points of the increments.
    rows : the best input of each family, best first, then the 3-2-1-1 of equal length and limits, ``reference``.
    histories : the flight.
    """

    targets: tuple[str, ...]
    known: tuple[float, ...]
    quantities: tuple[ForecastQuantity, ...]
    rows: tuple[NarrowRow, ...]
    reference: NarrowRow
    histories: BandHistories

    @property
    def best(self) -> NarrowRow:
        """The input that is flown."""
        return max(self.rows, key=lambda row: row.merit)

    @property
    def ratio(self) -> float:
        """Standard error by the 3-2-1-1 of equal length and limits over the expected one, of the target that gains least
        [-]."""
        return min(r / s for r, s in zip(self.reference.std, self.best.std, strict=True))

    def table(self) -> Table:
        """One row per family, best first."""
        rows: list[Row] = [
            (
                row.family,
                row.shape,
                Number(row.amplitude_rad / DEG, digits=3),
                *(Number(std, digits=3) for std in row.std),
                *(Number(std / known, digits=3) for std, known in zip(row.std, self.known, strict=True)),
            )
            for row in self.rows
        ]
        return flat(
            title=f"Inputs that determine {', '.join(self.targets)} ({self.aircraft})",
            columns=(
                "input",
                "shape",
                "peak [deg]",
                *(f"std, {t}" for t in self.targets),
                *(f"over known, {t}" for t in self.targets),
            ),
            rows=rows,
            notes=self._notes(),
        )

    def quantity_table(self) -> Table:
        """One row per derivative, or per point of an increment."""
        has_bias = any(np.isfinite(q.bias) for q in self.quantities)
        rows: list[Row] = []
        for q in self.quantities:
            figures = [q.known, q.expected, q.reference, *([q.bias, q.reference_bias] if has_bias else [])]
            name = q.target if q.at is None else f"{q.target} = {significant(q.at)}"
            rows.append((name, q.value, *(Number(x, digits=3) for x in figures)))
        return flat(
            title="Standard errors before and with the planned flight",
            columns=(
                *("quantity", "value", "std before", "planned", "3-2-1-1"),
                *(("bias, planned", "bias, 3-2-1-1") if has_bias else ()),
            ),
            rows=rows,
            notes=(
                "The bias is the error that filter error's linear model has in the flight without noise and gusts. More "
                "records do not reduce it.",
            )
            if has_bias
            else (),
        )

    def _notes(self) -> tuple[str, ...]:
        at, alpha = self.condition, self.histories.alpha_rad / DEG
        gain = (
            ""
            if self.ratio == 1.0
            else f"; the 3-2-1-1 has {significant(self.ratio)} times this standard error"
        )
        expected = ", ".join(
            f"{significant(std)} for {target} (now {significant(known)})"
            for target, std, known in zip(self.targets, self.best.std, self.known, strict=True)
        )
        return (
            f"Expected standard error of {self.campaign.runs} records: {expected}{gain}.",
            f"At {at.eas_m_s:.4g} m/s EAS, {at.altitude_m:.4g} m, in vertical gusts of {significant(self.gust_m_s)} m/s; "
            "mean over draws of the derivatives. Other derivatives, biases and initial state are free.",
            f"Reached in calm air, as declared and with the changes allowed for: {self.reached.beside(self.limits)}. "
            f"The declared aircraft flies angles of attack of {alpha.min():.3g} to {alpha.max():.3g} deg.",
        )

    def summary(self) -> str:
        """The tables as text."""
        return as_text(self.table()) + "\n" + as_text(self.quantity_table())

    def to_frame(self) -> pd.DataFrame:
        """One row per input: family, shape, amplitude_rad, std_TARGET for each target, merit."""
        import pandas as pd

        return pd.DataFrame([self._row(row) for row in self.rows])

    def _row(self, row: NarrowRow) -> dict[str, Any]:
        std = {f"std_{t}": s for t, s in zip(self.targets, row.std, strict=True)}
        return {
            "family": row.family,
            "shape": row.shape,
            "amplitude_rad": row.amplitude_rad,
            **std,
            "merit": row.merit,
        }

    def to_dict(self) -> dict[str, Any]:
        """Quantities with their standard errors, limits, what is reached, and the rows of `to_frame`."""
        return {
            **self._flight_dict(),
            "targets": list(self.targets),
            "expected_std": dict(zip(self.targets, self.best.std, strict=True)),
            "reference_std": dict(zip(self.targets, self.reference.std, strict=True)),
            "known_std": dict(zip(self.targets, self.known, strict=True)),
            "quantities": [_without_nan(asdict(q)) for q in self.quantities],
            "inputs": [self._row(row) for row in self.rows],
        }

    def plot(self) -> Figure:
        """The elevator beside that of the 3-2-1-1, the angle of attack, and the standard errors before and with the flight."""
        from airtruth import style

        p = self.histories
        with style.applied():
            figure, axes = style.panels(
                2 + len(self.targets), 1, width_in=6.5, height_in=4.0 + 2.0 * len(self.targets)
            )
            middle = axes[1, 0]
            draw_input(axes[0, 0], p.t_s, p.reference_rad, p.elevator_rad, self.best.family)
            middle.plot(p.t_s, p.alpha_rad / DEG, color=style.BLUE)
            middle.set_ylabel("alpha [deg]")
            middle.set_xlabel("time [s]")
            middle.sharex(axes[0, 0])
            for k, target in enumerate(self.targets):
                self._draw(axes[2 + k, 0], target)
            style.legend_above(figure, axes.ravel(), textwrap.fill(self._notes()[0], 70), columns=3)
        return figure

    def _draw(self, ax: Axes, target: str) -> None:
        """Estimate and 95 % intervals of a target: known, with the 3-2-1-1, with the planned flight."""
        from airtruth import style

        own = [q for q in self.quantities if q.target == target]
        value = np.array([q.value for q in own])
        kinds = (
            ("known", "^", style.GREY, np.array([q.known for q in own])),
            ("with the 3-2-1-1", "s", style.ORANGE, np.array([q.reference for q in own])),
            ("expected", "o", style.BLUE, np.array([q.expected for q in own])),
        )
        at = [q.at for q in own if q.at is not None]
        is_curve = len(at) == len(own) and bool(at)
        step = 0.08 * float(np.ptp(at)) / max(len(at) - 1, 1) if is_curve else 1.0
        for k, (label, marker, colour, std) in enumerate(kinds):
            x = np.array(at) + (k - 1) * step if is_curve else np.full(len(own), float(k))
            ax.errorbar(x, value, Z95 * std, fmt=marker, markersize=4, color=colour, capsize=2, label=label)
        if is_curve:
            ax.set_xlabel(target)
            ax.set_ylabel("increment, 95 %")
        else:
            ax.set_xticks(range(len(kinds)), [label for label, *_ in kinds])
            ax.set_xlim(-0.5, len(kinds) - 0.5)
            ax.set_ylabel(f"{target} [{LONGITUDINAL.units.get(target, '-')}], 95 %")

    def __repr__(self) -> str:
        """Return the first lines of the summary."""
        return shortened(self.summary())

    def _repr_html_(self) -> str:
        return as_html(self.table()) + as_html(self.quantity_table())


def _without_nan(row: dict[str, Any]) -> dict[str, Any]:
    """A row with None for every nan."""
    return {key: None if isinstance(x, float) and not np.isfinite(x) else x for key, x in row.items()}


__all__ = ["BandHistories", "ForecastQuantity", "NarrowResult", "NarrowRow"]
