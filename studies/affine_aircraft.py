"""An aircraft with affine aerodynamics: the linear models of the estimators are exact for it, up to kinematics."""

from __future__ import annotations

import shutil
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from airtruth.units import DEG

Array = NDArray[np.float64]


def affine_copy(source: Path, target: Path, alpha_rad: float, elevator_rad: float) -> Path:
    """Copy an aircraft with planes in place of its longitudinal tables: value and upward slopes of the tables at the trim.

    Parameters
    ----------
    source : folder of the aircraft.
    target : folder of the copy; must not exist.
    alpha_rad, elevator_rad : trim [rad].

    Returns
    -------
    ``target``.
    """
    shutil.copytree(source, target)
    path = target / f"{source.name}.xml"
    tree = ET.parse(path)
    at = {
        "aero/alpha-deg": alpha_rad / DEG,
        "aero/function/elevator-deg": elevator_rad / DEG,
        "aero/function/qhat": 0.0,
    }
    for table in tree.getroot().findall("./aerodynamics/axis/function//table"):
        names = [(variable.text or "").strip() for variable in table.findall("independentVar")]
        if not set(names) <= set(at):
            continue  # the lateral increments, which are zero in the pitch plane
        data = table.find("tableData")
        assert data is not None
        data.text = _plane(data.text or "", [at[name] for name in names])
    tree.write(path)
    return target


def _plane(text: str, at: Sequence[float]) -> str:
    """Table text of the plane that touches a table of one or two variables, from -90 to 90 [deg] or [-]."""
    lines = [[float(word) for word in line.split()] for line in text.splitlines() if line.strip()]
    if len(at) == 1:
        rows, columns, values = np.array(lines)[:, 0], np.zeros(0), np.array(lines)[:, 1:]
        first = _cell(rows, at[0])
        slope = (values[first + 1, 0] - values[first, 0]) / (rows[first + 1] - rows[first])
        value = values[first, 0] + slope * (at[0] - rows[first])
        return "\n".join(f"{x:.17g} {value + slope * (x - at[0]):.17g}" for x in (-90.0, 90.0))
    columns = np.array(lines[0])
    rows, values = np.array(lines[1:])[:, 0], np.array(lines[1:])[:, 1:]
    i, j = _cell(rows, at[0]), _cell(columns, at[1])
    s = (at[0] - rows[i]) / (rows[i + 1] - rows[i])
    t = (at[1] - columns[j]) / (columns[j + 1] - columns[j])
    corner = values[i : i + 2, j : j + 2]
    by_row = np.array([1.0 - t, t]) @ (corner[1] - corner[0]) / (rows[i + 1] - rows[i])
    by_column = np.array([1.0 - s, s]) @ (corner[:, 1] - corner[:, 0]) / (columns[j + 1] - columns[j])
    value = np.array([1.0 - s, s]) @ corner @ np.array([1.0 - t, t])
    ends = (-90.0, 90.0)
    plane = [[value + by_row * (x - at[0]) + by_column * (y - at[1]) for y in ends] for x in ends]
    body = [f"{x:.17g} " + " ".join(f"{v:.17g}" for v in line) for x, line in zip(ends, plane, strict=True)]
    return "\n".join([" ".join(f"{y:.17g}" for y in ends), *body])


def _cell(axis: Array, x: float) -> int:
    """Index of the cell above x; at a break, its slope is the upward one."""
    return int(np.clip(np.searchsorted(axis, x, side="right") - 1, 0, len(axis) - 2))
