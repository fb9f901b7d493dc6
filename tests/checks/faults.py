"""Physical faults of a log: how each is made, and the channel and the kind that the gate has to name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from airtruth.logs.flight_log import FlightLog

DEG, FT, G0, KT = np.pi / 180.0, 0.3048, 9.80665, 1852.0 / 3600.0
SLUG_FT3 = 515.3788


@dataclass(frozen=True)
class Made:
    """One fault: the change of a log's channels, the channels of which one is named, the kinds allowed."""

    change: Callable[[FlightLog], dict[str, np.ndarray]]
    channels: tuple[str, ...]
    codes: tuple[str, ...]

    def __call__(self, log: FlightLog) -> FlightLog:
        return replace(log, channels={**log.channels, **self.change(log)})


def times(name, factor, *codes):
    return Made(lambda log: {name: factor * log.channels[name]}, (name,), codes)


def plus(name, offset, *codes):
    return Made(lambda log: {name: log.channels[name] + offset(log)}, (name,), codes)


def swapped(one, other):
    return Made(lambda log: {one: log.channels[other], other: log.channels[one]}, (one, other), ("swapped",))


def copied(source, name, *codes):
    return Made(lambda log: {name: log.channels[source].copy()}, (name, source), codes or ("copy", "swapped"))


def constant(name, value=None):
    def change(log):
        x = log.channels[name]
        return {name: np.full_like(x, x.mean() if value is None else value)}

    return Made(change, (name,), ("constant", "impossible", "gravity", "unit", "scale"))


def partly(name, value, share=0.3):
    """A part of every run is replaced by a constant; None freezes the channel at its value there."""

    def change(log):
        x = log.channels[name].copy()
        for run in range(len(log.run_ids)):
            rows = log.rows(run)
            n = rows.stop - rows.start
            part = slice(rows.start + int(0.4 * n), rows.start + int((0.4 + share) * n))
            x[part] = x[part.start] if value is None else value
        return {name: x}

    return Made(change, (name,), ("dropout",))


def scattered(name):
    """Every seventh sample is zero."""

    def change(log):
        x = log.channels[name].copy()
        x[::7] = 0.0
        return {name: x}

    return Made(change, (name,), ("dropout",))


def gravity_out(name):
    def change(log):
        theta = log.channels["theta_rad"]
        own = -G0 * np.cos(theta) if name == "az_m_s2" else G0 * np.sin(theta)
        return {name: log.channels[name] - own}

    return Made(change, (name,), ("gravity",))


