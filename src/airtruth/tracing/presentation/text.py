"""The text of a trace in full: verdict, effects, errors, candidates and the next flight; `airtruth trace --verbose` prints it."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from typing import Final

from airtruth.effects.increment import STEP
from airtruth.effects.registry import EFFECTS
from airtruth.physics.terms import OUTPUTS
from airtruth.table import WIDTH, as_text, significant
from airtruth.tracing.accepted import AcceptedEffect, IncrementState, IncrementTable, ParameterEstimate
from airtruth.tracing.answer import Evidence, TraceAnswer
from airtruth.tracing.criterion import CRITERION
from airtruth.tracing.inference.causes import DERIVATIVES
from airtruth.tracing.presentation.candidates import probability, ranked
from airtruth.tracing.presentation.derivative_table import derivative_table
from airtruth.tracing.presentation.error_table import axial_words, error_table
from airtruth.tracing.presentation.odds import odds_lines
from airtruth.tracing.presentation.tolerances import tolerance_table
from airtruth.units import printed

MOST_CANDIDATES: Final = 8
"""Number of candidates in the text [-] (judgement: as many as a round refits)."""
FAR_SIGMA: Final = 2.0
"""Declared standard deviations beyond which the verdict names a derivative [-] (convention)."""


def as_trace_text(answer: TraceAnswer) -> str:
    """The answer of a trace as plain text, with every table."""
    tolerances = tolerance_table(answer)
    blocks = [
        opening(answer),
        *([effect_line(e), *effect_details(e, answer.credit.get(e.key))] for e in answer.effects),
        as_text(error_table(answer)).rstrip("\n").splitlines(),
        *([as_text(tolerances).rstrip("\n").splitlines()] if tolerances else []),
        *([wrapped("Axial force", axial_words(answer.axial_force))] if answer.axial_force else []),
        as_text(derivative_table(answer)).rstrip("\n").splitlines(),
        *([wrapped("Sets of causes", sets_line(answer))] if len(answer.alternatives) > 1 else []),
        ["Candidates, accepted effects first, then by significance:", *candidate_lines(answer)],
        wrapped("Smallest traceable sizes", "; ".join(detectable(answer)) + "."),
        wrapped("Next flight", answer.next_flight),
    ]
    if answer.updated_aircraft:
        blocks.append([f"Updated aircraft: {answer.updated_aircraft}"])
    blocks += [wrapped("Note", note + ".") for note in answer.notes]
    return "\n\n".join("\n".join(block) for block in blocks)


def opening(answer: TraceAnswer) -> list[str]:
    """Lines of the verdict, the posterior of its set, and the records."""
    sentences = (verdict(answer), *odds_lines(answer), records_line(answer))
    return [line for sentence in sentences for line in textwrap.wrap(sentence, WIDTH)]


def verdict(answer: TraceAnswer) -> str:
    """The verdict in one or two sentences."""
    sentence = _conclusion(answer)
    if answer.provisional:
        held = answer.records.held_out
        if not held:
            why = "no record was held out"
        elif answer.confirmed is False:
            why = "the held-out records are worse with the effects than without them"
        elif answer.remaining.p_value > CRITERION.significant:
            why = "the notes state the reason"
        else:
            why = f"a significant anomaly remains ({_evidence(answer.remaining)})"
        sentence += f" Provisional: {why}."
    return sentence


def _conclusion(answer: TraceAnswer) -> str:
    if answer.verdict == "none":
        declared = answer.declared_model
        own = "" if declared is None else f"; {probability(declared.p_value)} for the declared model"
        return (
            f"None: the declared aircraft explains these records ({probability(answer.anomaly.p_value)} for a missing "
            f"effect{own}); they show no missing effect.{_refinement(answer)}"
        )
    if answer.verdict == "unexplained":
        return (
            f"Unexplained: the declared aircraft lacks something ({_evidence(answer.remaining)}), and no candidate "
            "passes every acceptance test."
        )
    alike = _alike(answer)
    sentence = f"{_contradiction(answer)}{_kind(answer)}: {_causes(answer)}"
    if alike:
        sentence += f", or an effect that looks the same in these records: {', '.join(alike)}"
    return sentence + "."


def _refinement(answer: TraceAnswer) -> str:
    """Derivatives that the updated aircraft has from the records, in a sentence; empty for none."""
    refined = [
        f"{name} {significant(r.estimate)} +- {significant(r.std, 2)} (declared {significant(r.declared)})"
        for name, r in answer.refined.items()
    ]
    return f" They refine {_listed(refined)}." if refined else ""


def headline(answer: TraceAnswer) -> str:
    """The verdict in a few words, for the heading of a figure: ``Traced: vane_arm (provisional)``."""
    if answer.effects:
        words = f"{_kind(answer)}: {_listed([e.key for e in answer.effects])}"
        words += "".join(f" or {name}" for name in _alike(answer))
    else:
        words = "No missing effect" if answer.verdict == "none" else "Unexplained residual"
    return words + (" (provisional)" if answer.provisional else "")


def _kind(answer: TraceAnswer) -> str:
    """Lines about the effects of an answer."""
    return "Learned" if answer.verdict == "learned" else "One of several" if _alike(answer) else "Traced"


def _alike(answer: TraceAnswer) -> list[str]:
    """Effects that look the same as an accepted one."""
    return sorted({name for e in answer.effects for name in e.indistinguishable_from})


def _contradiction(answer: TraceAnswer) -> str:
    """That the records contradict the declared model, and the derivatives farthest from it."""
    declared = answer.declared_model
    if declared is None or declared.consistent:
        return ""
    far = [
        f"{name} {significant(s.estimate)} for {significant(s.declared)}"
        for name, s in declared.shifts.items()
        if abs(s.sigma) > FAR_SIGMA
    ]
    shifts = f": {', '.join(far)}" if far else ""
    return f"The records contradict the declared model ({probability(declared.p_value)}){shifts}. "


def _causes(answer: TraceAnswer) -> str:
    """Lines about the effects that the declared aircraft lacks, and about its derivatives."""
    lacks = [e.key for e in answer.effects if not _in_derivatives(e.name) and e.acts_on is None]
    learned = [f"an increment of {e.variant}" for e in answer.effects if e.acts_on is not None]
    lacks += [f"{_listed(learned)}, which no effect of the library describes"] if learned else []
    explains = [e.key for e in answer.effects if _in_derivatives(e.name) and e.name != DERIVATIVES]
    parts = [f"the declared aircraft lacks {_listed(lacks)}"] if lacks else []
    if explains:
        parts.append(f"{_listed(explains)} explain{'' if len(explains) > 1 else 's'} the derivatives")
    wrong = [p[1:] for e in answer.effects if e.name == DERIVATIVES for p in e.parameters]
    if wrong:
        parts.append(f"the declared {_listed(wrong)} {'are' if len(wrong) > 1 else 'is'} wrong")
    return "; ".join(parts)


def sets_line(answer: TraceAnswer) -> str:
    """Sets of causes with their posterior weights."""
    shown = answer.alternatives[:MOST_CANDIDATES]
    sets = "; ".join(f"{' + '.join(s.effects) or 'none'} {100.0 * s.weight:.0f} %" for s in shown)
    rest = len(answer.alternatives) - len(shown)
    return sets + (f"; and {rest} more." if rest else ".")


def _in_derivatives(name: str) -> bool:
    return name == DERIVATIVES or (name in EFFECTS and EFFECTS[name].prior is not None)


def _listed(names: list[str]) -> str:
    *most, last = names
    return f"{', '.join(most)} and {last}" if most else last


def _evidence(evidence: Evidence) -> str:
    where = f"; it shows in {evidence.where}" if evidence.where else ""
    return probability(evidence.p_value) + where


def unit_of(key: str, parameter: str) -> str:
    """Printed unit of an effect's parameter; "" where it has none or the library lacks the effect."""
    effect = EFFECTS.get(key) or next((e for e in EFFECTS.values() if e.name == key), None)
    if effect is None:
        return ""
    unit = {p.name: p.unit for p in effect.parameters}.get(parameter, "")
    return printed(unit)


