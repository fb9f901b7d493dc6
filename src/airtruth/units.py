"""Units of files and options; inside the package every quantity is in SI and radians.

The unit of a quantity ends its name (``eas_kt``, ``duration_s``). `UNITS` lists the suffixes of each dimension and
their factors to SI.
"""

from __future__ import annotations

import math
from typing import Final

DEG: Final = math.pi / 180.0
"""Degree [rad]."""
FT: Final = 0.3048
"""International foot [m], exact (NIST SP 811, 2008, appendix B)."""
INCH: Final = 0.0254
"""International inch [m], exact (NIST SP 811)."""
KT: Final = 1852.0 / 3600.0
"""International knot [m/s], exact (NIST SP 811)."""
MPH: Final = 0.44704
"""Mile per hour [m/s], exact (NIST SP 811)."""
LB: Final = 0.45359237
"""Avoirdupois pound [kg], exact (NIST SP 811)."""
G0: Final = 9.80665
"""Standard gravity [m/s2], exact (3rd CGPM, 1901)."""
LBF: Final = LB * G0
"""Pound-force [N], from the pound and standard gravity."""
SLUG: Final = LBF / FT
"""Slug [kg]: the mass that one pound-force accelerates by 1 ft/s2."""
PSF: Final = LBF / FT**2
"""Pound-force per square foot [Pa]."""
MMHG: Final = 133.322387415
"""Conventional millimetre of mercury [Pa] (NIST SP 811, B.8: 133.3224)."""
INHG: Final = 25.4 * MMHG
"""Conventional inch of mercury [Pa] (NIST SP 811, B.8: 3386.389)."""

UNITS: Final[dict[str, dict[str, float]]] = {
    "angle": {"rad": 1.0, "deg": DEG, "cdeg": 0.01 * DEG, "mrad": 1e-3},
    "angular_rate": {"rad_s": 1.0, "deg_s": DEG, "cdeg_s": 0.01 * DEG, "mrad_s": 1e-3},
    "angular_acceleration": {"rad_s2": 1.0, "deg_s2": DEG},
    "speed": {"m_s": 1.0, "kt": KT, "ft_s": FT, "km_h": 1.0 / 3.6, "mph": MPH, "cm_s": 0.01, "mm_s": 1e-3},
    "acceleration": {"m_s2": 1.0, "g": G0, "ft_s2": FT, "mg": 1e-3 * G0, "cm_s2": 0.01},
    "length": {"m": 1.0, "ft": FT, "in": INCH, "mm": 1e-3, "cm": 0.01, "km": 1e3, "fl": 100.0 * FT},
    "area": {"m2": 1.0, "ft2": FT**2},
    "time": {"s": 1.0, "ms": 1e-3},
    "frequency": {"hz": 1.0},
    "mass": {"kg": 1.0, "lb": LB, "slug": SLUG},
    "inertia": {"kg_m2": 1.0, "slug_ft2": SLUG * FT**2},
    "force": {"n": 1.0, "lbf": LBF},
    "moment": {"n_m": 1.0, "lbf_ft": LBF * FT},
    "pressure": {
        "pa": 1.0,
        "hpa": 100.0,
        "mbar": 100.0,
        "kpa": 1e3,
        "psf": PSF,
        "psi": LBF / INCH**2,
        "inhg": INHG,
        "mmhg": MMHG,
    },
    "temperature": {"k": 1.0, "degc": 1.0, "degf": 5.0 / 9.0},
    "density": {"kg_m3": 1.0, "slug_ft3": SLUG / FT**3},
    "ratio": {"": 1.0, "pct": 0.01},
    "per_angle": {"per_rad": 1.0, "per_deg": 1.0 / DEG},
}
"""Dimension -> suffix of a unit -> factor to SI; "cdeg" is 1/100 deg, "fl" a flight level."""
ZEROS: Final[dict[str, float]] = {"degc": 273.15, "degf": 459.67}
"""Unit whose zero is not that of SI -> its value at the zero of SI, with the opposite sign (NIST SP 811, B.8)."""

_PRINTED: Final = {
    "-": "",
    "1": "",
    "hz": "Hz",
    "rad_s": "rad/s",
    "m_s": "m/s",
    "m_s2": "m/s2",
    "kg_m2": "kg m2",
    "n_m": "N m",
    "per_rad": "1/rad",
}
"""Unit -> its printed form; others are printed as they are."""


def printed(unit: str) -> str:
    """Printed form of a unit: "rad/s" for "rad_s", "" without a dimension; others as they are."""
    return _PRINTED.get(unit, unit)


def factor(dimension: str, unit: str) -> float:
    """Return the factor from a unit to SI.

    Parameters
    ----------
    dimension : key of `UNITS`.
    unit : suffix of the unit.

    Raises
    ------
    KeyError
        If the dimension or the unit is not in `UNITS`.
    """
    return UNITS[dimension][unit]
