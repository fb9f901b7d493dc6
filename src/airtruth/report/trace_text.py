"""What `airtruth trace` says: the verdict, the effects, the errors, the candidates and what to fly next."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping
from typing import Any, Final

from airtruth.effects.library import EFFECTS
from airtruth.report.render import WIDTH, text
from airtruth.report.trace_table import error_grid, figures
from airtruth.report.trace_tolerances import tolerance_grid

MOST_CANDIDATES: Final = 8
_PRINTED: Final = {
    "-": "",
    "1": "",
    "hz": "Hz",
    "rad_s": "rad/s",
    "m_s": "m/s",
    "m_s2": "m/s2",
    "kg_m2": "kg m2",
}

Answer = Mapping[str, Any]


def as_trace_text(answer: Answer) -> str:
    """The answer of a trace in plain text.

    Parameters
    ----------
    answer : what trace.json holds (docs/trace.md).
    """
    tolerances = tolerance_grid(answer)
    blocks = [
        [*textwrap.wrap(verdict(answer), WIDTH), *textwrap.wrap(_freedom(answer), WIDTH)],
        *([effect_line(e), *effect_details(e)] for e in answer["effects"]),
        text(error_grid(answer)).rstrip("\n").splitlines(),
        *([text(tolerances).rstrip("\n").splitlines()] if tolerances else []),
        derivative_lines(answer),
        ["Candidates, most significant first:", *_candidate_lines(answer)],
        _wrapped("Smallest traceable sizes", "; ".join(detectable(answer)) + "."),
        _wrapped("Next flight", answer["next_flight"]),
    ]
    if answer.get("updated_aircraft"):
        blocks.append([f"Updated aircraft: {answer['updated_aircraft']}"])
    blocks += [_wrapped("Note", note + ".") for note in answer.get("notes", ())]
    return "\n\n".join("\n".join(block) for block in blocks)


def verdict(answer: Answer) -> str:
    """The verdict in one sentence."""
    anomaly, remaining = (
        _evidence(answer[which], answer.get("shown_by", {}).get(which)) for which in ("anomaly", "remaining")
    )
    effects = answer["effects"]
    names = " and ".join(", ".join(key(e) for e in effects).rsplit(", ", 1))
    if answer["verdict"] == "none":
        said = (
            f"None: the declared aircraft explains these records (p = {figures(answer['anomaly']['p_value'], 2)}); "
            "no effect is missing that they could show."
        )
    elif answer["verdict"] == "unexplained":
        said = (
            f"Unexplained: something is missing ({anomaly}), and no effect of the library passes every test."
        )
    elif answer["verdict"] == "one_of":
        alike = sorted({name for e in effects for name in e["indistinguishable_from"]})
        said = f"One of several: the aircraft lacks {names}, or what looks the same here: {', '.join(alike)}."
    else:
        said = f"Traced: the declared aircraft lacks {names}."
    if answer["provisional"]:
        held = answer["records"]["held_out"]
        why = f"a significant anomaly remains ({remaining})" if held else "no record was held out"
        said += f" Provisional: {why}."
    return said


def _evidence(found: Mapping[str, float], where: str | None) -> str:
    return f"p = {figures(found['p_value'], 2)}" + (f"; it shows in {where}" if where else "")


def key(entry: Mapping[str, Any]) -> str:
    """Name of an effect or candidate with its variant."""
    return f"{entry['name']}:{entry['variant']}" if entry.get("variant") else str(entry["name"])


def unit_of(name: str, parameter: str) -> str:
    """Unit of an effect's parameter, "" where there is none or the effect is not of this library."""
    effect = EFFECTS.get(name) or next((e for e in EFFECTS.values() if e.name == name), None)
    if effect is None:
        return ""
    units = {p.name: p.unit for p in effect.parameters}
    found = units.get(parameter, "")
    return _PRINTED.get(found, found)


def effect_line(effect: Mapping[str, Any]) -> str:
    """Name and size: ``elevator_delay: delay_s = 0.0205 +- 0.00045 s (95 %: 0.0196 to 0.0214)``."""
    told = []
    for name, value in effect["parameters"].items():
        low, high = (figures(x) if x is not None else "-" for x in value["ci95"])
        unit = unit_of(key(effect), name)
        told.append(
            f"{name} = {figures(value['value'])} +- {figures(value['std'], 2)}{f' {unit}' if unit else ''} "
            f"(95 %: {low} to {high})"
        )
    return f"{key(effect)}: {', '.join(told)}"


