"""Levels of significance of a search, and the gain in 2 log L that each demands of a refit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from airtruth.tracing.inference.hypothesis_test import HypothesisTest
from airtruth.tracing.selection.score_test import ScoreTable

LEVEL: Final = 0.05
"""Significance level of the scores in the first round, after Holm's correction [-] (convention)."""
REMAINS: Final = 0.01
"""Probability of the remaining anomaly below which effects without a score are refitted and increments learned [-]; that of an
unexplained verdict."""
BEYOND_DOUBT: Final = 1e-6
"""Probability of an anomaly below which a model is misspecified whatever the next effect explains [-] (judgement)."""
LATER_LEVEL: Final = 0.005
"""Significance level of the scores in later rounds [-] (judgement: a tenth of that of the first)."""
MISFIT_LEVEL: Final = 0.001
"""Significance level of the scores beside an anomaly beyond doubt [-] (judgement: a misspecified model always leaves a small
residual, and a stricter level adds fewer false effects at the price of small true ones)."""
FAMILY_LEVEL: Final = 0.05165827451
"""Significance level of the gain in 2 log L of a refit over all candidates, by Bonferroni's rule [-]: a gain of 10.0
where 33 candidates are tested, 10.1 for the 35 of the library (judgement: a round figure next to 5 %)."""
LATER_FAMILY_LEVEL: Final = 2.090301960986e-3
"""Level of that gain in later rounds [-]: a gain of 16.0 for 33 candidates (judgement: beside three true effects, the best false
one gains less than 16 in 77 of 78 triples, those for which the limit was chosen; seven true ones gain 16 to 25)."""
MISFIT_FAMILY_LEVEL: Final = 1.8919003744e-5
"""Level of that gain beside an anomaly beyond doubt [-]: a gain of 25.0 for 33 candidates (judgement: as `MISFIT_LEVEL`)."""


def significant_gain(candidates: int, level: float = FAMILY_LEVEL) -> float:
    """Gain in 2 log L from which a refit is significant among so many candidates (Bonferroni, chi-square(1)).

    Source: S. S. Wilks, Ann. Math. Statist. 9 (1938) 60-62.

    Parameters
    ----------
    level : significance level over all candidates [-].
    """
    return float(chi2.isf(level / max(candidates, 1), 1))


def later_gain(candidates: int, anomaly: HypothesisTest) -> float:
    """Gain in 2 log L from which an effect is significant beside others that leave an anomaly."""
    misfit = anomaly.p_value < BEYOND_DOUBT
    return significant_gain(candidates, MISFIT_FAMILY_LEVEL if misfit else LATER_FAMILY_LEVEL)


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


__all__ = ["later_gain", "significant_gain", "strongest"]
