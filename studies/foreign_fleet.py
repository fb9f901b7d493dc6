"""Aircraft of the JSBSim package, surveyed, flown and traced without and with an effect. Prints the tables of
docs/foreign_aircraft.md. Results are kept in a folder: a second call flies what is missing.

    python -m studies.foreign_fleet --out out/fleet                                 # everything
    python -m studies.foreign_fleet --out out/fleet --aircraft c182 --case calm     # a part
    python -m studies.foreign_fleet --out out/fleet --report                        # the tables alone
"""

from __future__ import annotations

import argparse
import json
import shutil
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from airtruth.errors import AirtruthError
from airtruth.physics.motion import LONGITUDINAL
from airtruth.simulation.campaign import plan
from airtruth.simulation.campaign import run as campaign
from airtruth.simulation.foreign_aircraft import CAMPAIGN, new_from_jsbsim
from airtruth.tracing import trace

AIRCRAFT: Final = (
    *("737", "A320", "MD11", "B747", "787-8", "global5000", "fokker100"),
    *("c172p", "c172r", "c172x", "c182", "c310", "pa28", "J3Cub", "L17", "dr1"),
    *("pc7", "DHC6", "C130", "L410", "t6texan2", "OV10", "p51d", "Boeing314"),
    *("T37", "T38", "A4", "F4N", "F80C", "f15", "f16", "f104", "Concorde"),
    *("SGS", "sgs233"),
)
"""Aircraft of the study: those of the JSBSim package that fly, are not more unstable than a record lasts and have an
aeroplane's elevator."""

CASES: Final = {
    "calm": ("", ""),
    "light": ("light", ""),
    "delay": ("light", '\n[[effect]]\nname = "elevator_delay"\ndelay_ms = 80\n'),
    "vane": ("light", '\n[[effect]]\nname = "vane_lag"\ntau_ms = 120\n'),
}
"""Case -> level of the gusts ("" for calm air) and effect that is flown."""

SOUGHT: Final = {"delay": ("elevator_delay", "delay_s", 0.080), "vane": ("vane_lag", "tau_s", 0.120)}
"""Case -> name, parameter and size [s] of its effect."""

WITHIN: Final = 0.15
"""Relative error of a size that counts as right [-]: the bar of the study."""

RESULTS: Final = "results.jsonl"
"""One line per aircraft and case."""


def fly_and_trace(name: str, case: str, out: Path, seed: int) -> dict[str, Any]:
    """Survey an aircraft unless that was done, fly six records of a case and trace them."""
    folder = out / "aircraft" / name
    if not folder.exists():
        folder.parent.mkdir(parents=True, exist_ok=True)
        survey = new_from_jsbsim(name, folder)
        print(survey.summary(), flush=True)
        if not (folder / CAMPAIGN).exists():
            reason = survey.cause or survey.flight[-1]
            return {"aircraft": name, "case": case, "seed": seed, "error": reason}
    level, effect = CASES[case]
    text = (folder / CAMPAIGN).read_text().split("[gust]")[0]
    text = text.replace("seed = 1\n", f"seed = {seed}\n")
    if level:
        text += f'[gust]\nfigures = "mil-f-8785c"\nlevel = "{level}"\n'
    file = folder / f"{case}-{seed}.toml"
    file.write_text(text + effect)
    logs = out / "flights" / f"{name}-{case}-{seed}"
    planned = plan.make(file)
    failures = campaign.fly(planned, logs).failures
    if failures:
        return {"aircraft": name, "case": case, "seed": seed, "error": failures[0].reason}
    answer = trace(logs, folder).answer.to_dict()
    shutil.rmtree(logs)
    keep = (
        "verdict",
        "provisional",
        "effects",
        "declared_model",
        "anomaly",
        "remaining",
        "notes",
        "detectability",
    )
    return {"aircraft": name, "case": case, "seed": seed} | {k: answer[k] for k in keep if k in answer}


