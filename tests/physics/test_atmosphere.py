"""Standard atmosphere against the published tables, and round trips."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from airtruth.physics import atmosphere
from airtruth.units import FT, KT

# ICAO Doc 7488/3 and U.S. Standard Atmosphere 1976, table I by geopotential altitude:
# H [m], T [K], p [Pa], rho [kg/m3], as many digits as are printed.
TABLE = [
    (0.0, 288.15, 101325.0, 1.2250),
    (1000.0, 281.65, 89874.6, 1.11164),
    (5000.0, 255.65, 54019.9, 0.736116),
    (10000.0, 223.15, 26436.3, 0.412707),
    (11000.0, 216.65, 22632.06, 0.363918),
    (15000.0, 216.65, 12044.6, 0.193674),
    (20000.0, 216.65, 5474.889, 0.0880349),
]


@pytest.mark.parametrize(("h", "t", "p", "rho"), TABLE)
def test_published_table(h: float, t: float, p: float, rho: float) -> None:
    assert atmosphere.temperature_k(h) == pytest.approx(t, abs=1e-9)
    assert atmosphere.pressure_pa(h) == pytest.approx(p, rel=2.5e-6)  # half a unit of the last digit printed
    assert atmosphere.density_kg_m3(h) == pytest.approx(rho, rel=2.5e-6)


def test_gtm_condition() -> None:
    """EAS 75 kt at 7000 ft geometric: TAS 42.85 m/s, q_bar 911.8 Pa, rho 0.9931 (the GTM's trim)."""
    rho = atmosphere.density_kg_m3(atmosphere.geopotential_m(7000 * FT))
    tas = atmosphere.true_airspeed_m_s(75 * KT, rho)
    assert rho == pytest.approx(0.9931, abs=5e-5)
    assert tas == pytest.approx(42.85, abs=5e-3)
    assert 0.5 * rho * tas**2 == pytest.approx(911.8, abs=0.05)


def test_geometric_altitude_is_the_inverse() -> None:
    for height in (-1000.0, 0.0, 2133.6, 19900.0):
        assert atmosphere.geometric_m(atmosphere.geopotential_m(height)) == pytest.approx(height, abs=1e-9)


def test_geopotential_altitude() -> None:
    """U.S. Standard Atmosphere 1976, table I by geometric altitude: Z 5000 m is H 4996 m, 10 km 9984 m."""
    np.testing.assert_allclose(atmosphere.geopotential_m([0.0, 5000.0, 10000.0]), [0, 4996, 9984], atol=0.5)


def test_hydrostatic_equation() -> None:
    """dp/dh = -rho g0 on both sides of the tropopause, by central differences."""
    h = np.array([-4000.0, 0.0, 3000.0, 9000.0, 12000.0, 19000.0])
    step = 1.0
    slope = (atmosphere.pressure_pa(h + step) - atmosphere.pressure_pa(h - step)) / (2 * step)
    np.testing.assert_allclose(slope, -atmosphere.density_kg_m3(h) * 9.80665, rtol=2e-8)


def test_continuous_at_the_tropopause() -> None:
    for quantity in (atmosphere.pressure_pa, atmosphere.density_kg_m3):
        below, above = quantity([11000.0 - 1e-6, 11000.0 + 1e-6])
        assert below == pytest.approx(above, rel=1e-9)


@given(st.floats(-5000.0, 20000.0))
def test_inverses(h: float) -> None:
    assert atmosphere.altitude_of_density_m(atmosphere.density_kg_m3(h)) == pytest.approx(h, abs=1e-6)


@given(st.floats(1.0, 400.0), st.floats(-5000.0, 20000.0))
def test_airspeed_round_trip(eas: float, h: float) -> None:
    rho = atmosphere.density_kg_m3(h)
    tas = atmosphere.true_airspeed_m_s(eas, rho)
    assert 0.5 * rho * tas**2 == pytest.approx(0.5 * atmosphere.RHO0_KG_M3 * eas**2, rel=1e-12)
    assert atmosphere.equivalent_airspeed_m_s(tas, rho) == pytest.approx(eas, rel=1e-12)


def test_outside_the_range_is_nan() -> None:
    h = [-5001.0, 20001.0, np.nan]
    for quantity in (atmosphere.temperature_k, atmosphere.pressure_pa, atmosphere.density_kg_m3):
        assert np.isnan(quantity(h)).all()
    assert np.isnan(atmosphere.altitude_of_density_m([0.08, 3.0, 0.0, -1.0])).all()


def test_keeps_the_shape() -> None:
    assert atmosphere.density_kg_m3(np.zeros((3, 4))).shape == (3, 4)


def test_density_of_a_record() -> None:
    """A measured density is taken as it is; without one it is that of the pressure altitude (published table)."""
    altitude, measured = np.array([0.0, 1000.0]), np.array([1.3, 1.2])
    from_altitude = atmosphere.air_density({"altitude_m": altitude})
    np.testing.assert_allclose(from_altitude, [1.2250, 1.11164], rtol=2.5e-6)
    assert atmosphere.air_density({"altitude_m": altitude, "density_kg_m3": measured}) is measured
