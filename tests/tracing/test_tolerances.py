"""Tolerances of 14 CFR Part 60, Table A2A, 2.c.10: 1.5 deg pitch or 2 deg/s, and 0.10 g."""

from types import SimpleNamespace

import numpy as np
import pytest

from airtruth.physics.motion import LATERAL, LONGITUDINAL
from airtruth.physics.proof_of_match import PROOFS
from airtruth.tracing.model.parameters import ParameterLayout
from airtruth.tracing.tolerances import excursion, tolerances
from airtruth.units import DEG, G0

DT = 0.02


def residual(q_deg_s=0.0, az_g=0.0, samples=101):
    """A constant in q over the first half, in az at one sample."""
    e = np.zeros((samples, 3))
    e[: samples // 2 + 1, 1] = q_deg_s * DEG
    e[10, 2] = az_g * G0
    return e


def judged(e, motion=LONGITUDINAL, measured=None):
    y = np.zeros_like(e) if measured is None else measured
    return excursion(e, y, motion.output_channels, DT, PROOFS[motion.name])


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
    assert judged(residual(q_deg_s, az_g)).within is within


def test_a_fast_excursion_of_small_angle_is_inside():
    """3 deg/s for 0.4 s: 1.2 deg."""
    e = np.zeros((101, 3))
    e[10:30, 1] = 3.0 * DEG
    found = judged(e)
    assert found.within
    assert found.distances["pitch_rad"] == pytest.approx(1.2 * DEG, rel=1e-12)
    assert found.distances["q_rad_s"] == pytest.approx(3.0 * DEG, rel=1e-12)


def test_the_share_counts_samples():
    """2.1 deg/s leaves the rate at once and the pitch once 1.5 deg are passed, at 0.72 s of 1 s."""
    found = judged(residual(2.1))
    outside = np.arange(51) * DT * 2.1 > 1.5
    assert found.share == pytest.approx(1.0 - outside.sum() / 101.0)


def test_worst_record_and_count_of_every_stage():
    records = [SimpleNamespace(signals=SimpleNamespace(dt_s=DT, y=np.zeros((101, 3)))) for _ in range(2)]
    fitted, held = (
        SimpleNamespace(records=own, layout=ParameterLayout(LONGITUDINAL)) for own in (records, records[:1])
    )
    case = SimpleNamespace(fitted=fitted, held=held)
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
    assert before.fit.distances["az_m_s2"] == pytest.approx(0.2 * G0)
    assert (before.held_out.records_within, after.held_out.records_within) == (0, 1)
    assert after.fit.share_inside == 1.0
    assert found.modes == {}


def test_rates_of_roll_and_yaw_by_the_larger_of_two_tolerances():
    """2 deg/s, or 10 % of the measured rate: 2.9 deg/s are inside at 30 deg/s, and outside at 28 deg/s."""
    e, y = np.zeros((50, 5)), np.zeros((50, 5))
    p, r = (LATERAL.output_channels.index(c) for c in ("p_rad_s", "r_rad_s"))
    e[5, p], y[5, p] = -2.9 * DEG, 30.0 * DEG
    e[7, r] = 1.9 * DEG
    assert judged(e, LATERAL, y).within
    y[5, p] = 28.0 * DEG
    found = judged(e, LATERAL, y)
    assert not found.within
    assert found.share == pytest.approx(49.0 / 50.0)
    assert found.distances == pytest.approx({"p_rad_s": 2.9 * DEG, "r_rad_s": 1.9 * DEG})
