"""Flights in six axes by an integration of our own: an independent truth of the lateral-directional motion.

A rigid body with constant derivatives about its trim flies in Dryden gusts, stepped by fourth-order Runge-Kutta at 200 Hz.
The equations of motion are those of B. L. Stevens and F. L. Lewis, Aircraft Control and Simulation, 2nd ed., 2003, table
2.5-1 (body axes, plane of symmetry), so that angles and rates may be large. Instruments read with arm, lag, delay, scale,
bias and noise, in this order. Nothing here imports `airtruth.effects`, `airtruth.identification` or `airtruth.tracing`.

Signs are those of the flight log: aileron (right - left)/2 with the trailing edge down positive, rudder trailing edge left
positive, beta with the wind from the right positive.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.signal import lfilter

from airtruth.logs.flight_log import FlightLog

Array = NDArray[np.float64]
DEG, G0 = np.pi / 180.0, 9.80665
FINE_HZ = 200.0
LATERAL = tuple(c + s for c in ("CY", "Cl", "Cn") for s in ("beta", "p", "r", "da", "dr"))


@dataclass(frozen=True)
class Plane:
    """An aircraft at one trim: geometry, inertia, derivatives (CG, body axes) and air; SI.

    ``lateral`` has rows CY, Cl, Cn and columns beta, p b/2V, r b/2V, aileron, rudder; ``pitch`` has rows CL, Cm and columns
    alpha, q c/2V, elevator.
    """

    name: str
    mass: float
    area: float
    span: float
    chord: float
    inertia: tuple[float, float, float, float]  # Ixx, Iyy, Izz, Ixz
    lateral: Array
    pitch: Array
    speed: float
    density: float
    alpha: float
    altitude: float = 2000.0
    servo_rad_s: float = 2.0 * np.pi * 5.0
    gust: tuple[float, float, float, float] = (
        1.166,
        0.812,
        911.0,
        840.0,
    )  # sigma_u, sigma_v = sigma_w, Lu, Lv
    at_rest: tuple[float, float, float] = (
        0.0,
        0.0,
        0.0,
    )  # CY, Cl, Cn without sideslip, rates and deflections
    roll_per_lift: float = 0.0  # rolling moment of an asymmetric wing over its lift coefficient
    cg_right: float = 0.0  # CG to the right of the plane of symmetry, in which the forces act


def _rows(text: str) -> Array:
    return np.array([[float(x) for x in line.split()] for line in text.strip().splitlines()])


_PITCH = np.array(
    [[4.793, 30.79, 0.480], [-1.789, -41.41, -1.787]]
)  # table 1 of M. Brunot's paper, as linear_flight
GTM = Plane(  # an independent six-degree-of-freedom integration of NASA's tables at 75 kt, 7000 ft
    "gtm", 26.195, 0.54830, 2.08751, 0.27898, (1.6555, 6.314, 7.575, 0.3715),
    _rows("-1.0158 .063 .8565 -.0157 .3406\n -.1403 -.3352 .1472 -.0718 .0266\n .2185 -.0528 -.3897 -.0035 -.1700"),
    _PITCH, 42.85, 0.9931, 5.56 * DEG, 2134.0,
)  # fmt: skip
# Dimensions of the real aircraft; derivatives of their class, rounded (Roskam; Klein and Morelli; Jategaonkar).
TRANSPORT = Plane(
    "transport", 17631.0, 64.0, 21.5, 3.159, (133367.0, 252687.0, 359593.0, 11442.0),
    _rows("-.95 0 .5 0 .25\n -.16 -.55 .22 -.26 .035\n .14 -.08 -.25 -.012 -.11"),
    np.array([[5.6, 8.0, 0.5], [-1.1, -24.0, -1.6]]), 131.0, 0.76, 3.0 * DEG, 4800.0,
    gust=(2.0, 2.0, 530.0, 530.0),
)  # fmt: skip
TWIN = Plane(  # published equation error of the Twin Otter (Klein and Morelli, 2006)
    "twin", 4800.0, 39.0, 19.8, 1.98, (22600.0, 31000.0, 50800.0, 1500.0),
    _rows("-.845 0 .963 0 .343\n -.1051 -.528 .193 -.2117 .0299\n .0854 -.0515 -.198 .0023 -.1305"),
    np.array([[5.2, 10.0, 0.4], [-1.5, -34.0, -1.85]]), 72.0, 1.0, 2.0 * DEG, 2000.0, gust=(1.5, 1.5, 530.0, 530.0),
)  # fmt: skip
LIGHT_AIRCRAFT = Plane(
    "light", 1045.0, 16.2, 10.9, 1.49, (1285.0, 1825.0, 2667.0, 0.0),
    _rows("-.393 -.075 .214 0 .187\n -.0923 -.484 .0798 -.229 .0147\n .0587 -.0278 -.0937 .0216 -.0645"),
    np.array([[4.6, 7.7, 0.43], [-0.89, -12.4, -1.28]]), 50.0, 1.06, 2.0 * DEG, 1500.0, gust=(1.5, 1.5, 530.0, 530.0),
)  # fmt: skip
JET = Plane(
    "jet", 5000.0, 15.8, 7.7, 2.36, (2400.0, 38000.0, 40000.0, 300.0),
    _rows("-1.1 0 .5 -.03 .2\n -.10 -.35 .15 -.09 .02\n .25 -.03 -.45 -.006 -.11"),
    np.array([[4.4, 6.0, 0.6], [-0.8, -14.0, -1.1]]), 180.0, 0.9, 3.0 * DEG, 3000.0, gust=(2.0, 2.0, 530.0, 530.0),
)  # fmt: skip
PLANES = {plane.name: plane for plane in (GTM, TRANSPORT, TWIN, LIGHT_AIRCRAFT, JET)}


@dataclass(frozen=True)
class Reading:
    """Errors of one instrument, SI; x ahead, y right, z below the CG."""

    noise: float = 0.0
    bias: float = 0.0
    scale: float = 1.0
    lag: float = 0.0
    delay: float = 0.0
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0


SENSORS: Mapping[str, Reading] = {
    "airspeed_m_s": Reading(0.1),
    "alpha_rad": Reading(0.031 * DEG),
    "theta_rad": Reading(0.05 * DEG),
    "q_rad_s": Reading(0.386 * DEG),
    "ax_m_s2": Reading(0.0058 * G0),
    "az_m_s2": Reading(0.0082 * G0),
    "elevator_rad": Reading(0.01 * DEG),
    "beta_rad": Reading(0.033 * DEG),
    "p_rad_s": Reading(0.522 * DEG, -0.0057 * DEG),
    "r_rad_s": Reading(0.333 * DEG, -0.0286 * DEG),
    "phi_rad": Reading(0.05 * DEG),
    "psi_rad": Reading(0.05 * DEG, -0.04 * DEG),
    "ay_m_s2": Reading(0.0065 * G0),
    "aileron_rad": Reading(0.01 * DEG),
    "rudder_rad": Reading(0.01 * DEG),
}
"""The GTM's sensors, one sigma per sample (NASA GTM_DesignSim)."""
Shape = Callable[[Array], Array]


