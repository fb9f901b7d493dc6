"""Does a planned flight break the ties that blind trials leave?

The trials are those of a folder of `validation.blind` whose answer has the true effect in a set of several. Each of them
is treated as a user treats a trace.

1. `airtruth plan --from` computes the next flight from the answer, for the air of the trial.
2. The aircraft of the trial flies it, in a process that does not know the tracer (`validation.blind.draw`), with gusts and
   sensor noise of its own.
3. The tracer receives the records of both flights together, with its default options. The tie is broken if a set of the
   answer holds the true effect alone.

The same flight is compared with the 3-2-1-1 of equal length and limits: by the separations to expect, and by those that
JSBSim has with either effect of the tie (`studies.planned_flights.separations`).

    python -m studies.planned_ties --blind DIR --out out/ties --seed S [--trials N] [--jobs J]

Each finished step is kept in the folder, and the same command continues.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from airtruth import aircraft as planes
from airtruth.api.plans import base_campaign
from airtruth.design import PlanOptions, SplitResult
from airtruth.design.from_files import Request, planned_from
from airtruth.design.question import MOST, is_separable
from airtruth.effects.registry import EFFECTS
from airtruth.errors import AirtruthError
from airtruth.logs.atomic import write_text
from airtruth.logs.store import read_log, write_log
from airtruth.physics.motion import LONGITUDINAL
from airtruth.simulation import manoeuvres
from airtruth.simulation.campaign import file as campaign_file
from airtruth.simulation.campaign.file import NO_GUST, Campaign
from airtruth.simulation.campaign.plan import make, planned_runs
from airtruth.tracing import trace
from studies.planned_flights import separations, single, summary
from validation.blind import draw
from validation.blind.figures import STEP_S, STRONG
from validation.blind.scoring import base
from validation.blind.surface import Manoeuvre
from validation.blind.trials import flown_apart


def ties(blind: Path) -> list[str]:
    """Trials with one effect above the noncentrality that counts, whose answer has it in a set of several, in order."""
    found = []
    for path in sorted((blind / "answer").glob("*.json")):
        answer = json.loads(path.read_text())
        truth = json.loads((blind / "truth" / path.name).read_text())
        (key,) = [effect["key"] for effect in truth["trial"]["effects"]]
        if truth["lambda"][key] > STRONG and any(base(key) in tie for tie in sets(answer)):
            found.append(path.stem)
    return found


def sets(answer: dict[str, Any]) -> list[list[str]]:
    """The sets of an answer that have several effects, those that an input can separate."""
    every = [[e["name"], *e["indistinguishable_from"]] for e in answer.get("effects", ())]
    separable = {e.name for e in EFFECTS.values() if LONGITUDINAL.name in e.motions and is_separable(e)}
    return [s for s in every if 1 < len(s) <= MOST and separable.issuperset(s)]


def one(blind: Path, name: str, out: Path, seed: int) -> str:
    """Plan, fly and trace the next flight of one trial; a line about it."""
    truth = json.loads((blind / "truth" / f"{name}.json").read_text())
    answer = json.loads((blind / "answer" / f"{name}.json").read_text())
    drawn = truth["trial"]
    trial = draw.draw(drawn["seed"], drawn["number"], drawn["composition"])
    folder = out / name
    folder.mkdir(parents=True, exist_ok=True)
    write_text(folder / "trace.json", json.dumps(answer))
    facts: dict[str, Any] = {"truth": drawn["effects"], "air": trial.air, "tie": sets(answer)}
    try:
        facts |= flown_and_traced(trial, blind / "logs" / name / "log.parquet", folder, seed)
    except AirtruthError as error:
        facts["failed"] = f"{type(error).__name__}: {error}"
    write_text(out / f"{name}.json", json.dumps(facts, indent=1))
    return f"{name}: {facts.get('failed') or facts['answer']['sets']}"


def flown_and_traced(trial: draw.Trial, first_log: Path, folder: Path, seed: int) -> dict[str, Any]:
    """The planned flight of one trial, its separations, and the answer to both flights."""
    gtm = planes.load("gtm")
    result = planned_from(
        campaign_in(trial.air), Request(trace=folder / "trace.json"), None, PlanOptions(seed=seed)
    )
    assert isinstance(result, SplitResult)
    write_text(folder / "next.toml", result.to_toml())
    campaigns = {"planned": result.campaign, "reference": result.reference_campaign}
    facts: dict[str, Any] = {
        "hypotheses": [{"name": m.effect.key, "values": m.values} for m in result.hypotheses],
        "input": result.best.family,
        "records": result.campaign.runs,
        "sigma": result.best.least,
        "ratio": result.ratio,
        "jsbsim": [
            separations(result.hypotheses, campaigns, result.limits, result.gust_m_s, k, gtm)
            for k in range(len(result.hypotheses))
        ],
    }
    flight = replace(
        trial,
        seed=seed,
        duration_s=float(result.campaign.duration),
        manoeuvres=commanded(result.campaign),
    )
    (flown,) = flown_apart([flight], [folder / "flown"])
    log = read_log(flown / "log.parquet")
    second = replace(log, run_ids=tuple(f"planned-{run}" for run in log.run_ids))
    write_log(folder / "second.parquet", second)
    answered = trace([first_log, folder / "second.parquet"], gtm).answer
    return facts | {"answer": {"truth": trial.effects[0].key, **summary(answered)}}


def campaign_in(air: str) -> Campaign:
    """Condition, rates and sensors of the trials, in their air."""
    campaign = base_campaign(None, False, "gtm")
    assert isinstance(campaign, Campaign)
    level = NO_GUST if air == "calm" else air
    return campaign.model_copy(update={"gust": campaign_file.GustTable(level=level)})


def commanded(campaign: Campaign) -> tuple[Manoeuvre, ...]:
    """The runs of a campaign as inputs of a blind trial."""
    plan = make(campaign)
    t_s = np.arange(round(float(campaign.duration) / STEP_S) + 1) * STEP_S
    return tuple(
        Manoeuvre(
            "sampled",
            run.amplitude_rad,
            0.0,
            0.0,
            samples_rad=run.amplitude_rad * manoeuvres.sample(plan.inputs[run.manoeuvre][0], t_s),
        )
        for run in planned_runs(plan.table)
    )


def report(out: Path) -> str:
    """The table of what is in the folder, and the totals."""
    lines = [
        "| tie | air | sigma | over 3-2-1-1, expected | in JSBSim | answer | tie broken |",
        "|---|---|---|---|---|---|---|",
    ]
    expected, reached, broken, named, wrong = [], [], 0, 0, 0
    done = [json.loads(path.read_text()) for path in sorted(out.glob("*-*.json"))]
    for facts in done:
        tie = "; ".join(", ".join(names) for names in facts["tie"])
        if "failed" in facts:
            lines.append(f"| {tie} | {facts['air']} | | | | {facts['failed'][:60]} | no |")
            continue
        ratios = [j["planned"] / j["reference"] for j in facts["jsbsim"] if j["reference"] > 0.0]
        expected.append(facts["ratio"])
        reached += ratios
        answer = facts["answer"]
        alone = single(answer)
        broken += alone
        names = "; ".join(", ".join(names) for names in answer["sets"]) or answer["verdict"]
        truth = base(answer["truth"])
        wrong += bool(answer["sets"]) and not any(truth in names for names in answer["sets"])
        named += bool(answer["sets"])
        shown = ", ".join(f"{r:.2f}" for r in ratios)
        lines.append(
            f"| {tie} | {facts['air']} | {facts['sigma']:.1f} | {facts['ratio']:.2f} | {shown} | {names} | "
            f"{'yes' if alone else 'no'} |"
        )
    if expected:
        lines.append(
            f"ties broken {broken} of {len(done)}; the true effect in no set {wrong} of {named}; median ratio expected "
            f"{np.median(expected):.2f}, in JSBSim {np.median(reached):.2f}"
        )
    return "\n".join(lines)
