"""The GTM in six axes by equations of our own: an independent truth for its flights in JSBSim.

A rigid body over a flat earth, body axes (B. L. Stevens, F. L. Lewis, E. N. Johnson, Aircraft Control and Simulation, 3rd ed.,
2016, table 1.5-1), integrated by scipy's DOP853. The figures are those of aircraft/gtm: the pitch-plane tables of gtm.xml, and
tables/*.csv as NASA states them, for the right aileron and for negative rudder; left aileron and positive rudder are mirrored
here. Nothing of airtruth is imported. Structural axes: x aft, y right, z up [in].
"""

from __future__ import annotations

import csv
import xml.etree.ElementTree as ET
from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import root

Array = NDArray[np.float64]
Tables = Mapping[str, Callable[..., Array]]

FOLDER = Path(__file__).resolve().parents[1] / "aircraft" / "gtm"
FT, IN, LBF, G = 0.3048, 0.0254, 4.4482216152605, 9.80665
SLUG_FT2 = 14.593902937206364 * FT**2
S, C, B = 5.9018 * FT**2, 0.9153 * FT, 6.8488 * FT
MASS = 57.75 * 0.45359237
IXX, IYY, IZZ, IXZ = (x * SLUG_FT2 for x in (1.221, 4.657102, 5.587, 0.274))
INERTIA = np.array([[IXX, 0.0, -IXZ], [0.0, IYY, 0.0], [-IXZ, 0.0, IZZ]])
CG, REFERENCE, ENGINE = (56.9697, 11.7132), (57.3003, 11.2812), (51.903, 7.71)  # x, z
TILT = np.deg2rad(1.965)
SERVO_RAD_S, DELAY_S = 2.0 * np.pi * 5.0, 0.015
COEFFICIENTS = ("CX", "CY", "CZ", "Cl", "Cm", "Cn")
MIRROR = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
"""Factors of the coefficients in a flight mirrored at the plane of symmetry."""


def _held(points: Sequence[Array], values: Array) -> Callable[..., Array]:
    """Linear interpolation of (..., coefficients) values that holds the end values outside."""
    grids = [p.tolist() for p in points]

    def at(*x: float) -> Array:
        found = values
        for grid, place in zip(grids, x, strict=True):
            i = min(max(bisect_right(grid, place) - 1, 0), len(grid) - 2)
            share = min(max((place - grid[i]) / (grid[i + 1] - grid[i]), 0.0), 1.0)
            found = found[i] + share * (found[i + 1] - found[i])
        return found

    return at


def figures(name: str) -> tuple[list[Array], Array]:
    """Breakpoints and values (..., coefficients) of tables/NAME.csv; coefficients that it lacks are zero."""
    lines = (FOLDER / "tables" / f"{name}.csv").read_text(encoding="utf-8").splitlines()
    rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    keys = [k for k in rows[0] if k not in COEFFICIENTS]
    points = [np.unique([float(r[k]) for r in rows]) for k in keys]
    values = np.zeros([*(len(p) for p in points), len(COEFFICIENTS)])
    for r in rows:
        where = tuple(int(np.searchsorted(p, float(r[k]))) for p, k in zip(points, keys, strict=True))
        values[where] = [float(r.get(c, 0.0)) for c in COEFFICIENTS]
    return points, values


def _of_xml(kind: str) -> Callable[..., Array]:
    """Pitch-plane table C?-KIND of gtm.xml; CY, Cl, Cn are zero."""
    parts: dict[str, tuple[list[Array], Array]] = {}
    for function in ET.parse(FOLDER / "gtm.xml").getroot().iter("function"):
        coefficient, _, found = function.get("name", "").removeprefix("aero/coefficient/").partition("-")
        if found != kind:
            continue
        text = function.findtext("product/table/tableData") or ""
        lines = [[float(x) for x in line.split()] for line in text.strip().splitlines()]
        if len(lines[0]) == 2:
            data = np.array(lines)
            parts[coefficient] = [data[:, 0]], data[:, 1]
        else:
            data = np.array(lines[1:])
            parts[coefficient] = [data[:, 0], np.array(lines[0])], data[:, 1:]
    points, one = parts["CX"]
    zero = np.zeros_like(one)
    values = np.stack([parts[c][1] if c in parts else zero for c in COEFFICIENTS], axis=-1)
    return _held(points, values)


