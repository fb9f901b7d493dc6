"""Gust severities against the published figures."""

from __future__ import annotations

import numpy as np
import pytest

from airtruth.errors import ConfigurationError
from airtruth.physics.gust_figures import gust_scales, side_gust
from airtruth.units import FT, KT

# NASA GTM_DesignSim at 800, 1226, 2000 and 7000 ft: Lu, Lw [m], and the products of table and gain
# (0.2, 0.17 for light; 0.4, 0.34 for moderate) as they come out there, sigma_u, sigma_w [m/s].
GTM = [
    (800, "light", 168.661, 151.864, 0.7632, 0.6151),
    (800, "moderate", 168.661, 151.864, 1.5265, 1.2303),
    (800, "severe", 168.661, 151.864, 3.8162, 3.6184),
    (1226, "light", 300.0, 300.0, 0.8769, 0.7463),
    (1226, "moderate", 300.0, 300.0, 1.7538, 1.4926),
    (1226, "severe", 300.0, 300.0, 4.3845, 4.39),
    (2000, "light", 300.0, 300.0, 0.878, 0.7463),
    (2000, "moderate", 300.0, 300.0, 1.756, 1.4926),
    (2000, "severe", 300.0, 300.0, 4.39, 4.39),
    (7000, "light", 911.218, 840.419, 1.1659, 0.8118),
    (7000, "moderate", 911.218, 840.419, 2.3318, 1.6236),
    (7000, "severe", 911.218, 840.419, 5.8294, 4.7754),
]


@pytest.mark.parametrize(("altitude_ft", "level", "lu", "lw", "su", "sw"), GTM)
def test_gtm_figures(altitude_ft: float, level: str, lu: float, lw: float, su: float, sw: float) -> None:
    s = gust_scales("gtm", level, altitude_ft * FT)
    assert s.length_u_m == pytest.approx(lu, rel=1e-12)
    assert s.length_w_m == pytest.approx(lw, rel=1e-12)
    assert s.sigma_u_m_s == pytest.approx(su, abs=6e-5)  # printed to 4 decimals
    assert s.sigma_w_m_s == pytest.approx(sw, abs=6e-5)


def test_gtm_figures_between_rows_are_linear() -> None:
    s = gust_scales("gtm", "severe", 4500 * FT)
    assert s.sigma_w_m_s == pytest.approx((4.39 + 4.7754) / 2, rel=1e-12)
    assert s.length_u_m == pytest.approx((300 + 911.218) / 2, rel=1e-12)


def test_mil_low_altitude() -> None:
    """Hand values at 500 ft, moderate (W20 30 kt): 0.177 + 0.000823 x 500 = 0.5885."""
    su, sw, lu, lw = gust_scales("mil-f-8785c", "moderate", 500 * FT)
    assert sw == pytest.approx(3.0 * KT, rel=1e-12)
    assert su == pytest.approx(3.0 * KT / 0.5885**0.4, rel=1e-12)
    assert lw == pytest.approx(500 * FT, rel=1e-12)
    assert lu == pytest.approx(500 * FT / 0.5885**1.2, rel=1e-12)


def test_mil_at_1000_ft_is_isotropic() -> None:
    su, sw, lu, lw = gust_scales("mil-f-8785c", "light", 1000 * FT)
    assert su == pytest.approx(sw, rel=1e-12)
    assert lu == pytest.approx(1000 * FT, rel=1e-12)
    assert lw == pytest.approx(1000 * FT, rel=1e-12)


def test_mil_is_continuous_and_linear_between_1000_and_2000_ft() -> None:
    at = [np.array(gust_scales("mil-f-8785c", "severe", h * FT)) for h in (1000, 1500, 2000)]
    np.testing.assert_allclose(at[1], (at[0] + at[2]) / 2, rtol=1e-12)
    for h in (1000, 2000):
        below, above = (np.array(gust_scales("mil-f-8785c", "severe", (h + e) * FT)) for e in (-1e-7, 1e-7))
        np.testing.assert_allclose(below, above, rtol=1e-8)


def test_factor_scales_sigma_only() -> None:
    one, two = (gust_scales("gtm", "light", 7000 * FT, factor=f) for f in (1.0, 2.0))
    assert two == (2 * one.sigma_u_m_s, 2 * one.sigma_w_m_s, one.length_u_m, one.length_w_m)


