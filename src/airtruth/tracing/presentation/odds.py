"""The posterior of an answer in words: weight of its set, odds against the next one, and what a wider set adds."""

from __future__ import annotations

from typing import Final

from airtruth.effects.increment import NAME
from airtruth.table import significant
from airtruth.tracing.answer import Alternative, TraceAnswer

_MOST_ODDS: Final = 1e4
"""Odds from which their number is not printed [-]: the likelihood is not known so well."""
_LEAST_WIDER: Final = 0.01
"""Posterior weight from which a wider set is mentioned [-]."""


def odds_lines(answer: TraceAnswer) -> tuple[str, ...]:
    """One line about the set of the answer, and one about the most probable set that contains it; none without sets.

    A set that the answer does not list, because it is improbable, has no lines.
    """
    names = {NAME if e.acts_on is not None else e.label for e in answer.effects}
    own = next((s for s in answer.alternatives if set(s.effects) == names), None)
    if own is None or len(answer.alternatives) < 2:
        return ()
    others = [s for s in answer.alternatives if s is not own]
    wider = [s for s in others if set(s.effects) > names and s.weight >= _LEAST_WIDER]
    rivals = [s for s in others if not set(s.effects) > names]
    words = f"Posterior of {_named(own)}: {_percent(own.weight)}"
    if answer.verdict == "unexplained":
        words = f"Among the sets of the library, none of which explains these records, {_named(own)} has {_percent(own.weight)}"
    if rivals:
        words += f"; odds of {_odds(own, rivals[0])} against {_named(rivals[0])}, the next one"
    lines = [f"{words}."]
    if wider:
        added = " and ".join(name for name in wider[0].effects if name not in names)
        lines.append(
            f"A wider set adds {added}: {_percent(wider[0].weight)}, {_odds(wider[0], own)} against the simpler one."
        )
    return tuple(lines)


def _named(one: Alternative) -> str:
    return " + ".join(one.effects) or "no missing effect"


def _percent(weight: float) -> str:
    return f"{100.0 * weight:.0f} %" if weight >= 0.005 else "below 1 %"


def _odds(one: Alternative, other: Alternative) -> str:
    """``12 to 1``, ``1 to 3``."""
    ratio = one.weight / max(other.weight, one.weight / _MOST_ODDS)
    if ratio < 1.0:
        return f"1 to {significant(1.0 / ratio, 2)}"
    return f"{'more than ' if ratio >= _MOST_ODDS else ''}{significant(ratio, 2)} to 1"


__all__ = ["odds_lines"]
