"""The outcome of a statistical test: one type for every test of a trace."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class HypothesisTest:
    """A test of a null hypothesis.

    Attributes
    ----------
    null : the deviation that is absent under the null hypothesis: an effect, a band of frequencies, a shift of the derivatives;
        empty where nothing is named.
    statistic, degrees : chi-square statistic and its degrees of freedom [-].
    p_value : probability of a larger statistic under the null hypothesis, corrected where several tests are made [-].
    """

    null: str
    statistic: float
    degrees: int
    p_value: float


__all__ = ["HypothesisTest"]
