"""Evidence that an effect is missing, as the omnibus tests and the scores state it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Anomaly:
    """Evidence of a missing effect.

    Attributes
    ----------
    where : name of the effect or of the test that shows it.
    statistic, degrees : chi-square statistic and its degrees of freedom [-].
    p_value : probability of a larger statistic where nothing is missing [-].
    """

    where: str
    statistic: float
    degrees: int
    p_value: float


__all__ = ["Anomaly"]
