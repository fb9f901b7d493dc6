"""Causes that move several derivatives together, by a build-up of body, wing and tail of the truth's own; their draws.

Sums of the textbooks (Etkin and Reid, Dynamics of Flight, 3rd ed., 1996, ch. 2 and 5): the tail at arm l carries
a (1 - e) alpha and 2 a l q c/(2V), a = efficiency times its isolated slope by the wing area, e the slope of the
downwash, which follows the wing's lift. Arm, efficiency, downwash and the body's part are drawn about usual values, so
that a tracer, which infers them from the derivatives, has them about right.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from validation.blind.figures import DERIVATIVES

Values = Mapping[str, float]

COMPOSITIONS: Final = ("derivative", "composite", "triple", "slow")
"""Modes whose trials have a set of effects, scored as a set."""
DECLARED: Final = {name: value for name, (value, _) in DERIVATIVES.items()}
ARM_MAC: Final = 3.72  # Cmde/CLde of the declared aircraft
_ISOLATED: Final = 1.47  # 1/rad: 90 % of the declared Cmq at that arm and an efficiency of 0.92
_ARM: Final = (0.95, 1.05)  # over ARM_MAC
_EFFICIENCY: Final = (0.86, 0.98)
_DOWNWASH: Final = (0.25, 0.42)
_BODY_LIFT: Final = (0.03, 0.10)  # share of the body in the lift of wing and body
_BODY_MOMENT: Final = (-0.05, 0.20)  # and in their moment
_ICE: Final = {
    "CLalpha": -0.100,
    "CLq": -0.0135,
    "CLde": -0.095,
    "Cmalpha": -0.099,
    "Cmq": -0.035,
    "Cmde": -0.100,
}
"""Twin Otter with ice, relative change of each derivative (Bragg et al., AIAA 2000-0360, table 1)."""
_ICE_SCATTER: Final = 0.15
SHARES: Final = tuple(f"share_{name}" for name in _ICE)
"""What each relative change is multiplied by in a trial."""

_LOST_TAIL: Final = (0.12, 0.50)
_LOST_WING: Final = (0.14, 0.40)
_ICING: Final = (1.4, 3.5)
_LOADING: Final = {"cg_shift": (0.08, 0.14), "mass_error": (0.06, 0.20), "inertia_error": (0.15, 0.35)}
_KINDS: Final = {"tail_effectiveness": 0.35, "wing_effectiveness": 0.2, "icing": 0.15, "loading": 0.3}
_STABLE: Final = 0.8  # of the declared Cmalpha, the most that a lost tail may take
_OFF: Final = (0.02, 0.30)
_LEAST: Final = (
    33.0,
    42.0,
)  # squares of shifts over declared standard deviations: of one, summed over several
_TIMES: Final = (0.2, 0.8)  # lag over the time constant of the short period
_LATE_S: Final = (0.03, 0.10)
TIME_CONSTANT_S: Final = 0.39
"""1/(zeta wn) of the declared short period, from half the trace of the linear model."""
FAMILIES: Final = (
    ("elevator_delay", "actuator_lag"),
    ("rate_limit",),
    ("backlash",),
    ("elevator_effectiveness", "elevator_asymmetry"),
    ("cm_alpha_nonlinear:break", "cm_alpha_nonlinear:quadratic"),
    ("cl_alpha_nonlinear:break", "cl_alpha_nonlinear:quadratic"),
    ("downwash_lag",),
    ("inertia_error",),
    ("vane_arm", "vane_lag", "sensor_delay:alpha_rad"),
    ("gyro_lag", "sensor_delay:q_rad_s"),
    ("accelerometer_lag", "sensor_delay:az_m_s2"),
    ("vane_scale",),
    ("gyro_scale",),
    ("accelerometer_scale", "mass_error"),
    ("accelerometer_arm",),
)
"""Effects of one row resemble each other: a triple has at most one of each."""


def tail(v: Values) -> dict[str, float]:
    """The tail's contribution to the six derivatives."""
    a, arm = v["efficiency"] * _ISOLATED, v["arm_mac"]
    lift, rate = a * (1.0 - v["downwash"]), 2.0 * a * arm
    return {
        "CLalpha": lift,
        "CLq": rate,
        "CLde": DECLARED["CLde"],
        "Cmalpha": -arm * lift,
        "Cmq": -arm * rate,
        "Cmde": DECLARED["Cmde"],
    }


def wing(v: Values) -> dict[str, float]:
    """The wing's contribution: what the tail leaves, less the body's part; its downwash unloads the tail."""
    of_tail = tail(v)
    rest = {name: DECLARED[name] - of_tail[name] for name in DECLARED}
    bent = v["efficiency"] * _ISOLATED * v["downwash"]
    lift, moment = 1.0 - v["body_lift"], 1.0 - v["body_moment"]
    return {
        "CLalpha": lift * rest["CLalpha"] - bent,
        "CLq": lift * rest["CLq"],
        "CLde": 0.0,
        "Cmalpha": moment * rest["Cmalpha"] + v["arm_mac"] * bent,
        "Cmq": lift * rest["Cmq"],
        "Cmde": 0.0,
    }


