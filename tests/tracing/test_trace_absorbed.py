"""Effects that refitted derivatives may have absorbed: of many records, few decide which of them are refitted to all."""

from dataclasses import replace

import numpy as np
import pytest
import trace_records as tr
from scaled_records import fitted

from airtruth.effects.registry import EFFECTS
from airtruth.tracing.selection import absorbed
from airtruth.tracing.selection.absorbed import refit_absorbed
from airtruth.tracing.selection.score_test import table
from airtruth.tracing.selection.set_table import SetTable
from airtruth.units import DEG

NAMES = ("vane_scale", "gyro_scale", "accelerometer_scale", "airspeed_scale", "vane_lag")
CANDIDATES = [EFFECTS[name] for name in NAMES]

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def problem():
    """Five records whose gyro reads 1.1 of the truth."""
    rng = np.random.default_rng(6)
    records = []
    for number in range(5):
        one = tr.fly(rng, amplitude=(-1.0) ** number * 2.0 * DEG, sigma_w=0.05, samples=100, name=str(number))
        records.append(replace(one, signals=replace(one.signals, y=one.signals.y * [1.0, 1.1, 1.0])))
    return tr.problem(records)


def refits(problem, most, monkeypatch):
    monkeypatch.setattr(absorbed, "RECORDS", most)
    steps = []
    null = fitted(problem)
    scores = table(null, problem, CANDIDATES, null.whitener, 1)
    return refit_absorbed(SetTable(problem), null, scores, (), steps.append, either_sign=True), steps


def test_the_best_of_few_records_is_the_best_of_all(problem, monkeypatch):
    """The same optimum as without the selection, to the tolerance of a fit (0.05 in log L); fewer effects are refitted."""
    few, steps = refits(problem, 3, monkeypatch)
    every, all_steps = refits(problem, 5, monkeypatch)
    assert few[0].score.effect.key == every[0].score.effect.key == "gyro_scale"
    assert few[0].fit.cost == pytest.approx(every[0].fit.cost, abs=0.05)
    assert few[0].size == pytest.approx(0.1, abs=0.03)
    assert len({r.score.effect.key for r in few}) < len({r.score.effect.key for r in every}) == len(NAMES)
    assert "refit vane_lag to 3 of 5 records" in steps
    assert all_steps == [f"refit {name} from the declared aircraft" for name in NAMES]
