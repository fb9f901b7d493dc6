"""A JSBSim aircraft from six derivatives: for a measured aircraft of which nobody has a model.

What the model holds stands in `airtruth.effects.new_aircraft_xml`.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd

from airtruth import aircraft as planes
from airtruth.aircraft import (
    Aircraft,
    AircraftFile,
    ElevatorProperties,
    JsbsimModel,
    ThrottleProperties,
)
from airtruth.effects import toml_text
from airtruth.effects.new_aircraft_xml import TrimPoint, model_xml
from airtruth.effects.writing import _claim
from airtruth.errors import ConfigurationError, StoreError, choices
from airtruth.logs.flight_log import FlightLog
from airtruth.physics.atmosphere import density_kg_m3
from airtruth.physics.short_period import PARAMETERS
from airtruth.quantity import Quantity

_MOST_ALPHA_RAD: Final = 0.7


def trim_point(log: FlightLog, window_s: float = 1.0) -> TrimPoint:
    """Means over the start of every run of a validated log, before anything moves.

    Parameters
    ----------
    log : flight log.
    window_s : length of that start [s].
    """
    rows = []
    for run in range(len(log.run_ids)):
        part = log.rows(run)
        t = log.t_s[part]
        head = slice(part.start, part.start + int(np.searchsorted(t - t[0], window_s, side="right")))
        rows.append(np.arange(head.start, head.stop))
    index = np.concatenate(rows)

    def mean(channel: str) -> float:
        return float(log.channels[channel][index].mean())

    measured = "density_kg_m3" in log.channels
    density = mean("density_kg_m3") if measured else float(density_kg_m3(mean("altitude_m")))
    return TrimPoint(mean("airspeed_m_s"), density, mean("alpha_rad"), mean("elevator_rad"), mean("az_m_s2"))


def from_estimates(estimates: pd.DataFrame, method: str | None = None) -> dict[str, Quantity]:
    """Derivatives from a table of estimates, with their uncertainty.

    Several runs give their mean; its standard deviation is that of the mean, from the spread of the runs
    or from what each run states, whichever is larger.

    Parameters
    ----------
    estimates : columns run_id, method, converged, and NAME, NAME_std of each derivative.
    method : which one; may be left out where there is one.

    Raises
    ------
    ConfigurationError
        If the method is not there or ambiguous, or no run converged.
    """
    methods = sorted(set(estimates["method"]))
    if method is None and len(methods) > 1:
        raise ConfigurationError(
            f"estimates hold several methods: choose one by --method ({', '.join(methods)})"
        )
    if method is not None and method not in methods:
        raise ConfigurationError(f"--method {method!r}: {choices(method, methods)}")
    chosen = method or methods[0]
    good = estimates[(estimates["method"] == chosen) & estimates["converged"]]
    if good.empty:
        raise ConfigurationError(f"estimates: no run of {chosen} converged")
    found = {}
    for name in PARAMETERS:
        value, std = good[name].to_numpy(), good[f"{name}_std"].to_numpy()
        spread = float(value.std(ddof=1)) if len(value) > 1 else 0.0
        stated = float(np.sqrt(np.nanmean(std**2))) if np.isfinite(std).any() else 0.0
        source = f"{chosen}, {len(value)} run{'s' if len(value) > 1 else ''}"
        found[name] = Quantity(
            value=float(value.mean()), std=max(spread, stated) / len(value) ** 0.5, source=source
        )
    return found


def write_new(
    aircraft: Aircraft,
    derivatives: Mapping[str, Quantity],
    at: TrimPoint,
    out_folder: Path,
    note: str = "",
) -> Aircraft:
    """Write a folder with a JSBSim model and aircraft.toml that flies six derivatives about a trim.

    Parameters
    ----------
    aircraft : its geometry, mass, actuator and sensors are taken over.
    derivatives : all of `airtruth.physics.short_period.PARAMETERS` about the CG [1/rad].
    at : trim about which they count.
    out_folder : folder to write, new or empty; the aircraft and its model take its name.
    note : said in the heads of both files.

    Returns
    -------
    Aircraft
        The written one, read back; `airtruth.fly.trim` finds its trim.

    Raises
    ------
    ConfigurationError
        If a derivative is missing, unknown or not finite, or the trim means nothing.
    StoreError
        If the folder is not empty or cannot be written.
    """
    values = _checked(derivatives, at)
    _claim(out_folder)
    name = out_folder.name
    head = f"{name}: the short-period motion of {aircraft.name} about one trim, written by airtruth."
    heading = f"{head}\n{note}".rstrip()
    file = aircraft.file
    model = JsbsimModel(
        model=name,
        elevator=ElevatorProperties(
            command="fcs/elevator-cmd-rad",
            command_frames=1 if file.elevator_actuator and file.elevator_actuator.delay.value > 0.0 else 0,
        ),
        throttle=ThrottleProperties(),
        rotary_gust="aero/gust/q-rad_sec",
    )
    update = {"name": name, "jsbsim": model, "derivatives": {k: derivatives[k] for k in PARAMETERS}}
    fields = {k: getattr(file, k) for k in file.model_fields_set if k != "schema_"}
    written = AircraftFile.model_construct(**fields | update)
    try:
        xml = model_xml(name, heading, aircraft, values, at)
        (out_folder / f"{name}.xml").write_text(xml, encoding="utf-8")
        (out_folder / planes.FILE).write_text(toml_text.write(written, heading), encoding="utf-8")
    except OSError as error:
        raise StoreError(
            f"{out_folder}: cannot be written ({error.strerror}); choose another folder"
        ) from None
    return planes.load(out_folder)


def _checked(derivatives: Mapping[str, Quantity], at: TrimPoint) -> dict[str, float]:
    for name in derivatives:
        if name not in PARAMETERS:
            raise ConfigurationError(f"derivative {name!r}: {choices(name, PARAMETERS)}")
    missing = [name for name in PARAMETERS if name not in derivatives]
    if missing:
        raise ConfigurationError(
            f"derivatives lack {', '.join(missing)}; state them in [derivatives] of aircraft.toml, or give estimates"
        )
    values = {name: derivatives[name].value for name in PARAMETERS}
    wrong = [name for name, value in values.items() if not np.isfinite(value)]
    if wrong:
        raise ConfigurationError(f"derivative {wrong[0]} is not a finite number")
    if not (at.airspeed_m_s > 0.0 and at.density_kg_m3 > 0.0 and at.az_m_s2 < 0.0):
        raise ConfigurationError(
            f"trim: airspeed {at.airspeed_m_s:g} m/s and density {at.density_kg_m3:g} kg/m3 have to be above 0 and "
            f"az {at.az_m_s2:g} m/s2 below 0"
        )
    if not abs(at.alpha_rad) < _MOST_ALPHA_RAD:
        raise ConfigurationError(
            f"trim: alpha {at.alpha_rad:g} rad is outside -{_MOST_ALPHA_RAD:g} to {_MOST_ALPHA_RAD:g} rad: degrees?"
        )
    return values


__all__ = ["TrimPoint", "from_estimates", "trim_point", "write_new"]
