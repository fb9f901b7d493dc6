"""The declared aircraft beside estimates: its derivatives at the condition of the records, and the shifts from them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.charts import Chart, Mark
from airtruth.identification.charts import COLOURS
from airtruth.logs.histories import Histories
from airtruth.physics.atmosphere import altitude_of_density_m
from airtruth.physics.motion import LONGITUDINAL
from airtruth.table import Number, Row, Table, flat
from airtruth.tracing.model.declared import declared_covariance
from airtruth.tracing.model.plant import declared_derivatives
from airtruth.tracing.model.probed import trim_of
from airtruth.tracing.presentation.charts import chart_of_shifts

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]

MODEL: Final = "declared"
"""Name of the declared aircraft among the models."""
_SPREAD: Final = 0.32
"""Half of the height of a row that the methods share [-] (judgement: rows stay apart)."""


@dataclass(frozen=True)
class Declared:
    """Declared derivatives at a flight condition.

    Attributes
    ----------
    values, std : derivative -> declared value and standard deviation, mass, inertia and CG included [1/rad, rates as
        q c/(2V)].
    condition : the condition in words.
    """

    values: Mapping[str, float]
    std: Mapping[str, float]
    condition: str

    def before(self, estimates: pd.DataFrame) -> pd.DataFrame:
        """Estimates after rows of a method "declared" with these derivatives, one for every run."""
        import pandas as pd

        runs = list(dict.fromkeys(estimates["run_id"]))
        own = pd.DataFrame({"run_id": runs, "method": MODEL, "converged": True, **self.values})
        return pd.concat([own, estimates], ignore_index=True)


def declared_at(aircraft: Aircraft, histories: Histories) -> Declared:
    """Derivatives of an aircraft at the mean condition of records: linearised in JSBSim, or as aircraft.toml states them.

    Raises
    ------
    AircraftError, TrimError
        If it has no derivatives, or cannot be trimmed there.
    """
    conditions = [r.conditions for r in histories.records]
    airspeed, density = (
        float(np.mean([c[n] for c in conditions])) for n in ("airspeed_m_s", "density_kg_m3")
    )
    heights = [c["altitude_m"] for c in conditions if "altitude_m" in c]
    altitude = float(np.mean(heights)) if heights else float(altitude_of_density_m(density))
    at = None if aircraft.file.jsbsim is None else trim_of(aircraft, airspeed, density, altitude, 0.0)
    values = declared_derivatives(aircraft, at)
    std = np.sqrt(np.diagonal(declared_covariance(aircraft, values)))
    return Declared(
        dict(zip(LONGITUDINAL.parameters, values.tolist(), strict=True)),
        dict(zip(LONGITUDINAL.parameters, std.tolist(), strict=True)),
        f"{airspeed:.4g} m/s, {density:.4g} kg/m3",
    )


def shifts_chart(declared: Declared, estimates: pd.DataFrame) -> Chart:
    """Shift of each derivative by each method from its declaration, over the declared standard deviation."""
    methods = list(dict.fromkeys(map(str, estimates["method"])))
    offsets = np.linspace(-_SPREAD, _SPREAD, len(methods)) if len(methods) > 1 else np.zeros(1)
    marks = []
    for row, name in enumerate(LONGITUDINAL.parameters):
        for k, method in enumerate(methods):
            value, low, high = (
                (x - declared.values[name]) / declared.std[name] for x in _mean(estimates, method, name)
            )
            colour = COLOURS[k % len(COLOURS)]
            marks.append(Mark(row + float(offsets[k]), value, low, high, label=method, colour=colour))
    return chart_of_shifts(
        LONGITUDINAL.parameters,
        tuple(marks),
        f"Estimate, mean over the converged runs, with the mean interval. Declared at {declared.condition}; its "
        "standard deviation includes mass, inertia and CG.",
    )


def shifts_table(declared: Declared, estimates: pd.DataFrame) -> Table:
    """Declared value, and mean and shift of each method."""
    methods = list(dict.fromkeys(map(str, estimates["method"])))
    rows: list[Row] = []
    for name in LONGITUDINAL.parameters:
        cells = [Number(declared.values[name]), Number(declared.std[name], digits=2)]
        for method in methods:
            value = _mean(estimates, method, name)[0]
            cells += [Number(value), Number((value - declared.values[name]) / declared.std[name], digits=2)]
        rows.append((name, *cells))
    columns = ["derivative", "declared", "declared std"]
    for method in methods:
        columns += [method, f"{method} shift [declared std]"]
    return flat("Shifts of the derivatives [1/rad, rates as q c/(2V)]", columns, rows)


def _mean(estimates: pd.DataFrame, method: str, name: str) -> tuple[float, float, float]:
    """Mean over the converged runs of a method, and the means of the ends of its intervals."""
    own = estimates[(estimates["method"] == method) & estimates["converged"]]
    with np.errstate(over="ignore", invalid="ignore"):
        value, low, high = (float(own[n].mean()) for n in (name, f"{name}_lower", f"{name}_upper"))
    return value, low, high


__all__ = ["MODEL", "Declared", "declared_at", "shifts_chart", "shifts_table"]
