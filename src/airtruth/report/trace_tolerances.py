"""Free runs of a trace against the tolerances of a training simulator, laid out once for every format."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

from airtruth.report.layout import Grid, Group, Row
from airtruth.report.trace_table import SETS, STAGES, figures
from airtruth.units import DEG, G0

Answer = Mapping[str, Any]

_QUANTITIES: Final = (
    ("pitch_rad", "pitch [deg]", DEG),
    ("q_rad_s", "q [deg/s]", DEG),
    ("az_m_s2", "az [g]", G0),
)


def tolerance_grid(answer: Answer) -> Grid | None:
    """Largest distances of the free runs beside their tolerance, per stage, held-out records first.

    Parameters
    ----------
    answer : what trace.json holds.

    Returns
    -------
    The table, or None where the answer states no tolerances.
    """
    stated = answer.get("tolerances")
    if not stated:
        return None
    found = [stage for stage in STAGES if stage in stated]
    groups = [
        Group(f"Largest distance, free run, {where}", tuple(_rows(stated, found, which)))
        for which, where in SETS
        if any(which in stated[stage] for stage in found)
    ]
    return Grid(
        title="Tolerances of a training simulator",
        header=("", "tolerance", *found),
        groups=tuple(groups),
        notes=(
            f"Source: {stated['source']} (short-period dynamics): pitch or q, and az. pitch: from the start of the "
            "record, the integral of q's distance. samples inside: mean over the records; records within: those "
            "that stay inside throughout. In gusts a distance is mostly the gusts'.",
        ),
    )


def _rows(stated: Mapping[str, Any], found: list[str], which: str) -> Iterator[Row]:
    cells = [stated[stage][which] for stage in found]
    for name, told, unit in _QUANTITIES:
        yield (
            told,
            figures(stated["limits"][name] / unit, 2),
            *(figures(cell[name] / unit) for cell in cells),
        )
    yield ("samples inside [%]", "100", *(f"{100.0 * cell['share_inside']:.0f}" for cell in cells))
    yield (
        "records within",
        str(cells[0]["records"]),
        *(f"{cell['records_within']}" for cell in cells),
    )


__all__ = ["tolerance_grid"]
