"""Modes against the tolerances of 14 CFR Part 60: formulas against an integrated motion and published figures."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from airtruth.physics.lateral import LateralScale, lateral_system
from airtruth.physics.proof_of_lateral import BANK_RAD, RUDDER_RAD, SPIRAL_S, LateralProof, lateral_proof
from airtruth.units import DEG, G0
from tests.physics.test_lateral import THETA as GTM
from tests.physics.test_lateral import gtm_scale

ALPHA = np.radians(5.56)


@pytest.fixture
def scale() -> LateralScale:
    return gtm_scale()


def test_dutch_roll_of_the_gtm(scale):
    """Published: 5.985 rad/s and damping .120, thus a period of 1.0575 s and a half time of .965 s."""
    found = lateral_proof(GTM, scale)
    assert found.dutch_roll_period_s == pytest.approx(
        2.0 * np.pi / (5.985 * np.sqrt(1.0 - 0.12**2)), rel=1e-3
    )
    assert found.dutch_roll_damping == pytest.approx(0.120, abs=2e-4)
    assert found.dutch_roll_half_s == pytest.approx(np.log(2.0) / (0.120 * 5.985), rel=2e-3)


def test_peaks_of_an_integrated_dutch_roll(scale):
    """The peak of bank that is nearest to a peak of sideslip, in an oscillation of the mode alone."""
    a = lateral_system(GTM, scale).a
    roots, vectors = np.linalg.eig(a)
    k = int(np.argmax(roots.imag))
    dt = 1e-3
    step = expm(a * dt)
    x = vectors[:, k].real
    history = [x]
    for _ in range(3000):
        history.append(step @ history[-1])
    slip, bank = np.array(history)[:, 0], np.array(history)[:, 3]
    # a peak of Re(v exp(i w t)) without the decay, as of two signals with one envelope
    envelope = np.exp(-roots[k].real * dt * np.arange(len(slip)))
    first, second = (
        np.flatnonzero((np.diff(y[:-1]) > 0.0) & (np.diff(y[1:]) <= 0.0)) + 1
        for y in (slip * envelope, bank * envelope)
    )
    nearest = min((b - first[1] for b in second), key=abs) * dt
    assert lateral_proof(GTM, scale).dutch_roll_peaks_s == pytest.approx(nearest, abs=2.0 * dt)


def test_spiral_after_twenty_seconds_by_integration(scale):
    a = lateral_system(GTM, scale).a
    roots, vectors = np.linalg.eig(a)
    k = int(np.argmin(np.abs(roots)))
    start = vectors[:, k].real / vectors[3, k].real * BANK_RAD
    bank = (expm(a * SPIRAL_S) @ start)[3]
    assert lateral_proof(GTM, scale).spiral_bank_rad == pytest.approx(bank, rel=1e-9)
    assert bank / BANK_RAD == pytest.approx(np.exp(-0.0366 * SPIRAL_S), abs=0.003)


def test_steady_sideslip_holds_still(scale):
    """With its sideslip, bank, aileron and rudder nothing changes but the heading."""
    found = lateral_proof(GTM, scale)
    system = lateral_system(GTM, scale)
    x = np.array([found.sideslip_angle_rad, 0.0, 0.0, found.sideslip_bank_rad])
    u = np.array([found.sideslip_control_rad, RUDDER_RAD])
    assert system.a @ x + system.b @ u == pytest.approx(np.zeros(4), abs=1e-12)
    side = scale.force * (GTM[0] * x[0] + GTM[3] * u[0] + GTM[4] * u[1])
    assert side == pytest.approx(-G0 * np.cos(ALPHA) * x[3])


def proof(**changed: float) -> LateralProof:
    first = LateralProof(2.0, 0.1, 3.0, 0.5, 20.0 * DEG, 3.0 * DEG, 4.0 * DEG, 5.0 * DEG)
    return replace(first, **changed)


@pytest.mark.parametrize(
    ("field", "inside", "outside"),
    [
        ("dutch_roll_period_s", 2.49, 2.51),  # .5 s is more than 10 %
        ("dutch_roll_peaks_s", 1.49, 1.51),  # 1 s
        ("spiral_bank_rad", 22.0 * DEG - 1e-9, 22.1 * DEG),  # 2 deg, and 10 %
        ("sideslip_bank_rad", 4.9 * DEG, 5.1 * DEG),
        ("sideslip_angle_rad", 3.01 * DEG, 2.99 * DEG),
        ("sideslip_control_rad", 6.9 * DEG, 7.1 * DEG),
    ],
)
def test_each_tolerance(field, inside, outside):
    assert all(proof(**{field: inside}).within(proof()).values())
    assert not proof(**{field: outside}).within(proof())[field]


def test_a_long_period_by_a_tenth():
    slow = proof(dutch_roll_period_s=8.0)
    assert proof(dutch_roll_period_s=8.79).within(slow)["dutch_roll_period_s"]
    assert not proof(dutch_roll_period_s=8.81).within(slow)["dutch_roll_period_s"]


def test_damping_or_time_to_half():
    far = proof(dutch_roll_damping=0.13, dutch_roll_half_s=3.2)
    assert far.within(proof())["dutch_roll_damping"]
    near = proof(dutch_roll_damping=0.115, dutch_roll_half_s=4.0)
    assert near.within(proof())["dutch_roll_half_s"]
    neither = proof(dutch_roll_damping=0.13, dutch_roll_half_s=4.0)
    assert not neither.within(proof())["dutch_roll_damping"]


def test_a_spiral_of_the_other_trend_is_outside():
    assert not proof(spiral_bank_rad=30.5 * DEG).within(proof(spiral_bank_rad=29.5 * DEG))["spiral_bank_rad"]


def test_no_oscillation_is_no_dutch_roll(scale):
    """A fin that is lost: Cnbeta below zero leaves real roots alone, or another oscillation."""
    lost = GTM.copy()
    lost[10] = -0.6
    found = lateral_proof(lost, scale)
    assert found.spiral_bank_rad > BANK_RAD or np.isnan(found.dutch_roll_period_s)
    assert not found.within(lateral_proof(GTM, scale))["dutch_roll_period_s"]