def increments(key: str, v: Values) -> dict[str, float]:
    """What a cause adds to the six derivatives; nothing by an effect of another kind."""
    if key == "derivatives":
        return {name.removeprefix("d"): value for name, value in v.items()}
    if key == "icing":
        shares = zip(_ICE.items(), SHARES, strict=True)
        return {name: v["severity"] * k * v[share] * DECLARED[name] for (name, k), share in shares}
    if key in ("tail_effectiveness", "wing_effectiveness"):
        part = tail(v) if key == "tail_effectiveness" else wing(v)
        return {name: (v["factor"] - 1.0) * value for name, value in part.items()}
    return {}


def tail_values(lost: float, position: float) -> dict[str, float]:
    """A tail or wing that lost a share; geometry at a position between 0 and 1 of each range."""

    def at(ends: tuple[float, float]) -> float:
        return ends[0] + position * (ends[1] - ends[0])

    return {
        "factor": 1.0 - lost,
        "arm_mac": ARM_MAC * at(_ARM),
        "efficiency": at(_EFFICIENCY),
        "downwash": at(_DOWNWASH),
        "body_lift": at(_BODY_LIFT),
        "body_moment": at(_BODY_MOMENT),
    }


def ice_values(severity: float, _: float) -> dict[str, float]:
    """Ice as measured on the Twin Otter."""
    return {"severity": severity} | dict.fromkeys(SHARES, 1.0)


def derivative_values(share: float, _: float) -> dict[str, float]:
    """All derivatives off by a share."""
    return {f"d{name}": share * value for name, value in DECLARED.items()}


def draw_derivatives(rng: np.random.Generator) -> dict[str, float]:
    """One to six derivatives off by 2 to 30 %, together clearly more than their declared uncertainty."""
    count = int(rng.integers(1, len(DECLARED) + 1))
    while True:
        names = [str(name) for name in rng.choice(list(DECLARED), count, replace=False)]
        off = rng.uniform(*_OFF, count) * rng.choice([-1.0, 1.0], count)
        shown = sum((x / DERIVATIVES[name][1]) ** 2 for name, x in zip(names, off, strict=True))
        if shown >= _LEAST[count > 1]:
            return {f"d{name}": float(x) * DECLARED[name] for name, x in zip(names, off, strict=True)}


def draw_composite(rng: np.random.Generator) -> list[tuple[str, dict[str, float]]]:
    """A tail, a wing, ice, or CG, mass and inertia together."""
    kind = str(rng.choice(list(_KINDS), p=list(_KINDS.values())))
    if kind == "loading":
        signed = {key: float(rng.uniform(*ends) * rng.choice([-1.0, 1.0])) for key, ends in _LOADING.items()}
        return [
            ("cg_shift", {"dx_mac": signed["cg_shift"]}),
            ("mass_error", {"factor": 1.0 + signed["mass_error"]}),
            ("inertia_error", {"factor": 1.0 + signed["inertia_error"]}),
        ]
    if kind == "icing":
        shares = 1.0 + _ICE_SCATTER * rng.uniform(-1.0, 1.0, len(SHARES))
        severity = float(np.exp(rng.uniform(*np.log(_ICING))))
        return [(kind, {"severity": severity} | dict(zip(SHARES, shares.tolist(), strict=True)))]
    lost = float(np.exp(rng.uniform(*np.log(_LOST_TAIL if kind == "tail_effectiveness" else _LOST_WING))))
    values = {
        "factor": 1.0,
        "arm_mac": ARM_MAC * float(rng.uniform(*_ARM)),
        "efficiency": float(rng.uniform(*_EFFICIENCY)),
        "downwash": float(rng.uniform(*_DOWNWASH)),
        "body_lift": float(rng.uniform(*_BODY_LIFT)),
        "body_moment": float(rng.uniform(*_BODY_MOMENT)),
    }
    if kind == "tail_effectiveness":
        lost = min(lost, _STABLE * DECLARED["Cmalpha"] / tail(values)["Cmalpha"])
    return [(kind, values | {"factor": 1.0 - lost})]


def draw_slow(rng: np.random.Generator) -> list[tuple[str, dict[str, float]]]:
    """A slow vane or gyro, and a surface that acts late."""
    sensor = str(rng.choice(["vane_lag", "gyro_lag"]))
    return [
        (sensor, {"tau_s": TIME_CONSTANT_S * float(rng.uniform(*_TIMES))}),
        ("elevator_delay", {"delay_s": float(rng.uniform(*_LATE_S))}),
    ]
