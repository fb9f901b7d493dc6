"""The plant behind the study of causes, and the study's own estimators, against independent figures."""

import numpy as np
import pytest

from airtruth.identification import identify_batch
from airtruth.physics.motion import LATERAL
from studies import lateral_causes as study
from studies.lateral_flights import FLOWN, fly
from validation import lateral_flight
from validation.affine_lateral import ALPHA, GTM, SPEED, THETA
from validation.affine_lateral import fly as fly_plant
from validation.lateral_tables import PARTS, coefficients, slopes

DETERMINED = [LATERAL.index(name) for name in ("CYbeta", "Clbeta", "Clp", "Clda", "Cnbeta", "Cndr")]


def about_cg(signals, alpha):
    """CY, Cl, Cn of one state by the plant that integrates single flights."""
    beta, p_hat, r_hat, aileron, rudder = signals
    rates = np.array([p_hat, 0.0, r_hat]) * 2.0 * SPEED / lateral_flight.B
    c = lateral_flight.coefficients(SPEED, alpha, beta, rates, np.array([0.0, aileron, rudder]))
    moment = lateral_flight._moment(lateral_flight.REFERENCE, np.array([0.0, c[1], 0.0]))
    return c[1], c[3] + moment[0] / lateral_flight.B, c[5] + moment[2] / lateral_flight.B


def test_coefficients_of_many_runs_are_those_of_one():
    rng = np.random.default_rng(2)
    signals = rng.uniform(-1.0, 1.0, (5, 30)) * np.array([0.12, 0.03, 0.03, 0.1, 0.1])[:, None]
    alpha = rng.uniform(0.05, 0.15, 30)
    expected = np.stack([about_cg(signals[:, k], alpha[k]) for k in range(30)], axis=1)
    np.testing.assert_allclose(coefficients(np.rad2deg(alpha), signals), expected, atol=1e-14)


def test_slopes_at_the_trim_are_the_declared_derivatives():
    np.testing.assert_allclose(slopes(np.rad2deg(ALPHA)), THETA, atol=2e-4)


def test_a_plant_without_curves_is_the_affine_aircraft():
    signals = np.array([[0.05], [0.01], [-0.02], [0.04], [-0.05]])
    linear = coefficients(np.array([np.rad2deg(ALPHA)]), signals, PARTS)
    np.testing.assert_allclose(linear[:, 0], study.TRUTH.reshape(3, 5) @ signals[:, 0], rtol=1e-12)


def test_own_estimators_of_the_study_agree_with_the_package():
    batch = fly_plant(runs=2, gust=0.5, seed=3)
    own, _ = study.fourth(batch)
    np.testing.assert_allclose(own, identify_batch(batch, GTM, "ls", motion=LATERAL).theta, rtol=1e-9)
    dynamic, _ = study.dynamic(3)(batch)
    package = identify_batch(batch, GTM, "iv-f1", motion=LATERAL).theta
    np.testing.assert_allclose(dynamic[:, DETERMINED], package[:, DETERMINED], rtol=0.02)
    central, _ = study.central(batch)
    assert 0.002 < np.abs(central / own - 1.0)[:, LATERAL.index("Clda")].max() < 0.02


@pytest.mark.slow
def test_campaigns_of_the_study_have_their_amplitudes(tmp_path):
    for name, (deflections, level, _, _) in FLOWN.items():
        fly(name, tmp_path, 1, 1)
        text = (tmp_path / f"{name}.toml").read_text()
        assert f'name = "{name}"' in text
        assert f'level = "{level}"' in text
        if deflections is not None and len(set(deflections)) == 1:
            low, _ = deflections
            assert text.count(f"amplitude_deg = {low}") == 2
            assert text.count(f"amplitude_deg = -{low}") == 2