FAULTS = {
    "alpha sign": times("alpha_rad", -1.0, "sign"),
    "q sign": times("q_rad_s", -1.0, "sign"),
    "theta sign": times("theta_rad", -1.0, "sign"),
    "az sign": times("az_m_s2", -1.0, "sign"),
    "ax sign": times("ax_m_s2", -1.0, "sign"),
    "elevator sign": times("elevator_rad", -1.0, "sign"),
    "command sign": times("elevator_command_rad", -1.0, "sign"),
    "alpha in deg": times("alpha_rad", 1 / DEG, "unit"),
    "alpha scaled to rad twice": times("alpha_rad", DEG, "unit"),
    "q in deg/s": times("q_rad_s", 1 / DEG, "unit"),
    "q scaled to rad twice": times("q_rad_s", DEG, "unit"),
    "theta in deg": times("theta_rad", 1 / DEG, "unit"),
    "theta scaled to rad twice": times("theta_rad", DEG, "unit"),
    "elevator in deg": times("elevator_rad", 1 / DEG, "unit"),
    "command in deg": times("elevator_command_rad", 1 / DEG, "unit"),
    "alpha in deg, sign": times("alpha_rad", -1 / DEG, "unit_and_sign"),
    "q in deg/s, sign": times("q_rad_s", -1 / DEG, "unit_and_sign"),
    "az in g": times("az_m_s2", 1 / G0, "unit"),
    "az in g, sign": times("az_m_s2", -1 / G0, "unit_and_sign"),
    "az in ft/s2": times("az_m_s2", 1 / FT, "unit"),
    "az in ft/s2, sign": times("az_m_s2", -1 / FT, "unit_and_sign"),
    "az scaled by g": times("az_m_s2", G0, "unit"),
    "ax in g": times("ax_m_s2", 1 / G0, "unit", "gravity"),
    "ax in ft/s2": times("ax_m_s2", 1 / FT, "unit"),
    "ax scaled by g": times("ax_m_s2", G0, "unit"),
    "az without gravity": gravity_out("az_m_s2"),
    "az without gravity, in g": Made(
        lambda log: {"az_m_s2": (log.channels["az_m_s2"] + G0) / G0}, ("az_m_s2",), ("gravity", "unit")
    ),
    "ax without gravity": gravity_out("ax_m_s2"),
    "az with gravity twice": plus("az_m_s2", lambda log: -G0 * np.cos(log.channels["theta_rad"]), "gravity"),
    "airspeed in kt": times("airspeed_m_s", 1 / KT, "unit", "scale"),
    "airspeed in ft/s": times("airspeed_m_s", 1 / FT, "unit", "scale"),
    "airspeed in km/h": times("airspeed_m_s", 3.6, "unit", "scale"),
    "airspeed times 0.2": times("airspeed_m_s", 0.2, "unit", "scale"),
    "airspeed times 10": times("airspeed_m_s", 10.0, "unit", "scale"),
    "altitude in ft": times("altitude_m", 1 / FT, "unit"),
    "altitude in km": times("altitude_m", 1e-3, "unit"),
    "density in slug/ft3": times("density_kg_m3", 1 / SLUG_FT3, "unit"),
    "density times 0.5": times("density_kg_m3", 0.5, "unit", "scale"),
    "density times 1.4": times("density_kg_m3", 1.4, "unit", "scale"),
    "alpha and q": swapped("alpha_rad", "q_rad_s"),
    "alpha and theta": swapped("alpha_rad", "theta_rad"),
    "q and theta": swapped("q_rad_s", "theta_rad"),
    "elevator and command": swapped("elevator_rad", "elevator_command_rad"),
    "ax and az": swapped("ax_m_s2", "az_m_s2"),
    "alpha and elevator": swapped("alpha_rad", "elevator_rad"),
    "q and elevator": swapped("q_rad_s", "elevator_rad"),
    "airspeed and altitude": swapped("airspeed_m_s", "altitude_m"),
    "density and throttle": swapped("density_kg_m3", "throttle"),
    "ax in place of q": copied("ax_m_s2", "q_rad_s"),
    "alpha in place of theta": copied("alpha_rad", "theta_rad"),
    "theta in place of alpha": copied("theta_rad", "alpha_rad"),
    "q in place of alpha": copied("q_rad_s", "alpha_rad"),
    "ax in place of az": copied("ax_m_s2", "az_m_s2", "copy", "swapped", "gravity", "unit"),
    "command in place of elevator": copied("elevator_command_rad", "elevator_rad"),
    "alpha constant": constant("alpha_rad"),
    "q constant": constant("q_rad_s"),
    "theta constant": constant("theta_rad"),
    "az constant": constant("az_m_s2"),
    "elevator constant": constant("elevator_rad"),
    "az zero": constant("az_m_s2", 0.0),
    "density constant, near zero": constant("density_kg_m3", 1e-3),
    "az partly zero": partly("az_m_s2", 0.0),
    "az with zeros": scattered("az_m_s2"),
    "q partly zero": partly("q_rad_s", 0.0),
    "alpha partly zero": partly("alpha_rad", 0.0),
    "alpha frozen": partly("alpha_rad", None),
    "q frozen": partly("q_rad_s", None),
    "az frozen": partly("az_m_s2", None),
    "theta frozen": partly("theta_rad", None),
}
"""Name of the fault -> how it is made."""
