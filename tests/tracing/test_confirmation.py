"""Confirmation on held-out records: sums over samples against their long-run variance."""

from types import SimpleNamespace

import numpy as np
import pytest

from airtruth.tracing.confirmation import confirmation
from airtruth.tracing.inference.assess import Assessment

SAMPLES = 400


def assessed(scale: float, seed: int, offset: float = 0.0) -> Assessment:
    """White innovations and a free run of so many units; the covariance of the innovations is that of unit scale."""
    rng = np.random.default_rng(seed)
    whitened = scale * rng.standard_normal((SAMPLES, 3))
    residual = offset + scale * rng.standard_normal((SAMPLES, 3))
    free = np.sqrt((residual**2).mean(axis=0))
    nothing = np.zeros(3)
    return Assessment(
        0.5 * float((whitened**2).sum()), nothing, free, residual, whitened, nothing, np.zeros(1)
    )


def stages(before, after, held=True):
    records = [SimpleNamespace(signals=SimpleNamespace(dt_s=0.02))] * len(before)
    settings = SimpleNamespace(measured=np.ones(3, dtype=np.bool_))
    case = SimpleNamespace(held=SimpleNamespace(records=records, settings=settings) if held else None)
    models = {"before": None} | ({"after": None} if after else {})
    return SimpleNamespace(case=case, models=models, held={"before": before, "after": after})


@pytest.mark.parametrize(
    ("before", "after", "confirmed"),
    [
        ([assessed(1.0, 1), assessed(1.0, 2)], [assessed(1.0, 1), assessed(1.0, 2)], True),
        ([assessed(1.3, 1), assessed(1.3, 2)], [assessed(1.0, 1), assessed(1.0, 2)], True),
        ([assessed(1.0, 1), assessed(1.0, 2)], [assessed(1.3, 1), assessed(1.3, 2)], False),
        ([assessed(1.0, 1)], [assessed(1.0, 1, offset=0.6)], False),
    ],
    ids=["the same", "better", "worse innovations", "worse free run"],
)
def test_worse_records_do_not_confirm(before, after, confirmed):
    assert confirmation(stages(before, after)) is confirmed


def test_chance_seldom_denies():
    """Two unrelated models of equal error, the least favourable case: denied in one of ten (9.6 % of 1000)."""
    denied = sum(
        confirmation(stages([assessed(1.0, 2 * k)], [assessed(1.0, 2 * k + 1)])) is False for k in range(200)
    )
    assert denied <= 32  # 19 expected, binomial standard deviation 4.1


def test_nothing_to_compare():
    one = [assessed(1.0, 1)]
    assert confirmation(stages(one, one, held=False)) is None
    assert confirmation(stages(one, None)) is None
