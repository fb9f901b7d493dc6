"""What an effect changes, in plain values: terms that whoever flies, traces or writes an aircraft reads.

Every term does nothing at its neutral value. Signs and axes are those of the flight log: body axes, x
forward, z down, nose-up positive, elevator trailing edge down positive.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Final, Literal

SURFACE_KINDS: Final = ("delay", "lag", "rate_limit", "backlash")
SIGNALS: Final = ("alpha", "elevator", "qhat", "alpha_dot_hat")
SHAPES: Final = ("linear", "quadratic", "above", "below")
STATE_KINDS: Final = ("lag", "mode")
SENSOR_KINDS: Final = ("bias", "scale", "lag", "delay", "arm")
DECLARED: Final = ("mass", "inertia", "elevator", "cg", "thrust_arm")
AIR: Final = ("sigma_u", "sigma_w")


@dataclass(frozen=True)
class SurfaceTerm:
    """What lies between the surface that is measured and the surface that the air sees, in sequence.

    Attributes
    ----------
    kind : "delay" [s]; "lag", time constant of a first-order lag [s]; "rate_limit" [rad/s];
        "backlash", full width of the play [rad], the surface starts in its middle.
    value : neutral 0, for "rate_limit" infinite.
    """

    kind: Literal["delay", "lag", "rate_limit", "backlash"]
    value: float


@dataclass(frozen=True)
class StateTerm:
    """A state of its own, driven by a signal s, that an `AeroTerm` can take as its signal by name.

    Attributes
    ----------
    name : of the state.
    kind : "lag": tau x' = s - x; "mode": x'' + 2 zeta wn x' + wn^2 x = wn^2 s. Both start in equilibrium.
    signal : one of `SIGNALS`.
    time_s : tau of a lag [s]; 1/wn of a mode [s].
    damping : zeta of a mode [-].
    """

    name: str
    kind: Literal["lag", "mode"]
    signal: str
    time_s: float
    damping: float = 0.0


@dataclass(frozen=True)
class AeroTerm:
    """An increment of a coefficient: coefficient += amplitude f(signal).

    Attributes
    ----------
    coefficient : "CL" (force along -z of the body over q_bar S) or "Cm" (about the CG, over q_bar S c).
    signal : one of `SIGNALS` or the name of a `StateTerm`; alpha [rad] of the air at the CG, elevator [rad] as
        the air sees it (surface terms and effectiveness in it), qhat = q c/(2V), alpha_dot_hat = alpha_dot c/(2V)
        of the motion over ground, what this term does to it included; zero at a trim.
    shape : with s the signal, "linear": s - at; "quadratic": (s - at)^2; "above": max(0, s - at);
        "below": min(0, s - at).
    amplitude : per unit of f; neutral 0.
    at : origin of f [unit of the signal].
    """

    coefficient: Literal["CL", "Cm"]
    signal: str
    shape: Literal["linear", "quadratic", "above", "below"]
    amplitude: float
    at: float = 0.0


@dataclass(frozen=True)
class DeclaredTerm:
    """A declared quantity is another.

    Attributes
    ----------
    quantity : "mass", "inertia" (Iyy), "elevator" (all forces and moments of the surface's deflection
        from trim): a factor, neutral 1; "cg": CG aft of where it is declared, in chords; "thrust_arm": thrust passes
        so much below the CG than declared [m], nose-up positive: neutral 0. Sensors keep their place
        relative to the CG.
    """

    quantity: Literal["mass", "inertia", "elevator", "cg", "thrust_arm"]
    value: float


@dataclass(frozen=True)
class SensorTerm:
    """What a sensor does that aircraft.toml does not declare; it adds to what is declared.

    Attributes
    ----------
    channel : column of the log.
    kind : "bias" [unit of the channel]; "scale", a factor; "lag", time constant [s]; "delay" [s]; "arm",
        position ahead of the CG [m] (alpha_rad: alpha - q x/V; az_m_s2: az - x q_dot).
    value : neutral 0, for "scale" 1.
    """

    channel: str
    kind: Literal["bias", "scale", "lag", "delay", "arm"]
    value: float


@dataclass(frozen=True)
class AirTerm:
    """The air is rougher or smoother than declared.

    Attributes
    ----------
    level : "sigma_u" or "sigma_w", standard deviation of a gust component.
    factor : on the declared level [-]; neutral 1. A level that is declared as none has the other's as its unit.
    """

    level: Literal["sigma_u", "sigma_w"]
    factor: float


@dataclass(frozen=True)
class Change:
    """All that one effect, or several, change."""

    surface: tuple[SurfaceTerm, ...] = ()
    states: tuple[StateTerm, ...] = ()
    aero: tuple[AeroTerm, ...] = ()
    declared: tuple[DeclaredTerm, ...] = ()
    sensors: tuple[SensorTerm, ...] = ()
    air: tuple[AirTerm, ...] = ()

    def __add__(self, other: Change) -> Change:
        """Both changes; surface terms of the first come first."""
        return Change(**{f.name: getattr(self, f.name) + getattr(other, f.name) for f in fields(Change)})

    @property
    def in_aircraft(self) -> bool:
        """Whether it changes the JSBSim model itself, and not only its sensors or the air."""
        return bool(self.surface or self.states or self.aero or self.declared)
