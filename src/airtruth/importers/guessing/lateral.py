"""Evidence of physics on the lateral-directional columns of an assignment.

With the Euler angles phi, theta, psi and the rates p, q, r in body axes (B. L. Stevens and F. L. Lewis, *Aircraft Control and
Simulation*, 2nd ed., 2003):

    phi' = p + tan(theta) (q sin(phi) + r cos(phi))
    psi' = (q sin(phi) + r cos(phi)) / cos(theta)
    v'   = ay + g cos(theta) sin(phi) - r u + p w

A right aileron that moves down rolls to the left, and a rudder whose trailing edge moves left yaws to the left.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.channels import SIGNALS
from airtruth.checks.spectra import integral
from airtruth.importers.guessing.evidence import (
    SlotFinding,
    SlotRelation,
    changes,
    compared,
    effect,
    moved,
    moves,
    near,
)
from airtruth.physics.motion import LATERAL
from airtruth.physics.motion_parts import Control
from airtruth.units import G0

Array = NDArray[np.float64]

_ROLLING, _YAWING = LATERAL.controls


def _yawing(c: Mapping[str, Array]) -> Array:
    """q sin(phi) + r cos(phi) [rad/s]."""
    phi, zero = c.get("phi", np.zeros_like(c["r"])), np.zeros_like(c["r"])
    return np.asarray(c.get("q", zero) * np.sin(phi) + c["r"] * np.cos(phi))


def _bank(c: Mapping[str, Array], dt_s: float) -> Array:
    climb = np.tan(np.clip(c["theta"], -1.4, 1.4)) * _yawing(c) if {"theta", "r"} <= c.keys() else 0.0
    return integral(c["p"] + climb, dt_s)


def _heading(c: Mapping[str, Array], dt_s: float) -> Array:
    theta = np.clip(c["theta"], -1.4, 1.4) if "theta" in c else np.zeros_like(c["r"])
    return integral(_yawing(c) / np.cos(theta), dt_s)


def _pull(c: Mapping[str, Array]) -> Array:
    """Sideways acceleration over the airspeed [rad/s]."""
    theta = c.get("theta", np.zeros_like(c["ay"]))
    return np.asarray(
        (c["ay"] + G0 * np.cos(theta) * np.sin(c["phi"])) / np.maximum(np.abs(c["airspeed"]), 1.0)
    )


def _turning(c: Mapping[str, Array]) -> Array:
    """Turn of the body about the lift's direction [rad/s]."""
    alpha, zero = c.get("alpha", np.zeros_like(c["r"])), np.zeros_like(c["r"])
    return np.asarray(c["r"] * np.cos(alpha) - c.get("p", zero) * np.sin(alpha))


def _turned(c: Mapping[str, Array], dt_s: float) -> SlotFinding:
    """The turn that bank and side force require, where no sideslip tells the rest."""
    if "beta" in c:
        return SlotFinding(0.0, "beta tells more")
    ratio, factor, share = compared(integral(_turning(c), dt_s), integral(_pull(c), dt_s), dt_s, 1)
    return SlotFinding(
        ratio, f"the turn is {factor:.3g} of that which bank and side force require (R2 {share:.2f})"
    )


def _turned_by(control: Control, usual: float, beside: Sequence[str]) -> Callable[..., SlotFinding]:
    """Test of the effect of a surface on its rate, usually of a size [1/s2], with the slots beside it that are filled held."""
    rate = SIGNALS[control.damped].stem

    def test(c: Mapping[str, Array], dt_s: float) -> SlotFinding:
        others = [name for name in beside if name != "ay" or "beta" not in c]  # ay stands for an absent beta
        held = [c[name] for name in (rate, *others) if name in c]
        return moves(*effect(c[rate], [c[control.name], *held], dt_s), usual, changes(control))

    return test


def _centred(c: Mapping[str, Array], dt_s: float) -> SlotFinding:
    mean = float(np.median(c["ay"])) / G0
    return near(mean, 0.08, 1.0, f"the median of ay is {mean:+.3f} g")


def _coordinated(c: Mapping[str, Array], dt_s: float) -> SlotFinding:
    mean = float(np.median(c["beta"]))
    return near(mean, 0.08, 0.8, f"the median of beta is {np.degrees(mean):+.1f} deg")


_BANKED = moved("phi", "the integral of p and of the turn", 2, lambda c: c["phi"], _bank)
_HEADED = moved("psi", "the integral of the turn", 2, lambda c: c["psi"], _heading)
_SLIPPED = moved(
    "beta",
    "the integral of bank, side force and turn",
    2,
    lambda c: c["beta"],
    lambda c, dt: integral(_pull(c) - _turning(c), dt),
)


def _commanded(surface: str) -> SlotRelation:
    command = f"{surface}_command"
    follows = moved(f"the {surface}", "its command", 1, lambda c: c[surface], lambda c, dt: c[command])
    return SlotRelation((surface, command), follows)


LATERAL_RELATIONS: Final = (
    SlotRelation(("ay",), _centred),
    SlotRelation(("beta",), _coordinated),
    SlotRelation(("phi", "p"), _BANKED, ("theta", "q", "r")),
    SlotRelation(("psi", "r"), _HEADED, ("theta", "q", "phi")),
    SlotRelation(("beta", "ay", "phi", "r", "airspeed"), _SLIPPED, ("p", "theta", "alpha")),
    SlotRelation(("r", "phi", "ay", "airspeed"), _turned, ("p", "theta", "alpha", "beta")),
    SlotRelation((_ROLLING.name, "p"), _turned_by(_ROLLING, 30.0, ("r", "beta")), ("r", "beta")),
    SlotRelation((_YAWING.name, "r"), _turned_by(_YAWING, 6.0, ("p", "beta", "ay")), ("p", "beta", "ay")),
    *(_commanded(control.name) for control in LATERAL.controls),
)
"""Everything that is tested of the lateral-directional motion. A relation uses further slots where they are assigned."""

__all__ = ["LATERAL_RELATIONS"]
