"""Conditions, units and provenance: the last section of every page."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Final

from airtruth.identification.stored import Record
from airtruth.logs.histories import Histories
from airtruth.logs.provenance import Provenance
from airtruth.physics.motion import LONGITUDINAL, Motion
from airtruth.reporting.pages.page import Section, data_table, notes_html
from airtruth.reporting.pages.records import conditions_table
from airtruth.table import Group, Row, Table

UNITS: Final = (
    "Units: angles in degrees in plots and SI units in files; derivatives per radian, with rates as q c/(2V); "
    "wn in rad/s, zeta without unit. Signs: body axes x forward, z down; alpha, q and pitch nose-up positive; az about "
    "-9.8 m/s2 in level flight; elevator trailing edge down positive."
)
"""Units and signs of a page (contract 1)."""
_LATERAL_UNITS: Final = (
    "Units: SI; derivatives per radian, with rates as p b/(2V) and r b/(2V); wn in rad/s, zeta without unit, roots in 1/s. "
    "Signs: body axes x forward, y right, z down; aileron (right less left)/2, each trailing edge down positive; "
    "rudder trailing edge left positive."
)
"""The same for the lateral motion."""
_CONSTANTS: Final = {
    "wing_area_m2": "wing area [m2]",
    "chord_m": "chord [m]",
    "mass_kg": "mass [kg]",
    "inertia_yy_kg_m2": "Iyy [kg m2]",
    "span_m": "span [m]",
    "inertia_xx_kg_m2": "Ixx [kg m2]",
    "inertia_zz_kg_m2": "Izz [kg m2]",
    "inertia_xz_kg_m2": "Ixz [kg m2]",
}
"""Constant of an aircraft -> heading with its unit."""


def origin_section(
    histories: Histories | None,
    groups: Iterable[Group],
    notes: Iterable[str] = (),
    motion: Motion = LONGITUDINAL,
) -> Section:
    """Return the section of conditions, units and provenance.

    Parameters
    ----------
    histories : records with their conditions; None where there are none.
    groups : rows of provenance, entry and value, from `of_trace` or `of_methods`.
    notes : sentences of the result.
    motion : whose units and signs the page states.
    """
    parts = [] if histories is None else [data_table(conditions_table(histories), "conditions")]
    parts.append(notes_html([UNITS if motion is LONGITUDINAL else _LATERAL_UNITS]))
    rows = tuple(group for group in groups if group.rows)
    if rows:
        parts.append(data_table(Table("Provenance", ("entry", "value"), rows), "provenance"))
    parts.append(notes_html(notes))
    return Section("Conditions, units and provenance", "origin", "\n".join(parts))


def of_trace(provenance: Provenance) -> tuple[Group, ...]:
    """Version, options and digests of a trace as rows."""
    known = {"airtruth": provenance.version, "aircraft": provenance.aircraft}
    return (
        Group("", tuple((name, value) for name, value in known.items() if value)),
        Group("Options of the trace", tuple(provenance.options.items())),
        Group("SHA-256 of the inputs", tuple(provenance.digests.items())),
    )


def of_methods(records: Mapping[str, Record]) -> tuple[Group, ...]:
    """Version, options, constants and digests of the estimates of each method; methods that agree share a group."""
    if not records:
        return ()
    groups: list[Group] = []
    seen: dict[str, list[str]] = {}
    for method, record in records.items():
        seen.setdefault(repr((record["version"], record["options"], record["joint"])), []).append(method)
    for methods in seen.values():
        record = records[methods[0]]
        rows: list[Row] = [("airtruth", record["version"]), ("joint", "yes" if record["joint"] else "no")]
        rows += [
            (name, "default" if value is None else str(value)) for name, value in record["options"].items()
        ]
        groups.append(Group(f"Options of {', '.join(methods)}", tuple(rows)))
    first = next(iter(records.values()))
    constants = tuple(
        (words, f"{first['constants'][name]:.6g}")
        for name, words in _CONSTANTS.items()
        if name in first["constants"]
    )
    digests = {source[0]: source[1] for record in records.values() for source in record["sources"]}
    return (
        *groups,
        Group(f"Aircraft {first['aircraft']}", constants),
        Group("SHA-256 of the logs", tuple(digests.items())),
    )


__all__ = ["UNITS", "of_methods", "of_trace", "origin_section"]
