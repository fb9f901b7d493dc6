"""The variants of the paper's campaigns that `studies.paper_study` compares, and their flights."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Final

import numpy as np

from airtruth.aircraft import Aircraft
from airtruth.identification import Options
from airtruth.logs.flight_log import Batch, batches
from airtruth.logs.store import log_paths, read_log
from airtruth.simulation.campaign import plan as planning
from airtruth.simulation.campaign import run as flying

ROOT: Final = Path(__file__).resolve().parents[1]
"""Root of the repository."""

CAMPAIGNS: Final = ROOT / "data" / "campaigns"
"""Folder of the campaign files."""

GTM: Final = ROOT / "aircraft" / "gtm"
"""Declared aircraft."""

QUICK_DIVISOR: Final = 10
"""Factor by which a quick study reduces the number of runs [-]."""

TRIM_AIRSPEED_M_S: Final = 42.852
"""True airspeed of the trim at 75 kt EAS and 7000 ft [m/s]; the paper's dynamic pressure is that of the trim."""

PAPER: Final = Options(airspeed_m_s=TRIM_AIRSPEED_M_S, covariance="none")
"""Options of the paper."""

IDEAL: Final = "\n[sensors]\nideal = true\n"
"""Text of a campaign file for sensors without errors."""


@dataclass(frozen=True)
class Case:
    """A variant of a campaign.

    Attributes
    ----------
    label : name of the variant.
    level : campaign of which it is a variant, "light" or "moderate".
    settings : key of the campaign file -> its new value, as TOML.
    extra : text appended to the file.
    u, w : factors of the gust components, in addition to the factor in the file [-].
    options : options of the identification.
    from_s : start of the identified part of the record [s].
    lead_s : time by which the measured elevator, shifted ahead, replaces the command [s]; None for the command.
    """

    label: str
    level: str = "light"
    settings: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    extra: str = ""
    u: float = 1.0
    w: float = 1.0
    options: Options = PAPER
    from_s: float = 0.0
    lead_s: float | None = None


MEASURED: Final = replace(PAPER, airspeed_m_s=None)
"""Options with the measured airspeed."""

WINDOW: Final = replace(PAPER, trim="mean", trim_window_s=1.9)
"""Options with the mean of the first 1.9 s as the trim."""

TIGHT: Final = replace(PAPER, tolerance=1e-3)
"""Options with a tolerance of 0.1 %."""

CROPPED: Final = Case("record begins with the doublet", from_s=2.0)
"""Record without the part before the doublet."""

SETTINGS: Final = (
    Case("the best setting"),
    Case("doublet of +-2 deg", settings={"amplitude_deg": "2.0"}),
    Case("+-2 deg, gusts 1.75", settings={"amplitude_deg": "2.0", "factor": "1.75"}),
    Case("+-2 deg, gusts 2", settings={"amplitude_deg": "2.0", "factor": "2.0"}),
    Case("first pulse nose-up", settings={"amplitude_deg": "-1.0"}),
    Case("gusts 0.75", settings={"factor": "0.75"}),
    Case("gusts 1.25", settings={"factor": "1.25"}),
    Case("gusts stationary", settings={"start": '"stationary"'}),
    Case("record of 5 s", settings={"duration_s": "5.0"}),
    Case("record of 10 s", settings={"duration_s": "10.0"}),
    Case("record of 20 s", settings={"duration_s": "20.0"}),
    Case(
        "5 s, +-2 deg, gusts 1.75", settings={"duration_s": "5.0", "amplitude_deg": "2.0", "factor": "1.75"}
    ),
    Case("doublet at 1 s", settings={"start_s": "1.0"}),
    CROPPED,
    Case("airspeed measured", options=MEASURED),
    Case("trim: mean of the first 1.9 s", options=WINDOW),
    Case("tolerance 0.1 %", options=TIGHT),
)
"""Settings of the light campaign."""

MODERATE: Final = (
    Case("the best setting", level="moderate"),
    Case("record of 5 s", level="moderate", settings={"duration_s": "5.0"}),
    Case("+-2 deg, gusts 1.75", level="moderate", settings={"amplitude_deg": "2.0", "factor": "1.75"}),
    Case("trim: mean of the first 1.9 s", level="moderate", options=WINDOW),
    Case("tolerance 0.1 %", level="moderate", options=TIGHT),
)
"""Settings of the moderate campaign."""