def interval(estimate: ParameterEstimate) -> str:
    """``0.0196 to 0.0214``, "-" for an end at infinity."""
    low, high = (significant(end) if end is not None else "-" for end in estimate.ci95)
    return f"{low} to {high}"


def effect_line(effect: AcceptedEffect) -> str:
    """Name and size: ``elevator_delay: delay_s = 0.0205 +- 0.00045 s (95 %: 0.0196 to 0.0214)``."""
    if effect.table is not None:
        return f"{effect.key}: {increment_words(effect)}"
    parts = []
    for name, estimate in effect.parameters.items():
        unit = unit_of(effect.key, name)
        size = f"{significant(estimate.value)} +- {significant(estimate.std, 2)} {unit}".rstrip()
        parts.append(f"{name} = {size} (95 %: {interval(estimate)})")
    words = f"; {increment_words(effect)}" if effect.acts_on is not None else ""
    return f"{effect.key}: {', '.join(parts)}{words}"


def _through(state: IncrementState) -> str:
    if state.kind == "play":
        return f"through a play of half width {significant(state.half_width, 2)}"
    return f"through a {state.kind} of {significant(state.time_s, 2)} s" + (
        " (1/wn)" if state.kind == "mode" else ""
    )


def largest_words(table: IncrementTable, over: str) -> str:
    """Largest value of a learned table, where it is, and its band."""
    i = max(range(len(table.at)), key=lambda k: abs(table.value[k]))
    low, high = significant(table.low[i], 2), significant(table.high[i], 2)
    return f"{significant(table.value[i], 2)} at {over} = {significant(table.at[i])} (95 %: {low} to {high})"