def straight(plane: Plane) -> tuple[float, float, float]:
    """Aileron, rudder and bank [rad] that hold the aircraft straight without sideslip, to first order in the bank."""
    trim_cl = plane.mass * G0 / (0.5 * plane.density * plane.speed**2 * plane.area)
    force, roll, yaw = plane.at_rest
    roll += (plane.roll_per_lift + plane.cg_right / plane.span * np.cos(plane.alpha)) * trim_cl
    yaw += plane.cg_right / plane.span * np.sin(plane.alpha) * trim_cl
    aileron, rudder = np.linalg.lstsq(plane.lateral[1:, 3:], [-roll, -yaw])[0]
    side = force + plane.lateral[0, 3] * aileron + plane.lateral[0, 4] * rudder
    return float(aileron), float(rudder), float(-side / trim_cl / np.cos(plane.alpha))


def steps(start_s: float, unit_s: float, *signs: float) -> Shape:
    """Successive steps, each one unit long: 1, -1, -1, 1 is a 1-2-1."""

    def shape(t: Array) -> Array:
        number = np.floor((t - start_s) / unit_s + 1e-9).astype(int)
        inside = (number >= 0) & (number < len(signs))
        return np.where(inside, np.array(signs)[np.clip(number, 0, len(signs) - 1)], 0.0)

    return shape


