"""Gust severity: standard deviations and scale lengths of named levels over altitude."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Literal, NamedTuple

import numpy as np

from airtruth.errors import ConfigurationError, choices
from airtruth.units import FT, KT


class GustScales(NamedTuple):
    """Standard deviations [m/s] and scale lengths [m] of u and w."""

    sigma_u_m_s: float
    sigma_w_m_s: float
    length_u_m: float
    length_w_m: float


LEVELS: Final = ("light", "moderate", "severe")
"""Named severities of gusts."""

_GTM_TABLE: Final = np.array(
    [
        [800.0, 168.661, 151.864, 3.8162, 3.6184],
        [1226.0, 300.0, 300.0, 4.3845, 4.39],
        [2000.0, 300.0, 300.0, 4.39, 4.39],
        [7000.0, 911.218, 840.419, 5.8294, 4.7754],
    ]
)
"""NASA TM-4511 "severe" at full scale, as tabulated in NASA GTM_DesignSim: altitude [ft], Lu, Lw [m], sigma_u,
sigma_w [m/s]."""
_GTM_GAINS: Final = {"light": (0.2, 0.17), "moderate": (0.4, 0.34), "severe": (1.0, 1.0)}
"""Factors of a level on sigma_u and sigma_w of the table [-], from GTM_DesignSim. As shipped, its "severe" has the
factors of "moderate"; here it is the table itself."""

_MIL_W20_KT: Final = {"light": 15.0, "moderate": 30.0, "severe": 45.0}
"""Wind speed at 20 ft (MIL-F-8785C) [kt]."""
_MIL_ALTITUDE_FT: Final = (1750.0, 3750.0, 7500.0, 15e3, 25e3, 35e3, 45e3, 55e3, 65e3, 75e3, 80e3)
"""Altitudes of `_MIL_SIGMA_FT_S` [ft]."""
_MIL_SIGMA_FT_S: Final = {
    "light": (6.9, 7.4, 6.7, 4.6, 2.7, 0.4, 0.0, 0.0, 0.0, 0.0, 0.0),
    "moderate": (9.6, 10.6, 10.1, 8.0, 6.6, 5.0, 4.2, 2.7, 0.0, 0.0, 0.0),
    "severe": (17.6, 23.0, 23.6, 22.1, 20.0, 16.0, 15.1, 12.1, 7.9, 6.2, 5.1),
}
"""MIL-F-8785C, figure 7: sigma over altitude at a probability of exceedance of 1e-2 (light), 1e-3 (moderate) and 1e-5
(severe) [ft/s], as digitised in JSBSim's FGWinds."""


def _gtm(level: str, altitude_ft: float) -> GustScales:
    length_u, length_w, sigma_u, sigma_w = (
        float(np.interp(altitude_ft, _GTM_TABLE[:, 0], _GTM_TABLE[:, column])) for column in (1, 2, 3, 4)
    )
    gain_u, gain_w = _GTM_GAINS[level]
    return GustScales(gain_u * sigma_u, gain_w * sigma_w, length_u, length_w)


def _mil_f_8785c(level: str, altitude_ft: float) -> GustScales:
    """Low-altitude model (figures 10 and 11) to 1000 ft, medium and high (3.7.2) from 2000 ft, linear between."""
    low = min(altitude_ft, 1000.0)
    ratio = 0.177 + 0.000823 * low
    sigma_w = 0.1 * _MIL_W20_KT[level] * KT
    near = np.array([sigma_w / ratio**0.4, sigma_w, low / ratio**1.2 * FT, low * FT])
    sigma = float(np.interp(max(altitude_ft, 2000.0), _MIL_ALTITUDE_FT, _MIL_SIGMA_FT_S[level])) * FT
    far = np.array([sigma, sigma, 1750.0 * FT, 1750.0 * FT])
    share = min(max((altitude_ft - 1000.0) / 1000.0, 0.0), 1.0)
    return GustScales(*((1.0 - share) * near + share * far).tolist())


@dataclass(frozen=True)
class Figures:
    """A source of gust figures.

    Attributes
    ----------
    scales : function of level and altitude [ft].
    lowest_ft, highest_ft : range of altitudes that it covers [ft].
    side : the gust whose standard deviation and scale length the side gust v has.
    """

    scales: Callable[[str, float], GustScales]
    lowest_ft: float
    highest_ft: float
    side: Literal["u", "w"]


FIGURES: Final[dict[str, Figures]] = {
    "gtm": Figures(_gtm, 800.0, 7000.0, side="w"),
    "mil-f-8785c": Figures(_mil_f_8785c, 10.0, 80000.0, side="u"),
}
"""Sources of gust figures by name. The GTM simulator gives v the figures of w, the specification those of u (sigma_u = sigma_v,
Lu = Lv)."""


def gust_scales(figures: str, level: str, altitude_m: float, factor: float = 1.0) -> GustScales:
    """Standard deviations and scale lengths of a named severity.

    Parameters
    ----------
    figures : key of `FIGURES`; "gtm" is the full-scale table of the GTM simulator, "mil-f-8785c" the
        specification (altitude above the ground below 2000 ft).
    level : one of `LEVELS`.
    altitude_m : altitude [m].
    factor : multiplies both standard deviations.

    Raises
    ------
    ConfigurationError
        If a name is not known, or the altitude is outside the range of the figures.
    """
    if figures not in FIGURES:
        raise ConfigurationError(f"gust figures {figures!r} are not known; {choices(figures, FIGURES)}")
    if level not in LEVELS:
        raise ConfigurationError(f"gust level {level!r} is not known; {choices(level, LEVELS)}")
    source = FIGURES[figures]
    altitude_ft = altitude_m / FT
    tolerance_ft = 1e-6
    if not source.lowest_ft - tolerance_ft <= altitude_ft <= source.highest_ft + tolerance_ft:
        raise ConfigurationError(
            f"gust figures {figures!r} cover {source.lowest_ft:g} to {source.highest_ft:g} ft "
            f"({source.lowest_ft * FT:.0f} to {source.highest_ft * FT:.0f} m), not {altitude_ft:.0f} ft; "
            f"fly inside that range, or choose other figures ({', '.join(sorted(FIGURES))})"
        )
    s = source.scales(level, altitude_ft)
    return GustScales(factor * s.sigma_u_m_s, factor * s.sigma_w_m_s, s.length_u_m, s.length_w_m)


def side_gust(figures: str, scales: GustScales) -> tuple[float, float]:
    """Standard deviation [m/s] and scale length [m] of the side gust v.

    Parameters
    ----------
    figures : key of `FIGURES`.
    scales : of u and w.

    Examples
    --------
    >>> side_gust("gtm", GustScales(1.2, 0.8, 900.0, 800.0))
    (0.8, 800.0)
    """
    side = FIGURES[figures].side
    return getattr(scales, f"sigma_{side}_m_s"), getattr(scales, f"length_{side}_m")


__all__ = ["FIGURES", "LEVELS", "Figures", "GustScales", "gust_scales", "side_gust"]
