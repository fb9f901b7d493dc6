"""A model on the bench: one state after another, each in an executive of its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft, AircraftFile, JsbsimModel
from airtruth.aircraft.probe import Constants, constants_of
from airtruth.physics.motion import LATERAL, LONGITUDINAL
from airtruth.physics.terms import ELEVATOR
from airtruth.simulation.simulator import Condition, Controls, Executive
from airtruth.units import DEG, G0

Array = NDArray[np.float64]

STEP_S: Final = 1.0 / 200.0
"""Simulation step [s]: that of the campaigns."""
_DENSITY: Final = 1.225
"""Density of the air at sea level [kg/m3] (standard atmosphere)."""


@dataclass(frozen=True)
class ModelBench:
    """A model and a state to examine it in.

    Attributes
    ----------
    folder, model : folder of aircraft.toml and its [jsbsim] table as known so far.
    constants : geometry and mass.
    condition : flight condition; alpha_rad, throttle : state in it.
    """

    folder: Path
    model: JsbsimModel
    constants: Constants
    condition: Condition
    alpha_rad: float = 4.0 * DEG
    throttle: float = 0.6

    @property
    def aircraft(self) -> Aircraft:
        """The aircraft as known so far."""
        name = self.folder.name.replace(" ", "_") or "aircraft"
        file = AircraftFile.model_construct(name=name, jsbsim=self.model)
        return Aircraft(folder=self.folder, file=file, constants=self.constants)

    def known(self, **changes: object) -> ModelBench:
        """The bench with other entries of the [jsbsim] table."""
        return replace(self, model=self.model.model_copy(update=changes))

    def at(
        self,
        writes: Mapping[str, float] | None = None,
        *,
        alpha_rad: float | None = None,
        q_rad_s: float = 0.0,
        speed: float = 1.0,
        throttle: float | None = None,
        lateral: Mapping[str, float] | None = None,
    ) -> Executive:
        """An executive in a steady state.

        Parameters
        ----------
        writes : further properties, written after the controls.
        alpha_rad, q_rad_s : of the state; speed : over that of the condition; throttle : lever.
        lateral : p_rad_s, r_rad_s, beta_rad or phi_rad of the state [rad/s], [rad]; the others are zero.
        """
        executive = Executive(self.aircraft, STEP_S)
        for name, value in (writes or {}).items():
            executive.fdm[name] = value
        condition = replace(self.condition, eas_m_s=self.condition.eas_m_s * speed)
        lever = self.throttle if throttle is None else throttle
        command = (writes or {}).get(self.model.elevator.command, 0.0) / self.model.elevator.command_per_rad
        alpha = self.alpha_rad if alpha_rad is None else alpha_rad
        rates = dict(lateral or {})
        controls = Controls(
            lever,
            {ELEVATOR: command},
            bank_rad=rates.pop("phi_rad", 0.0),
            sideslip_rad=rates.pop(LATERAL.vane, 0.0),
        )
        if lateral is not None:
            condition = replace(condition, straight="wings-level")
        executive.initialise(condition, alpha, controls, rates | {LONGITUDINAL.gyros[0]: q_rad_s})
        return executive


def bench(folder: Path, model: JsbsimModel, altitude_m: float = 1500.0, lift: float = 0.45) -> ModelBench:
    """A bench at the airspeed at which a lift coefficient carries the weight.

    Parameters
    ----------
    altitude_m : altitude [m]; lift : coefficient [-].
    """
    unknown = Constants(wing_area_m2=1.0, chord_m=1.0, span_m=1.0, mass_kg=1.0, inertia_yy_kg_m2=1.0)
    first = ModelBench(folder, model, unknown, Condition(60.0, altitude_m))
    constants = constants_of(first.at().fdm)
    return replace(first, constants=constants, condition=Condition(eas_of(constants, lift), altitude_m))


def eas_of(constants: Constants, lift: float) -> float:
    """Equivalent airspeed [m/s] at which a lift coefficient carries the weight; 60 m/s without a wing."""
    if not constants.wing_area_m2 > 0.0:
        return 60.0
    return float(np.sqrt(2.0 * constants.mass_kg * G0 / (_DENSITY * constants.wing_area_m2 * lift)))


def read(executive: Executive, names: Sequence[str]) -> Array:
    """(names,) values of properties in the present state."""
    return np.array([executive.fdm[name] for name in names])


__all__ = ["STEP_S", "ModelBench", "bench", "eas_of", "read"]
