"""Derivatives of the lateral-directional innovations along the nominal flight: against central differences of flights."""

from dataclasses import replace

import lateral_records as lr
import numpy as np
import pytest
from test_response_slopes import check

from airtruth.physics.terms import AeroTerm, Change, DeclaredTerm, ReadingTerm, SensorTerm, StateTerm
from airtruth.tracing.model.response import filter_inputs
from airtruth.tracing.model.settings import without
from airtruth.units import DEG

COMMON, OWN = lr.LAYOUT.common, lr.LAYOUT.per_record
EVERY = np.arange(COMMON.size + OWN.size)
SAMPLES = 80
LATE = Change(sensors=(SensorTerm("beta_rad", "delay", 0.03), SensorTerm("ay_m_s2", "lag", 0.05)))
EFFECTS = Change(
    aero=(
        AeroTerm("Cn", "beta", "quadratic", 0.5, 0.01),
        AeroTerm("CY", "beta_dot_hat", "linear", 0.6),
        AeroTerm("Cn", "beta_dot_hat", "linear", -0.4),
        AeroTerm("Cl", "phat", "above", -0.2, -0.01, "beta", 0.001),
        AeroTerm("CY", "slow", "linear", -0.2),
        AeroTerm("Cl", "swings", "quadratic", 0.3),
        AeroTerm("Cn", "rhat", "below", 0.1, 0.001),
    ),
    states=(StateTerm("slow", "lag", "rhat", 0.1), StateTerm("swings", "mode", "beta_dot_hat", 0.05, 0.3)),
    readings=(
        ReadingTerm("beta_rad", "beta", "quadratic", 0.3),
        ReadingTerm("ay_m_s2", "swings", "linear", 2.0),
        ReadingTerm("r_rad_s", "qbar", "linear", 1e-4, 0.0, "slow"),
    ),
    sensors=(
        SensorTerm("beta_rad", "arm", 0.3),
        SensorTerm("ay_m_s2", "arm", 0.2),
        SensorTerm("p_rad_s", "scale", 1.1),
    ),
    declared=(DeclaredTerm("cg", 0.05), DeclaredTerm("cg_y", 0.01), DeclaredTerm("inertia_xz", 0.05)),
)
"""Every kind of term and of state but a play, which has no slope."""
CASES = {
    "plain": (Change(), 0.0, 0),
    "late sensors": (LATE, 0.0, 0),
    "late sensors and correlated noise": (LATE, 0.3, 0),
    "correlated noise": (Change(), 0.4, 0),
    "uncertain surfaces": (Change(), 0.0, 1),
    "effects": (EFFECTS, 0.0, 0),
}
"""Name -> change, share of correlated noise, and whether both surfaces are uncertain in a cell."""


def bent():
    """Tables that bend, over the signals and over the angle of attack."""
    made = lr.plant()
    line = np.linspace(-1.0, 1.0, 51)
    axis = np.linspace(-1.0, 1.0, 3)
    bend = (line + 2.0 * line**3)[:, None] * (1.0 + 0.5 * axis)[:, None, None]
    tables = tuple(replace(t, axes=(axis, line), values=t.values[:1, 1:] * bend) for t in made.tables)
    return replace(made, tables=tables, constant=np.zeros((axis.size, 3)))


def arguments(change, share, uncertain, speed=lr.V):
    """What the derivatives are taken of: a flight in gusts with both surfaces, and parameters near its own."""
    rng = np.random.default_rng(5)
    plane = bent()

    def made(y):
        return lr.record(
            y,
            lambda t: 3.0 * DEG * np.sin(5.0 * t),
            lambda t: 2.0 * DEG * np.sin(4.0 * t + 1.0),
            plane,
            v=speed,
            alpha=lambda t: lr.ALPHA + 0.5 * DEG * np.sin(3.0 * t),
            q=lambda t: 0.05 * np.cos(3.0 * t),
        )

    start = (0.01, 0.1, 0.02, 0.05)
    y = lr.free(made(np.zeros((SAMPLES, 5))), own=lr.per_record(start))
    record = made(y + lr.NOISE * rng.standard_normal(y.shape))
    if uncertain:
        variance = np.zeros((2, SAMPLES))
        variance[0, 20], variance[1, 40] = (0.3 * DEG) ** 2, (0.2 * DEG) ** 2
        record = replace(record, signals=replace(record.signals, corner_rad2=variance))
    common = lr.common(rotary=0.1, rolloff=0.05, mounting=-0.1, inertia=0.02)
    common[COMMON.derivatives] += 0.02 * rng.normal(size=15)
    common[COMMON.log_noise] += 0.02 * rng.normal(size=5)
    common[COMMON.colour_shares] = share
    own = lr.per_record(start, level=0.4) + 0.001 * rng.normal(size=OWN.size)
    return filter_inputs(record, change), lr.SETTINGS, common, own


@pytest.mark.parametrize("name", CASES)
def test_derivatives_are_those_of_flights(name):
    given = arguments(*CASES[name])
    made = check(given, EVERY)
    absent = {*(np.flatnonzero(given[2][COMMON.colour_shares] <= 0.0) + COMMON.colour_shares.start).tolist()}
    absent |= {COMMON.size + OWN.index(name) for name in ("upwash", "tailwind")}  # differences of flights
    assert {*EVERY.tolist()} - {*made.parameters.tolist()} == absent


def test_a_record_without_a_vane():
    given, settings, common, own = arguments(Change(), 0.0, 0)
    check((given, without(settings, 0), common, own), EVERY)


def test_gains_that_follow_the_airspeed():
    given = arguments(Change(), 0.0, 0, speed=lambda t: lr.V * np.linspace(1.0, 0.65, t.size))
    assert len(given[0].along.flow_rad) > 1
    check(given, EVERY)