def summed(*parts: Shape) -> Shape:
    return lambda t: np.sum([part(t) for part in parts], axis=0)


def multisine(first: int, start_s: float, stop_s: float, seed: int) -> Shape:
    """Every other harmonic from ``first`` up to 2 Hz, random phases, unit amplitude; other surfaces take the rest."""
    rng = np.random.default_rng(seed)
    length = stop_s - start_s
    numbers = np.arange(first, int(2.0 * length), 2)
    phases = rng.uniform(0.0, 2.0 * np.pi, len(numbers))

    def shape(t: Array) -> Array:
        x = np.sin(2.0 * np.pi * np.outer(t - start_s, numbers) / length + phases).sum(axis=1)
        inside = (t >= start_s) & (t <= stop_s)
        return x * inside / max(float(np.abs(x[inside]).max()), 1e-12)

    return shape


def still(t: Array) -> Array:
    return np.zeros_like(t)


@dataclass(frozen=True)
class Flight:
    """One record: aircraft, inputs with amplitudes [rad], gusts over the light level, instruments, rate, seed."""

    plane: Plane = GTM
    aileron: Shape = field(default=steps(1.0, 0.4, 1, -1, -1, 1))
    rudder: Shape = field(default=steps(3.5, 0.25, 1, 1, 1, -1, -1, 1, -1))
    elevator: Shape = still
    amplitudes: tuple[float, float, float] = (3.5 * DEG, 3.5 * DEG, 0.0)
    gust: float = 0.0
    sensors: Mapping[str, Reading] = field(default_factory=lambda: SENSORS)
    rate_hz: float = 50.0
    duration_s: float = 12.0
    seed: int = 0
    heading: float = 0.6
    aileron_delay: float = 0.0
    rudder_delay: float = 0.0

    def reading(self, channel: str, **errors: float) -> Flight:
        """The flight with further errors of one instrument."""
        own = replace(self.sensors.get(channel, Reading()), **errors)
        return replace(self, sensors={**self.sensors, channel: own})

    def quiet(self, share: float = 0.0) -> Flight:
        """The flight with a share of the noise, and no bias."""
        return replace(
            self, sensors={n: replace(r, noise=share * r.noise, bias=0.0) for n, r in self.sensors.items()}
        )


def record_pair(
    amplitude_rad: float = 3.5 * DEG, gust: float = 0.0, seed: int = 0, **other: object
) -> list[Flight]:
    """Aileron 1-2-1 then rudder 3-2-1-1, in both signs."""
    return [
        Flight(amplitudes=(s * amplitude_rad, s * amplitude_rad, 0.0), gust=gust, seed=2 * seed + k, **other)  # type: ignore[arg-type]
        for k, s in enumerate((1.0, -1.0))
    ]


def dryden(rng: np.random.Generator, samples: int, dt: float, sigma: float, tau: float, order: int) -> Array:
    """Stationary Dryden gust of first (u) or second order (v, w), exactly discretised (MIL-F-8785C, 3.7.1)."""
    if sigma <= 0.0:
        return np.zeros(samples)
    if order == 1:
        a, b, c = np.array([[-1.0 / tau]]), np.array([[1.0]]), sigma * np.sqrt(2.0 / tau) * np.ones(1)
    else:
        a = np.array([[0.0, 1.0], [-1.0 / tau**2, -2.0 / tau]])
        b = np.array([[0.0], [1.0]])
        c = sigma * np.sqrt(tau) / tau**2 * np.array([1.0, np.sqrt(3.0) * tau])
    n = len(a)
    big = np.zeros((2 * n, 2 * n))  # C. F. Van Loan, IEEE TAC 23, 1978
    big[:n, :n], big[:n, n:], big[n:, n:] = -a, b @ b.T, a.T
    exponential = expm(big * dt)
    phi = exponential[n:, n:].T
    cov = phi @ exponential[:n, n:]
    root = np.linalg.cholesky(0.5 * (cov + cov.T))
    stationary = np.linalg.solve(np.eye(n * n) - np.kron(phi, phi), cov.ravel()).reshape(n, n)
    x = np.linalg.cholesky(0.5 * (stationary + stationary.T)) @ rng.standard_normal(n)
    out = np.empty(samples)
    for k, z in enumerate(rng.standard_normal((samples, n)) @ root.T):
        out[k] = c @ x
        x = phi @ x + z
    return out


