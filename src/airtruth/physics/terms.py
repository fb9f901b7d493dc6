"""Terms that an effect adds to a model, in plain values; simulation, tracing and the aircraft writer read them.

Every term has no influence at its neutral value. Signs and axes are those of the flight log: body axes, x forward, y right,
z down, nose-up positive, elevator trailing edge down positive (`airtruth.physics.motion`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, fields, replace
from typing import Final, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from airtruth.physics.motion import LATERAL, LONGITUDINAL, MOTIONS, Motion
from airtruth.physics.motion_parts import Control
from airtruth.physics.sensor_errors import Kind

Array = NDArray[np.float64]

QBAR: Final = "qbar"
"""Signal of every motion: dynamic pressure [Pa]."""


def factors_of(motion: Motion) -> tuple[str, ...]:
    """Signals by which an `AeroTerm` may be multiplied: those of the derivatives, angles before rates."""
    return tuple(s.name for s in sorted(motion.signals, key=lambda s: s.length is not None))


def drivers_of(motion: Motion) -> tuple[str, ...]:
    """Signals that may drive a `StateTerm`: `factors_of`, and the rate of the implicit state over l/(2V)."""
    return (*factors_of(motion), f"{motion.implicit[1]}_dot_hat")


def signals_of(motion: Motion) -> tuple[str, ...]:
    """Signals of an `AeroTerm`, which may name a state as well; their order numbers them for compiled code.

    Examples
    --------
    >>> signals_of(LONGITUDINAL)
    ('alpha', 'elevator', 'qhat', 'alpha_dot_hat', 'qbar')
    >>> signals_of(MOTIONS["lateral"])
    ('beta', 'aileron', 'rudder', 'phat', 'rhat', 'beta_dot_hat', 'qbar', 'alpha')
    """
    return (*drivers_of(motion), QBAR, *(s.name for s in motion.known_signals))


def measured_of(motion: Motion) -> tuple[str, ...]:
    """Signals that a log measures; a `ReadingTerm` names one of these or a state."""
    return (*factors_of(motion), QBAR, *(s.name for s in motion.known_signals))


def coefficients_of(motion: Motion) -> tuple[str, ...]:
    """Coefficients of an `AeroTerm`; the axial force of the pitch plane changes the airspeed and ax alone."""
    return (*(c.name for c in motion.coefficients), *(("CX",) if motion is LONGITUDINAL else ()))


SIGNALS: Final = signals_of(LONGITUDINAL)
"""`signals_of` the pitch plane."""
READINGS: Final = LONGITUDINAL.output_channels
"""Outputs of the filter of the pitch plane."""
OUTPUTS: Final = frozenset(channel for m in MOTIONS.values() for channel in m.output_channels)
"""Channels of a `ReadingTerm`: the outputs of every motion."""
ELEVATOR: Final = LONGITUDINAL.controls[0].name
"""Control of a `SurfaceTerm` that names none."""
_ACROSS: Final = {"arm_right": LATERAL.gyros[0]}
"""Kind of error of a position -> rate of rotation that it needs, where the channel itself does not imply it."""
SHAPES: Final = ("linear", "quadratic", "above", "below")
"""Functions f of an `AeroTerm` or a `ReadingTerm`, see `shape_of`; their order numbers them for compiled code."""
FORMULAS: Final[Mapping[str, str]] = {
    "linear": "(s - at)",
    "quadratic": "(s - at)^2",
    "above": "max(0, s - at)",
    "below": "min(0, s - at)",
}
"""The same functions as text, s the signal."""
STATE_KINDS: Final = ("lag", "mode", "play")
"""Kinds of a `StateTerm`; their order numbers them for compiled code."""
DECLARED: Final[Mapping[str, float]] = {
    name: value for m in MOTIONS.values() for name, value in m.neutral.items()
}
"""Quantity that an aircraft declares and an effect may change -> neutral value: 1 for a factor, 0 for a shift."""
LATE: Final = ("delay", "lag")
"""Kinds of terms that delay a signal."""


@dataclass(frozen=True)
class SurfaceTerm:
    """An element between the measured surface and the surface that causes the forces; several act in sequence.

    Attributes
    ----------
    kind : "delay" [s]; "lag", time constant of a first-order lag [s]; "rate_limit" [rad/s];
        "backlash", full width of the play [rad], the surface starts in its middle.
    value : neutral 0; for "rate_limit" infinite.
    control : name of the control (`airtruth.physics.motion_parts.Control`).
    """

    kind: Literal["delay", "lag", "rate_limit", "backlash"]
    value: float
    control: str = ELEVATOR


@dataclass(frozen=True)
class StateTerm:
    """A state x driven by a signal s; an `AeroTerm` or a `ReadingTerm` may name it as its signal.

    Attributes
    ----------
    name : of the state.
    kind : "lag": tau x' = s - x; "mode": x'' + 2 zeta wn x' + wn^2 x = wn^2 s; "play": x rests until |s - x| reaches a half
        width and then follows s at that distance: hysteresis, or friction. All start in equilibrium, x = s.
    signal : one of `drivers_of` a motion; of a play one of `factors_of` it.
    time_s : tau of a lag [s]; 1/wn of a mode [s]; 0 of a play.
    damping : zeta of a mode [-].
    half_width : of a play [unit of the signal].
    """

    name: str
    kind: Literal["lag", "mode", "play"]
    signal: str
    time_s: float = 0.0
    damping: float = 0.0
    half_width: float = 0.0


@dataclass(frozen=True)
class AeroTerm:
    """An increment of a coefficient: coefficient += amplitude f(signal) [(factor - factor_at)], f by `shape_of`.

    Attributes
    ----------
    coefficient : "CL" (force along -z of the body over q_bar S), "Cm" (about the CG, over q_bar S c) or "CX" (force along x of
        the body through the CG over q_bar S, which changes the airspeed and ax alone); "CY" (force along y of the body),
        "Cl", "Cn" (about the CG, over q_bar S b).
    signal : one of `signals_of` the motion, or the name of a `StateTerm`: alpha, beta [rad] of the air at the CG; elevator,
        aileron, rudder [rad] that cause the forces (surface terms and effectiveness included); qhat = q c/(2V),
        phat = p b/(2V), rhat = r b/(2V); alpha_dot_hat = alpha_dot c/(2V), beta_dot_hat = beta_dot b/(2V) of the motion over
        ground, the influence of this term on it included; zero at a trim; qbar [Pa], the dynamic pressure.
    shape : name of f, see `FORMULAS`.
    amplitude : per unit of f [and of the factor]; neutral 0.
    at : origin of f [unit of the signal].
    factor : one of `factors_of` the motion, whose derivative then depends on the signal; empty for none.
    factor_at : origin of the factor [unit of the factor].
    """

    coefficient: str
    signal: str
    shape: Literal["linear", "quadratic", "above", "below"]
    amplitude: float
    at: float = 0.0
    factor: str = ""
    factor_at: float = 0.0

    @property
    def curve(self) -> tuple[str, str, str, float] | None:
        """Key that the bends of one table share: coefficient, signal, factor and its origin; None for a term that is no bend."""
        is_bend = self.shape in ("above", "below")
        return (self.coefficient, self.signal, self.factor, self.factor_at) if is_bend else None


@dataclass(frozen=True)
class ReadingTerm:
    """An increment of a reading: channel += amplitude f(signal) [(x - s)], f by `shape_of`.

    It acts where the instrument is, before its lag, delay and scale.

    Attributes
    ----------
    channel : one of `OUTPUTS`.
    signal : one of `measured_of` a motion, as in an `AeroTerm`, or the name of a `StateTerm`.
    shape : name of f, see `FORMULAS`.
    amplitude : per unit of f [unit of the channel]; neutral 0.
    at : origin of f [unit of the signal].
    behind : name of a `StateTerm` x of a signal s; a small lag whose time constant depends on the dynamic pressure has
        f(qbar) (x - s). Empty for none.
    """

    channel: str
    signal: str
    shape: Literal["linear", "quadratic", "above", "below"]
    amplitude: float
    at: float = 0.0
    behind: str = ""


def shape_of(term: AeroTerm | ReadingTerm, signal: ArrayLike) -> Array:
    """Evaluate f of a term, without its amplitude.

    Parameters
    ----------
    term : the increment; its shape and origin count.
    signal : values of its signal, any shape [unit of the signal].

    Returns
    -------
    f, of the shape of ``signal``; see `FORMULAS`.

    Examples
    --------
    >>> shape_of(AeroTerm("Cm", "alpha", "above", -0.4, at=0.1), [0.05, 0.3]).tolist()
    [0.0, 0.19999999999999998]
    """
    return numbered_shape(SHAPES.index(term.shape), np.asarray(signal, dtype=np.float64) - term.at)


def term_value(term: AeroTerm, signals: Mapping[str, Array]) -> Array:
    """Increment of a coefficient by a term [-], of the shape of the signals.

    Parameters
    ----------
    signals : name -> values of one shape, those that the term names among them.

    Examples
    --------
    >>> pair = AeroTerm("Cm", "alpha", "above", -2.0, at=0.1, factor="elevator", factor_at=0.02)
    >>> term_value(pair, {"alpha": np.array([0.05, 0.2]), "elevator": np.array([0.12, 0.12])}).round(
    ...     12
    ... ).tolist()
    [-0.0, -0.02]
    """
    value = term.amplitude * shape_of(term, signals[term.signal])
    return np.asarray(value * (signals[term.factor] - term.factor_at) if term.factor else value)


def numbered_shape(number: int, s: Array) -> Array:
    """f by its number in `SHAPES`, s counted from the origin; the tracer's filter compiles it for single numbers."""
    if number == 1:
        return s * s
    if number == 2:
        return np.maximum(s, 0.0)
    if number == 3:
        return np.minimum(s, 0.0)
    return s


