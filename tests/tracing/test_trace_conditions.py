"""Records of two flight conditions: each has its own declared derivatives, prior and scale."""

from dataclasses import replace

import numpy as np
import pytest
import trace_records as tr

from airtruth.effects.registry import EFFECTS
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.terms import Change, DeclaredTerm
from airtruth.tracing.conditions import with_mean_derivatives
from airtruth.tracing.inference.hypothesis import Hypothesis
from airtruth.tracing.inference.optimise import fit, initial_parameters
from airtruth.tracing.model.compile import compile_change
from airtruth.tracing.model.longitudinal.packing import pack_aircraft
from airtruth.tracing.model.parameters import SHORT_PERIOD
from airtruth.tracing.model.settings import common_prior
from airtruth.units import DEG

pytestmark = pytest.mark.slow

FAST = 1.3 * tr.V
DECLARED_FAST = tr.TRUTH * [1.15, 0.9, 1.1, 0.8, 1.2, 0.9]
MORE = np.array([0.15, -4.0, 0.03, -0.06, 3.0, 0.07])
"""Increments of the derivatives that both conditions have in common, about one declared standard deviation each."""
ARM_M = 0.3
HYPOTHESIS = Hypothesis(Change(), (EFFECTS["vane_arm"],))


@pytest.fixture(scope="module")
def records():
    """Two records at each of two airspeeds, with a vane arm."""
    rng = np.random.default_rng(90)
    made = []
    for v, declared in ((tr.V, tr.TRUTH), (FAST, DECLARED_FAST)):
        for amplitude in (2.0, -2.0):
            plant = tr.plant(declared, v=v)
            name = f"{v:.0f} {amplitude}"
            one = tr.fly(rng, declared + MORE, 0.2, amplitude=amplitude * DEG, name=name, v=v, plant_=plant)
            y = one.signals.y.copy()
            y[:, 0] -= ARM_M / v * y[:, 1]
            made.append(replace(one, signals=replace(one.signals, y=y)))
    return made


def fitted(records):
    problem = tr.problem(records)
    start = initial_parameters(problem, HYPOTHESIS)
    found = fit(problem, HYPOTHESIS, replace(start, sizes=np.array([0.1])))
    assert found is not None
    assert found.converged
    return found


@pytest.fixture(scope="module")
def forward(records):
    return fitted(records)


def test_the_increments_are_common_to_both_conditions(forward):
    """Simulated with the declared derivatives of each condition and the same increments: three standard errors."""
    off = forward.point.common[SHORT_PERIOD.common.derivatives] - MORE
    assert (np.abs(off) < 3.0 * forward.common_std[SHORT_PERIOD.common.derivatives]).all()
    assert abs(forward.point.sizes[0] - ARM_M) < 3.0 * forward.size_std(0)
    assert forward.size_std(0) < 0.1


def test_the_order_of_the_conditions_does_not_matter(records, forward):
    order = [3, 1, 0, 2]
    turned = fitted([records[i] for i in order])
    assert turned.cost == pytest.approx(forward.cost, rel=1e-8)
    std = np.sqrt(np.diag(forward.covariance))
    shift = np.append(turned.point.common - forward.point.common, turned.point.sizes - forward.point.sizes)
    np.testing.assert_allclose(shift / std, 0.0, atol=1e-5)
    np.testing.assert_allclose(turned.point.per_record, forward.point.per_record[order], atol=1e-6)
    np.testing.assert_allclose(turned.covariance, forward.covariance, rtol=1e-4, atol=1e-12)


@pytest.mark.parametrize("declared", [tr.TRUTH, DECLARED_FAST], ids=["slow", "fast"])
def test_an_inertia_divides_the_derivatives_of_each_condition(declared):
    """By definition: the increments -i d/(1 + i) of the mean d leave the moment that the declared factor 1 + i leaves."""
    mean = 0.5 * (tr.TRUTH + DECLARED_FAST)
    plant = replace(tr.plant(declared), mean_derivatives=mean)
    common = np.zeros(SHORT_PERIOD.common.size)
    common[SHORT_PERIOD.common.inertia] = 0.05
    row = LONGITUDINAL.row("Cm")
    common[row] = -0.05 / 1.05 * mean[row]
    packed = pack_aircraft(plant, compile_change(Change()), common)
    change = Change(declared=(DeclaredTerm("inertia", 1.05),))
    expected = pack_aircraft(plant, compile_change(change), np.zeros_like(common))
    np.testing.assert_allclose(packed.increments[row], 0.0, atol=1e-15)
    assert packed.inertia_kg_m2 == pytest.approx(expected.inertia_kg_m2, rel=1e-15)


def test_records_of_several_conditions_share_the_mean_of_the_fitted(records):
    names = [f"{i}" for i in range(len(records))]
    own = [replace(r, signals=replace(r.signals, run_id=n)) for r, n in zip(records, names, strict=True)]
    shared = with_mean_derivatives(own, names[-1:])
    mean = np.mean([r.plant.derivatives for r in records[:-1]], axis=0)
    for r in shared:
        np.testing.assert_allclose(r.plant.turned, mean, rtol=1e-15)
    assert len({id(r.plant) for r in shared}) == len({id(r.plant) for r in records})
    (alone,) = with_mean_derivatives(own[:1], ())
    assert alone is own[0]


def test_the_prior_of_two_conditions_is_their_mean_covariance(records):
    """Covariances of the derivatives and of the inertia are averaged; precisions are not added."""
    joint = [np.linalg.inv(common_prior([r], tr.SETTINGS)) for r in records]
    both = np.linalg.inv(common_prior(records, tr.SETTINGS))
    np.testing.assert_allclose(both, np.mean(joint, axis=0), rtol=1e-7, atol=1e-12)