def fly(flight: Flight) -> dict[str, Array]:
    """Truth at 200 Hz: t_s, every channel of the log at the CG, p_dot, q_dot, r_dot and the gusts."""
    plane, dt = flight.plane, 1.0 / FINE_HZ
    t = np.arange(round(flight.duration_s * FINE_HZ) + 1) * dt
    rng = np.random.default_rng([flight.seed, 7])
    su, sv, lu, lv = plane.gust
    air = np.stack([
        dryden(rng, t.size, dt, flight.gust * su, lu / plane.speed, 1),
        dryden(rng, t.size, dt, flight.gust * sv, lv / plane.speed, 2),
        dryden(rng, t.size, dt, flight.gust * sv, lv / plane.speed, 2),
    ], axis=1)  # fmt: skip
    commands = [
        a * shape(t - late) for a, shape, late in zip(
            flight.amplitudes, (flight.aileron, flight.rudder, flight.elevator),
            (flight.aileron_delay, flight.rudder_delay, 0.0), strict=True,
        )
    ]  # fmt: skip
    decay = np.exp(-plane.servo_rad_s * dt)
    surfaces = np.stack([lfilter([0.0, 1.0 - decay], [1.0, -decay], c) for c in commands], axis=1)
    aileron, rudder, bank = straight(plane)
    surfaces[:, :2] += aileron, rudder
    rates = _equations(plane)
    x = np.empty((t.size, 9))  # u v w p q r phi theta psi
    x[0] = [
        plane.speed * np.cos(plane.alpha),
        0,
        plane.speed * np.sin(plane.alpha),
        0,
        0,
        0,
        bank,
        plane.alpha,
        flight.heading,
    ]
    for k in range(t.size - 1):
        mid_s, mid_a = 0.5 * (surfaces[k] + surfaces[k + 1]), 0.5 * (air[k] + air[k + 1])
        k1 = rates(x[k], surfaces[k], air[k])[0]
        k2 = rates(x[k] + 0.5 * dt * k1, mid_s, mid_a)[0]
        k3 = rates(x[k] + 0.5 * dt * k2, mid_s, mid_a)[0]
        k4 = rates(x[k] + dt * k3, surfaces[k + 1], air[k + 1])[0]
        x[k + 1] = x[k] + dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    dots, forces = map(
        np.array, zip(*(rates(*row) for row in zip(x, surfaces, air, strict=True)), strict=True)
    )
    u, v, w = (x[:, :3] - air).T
    speed = np.sqrt(u**2 + v**2 + w**2)
    ones = np.ones_like(t)
    delayed = {"aileron": flight.aileron_delay, "rudder": flight.rudder_delay}
    logged = {n: np.interp(t + late, t, surfaces[:, i]) for i, (n, late) in enumerate(delayed.items())}
    return {
        "t_s": t, "airspeed_m_s": speed, "alpha_rad": np.arctan2(w, u), "beta_rad": np.arcsin(v / speed),
        "p_rad_s": x[:, 3], "q_rad_s": x[:, 4], "r_rad_s": x[:, 5],
        "phi_rad": x[:, 6], "theta_rad": x[:, 7], "psi_rad": x[:, 8],
        "ax_m_s2": forces[:, 0], "ay_m_s2": forces[:, 1], "az_m_s2": forces[:, 2],
        "p_dot": dots[:, 3], "q_dot": dots[:, 4], "r_dot": dots[:, 5],
        "aileron_rad": logged["aileron"], "rudder_rad": logged["rudder"], "elevator_rad": surfaces[:, 2],
        "density_kg_m3": plane.density * ones, "altitude_m": plane.altitude * ones,
    }  # fmt: skip


