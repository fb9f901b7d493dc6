"""A flown log, and its export as other people's files: odd names, other units, other signs."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from airtruth.logs.flight_log import FlightLog
from airtruth.logs.store import iter_logs
from airtruth.simulation.campaign import run as campaign

DEG = np.pi / 180.0
FOOT, POUND_G = 0.3048, 9.80665

CAMPAIGN = """
schema = 1
name = "{name}"
title = "for export"
aircraft = "gtm"
runs = {runs}
seed = 3
duration_s = {duration_s}

[condition]
eas_kt = 75.0
altitude_ft = 7000.0

[[manoeuvre]]
kind = "3211"
amplitude_deg = 2.0
start_s = 1.0
step_s = 0.4

[gust]
figures = "gtm"
level = "light"
factor = {gust}
{extra}
"""


def flown(folder: Path, name="export", runs=2, duration_s=8.0, gust=0.3, extra="") -> FlightLog:
    """Fly a campaign and return its runs as one log."""
    file = folder / f"{name}.toml"
    file.write_text(CAMPAIGN.format(name=name, runs=runs, duration_s=duration_s, gust=gust, extra=extra))
    campaign.fly(file, folder / name)
    logs = list(iter_logs(folder / name))
    lengths = [n for log in logs for n in np.diff(log.offsets)]
    return FlightLog(
        metadata={"aircraft": "gtm"},
        run_ids=tuple(i for log in logs for i in log.run_ids),
        offsets=np.cumsum([0, *lengths]).astype(np.int64),
        t_s=np.concatenate([log.t_s for log in logs]),
        channels={n: np.concatenate([log.channels[n] for log in logs]) for n in logs[0].channels},
    )


def foreign(log: FlightLog, run: int = 0) -> dict[str, np.ndarray]:
    """Columns of one run as a test centre might write them; elevator trailing edge up positive, nz up."""
    c = {name: values[log.rows(run)] for name, values in log.channels.items()}
    return {
        "Clock [ms]": log.t_s[log.rows(run)] * 1000.0 + 36000.0,
        "KTAS": c["airspeed_m_s"] * 3600.0 / 1852.0,
        "AOA_nose": c["alpha_rad"] / DEG + 1.5,
        "PitchAtt": c["theta_rad"] / DEG,
        "PitchRate": c["q_rad_s"] / DEG,
        "Ax": c["ax_m_s2"] / FOOT,
        "Nz": -c["az_m_s2"] / POUND_G,
        "ELEV_L": -c["elevator_rad"] / DEG - 0.5,
        "ELEV_R": -c["elevator_rad"] / DEG + 0.5,
        "Hp": c["altitude_m"] / FOOT,
        "rho": c["density_kg_m3"] / (14.59390293720636 / FOOT**3),
    }


MAPPING = """
run_id = "flight"
[source]
{source}
[time]
column = "{time}"
unit = "ms"
{variable}
[channels.airspeed_m_s]
column = {airspeed}
unit = "kt"
{variable}
[channels.alpha_rad]
column = {alpha}
unit = "deg"
offset = -1.5
{variable}
[channels.theta_rad]
column = {theta}
unit = "deg"
{variable}
[channels.q_rad_s]
column = {q}
unit = "deg/s"
{variable}
[channels.ax_m_s2]
column = {ax}
unit = "ft/s^2"
{variable}
[channels.az_m_s2]
column = {az}
unit = "g"
sign = -1
{variable}
[channels.elevator_rad]
columns = {elevators}
unit = "deg"
sign = -1
{variable}
[channels.altitude_m]
column = {altitude}
unit = "ft"
{variable}
[channels.density_kg_m3]
column = {density}
unit = "slug/ft3"
{variable}
"""


def mapping_by_name(source: str = "") -> str:
    return MAPPING.format(
        source=source,
        time="Clock [ms]",
        airspeed='"KTAS"',
        alpha='"AOA_nose"',
        theta='"PitchAtt"',
        q='"PitchRate"',
        ax='"Ax"',
        az='"Nz"',
        elevators='["ELEV_L", "ELEV_R"]',
        altitude='"Hp"',
        density='"rho"',
        variable="",
    )


def mapping_by_number(variable: str) -> str:
    """For a matrix whose columns stand in the order of `foreign`."""
    text = MAPPING.format(
        source="",
        time="1",
        airspeed=2,
        alpha=3,
        theta=4,
        q=5,
        ax=6,
        az=7,
        elevators="[8, 9]",
        altitude=10,
        density=11,
        variable=f'variable = "{variable}"',
    )
    return text.replace('column = "1"', "column = 1")


def write_csv(path: Path, columns: dict[str, np.ndarray], delimiter: str = ",") -> None:
    rows = [delimiter.join(f"{x:.17g}" for x in row) for row in zip(*columns.values(), strict=True)]
    path.write_text("\n".join([delimiter.join(columns), *rows]) + "\n")
