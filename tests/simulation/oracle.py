"""An independent flight of the GTM: its tables read from the XML, rigid-body equations by DOP853.

Shares no code with airtruth or JSBSim beyond the numbers in gtm.xml; constants are the GTM's own.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import RegularGridInterpolator

GTM = Path(__file__).parents[2] / "aircraft" / "gtm" / "gtm.xml"
FT, IN, LBF, PSF = 0.3048, 0.0254, 4.4482216152605, 47.88025898033584
S, C = 5.9018 * FT**2, 0.9153 * FT
MASS, IYY = 57.75 * 0.45359237, 4.657102 * 14.593902937206364 * FT**2
G = 9.80665
CG, REF, ENGINE = ((56.9697, 11.7132), (57.3003, 11.2812), (51.903, 7.71))
TILT = np.deg2rad(1.965)
SERVO, DELAY = 2 * np.pi * 5.0, 0.015


def tables() -> dict[str, RegularGridInterpolator]:
    found = {}
    for function in ET.parse(GTM).getroot().iter("function"):
        name = function.get("name", "")
        table = function.find("product/table")
        if not name.startswith("aero/coefficient/") or table is None:
            continue
        lines = [
            [float(x) for x in line.split()] for line in table.findtext("tableData").strip().splitlines()
        ]
        if len(lines[0]) == 2 and len(lines[1]) == 2:
            data = np.array(lines)
            found[name.split("/")[-1]] = RegularGridInterpolator((data[:, 0],), data[:, 1])
        else:
            data = np.array(lines[1:])
            found[name.split("/")[-1]] = RegularGridInterpolator((data[:, 0], lines[0]), data[:, 1:])
    return found


def standard_atmosphere(height_m: float) -> tuple[float, float]:
    """Density [kg/m3] and pressure ratio below 11 km."""
    h = 6356766.0 * height_m / (6356766.0 + height_m)
    temperature = 288.15 - 0.0065 * h
    pressure = (temperature / 288.15) ** 5.255879
    return pressure * 101325.0 / (287.05287 * temperature), pressure


def gross_thrust(lever: float) -> float:
    """One engine at sea-level pressure [N]."""
    t = 100.0 * lever
    n = 3.30355e-5 * t**3 - 8.35439e-3 * t**2 + 1.191127 * t + 31.51896
    return (1.48476e-5 * n**3 + 0.412662) * LBF


def accelerations(tab, u, w, q, theta, height, elevator, lever):
    """u_dot, w_dot, q_dot and the specific force along x and z at the CG."""
    v, alpha = np.hypot(u, w), np.arctan2(w, u)
    rho, pressure = standard_atmosphere(height)
    force = 0.5 * rho * v**2 * S
    a, e, r = np.rad2deg(alpha), np.rad2deg(elevator), q * C / (2 * v)
    cx, cz, cm = (
        float(
            tab[f"{c}-static"]([a])[0]
            + tab[f"{c}-elevator"]([(a, e)])[0]
            + tab[f"{c}-pitch-rate"]([(a, r)])[0]
        )
        for c in ("CX", "CZ", "Cm")
    )
    thrust = 2 * max(0.0, gross_thrust(lever) * pressure - 0.010 * force)
    fx, fz = force * cx, force * cz
    tx, tz = thrust * np.cos(TILT), -thrust * np.sin(TILT)

    def moment(point, px, pz):  # structural frame: x aft, z up, inches
        dx, dz = (CG[0] - point[0]) * IN, (CG[1] - point[1]) * IN  # forward, down of the CG
        return dz * px - dx * pz

    m = force * C * cm + moment(REF, fx, fz) + moment(ENGINE, tx, tz)
    ax, az = (fx + tx) / MASS, (fz + tz) / MASS
    return ax - G * np.sin(theta) - q * w, az + G * np.cos(theta) + q * u, m / IYY, ax, az


def servo(t: float, trim_elevator: float, amplitude: float, start: float, step: float) -> float:
    """Exact response of the first-order servo to a doublet, after the delay."""
    tau = t - DELAY - start
    steps = ((0.0, 1.0), (step, -2.0), (2 * step, 1.0))
    return trim_elevator + amplitude * sum(
        s * (1 - np.exp(-SERVO * (tau - t0))) for t0, s in steps if tau > t0
    )


def doublet(trim, amplitude: float, start: float, step: float, times: np.ndarray) -> dict[str, np.ndarray]:
    """Fly a doublet from a trim (alpha, elevator, lever, airspeed, height)."""
    tab = tables()
    alpha, elevator, lever, v, height = trim

    def rates(t, x):
        u, w, q, theta, h = x
        u_dot, w_dot, q_dot, *_ = accelerations(
            tab, u, w, q, theta, h, servo(t, elevator, amplitude, start, step), lever
        )
        return [u_dot, w_dot, q_dot, q, u * np.sin(theta) - w * np.cos(theta)]

    x = np.array([v * np.cos(alpha), v * np.sin(alpha), 0.0, alpha, height])
    states = [x]
    edges = {start + DELAY + k * step for k in range(3)}
    for t0, t1 in pairwise(times):
        for left, right in pairwise(sorted({t0, t1, *(e for e in edges if t0 < e < t1)})):
            x = solve_ivp(rates, (left, right), x, method="DOP853", rtol=1e-9, atol=1e-11).y[:, -1]
        states.append(x)
    y = np.array(states).T
    specific = [
        accelerations(tab, *y[:4, i], y[4, i], servo(t, elevator, amplitude, start, step), lever)[3:]
        for i, t in enumerate(times)
    ]
    return {
        "airspeed_m_s": np.hypot(y[0], y[1]),
        "alpha_rad": np.arctan2(y[1], y[0]),
        "q_rad_s": y[2],
        "theta_rad": y[3],
        "ax_m_s2": np.array(specific)[:, 0],
        "az_m_s2": np.array(specific)[:, 1],
        "elevator_rad": np.array([servo(t, elevator, amplitude, start, step) for t in times]),
    }
