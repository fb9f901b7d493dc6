"""Do planned flights separate effects that tie, when JSBSim flies them?

For each pair of effects a flight is planned (`airtruth plan --split`). Two questions follow.

1. Separation. JSBSim flies the planned input and the 3-2-1-1 of equal length and limits with either effect, in calm air
   and without sensor noise. The outputs of JSBSim pass the tracer's filter under both hypotheses, everything else refitted
   to first order. The difference of the squared innovations is the square of the separation, without any randomness.
2. Ties. JSBSim flies the planned campaign with either effect in gusts and with sensor noise, the derivatives drawn from
   their declared uncertainty, the size from a factor of 0.8 to 1.25. A trace among the effects of
   all pairs and some others follows. The tie is broken if the
   answer has one set with the true effect alone.

Limits are compared with what the aircraft with the effects reaches, without sensor errors.

    python -m studies.planned_flights --out out/planned [--seed S] [--trials N] [--pairs K]

Each finished step is kept in the folder, and the same command continues.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from airtruth import aircraft as planes
from airtruth.aircraft import Aircraft
from airtruth.api.plans import base_campaign
from airtruth.design import Limits, PlanOptions, split
from airtruth.design.limits import extremes
from airtruth.design.question import from_names
from airtruth.design.separation import Experiment, Member, Model
from airtruth.design.splitting import reference_separation
from airtruth.effects.effect import Effect
from airtruth.effects.registry import EFFECTS
from airtruth.logs.atomic import write_text
from airtruth.logs.sources import named_logs
from airtruth.physics.motion import LONGITUDINAL
from airtruth.simulation.campaign import file as campaign_file
from airtruth.simulation.campaign import run as flying
from airtruth.simulation.campaign.chunk import Pilot
from airtruth.simulation.campaign.file import Campaign
from airtruth.simulation.campaign.plan import make, planned_runs
from airtruth.simulation.linearise import linearise
from airtruth.simulation.simulator import Condition
from airtruth.simulation.trim import trim
from airtruth.tracing import TraceOptions, trace
from airtruth.tracing.answer import TraceAnswer
from airtruth.tracing.model.parameters import SHORT_PERIOD
from airtruth.tracing.model.plant import declared_covariance
from airtruth.tracing.prepare import Case, prepare

Array = NDArray[np.float64]

PAIRS: Final = (
    ("elevator_delay", "actuator_lag", "delay_s"),
    ("gyro_lag", "sensor_delay:q_rad_s", "tau_s"),
    ("cm_alpha_nonlinear:break", "cm_alpha_nonlinear:quadratic", "dCmalpha"),
    ("vane_lag", "vane_arm", "tau_s"),
    ("backlash", "elevator_delay", "width_rad"),
    ("downwash_lag", "lift_alpha_dot", "Cmalphadot"),
)
"""Pairs of effects, and the first parameter of the first."""
TIED: Final = 2.0
"""Separation of six records of the 3-2-1-1 for which the size of the first effect is chosen [-]: a trace then has one name
with a probability of 0.31."""
_OTHERS: Final = (
    "accelerometer_arm",
    "accelerometer_lag",
    "vane_scale",
    "gyro_scale",
    "rate_limit",
    "elevator_asymmetry",
    "cl_alpha_nonlinear",
    "inertia_error",
    "derivatives",
)
"""Effects that belong to no pair, and are candidates of the traces."""
CANDIDATES: Final = tuple(dict.fromkeys([*(key for pair in PAIRS for key in pair[:2]), *_OTHERS]))
"""Effects among which the flights are traced."""


TRIED: Final = 6
"""Steps of the search for that size [-]."""
CLOSE: Final = 0.1
"""Difference of the logarithms at which it ends [-]."""
LOCATED: Final = {"cm_alpha_nonlinear:break": {"cm_alpha_nonlinear:break.at_alpha_rad": 0.09}}
"""Locations of effects that have one: near the trim, so that the input crosses it."""


LOCATIONS: Final = (0.0, -0.02, -0.01, 0.01, 0.02)
"""Shifts of a location at which a fit begins [rad]: the likelihood has several optima along it."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the study, or what is left of it, and print its tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--trials", type=int, default=1, help="trials per truth")
    parser.add_argument("--pairs", type=int, default=len(PAIRS))
    chosen = parser.parse_args(arguments)
    chosen.out.mkdir(parents=True, exist_ok=True)
    gtm = planes.load("gtm")
    for number in range(len(PAIRS[: chosen.pairs])):
        planned(gtm, number, chosen.out, chosen.seed)
        for truth in range(2):
            for trial in range(chosen.trials):
                flown(gtm, number, truth, trial, chosen.out, chosen.seed)
    print(report(chosen.out))


