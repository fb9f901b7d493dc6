"""Write an aircraft without a JSBSim model, with a change, as an aircraft that flies.

A small JSBSim model of the six derivatives (`airtruth.aircraft.jsbsim.short_period`) takes the change as any other
model does. Its reference point is moved by what the change adds at the trim, so that it trims where the records do.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from airtruth.aircraft.create import flown_values, write_new
from airtruth.aircraft.dynamics import declared_dynamics
from airtruth.aircraft.file import FILE, Aircraft
from airtruth.aircraft.jsbsim.short_period import TrimPoint
from airtruth.aircraft.origin import UNKNOWN, Origin
from airtruth.aircraft.write import changed
from airtruth.physics.motion import LONGITUDINAL, MOTIONS
from airtruth.physics.terms import QBAR, Change, declared_total, signals_of, term_value
from airtruth.quantity import Quantity


def reference_point(
    aircraft: Aircraft, derivatives: Mapping[str, float], at: TrimPoint, change: Change
) -> TrimPoint:
    """Trim about which the model is written, so that the model with the change trims at another one.

    At the trim the change adds dCL and dCm to lift and moment, the elevator is effective by a factor k, the mass grows by
    a factor m, and a CG aft by x chords adds CN x to the moment. Lift and moment balance at alpha_t and de_t if

        de_r = k de_t + (dCm + CN x)/Cmde,     CN_r = m CN - dCL - CLde (k de_t - de_r)

    Parameters
    ----------
    aircraft : source of mass and geometry.
    derivatives : the six derivatives of the pitch plane [1/rad].
    at : trim of the changed aircraft.
    change : terms, alpha counted from zero.
    """
    c = aircraft.constants
    pressure = 0.5 * at.density_kg_m3 * at.airspeed_m_s**2
    (control,), (force, turn) = LONGITUDINAL.controls, (c.name for c in LONGITUDINAL.coefficients)
    factor, mass = declared_total(change.declared, control.name), declared_total(change.declared, "mass")
    normal = -mass * c.mass_kg * at.az_m_s2 / (pressure * c.wing_area_m2)
    surface = factor * at.elevator_rad
    steady = {name: 0.0 for motion in MOTIONS.values() for name in signals_of(motion)}
    steady |= {LONGITUDINAL.flow: at.alpha_rad, control.name: surface, QBAR: pressure}
    signals = {name: np.asarray(value) for name, value in steady.items()}
    signals |= {state.name: signals[state.signal] for state in change.states}
    added = {
        name: float(sum(term_value(t, signals) for t in change.aero if t.coefficient == name))
        for name in (force, turn)
    }
    moment = added[turn] + normal * declared_total(change.declared, "cg")
    by_lift, by_moment = (derivatives[name + control.symbol] for name in (force, turn))
    reference = surface + (moment / by_moment if by_moment else 0.0)
    lift = normal - added[force] - by_lift * (surface - reference)
    return replace(at, elevator_rad=reference, az_m_s2=at.az_m_s2 * mass * lift / normal)


def write_corrected(
    aircraft: Aircraft,
    derivatives: Mapping[str, Quantity],
    at: TrimPoint,
    change: Change,
    out_folder: Path,
    note: str = "",
    origin: Origin = UNKNOWN,
) -> Aircraft:
    """Write a folder with a generated JSBSim model and aircraft.toml that both hold a change.

    Parameters
    ----------
    aircraft : an aircraft without a JSBSim model: geometry, mass, actuator, sensors, and dynamics, which the model takes.
    derivatives : all of a motion, or of both, about the CG, without the change [1/rad, -].
    at : trim at which the changed aircraft flies.
    change : terms to add, alpha counted from zero; terms in the air are left out.
    out_folder : folder to write, new or empty; the JSBSim model takes its name.
    note : added to the heads of both files.
    origin : standard deviations and source of the numbers of the change.

    Returns
    -------
    Aircraft
        The written aircraft, read back and checked.

    Raises
    ------
    ConfigurationError
        If a derivative is missing or not finite, the trim is not physical, or a `DerivativeTerm` is not resolved.
    AircraftError
        If JSBSim refuses the result.
    StoreError
        If the folder is not empty or cannot be written.
    """
    whole = declared_dynamics(aircraft.file.dynamics, "") + change
    static = aircraft.model_copy(update={"file": aircraft.file.model_copy(update={"dynamics": None})})
    values = flown_values(derivatives, at)
    with tempfile.TemporaryDirectory() as folder:
        reference = reference_point(aircraft, values, at, whole)
        plain = write_new(static, derivatives, reference, Path(folder) / out_folder.name)
        return changed(plain, whole, out_folder, note, origin=origin, declared=_text(aircraft))


def _text(aircraft: Aircraft) -> str | None:
    """aircraft.toml of the declared aircraft, which the new one changes; None for an aircraft in memory."""
    path = aircraft.folder / FILE
    return path.read_bytes().decode() if path.is_file() else None


__all__ = ["reference_point", "write_corrected"]
