"""Physical faults of a lateral log: how each is made, and the channel and the kind that the gate has to name."""

from __future__ import annotations

import numpy as np
from faults import DEG, G0, Made, constant, copied, partly, swapped, times


def side_gravity_out():
    def change(log):
        c = log.channels
        return {"ay_m_s2": c["ay_m_s2"] + G0 * np.cos(c["theta_rad"]) * np.sin(c["phi_rad"])}

    return Made(change, ("ay_m_s2",), ("gravity",))


def several(factors, *codes):
    """One mistake of several channels, each of which may be named."""
    return Made(lambda log: {n: k * log.channels[n] for n, k in factors.items()}, tuple(factors), codes)


ANGLES = ("beta_rad", "phi_rad", "psi_rad")
RATES = ("p_rad_s", "r_rad_s")
SURFACES = ("aileron_rad", "rudder_rad")
LATERAL_FAULTS = {
    "beta sign": times("beta_rad", -1.0, "sign"),
    "p sign": times("p_rad_s", -1.0, "sign"),
    "r sign": times("r_rad_s", -1.0, "sign"),
    "phi sign": times("phi_rad", -1.0, "sign"),
    "psi sign": times("psi_rad", -1.0, "sign"),
    "ay sign": times("ay_m_s2", -1.0, "sign"),
    "aileron sign, left and right mixed up": times("aileron_rad", -1.0, "sign"),
    "rudder sign": times("rudder_rad", -1.0, "sign"),
    "beta in deg": times("beta_rad", 1 / DEG, "unit"),
    "p in deg/s": times("p_rad_s", 1 / DEG, "unit"),
    "r in deg/s": times("r_rad_s", 1 / DEG, "unit"),
    "phi in deg": times("phi_rad", 1 / DEG, "unit"),
    "psi in deg": times("psi_rad", 1 / DEG, "unit"),
    "aileron in deg": times("aileron_rad", 1 / DEG, "unit"),
    "rudder in deg": times("rudder_rad", 1 / DEG, "unit"),
    "beta scaled to rad twice": times("beta_rad", DEG, "unit"),
    "p scaled to rad twice": times("p_rad_s", DEG, "unit"),
    "r scaled to rad twice": times("r_rad_s", DEG, "unit"),
    "phi scaled to rad twice": times("phi_rad", DEG, "unit"),
    "psi scaled to rad twice": times("psi_rad", DEG, "unit"),
    "aileron scaled to rad twice": times("aileron_rad", DEG, "unit"),
    "rudder scaled to rad twice": times("rudder_rad", DEG, "unit"),
    "beta in deg, sign": times("beta_rad", -1 / DEG, "unit_and_sign"),
    "p in deg/s, sign": times("p_rad_s", -1 / DEG, "unit_and_sign"),
    "r in deg/s, sign": times("r_rad_s", -1 / DEG, "unit_and_sign"),
    "phi in deg, sign": times("phi_rad", -1 / DEG, "unit_and_sign"),
    "aileron in deg, sign": times("aileron_rad", -1 / DEG, "unit_and_sign"),
    "rudder in deg, sign": times("rudder_rad", -1 / DEG, "unit_and_sign"),
    "ay in g": times("ay_m_s2", 1 / G0, "unit"),
    "ay in g, sign": times("ay_m_s2", -1 / G0, "unit_and_sign", "unit", "sign"),
    "ay scaled by g": times("ay_m_s2", G0, "unit"),
    "ay without gravity": side_gravity_out(),
    "p and r": swapped("p_rad_s", "r_rad_s"),
    "p and q": swapped("p_rad_s", "q_rad_s"),
    "q and r": swapped("q_rad_s", "r_rad_s"),
    "phi and psi": swapped("phi_rad", "psi_rad"),
    "phi and theta": swapped("phi_rad", "theta_rad"),
    "beta and phi": swapped("beta_rad", "phi_rad"),
    "alpha and beta": swapped("alpha_rad", "beta_rad"),
    "ay and az": swapped("ay_m_s2", "az_m_s2"),
    "aileron and rudder": swapped("aileron_rad", "rudder_rad"),
    "p and phi": swapped("p_rad_s", "phi_rad"),
    "r in place of p": copied("r_rad_s", "p_rad_s"),
    "beta in place of phi": copied("beta_rad", "phi_rad"),
    "aileron in place of rudder": copied("aileron_rad", "rudder_rad"),
    "beta constant": constant("beta_rad"),
    "p constant": constant("p_rad_s"),
    "r constant": constant("r_rad_s"),
    "phi constant": constant("phi_rad"),
    "psi constant": constant("psi_rad"),
    "ay constant": constant("ay_m_s2"),
    "ay zero": constant("ay_m_s2", 0.0),
    "p partly zero": partly("p_rad_s", 0.0),
    "beta frozen": partly("beta_rad", None),
    "phi frozen": partly("phi_rad", None),
    "r frozen": partly("r_rad_s", None),
    "left wing down positive": several({"phi_rad": -1.0, "p_rad_s": -1.0}, "sign"),
    "nose left positive": several({"psi_rad": -1.0, "r_rad_s": -1.0}, "sign"),
    "left positive": several({"beta_rad": -1.0, "ay_m_s2": -1.0}, "sign"),
    "lateral angles and rates in degrees": several(dict.fromkeys((*ANGLES, *RATES, *SURFACES), 1 / DEG), "unit"),
    "both rates in degrees": several(dict.fromkeys(RATES, 1 / DEG), "unit"),
    "both surfaces in degrees": several(dict.fromkeys(SURFACES, 1 / DEG), "unit"),
    "all rates in degrees": several(dict.fromkeys((*RATES, "q_rad_s"), 1 / DEG), "unit"),
    "all accelerations in g": several(dict.fromkeys(("ax_m_s2", "ay_m_s2", "az_m_s2"), 1 / G0), "unit"),
}  # fmt: skip
"""Name of the fault -> how it is made."""
