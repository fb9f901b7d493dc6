"""What the trials hold fixed: declared values and their uncertainty, air, sensors, the flight condition."""

from __future__ import annotations

from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parents[2]
DECLARED: Final = ROOT / "aircraft" / "gtm"

FT: Final = 0.3048
INCH: Final = 0.0254
LB: Final = 0.45359237
SLUG: Final = 14.593902937206364
DEG: Final = 0.017453292519943295
KT: Final = 1852.0 / 3600.0
G: Final = 9.80665

EAS_M_S: Final = 75.0 * KT
ALTITUDE_FT: Final = 7000.0
ALPHA_TRIM_RAD: Final = 5.570 * DEG
"""Of the declared aircraft; origin of the linear increments below."""
CHORD_M: Final = 0.9153 * FT
SPAN_M: Final = 6.8488 * FT
CG_IN: Final = (56.9697, 0.0, 11.7132)
REFERENCE_IN: Final = (57.3003, 0.0, 11.2812)

DERIVATIVES: Final = {
    "CLalpha": (4.793, 0.05),
    "CLq": (30.77, 0.30),
    "CLde": (0.480, 0.10),
    "Cmalpha": (-1.790, 0.05),
    "Cmq": (-41.38, 0.15),
    "Cmde": (-1.787, 0.05),
}
"""Declared value about the CG and relative standard deviation."""
BODY: Final = {"mass": 0.01, "inertia": 0.03, "cg": 0.005}
"""Standard deviation of mass and inertia (relative) and of the CG [chords]."""

SIGMA_M_S: Final = {"calm": (0.0, 0.0), "light": (1.1659, 0.8118), "moderate": (2.3318, 1.6236)}
"""sigma_u, sigma_w at 7000 ft, TM-4511 severe times the GTM simulator's gains."""
LENGTH_M: Final = (911.218, 840.419)

STEP_S: Final = 0.001
LOG_STEP_S: Final = 0.02
CHANNELS: Final = ("alpha_rad", "q_rad_s", "az_m_s2")
NOISE: Final = {
    "airspeed_m_s": 0.06 * KT,
    "alpha_rad": 0.031 * DEG,
    "theta_rad": 0.02 * DEG,
    "q_rad_s": 0.3857 * DEG,
    "ax_m_s2": 0.0016 * G,
    "az_m_s2": 0.0082 * G,
    "elevator_rad": 0.01 * DEG,
    "altitude_m": 2.36 * FT,
}
"""White, 1 sigma, as aircraft/gtm/aircraft.toml declares it."""
BIAS: Final = {
    "airspeed_m_s": 0.07 * KT,
    "theta_rad": -0.09 * DEG,
    "q_rad_s": 0.1547 * DEG,
    "ax_m_s2": 0.0162 * G,
    "az_m_s2": 0.0009 * G,
}
QUANTUM: Final = {"alpha_rad": 0.05 * DEG, "q_rad_s": 0.3 * DEG, "az_m_s2": 0.01 * G}
"""Steps of the quantised sensors."""
CONDITIONS: Final = ("drift", "loop", "coarse")
"""Modes of one effect or none, in records that are not at one airspeed, not in open loop, or not at 50 Hz."""
LEAVE_ONE_OUT: Final = "leave-one-out"
"""Mode in which the true effect, a single one, is withheld from the tracer's library."""
WITHHELD: Final = "withheld.json"
"""File beside the log of such a trial: the public names that are withheld."""
STRONG: Final = 30.0
"""Noncentrality above which an effect has to be found."""
BEYOND: Final = "beyond the library"
"""Key among the noncentralities of an effect that the library lacks: what its best member leaves."""
TOGETHER: Final = "together"
"""Key of the noncentrality of all effects of a trial."""
APART: Final = "beyond its rivals"
"""The same of a single effect of the library: what the best effect of another name leaves; the least of the three of a triple."""


def held_out(records: int) -> tuple[int, ...]:
    """Records that a tracer holds out: every third, or the second of two."""
    return (1,) if records == 2 else tuple(range(2, records, 3))
