"""Flights of an aircraft whose lateral aerodynamics are affine, by an integration of its own: known truth for estimators.

Constant alpha, theta and inertial speed; the equations of Klein and Morelli, 3.2, with sin(phi) and the products of rates.
Gusts u and v have Dryden's spectra. Nothing of airtruth.identification or of airtruth.physics is used.
"""

from types import SimpleNamespace

import numpy as np

from airtruth.logs.flight_log import Batch, FlightLog
from airtruth.units import DEG, FT, G0, KT, LB, SLUG

SLUG_FT2 = SLUG * FT**2
GTM = SimpleNamespace(
    name="gtm",
    wing_area_m2=5.9018 * FT**2,
    chord_m=0.9153 * FT,
    span_m=2.08751,
    mass_kg=57.75 * LB,
    inertia_xx_kg_m2=1.221 * SLUG_FT2,
    inertia_yy_kg_m2=4.657 * SLUG_FT2,
    inertia_zz_kg_m2=5.587 * SLUG_FT2,
    inertia_xz_kg_m2=0.274 * SLUG_FT2,
)
"""NASA GTM T-2, GTM_DesignSim."""
NAMES = [c + s for c in ("CY", "Cl", "Cn") for s in ("beta", "p", "r", "da", "dr")]
THETA = np.array(
    [
        *(-1.0158, 0.063, 0.8565, -0.0157, 0.3406),
        *(-0.1403, -0.3352, 0.1472, -0.0718, 0.0266),
        *(0.2185, -0.0528, -0.3897, -0.0035, -0.1700),
    ]
)
"""Its derivatives at 75 kt EAS, 7000 ft, per rad, from an independent integration of NASA's tables."""
SPEED = 42.85
DENSITY = 1.225 * (75.0 * KT / SPEED) ** 2
ALPHA = np.radians(5.56)
NOISE = {
    "beta_rad": 0.033 * DEG,
    "p_rad_s": 0.522 * DEG,
    "r_rad_s": 0.333 * DEG,
    "phi_rad": 0.05 * DEG,
    "ay_m_s2": 0.0065 * G0,
    "airspeed_m_s": 0.06 * KT,
    "alpha_rad": 0.031 * DEG,
    "q_rad_s": 0.3857 * DEG,
}
"""Standard deviations of the GTM's instruments per sample at 200 Hz."""
LIGHT = (1.166, 0.812, 911.0, 840.0)
"""Light gusts of the GTM at 7000 ft: standard deviations of u and v [m/s], their scale lengths [m]."""
RATE, PICK = 200, 4
SERVO_S = 1.0 / (2.0 * np.pi * 5.0)


def commands(runs, seconds, amplitude, sign):
    """(2, runs, samples at 200 Hz) aileron 1-2-1 of 0.4 s, then rudder 3-2-1-1 of 0.25 s [rad]; sign of each run."""
    t = np.arange(round(seconds * RATE) + 1) / RATE
    aileron, rudder = np.zeros_like(t), np.zeros_like(t)
    for start, length, level in ((1.0, 0.4, 1), (1.4, 0.8, -1), (2.2, 0.4, 1)):
        aileron[(t >= start) & (t < start + length)] = level
    for start, length, level in ((4.0, 0.75, 1), (4.75, 0.5, -1), (5.25, 0.25, 1), (5.5, 0.25, -1)):
        rudder[(t >= start) & (t < start + length)] = level
    return (
        amplitude
        * np.asarray(sign)[None, :, None]
        * np.stack([aileron, rudder])[:, None, :]
        * np.ones((1, runs, 1))
    )


def servo(command):
    """First-order servo behind a command held between samples, exactly, from its first value."""
    decay = np.exp(-1.0 / (RATE * SERVO_S))
    out = np.zeros_like(command)
    for k in range(1, command.shape[-1]):
        out[..., k] = decay * out[..., k - 1] + (1.0 - decay) * command[..., k - 1]
    return out