def effect_details(effect: Mapping[str, Any]) -> Iterator[str]:
    """How sure it is, and what it cannot be told from."""
    gain = effect.get("gain_2_log_likelihood")
    told = f"  p = {figures(effect['p_value'], 2)} (Holm over all candidates)"
    if gain is not None:
        told += f"; 2 log L gained: {figures(gain)}"
    yield told + f"; {figures(effect['separation_sigma'])} sigma from the next effect"
    alike = effect["indistinguishable_from"]
    yield (
        f"  cannot be told from: {', '.join(alike)}"
        if alike
        else "  no other effect that passes every test explains it as well"
    )
    if variants := effect.get("other_variants"):
        names = ", ".join(f"{effect['name']}:{v}" for v in variants)
        yield f"  as {names} it explains the records as well"


def derivative_lines(answer: Answer) -> list[str]:
    """A small table of the six derivatives: declared, refitted without and with the effect."""
    rows = {k: v for k, v in answer["derivatives"].items() if k != "after_std"}
    std = answer["derivatives"].get("after_std", {})
    if not answer["effects"]:
        rows.pop("after", None)
    names = list(rows["declared"])
    lines = ["".ljust(8) + "".join(name.rjust(12) for name in names)]
    for stage, values in rows.items():
        lines.append("  " + stage.ljust(9) + "".join(figures(values[n], 4).rjust(12) for n in names)[3:])
    if std:
        lines.append("  " + "+-".ljust(9) + "".join(figures(std[n], 2).rjust(12) for n in names)[3:])
    return ["Derivatives [1/rad, rates as q c/(2V)]", *lines]


def why_not(candidate: Mapping[str, Any], answer: Answer) -> str:
    """Why a candidate is not the answer, or that it is."""
    if candidate["why_not"]:
        return str(candidate["why_not"])
    leading = {key(e) for e in answer["effects"]}
    return "accepted" if key(candidate) in leading else "cannot be told from the accepted one"


def detectable(answer: Answer) -> Iterator[str]:
    """``elevator_delay 0.0033 s`` of each effect; one of several variants is named with it."""
    stated = answer["detectability"]
    with_variants = {name.partition(":")[0] for name in stated if ":" in name}
    for name, value in stated.items():
        if name in with_variants:
            continue
        effect = EFFECTS.get(name)
        unit = unit_of(name, effect.parameters[0].name) if effect else ""
        yield f"{name} {figures(value, 2)} {unit}".rstrip()


def _candidate_lines(answer: Answer) -> Iterator[str]:
    shown = [c for c in answer["candidates"] if c["testable"]][:MOST_CANDIDATES]
    width = max((len(key(c)) for c in shown), default=0)
    for c in shown:
        p = f"p = {figures(c['p_value'], 2)}"
        yield f"  {key(c).ljust(width)}  score {figures(c['score']).rjust(7)}  {p.ljust(12)}  {why_not(c, answer)}"
    rest = sum(c["testable"] for c in answer["candidates"]) - len(shown)
    silent = [key(c) for c in answer["candidates"] if not c["testable"]]
    if rest > 0:
        yield f"  and {rest} more"
    if silent:
        yield from textwrap.wrap(
            f"Not testable here: {', '.join(silent)}", WIDTH, initial_indent="  ", subsequent_indent="  "
        )


def _freedom(answer: Answer) -> str:
    records = answer["records"]
    held = ", ".join(records["held_out"]) or "none"
    model = "forces probed in JSBSim" if answer["model"] == "aircraft" else "linear short-period model"
    return f"{len(records['fitted'])} records fitted, held out: {held}; {model}."


def _wrapped(heading: str, words: str) -> list[str]:
    return textwrap.wrap(f"{heading}: {words}", WIDTH, subsequent_indent="  ")


__all__ = [
    "as_trace_text",
    "detectable",
    "effect_details",
    "effect_line",
    "key",
    "unit_of",
    "verdict",
    "why_not",
]
