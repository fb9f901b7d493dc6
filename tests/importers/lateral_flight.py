"""Lateral-directional motion beside a flight of `validation.guess_flights`: a linear model, the nonlinear Euler angles."""

from __future__ import annotations

from functools import cache

import numpy as np

from validation.guess_flights import CRAFT, G0, STEP_S, flown

ROLL = {"beta": -15.0, "p": -6.0, "r": 1.5, "aileron": -40.0, "rudder": 0.8}
YAW = {"beta": 6.0, "p": -0.3, "r": -0.9, "aileron": 0.2, "rudder": -6.0}
SIDE = {"beta": -0.22, "rudder": 0.05}
"""Derivatives of p' and r' [1/s2, 1/s], and of the side force over m V [1/s], round figures of a single-engine aircraft."""


def _doublets(t, starts, length, size):
    x = np.zeros_like(t)
    for start in starts:
        x[(t >= start) & (t < start + length)] = size
        x[(t >= start + length) & (t < start + 2.0 * length)] = -size
    return x


@cache
def lateral(craft="single"):
    """Exact channels (samples,) in SI at 400 Hz: those of `flown`, and the lateral-directional ones."""
    c = flown(craft)
    speed = CRAFT[craft].speed
    aileron = _doublets(c["t_s"], (2.0, 14.0), 0.7, 0.06)
    rudder = _doublets(c["t_s"], (7.0, 20.0), 0.9, 0.08)
    states = np.zeros((len(aileron), 5))
    states[0] = 0.0, 0.0, 0.0, 0.05, 6.2
    ay = np.zeros(len(aileron))
    for k in range(len(aileron)):
        beta, p, r, phi, _ = states[k]
        q, theta, alpha = c["q_rad_s"][k], c["theta_rad"][k], c["alpha_rad"][k]
        ay[k] = speed * (SIDE["beta"] * beta + SIDE["rudder"] * rudder[k])
        turn = q * np.sin(phi) + r * np.cos(phi)
        rates = [
            (ay[k] + G0 * np.cos(theta) * np.sin(phi)) / speed - r * np.cos(alpha) + p * np.sin(alpha),
            *(
                d["beta"] * beta
                + d["p"] * p
                + d["r"] * r
                + d["aileron"] * aileron[k]
                + d["rudder"] * rudder[k]
                for d in (ROLL, YAW)
            ),
            p + np.tan(theta) * turn,
            turn / np.cos(theta),
        ]
        if k + 1 < len(states):
            states[k + 1] = states[k] + STEP_S * np.array(rates)
    names = ("beta_rad", "p_rad_s", "r_rad_s", "phi_rad", "psi_rad")
    return {
        **c,
        **dict(zip(names, states.T, strict=True)),
        "ay_m_s2": ay,
        "aileron_rad": aileron,
        "rudder_rad": rudder,
    }


NOISE = {
    "beta_rad": 1e-3,
    "p_rad_s": 4e-3,
    "r_rad_s": 3e-3,
    "phi_rad": 1e-3,
    "psi_rad": 1e-3,
    "ay_m_s2": 0.06,
    "aileron_rad": 3e-4,
    "rudder_rad": 3e-4,
}
"""Standard deviations of the noise [SI]."""


def recorded(channel, craft="single", step=8):
    """Noisy samples at 50 Hz."""
    exact = lateral(craft)[channel][::step]
    rng = np.random.default_rng(sorted(NOISE).index(channel))
    return exact + NOISE[channel] * rng.standard_normal(len(exact))
