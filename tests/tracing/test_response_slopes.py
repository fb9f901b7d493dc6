"""Derivatives of the innovations along the nominal flight: against central differences of flights."""

from dataclasses import replace

import numpy as np
import pytest
import trace_records as tr
from hypothesis import given as each
from hypothesis import settings as run
from hypothesis import strategies as st
from test_tangent import CASES, flown

from airtruth.physics.terms import AeroTerm, Change, DeclaredTerm, ReadingTerm, SensorTerm, StateTerm
from airtruth.tracing.inference.hypothesis import Hypothesis
from airtruth.tracing.inference.posterior import sensitivities_of
from airtruth.tracing.model.parameters import SHORT_PERIOD
from airtruth.tracing.model.response import filter_inputs, respond_to
from airtruth.tracing.model.response_slopes import respond_with_slopes
from airtruth.tracing.model.settings import without

COMMON, OWN = SHORT_PERIOD.common, SHORT_PERIOD.per_record
EVERY = np.arange(COMMON.size + OWN.size)
EFFECTS = Change(
    aero=(
        AeroTerm("Cm", "alpha", "quadratic", 2.0, 0.01),
        AeroTerm("CL", "alpha_dot_hat", "linear", 3.0),
        AeroTerm("Cm", "alpha_dot_hat", "linear", -9.0),
        AeroTerm("CL", "alpha", "above", 1.0, -1.0, "qhat", 0.001),
        AeroTerm("Cm", "slow", "linear", -0.2),
        AeroTerm("CL", "swings", "quadratic", 0.3),
    ),
    states=(StateTerm("slow", "lag", "alpha", 0.1), StateTerm("swings", "mode", "alpha_dot_hat", 0.05, 0.3)),
    readings=(
        ReadingTerm("alpha_rad", "alpha", "quadratic", 0.3),
        ReadingTerm("az_m_s2", "swings", "linear", 2.0),
        ReadingTerm("q_rad_s", "qbar", "linear", 1e-4, 0.0, "slow"),
    ),
    sensors=(SensorTerm("alpha_rad", "arm", 0.3), SensorTerm("az_m_s2", "arm", 0.2)),
    declared=(DeclaredTerm("cg", 0.05), DeclaredTerm("thrust_arm", 0.1)),
)
"""Every kind of term and of state but a play, which has no slope."""
LATE_AZ = Change(sensors=(SensorTerm("alpha_rad", "delay", 0.03), SensorTerm("az_m_s2", "lag", 0.05)))
RECORDS = {**CASES, "late az and noise": (LATE_AZ, 2, 0.2, {}), "effects": (EFFECTS, 2, 0.0, {})}


def central(arguments, index, h):
    """Central differences of the innovations, their covariance over their deviations, and log|S| beyond."""
    given, settings, common, own = arguments
    ends, common_size = [], common.size
    for sign in (1.0, -1.0):
        moved = np.append(common, own)
        moved[index] += sign * h
        ends.append(respond_to(given, settings, moved[:common_size], moved[common_size:]))
    return [
        (getattr(ends[0], a) - getattr(ends[1], a)) / (2.0 * h) for a in ("e", "covariance", "more_logdet")
    ]


def check(arguments, indices=EVERY, tolerance=1e-3):
    """Derivatives against differences.

    1e-3 of the largest: the gains' own step of a hundredth, and rounding of a Riccati equation that is slow to settle, are 2e-4.
    A parameter that moves no innovation by a hundredth of its deviation per unit counts as if it did.
    """
    layout = arguments[1].layout
    step = np.append(layout.common.step, layout.per_record.step)
    names = layout.common.names + layout.per_record.names
    base, made = respond_with_slopes(*arguments, np.asarray(indices))
    nominal = respond_to(*arguments)
    np.testing.assert_allclose(base.e, nominal.e, rtol=0.0, atol=1e-9)
    assert base.logdet == pytest.approx(nominal.logdet, abs=1e-9)
    std = np.sqrt(np.diag(nominal.covariance))
    for row, index in enumerate(made.parameters):
        e, covariance, more = central(arguments, index, 0.1 * step[index])
        scale = max(np.abs(e / std).max(), 0.01)
        assert np.abs((made.e[row] - e) / std).max() < tolerance * scale, names[index]
        by_std = np.outer(std, std)
        largest = max(np.abs(covariance / by_std).max(), 1e-3)
        assert np.abs((made.covariance[row] - covariance) / by_std).max() < tolerance * largest, names[index]
        assert made.more_logdet[row] == pytest.approx(more, rel=3e-3, abs=1e-3), names[index]
    return made


