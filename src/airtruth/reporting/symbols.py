"""Symbols of the parameters of every motion, for LaTeX."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from airtruth.physics.motion import LATERAL
from airtruth.reporting.paper.published import SYMBOLS as PRINTED

_SIGNALS: Final[Mapping[str, str]] = {
    "beta": r"\beta",
    "p": "p",
    "r": "r",
    "da": r"\delta_a",
    "dr": r"\delta_r",
}
"""Symbol of a signal in the name of a derivative -> its symbol."""

LATERAL_SYMBOLS: Final[Mapping[str, str]] = {
    **{
        c.name + s.symbol: f"$C_{{{c.name[1:]}{_SIGNALS[s.symbol]}}}$"
        for c in LATERAL.coefficients
        for s in LATERAL.signals
    },
    "dutch_roll_wn_rad_s": r"$\omega_n$, Dutch roll",
    "dutch_roll_zeta": r"$\zeta$, Dutch roll",
    "roll_1_s": r"$\lambda$, roll",
    "spiral_1_s": r"$\lambda$, spiral",
}
"""Symbol of each parameter of the lateral-directional motion."""

SYMBOLS: Final[Mapping[str, str]] = {
    **PRINTED,
    **{
        name: symbol + ("" if LATERAL.units[name] in ("-", "1/rad") else f" [{LATERAL.units[name]}]")
        for name, symbol in LATERAL_SYMBOLS.items()
    },
}
"""Symbol of each parameter of every motion, those of modes with their units."""

__all__ = ["LATERAL_SYMBOLS", "SYMBOLS"]