def gusts(rng, runs, samples, level):
    """(2, runs, samples) u and v at ``level`` times light gusts [m/s], stationary, of Dryden's spectra."""
    dt = 1.0 / RATE
    draws = rng.standard_normal((2, runs, samples + 1))
    sigma_u, sigma_v, length_u, length_v = LIGHT
    a = SPEED / np.array([length_u, length_v])
    decay, kick = np.exp(-a * dt)[:, None], np.sqrt(1.0 - np.exp(-2.0 * a * dt))[:, None]
    out = np.zeros((2, runs, samples))
    first = draws[:, :, 0].copy()
    second = 0.5 * first[1] + 0.5 * rng.standard_normal(runs)
    for k in range(samples):
        out[0, :, k] = sigma_u * first[0]
        out[1, :, k] = sigma_v * np.sqrt(1.5) * (first[1] + (1.0 / np.sqrt(3.0) - 1.0) * second)
        moved = decay * first + kick * draws[:, :, k + 1]
        second = decay[1] * second + 0.5 * a[1] * dt * (decay[1] * first[1] + moved[1])
        first = moved
    return level * out


def fly(
    runs=2,
    seconds=10.0,
    degrees=3.0,
    gust=0.0,
    noise=1.0,
    seed=0,
    theta=THETA,
    start=None,
    q=None,
    curvature=0.0,
    alpha=None,
    slopes=None,
    aerodynamics=None,
):
    """Records of runs at 50 Hz as a `Batch`: doublets of alternating sign, light gusts and the GTM's noise so many times.

    ``start`` is the initial state (4,); ``q`` a function of time [s] for the pitch rate [rad/s], or its values (runs, samples
    at 200 Hz), and ``alpha`` the same for the deviation of the angle of attack [rad]; ``curvature`` times beta |beta| is
    added to Cl, and ``slopes`` (15,) times alpha to ``theta``. ``aerodynamics`` makes CY, Cl, Cn (3, runs) from the signals
    (5, runs) and that deviation (runs,) in place of all this.
    """
    rng = np.random.default_rng(seed)
    sign = np.where(np.arange(runs) % 2 == 0, 1.0, -1.0)
    surface = servo(commands(runs, seconds, degrees * DEG, sign))
    samples = surface.shape[-1]
    u_gust, v_gust = gusts(rng, runs, samples, gust)
    t = np.arange(samples) / RATE
    c = GTM
    inertia = np.array([[c.inertia_xx_kg_m2, -c.inertia_xz_kg_m2], [-c.inertia_xz_kg_m2, c.inertia_zz_kg_m2]])
    inverse = np.linalg.inv(inertia)
    table = np.asarray(theta).reshape(3, 5)
    shift = np.zeros(15) if slopes is None else np.asarray(slopes)
    pitch, attack = (
        np.broadcast_to(
            given(t) if callable(given) else np.zeros_like(t) if given is None else given, u_gust.shape
        )
        for given in (q, alpha)
    )
    # a servo behind a held command moves in exponentials: half a step later by the square root of its decay
    half_decay = np.exp(-0.5 / (RATE * SERVO_S))
    held = np.concatenate(
        [(surface[..., 1:] - half_decay**2 * surface[..., :-1]) / (1 - half_decay**2)], axis=-1
    )
    middle = half_decay * surface[..., :-1] + (1.0 - half_decay) * held

    def affine(signals, attack):
        made = table @ signals + shift.reshape(3, 5) @ (signals * attack)
        made[1] += curvature * signals[0] * np.abs(signals[0])
        return made

    coefficients = affine if aerodynamics is None else aerodynamics

    def rates(x, da_dr, u, v, pitch, attack):
        beta, p, r, phi = x
        speed = SPEED + u
        force = 0.5 * DENSITY * speed**2 * c.wing_area_m2
        signals = np.stack([beta + v / SPEED, p * c.span_m / (2 * speed), r * c.span_m / (2 * speed), *da_dr])
        cy, cl, cn = coefficients(signals, attack)
        path = ALPHA + attack
        ixx, iyy, izz, ixz = c.inertia_xx_kg_m2, c.inertia_yy_kg_m2, c.inertia_zz_kg_m2, c.inertia_xz_kg_m2
        roll = force * c.span_m * cl + ixz * p * pitch - (izz - iyy) * pitch * r
        yaw = force * c.span_m * cn - ixz * pitch * r - (iyy - ixx) * p * pitch
        p_dot, r_dot = inverse @ np.stack([roll, yaw])
        ay = force * cy / c.mass_kg
        beta_dot = ay / SPEED + p * np.sin(path) - r * np.cos(path)
        beta_dot = beta_dot + G0 / SPEED * np.cos(ALPHA) * np.sin(phi)
        phi_dot = p + (pitch * np.sin(phi) + r * np.cos(phi)) * np.tan(ALPHA)
        return np.stack([beta_dot, p_dot, r_dot, phi_dot]), ay

    x = np.zeros((4, runs)) if start is None else np.tile(np.asarray(start, dtype=float)[:, None], (1, runs))
    out = np.empty((5, runs, samples))
    h = 1.0 / RATE
    for k in range(samples):
        now = (surface[:, :, k], u_gust[:, k], v_gust[:, k], pitch[:, k], attack[:, k])
        first, ay = rates(x, *now)
        out[:4, :, k], out[4, :, k] = x, ay
        if k + 1 == samples:
            break
        half = (
            middle[:, :, k],
            0.5 * (u_gust[:, k] + u_gust[:, k + 1]),
            0.5 * (v_gust[:, k] + v_gust[:, k + 1]),
            0.5 * (pitch[:, k] + pitch[:, k + 1]),
            0.5 * (attack[:, k] + attack[:, k + 1]),
        )
        after = (
            surface[:, :, k + 1],
            u_gust[:, k + 1],
            v_gust[:, k + 1],
            pitch[:, k + 1],
            attack[:, k + 1],
        )
        second, _ = rates(x + 0.5 * h * first, *half)
        third, _ = rates(x + 0.5 * h * second, *half)
        fourth, _ = rates(x + h * third, *after)
        x = x + h / 6.0 * (first + 2.0 * second + 2.0 * third + fourth)
    one = np.ones((runs, samples))
    channels = {
        "airspeed_m_s": SPEED + u_gust,
        "alpha_rad": ALPHA + attack * one,
        "theta_rad": ALPHA * one,
        "q_rad_s": pitch * one,
        "density_kg_m3": DENSITY * one,
        "beta_rad": out[0] + v_gust / SPEED,
        "p_rad_s": out[1],
        "r_rad_s": out[2],
        "phi_rad": out[3],
        "ay_m_s2": out[4],
        "aileron_rad": surface[0],
        "rudder_rad": surface[1],
    }
    for name, std in NOISE.items():
        channels[name] = channels[name] + noise * std * rng.standard_normal((runs, samples))
    picked = {name: np.ascontiguousarray(values[:, ::PICK]) for name, values in channels.items()}
    times = np.tile(t[::PICK], (runs, 1))
    return Batch(tuple(f"r{k}" for k in range(runs)), PICK / RATE, times, picked)