@pytest.mark.parametrize(
    ("figures", "level", "altitude_ft", "message"),
    [
        ("gtm", "light", 7500, "cover 800 to 7000 ft .244 to 2134 m., not 7500 ft"),
        ("gtm", "light", 100, "cover 800 to 7000 ft"),
        ("mil-f-8785c", "light", 5, "cover 10 to 80000 ft"),
        ("gmt", "light", 7000, "did you mean 'gtm'"),
        ("gtm", "sever", 7000, "did you mean 'severe'.*allowed: light, moderate, severe"),
        ("gtm", "light", float("nan"), "not nan ft"),
    ],
)
def test_errors_name_the_choices(figures: str, level: str, altitude_ft: float, message: str) -> None:
    with pytest.raises(ConfigurationError, match=message):
        gust_scales(figures, level, altitude_ft * FT)


MIL_FIGURE_7 = {
    2000.0: (6.9 + 0.125 * (7.4 - 6.9), 9.6 + 0.125 * (10.6 - 9.6), 17.6 + 0.125 * (23.0 - 17.6)),
    3750.0: (7.4, 10.6, 23.0),
    7500.0: (6.7, 10.1, 23.6),
    15000.0: (4.6, 8.0, 22.1),
    25000.0: (2.7, 6.6, 20.0),
    35000.0: (0.4, 5.0, 16.0),
    45000.0: (0.0, 4.2, 15.1),
    55000.0: (0.0, 2.7, 12.1),
    65000.0: (0.0, 0.0, 7.9),
    75000.0: (0.0, 0.0, 6.2),
    80000.0: (0.0, 0.0, 5.1),
}
"""Altitude [ft] -> sigma [ft/s] of light, moderate and severe turbulence: MIL-F-8785C, figure 7, rows 3, 4 and 6 of the
table of exceedance as two simulators other than JSBSim print it (1750 ft: 6.9, 9.6, 17.6)."""


@pytest.mark.parametrize("altitude_ft", MIL_FIGURE_7)
def test_mil_medium_and_high_altitude(altitude_ft: float) -> None:
    for level, sigma_ft_s in zip(("light", "moderate", "severe"), MIL_FIGURE_7[altitude_ft], strict=True):
        s = gust_scales("mil-f-8785c", level, altitude_ft * FT)
        assert s.sigma_u_m_s == s.sigma_w_m_s == pytest.approx(sigma_ft_s * FT, rel=1e-12, abs=1e-12)
        assert s.length_u_m == s.length_w_m == pytest.approx(1750.0 * FT, rel=1e-12)


@pytest.mark.parametrize(
    ("figures", "lowest_ft", "highest_ft"), [("gtm", 800, 7000), ("mil-f-8785c", 10, 80000)]
)
def test_the_ends_of_a_table_belong_to_it(figures: str, lowest_ft: float, highest_ft: float) -> None:
    for altitude_ft in (lowest_ft, highest_ft):
        gust_scales(figures, "severe", altitude_ft * FT)
    for altitude_ft in (lowest_ft - 1.0, highest_ft + 1.0):
        with pytest.raises(ConfigurationError, match=f"cover {lowest_ft} to {highest_ft} ft"):
            gust_scales(figures, "severe", altitude_ft * FT)


def test_the_side_gust_is_that_of_its_source() -> None:
    """GTM: v as w; MIL-F-8785C, figures 10, 11 (500 ft): sigma_v/sigma_w = (.177 + .000823 h)^-.4, Lv = h/(...)^1.2."""
    gtm = gust_scales("gtm", "light", 7000 * FT)
    assert side_gust("gtm", gtm) == (gtm.sigma_w_m_s, gtm.length_w_m)
    low = gust_scales("mil-f-8785c", "moderate", 500 * FT)
    sigma_v, length_v = side_gust("mil-f-8785c", low)
    ratio = 0.177 + 0.000823 * 500.0
    assert sigma_v / low.sigma_w_m_s == pytest.approx(ratio**-0.4, rel=1e-12)
    assert length_v == pytest.approx(500.0 * FT / ratio**1.2, rel=1e-12)
