"""Picture of the manoeuvres of a flight, to accept or edit."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from airtruth import style
from airtruth.importers.manoeuvre_result import ManoeuvreResult
from airtruth.units import DEG

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ROW_S: Final = 600.0
"""Time in one row [s] (judgement: a doublet is still a few millimetres wide)."""
MOST_ROWS: Final = 24
"""Rows of a picture [-] (judgement: four hours); longer flights have longer rows."""


@style.themed
def draw(found: ManoeuvreResult) -> Figure:
    """Elevator and pitch rate over the flight, accepted manoeuvres green and others grey and hatched, with their names."""
    span = float(found.t_s[-1] - found.t_s[0])
    rows = min(MOST_ROWS, max(1, int(np.ceil(span / ROW_S))))
    length = span / rows
    figure, axes = style.panels(rows, 1, width_in=12.0, height_in=1.2 + 1.5 * rows)
    for row, axis in enumerate(axes.ravel()):
        low = float(found.t_s[0]) + row * length
        shown = (found.t_s >= low) & (found.t_s <= low + length)
        t = found.t_s[shown]
        axis.plot(t, found.elevator_rad[shown] / DEG, color=style.BLUE, label="elevator [deg]", linewidth=0.9)
        axis.plot(t, found.q_rad_s[shown] / DEG, color=style.VERMILLION, label="q [deg/s]", linewidth=0.6)
        for one in found.candidates:
            if one.end_s < low or one.start_s > low + length:
                continue
            good = one.accept == "yes"
            axis.axvspan(
                max(one.start_s, low),
                min(one.end_s, low + length),
                color=style.GREEN if good else style.GREY,
                hatch=None if good else "//",
                alpha=0.3,
                label=("accepted" if good else "not accepted"),
            )
            axis.annotate(
                one.run_id, (max(one.start_s, low), 1.0), xycoords=("data", "axes fraction"), fontsize=7.0
            )
        axis.set_xlim(low, low + length)
    axes.ravel()[-1].set_xlabel("time on the clock of the file [s]")
    style.legend_above(figure, axes.ravel())
    return figure


__all__ = ["draw"]
