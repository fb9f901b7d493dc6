"""Reliability of posterior weights: deciles of sets, and which sets of a trial count."""

import numpy as np
import pytest

from validation.blind.calibration import is_counted, markdown, reliability, weighed_sets


def test_a_decile_has_its_mean_weight_and_its_share_of_right_sets():
    """Eight sets of 0.84 of which six are right: Clopper and Pearson give 0.349 to 0.968 (their table of 1934)."""
    pairs = [(0.84, k < 6) for k in range(8)] + [(0.05, False)] * 3
    low, high = reliability(pairs)
    assert (low.right.count, low.right.value, low.high) == (3, 0.0, pytest.approx(0.1))
    assert (high.right.count, high.right.value, high.weight) == (8, 0.75, pytest.approx(0.84))
    assert high.right.interval == pytest.approx((0.349, 0.968), abs=1e-3)


def test_calibrated_weights_lie_on_the_diagonal():
    """Ten thousand sets that are right with their own probability, to four standard errors of a decile."""
    rng = np.random.default_rng(5)
    weights = rng.uniform(0.01, 1.0, 10_000)
    right = rng.uniform(size=weights.size) < weights
    for row in reliability(list(zip(weights.tolist(), right.tolist(), strict=True))):
        assert row.right.value == pytest.approx(row.weight, abs=4.0 * 0.5 / np.sqrt(row.right.count))


def case(effects, lambdas, alternatives):
    trial = {"effects": [{"key": key} for key in effects], "composition": "pair"}
    answer = {"alternatives": [{"effects": list(names), "weight": w} for names, w in alternatives]}
    return {"truth": {"trial": trial, "lambda": lambdas}, "answer": answer}


def test_sets_with_increments_and_negligible_sets_do_not_count():
    alternatives = [((), 0.6), (("vane_lag",), 0.3), (("increment",), 0.095), (("gyro_lag",), 0.005)]
    assert list(weighed_sets(case((), {}, alternatives))) == [(0.6, True), (0.3, False)]
    own = case(("vane_lag",), {"vane_lag": 90.0}, alternatives)
    assert list(weighed_sets(own)) == [(0.6, False), (0.3, True)]
    assert is_counted(own)
    assert not is_counted(case(("vane_lag",), {"vane_lag": 3.0}, alternatives))


def test_the_table_has_a_row_for_each_mode():
    text = markdown({"null": [(0.8, True), (0.7, True)], "single": [(0.5, False), (0.9, True)]})
    assert "| null | 2 | 0.75 | 1.00 (0.16 to 1.00) |" in text
    assert "| 0.4 to 0.5 | 1 | 0.50 | 0.00 (0.00 to 0.97) |" in text
