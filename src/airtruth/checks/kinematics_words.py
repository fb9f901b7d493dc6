"""The verdict of a kinematic check, and its conclusions in words."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from airtruth.checks.kinematics_search import ErrorSearch
from airtruth.checks.result import Finding, PossibleCause, Verdict, digits_of, shown
from airtruth.units import G0

AGREES: Final = 0.05
"""Probability of the absolute test below which the channels are not called consistent."""
NAMED: Final = ("present", "one of")
"""States of an error that an explanation has; a check that failed names none."""
_LIKE_FRICTION: Final = ("vane_lag", "sensor_delay:alpha_rad")
"""Errors that a friction of the vane imitates: a play of 1.2 deg was a lag of 33 ms on a small aircraft in gusts."""


def verdict_of(found: ErrorSearch, findings: Sequence[Finding]) -> Verdict:
    """Answer of a check."""
    if limiting(found):
        return "failed"
    states = {f.state for f in findings if f.name != "forward_bias"}
    if not found.best.names and not states & set(NAMED):
        needed = found.problem.kinematics.telling
        telling = all(f.smallest <= needed.get(f.name, f.smallest) for f in findings)
        return "agrees" if telling and found.p_value > AGREES else "cannot_tell"
    return "one_of" if "one of" in states else "errors"


def limiting(found: ErrorSearch) -> tuple[str, ...]:
    """Errors whose fit ended at a limit or unconverged although it explains more than the best set."""
    names = [
        n
        for e in found.unsound
        if e.cost < found.best.cost - found.margin
        for n in (e.fit.at_limit or e.fit.names)
    ]
    return tuple(sorted(set(names)))


def conclusions(
    verdict: Verdict, found: ErrorSearch, findings: Sequence[Finding], causes: Sequence[PossibleCause]
) -> list[str]:
    """Conclusions in words, the most important first."""
    result = _headline(verdict, found, findings, causes)
    if verdict != "agrees" and found.enlargement > 1.0 and found.p_value <= AGREES:
        result.append(
            f"The errors do not explain all motion that follows {found.problem.kinematics.controls} "
            f"(p = {found.p_value:.1g}), so the sensor noise is "
            f"multiplied by {found.enlargement**0.5:.2g}. The motion has terms outside this check (sideslip, roll, "
            "flexibility or other sensor errors)."
        )
    if any(f.name in _LIKE_FRICTION and f.state in NAMED for f in findings):
        result.append(
            "A friction of the vane, which this check does not model, looks like a lag or a delay of the vane: move the vane by "
            "hand with the log running, or trace the records, which tests a friction."
        )
    if not found.stable:
        result.append("The estimate of the sensor noise did not converge, so the sizes are unreliable.")
    dark = [f.name for f in findings if f.state == "not shown"]
    if dark:
        result.append(
            f"These records cannot show {', '.join(dark)} of usual size; fly a stronger manoeuvre, or more records."
        )
    return result


def _headline(
    verdict: Verdict, found: ErrorSearch, findings: Sequence[Finding], causes: Sequence[PossibleCause]
) -> list[str]:
    if verdict == "failed":
        return [
            f"The check failed: the fit of {', '.join(limiting(found))} ended at a limit of its range or did not converge, "
            "and explains more than every other set. No size below may be used; inspect the channels, cut the record to one "
            "manoeuvre, or declare what is known of the sensors in the aircraft.toml of --aircraft."
        ]
    if verdict == "agrees":
        limits = ", ".join(
            f"{f.name} {f.smallest:.{digits_of(f.smallest)}f}{'' if f.unit == '-' else ' ' + f.unit}"
            for f in findings
            if f.state == "not needed" and "bias" not in f.name
        )
        return [
            f"The channels agree (chi-square {found.statistic:.1f}, {found.degrees} degrees of freedom, "
            f"p = {found.p_value:.2f}).",
            f"Larger errors than these would have been seen: {limits}.",
        ]
    if verdict == "cannot_tell":
        needed = found.problem.kinematics.telling
        weak = [f for f in findings if f.smallest > needed.get(f.name, f.smallest)]
        reasons = [
            f"{f.name} below {f.smallest:.2g}{'' if f.unit == '-' else ' ' + f.unit} would not be seen"
            for f in weak
        ]
        if found.p_value <= AGREES:
            reasons.append(f"motion remains that no error explains (p = {found.p_value:.2g})")
        return [
            f"These records cannot tell whether the channels agree: {'; '.join(reasons)}. Fly a stronger manoeuvre, or "
            "more records."
        ]
    return _named(findings, causes)


def _named(findings: Sequence[Finding], causes: Sequence[PossibleCause]) -> list[str]:
    result = []
    possible = [c for c in causes if c.possible]
    for one in findings:
        if one.state == "present":
            declared = f"{one.declared:.4g}{'' if one.unit == '-' else ' ' + one.unit}"
            note = f", where {declared} is declared" if "bias" not in one.name or one.declared else ""
            result.append(f"{one.name} is {shown(one)}{note}.")
    common = (
        frozenset.intersection(*(frozenset(f.name for f in c.errors) for c in possible))
        if possible
        else frozenset()
    )
    options = [[f for f in c.errors if f.name not in common] for c in possible]
    by_name = {f.name: f for f in findings}
    if len(options) > 1:

        def words(errors: Sequence[Finding]) -> str:
            return " with ".join(f"{f.name} {shown(f)}" for f in errors)

        # where every choice of one list goes with every choice of the other, two lists replace the product
        lists = _factors([frozenset(f.name for f in o) for o in options])
        first = {f.name: f for o in reversed(options) for f in o}
        told = (
            "; and one of: ".join(
                " or ".join(words([first[n] for n in sorted(c)]) for c in choices) for choices in lists
            )
            if lists
            else " or ".join(words(o) for o in options)
        )
        result.append(
            f"One of several: {told}. These records do not tell them apart; a surveyed position, a known scale or "
            "a manoeuvre of higher frequency does."
        )
    bias, scale = by_name.get("accelerometer_bias"), by_name.get("accelerometer_scale")
    if bias is not None and scale is not None and bias.state == "one of":
        factor = scale.declared * (1.0 - (bias.value - bias.declared) / G0)
        result.append(
            f"accelerometer_bias is {shown(bias)}, or accelerometer_scale is {factor:.3f}: "
            "gravity alone does not tell them apart."
        )
    return result


def _factors(sets: Sequence[frozenset[str]]) -> tuple[list[frozenset[str]], list[frozenset[str]]] | None:
    """Two lists whose every pair is one of the sets, and whose pairs are all of them; None where there are no such lists.

    Examples
    --------
    >>> ab_cd = [frozenset(pair) for pair in ("ac", "bc", "ad", "bd")]
    >>> [[*map(sorted, one)] for one in _factors(ab_cd) or ()]
    [[['a'], ['b']], [['c'], ['d']]]
    """
    names = dict.fromkeys(n for one in sets for n in sorted(one))
    for name in names:
        rest = {one - {name} for one in sets if name in one}
        second = list(dict.fromkeys(one - {name} for one in sets if name in one))
        own = frozenset().union(*second)
        first = list(dict.fromkeys(one - own for one in sets))
        if min(len(first), len(second)) < 2:
            continue
        if all({one & own for one in sets if one - own == choice} == rest for choice in first):
            return first, second
    return None


__all__ = ["NAMED", "conclusions", "limiting", "verdict_of"]