@dataclass(frozen=True)
class DeclaredTerm:
    """An error of a declared quantity.

    Attributes
    ----------
    quantity : key of `DECLARED`. "mass", "inertia" (Iyy), "inertia_xx", "inertia_zz", the name of a control (all forces and
        moments of the surface's deflection from trim): a factor, neutral 1. "inertia_xz": increment of Ixz over the square
        root of Ixx Izz; "cg": shift of the CG aft [chords]; "cg_y": to the right [m]; "load_y": shift of the normal force to the
        left [m]; "thrust_arm": shift of the thrust line down, nose-up positive [m]; "yaw_moment": constant yawing moment, nose
        right [N m]: neutral 0. Sensors keep their position relative to the CG; a `SensorTerm` moves them.
    """

    quantity: str
    value: float


def declared_total(terms: Iterable[DeclaredTerm], quantity: str) -> float:
    """All terms of a declared quantity together: the product of factors, the sum of shifts.

    Examples
    --------
    >>> declared_total(
    ...     [DeclaredTerm("mass", 1.5), DeclaredTerm("cg", 0.1), DeclaredTerm("mass", 2.0)], "mass"
    ... )
    3.0
    """
    total = DECLARED[quantity]
    for term in terms:
        if term.quantity == quantity:
            total = total * term.value if DECLARED[quantity] == 1.0 else total + term.value
    return total


