"""Modal parameters: the delta method against differences and against sampling."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from airtruth.identification.estimates import modal_jacobian, modal_with_covariance
from airtruth.physics.short_period import modal
from validation.linear_flight import THETA, gtm_scale


@settings(max_examples=50, deadline=None)
@given(st.lists(st.floats(0.6, 1.4), min_size=6, max_size=6))
def test_jacobian_is_the_derivative(factors):
    theta = THETA * np.array(factors)
    s = gtm_scale()
    jacobian = modal_jacobian(theta, s)
    for i in range(6):
        step = 1e-5 * abs(THETA[i])
        up, down = theta.copy(), theta.copy()
        up[i] += step
        down[i] -= step
        difference = (np.array(modal(up, s)) - np.array(modal(down, s))) / (2.0 * step)
        assert jacobian[:, i] == pytest.approx(difference, rel=1e-6, abs=1e-9)


def test_covariance_is_that_of_a_sample():
    """200,000 normal draws of theta at 1 %: standard deviations within 1 %."""
    s = gtm_scale()
    covariance = np.diag((0.01 * THETA) ** 2)
    value, spread = modal_with_covariance(THETA, covariance, s)
    draws = THETA * (1.0 + 0.01 * np.random.default_rng(0).normal(size=(200_000, 6)))
    sample = np.stack(modal(draws, gtm_scale((200_000,))), axis=-1)
    np.testing.assert_allclose(np.sqrt(np.diag(spread)), sample.std(axis=0), rtol=0.01)
    np.testing.assert_allclose(
        np.corrcoef(sample.T)[0, 1], spread[0, 1] / np.sqrt(np.prod(np.diag(spread))), atol=0.01
    )
    assert value == pytest.approx(np.array(modal(THETA, s)))


def test_no_oscillation_has_no_modal_parameters():
    theta = THETA.copy()
    theta[3] = 1.0
    value, spread = modal_with_covariance(theta, np.eye(6), gtm_scale())
    assert np.isnan(value).all()
    assert np.isnan(spread).all()