def _equations(plane: Plane) -> Callable[[Array, Array, Array], tuple[Array, Array]]:
    """Derivative of the state and specific forces from state, surfaces (aileron, rudder, elevator) and gust."""
    ixx, iyy, izz, ixz = plane.inertia
    gamma = ixx * izz - ixz**2
    trim_cl = plane.mass * G0 / (0.5 * plane.density * plane.speed**2 * plane.area)
    rest = plane.at_rest
    drag0 = 0.04
    thrust_share = (
        0.5 * plane.density * plane.speed**2 * plane.area * (drag0 + 0.05 * trim_cl**2) / plane.mass
    )

    def rates(x: Array, surface: Array, gust: Array) -> tuple[Array, Array]:
        p, q, r, phi, theta = x[3:8]
        ua, va, wa = x[:3] - gust
        speed = np.sqrt(ua * ua + va * va + wa * wa)
        alpha, beta = np.arctan2(wa, ua), np.arcsin(va / speed)
        pressure = 0.5 * plane.density * speed**2 * plane.area
        half_span, half_chord = plane.span / (2.0 * speed), plane.chord / (2.0 * speed)
        cy, cl, cn = plane.lateral @ np.array([beta, p * half_span, r * half_span, surface[0], surface[1]])
        lift, moment = plane.pitch @ np.array([alpha - plane.alpha, q * half_chord, surface[2]])
        lift += trim_cl
        cy, cl, cn = cy + rest[0], cl + rest[1] + plane.roll_per_lift * lift, cn + rest[2]
        drag = drag0 + 0.05 * lift**2
        ca, sa = np.cos(alpha), np.sin(alpha)
        # thrust along the trim's flight path, so that level flight is an equilibrium
        ax = pressure / plane.mass * (-drag * ca + lift * sa) + thrust_share * np.cos(plane.alpha)
        az = pressure / plane.mass * (-drag * sa - lift * ca) + thrust_share * np.sin(plane.alpha)
        ay = pressure / plane.mass * cy
        roll, pitch, yaw = (
            pressure * plane.span * cl - plane.cg_right * plane.mass * az,
            pressure * plane.chord * moment,
            pressure * plane.span * cn + plane.cg_right * plane.mass * ax,
        )
        u, v, w = x[:3]
        st, ct, sf, cf = np.sin(theta), np.cos(theta), np.sin(phi), np.cos(phi)
        roll_sum = roll + ixz * p * q - (izz - iyy) * q * r
        yaw_sum = yaw - ixz * q * r - (iyy - ixx) * p * q
        turn = (q * sf + r * cf) / ct
        dot = np.array([
            r * v - q * w - G0 * st + ax,
            p * w - r * u + G0 * ct * sf + ay,
            q * u - p * v + G0 * ct * cf + az,
            (izz * roll_sum + ixz * yaw_sum) / gamma,
            (pitch - (ixx - izz) * p * r - ixz * (p * p - r * r)) / iyy,
            (ixz * roll_sum + ixx * yaw_sum) / gamma,
            p + turn * st,
            q * cf - r * sf,
            turn,
        ])  # fmt: skip
        return dot, np.array([ax, ay, az])

    return rates


def at_instruments(truth: Mapping[str, Array], sensors: Mapping[str, Reading]) -> dict[str, Array]:
    """Channels where the instruments are: the velocity and the acceleration of a point of a rigid body."""
    p, q, r = (truth[n] for n in ("p_rad_s", "q_rad_s", "r_rad_s"))
    pd, qd, rd = (truth[n] for n in ("p_dot", "q_dot", "r_dot"))
    place = {n: sensors.get(n, Reading()) for n in ("alpha_rad", "beta_rad", "ax_m_s2", "ay_m_s2", "az_m_s2")}
    result = {n: x for n, x in truth.items() if n in SENSORS or n in ("density_kg_m3", "altitude_m")}
    speed, a, b = truth["airspeed_m_s"], truth["alpha_rad"], truth["beta_rad"]
    u, v, w = speed * np.cos(a) * np.cos(b), speed * np.sin(b), speed * np.sin(a) * np.cos(b)
    for name in ("alpha_rad", "beta_rad"):
        x, y, z = place[name].x, place[name].y, place[name].z
        lu, lv, lw = u + q * z - r * y, v + r * x - p * z, w + p * y - q * x
        result[name] = (
            np.arctan2(lw, lu) if name == "alpha_rad" else np.arcsin(lv / np.sqrt(lu**2 + lv**2 + lw**2))
        )
    o = place["ax_m_s2"]
    result["ax_m_s2"] = truth["ax_m_s2"] - (q**2 + r**2) * o.x + (p * q - rd) * o.y + (p * r + qd) * o.z
    o = place["ay_m_s2"]
    result["ay_m_s2"] = truth["ay_m_s2"] + (p * q + rd) * o.x - (p**2 + r**2) * o.y + (q * r - pd) * o.z
    o = place["az_m_s2"]
    result["az_m_s2"] = truth["az_m_s2"] + (p * r - qd) * o.x + (q * r + pd) * o.y - (p**2 + q**2) * o.z
    return result