@pytest.mark.parametrize("name", RECORDS)
def test_derivatives_are_those_of_flights(name):
    given, settings, common, own = flown(*RECORDS[name])[0]
    rng = np.random.default_rng(3)
    common = (
        common + np.where(COMMON.colour.start > EVERY, 0.02 * rng.normal(size=EVERY.size), 0.0)[: common.size]
    )
    own = own + 0.001 * rng.normal(size=own.size)
    made = check((given, settings, common, own))
    shares = np.flatnonzero(common[COMMON.colour_shares] <= 0.0) + COMMON.colour_shares.start
    assert {*EVERY.tolist()} - {*made.parameters.tolist()} == {*shares.tolist()}


def test_a_record_without_a_vane():
    given, settings, common, own = flown(*CASES["plain"])[0]
    check((given, without(settings, 0), common, own))


def test_gains_that_follow_the_airspeed():
    """A record that slows down to two thirds has gains at several airspeeds."""
    record = tr.fly(np.random.default_rng(5), samples=120)
    signals = record.signals
    v = np.linspace(1.0, 0.65, signals.airspeed_m_s.size) * signals.airspeed_m_s
    slower = replace(record, signals=replace(signals, airspeed_m_s=v, ground_m_s=v))
    given = filter_inputs(slower, Change())
    assert len(given.along.flow_rad) > 1
    point = tr.point([slower])
    check((given, tr.SETTINGS, point.common, point.per_record[0]))


@run(max_examples=8, deadline=None, derandomize=True)
@each(
    seed=st.integers(0, 10**6),
    vane=st.sampled_from([None, "lag", "delay"]),
    share=st.sampled_from([0.0, 0.3]),
    slope=st.floats(-1.0, 1.0),
    lag_s=st.floats(0.02, 0.3),
)
def test_any_record_and_change(seed, vane, share, slope, lag_s):
    rng = np.random.default_rng(seed)
    change = Change(
        aero=(AeroTerm("Cm", "slow", "linear", slope), AeroTerm("CL", "alpha", "above", slope, 0.02)),
        states=(StateTerm("slow", "lag", "alpha", lag_s),),
        sensors=() if vane is None else (SensorTerm("alpha_rad", vane, 0.5 * lag_s),),
    )
    record = tr.fly(rng, samples=60)
    point = tr.point([record])
    common = point.common + 0.02 * rng.normal(size=COMMON.size) * (
        np.arange(COMMON.size) < COMMON.colour.start
    )
    common[COMMON.colour_shares] = share
    check((filter_inputs(record, change), tr.SETTINGS, common, point.per_record[0]))


def test_a_play_is_differenced():
    """It has no slope where it reverses: its flights are moved one parameter at a time."""
    change = Change(
        aero=(AeroTerm("Cm", "held", "linear", -0.2),),
        states=(StateTerm("held", "play", "alpha", half_width=0.01),),
    )
    record = tr.fly(np.random.default_rng(5), samples=60)
    problem, point = tr.problem([record]), tr.point([record])
    given = filter_inputs(record, change)
    _, made = respond_with_slopes(given, tr.SETTINGS, point.common, point.per_record[0], EVERY)
    assert made.parameters.size == 0
    found = sensitivities_of(problem, 0, Hypothesis(change), point)
    base = respond_to(given, tr.SETTINGS, point.common, point.per_record[0])
    moved = point.common.copy()
    moved[3] += COMMON.step[3]
    after = respond_to(given, tr.SETTINGS, moved, point.per_record[0])
    np.testing.assert_allclose(found.t[3], (after.e - base.e) @ base.white.T / COMMON.step[3], atol=1e-9)
