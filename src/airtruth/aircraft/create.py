"""Write an aircraft with a JSBSim model from its derivatives, for a measured aircraft that has no model.

The equations of the model are in `airtruth.aircraft.jsbsim.short_period`.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from airtruth.aircraft import toml
from airtruth.aircraft.file import FILE, Actuator, Aircraft, AircraftFile
from airtruth.aircraft.jsbsim.short_period import TrimPoint, model_xml
from airtruth.aircraft.loading import load
from airtruth.aircraft.model import ElevatorProperties, JsbsimModel, SurfaceProperties, ThrottleProperties
from airtruth.aircraft.write import require_new
from airtruth.errors import ConfigurationError, choices
from airtruth.logs import ledger
from airtruth.logs.atomic import new_folder
from airtruth.logs.flight_log import FlightLog
from airtruth.physics.atmosphere import air_density
from airtruth.physics.motion import LATERAL, LONGITUDINAL
from airtruth.physics.motion_parts import Control
from airtruth.quantity import LARGEST, Quantity

if TYPE_CHECKING:
    import pandas as pd

_MOST_ALPHA_RAD: Final = 0.7
"""Largest angle of attack of a trim [rad] (judgement: 40 deg, above any trim; a value in degrees exceeds it)."""
_PITCH: Final = dict(zip(LONGITUDINAL.parameters, (5.0, 5.0, 0.4, -0.8, -20.0, -1.2), strict=True))
"""Pitch plane of a model of lateral derivatives alone [1/rad] (judgement: stable and well damped; a lateral trace takes alpha and
q as measured)."""
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
    vane, _, normal = LONGITUDINAL.output_channels
    return TrimPoint(
        float(start["airspeed_m_s"].mean()),
        float(air_density(start).mean()),
        *(float(start[name].mean()) for name in (vane, *LONGITUDINAL.surfaces, normal)),
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
    """Write a folder with a JSBSim model and aircraft.toml that flies derivatives about a trim, in six axes with lateral ones.

    Parameters
    ----------
    aircraft : source of geometry, mass, actuator and sensors.
    derivatives : all of a motion, or of both, about the CG [1/rad, -]; the pitch plane of lateral ones alone is a placeholder.
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
    values = flown_values(derivatives, at)
    require_new(out_folder)
    name = out_folder.name
    motion = "motion" if _is_lateral(derivatives) else "short-period motion"
    head = f"{name}: the {motion} of {aircraft.name} about one trim, written by airtruth."
    if not set(LONGITUDINAL.parameters) <= set(derivatives):
        note = f"The pitch plane is a placeholder: no derivatives of it are declared. {note}"
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
    frames = {"command_frames": _frames(source.elevator_actuator)}
    model = JsbsimModel(
        model=name,
        elevator=ElevatorProperties(command="fcs/elevator-cmd-rad", **frames),
        throttle=ThrottleProperties(),
        rotary_gust="aero/gust/q-rad_sec",
    )
    if _is_lateral(derivatives):
        surfaces = {c.name: _surface(c, getattr(source, c.actuator)) for c in LATERAL.controls}
        gusts = {"roll_gust": "aero/gust/p-rad_sec", "yaw_gust": "aero/gust/r-rad_sec"}
        model = model.model_copy(update=surfaces | gusts)
    changed = {"name": name, "jsbsim": model, "derivatives": dict(derivatives)}
    kept = {k: getattr(source, k) for k in source.model_fields_set if k != "schema_"}
    return AircraftFile.model_construct(**kept | changed)


def _is_lateral(derivatives: Mapping[str, Quantity]) -> bool:
    """Whether they are those of the lateral-directional motion as well."""
    return set(LATERAL.parameters) <= set(derivatives)


def _surface(control: Control, servo: Actuator | None) -> SurfaceProperties:
    return SurfaceProperties(
        command=f"fcs/{control.name}-cmd-rad",
        surface=f"fcs/{control.name}-pos-rad",
        command_frames=_frames(servo),
    )


def _frames(servo: Actuator | None) -> int:
    """Frames between reading a command and acting on it: JSBSim's actuators delay by one less than a delay states."""
    return 1 if servo and servo.delay.value > 0.0 else 0


def flown_values(derivatives: Mapping[str, Quantity], at: TrimPoint) -> dict[str, float]:
    """Values of all six derivatives, and of the lateral ones where all are there [1/rad, -].

    Raises
    ------
    ConfigurationError
        As `write_new`.
    """
    known = (*LONGITUDINAL.parameters, *LATERAL.parameters)
    for name in derivatives:
        if name not in known:
            raise ConfigurationError(f"derivative {name!r}: {choices(name, known)}")
    lateral = LATERAL.parameters if _is_lateral(derivatives) else ()
    pitch = [name for name in LONGITUDINAL.parameters if name in derivatives]
    missing = [name for name in LONGITUDINAL.parameters if name not in derivatives and (pitch or not lateral)]
    if missing:
        raise ConfigurationError(
            f"derivatives lack {', '.join(missing)}; state them in [derivatives] of aircraft.toml, or give estimates"
        )
    values = (_PITCH if not pitch else {}) | {name: derivatives[name].value for name in (*pitch, *lateral)}
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


__all__ = ["TRIM_WINDOW_S", "TrimPoint", "flown_values", "from_estimates", "trim_point", "write_new"]
