"""A model on the bench: one state after another, each in an executive of its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft, AircraftFile, JsbsimModel
from airtruth.aircraft.model import SurfaceProperties
from airtruth.aircraft.probe import Constants, constants_of
from airtruth.physics.motion import LATERAL, LONGITUDINAL
from airtruth.physics.terms import ELEVATOR
from airtruth.simulation.simulator import Condition, Controls, Executive
from airtruth.units import DEG, G0

Array = NDArray[np.float64]

STEP_S: Final = 1.0 / 200.0
"""Simulation step [s]: that of the campaigns."""
_MOTION: Final = {LONGITUDINAL.vane: 4.0 * DEG}
"""Channel of the motion -> its value in the state that is examined [rad] (judgement: away from the stall)."""
_DENSITY: Final = 1.225
"""Density of the air at sea level [kg/m3] (standard atmosphere)."""


@dataclass(frozen=True)
class ModelBench:
    """A model and a state to examine it in.

    Attributes
    ----------
    folder, model : folder of aircraft.toml and its [jsbsim] table as known so far.
    constants : geometry and mass.
    condition : flight condition; throttle : lever in it.
    """

    folder: Path
    model: JsbsimModel
    constants: Constants
    condition: Condition
    throttle: float = 0.6

    @property
    def aircraft(self) -> Aircraft:
        """The aircraft as known so far."""
        name = self.folder.name.replace(" ", "_") or "aircraft"
        file = AircraftFile.model_construct(name=name, jsbsim=self.model)
        return Aircraft(folder=self.folder, file=file, constants=self.constants)

    @property
    def surface(self) -> SurfaceProperties:
        """The control surface of the pitch plane."""
        return self.model.surfaces(LONGITUDINAL)[ELEVATOR]

    def known(self, **changes: object) -> ModelBench:
        """The bench with other entries of the [jsbsim] table."""
        return replace(self, model=self.model.model_copy(update=changes))

    def at(
        self,
        writes: Mapping[str, float] | None = None,
        *,
        off: Mapping[str, float] = MappingProxyType({}),
        speed: float = 1.0,
        throttle: float | None = None,
    ) -> Executive:
        """An executive in a steady state.

        Parameters
        ----------
        writes : further properties, written after the controls.
        off : channel of the motion -> departure from `_MOTION` [rad], [rad/s]; one of the lateral motion needs six axes.
        speed : over that of the condition; throttle : lever.
        """
        executive = Executive(self.aircraft, STEP_S)
        for name, value in (writes or {}).items():
            executive.fdm[name] = value
        condition = replace(self.condition, eas_m_s=self.condition.eas_m_s * speed)
        lever = self.throttle if throttle is None else throttle
        command = (writes or {}).get(self.surface.command, 0.0) / self.surface.command_per_rad
        motion = dict(_MOTION) | {name: _MOTION.get(name, 0.0) + more for name, more in off.items()}
        if not off.keys().isdisjoint(LATERAL.output_channels):
            condition = replace(condition, straight="wings-level")
        executive.initialise(condition, Controls(lever, {ELEVATOR: command}, motion=motion))
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
