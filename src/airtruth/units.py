"""Units at the border. Inside airtruth everything is SI and radians.

A quantity carries its unit at the end of its name (``eas_kt``, ``duration_s``). `UNITS` lists, for
each dimension, the suffixes that are understood and the factor to SI.
"""

from __future__ import annotations

import math
from typing import Final

DEG: Final = math.pi / 180.0
FT: Final = 0.3048  # international foot, exact [m]
INCH: Final = 0.0254  # exact [m]
KT: Final = 1852.0 / 3600.0  # international knot, exact [m/s]
LB: Final = 0.45359237  # avoirdupois pound, exact [kg]
G0: Final = 9.80665  # standard gravity, exact [m/s2]
LBF: Final = LB * G0  # [N]
SLUG: Final = LBF / FT  # [kg]
PSF: Final = LBF / FT**2  # [Pa]

UNITS: Final[dict[str, dict[str, float]]] = {
    "angle": {"rad": 1.0, "deg": DEG},
    "angular_rate": {"rad_s": 1.0, "deg_s": DEG},
    "angular_acceleration": {"rad_s2": 1.0, "deg_s2": DEG},
    "speed": {"m_s": 1.0, "kt": KT, "ft_s": FT, "km_h": 1.0 / 3.6},
    "acceleration": {"m_s2": 1.0, "g": G0, "ft_s2": FT},
    "length": {"m": 1.0, "ft": FT, "in": INCH, "mm": 1e-3},
    "area": {"m2": 1.0, "ft2": FT**2},
    "time": {"s": 1.0, "ms": 1e-3},
    "frequency": {"hz": 1.0},
    "mass": {"kg": 1.0, "lb": LB, "slug": SLUG},
    "inertia": {"kg_m2": 1.0, "slug_ft2": SLUG * FT**2},
    "force": {"n": 1.0, "lbf": LBF},
    "moment": {"n_m": 1.0, "lbf_ft": LBF * FT},
    "pressure": {"pa": 1.0, "psf": PSF},
    "density": {"kg_m3": 1.0, "slug_ft3": SLUG / FT**3},
    "ratio": {"": 1.0, "pct": 0.01},
}


def factor(dimension: str, unit: str) -> float:
    """Factor that takes a value in ``unit`` to SI.

    Raises
    ------
    KeyError
        If the dimension or the unit is not in `UNITS`.
    """
    return UNITS[dimension][unit]
