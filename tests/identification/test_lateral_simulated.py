"""Lateral records beside identified models: against independently integrated flights."""

from dataclasses import replace

import numpy as np
import pytest

from airtruth.identification import identify
from airtruth.identification.lateral.simulated import simulate
from airtruth.identification.record_constants import values_of
from airtruth.physics.motion import LATERAL
from validation.affine_lateral import GTM, NAMES, THETA, fly, log_of, pitching

BATCH = fly(runs=1, noise=0.0, q=pitching)
MEASURED = np.stack([BATCH.channels[c][0] for c in LATERAL.output_channels], axis=1)
CONSTANTS = values_of(GTM, LATERAL)


def test_the_true_derivatives_give_the_flight():
    residual = MEASURED - simulate(THETA, BATCH, CONSTANTS)
    assert (residual.std(axis=0) < 2e-3 * MEASURED.std(axis=0)).all()


def test_initial_state_and_biases_are_fitted():
    moved = {c: x + 0.05 for c, x in BATCH.channels.items() if c in ("beta_rad", "ay_m_s2")}
    biased = replace(BATCH, channels={**BATCH.channels, **moved})
    residual = simulate(THETA, biased, CONSTANTS) - simulate(THETA, BATCH, CONSTANTS)
    np.testing.assert_allclose(residual.mean(axis=0)[[0, 4]], 0.05, atol=1e-3)


def test_a_wrong_derivative_leaves_a_residual():
    wrong = THETA.copy()
    wrong[NAMES.index("Cnbeta")] *= 1.1
    residual = MEASURED - simulate(wrong, BATCH, CONSTANTS)
    assert residual[:, 2].std() > 0.05 * MEASURED[:, 2].std()


def test_a_motion_that_diverges_is_no_number():
    wrong = THETA.copy()
    wrong[NAMES.index("Cnbeta")] *= -1e4
    assert np.isnan(simulate(wrong, BATCH, CONSTANTS)).all()


@pytest.mark.parametrize("lacking", ["beta_rad", "phi_rad"])
def test_an_output_that_a_log_lacks_is_not_shown(lacking):
    log = log_of(fly(runs=2, noise=0.1, seed=4, q=pitching))
    log = replace(log, channels={name: x for name, x in log.channels.items() if name != lacking})
    histories = identify(log, GTM, ["ls"], motion=LATERAL).histories()
    assert set(histories.first.measured) == set(LATERAL.output_channels) - {lacking}
    assert np.isfinite(histories.first.models["ls"]["p_rad_s"]).all()