@cache
def tables() -> Tables:
    """The figures of aircraft/gtm by name; angles in degrees, rates as p b/(2V), q c/(2V), r b/(2V)."""
    xml = {kind: _of_xml(kind) for kind in ("static", "elevator", "pitch-rate")}
    names = ("sideslip", "right_aileron", "rudder", "roll_rate", "yaw_rate")
    return xml | {name: _held(*figures(name)) for name in names}


def coefficients(v: float, alpha: float, beta: float, rates: Array, surfaces: Array) -> Array:
    """(6,) CX to Cn about the aerodynamic reference.

    Parameters
    ----------
    v : airspeed [m/s]; alpha, beta [rad]; rates : p, q, r [rad/s]; surfaces : elevator, aileron, rudder [rad].
    """
    t, (p, q, r) = tables(), rates / (2.0 * v)
    a, b = np.rad2deg(alpha), np.rad2deg(beta)
    e, da, dr = np.rad2deg(surfaces)
    right = t["right_aileron"](a, b, da)
    left = MIRROR * t["right_aileron"](a, -b, -da)  # the left aileron stands at -da
    rudder = t["rudder"](a, b, dr) if dr <= 0.0 else MIRROR * t["rudder"](a, -b, -dr)
    pitch = t["static"](a) + t["elevator"](a, e) + t["pitch-rate"](a, q * C)
    return np.asarray(
        pitch
        + t["sideslip"](a, b)
        + right
        + left
        + rudder
        + t["roll_rate"](a, p * B)
        + t["yaw_rate"](a, r * B)
    )


def standard_atmosphere(height_m: float) -> tuple[float, float]:
    """Density [kg/m3] and pressure over that at sea level, US Standard Atmosphere 1976 below 11 km."""
    h = 6356766.0 * height_m / (6356766.0 + height_m)
    temperature = 288.15 - 0.0065 * h
    pressure = (temperature / 288.15) ** 5.255879
    return pressure * 101325.0 / (287.05287 * temperature), pressure


def thrust(lever: float, pressure: float, force: float) -> float:
    """Net thrust of both engines [N]; force is q_bar S [N]."""
    t = 100.0 * lever
    n = 3.30355e-5 * t**3 - 8.35439e-3 * t**2 + 1.191127 * t + 31.51896
    return 2.0 * max(0.0, (1.48476e-5 * n**3 + 0.412662) * LBF * pressure - 0.010 * force)


def _moment(point: tuple[float, float], force: Array) -> Array:
    """Moment about the CG [N m] of a force in the plane of symmetry or beside none, at x, z of the structure."""
    arm = np.array([(CG[0] - point[0]) * IN, 0.0, (CG[1] - point[1]) * IN])
    return np.cross(arm, force)


def motion(state: Array, surfaces: Array, lever: float) -> tuple[Array, Array]:
    """Rates of the ten states u, v, w, p, q, r, phi, theta, psi, height, and the specific force (3,) [m/s2]."""
    velocity, rates, (phi, theta, _) = state[:3], state[3:6], state[6:9]
    v = float(np.linalg.norm(velocity))
    alpha, beta = np.arctan2(velocity[2], velocity[0]), np.arcsin(velocity[1] / v)
    density, pressure = standard_atmosphere(float(state[9]))
    force = 0.5 * density * v**2 * S
    c = coefficients(v, alpha, beta, rates, surfaces)
    air = force * c[[0, 1, 2]]
    jet = thrust(lever, pressure, force) * np.array([np.cos(TILT), 0.0, -np.sin(TILT)])
    moment = force * c[[3, 4, 5]] * np.array([B, C, B]) + _moment(REFERENCE, air) + _moment(ENGINE, jet)
    specific = (air + jet) / MASS
    sf, cf, st, ct = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
    weight = G * np.array([-st, sf * ct, cf * ct])
    p, q, r = rates
    turn = q * sf + r * cf
    return (
        np.concatenate(
            [
                specific + weight - np.cross(rates, velocity),
                np.linalg.solve(INERTIA, moment - np.cross(rates, INERTIA @ rates)),
                [p + turn * np.tan(theta), q * cf - r * sf, turn / ct],
                [velocity @ np.array([st, -sf * ct, -cf * ct])],
            ]
        ),
        specific,
    )