CAUSES: Final = (
    Case("sensor noise alone", u=0.0, w=0.0),
    Case("w gust alone", u=0.0, extra=IDEAL),
    Case("u gust alone", w=0.0, extra=IDEAL),
    Case("u and w gust", extra=IDEAL),
    Case("noise and w gust", u=0.0),
    Case("noise and u gust", w=0.0),
    Case("all"),
)
"""Sources of error, alone and together."""

LEADS: Final = (
    Case("command as flown"),
    Case("elevator, 0 ms ahead", lead_s=0.0),
    Case("elevator, 10 ms ahead", lead_s=0.010),
    Case("elevator, 15 ms ahead", lead_s=0.015),
    Case("elevator, 20 ms ahead", lead_s=0.020),
)
"""References of iv-reference-regressor: the command, or the measured elevator shifted ahead."""


FAST: Final = (
    Case("50 Hz"),
    Case("200 Hz", settings={"log_hz": "200.0"}),
    Case("200 Hz, record begins with the doublet", settings={"log_hz": "200.0"}, from_s=2.0),
)
"""Sample rates of the log: the paper's, and that of its dedicated test."""

SEVERE: Final = Case("severe", settings={"level": '"severe"'})
"""The light campaign in severe turbulence."""


@dataclass(frozen=True)
class Study:
    """Folder of the flights, number of processes, whether a tenth of the runs is flown, and the declared aircraft."""

    out: Path
    jobs: int
    quick: bool
    gtm: Aircraft


def with_settings(text: str, settings: Mapping[str, str], extra: str = "") -> str:
    """Return the text of a campaign file with new values of some keys, and more text at its end.

    Raises
    ------
    KeyError
        If a key does not appear exactly once.
    """
    for key, value in settings.items():
        text, count = re.subn(rf"(?m)^{key} = .*$", f"{key} = {value}", text)
        if count != 1:
            raise KeyError(f"{key} appears {count} times in the campaign file")
    return text + extra


def flown(study: Study, case: Case, runs: int | None = None, folder: Path = GTM) -> Path:
    """Fly the runs of a case that are not flown yet; return its campaign folder."""
    source = (CAMPAIGNS / f"{case.level}-fit.toml").read_text(encoding="utf-8")
    settings = dict(case.settings) | ({"runs": str(runs)} if runs else {})
    text = with_settings(source, settings | {"aircraft": f'"{folder}"'}, case.extra)
    parts = [case.level, *(f"{k}={v}".replace('"', "") for k, v in sorted(settings.items()))]
    parts += ["ideal"] * bool(case.extra) + [f"u={case.u:g},w={case.w:g}"] * ((case.u, case.w) != (1.0, 1.0))
    name = "_".join(parts) + ("" if folder == GTM else f"_{folder.name}") + "_quick" * study.quick
    file = study.out / f"{name}.toml"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text, encoding="utf-8")
    plan = planning.make(file)
    if study.quick and runs is None:
        plan = planning.make(file, runs=plan.campaign.runs // QUICK_DIVISOR)
    table = plan.table.assign(
        sigma_u_m_s=case.u * plan.table["sigma_u_m_s"], sigma_w_m_s=case.w * plan.table["sigma_w_m_s"]
    )
    plan = replace(plan, table=table, digest=f"{plan.digest} u {case.u:g} w {case.w:g}")
    flying.fly(plan, study.out / name, study.jobs)
    return study.out / name


def records(folder: Path, case: Case) -> Iterator[Batch]:
    """Yield the records of a campaign, cut and shifted as the case states."""
    for path in log_paths(folder):
        for batch in batches(read_log(path)):
            keep = batch.t_s[0] >= case.from_s - 1e-9
            channels = {name: values[:, keep] for name, values in batch.channels.items()}
            if case.lead_s is not None:
                t = np.arange(np.count_nonzero(keep)) * batch.dt_s
                ahead = [np.interp(t + case.lead_s, t, row) for row in channels["elevator_rad"]]
                channels["elevator_command_rad"] = np.array(ahead)
            yield replace(batch, t_s=batch.t_s[:, keep], channels=channels)
