"""Tolerances of 14 CFR Part 60, Table A2A, 2.c.10: 1.5 deg pitch or 2 deg/s, and 0.10 g."""

from types import SimpleNamespace

import numpy as np
import pytest

from airtruth.tracing.tolerances import excursion, tolerances
from airtruth.units import DEG, G0

DT = 0.02


def residual(q_deg_s=0.0, az_g=0.0, samples=101):
    """A constant in q over the first half, in az at one sample."""
    e = np.zeros((samples, 3))
    e[: samples // 2 + 1, 1] = q_deg_s * DEG
    e[10, 2] = az_g * G0
    return e


@pytest.mark.parametrize(
    ("q_deg_s", "az_g", "within"),
    [
        (0.0, 0.0, True),
        (1.9, 0.0, True),  # 1.9 deg after 1 s, but the rate is inside
        (1.9, 0.099, True),
        (1.9, 0.101, False),
        (2.1, 0.0, False),  # 2.1 deg after 1 s, and the rate is outside
    ],
)
def test_pitch_or_rate_and_normal_acceleration(q_deg_s, az_g, within):
    assert excursion(residual(q_deg_s, az_g), DT).within is within


def test_a_fast_excursion_of_small_angle_is_inside():
    """3 deg/s for 0.4 s: 1.2 deg."""
    e = np.zeros((101, 3))
    e[10:30, 1] = 3.0 * DEG
    found = excursion(e, DT)
    assert found.within
    assert found.pitch_rad == pytest.approx(1.2 * DEG, rel=1e-12)
    assert found.rate_rad_s == pytest.approx(3.0 * DEG, rel=1e-12)


def test_the_share_counts_samples():
    """2.1 deg/s leaves the rate at once and the pitch once 1.5 deg are passed, at 0.72 s of 1 s."""
    found = excursion(residual(2.1), DT)
    outside = np.arange(51) * DT * 2.1 > 1.5
    assert found.share == pytest.approx(1.0 - outside.sum() / 101.0)


def test_worst_record_and_count_of_every_stage():
    records = [SimpleNamespace(signals=SimpleNamespace(dt_s=DT)) for _ in range(2)]
    case = SimpleNamespace(fitted=SimpleNamespace(records=records), held=SimpleNamespace(records=records[:1]))
    good, bad = (SimpleNamespace(residual=residual(1.0, g)) for g in (0.05, 0.2))
    stages = SimpleNamespace(
        case=case,
        fitted={"before": [good, bad], "after": [good, good]},
        held={"before": [bad], "after": [good]},
    )
    found = tolerances(stages)
    assert found.limits["az_m_s2"] == pytest.approx(0.10 * G0)
    before, after = found.stages["before"], found.stages["after"]
    assert (before.fit.records_within, before.fit.records) == (1, 2)
    assert before.fit.az_m_s2 == pytest.approx(0.2 * G0)
    assert (before.held_out.records_within, after.held_out.records_within) == (0, 1)
    assert after.fit.share_inside == 1.0