def increment_words(effect: AcceptedEffect) -> str:
    """A learned increment in words: largest value, onset, memory, and size relative to the declared model."""
    over, table = effect.over or "", effect.table
    parts = []
    play = next((state.half_width for state in effect.states if state.kind == "play"), None)
    if table is not None and STEP in effect.parameters and play is not None:
        parts.append(_switch(effect.parameters[STEP], table, over, play))
    elif table is not None:
        parts.append(f"{effect.subject} {largest_words(table, over)}")
        if effect.by and effect.states:
            change_s = max(table.value, key=abs) * effect.states[0].time_s
            parts.append(f"the time constant changes by {significant(change_s, 2)} s there")
        parts.append(_onset(table, over))
    parts += [_through(s) for s in effect.states if not effect.by]
    if effect.relative_size is not None:
        whole = (
            f"motion of {effect.acts_on}"
            if effect.acts_on in OUTPUTS
            else "declared CX over the flown angles of attack"
            if effect.acts_on == "CX"
            else "declared derivative"
            if effect.by
            else "declared derivative in the flown range"
        )
        parts.append(f"{significant(100.0 * effect.relative_size, 2)} % of the {whole}")
    return "; ".join(parts)


def _switch(step: ParameterEstimate, table: IncrementTable, over: str, half_width: float) -> str:
    """A step behind a play: its size, and the values of the signal at which it comes and goes."""
    middle = 0.5 * sum(table.at[table.steepest : table.steepest + 2])
    comes, goes = (significant(middle + half) for half in (half_width, -half_width))
    return (
        f"a step of {significant(step.value, 2)} (95 %: {interval(step)}) that comes where {over} rises above {comes} and goes "
        f"where it falls below {goes}"
    )


def _onset(table: IncrementTable, over: str) -> str:
    below, above = table.onset
    sides = [f"below {significant(below)}"] if below is not None else []
    sides += [f"above {significant(above)}"] if above is not None else []
    if not sides:
        return "its band contains zero at every single point"
    return f"its band excludes zero where {over} is {' or '.join(sides)}"


