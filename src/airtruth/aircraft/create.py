"""Write an aircraft with a JSBSim model from six derivatives, for a measured aircraft that has no model.

The equations of the model are in `airtruth.aircraft.jsbsim.short_period`.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd

from airtruth.aircraft import toml
from airtruth.aircraft.file import FILE, Aircraft, AircraftFile
from airtruth.aircraft.jsbsim.short_period import TrimPoint, model_xml
from airtruth.aircraft.loading import load
from airtruth.aircraft.model import ElevatorProperties, JsbsimModel, ThrottleProperties
from airtruth.aircraft.write import require_new
from airtruth.errors import ConfigurationError, choices
from airtruth.logs import ledger
from airtruth.logs.atomic import new_folder
from airtruth.logs.flight_log import FlightLog
from airtruth.physics.atmosphere import air_density
from airtruth.physics.motion import LONGITUDINAL
from airtruth.quantity import LARGEST, Quantity

_MOST_ALPHA_RAD: Final = 0.7
"""Largest angle of attack of a trim [rad] (judgement: 40 deg, above any trim; a value in degrees exceeds it)."""
TRIM_WINDOW_S: Final = 1.0
"""Start of a run whose mean is the trim [s]: a record of the campaigns flies its manoeuvre after it."""


def trim_point(log: FlightLog, window_s: float = TRIM_WINDOW_S) -> TrimPoint:
    """Return the trim of a validated log: means over the start of every run, before the manoeuvre.

    Parameters
    ----------
    log : flight log.
    window_s : length of that start [s].
    """
    rows = []
    for run in range(len(log.run_ids)):
        part = log.rows(run)
        t = log.t_s[part]
        last = part.start + int(np.searchsorted(t - t[0], window_s, side="right"))
        rows.append(np.arange(part.start, last))
    index = np.concatenate(rows)
    start = {name: values[index] for name, values in log.channels.items()}
    return TrimPoint(
        airspeed_m_s=float(start["airspeed_m_s"].mean()),
        density_kg_m3=float(air_density(start).mean()),
        alpha_rad=float(start["alpha_rad"].mean()),
        elevator_rad=float(start["elevator_rad"].mean()),
        az_m_s2=float(start["az_m_s2"].mean()),
    )


def from_estimates(estimates: pd.DataFrame, method: str | None = None) -> dict[str, Quantity]:
    """Return the derivatives of a table of estimates, with their uncertainty.

    Several runs give their mean. Its standard deviation follows from the scatter of the runs or from their stated
    standard deviations, whichever is larger.

    Parameters
    ----------
    estimates : columns run_id, method, converged, and NAME, NAME_std of each derivative [1/rad].
    method : method to take; None if the table has one only.

    Raises
    ------
    ConfigurationError
        If the method is absent or ambiguous, no run converged, or an estimate is not finite.
    """
    methods = sorted(set(estimates["method"]))
    if not methods:
        raise ConfigurationError("estimates: the table has no rows; identify a log again")
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
    source = f"{chosen}, {len(good)} run{'s' if len(good) > 1 else ''}"
    derivatives = {}
    for name in LONGITUDINAL.parameters:
        value, std = good[name].to_numpy(), good[f"{name}_std"].to_numpy()
        with np.errstate(over="ignore", invalid="ignore"):  # diverged estimates
            scatter = float(value.std(ddof=1)) if len(value) > 1 else 0.0
            stated = float(np.sqrt(np.nanmean(std**2))) if np.isfinite(std).any() else 0.0
            mean, error = float(value.mean()), max(scatter, stated) / len(value) ** 0.5
        if not abs(mean) + error < LARGEST:
            raise ConfigurationError(
                f"estimates: {name} of {chosen} is {mean:g} with a standard error of {error:g}; choose another method, "
                "or identify a log again"
            )
        derivatives[name] = Quantity(value=mean, std=error, source=source)
    return derivatives


def write_new(
    aircraft: Aircraft, derivatives: Mapping[str, Quantity], at: TrimPoint, out_folder: Path, note: str = ""
) -> Aircraft:
    """Write a folder with a JSBSim model and aircraft.toml that flies six derivatives about a trim.

    Parameters
    ----------
    aircraft : source of geometry, mass, actuator and sensors.
    derivatives : all of ``LONGITUDINAL.parameters`` about the CG [1/rad].
    at : trim about which they hold.
    out_folder : folder to write, new or empty; the aircraft and its model take its name.
    note : added to the heads of both files.

    Returns
    -------
    Aircraft
        The written aircraft, read back and checked.

    Raises
    ------
    ConfigurationError
        If a derivative is missing, unknown or not finite, or the trim is not physical.
    StoreError
        If the folder is not empty or cannot be written.
    """
    values = _checked(derivatives, at)
    require_new(out_folder)
    name = out_folder.name
    head = f"{name}: the short-period motion of {aircraft.name} about one trim, written by airtruth."
    heading = f"{head}\n{note}".rstrip()
    file = _file(aircraft.file, name, derivatives)
    with new_folder(out_folder) as folder:
        xml = model_xml(name, heading, aircraft, values, at)
        (folder / f"{name}.xml").write_text(xml, encoding="utf-8")
        (folder / FILE).write_text(toml.write(file, heading), encoding="utf-8")
        ledger.add_folder(folder, "aircraft")
    return load(out_folder)


def _file(source: AircraftFile, name: str, derivatives: Mapping[str, Quantity]) -> AircraftFile:
    """aircraft.toml of the new aircraft: its source's, with the model and the derivatives."""
    servo = source.elevator_actuator
    model = JsbsimModel(
        model=name,
        elevator=ElevatorProperties(
            command="fcs/elevator-cmd-rad", command_frames=1 if servo and servo.delay.value > 0.0 else 0
        ),
        throttle=ThrottleProperties(),
        rotary_gust="aero/gust/q-rad_sec",
    )
    changed = {
        "name": name,
        "jsbsim": model,
        "derivatives": {k: derivatives[k] for k in LONGITUDINAL.parameters},
    }
    kept = {k: getattr(source, k) for k in source.model_fields_set if k != "schema_"}
    return AircraftFile.model_construct(**kept | changed)


def _checked(derivatives: Mapping[str, Quantity], at: TrimPoint) -> dict[str, float]:
    """Values of all six derivatives [1/rad]."""
    for name in derivatives:
        if name not in LONGITUDINAL.parameters:
            raise ConfigurationError(f"derivative {name!r}: {choices(name, LONGITUDINAL.parameters)}")
    missing = [name for name in LONGITUDINAL.parameters if name not in derivatives]
    if missing:
        raise ConfigurationError(
            f"derivatives lack {', '.join(missing)}; state them in [derivatives] of aircraft.toml, or give estimates"
        )
    values = {name: derivatives[name].value for name in LONGITUDINAL.parameters}
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


__all__ = ["TRIM_WINDOW_S", "TrimPoint", "from_estimates", "trim_point", "write_new"]
