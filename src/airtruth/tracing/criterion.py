"""The constants that decide what a trace answers; the provenance of a result states them."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Final


@dataclass(frozen=True)
class AnswerCriterion:
    """Levels, odds and limits of an answer.

    Attributes
    ----------
    level : conventional level of significance [-]: of a score after Holm's correction, of what is learned without a name,
        and of a friction of the vane. Also the odds, one in twenty, within which a set explains the records as well as that
        of the answer, or is refitted, and down to which records left out may be less likely with a set than without.
    significant : probability below which an anomaly remains, the records contradict the declared derivatives, and the
        evidence of one name is not weak [-] (judgement: one right answer in a hundred).
    significant_of_several : the last of these where several effects are named [-]: a gain of 25 in 2 log L, because one
        effect that the library lacks can look like several of unequal evidence (judgement).
    declared : probability below which the declared model is contradicted [-] (judgement: at most one true declaration in a
        hundred may be; at a level of 0.01 it was 6 of 450).
    differ : probability of the agreement of the records below which names are provisional [-] (judgement: none of 80 nulls
        of the blind trials is below).
    certain : probability below which a test is beyond doubt [-] (judgement): records that disagree, or kinematics that
        contradict each other, are no "none", and an anomaly of the best set has every effect refitted alone. One of 140 null
        trials has 1.4e-7.
    simpler : posterior weight over that of the most probable effects from which fewer effects are preferred [-] (judgement:
        a further cause is named where the odds for it are substantial, beyond the square root of ten, by H. Jeffreys, Theory of
        Probability, 3rd ed. (1961), appendix B).
    even : the same for fewer effects of one event [-] (judgement: a changed loading changes CG, mass and inertia, as a
        rule), and posterior probability of a name below which it is provisional.
    wrong_by : standard deviation of a derivative whose declaration is wrong, over the declared one [-]: equal parts of a
        mixture (judgement: published uncertainties of derivatives are often too small by the first factor, and by up to the
        second).
    log_wrong : logarithm of the prior odds of all sets of wrong declarations together, whatever the number of derivatives [-]
        (judgement: one in seven).
    log_same_event : logarithm of the prior odds of each further cause of the same event, and of each further wrong derivative [-]
        (judgement: one in three).
    far : standard deviations that count as far [-] (convention): a free run of records left out that gets worse by more
        refuses a set, and a cause whose size is as many standard deviations of its prior is provisional.
    slight : overshoot allowed to an effect that cancels a declared term, as a fraction of that term [-] (judgement: a flight
        tells a term in alpha_dot to about that).
    many : number of separate causes from which their names are provisional [-] (judgement: in the blind trials an effect
        outside the library is answered by three or more names about as often as three true causes are).
    lead : log-evidence of increments from which they are evident without an anomaly, and from which they replace named
        effects [-] (judgement: refits of true shapes have tripled it, and a name is preferred to a curve).
    """

    level: float = 0.05
    significant: float = 0.01
    significant_of_several: float = 2e-5
    declared: float = 0.005
    differ: float = 1e-4
    certain: float = 1e-6
    simpler: float = 0.3
    even: float = 0.5
    wrong_by: tuple[float, float] = (3.0, 10.0)
    log_wrong: float = -2.0
    log_same_event: float = -1.0
    far: float = 3.0
    slight: float = 0.25
    many: int = 3
    lead: float = 5.0

    def __str__(self) -> str:
        """Names and values, ``level 0.05, significant 0.01, ...``."""
        return ", ".join(f"{f.name} {_number(getattr(self, f.name))}" for f in fields(self))


CRITERION: Final = AnswerCriterion()
"""That of every trace."""


def _number(value: float | tuple[float, ...]) -> str:
    return " and ".join(f"{x:g}" for x in value) if isinstance(value, tuple) else f"{value:g}"


__all__ = ["CRITERION", "AnswerCriterion"]