def effect_details(effect: AcceptedEffect, share: float | None = None) -> Iterator[str]:
    """Significance of an effect, and the effects that look the same."""
    is_learned, gain = effect.acts_on is not None, effect.gain_2_log_likelihood
    rule = (
        "inverse of the posterior odds over all increments tried"
        if is_learned
        else "Holm over all candidates"
    )
    line = f"  {probability(effect.p_value)} ({rule})"
    if gain is not None:
        line += (
            f"; twice its log odds: {significant(gain)}"
            if is_learned
            else f"; its refit gains {significant(gain)} in 2 log L"
        )
    yield f"{line}; {significant(effect.separation_sigma)} sigma from the next effect"
    if share is not None:
        yield f"  {_removal(share)}"
    alike = effect.indistinguishable_from
    yield (
        f"  looks the same in these records: {', '.join(alike)}"
        if alike
        else "  no other effect that passes every test explains the records as well"
    )
    if effect.other_variants:
        names = ", ".join(f"{effect.name}:{v}" for v in effect.other_variants)
        yield f"  explains the records as well: {names}"


def _removal(share: float) -> str:
    """How much worse the answer fits without one of its effects."""
    if share > 1.0:
        return "without it, the rest of this answer fits the records worse than the declared aircraft does"
    return f"without it, {100.0 * share:.0f} % of the improvement over the declared aircraft is lost (log-likelihood)"


def detectable(answer: TraceAnswer) -> Iterator[str]:
    """``elevator_delay 0.0033 s`` for each effect; of several variants, each variant."""
    stated = answer.detectability
    with_variants = {name.partition(":")[0] for name in stated if ":" in name}
    for name, value in stated.items():
        if name in with_variants:
            continue
        effect = EFFECTS.get(name)
        unit = unit_of(name, effect.parameters[0].name) if effect else ""
        yield f"{name} {significant(value, 2)} {unit}".rstrip()


def candidate_lines(answer: TraceAnswer, most: int = MOST_CANDIDATES) -> Iterator[str]:
    """The foremost candidates, one line each, how many others there are, and those that cannot be tested."""
    testable = [r for r in ranked(answer) if r.candidate.testable]
    shown = testable[:most]
    width = max((len(r.candidate.key) for r in shown), default=0)
    for r in shown:
        c = r.candidate
        gain = "" if r.gain is None else f"; its refit gains {significant(r.gain)} in 2 log L"
        score = f"score {significant(c.score).rjust(7)}  {probability(c.p_value).ljust(12)}"
        yield f"  {c.key.ljust(width)}  {score}  {r.outcome}{gain}"
    if len(testable) > len(shown):
        yield f"  and {len(testable) - len(shown)} more"
    silent = [c.key for c in answer.candidates if not c.testable]
    if silent:
        yield from textwrap.wrap(
            f"Not testable here: {', '.join(silent)}", WIDTH, initial_indent="  ", subsequent_indent="  "
        )


def records_line(answer: TraceAnswer) -> str:
    """Fitted and held-out records, and the model."""
    records = answer.records
    held = ", ".join(records.held_out) or "none"
    model = (
        "forces probed in JSBSim" if answer.model == "aircraft" else f"linear {answer.motion.linear} model"
    )
    count = len(records.fitted)
    fitted = "1 record fitted, in two parts" if count == 1 else f"{count} records fitted"
    return f"{fitted}, held out: {held}; {model}."


def wrapped(heading: str, words: str) -> list[str]:
    """A paragraph behind its heading."""
    return textwrap.wrap(f"{heading}: {words}", WIDTH, subsequent_indent="  ")


__all__ = [
    "FAR_SIGMA",
    "as_trace_text",
    "candidate_lines",
    "detectable",
    "effect_details",
    "effect_line",
    "headline",
    "increment_words",
    "interval",
    "largest_words",
    "opening",
    "sets_line",
    "unit_of",
    "verdict",
    "wrapped",
]
