"""Campaigns flown with airtruth.simulation for the tests of the tracer: short, with or without undeclared effects."""

import numpy as np

from airtruth.logs.flight_log import FlightLog
from airtruth.logs.store import log_paths, read_log
from airtruth.simulation.campaign import plan
from airtruth.simulation.campaign import run as campaign

CAMPAIGN = """
schema = 1
name = "{name}"
aircraft = "{aircraft}"
runs = {runs}
seed = {seed}
duration_s = {duration}
[condition]
eas_kt = {eas}
altitude_ft = 7000.0
[[manoeuvre]]
kind = "doublet"
amplitude_deg = {amplitude}
[[manoeuvre]]
kind = "3211"
amplitude_deg = -{amplitude}
start_s = 1.0
step_s = 0.3
{gust}
{effects}
"""
LIGHT = '[gust]\nfigures = "gtm"\nlevel = "light"\n'
CALM = ""


def stated(key, values):
    """An [[effect]] of a campaign file."""
    name, _, variant = key.partition(":")
    lines = ["[[effect]]", f'name = "{name}"', *([f'variant = "{variant}"'] if variant else [])]
    return "\n".join([*lines, *(f"{k} = {float(v)!r}" for k, v in values.items())]) + "\n"


def fly(
    folder,
    effects=(),
    *,
    name="blind",
    aircraft="gtm",
    runs=3,
    seed=5,
    duration=5.0,
    gust=LIGHT,
    amplitude=2.0,
    eas=75.0,
):
    """Fly a campaign into folder/flown; effects: (key, values) each."""
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / f"{name}.toml"
    file.write_text(
        CAMPAIGN.format(
            name=name,
            aircraft=aircraft,
            runs=runs,
            seed=seed,
            duration=duration,
            eas=eas,
            gust=gust,
            amplitude=amplitude,
            effects="".join(stated(k, v) for k, v in effects),
        )
    )
    campaign.fly(plan.make(file), folder / "flown", 1)
    return folder / "flown"


def log_of(place, runs=None):
    """The runs of a flown campaign, or some of them by number, as one log."""
    logs = [read_log(path) for path in log_paths(place)]
    parts = [(log, i) for log in logs for i in range(len(log.run_ids))]
    parts = parts if runs is None else [parts[i] for i in runs]
    lengths = [log.rows(i).stop - log.rows(i).start for log, i in parts]
    return FlightLog(
        metadata=logs[0].metadata,
        run_ids=tuple(log.run_ids[i] for log, i in parts),
        offsets=np.concatenate([[0], np.cumsum(lengths)]),
        t_s=np.concatenate([log.t_s[log.rows(i)] for log, i in parts]),
        channels={
            c: np.concatenate([log.channels[c][log.rows(i)] for log, i in parts]) for c in logs[0].channels
        },
    )