def results(out: Path) -> list[dict[str, Any]]:
    """The kept results, the last of each aircraft, case and seed."""
    path = out / RESULTS
    rows = [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []
    return list({(r["aircraft"], r["case"], r["seed"]): r for r in rows}.values())


def named(row: dict[str, Any]) -> str:
    """Effects of an answer in a few words."""
    if "error" in row:
        return f"not flown: {row['error'][:90]}"
    words = []
    for effect in row["effects"]:
        sizes = ", ".join(f"{k} {v['value']:.4g}" for k, v in effect["parameters"].items())
        same = effect["indistinguishable_from"]
        words.append(f"{effect['name']} ({sizes})" + (f" or {', '.join(same)}" if same else ""))
    provisional = ", provisional" if row["provisional"] else ""
    return f"{row['verdict']}{provisional}" + (f": {'; '.join(words)}" if words else "")


def found(row: dict[str, Any]) -> tuple[bool, float]:
    """Whether the flown effect leads an answer or is in the class of a leading one, and the error of its size [-]."""
    name, parameter, size = SOUGHT[row["case"]]
    for effect in row.get("effects", ()):
        if effect["name"] == name:
            return True, effect["parameters"][parameter]["value"] / size - 1.0
    members = [m for effect in row.get("effects", ()) for m in effect["indistinguishable_from"]]
    return any(m.startswith(name) for m in members), float("nan")


def sigmas(row: dict[str, Any]) -> list[float]:
    """Distance of each derivative from the linearisation, in standard deviations of the estimate."""
    shifts = row.get("declared_model", {}).get("shifts", {})
    return [
        (shifts[n]["estimate"] - shifts[n]["declared"]) / shifts[n]["std"]
        for n in LONGITUDINAL.parameters
        if n in shifts
    ]


def report(rows: Sequence[dict[str, Any]]) -> Iterable[str]:
    """The tables as Markdown."""
    yield "| aircraft | " + " | ".join(CASES) + " |"
    yield "|---|" + "---|" * len(CASES)
    by = {(r["aircraft"], r["case"]): r for r in rows}
    for name in dict.fromkeys(r["aircraft"] for r in rows):
        cells = [named(by[name, case]) if (name, case) in by else "" for case in CASES]
        yield f"| {name} | " + " | ".join(cells) + " |"
    nulls = [r for r in rows if r["case"] not in SOUGHT and "error" not in r]
    wrong = [r for r in nulls if r["verdict"] != "none"]
    yield ""
    yield f"nulls: {len(wrong)} of {len(nulls)} answered with anything but none: " + ", ".join(
        f"{r['aircraft']} {r['case']}" for r in wrong
    )
    for case, (name, _, size) in SOUGHT.items():
        these = [found(r) for r in rows if r["case"] == case and "error" not in r]
        hits = [error for hit, error in these if hit]
        right = [error for error in hits if abs(error) <= WITHIN]
        yield f"{name} {size:g} s: found in {len(hits)} of {len(these)}, size within {WITHIN:.0%} in {len(right)}"
    distances = np.abs([s for r in nulls for s in sigmas(r)])
    if distances.size:
        yield f"derivatives of the nulls: {np.mean(distances <= 2.0):.1%} of {distances.size} within two standard deviations"


def main() -> None:
    """Fly what is missing, then print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--aircraft", nargs="*", default=AIRCRAFT)
    parser.add_argument("--case", nargs="*", default=list(CASES), choices=list(CASES))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--report", action="store_true")
    stated = parser.parse_args()
    stated.out.mkdir(parents=True, exist_ok=True)
    done = {(r["aircraft"], r["case"], r["seed"]) for r in results(stated.out)}
    for case in stated.case:
        for name in stated.aircraft:
            if stated.report or (name, case, stated.seed) in done:
                continue
            try:
                row = fly_and_trace(name, case, stated.out, stated.seed)
            except AirtruthError as error:
                row = {"aircraft": name, "case": case, "seed": stated.seed, "error": str(error)}
            with (stated.out / RESULTS).open("a") as file:
                file.write(json.dumps(row) + "\n")
            print(f"{name} {case}: {named(row)}", flush=True)
    print("\n".join(report(results(stated.out))))


if __name__ == "__main__":
    main()