def recorded(flight: Flight) -> dict[str, Array]:
    """Channels of the log at its rate, `t_s` with them."""
    truth = fly(flight)
    t = truth["t_s"]
    every = round(FINE_HZ / flight.rate_hz)
    result = {"t_s": t[::every]}
    for number, (name, x) in enumerate(at_instruments(truth, flight.sensors).items()):
        error = flight.sensors.get(name, Reading())
        if error.lag > 0.0:
            decay = np.exp(-1.0 / FINE_HZ / error.lag)
            mean = (1.0 - decay) * error.lag * FINE_HZ  # linear between samples
            x = lfilter([1.0 - mean, mean - decay], [1.0, -decay], x, zi=[x[0] * mean])[0]
        if error.delay > 0.0:
            x = np.interp(t - error.delay, t, x)
        x = (error.scale * x + error.bias)[::every]
        result[name] = x + error.noise * np.random.default_rng([flight.seed, 11, number]).standard_normal(
            x.size
        )
    return result


def log_of(*flights: Flight, leave_out: tuple[str, ...] = ()) -> FlightLog:
    """One log, a run for each flight."""
    parts = [recorded(flight) for flight in flights]
    names = [n for n in parts[0] if n not in ("t_s", *leave_out)]
    return FlightLog(
        metadata={},
        run_ids=tuple(f"{f.plane.name}-{i:03d}" for i, f in enumerate(flights)),
        offsets=np.concatenate([[0], np.cumsum([len(p["t_s"]) for p in parts])]).astype(np.int64),
        t_s=np.concatenate([p["t_s"] for p in parts]),
        channels={n: np.concatenate([p[n] for p in parts]) for n in names},
    )


@dataclass(frozen=True)
class Undeclared:
    """What a blind trial hides: effect -> size in SI, and the flights that carry it."""

    effects: Mapping[str, float]
    flights: tuple[Flight, ...]


_SENSOR_ERRORS: Mapping[str, tuple[str, str, tuple[float, float]]] = {
    "vane_arm:beta_rad": ("beta_rad", "x", (0.4, 1.5)),
    "vane_lag:beta_rad": ("beta_rad", "lag", (0.05, 0.15)),
    "vane_scale:beta_rad": ("beta_rad", "scale", (1.06, 1.2)),
    "gyro_scale:p_rad_s": ("p_rad_s", "scale", (1.05, 1.15)),
    "gyro_scale:r_rad_s": ("r_rad_s", "scale", (1.05, 1.15)),
    "gyro_lag:p_rad_s": ("p_rad_s", "lag", (0.03, 0.1)),
    "gyro_lag:r_rad_s": ("r_rad_s", "lag", (0.03, 0.1)),
    "sensor_delay:beta_rad": ("beta_rad", "delay", (0.05, 0.15)),
    "sensor_delay:phi_rad": ("phi_rad", "delay", (0.03, 0.12)),
    "accelerometer_scale:ay_m_s2": ("ay_m_s2", "scale", (1.1, 1.3)),
    "accelerometer_arm:ay_m_s2": ("ay_m_s2", "x", (0.4, 1.5)),
}
_MODEL_ERRORS: Mapping[str, tuple[float, float]] = {
    "aileron_effectiveness": (0.6, 0.85),
    "rudder_effectiveness": (0.6, 0.85),
    "aileron_delay": (0.03, 0.1),
    "rudder_delay": (0.03, 0.1),
    "adverse_yaw": (0.02, 0.05),
    "dihedral": (0.03, 0.08),
}
MODES = ("lateral-none", "lateral-sensor", "lateral-model", "lateral-two")
"""Modes of blind trials: nothing undeclared, one error of a sensor, one of the aircraft, one of either."""


