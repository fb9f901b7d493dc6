"""A planned flight from files: a campaign, a trace, or the defaults of a shipped aircraft; and its output files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np

from airtruth import aircraft as planes
from airtruth import style
from airtruth.aircraft import Aircraft
from airtruth.design.flight import PlanOptions
from airtruth.design.lateral_flight import LateralPlan, LateralQuestion, plan_lateral
from airtruth.design.lateral_splitting import LateralSplit, split_lateral
from airtruth.design.narrow_result import NarrowResult
from airtruth.design.narrowing import narrow
from airtruth.design.precision import DerivativeQuestion
from airtruth.design.question import from_names, motion_of, tied_in
from airtruth.design.search import Step
from airtruth.design.split_result import SplitResult
from airtruth.design.splitting import split
from airtruth.design.verdict import Asked, asked_by, least_known
from airtruth.errors import ConfigurationError
from airtruth.logs.atomic import make_folder
from airtruth.logs.histories import FILE, Histories, read_histories
from airtruth.logs.names import name_of
from airtruth.logs.outputs import writing
from airtruth.logs.provenance import PROVENANCE, Provenance, aircraft_digests
from airtruth.logs.remote import location
from airtruth.physics.atmosphere import RHO0_KG_M3
from airtruth.physics.motion import LATERAL
from airtruth.simulation.campaign import file as campaign_file
from airtruth.simulation.campaign.file import Campaign
from airtruth.simulation.simulator import jsbsim_model
from airtruth.tracing.answer import TraceAnswer, answer_path
from airtruth.tracing.update import WITHOUT_EFFECTS

_NAME: Final = "next"
"""Name of a planned campaign that is not written to a file."""
_LOG_HZ: Final = 50.0
"""Rate of the log where neither a campaign nor a trace states one [Hz]: that of the shipped campaigns."""


@dataclass(frozen=True)
class Request:
    """The question as a user states it; without a statement, a trace asks.

    Attributes
    ----------
    split : keys of effects to separate.
    sizes : EFFECT.PARAMETER -> value [its unit].
    derivatives : names of derivatives to determine.
    trace : folder of a trace, or its trace.json; None for none.
    """

    split: Sequence[str] = ()
    sizes: Mapping[str, float] = field(default_factory=dict)
    derivatives: Sequence[str] = ()
    trace: Path | None = None


def planned_from(
    campaign: Path | Campaign | None,
    stated: Request,
    aircraft: str | None,
    options: PlanOptions,
    out: Path | None = None,
    *,
    force: bool = False,
    step: Step = lambda text: None,
) -> SplitResult | NarrowResult | LateralPlan | LateralSplit:
    """Plan the flight that answers a question, or the question that a trace leaves open.

    Parameters
    ----------
    campaign : where condition, gusts and sensors come from; None for those of the trace or the default ones.
    stated : the question.
    aircraft : shipped name or folder; None for that of the campaign or of the trace.
    options : limits, records and seed.
    out : campaign file to write, and a figure beside it; None to write nothing.
    force : replace files that the command did not write, or that changed since.
    step : receives each step.

    Raises
    ------
    ConfigurationError, AircraftError, TrimError, StoreError
        Naming what is wrong, where, and what to do.
    """
    if out is not None and out.suffix != ".toml":
        raise ConfigurationError(f"--out {out}: the campaign file needs the suffix .toml; write FILE.toml")
    trace = stated.trace
    answer_file = None if trace is None else answer_path(trace)
    question = _question(stated, answer_file)
    records = _records(answer_file)
    declared, base = _base(campaign, aircraft, records, answer_file, "" if out is None else name_of(out))
    inputs = [p for p in (campaign, answer_file) if isinstance(p, Path)]
    with writing("plan", inputs, force=force) as outputs:
        if out is not None:
            outputs.require(out, out.with_suffix(".png"))
            make_folder(location(out).parent)
        result: SplitResult | NarrowResult | LateralPlan | LateralSplit
        if isinstance(question, LateralQuestion):
            result = plan_lateral(base, question, options.limits.amplitude_rad, options.records, step)
        elif isinstance(question, tuple) and motion_of([h.effect for h in question]) is LATERAL:
            result = split_lateral(base, question, options, declared, step)
        elif isinstance(question, tuple):
            result = split(base, question, options, declared, step)
        else:
            result = narrow(base, question, options, declared, step)
        if out is not None:
            result.write(out)
            style.save(result.plot(), out.with_suffix(".png"))
    return result


def _question(stated: Request, answer_file: Path | None) -> Asked | LateralQuestion:
    if stated.split and stated.derivatives:
        raise ConfigurationError("plan: --split and --derivative exclude each other; state one of them")
    if stated.sizes and not stated.split:
        raise ConfigurationError(
            "plan: --size applies to effects to separate; leave it out, or state --split"
        )
    if stated.derivatives and set(stated.derivatives) <= set(LATERAL.parameters):
        return LateralQuestion(tuple(stated.derivatives))
    if stated.derivatives:
        return DerivativeQuestion(tuple(stated.derivatives))
    if stated.split or answer_file is None:
        return from_names(stated.split, stated.sizes)
    answer = TraceAnswer.read(answer_file)
    if answer.motion is LATERAL:
        return tied_in(answer) or LateralQuestion((least_known(answer),))
    return asked_by(answer, str(answer_file))


def _records(answer_file: Path | None) -> Histories | None:
    if answer_file is None or not (answer_file.parent / FILE).is_file():
        return None
    return read_histories(answer_file.parent / FILE, "run `airtruth trace` again to write it")


def _base(
    campaign: Path | Campaign | None,
    aircraft: str | None,
    records: Histories | None,
    answer_file: Path | None,
    name: str,
) -> tuple[Aircraft, Campaign]:
    """The declared aircraft and the campaign whose manoeuvres are replaced."""
    if campaign is not None:
        read = campaign if isinstance(campaign, Campaign) else campaign_file.read(campaign)
        near = campaign.parent if isinstance(campaign, Path) else None
        declared = _flying(planes.load(aircraft or read.aircraft, near=near), answer_file)
        own = name or read.name
        return declared, read.model_copy(update={"name": own, "aircraft": _stated(declared)})
    declared = _flying(_traced(records) if aircraft is None else planes.load(aircraft), answer_file)
    raw = _default(declared, records) | {"name": name or _NAME, "aircraft": _stated(declared)}
    return declared, Campaign.model_validate(raw)


def _flying(declared: Aircraft, answer_file: Path | None) -> Aircraft:
    """The aircraft; of one without a JSBSim model the form that its trace wrote, without the accepted effects."""
    if declared.file.jsbsim is not None or answer_file is None:
        return declared
    written = answer_file.parent / WITHOUT_EFFECTS / declared.name
    return planes.load(written) if (written / planes.FILE).is_file() else declared


def _traced(records: Histories | None) -> Aircraft:
    """The aircraft of a trace, as it was then.

    Raises
    ------
    ConfigurationError
        If no trace states it, or a file of it has changed since.
    """
    origin = Provenance.read({} if records is None else records.facts.get(PROVENANCE))
    if not origin.aircraft:
        raise ConfigurationError(
            "plan: state --aircraft, or a CAMPAIGN.toml with the aircraft and its condition"
        )
    traced = Path(origin.folder)
    declared = planes.load(str(traced) if origin.folder and traced.is_dir() else origin.aircraft)
    now = aircraft_digests(declared.folder)
    changed = [name for name, digest in now.items() if origin.digests.get(name, digest) != digest]
    if changed:
        raise ConfigurationError(
            f"plan: {declared.folder / changed[0]} is not the file of the trace; state --aircraft to plan for the aircraft "
            "as it is now, or trace the records again"
        )
    return declared


def _default(declared: Aircraft, records: Histories | None) -> dict[str, object]:
    """Condition, rates and air of a trace's records."""
    jsbsim_model(declared)
    if records is None:
        raise ConfigurationError(
            f"plan: no flight condition of {declared.name} is known; give a CAMPAIGN.toml "
            f"(`airtruth new campaign --aircraft {declared.name} --eas-kt SPEED --altitude-ft ALTITUDE --out FILE.toml` "
            "writes one)"
        )
    known = [r.conditions for r in records.records]
    speed = np.array([c["airspeed_m_s"] for c in known])
    density = np.array([c["density_kg_m3"] for c in known])
    eas = float(np.mean(speed * np.sqrt(density / RHO0_KG_M3)))
    rate = round(float(known[0].get("sample_rate_hz", _LOG_HZ)), 3)
    return {
        "runs": 1,
        "duration_s": max(1, round(rate)) / rate,  # whole samples; the planned input replaces it
        "log_hz": rate,
        "simulation_hz": rate * max(1, round(200.0 / rate)),
        "condition": {"eas_m_s": eas, "altitude_m": float(np.mean([c["altitude_m"] for c in known]))},
        "manoeuvre": [{"kind": "doublet", "amplitude_deg": 1.0, "step_ms": 100.0, "start_s": 0.0}],
        "gust": {"figures": "mil-f-8785c", "level": "light"},
    }


def _stated(declared: Aircraft) -> str:
    """Name of a shipped aircraft; any other one by its folder, which does not depend on the folder of the file."""
    folder = declared.folder.resolve()
    shipped = any(folder.parent == root.resolve() for root in planes.shipped_roots())
    return folder.name if shipped else str(folder)


__all__ = ["Request", "planned_from"]
