"""A linear state-space model with names, units, operating point and uncertainty; the names come from the motion."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from airtruth.channels import SIGNALS
from airtruth.errors import ConfigurationError
from airtruth.identification.record_constants import LateralValues, RecordConstants
from airtruth.physics import short_period
from airtruth.physics.lateral import lateral_scale, lateral_system
from airtruth.physics.motion import LATERAL, LONGITUDINAL, Motion
from airtruth.result import shortened

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FlightPoint:
    """The steady flight about which a model is linear, and the aircraft in it.

    Attributes
    ----------
    airspeed_m_s, density_kg_m3 : true airspeed [m/s], density of the air [kg/m3].
    constants : of the aircraft, those that its motion needs.
    trim : further trim values by the names of channels, of those that are known [SI]; for the lateral-directional motion the
        angle of attack and the pitch attitude.
    """

    airspeed_m_s: float
    density_kg_m3: float
    constants: RecordConstants
    trim: Mapping[str, float] = field(default_factory=dict)

    def to_dict(self) -> dict[str, float]:
        """All values by name, with the dynamic pressure [Pa]."""
        air = {"airspeed_m_s": self.airspeed_m_s, "density_kg_m3": self.density_kg_m3}
        own = {name: float(value) for name, value in (air | asdict(self.constants)).items()}
        pressure = 0.5 * self.density_kg_m3 * self.airspeed_m_s**2
        return {**own, "dynamic_pressure_pa": pressure, **self.trim}


Matrices = tuple[Array, Array, Array, Array]
"""A, B, C and D."""


def _short_period(theta: Array, at: FlightPoint) -> Matrices:
    """M. Brunot, "An Instrumental Variable Approach for Aircraft Identification", eqs (2) and (3); az in m/s2."""
    scale = short_period.scale_of(at.constants, at.airspeed_m_s, at.density_kg_m3)
    return short_period.linear_system(theta, scale)


def _lateral(theta: Array, at: FlightPoint) -> Matrices:
    """V. Klein and E. A. Morelli, 3.2 and 3.3, see `airtruth.physics.lateral`; ay in m/s2."""
    if not isinstance(at.constants, LateralValues):
        raise TypeError("the lateral motion needs its constants")
    angles = (at.trim[name] for name in (LONGITUDINAL.vane, "theta_rad"))
    s = lateral_scale(at.constants, at.airspeed_m_s, at.density_kg_m3, *angles)
    return lateral_system(theta, s)


SYSTEMS: Final[Mapping[str, Callable[[Array, FlightPoint], Matrices]]] = MappingProxyType(
    {LONGITUDINAL.name: _short_period, LATERAL.name: _lateral}
)
"""Name of a motion -> its matrices from derivatives and operating point: states, inputs and outputs in the order of the
motion; affine in the derivatives."""


@dataclass(frozen=True)
class LinearModel:
    """x' = A x + B u, y = C x + D u: deviations from the operating point, outputs at the centre of gravity.

    Attributes
    ----------
    motion : names of states, inputs and outputs, and of the derivatives.
    point : where it holds.
    derivatives : (n,) in the order of ``motion.parameters``.
    derivative_covariance : (n, n) of the derivatives; NaN where the source states none.
    source : estimate behind it, in words.
    notes : what a user should know.
    """

    motion: Motion
    point: FlightPoint
    derivatives: Array
    derivative_covariance: Array
    source: str
    notes: tuple[str, ...] = ()

    @property
    def matrices(self) -> dict[str, Array]:
        """A, B, C and D by name."""
        found = SYSTEMS[self.motion.name](self.derivatives, self.point)
        return dict(zip("ABCD", found, strict=True))

    @property
    def states(self) -> tuple[str, ...]:
        """Channels of the states; the unit ends a name."""
        return tuple(state.channel for state in self.motion.states)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Channels of the controls."""
        return tuple(control.channel for control in self.motion.controls)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Channels of the outputs."""
        return self.motion.output_channels

    @property
    def entries(self) -> tuple[str, ...]:
        """Names of the entries of the matrices, "A(1,2)" for example: A, B, C, D, each row by row, counted from 1."""
        return tuple(
            f"{name}({row + 1},{column + 1})"
            for name, matrix in self.matrices.items()
            for row, column in np.ndindex(*matrix.shape)
        )

    @property
    def jacobian(self) -> Array:
        """(entries, n) derivatives of the entries; exact, because the entries are affine in the derivatives."""
        system = SYSTEMS[self.motion.name]
        zero = np.zeros(len(self.derivatives))
        origin = _entries(system(zero, self.point))
        units = np.eye(len(zero))
        return np.stack([_entries(system(unit, self.point)) - origin for unit in units], axis=1)

    @property
    def covariance(self) -> Array:
        """(entries, entries) covariance of the entries, in the order of `entries`; mass and geometry count as known."""
        jacobian = self.jacobian
        return np.asarray(jacobian @ self.derivative_covariance @ jacobian.T)

    def to_frame(self) -> pd.DataFrame:
        """One row for each entry of the matrices: entry, value, std."""
        import pandas as pd

        variance = np.diag(self.covariance)
        return pd.DataFrame(
            {
                "entry": self.entries,
                "value": _entries(tuple(self.matrices.values())),
                "std": np.sqrt(np.where(variance >= 0.0, variance, np.nan)),
            }
        )

    def to_dict(self) -> dict[str, Any]:
        """The content of the JSON file; NaN is null."""
        return {
            "motion": self.motion.name,
            "source": self.source,
            "notes": list(self.notes),
            "states": _named(self.states),
            "inputs": _named(self.inputs),
            "outputs": _named(self.outputs),
            **{name: _plain(matrix) for name, matrix in self.matrices.items()},
            "operating_point": self.point.to_dict(),
            "derivatives": {
                "names": list(self.motion.parameters),
                "units": [self.motion.units[name] for name in self.motion.parameters],
                "values": _plain(self.derivatives),
                "covariance": _plain(self.derivative_covariance),
            },
            "entries": {"names": list(self.entries), "covariance": _plain(self.covariance)},
        }

    def to_control(self) -> Any:
        """The model as a StateSpace object of python-control, with the names of the channels.

        Raises
        ------
        ConfigurationError
            If python-control is not installed.
        """
        try:
            import control
        except ImportError:
            raise ConfigurationError(
                "python-control is not installed: `pip install control`, or export a .json or .mat file"
            ) from None
        names = {"states": list(self.states), "inputs": list(self.inputs), "outputs": list(self.outputs)}
        return control.ss(*self.matrices.values(), **names)

    def summary(self) -> str:
        """Source, operating point, matrices with their names, and notes."""
        at = self.point
        lines = [
            f"{self.motion.heading} as a linear model: {self.source}",
            f"about {at.airspeed_m_s:.4g} m/s, {at.density_kg_m3:.4g} kg/m3, mass {at.constants.mass_kg:.4g} kg",
            f"states {', '.join(self.states)}; inputs {', '.join(self.inputs)}; outputs {', '.join(self.outputs)}",
        ]
        for name, matrix in self.matrices.items():
            rows = ["  ".join(f"{x:11.5g}" for x in row) for row in matrix]
            lines += [f"{name if i == 0 else ' '}  {row}" for i, row in enumerate(rows)]
        return "\n".join([*lines, *self.notes])

    def __repr__(self) -> str:
        """Return the first lines of the summary."""
        return shortened(self.summary())


def _entries(matrices: tuple[Array, ...]) -> Array:
    return np.concatenate([matrix.ravel() for matrix in matrices])


def _named(channels: tuple[str, ...]) -> list[dict[str, str]]:
    return [
        {"name": name, "unit": SIGNALS[name].unit, "description": SIGNALS[name].description}
        for name in channels
    ]


def _plain(values: Array) -> Any:
    """Numbers in nested lists, null for one that is not finite."""
    if values.ndim > 1:
        return [_plain(row) for row in values]
    return [float(x) if np.isfinite(x) else None for x in values]


__all__ = ["SYSTEMS", "FlightPoint", "LinearModel"]
