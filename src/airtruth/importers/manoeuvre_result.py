"""The manoeuvres of a flight as a result: a table that a person edits, a summary and a picture."""

from __future__ import annotations

import csv
import io
import math
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from airtruth import style
from airtruth.logs.atomic import write_text
from airtruth.result import shortened
from airtruth.table import MISSING, Cell, Number, Table, flat
from airtruth.units import DEG

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

Array = NDArray[np.float64]


INPUT: Final = "input"
"""Kind of a manoeuvre that the elevator causes."""
FREE: Final = "free response"
"""Kind of a manoeuvre in which the elevator is at rest."""


@dataclass(frozen=True)
class CandidateManoeuvre:
    """A part of a flight that may become a run; the columns of the table.

    Attributes
    ----------
    run_id : name of the run.
    accept : "yes" or "no"; the import takes the rows with yes.
    start_s, end_s : on the clock of the first file [s].
    input_deg : range of the elevator [deg].
    energy_deg2_s : integral of its squared deviation from trim [deg2 s].
    excitation : rms of q over that of the background [-].
    trim_range : range of the elevator before the input over that of the input [-].
    airspeed_m_s, airspeed_change : mean [m/s] and relative range [-]; nan without airspeed.
    load_factor : mean of -az/g [-]; nan without az.
    reason : why it is not accepted.
    kind : "input", or "free response" where the elevator is at rest.
    """

    run_id: str
    accept: str
    start_s: float
    end_s: float
    input_deg: float
    energy_deg2_s: float
    excitation: float
    trim_range: float
    airspeed_m_s: float
    airspeed_change: float
    load_factor: float
    reason: str = ""
    kind: str = INPUT


_LARGEST: Final = 1e4
"""Value from which ten digits may not resolve a microsecond."""


@dataclass(frozen=True)
class ManoeuvreResult:
    """Manoeuvres of a flight, with what their picture shows.

    Attributes
    ----------
    candidates : in the order of time.
    t_s : (samples,) times on the clock of the first file [s].
    elevator_rad, q_rad_s : (samples,) what was searched.
    threshold_rad : deviation of the elevator that counts as an input [rad].
    """

    candidates: tuple[CandidateManoeuvre, ...]
    t_s: Array
    elevator_rad: Array
    q_rad_s: Array
    threshold_rad: float

    @property
    def accepted(self) -> tuple[CandidateManoeuvre, ...]:
        """Candidates that the import would take."""
        return tuple(c for c in self.candidates if c.accept == "yes")

    def table(self) -> str:
        """The candidates as CSV, which `airtruth.importers.read_table` accepts after any edit."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        names = [f.name for f in fields(CandidateManoeuvre)]
        writer.writerow(names)
        for one in self.candidates:
            cells = [getattr(one, name) for name in names]
            writer.writerow([_as_text(c) if isinstance(c, float) else c for c in cells])
        return text.getvalue()

    def summary(self) -> str:
        """The number of candidates, the reasons of those that are not accepted, and the free responses."""
        rejected = [c for c in self.candidates if c.accept != "yes"]
        text = f"{len(self.accepted)} of {len(self.candidates)} manoeuvres accepted"
        text += "".join(f"\n  {c.run_id} not: {c.reason}" for c in rejected)
        return text + "".join(
            f"\n  {c.run_id} is a free response: the elevator stays within {c.input_deg:.2g} deg; it shows the short period, and "
            "no derivative of the elevator"
            for c in self.accepted
            if c.kind == FREE
        )

    def to_frame(self) -> pd.DataFrame:
        """One row per candidate, with the columns of the CSV table."""
        import pandas as pd

        columns = [f.name for f in fields(CandidateManoeuvre)]
        return pd.DataFrame([asdict(c) for c in self.candidates], columns=columns)

    def to_dict(self) -> dict[str, Any]:
        """The candidates and the threshold, in types that JSON has; what was not measured is None."""
        rows = [
            {k: None if isinstance(v, float) and math.isnan(v) else v for k, v in asdict(c).items()}
            for c in self.candidates
        ]
        return {"candidates": rows, "threshold_deg": self.threshold_rad / DEG}

    def plot(self) -> Figure:
        """Elevator and pitch rate over the flight, accepted manoeuvres green and others grey."""
        from airtruth.importers.figure import draw

        return draw(self)

    def write(self, path: Path) -> None:
        """Write the table as CSV and the picture beside it, with the suffix .png."""
        write_text(path, self.table())
        style.save(self.plot(), path.with_suffix(".png"))

    def __repr__(self) -> str:
        """Return the first lines of the summary."""
        return shortened(self.summary())

    def _repr_html_(self) -> str:
        rows = [tuple(map(_cell, asdict(c).values())) for c in self.candidates]
        columns = tuple(f.name for f in fields(CandidateManoeuvre))
        shown: Table = flat(self.summary().partition("\n")[0], columns, rows)
        return shown._repr_html_()


def _as_text(value: float) -> str:
    """Ten digits, and microseconds of a time since 1970."""
    return f"{value:.10g}" if abs(value) < _LARGEST else f"{value:.6f}"


def _cell(value: str | float) -> Cell:
    if isinstance(value, str):
        return value
    return MISSING if math.isnan(value) else Number(value, digits=4)


__all__ = ["FREE", "INPUT", "CandidateManoeuvre", "ManoeuvreResult"]
