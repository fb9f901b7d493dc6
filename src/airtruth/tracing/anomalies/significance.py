"""Levels of significance of a search, and the gain in 2 log L that each demands of a refit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from airtruth.tracing.anomalies.score_test import ScoreTable
from airtruth.tracing.inference.hypothesis_test import HypothesisTest

FAMILY_LEVEL: Final = 0.05165827451
"""Significance level of the gain in 2 log L of a refit over all candidates, by Bonferroni's rule [-]: a gain of 10.0
where 33 candidates are tested, 10.1 for the 35 of the library (judgement: a round figure next to 5 %)."""


def significant_gain(candidates: int, level: float = FAMILY_LEVEL) -> float:
    """Gain in 2 log L from which a refit is significant among so many candidates (Bonferroni, chi-square(1)).

    Source: S. S. Wilks, Ann. Math. Statist. 9 (1938) 60-62.

    Parameters
    ----------
    level : significance level over all candidates [-].
    """
    return float(chdtri(1, level / max(candidates, 1)))


def strongest(
    omnibus: Sequence[HypothesisTest], table: ScoreTable, adjusted: NDArray[np.float64]
) -> HypothesisTest:
    """The strongest evidence of a missing effect, a score or an omnibus test; p-value by Bonferroni's rule.

    Parameters
    ----------
    adjusted : (scores,) p-values of the table's scores after Holm's correction.
    """
    seen = list(omnibus)
    if table.scores:
        best = min(range(len(adjusted)), key=lambda i: (adjusted[i], -abs(table.scores[i].z)))
        s = table.scores[best]
        seen.append(HypothesisTest(s.effect.key, s.z**2, 1, float(adjusted[best])))
    # among p-values that underflow to zero, the chi-square farthest out by R. A. Fisher's sqrt(2 x)
    least = min(seen, key=lambda a: (a.p_value, np.sqrt(2.0 * a.degrees) - np.sqrt(2.0 * a.statistic)))
    return replace(least, p_value=min(1.0, len(seen) * least.p_value))


__all__ = ["significant_gain", "strongest"]
