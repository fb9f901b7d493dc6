"""The effects that a truth may have, each in the truth's own terms; the library's names, and some it lacks."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Final

from validation.blind import causes, states
from validation.blind.aircraft_xml import Body, Shape, linear
from validation.blind.figures import ALPHA_TRIM_RAD, DEG
from validation.blind.flight import Model, Start
from validation.blind.sensors import Fault

Values = Mapping[str, float]


@dataclass(frozen=True)
class Parts:
    """What one effect, or several, put into a truth."""

    chain: tuple[tuple[str, float], ...] = ()
    shapes: tuple[Shape, ...] = ()
    faults: tuple[Fault, ...] = ()
    states: tuple[Start, ...] = ()
    mass: float = 1.0
    inertia: float = 1.0
    cg: float = 0.0
    elevator: float = 1.0
    thrust_arm_m: float = 0.0

    def __add__(self, other: Parts) -> Parts:
        return Parts(
            self.chain + other.chain,
            self.shapes + other.shapes,
            self.faults + other.faults,
            self.states + other.states,
            self.mass * other.mass,
            self.inertia * other.inertia,
            self.cg + other.cg,
            self.elevator * other.elevator,
            self.thrust_arm_m + other.thrust_arm_m,
        )


@dataclass(frozen=True)
class Added:
    """An effect of a truth: its key in `EFFECTS`, and its parameters by their public names."""

    key: str
    values: Mapping[str, float]

    @property
    def name(self) -> str:
        """The public name, without a variant."""
        return self.key.split(":")[0]


@dataclass(frozen=True)
class Kind:
    """One kind of effect.

    Attributes
    ----------
    parts : parameters -> what it puts into the truth.
    values : size, fraction in [0, 1) for anything else that is drawn -> parameters.
    largest : largest size [same unit].
    signed : sizes of either sign.
    library : whether a tracer is meant to know it.
    smooth : what it does grows in proportion to its size, while small.
    pooled : whether single effects, pairs and clutter are drawn from it.
    """

    parts: Callable[[Values], Parts]
    values: Callable[[float, float], dict[str, float]]
    largest: float
    signed: bool = True
    library: bool = True
    smooth: bool = True
    pooled: bool = True


def _alone(name: str) -> Callable[[float, float], dict[str, float]]:
    return lambda size, _: {name: size}


def _damping(name: str) -> Callable[[float, float], dict[str, float]]:
    """A downwash that arrives late damps, whatever sign is drawn."""
    return lambda size, _: {name: -abs(size)}


def _factor(size: float, _: float) -> dict[str, float]:
    return {"factor": 1.0 + size}


def _break(name: str) -> Callable[[float, float], dict[str, float]]:
    return lambda size, draw: {name: size, "at_alpha_rad": ALPHA_TRIM_RAD + (draw * 2.0 - 0.5) * DEG}


def _sensor(channel: str, kind: str, parameter: str) -> Callable[[Values], Parts]:
    return lambda v: Parts(faults=(Fault(channel, kind, v[parameter]),))


def _shape(coefficient: str, shape: str, parameter: str) -> Callable[[Values], Parts]:
    def parts(v: Values) -> Parts:
        about_trim = shape in ("alpha-square", "alpha-elevator")
        at = v.get("at_alpha_rad", ALPHA_TRIM_RAD if about_trim else 0.0)
        return Parts(shapes=(Shape(coefficient, shape, v[parameter], at),))

    return parts


def _lag_values(size: float, _: float) -> dict[str, float]:
    return {"bandwidth_hz": 1.0 / (2.0 * math.pi * size)}


def _lag_parts(v: Values) -> Parts:
    return Parts(chain=(("lag", 1.0 / (2.0 * math.pi * v["bandwidth_hz"])),))


def _cause(
    key: str, values: Callable[[float, float], dict[str, float]], largest: float, signed: bool = False
) -> Kind:
    """A cause that moves several derivatives together."""
    return Kind(
        lambda v: Parts(shapes=linear(causes.increments(key, v))), values, largest, signed, pooled=False
    )


def _further(parts: Callable[[Values], Parts], name: str, largest: float, signed: bool = True) -> Kind:
    """An effect of the mode `unmodelled` alone: neither the library nor the older pools hold it."""
    return Kind(parts, _alone(name), largest, signed, library=False, pooled=False)


EFFECTS: Final[dict[str, Kind]] = {
    "elevator_delay": Kind(
        lambda v: Parts(chain=(("delay", v["delay_s"]),)),
        _alone("delay_s"),
        0.08,
        signed=False,
    ),
    "actuator_lag": Kind(_lag_parts, _lag_values, 0.08, signed=False),
    "rate_limit": Kind(
        lambda v: Parts(chain=(("rate_limit", v["rate_rad_s"]),)),
        lambda size, _: {"rate_rad_s": 1.0 / size},
        4.0,
        signed=False,
        smooth=False,
    ),
    "backlash": Kind(
        lambda v: Parts(chain=(("backlash", v["width_rad"]),)),
        _alone("width_rad"),
        0.02,
        signed=False,
        smooth=False,
    ),
    "elevator_effectiveness": Kind(lambda v: Parts(elevator=v["factor"]), _factor, 0.4),
    "elevator_asymmetry": Kind(_shape("Cm", "elevator-below", "dCmde"), _alone("dCmde"), 1.2),
    "cm_alpha_nonlinear:break": Kind(_shape("Cm", "alpha-above", "dCmalpha"), _break("dCmalpha"), 1.5),
    "cm_alpha_nonlinear:quadratic": Kind(_shape("Cm", "alpha-square", "Cmalpha2"), _alone("Cmalpha2"), 12.0),
    "cl_alpha_nonlinear:break": Kind(_shape("CL", "alpha-above", "dCLalpha"), _break("dCLalpha"), 3.5),
    "cl_alpha_nonlinear:quadratic": Kind(_shape("CL", "alpha-square", "CLalpha2"), _alone("CLalpha2"), 25.0),
    "downwash_lag": Kind(_shape("Cm", "alphadot", "Cmalphadot"), _damping("Cmalphadot"), 35.0),
    "thrust_moment": Kind(lambda v: Parts(thrust_arm_m=v["arm_m"]), _alone("arm_m"), 0.2),
    "cg_shift": Kind(lambda v: Parts(cg=v["dx_mac"]), _alone("dx_mac"), 0.06),
    "inertia_error": Kind(lambda v: Parts(inertia=v["factor"]), _factor, 0.3),
    "mass_error": Kind(lambda v: Parts(mass=v["factor"]), _factor, 0.12),
    "vane_arm": Kind(_sensor("alpha_rad", "arm", "x_m"), _alone("x_m"), 1.5),
    "vane_lag": Kind(_sensor("alpha_rad", "lag", "tau_s"), _alone("tau_s"), 0.06, signed=False),
    "gyro_lag": Kind(_sensor("q_rad_s", "lag", "tau_s"), _alone("tau_s"), 0.06, signed=False),
    "accelerometer_lag": Kind(_sensor("az_m_s2", "lag", "tau_s"), _alone("tau_s"), 0.06, signed=False),
    "vane_scale": Kind(_sensor("alpha_rad", "scale", "factor"), _factor, 0.25),
    "gyro_scale": Kind(_sensor("q_rad_s", "scale", "factor"), _factor, 0.25),
    "accelerometer_scale": Kind(_sensor("az_m_s2", "scale", "factor"), _factor, 0.2),
    "airspeed_scale": Kind(_sensor("airspeed_m_s", "scale", "factor"), _factor, 0.15),
    "accelerometer_arm": Kind(_sensor("az_m_s2", "arm", "x_m"), _alone("x_m"), 1.0),
    "sensor_delay:alpha_rad": Kind(
        _sensor("alpha_rad", "delay", "delay_s"), _alone("delay_s"), 0.06, signed=False
    ),
    "sensor_delay:q_rad_s": Kind(
        _sensor("q_rad_s", "delay", "delay_s"), _alone("delay_s"), 0.06, signed=False
    ),
    "sensor_delay:az_m_s2": Kind(
        _sensor("az_m_s2", "delay", "delay_s"), _alone("delay_s"), 0.06, signed=False
    ),
    "structural_mode": Kind(
        lambda v: Parts(faults=(Fault("q_rad_s", "mode", v["gain_s"], v["frequency_hz"]),)),
        lambda size, draw: {"gain_s": size, "frequency_hz": 5.0 + 5.0 * draw},
        0.03,
        library=False,
    ),
    "hinge_blowback": Kind(
        _shape("Cm", "elevator-odd-square", "Cmde2"), _alone("Cmde2"), 15.0, library=False
    ),
    "cm_hysteresis": Kind(
        lambda v: Parts(states=(states.hysteresis(v["Cmplay"], 2.0 * DEG),)),
        _alone("Cmplay"),
        1.2,
        library=False,
    ),
    "fuel_slosh": Kind(
        lambda v: Parts(states=(states.slosh(v["gain"], v["frequency_hz"]),)),
        lambda size, draw: {"gain": size, "frequency_hz": 1.0 + 2.0 * draw},
        15.0,
        library=False,
    ),
    "thrust_lag": Kind(
        lambda v: Parts(states=(states.thrust_lag(v["gain"], 0.5),)),
        _alone("gain"),
        1.2,
        library=False,
    ),
    "separation_switch": Kind(
        lambda v: Parts(states=(states.switch(v["dCm"], 0.5 * v["dCm"]),)),
        _alone("dCm"),
        0.04,
        library=False,
    ),
    "vane_friction": Kind(
        _sensor("alpha_rad", "friction", "width_rad"),
        _alone("width_rad"),
        0.02,
        signed=False,
        smooth=False,
        library=False,
    ),
    "stall_state": _further(lambda v: Parts(states=(states.stall(v["dCL"]),)), "dCL", 1.0, signed=False),
    "cg_drift": _further(lambda v: Parts(states=(states.drifting_cg(v["rate_mac_s"]),)), "rate_mac_s", 0.02),
    "elevator_in_wake": _further(_shape("Cm", "alpha-elevator", "Cmalphade"), "Cmalphade", 20.0),
    "vane_curve": _further(_sensor("alpha_rad", "curve", "curve_per_rad"), "curve_per_rad", 5.0),
    "gyro_g_sensitivity": _further(_sensor("q_rad_s", "cross", "rad_s_per_m_s2"), "rad_s_per_m_s2", 0.02),
    "tail_effectiveness": _cause("tail_effectiveness", causes.tail_values, 0.45),
    "wing_effectiveness": _cause("wing_effectiveness", causes.tail_values, 0.4),
    "icing": _cause("icing", causes.ice_values, 3.5),
    "derivatives": _cause("derivatives", causes.derivative_values, 0.3, signed=True),
}


def shrunk(effect: Added, share: float) -> Added:
    """The effect with a share of its size."""
    values = dict(effect.values)
    if effect.key == "derivatives":
        return Added(effect.key, {name: share * value for name, value in values.items()})
    first = next(iter(values))
    if first == "factor":
        values[first] = 1.0 + share * (values[first] - 1.0)
    else:
        values[first] *= 1.0 / share if first in ("bandwidth_hz", "rate_rad_s") else share
    return Added(effect.key, values)


LIBRARY: Final = tuple(key for key, kind in EFFECTS.items() if kind.library and kind.pooled)
OFF_LIBRARY: Final = tuple(key for key, kind in EFFECTS.items() if not kind.library and kind.pooled)
FURTHER: Final = tuple(key for key, kind in EFFECTS.items() if not kind.library and not kind.pooled)
"""Effects outside the library that joined after the frozen trials, whose draws depend on the pools above."""


def combined(effects: Iterable[Added]) -> Parts:
    """What several effects put into a truth together."""
    total = Parts()
    for effect in effects:
        total += EFFECTS[effect.key].parts(effect.values)
    return total


def model(body: Body, parts: Parts) -> Model:
    """The aircraft of a truth: its draws and its effects."""
    body = replace(
        body, mass=body.mass * parts.mass, inertia=body.inertia * parts.inertia, cg=body.cg + parts.cg
    )
    return Model(body, parts.shapes, parts.elevator, parts.thrust_arm_m, parts.states)
