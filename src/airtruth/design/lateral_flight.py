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
    """An input and what it answers.

    Attributes
    ----------
    kind : of both manoeuvres; steps_s : length of a step of each control [s].
    values : of each quantity by which inputs are compared.
    """

    kind: str
    steps_s: tuple[float, float]
    values: tuple[float, ...]


@dataclass(frozen=True)
class LateralFlight:
    """A planned lateral flight; satisfies `airtruth.result.Result`.

    Attributes
    ----------
    aircraft : name.
    campaign : flies the best input in both signs.
    inputs : best first.
    """

    aircraft: str
    campaign: Campaign
    inputs: tuple[LateralInput, ...]

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the values of an input."""
        raise NotImplementedError

    @property
    def purpose(self) -> str:
        """Verb and object of the title, behind "Lateral flight that"."""
        raise NotImplementedError

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks below the table."""
        raise NotImplementedError

    def table(self) -> Table:
        """The inputs with their values, best first."""
        rows: list[Row] = [
            (one.kind, *one.steps_s, *(Number(x, digits=3) for x in one.values)) for one in self.inputs
        ]
        steps = (f"step of the {control.name} [s]" for control in LATERAL.controls)
        return flat(
            f"Lateral flight that {self.purpose} ({self.aircraft})",
            ("manoeuvre", *steps, *self.columns),
            rows,
            (
                *self.notes,
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
                {"kind": i.kind, "steps_s": i.steps_s, **dict(zip(self.columns, i.values, strict=True))}
                for i in self.inputs
            ]
        )

    def to_dict(self) -> dict[str, Any]:
        """Aircraft, campaign and inputs."""
        return {
            "aircraft": self.aircraft,
            "motion": LATERAL.name,
            "campaign": self.campaign.name,
            "records": self.campaign.runs,
            "inputs": self.to_frame().to_dict("records"),
        }

    def plot(self) -> Figure:
        """Values of the inputs over those of the best [-]."""
        from airtruth import style

        with style.applied():
            figure = style.new_figure(6.6, 3.4)
            ax = figure.subplots()
            best = np.array(self.inputs[0].values)
            at = np.arange(len(self.inputs))
            for k, name in enumerate(self.columns):
                ax.plot(at, [one.values[k] / best[k] for one in self.inputs], "o", label=name)
            ax.set_xticks(at, [f"{i.kind}\n{i.steps_s[0]:g}, {i.steps_s[1]:g} s" for i in self.inputs])
            ax.tick_params(axis="x", labelsize=6)
            ax.set_ylabel("relative to the best input [-]")
            style.legend_above(figure, [ax], self.table().title)
        return figure

    def write(self, out: Path) -> None:
        """Write the campaign file.

        Raises
        ------
        StoreError
            If the file cannot be written.
        """
        write_text(
            out, as_toml(self.campaign, f"Lateral flight that {self.purpose}, computed by airtruth plan.")
        )

    def __repr__(self) -> str:
        """Return the first lines of the summary."""
        return shortened(self.summary())

    def _repr_html_(self) -> str:
        return as_html(self.table())


@dataclass(frozen=True, repr=False)
class LateralPlan(LateralFlight):
    """The flight that determines derivatives best; the values of an input are standard errors of one record.

    Attributes
    ----------
    targets : derivatives.
    declared : (targets,) declared values [-].
    """

    targets: tuple[str, ...]
    declared: tuple[float, ...]

    @property
    def columns(self) -> tuple[str, ...]:
        """Standard error of each derivative."""
        return tuple(f"std of {name}" for name in self.targets)

    @property
    def purpose(self) -> str:
        """The derivatives."""
        return f"determines {', '.join(self.targets)}"

    @property
    def notes(self) -> tuple[str, ...]:
        """The origin of the standard errors, and the declared values."""
        declared = ", ".join(f"{n} {v:.4g}" for n, v in zip(self.targets, self.declared, strict=True))
        units = LATERAL.derivative_units
        return (f"Standard errors of one record, Cramer-Rao bound [{units}]; declared: {declared}.",)

    def to_dict(self) -> dict[str, Any]:
        """Aircraft, campaign, inputs, and the declared values."""
        return super().to_dict() | {"declared": dict(zip(self.targets, self.declared, strict=True))}


def every_input() -> Iterator[tuple[str, tuple[float, float]]]:
    """Pattern and length of a step of each control of the inputs that are compared."""
    for kind, first, second in product(PATTERNS, *STEPS_S):
        yield kind, (first, second)


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
    for kind, steps_s in every_input():
        step(f"evaluate {kind} with steps of {steps_s[0]:g} and {steps_s[1]:g} s")
        result = forecast(with_input(base, kind, steps_s, amplitude_rad, 1), records=1, motion=LATERAL.name)
        at = [result.parameters.index(name) for name in question.names]
        found.append((LateralInput(kind, steps_s, tuple(float(result.single[i]) for i in at)), result))
    scale = np.array(found[0][0].values)
    found.sort(key=lambda pair: float(np.mean((np.array(pair[0].values) / scale) ** 2)))
    best, result = found[0]
    declared = tuple(float(result.theta[result.parameters.index(name)]) for name in question.names)
    campaign = with_input(base, best.kind, best.steps_s, amplitude_rad, records or RECORDS)
    return LateralPlan(result.aircraft, campaign, tuple(one for one, _ in found), question.names, declared)


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


__all__ = [
    "RECORDS",
    "LateralFlight",
    "LateralInput",
    "LateralPlan",
    "LateralQuestion",
    "every_input",
    "plan_lateral",
    "with_input",
]