def planned(gtm: Aircraft, number: int, out: Path, seed: int) -> None:
    """Plan the flight of one pair, and measure its separations in JSBSim."""
    path = out / f"{number}-plan.json"
    if path.exists():
        return
    base = base_campaign(None, False, "gtm")
    assert isinstance(base, Campaign)
    began = time.perf_counter()
    options = PlanOptions(Limits(), seed=seed)
    keys = PAIRS[number][:2]
    sizes = tied(base, number, options, gtm)
    result = split(base, from_names(keys, sizes), options, gtm)
    facts = result.to_dict() | {"seconds": time.perf_counter() - began}
    campaigns = {"planned": result.campaign, "reference": result.reference_campaign}
    facts["jsbsim"] = [
        separations(result.hypotheses, campaigns, result.limits, result.gust_m_s, k, gtm) for k in range(2)
    ]
    write_text(out / f"{number}.toml", result.to_toml())
    write_text(path, json.dumps(facts, indent=1))
    print(path.name, result.best.family, result.best.least, result.ratio, facts["jsbsim"], flush=True)


def tied(base: Campaign, number: int, options: PlanOptions, gtm: Aircraft) -> dict[str, float]:
    """The size of the first effect at which the reference separates as far as `TIED`, by the secant in logarithms."""
    first, second, parameter = PAIRS[number]
    start = from_names([first, second], {})[0].effect.parameters[0]
    size, power = 4.0 * start.material, 1.0
    tried: list[tuple[float, float]] = []
    for _ in range(TRIED):
        stated = {f"{first}.{parameter}": start.value(size), **LOCATED.get(first, {})}
        sigma = reference_separation(base, from_names([first, second], stated), options, gtm)
        tried.append((float(np.log(size)), float(np.log(sigma))))
        if len(tried) > 1 and tried[-1][0] != tried[-2][0]:
            power = (tried[-1][1] - tried[-2][1]) / (tried[-1][0] - tried[-2][0])
        factor = (TIED / sigma) ** (1.0 / float(np.clip(power, 0.5, 3.0)))
        if abs(np.log(TIED / sigma)) < CLOSE:
            break
        size = min(size * factor, start.reach[1])
    return stated


def flown(gtm: Aircraft, number: int, truth: int, trial: int, out: Path, seed: int) -> None:
    """Fly and trace a planned campaign with one of its effects."""
    path = out / f"{number}-{truth}-{trial}.json"
    if path.exists():
        return
    facts = json.loads((out / f"{number}-plan.json").read_text())
    stated = facts["hypotheses"][truth]
    effect = EFFECTS[stated["name"]]
    member = Member(effect, np.array([p.size(stated["parameters"][p.name]) for p in effect.parameters]))
    campaign = campaign_file.read(out / f"{number}.toml")
    condition = Condition(**facts["condition"])
    folder = out / "flights" / path.stem
    answer = traced(campaign, member, condition, [seed, number, truth, trial], folder, gtm)
    write_text(path, json.dumps(answer | {"pair": [h["name"] for h in facts["hypotheses"]]}, indent=1))
    print(effect.key, answer["verdict"], answer["sets"], answer["seconds"], flush=True)


def separations(
    members: Sequence[Member],
    campaigns: dict[str, Campaign],
    limits: Limits,
    gust_m_s: float,
    truth: int,
    gtm: Aircraft,
) -> dict[str, Any]:
    """Separation of one record in JSBSim, by the planned input and by the reference; and the limits in flight."""
    member, rivals = members[truth], [m for k, m in enumerate(members) if k != truth]
    found: dict[str, Any] = {}
    for name, campaign in campaigns.items():
        own = still(campaign, [effect_table(member.effect, member.values)])
        plan = make(own)
        pilot = Pilot(replace(plan, sensors={}))
        run, _ = planned_runs(plan.table)
        channels = pilot.channels(run)
        reached = extremes(channels, 1.0 / own.log_hz)
        with tempfile.TemporaryDirectory() as folder:
            logs = [log for _, log in named_logs(flying.fly(own, Path(folder) / "flown", 1).folder)]
        effects = [member.effect, *(m.effect for m in rivals)]
        case = prepare(logs, gtm, effects, TraceOptions(hold_out=()))
        own_misfit, *others = [misfit(case, m, gust_m_s) for m in (member, *rivals)]
        found[name] = float(np.sqrt(max(0.0, min(others) - own_misfit)))
        if name == "planned":
            found["limit_share"] = reached.share(limits)
    return found


def still(campaign: Campaign, effects: list[dict[str, Any]]) -> Campaign:
    """Two equal runs in calm air with ideal sensors.

    JSBSim holds the surface over a step. At 200 Hz this hides the difference between a delay and a lag of 4 ms.
    """
    update = {
        "simulation_hz": 1000.0,
        "runs": 2,  # a single record would be cut into halves
        "gust": campaign_file.GustTable(),
        "sensors": campaign_file.SensorTable(ideal=True),
        "effect": tuple(campaign_file.EffectTable.model_validate(e) for e in effects),
    }
    return campaign.model_copy(update=update)


