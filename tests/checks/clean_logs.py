"""Flights without a fault: every shipped aircraft, gust level, manoeuvre and rate, with and without noise."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np

from airtruth.logs.flight_log import FlightLog
from airtruth.logs.store import log_paths, read_log
from airtruth.simulation.campaign import plan
from airtruth.simulation.campaign import run as campaign

# aircraft: EAS [kt], altitude [ft], gust figures, amplitude [deg], longest record [s].
# The F-16 flies without its control system and is unstable; the Cessna's elevator cable has 3 deg of slack.
FLOWN = {
    "gtm": (75.0, 7000.0, "gtm", 1.0, 20.0),
    "c172x": (90.0, 5000.0, "mil-f-8785c", 4.0, 20.0),
    "f16": (300.0, 10000.0, "mil-f-8785c", 0.5, 4.0),
    "T38": (300.0, 10000.0, "mil-f-8785c", 1.0, 20.0),
}
LEVELS = ("none", "light", "moderate", "severe")
RATES_HZ = (100.0, 50.0, 25.0, 20.0, 10.0)
"""Every rate is picked from the first, as the logs of a campaign are picked from the simulator's steps."""
MANOEUVRES = ("doublet", "3211", "multisine")
NOISE = """
[sensors.channel.airspeed_m_s]
noise_std = { value = 0.3, unit = "m_s" }
[sensors.channel.alpha_rad]
noise_std = { value = 0.1, unit = "deg" }
[sensors.channel.theta_rad]
noise_std = { value = 0.1, unit = "deg" }
[sensors.channel.q_rad_s]
noise_std = { value = 0.3, unit = "deg_s" }
[sensors.channel.ax_m_s2]
noise_std = { value = 0.1, unit = "m_s2" }
[sensors.channel.az_m_s2]
noise_std = { value = 0.3, unit = "m_s2" }
[sensors.channel.elevator_rad]
noise_std = { value = 0.05, unit = "deg" }
"""
CAMPAIGN = """
schema = 1
name = "{name}"
aircraft = "{aircraft}"
runs = 1
seed = {seed}
duration_s = {duration}
log_hz = {rate}
[condition]
eas_kt = {eas}
altitude_ft = {altitude}
[[manoeuvre]]
kind = "{manoeuvre}"
amplitude_deg = {amplitude}
start_s = 1.0
step_s = 0.4
length_s = {length}
[gust]
figures = "{figures}"
level = "{level}"
{sensors}
"""


@dataclass(frozen=True)
class Flight:
    """One flight of the table: aircraft, gust level, manoeuvre, noise, seed."""

    aircraft: str
    level: str
    manoeuvre: str
    noisy: bool
    seed: int

    @property
    def name(self) -> str:
        noise = "noisy" if self.noisy else "own"
        return f"{self.aircraft}-{self.level}-{self.manoeuvre}-{noise}"


def table() -> list[Flight]:
    """96 flights: every aircraft, level and manoeuvre, with the aircraft's own sensors and with much noise."""
    everything = product(FLOWN, LEVELS, MANOEUVRES, (False, True))
    return [Flight(*one, seed=i) for i, one in enumerate(everything)]


def picked(log: FlightLog, rate_hz: float) -> FlightLog:
    """One run with every k-th sample."""
    every = round(RATES_HZ[0] / rate_hz)
    t = log.t_s[::every]
    channels = {name: np.ascontiguousarray(values[::every]) for name, values in log.channels.items()}
    metadata = {**log.metadata, "sample_rate_hz": rate_hz}
    return FlightLog(metadata, log.run_ids, np.array([0, len(t)]), t, channels)


def fly(flight: Flight, folder: Path) -> FlightLog:
    """Fly one entry of the table: one run at the highest rate."""
    eas, altitude, figures, amplitude, longest = FLOWN[flight.aircraft]
    duration = min(longest, (6.0, 10.0, 20.0)[flight.seed // 2 % 3])
    text = CAMPAIGN.format(
        name=flight.name,
        aircraft=flight.aircraft,
        seed=flight.seed,
        duration=duration,
        rate=RATES_HZ[0],
        eas=eas,
        altitude=altitude,
        manoeuvre=flight.manoeuvre,
        amplitude=amplitude,
        length=duration - 1.5,
        figures=figures,
        level=flight.level,
        sensors=NOISE if flight.noisy else "",
    )
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / f"{flight.name}.toml"
    file.write_text(text)
    campaign.fly(plan.make(file), folder / flight.name)
    return read_log(log_paths(folder / flight.name)[0])
