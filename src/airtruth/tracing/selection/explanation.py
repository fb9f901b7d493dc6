"""The set of effects that an answer states, of several with their weights, and its explanation of the derivatives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from airtruth.effects.registry import EFFECTS
from airtruth.tracing.criterion import CRITERION
from airtruth.tracing.inference.causes import DERIVATIVES


@dataclass(frozen=True)
class ExplainedDerivatives:
    """Physical causes that the filter does not carry, and wrong declarations of derivatives.

    Attributes
    ----------
    causes : keys of the causes; wrong : names of the derivatives whose declaration is wrong.
    sizes, size_std : (causes,) estimates without the prior of the sizes, and their standard deviations.
    """

    causes: tuple[str, ...]
    wrong: tuple[str, ...]
    sizes: tuple[float, ...]
    size_std: tuple[float, ...]

    @property
    def effects(self) -> tuple[str, ...]:
        """Keys of its effects: the causes, then `DERIVATIVES` where declarations are wrong."""
        return (*self.causes, *([DERIVATIVES] if self.wrong else []))


def simplest(weights: Mapping[tuple[str, ...], float]) -> tuple[str, ...]:
    """The set of the fewest events against which the odds of the most probable one are not substantial.

    Of sets of as many events, it has the fewest effects that are half as probable as the best of them.

    Parameters
    ----------
    weights : names of each set -> its posterior weight; at least one set.
    """
    enough = CRITERION.simpler * max(weights.values())
    fewest = min(events(n) for n, w in weights.items() if w >= enough)
    among = {n: w for n, w in weights.items() if w >= enough and events(n) == fewest}
    likely = CRITERION.even * max(among.values())
    return min((n for n, w in among.items() if w >= likely), key=lambda n: (len(n), -among[n]))


def shares(weights: Mapping[tuple[str, ...], float]) -> dict[tuple[str, ...], float]:
    """Weights of sets that add up to one."""
    total = sum(weights.values())
    return {names: weight / total for names, weight in weights.items()}


def events(effects: Sequence[str]) -> int:
    """Number of effects by their keys; those of one event come together."""
    own = [EFFECTS[key].event if key in EFFECTS else "" for key in effects]
    return own.count("") + len(set(own) - {""})


__all__ = ["ExplainedDerivatives", "events", "shares", "simplest"]