@dataclass(frozen=True)
class DerivativeTerm:
    """A cause that changes derivatives by an amount that depends on the aircraft and its trim.

    `airtruth.physics.resolution.resolved` turns it into linear `AeroTerm`s; the simulator, the filter and the aircraft
    writer take those only.

    Attributes
    ----------
    cause : key of `airtruth.physics.composition.CAUSES`: "tail", "wing" (lift and moment of the part) and
        "dynamic_pressure": a factor, neutral 1. "aerodynamic_center": its shift aft [chords]; "icing": severity, 1 for the
        reference ice; the name of a derivative: its increment: neutral 0.
    value : see ``cause``.
    """

    cause: str
    value: float


@dataclass(frozen=True)
class SensorTerm:
    """An error of a sensor beyond those that aircraft.toml declares.

    Attributes
    ----------
    channel : column of the log.
    kind : "bias" [unit of the channel]; "scale", a factor; "lag", time constant [s]; "delay" [s]; "arm", "arm_right",
        "arm_down", position ahead of, right of and below the CG [m] (alpha_rad: alpha - q x/V + p y/V; az_m_s2: az - x q_dot;
        beta_rad: beta + r x/V - p z/V; ay_m_s2: ay + x r_dot - z p_dot).
    value : neutral 0, for "scale" 1.
    """

    channel: str
    kind: Kind
    value: float

    @property
    def rate(self) -> str:
        """Rate of rotation that brings the error about where the channel itself does not imply it; empty elsewhere."""
        return _ACROSS.get(self.kind, "")


