"""What must hold whatever the aircraft: signs, scales and order of things."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from airtruth.identification import METHODS, Options, identify_batch
from validation.linear_flight import GTM, THETA, Constants, fly

PLAIN = Options(covariance="none", tolerance=1e-10)
factor = st.floats(0.7, 1.4)


@settings(max_examples=15, deadline=None)
@given(st.lists(factor, min_size=6, max_size=6), st.sampled_from(["iv-f1", "iv-f2"]))
def test_other_aircraft_are_found_as_well(factors, name):
    theta = THETA * np.array(factors)
    got = identify_batch(fly(theta=theta), GTM, name, PLAIN)
    assert got.converged.all()
    np.testing.assert_allclose(got.theta[0], theta, rtol=1e-3)


@pytest.mark.parametrize("name", list(METHODS))
def test_mirrored_motion_gives_the_same_derivatives(name):
    """All deviations of the other sign: the model is odd."""
    batch = fly(runs=2, gust=1.0, noise=1.0, seed=71)
    mirrored = {
        k: -v if k.startswith(("alpha", "q_", "az", "elevator")) else v for k, v in batch.channels.items()
    }
    a = identify_batch(batch, GTM, name, PLAIN).theta
    b = identify_batch(replace(batch, channels=mirrored), GTM, name, PLAIN).theta
    np.testing.assert_allclose(b, a, rtol=1e-9)


@settings(max_examples=20, deadline=None)
@given(st.floats(0.5, 2.0), st.floats(0.5, 2.0))
def test_mass_and_inertia_scale_what_they_must(mass, inertia):
    """Cm scales with Iyy; the mass enters both lift equations alike, so CL scales with it."""
    batch = fly(runs=1, gust=1.0, noise=1.0, seed=72)
    other = Constants(mass_kg=GTM.mass_kg * mass, inertia_yy_kg_m2=GTM.inertia_yy_kg_m2 * inertia)
    a = identify_batch(batch, GTM, "ls", PLAIN).theta[0]
    b = identify_batch(batch, other, "ls", PLAIN).theta[0]
    np.testing.assert_allclose(b[3:], a[3:] * inertia, rtol=1e-9)
    np.testing.assert_allclose(b[:3], a[:3] * mass, rtol=1e-9)


@pytest.mark.parametrize("name", list(METHODS))
def test_a_larger_manoeuvre_of_the_same_shape_changes_nothing_without_noise(name):
    a = identify_batch(fly(amplitude_rad=0.01), GTM, name, PLAIN).theta
    b = identify_batch(fly(amplitude_rad=0.05), GTM, name, PLAIN).theta
    # a likelihood stops within its tolerance, and its prior of the levels has a size
    np.testing.assert_allclose(b, a, rtol=1e-4 if name in ("filter-error", "output-error") else 1e-8)
