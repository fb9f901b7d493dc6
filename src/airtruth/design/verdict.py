"""Question of the answer of a trace to the next flight: effects to separate, a derivative, or the band of an increment."""

from __future__ import annotations

from collections.abc import Iterator

from airtruth.design.band import COEFFICIENTS, BandQuestion
from airtruth.design.precision import DerivativeQuestion
from airtruth.design.question import Hypothesised, estimated, is_separable, tied_in
from airtruth.effects.registry import EFFECTS
from airtruth.errors import ConfigurationError
from airtruth.table.model import significant
from airtruth.tracing.answer import AcceptedEffect, TraceAnswer

Asked = tuple[Hypothesised, ...] | DerivativeQuestion | BandQuestion
"""Effects to separate, or what a flight has to determine."""


def asked_by(answer: TraceAnswer, source: str) -> Asked:
    """The question that a trace leaves open.

    Learned increments ask for a narrower band, and tied effects or sets of effects for their separation. The effect
    `derivatives`, accepted or tied with the accepted one, asks for the derivative that is known least, and a provisional
    verdict with one name for the separation from the nearest rival.

    Parameters
    ----------
    source : name of the file, for messages.

    Raises
    ------
    ConfigurationError
        If the trace leaves no question that an input answers; the message names the options that state one.
    """
    increments = tuple(e for e in answer.effects if e.acts_on in COEFFICIENTS)
    if increments:
        return BandQuestion(increments)
    tied = tied_in(answer)
    if tied:
        return tied
    for effect in answer.effects:
        if effect.name == "derivatives" and effect.parameters:
            return DerivativeQuestion((_widest(answer, effect),))
        if "derivatives" in effect.indistinguishable_from:
            return DerivativeQuestion((least_known(answer),))
    first, rival = _doubtful(answer), next(_rivals(answer), "")
    if first is not None and answer.provisional and rival:
        return (estimated(first), Hypothesised(EFFECTS[rival]))
    raise ConfigurationError(f"{source}: {_nothing_open(answer, first)}")


def _widest(answer: TraceAnswer, effect: AcceptedEffect) -> str:
    """The shifted derivative whose standard deviation is the largest share of its declared value."""
    share = {
        name.removeprefix("d"): p.std / max(abs(answer.derivatives.declared[name.removeprefix("d")]), 1e-9)
        for name, p in effect.parameters.items()
    }
    return max(share, key=lambda name: share[name])


def least_known(answer: TraceAnswer) -> str:
    """The derivative whose standard deviation after the trace is the largest share of its declared value."""
    declared, std = answer.derivatives.declared, answer.derivatives.after_std
    return max(std, key=lambda name: std[name] / max(abs(declared[name]), 1e-9), default="Cmq")


def _doubtful(answer: TraceAnswer) -> AcceptedEffect | None:
    """The accepted effect that is nearest to the next one."""
    every = [e for e in answer.effects if e.key in EFFECTS and is_separable(EFFECTS[e.key])]
    return min(every, key=lambda e: e.separation_sigma, default=None)


def _rivals(answer: TraceAnswer) -> Iterator[str]:
    """Keys of the effects that were not accepted, most significant first."""
    accepted = {e.name for e in answer.effects}
    for c in answer.candidates:
        if c.testable and c.name not in accepted and c.key in EFFECTS and is_separable(EFFECTS[c.key]):
            yield c.key


def _nothing_open(answer: TraceAnswer, first: AcceptedEffect | None) -> str:
    rivals = list(_rivals(answer))[:2]
    derivative = f"--derivative {least_known(answer)} for the derivative that is known least"
    if answer.verdict == "none":
        return (
            "the verdict is none and leaves no effects to separate, because the declared aircraft explains the records; "
            f"state --split A,B for effects that you expect, or {derivative}"
        )
    if answer.verdict == "unexplained":
        pair = (
            f"--split {','.join(rivals)} for the two nearest effects" if len(rivals) == 2 else "--split A,B"
        )
        return (
            "the verdict is unexplained: no effect passes every test, so that no hypothesis has a size to plan for; "
            f"fly what `next_flight` of the trace states, or state {pair}, or {derivative}"
        )
    if first is None:
        names = ", ".join(e.key for e in answer.effects) or "nothing"
        return (
            f"the verdict is {answer.verdict} ({names}), for which no flight is planned; state "
            f"--split A,B for other effects, or {derivative}"
        )
    rival = rivals[0] if rivals else "B"
    return (
        f"the verdict is {answer.verdict} and no two effects are tied: {first.key} is "
        f"{significant(first.separation_sigma)} sigma from the next effect; state --split {first.key},{rival} to confirm "
        f"it, or {derivative}"
    )


__all__ = ["Asked", "asked_by", "least_known"]