@dataclass(frozen=True)
class AirTerm:
    """An error of a declared gust level.

    Attributes
    ----------
    level : standard deviation of a gust component.
    factor : on the declared level [-]; neutral 1. A declared level of zero counts as that of the other component.
    """

    level: Literal["sigma_u", "sigma_v", "sigma_w"]
    factor: float


def entries(term: SurfaceTerm | StateTerm | AeroTerm | ReadingTerm) -> Mapping[str, object]:
    """Entries of a term in a file; a surface term of the elevator names no control.

    Examples
    --------
    >>> entries(SurfaceTerm("delay", 0.06)), entries(SurfaceTerm("lag", 0.1, "rudder"))
    ({'kind': 'delay', 'value': 0.06}, {'kind': 'lag', 'value': 0.1, 'control': 'rudder'})
    """
    return {k: v for k, v in asdict(term).items() if (k, v) != ("control", ELEVATOR)}


@dataclass(frozen=True)
class Change:
    """All terms of one or several effects."""

    surface: tuple[SurfaceTerm, ...] = ()
    states: tuple[StateTerm, ...] = ()
    aero: tuple[AeroTerm, ...] = ()
    declared: tuple[DeclaredTerm, ...] = ()
    derivatives: tuple[DerivativeTerm, ...] = ()
    sensors: tuple[SensorTerm, ...] = ()
    readings: tuple[ReadingTerm, ...] = ()
    air: tuple[AirTerm, ...] = ()

    def __add__(self, other: Change) -> Change:
        """Return the terms of both changes; the surface terms of the first act first."""
        return Change(**{f.name: getattr(self, f.name) + getattr(other, f.name) for f in fields(Change)})

    @property
    def in_aircraft(self) -> bool:
        """Whether it changes the JSBSim model itself, and not its sensors or the air alone."""
        return bool(self.surface or self.aero or self.declared or self.derivatives)

    def of_surface(self, control: str) -> tuple[SurfaceTerm, ...]:
        """The surface terms of one control."""
        return tuple(term for term in self.surface if term.control == control)

    def surface_path(self, control: Control = LONGITUDINAL.controls[0]) -> tuple[SurfaceTerm, ...]:
        """Elements between the reading of a control and the air: a late reading is a negative delay before `surface`.

        Examples
        --------
        >>> late = Change(sensors=(SensorTerm("rudder_rad", "delay", 0.02),))
        >>> late.surface_path(MOTIONS["lateral"].controls[1]), late.surface_path()
        ((SurfaceTerm(kind='delay', value=-0.02, control='rudder'),), ())
        """
        own = self.of_surface(control.name)
        late = sum(t.value for t in self.sensors if (t.channel, t.kind) == (control.channel, "delay"))
        return (SurfaceTerm("delay", -late, control.name), *own) if late != 0.0 else own

    def names(self) -> frozenset[str]:
        """Every name of its terms that a motion has to have; states of its own are none."""
        found = {t.quantity for t in self.declared} | {t.cause for t in self.derivatives}
        found |= {t.channel for t in self.sensors} | {t.level for t in self.air}
        found |= {t.control for t in self.surface}
        found |= {t.rate for t in self.sensors}
        found |= {name for r in self.readings for name in (r.channel, r.signal)} | {
            x.signal for x in self.states
        }
        found |= {name for t in self.aero for name in (t.coefficient, t.signal, t.factor)}
        return frozenset(found - {"", *(state.name for state in self.states)})

    @property
    def in_motion(self) -> Change:
        """The change without its readings and the states that they alone read."""
        signals = {term.signal for term in self.aero}
        states = tuple(s for s in self.states if s.name in signals)
        return replace(self, states=states, readings=())