def effect_table(effect: Effect, values: dict[str, float]) -> dict[str, Any]:
    """An effect as a campaign file states it."""
    variant = {"variant": effect.variant} if effect.variant else {}
    return {"name": effect.name, **variant, **values}


def misfit(case: Case, member: Member, gust_m_s: float) -> float:
    """Square of the innovations of the first record beyond everything that is refitted, sizes included [-]."""
    record = case.fitted.records[0]
    model = Model(case.fitted.settings, case.hypothesis.declared, gust_m_s, 1)
    experiment = Experiment(model, record)
    located = np.array([1.0 if p.is_location and p.unit == "rad" else 0.0 for p in member.effect.parameters])
    starts = [member.sizes + shift * located for shift in (LOCATIONS if located.any() else (0.0,))]
    still_air = np.zeros(SHORT_PERIOD.common.size)
    return min(experiment.distance(record.signals.y, member.effect, s, still_air).sigma ** 2 for s in starts)


def traced(
    planned_campaign: Campaign, member: Member, at: Condition, key: list[int], folder: Path, gtm: Aircraft
) -> dict[str, Any]:
    """Answer of the whole library to a planned campaign, flown with one of the effects."""
    rng = np.random.default_rng(key)
    sizes = member.sizes.copy()
    sizes[0] *= float(np.exp(rng.uniform(np.log(0.8), np.log(1.25))))
    values = replace(member, sizes=sizes).values
    covariance = declared_covariance(gtm, linearise(gtm, trim(gtm, at)).central)
    drawn = np.linalg.cholesky(covariance) @ rng.standard_normal(6)
    derivatives = {
        "name": "derivatives",
        **{f"d{n}": float(x) for n, x in zip(LONGITUDINAL.parameters, drawn, strict=True)},
    }
    effects = [effect_table(member.effect, values), derivatives]
    campaign = planned_campaign.model_copy(
        update={
            "seed": int(rng.integers(2**31)),
            "effect": tuple(campaign_file.EffectTable.model_validate(e) for e in effects),
        }
    )
    flying.fly(campaign, folder, 1)
    began = time.perf_counter()
    answer = trace(folder, gtm, TraceOptions(effects=CANDIDATES)).answer
    return {
        "truth": member.effect.key,
        "values": values,
        **summary(answer),
        "consistent": None if answer.declared_model is None else answer.declared_model.consistent,
        "seconds": time.perf_counter() - began,
    }


def summary(answer: TraceAnswer) -> dict[str, Any]:
    """What both studies keep of an answer: its verdict, and the names and the variants of each set."""
    return {
        "verdict": answer.verdict,
        "provisional": answer.provisional,
        "sets": [[e.name, *e.indistinguishable_from] for e in answer.effects],
        "variants": [[e.key, *e.other_variants] for e in answer.effects],
    }


def report(out: Path) -> str:
    """Tables of what is in the folder."""
    lines, ratios, broken = [], [], []
    for number, keys in enumerate(PAIRS):
        path = out / f"{number}-plan.json"
        if not path.exists():
            continue
        facts = json.loads(path.read_text())
        jsbsim = facts["jsbsim"]
        ratio = [j["planned"] / j["reference"] if j["reference"] else float("nan") for j in jsbsim]
        ratios += ratio
        answers = [json.loads(p.read_text()) for p in sorted(out.glob(f"{number}-[01]-*.json"))]
        alone = [single(a) for a in answers]
        broken += alone
        lines.append(
            f"| {keys[0]}, {keys[1]} | {facts['inputs'][0]['family']} | {facts['records']} | "
            f"{facts['separation_sigma']:.1f} | {facts['separation_sigma'] / facts['reference_sigma']:.2f} | "
            f"{ratio[0]:.2f}, {ratio[1]:.2f} | {sum(alone)} of {len(alone)} | "
            f"{max(j['limit_share'] for j in jsbsim):.3f} |"
        )
    head = "| effects | input | records | sigma expected | over 3-2-1-1, expected | in JSBSim | tie broken | share of limits |"
    lines = [head, "|---|---|---|---|---|---|---|---|", *lines]
    if ratios:
        lines.append(
            f"median ratio in JSBSim {np.nanmedian(ratios):.2f}; ties broken {sum(broken)} of {len(broken)}"
        )
    return "\n".join(lines)


def single(answer: dict[str, Any]) -> bool:
    """Whether the answer has the true effect, in a set of one."""
    name, _, _ = answer["truth"].partition(":")
    return any(
        own[0] == name and len(own) == 1 and variants == [answer["truth"]]
        for own, variants in zip(answer["sets"], answer["variants"], strict=True)
    )


if __name__ == "__main__":
    main()
