"""Write the lateral tables of aircraft/gtm/tables into aircraft/gtm/gtm.xml.

python -m scripts.gtm_model
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

Array = NDArray[np.float64]

FOLDER: Final = Path(__file__).resolve().parents[1] / "aircraft" / "gtm"
"""Folder of the aircraft."""
MODEL: Final = FOLDER / "gtm.xml"
"""The JSBSim model."""
_BEGIN: Final = "      <!-- six axes: begin ({}) -->\n"
_END: Final = "      <!-- six axes: end ({}) -->\n"
_AXES: Final = {
    "CX": ("Axial force coefficient, body x, forward positive", None, 1.0),
    "CY": ("Side force coefficient, body y, right positive", None, -1.0),
    "CZ": ("Normal force coefficient, body z, down positive", None, 1.0),
    "Cl": ("Rolling moment coefficient about 25 % MAC, right wing down positive", "metrics/bw-ft", -1.0),
    "Cm": ("Pitching moment coefficient about 25 % MAC, nose-up positive", "metrics/cbarw-ft", 1.0),
    "Cn": ("Yawing moment coefficient about 25 % MAC, nose right positive", "metrics/bw-ft", -1.0),
}
"""Coefficient -> its description, reference length beside the wing area, and factor of its mirror image."""
_ALPHA: Final = "aero/alpha-deg"
_BETA: Final = "aero/beta-deg"


def read(name: str, coefficient: str) -> tuple[list[Array], Array]:
    """Break points and values of a coefficient in a file of aircraft/gtm/tables.

    Parameters
    ----------
    name : of the file, without its end; coefficient : column.

    Returns
    -------
    points, values : break points of alpha [deg] and of the further variables (sideslip and surface [deg], rate [-]), and an
        array over them [-].
    """
    table = pd.read_csv(FOLDER / "tables" / f"{name}.csv", comment="#")
    keys = [c for c in table.columns if c not in _AXES]
    points = [np.unique(table[k].to_numpy(dtype=np.float64)) for k in keys]
    values = table.sort_values(keys)[coefficient].to_numpy(dtype=np.float64)
    return points, values.reshape([len(p) for p in points])


def mirrored(points: list[Array], values: Array, factor: float) -> Array:
    """Values of the mirror image of a table over alpha, sideslip and deflection: sideslip changes sign.

    Parameters
    ----------
    points : alpha, sideslip, deflection [deg], the sideslip symmetric; values : over them.
    factor : -1 for CY, Cl and Cn, 1 for CX, CZ and Cm.
    """
    assert np.array_equal(points[1], -points[1][::-1])
    return factor * values[:, ::-1, :]


def both_ailerons(points: list[Array], values: Array, factor: float) -> tuple[list[Array], Array]:
    """The table of right and left aileron at opposite deflections, from that of the right one.

    The left aileron is the mirror image of the right one. The sum is exact between break points as well, because those of
    deflection and sideslip are symmetric.

    Parameters
    ----------
    points, values : as in `mirrored`; factor : as there.
    """
    assert np.array_equal(points[2], -points[2][::-1])
    return points, values + mirrored(points, values, factor)[:, :, ::-1]


def both_ways(points: list[Array], values: Array, factor: float) -> tuple[list[Array], Array]:
    """The rudder's table continued to positive deflections: there sideslip and deflection change sign.

    Parameters
    ----------
    points, values : as in `mirrored`, for deflections up to 0; factor : as there.
    """
    other = mirrored(points, values, factor)[:, :, ::-1]
    deflections = np.concatenate([points[2], -points[2][-2::-1]])
    return [points[0], points[1], deflections], np.concatenate([values, other[:, :, 1:]], axis=2)


def function(coefficient: str) -> str:
    """The function of the increments of one coefficient, as XML."""
    description, length, factor = _AXES[coefficient]
    aileron = both_ailerons(*read("right_aileron", coefficient), factor)
    rudder = both_ways(*read("rudder", coefficient), factor)
    tables = [
        _table("sideslip", *read("sideslip", coefficient), (_ALPHA, _BETA)),
        _table("ailerons", *aileron, (_ALPHA, _BETA, "aero/function/aileron-deg")),
        _table("rudder", *rudder, (_ALPHA, _BETA, "aero/function/rudder-deg")),
    ]
    if factor < 0.0:
        tables += [
            _table("roll rate", *read("roll_rate", coefficient), (_ALPHA, "aero/function/phat")),
            _table("yaw rate", *read("yaw_rate", coefficient), (_ALPHA, "aero/function/rhat")),
        ]
        what = "sideslip, ailerons, rudder, roll and yaw rate"
    else:
        what = "increment of sideslip, ailerons and rudder"
    reference = "" if length is None else f"            <property>{length}</property>\n"
    return f"""      <function name="aero/coefficient/{coefficient}-lateral">
        <description>{description}: {what}; in six axes</description>
        <ifthen>
          <property>aero/six-axes</property>
          <product>
            <property>aero/qbar-area</property>
{reference}            <sum>
{"".join(tables)}            </sum>
          </product>
          <value>0.0</value>
        </ifthen>
      </function>
"""


def _table(name: str, points: list[Array], values: Array, variables: tuple[str, ...]) -> str:
    lookups = zip(("row", "column", "table"), variables, strict=False)
    lines = [f'<independentVar lookup="{kind}">{variable}</independentVar>' for kind, variable in lookups]
    sheets: Iterable[tuple[str, Array]] = [("", values)]
    if len(points) == 3:
        sheets = [(f' breakPoint="{p:g}"', values[:, :, k]) for k, p in enumerate(points[2])]
    for end, sheet in sheets:
        # JSBSim looks nothing up in a sheet of one row, and is the faster for it
        rows, columns = (points[0], points[1]) if sheet.any() else (points[0][:1], points[1][[0, -1]])
        lines += [f"<tableData{end}>", "        " + "".join(f"{p:13g}" for p in columns)]
        rows = zip(rows, sheet[: len(rows), : len(columns)], strict=True)
        lines += [f"{a:8g}" + "".join(f" {round(v, 9) + 0.0:12.8g}" for v in row) for a, row in rows]
        lines.append("</tableData>")
    body = "".join(f"                {line}\n" for line in lines)
    return f"              <!-- {name} -->\n              <table>\n{body}              </table>\n"


def generated(model: str, functions: Mapping[str, str]) -> str:
    """The model with the functions of the coefficients between their marks.

    Parameters
    ----------
    model : text of the XML file; functions : coefficient -> XML.
    """
    for coefficient, text in functions.items():
        begin, end = _BEGIN.format(coefficient), _END.format(coefficient)
        before, rest = model.split(begin)
        _, after = rest.split(end)
        model = before + begin + text + end + after
    return model


def main() -> None:
    """Write the model."""
    functions = {coefficient: function(coefficient) for coefficient in _AXES}
    MODEL.write_text(generated(MODEL.read_text(encoding="utf-8"), functions), encoding="utf-8")


if __name__ == "__main__":
    main()
