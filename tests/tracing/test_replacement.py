"""The lead by which one finished search replaces another, case by case."""

import math

import pytest

from airtruth.tracing.selection.outcome import SearchOutcome, required_lead

LEAD = 5.0
MISFIT, REMAINS, CLEAN = 9e-7, 2e-6, 0.06
FEWER = -math.log(10.0)
"""Odds of ten to one."""


@pytest.mark.parametrize(
    ("old", "new", "needed"),
    [
        # both leave an anomaly beyond doubt, and one agrees with the kinematics
        ((2, MISFIT, False), (2, MISFIT, True), -5.0),
        ((2, MISFIT, False), (3, MISFIT, True), -5.0),
        ((2, MISFIT, True), (1, MISFIT, False), math.inf),
        # both or neither agree, or one leaves less: the kinematics decide nothing
        ((2, MISFIT, False), (2, MISFIT, False), LEAD),
        ((2, MISFIT, True), (2, MISFIT, True), LEAD),
        ((2, MISFIT, False), (2, REMAINS, True), LEAD),
        ((2, REMAINS, False), (2, MISFIT, False), LEAD),
        ((2, REMAINS, True), (2, MISFIT, False), LEAD),
        # fewer effects, and no anomaly that remains
        ((2, REMAINS, True), (1, REMAINS, True), FEWER),
        ((2, REMAINS, True), (2, CLEAN, True), 0.0),
        ((2, 0.02, True), (2, CLEAN, True), LEAD),
    ],
)
def test_the_lead_of_each_case(old, new, needed):
    assert required_lead(SearchOutcome(*old), SearchOutcome(*new), LEAD) == pytest.approx(needed)
