"""Evidence that an effect is missing, as the omnibus tests and the scores state it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

DERIVATIVES_MOVED: Final = "the derivatives"
"""Where evidence shows that the derivatives are not those that are declared, or not those that an answer gives."""


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


__all__ = ["DERIVATIVES_MOVED", "Anomaly"]