def pitching(t):
    """Pitch rate of a slow oscillation of the path [rad/s], so that theta, q and az of a log agree."""
    return 0.03 * np.cos(1.5 * t)


def log_of(batch, elevator_degrees=0.0):
    """Runs that were flown with `pitching` as a `FlightLog` that holds the longitudinal channels as well."""
    rng = np.random.default_rng(5)
    shape = batch.t_s.shape
    elevator = elevator_degrees * DEG * np.sign(np.sin(2.0 * np.pi * batch.t_s)) * (batch.t_s < 2.0)
    theta = ALPHA + 0.02 * np.sin(1.5 * batch.t_s)
    q = pitching(batch.t_s)
    channels = {
        **batch.channels,
        "theta_rad": theta + 3e-4 * rng.standard_normal(shape),
        "az_m_s2": -G0 * np.cos(theta) - SPEED * q + 0.06 * rng.standard_normal(shape),
        "elevator_rad": elevator + 1e-5 * rng.standard_normal(shape),
    }
    runs, samples = shape
    return FlightLog(
        metadata={"schema": 1, "aircraft": "gtm", "sample_rate_hz": round(1.0 / batch.dt_s)},
        run_ids=batch.run_ids,
        offsets=samples * np.arange(runs + 1),
        t_s=batch.t_s.ravel(),
        channels={name: values.ravel() for name, values in channels.items()},
    )