def trial(mode: str, seed: int, gust: float | None = None, records: int = 4) -> Undeclared:
    """Draw one blind trial.

    Raises
    ------
    ValueError
        If the mode is none of `MODES`.
    """
    if mode not in MODES:
        raise ValueError(f"mode {mode!r}: none of {', '.join(MODES)}")
    rng = np.random.default_rng([seed, MODES.index(mode)])
    level = float(rng.choice([0.0, 0.5, 1.0])) if gust is None else gust
    flights = [
        replace(f, gust=level, seed=100 * seed + i)
        for i, f in enumerate(record_pair() * (records // 2) + record_pair()[: records % 2])
    ]
    chosen: list[str] = []
    if mode in ("lateral-sensor", "lateral-two"):
        chosen.append(str(rng.choice(list(_SENSOR_ERRORS))))
    if mode in ("lateral-model", "lateral-two"):
        chosen.append(str(rng.choice(list(_MODEL_ERRORS))))
    effects: dict[str, float] = {}
    for name in chosen:
        low, high = _SENSOR_ERRORS[name][2] if name in _SENSOR_ERRORS else _MODEL_ERRORS[name]
        effects[name] = float(rng.uniform(low, high))
        flights = [with_effect(f, name, effects[name]) for f in flights]
    return Undeclared(effects, tuple(flights))


def with_effect(flight: Flight, name: str, size: float) -> Flight:
    """The flight with one undeclared effect of a size in SI.

    Raises
    ------
    KeyError
        If there is no such effect.
    """
    if name in _SENSOR_ERRORS:
        channel, attribute, _ = _SENSOR_ERRORS[name]
        return flight.reading(channel, **{attribute: size})
    lateral = flight.plane.lateral.copy()
    if name == "aileron_delay":
        return replace(flight, aileron_delay=size)
    if name == "rudder_delay":
        return replace(flight, rudder_delay=size)
    change: dict[str, Callable[[], None]] = {
        "aileron_effectiveness": lambda: lateral.__setitem__((slice(None), 3), size * lateral[:, 3]),
        "rudder_effectiveness": lambda: lateral.__setitem__((slice(None), 4), size * lateral[:, 4]),
        "adverse_yaw": lambda: lateral.__setitem__((2, 3), lateral[2, 3] + size),
        "dihedral": lambda: lateral.__setitem__((1, 0), lateral[1, 0] - size),
    }
    change[name]()
    return replace(flight, plane=replace(flight.plane, lateral=lateral))


def modes_of(plane: Plane) -> NDArray[np.complex128]:
    """Eigenvalues of the lateral motion (v, p, r, phi) about the trim, by differences of the equations of motion."""
    rates = _equations(plane)
    x0 = np.array(
        [
            plane.speed * np.cos(plane.alpha),
            0,
            plane.speed * np.sin(plane.alpha),
            0,
            0,
            0,
            0,
            plane.alpha,
            0.0,
        ]
    )
    index, zero = [1, 3, 5, 6], np.zeros(3)
    columns = []
    for i in index:
        step = np.zeros(9)
        step[i] = 1e-5
        columns.append((rates(x0 + step, zero, zero)[0] - rates(x0 - step, zero, zero)[0])[index] / 2e-5)
    return np.asarray(np.linalg.eigvals(np.array(columns).T))


__all__ = [
    "GTM", "LATERAL", "MODES", "PLANES", "SENSORS", "Flight", "Plane", "Reading", "Undeclared", "at_instruments", "dryden",
    "fly", "log_of", "modes_of", "multisine", "record_pair", "recorded", "steps", "still", "straight", "summed", "trial",
    "with_effect",
]  # fmt: skip