@dataclass(frozen=True)
class Trim:
    """Straight level flight with the wings level: airspeed [m/s], height [m], alpha, beta [rad], surfaces (elevator, aileron,
    rudder) [rad], lever [0..1]."""

    airspeed: float
    height: float
    alpha: float
    beta: float
    surfaces: Array
    lever: float

    @property
    def state(self) -> Array:
        """The ten states; the velocity leads level along the heading, to the sideslip."""
        ca, sa, cb, sb = np.cos(self.alpha), np.sin(self.alpha), np.cos(self.beta), np.sin(self.beta)
        velocity = self.airspeed * np.array([ca * cb, sb, sa * cb])
        # A level path without bank: u sin(theta) = w cos(theta), whatever the sideslip.
        return np.array([*velocity, 0.0, 0.0, 0.0, 0.0, self.alpha, 0.0, self.height])


def trim(airspeed: float, height: float) -> Trim:
    """The equilibrium by scipy's hybrid method."""

    def made(x: Array) -> Trim:
        return Trim(airspeed, height, float(x[0]), float(x[1]), np.array(x[2:5]), float(x[5]))

    def residual(x: Array) -> Array:
        at = made(x)
        return motion(at.state, at.surfaces, at.lever)[0][:6]

    found = root(residual, [0.1, 0.0, 0.0, 0.0, 0.0, 0.42], tol=1e-12)
    if np.abs(residual(found.x)).max() > 1e-8:
        raise RuntimeError(f"no equilibrium: {found.message}")
    return made(found.x)


def doublet(
    at: Trim, control: str, amplitude: float, start: float, step: float, times: Array
) -> dict[str, Array]:
    """Fly a doublet of the aileron or the rudder from a trim.

    Parameters
    ----------
    control : "aileron" or "rudder"; amplitude [rad], first positive; start, step : of the command [s].
    times : (samples,) increasing, from 0 [s].

    Returns
    -------
    dict
        Channel of a flight log -> (samples,) values at the CG.
    """
    number = ("elevator", "aileron", "rudder").index(control)
    edges = [start + DELAY_S + k * step for k in range(3)]
    level = (0.0, amplitude, -amplitude, 0.0)

    def surfaces(x: Array) -> Array:
        moved = at.surfaces.copy()
        moved[number] += x[10]
        return moved

    x = np.append(at.state, 0.0)
    states = [x]
    for k, (left, right) in enumerate(pairwise([0.0, *edges, float(times[-1])])):

        def rates(_: float, x: Array, command: float = level[k]) -> Array:
            return np.append(motion(x[:10], surfaces(x), at.lever)[0], SERVO_RAD_S * (command - x[10]))

        inside = times[(times > left) & (times <= right)]
        asked = np.union1d(inside, [right])
        flown = solve_ivp(rates, (left, right), x, method="DOP853", t_eval=asked, rtol=1e-8, atol=1e-10).y.T
        states += [y for t, y in zip(asked, flown, strict=True) if t in inside]
        x = flown[-1]
    y = np.array(states)
    v = np.linalg.norm(y[:, :3], axis=1)
    force = np.array([motion(row[:10], surfaces(row), at.lever)[1] for row in y])
    return {
        "beta_rad": np.arcsin(y[:, 1] / v),
        "p_rad_s": y[:, 3],
        "r_rad_s": y[:, 5],
        "phi_rad": y[:, 6],
        "psi_rad": y[:, 8],
        "ay_m_s2": force[:, 1],
        f"{control}_rad": at.surfaces[number] + y[:, 10],
    }
