"""The lateral flight that determines derivatives best: steps of ailerons and rudder of several patterns and lengths.

Each input is flown in calm air by the declared aircraft, and the Cramer-Rao bound of its record gives the standard errors
(`airtruth.design.bound`). The input with the smallest mean variance over the targets, each relative to that of the first input,
is written as a campaign in both signs.

Source: V. Klein and E. A. Morelli, Aircraft System Identification (2006), section 9.2 (multisteps on several controls in turn).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from airtruth.design.bound import ForecastResult, forecast
from airtruth.errors import ConfigurationError, choices
from airtruth.logs.atomic import write_text
from airtruth.physics.motion import LATERAL
from airtruth.result import shortened
from airtruth.simulation.campaign.file import Campaign
from airtruth.simulation.campaign.manoeuvre_table import ManoeuvreTable
from airtruth.simulation.campaign.write import as_toml
from airtruth.table import Number, Row, Table, as_html, as_text, flat
from airtruth.units import DEG

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

PATTERNS: Final = {"121": 4.0, "3211": 7.0}
"""Kind of a manoeuvre -> its length in steps [-]."""
STEPS_S: Final = ((0.25, 0.4, 0.6), (0.2, 0.3, 0.45))
"""Lengths of a step of the first and of the second control [s] (judgement: about the roll mode and the Dutch roll of a model
aircraft, half and one and a half times as long)."""
_START_S: Final = 1.0
"""Start of the first manoeuvre, and pause between two [s] (judgement: the record shows the trim)."""
_TAIL_S: Final = 3.0
"""Record behind the last step [s] (judgement: half a minute of no spiral, and three periods of the Dutch roll)."""
RECORDS: Final = 6
"""Records of the campaign by default [-] (judgement: as many as a trace recommends)."""


@dataclass(frozen=True)
class LateralQuestion:
    """Derivatives of the lateral-directional motion that a flight has to determine.

    Attributes
    ----------
    names : of the derivatives.
    """

    names: tuple[str, ...]

    def __post_init__(self) -> None:
        """Refuse names that are none.

        Raises
        ------
        ConfigurationError
            Naming the first one and the allowed names.
        """
        for name in self.names:
            if name not in LATERAL.parameters:
                raise ConfigurationError(f"plan: derivative {name!r}: {choices(name, LATERAL.parameters)}")


@dataclass(frozen=True)
class LateralInput:
    """An input and what it determines.

    Attributes
    ----------
    kind : of both manoeuvres; steps_s : length of a step of each control [s].
    std : (targets,) standard errors of one record [-].
    """

    kind: str
    steps_s: tuple[float, float]
    std: tuple[float, ...]


@dataclass(frozen=True)
class LateralPlan:
    """The planned flight; satisfies `airtruth.result.Result`.

    Attributes
    ----------
    aircraft : name.
    targets : derivatives.
    declared : (targets,) declared values [-].
    campaign : flies the best input in both signs.
    inputs : best first.
    """

    aircraft: str
    targets: tuple[str, ...]
    declared: tuple[float, ...]
    campaign: Campaign
    inputs: tuple[LateralInput, ...]

    def table(self) -> Table:
        """The inputs with the standard errors of one record, best first."""
        rows: list[Row] = [
            (one.kind, *one.steps_s, *(Number(x, digits=3) for x in one.std)) for one in self.inputs
        ]
        steps = (f"step of the {control.name} [s]" for control in LATERAL.controls)
        return flat(
            f"Lateral flight that determines {', '.join(self.targets)} ({self.aircraft})",
            ("manoeuvre", *steps, *(f"std of {name}" for name in self.targets)),
            rows,
            (
                f"Standard errors of one record, Cramer-Rao bound [{LATERAL.derivative_units}]; declared: "
                + ", ".join(f"{n} {v:.4g}" for n, v in zip(self.targets, self.declared, strict=True))
                + ".",
                "The amplitude is as stated; limits of the motion are not searched for, so compare the flown sideslip with what "
                "the aircraft may do.",
            ),
        )

    def summary(self) -> str:
        """The table as text."""
        return as_text(self.table()).rstrip("\n")

    def to_frame(self) -> pd.DataFrame:
        """One row per input."""
        import pandas as pd

        return pd.DataFrame(
            [
                {"kind": i.kind, "steps_s": i.steps_s, **dict(zip(self.targets, i.std, strict=True))}
                for i in self.inputs
            ]
        )

    def to_dict(self) -> dict[str, Any]:
        """Aircraft, campaign, targets and inputs."""
        return {
            "aircraft": self.aircraft,
            "motion": LATERAL.name,
            "campaign": self.campaign.name,
            "records": self.campaign.runs,
            "declared": dict(zip(self.targets, self.declared, strict=True)),
            "inputs": self.to_frame().to_dict("records"),
        }

    def plot(self) -> Figure:
        """Standard errors of the inputs over those of the best [-]."""
        from airtruth import style

        with style.applied():
            figure = style.new_figure(6.6, 3.4)
            ax = figure.subplots()
            best = np.array(self.inputs[0].std)
            at = np.arange(len(self.inputs))
            for k, name in enumerate(self.targets):
                ax.plot(at, [one.std[k] / best[k] for one in self.inputs], "o", label=name)
            ax.set_xticks(at, [f"{i.kind}\n{i.steps_s[0]:g}, {i.steps_s[1]:g} s" for i in self.inputs])
            ax.tick_params(axis="x", labelsize=6)
            ax.set_ylabel("standard error over the best input [-]")
            style.legend_above(figure, [ax], self.table().title)
        return figure

    def write(self, out: Path) -> None:
        """Write the campaign file.

        Raises
        ------
        StoreError
            If the file cannot be written.
        """
        note = f"Lateral flight that determines {', '.join(self.targets)}, computed by airtruth plan."
        write_text(out, as_toml(self.campaign, note))

    def __repr__(self) -> str:
        """Return the first lines of the summary."""
        return shortened(self.summary())

    def _repr_html_(self) -> str:
        return as_html(self.table())


def plan_lateral(
    base: Campaign,
    question: LateralQuestion,
    amplitude_rad: float,
    records: int | None = None,
    step: Callable[[str], None] = lambda text: None,
) -> LateralPlan:
    """Compare the inputs, and return the campaign of the best.

    Parameters
    ----------
    base : aircraft, condition, gusts and sensors; its manoeuvres are replaced.
    question : derivatives to determine.
    amplitude_rad : of both controls [rad].
    records : of the campaign; None for `RECORDS`.
    step : receives each step.

    Raises
    ------
    ConfigurationError, AircraftError, TrimError, FlightError
        As `airtruth.design.bound.forecast`.
    """
    found: list[tuple[LateralInput, ForecastResult]] = []
    for kind, first, second in product(PATTERNS, *STEPS_S):
        step(f"evaluate {kind} with steps of {first:g} and {second:g} s")
        result = forecast(
            with_input(base, kind, (first, second), amplitude_rad, 1), records=1, motion=LATERAL.name
        )
        at = [result.parameters.index(name) for name in question.names]
        found.append(
            (LateralInput(kind, (first, second), tuple(float(result.single[i]) for i in at)), result)
        )
    scale = np.array(found[0][0].std)
    found.sort(key=lambda pair: float(np.mean((np.array(pair[0].std) / scale) ** 2)))
    best, result = found[0]
    declared = tuple(float(result.theta[result.parameters.index(name)]) for name in question.names)
    campaign = with_input(base, best.kind, best.steps_s, amplitude_rad, records or RECORDS)
    return LateralPlan(result.aircraft, question.names, declared, campaign, tuple(one for one, _ in found))


def with_input(
    base: Campaign, kind: str, steps_s: tuple[float, float], amplitude_rad: float, records: int
) -> Campaign:
    """The campaign with one input in both signs: the first control, then the second.

    Parameters
    ----------
    kind : of both manoeuvres, one of `PATTERNS`.
    steps_s : length of a step of each control [s].
    amplitude_rad : of both [rad].
    records : runs of the campaign.
    """
    end = _START_S + PATTERNS[kind] * sum(steps_s) + _START_S + _TAIL_S
    samples = math.ceil(end * base.log_hz - 1e-9)
    tables = (_manoeuvre(kind, steps_s, sign * amplitude_rad) for sign in (1.0, -1.0))
    return base.model_copy(
        update={
            "title": f"Lateral flight: {kind} of ailerons and rudder",
            "runs": records,
            "duration": round(samples / base.log_hz, 9),
            "manoeuvre": tuple(ManoeuvreTable.model_validate(own) for own in tables),
            "effect": (),
        }
    )


def _manoeuvre(kind: str, steps_s: tuple[float, float], amplitude_rad: float) -> dict[str, Any]:
    first, second = (dict(own) for own in _controls(kind, steps_s, amplitude_rad))
    return {**first, "also": [second]}


def _controls(kind: str, steps_s: tuple[float, float], amplitude_rad: float) -> Iterator[dict[str, Any]]:
    start = _START_S
    for control, step_s in zip(LATERAL.controls, steps_s, strict=True):
        yield {
            "control": control.name,
            "kind": kind,
            "amplitude_deg": round(amplitude_rad / DEG, 6),
            "start_s": round(start, 6),
            "step_s": step_s,
        }
        start += PATTERNS[kind] * step_s + _START_S


__all__ = ["RECORDS", "LateralInput", "LateralPlan", "LateralQuestion", "plan_lateral", "with_input"]
