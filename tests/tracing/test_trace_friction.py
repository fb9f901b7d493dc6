"""The lag of the vane that a friction imitates."""

import numpy as np
import pytest
import trace_records as tr

from airtruth.tracing.anomalies.omnibus import views
from airtruth.tracing.friction import PLAUSIBLE_RAD, imitated_lag_s
from airtruth.tracing.inference.optimise import fit, initial_parameters
from airtruth.units import DEG


def flown(sigma_w):
    rng = np.random.default_rng(31)
    records = [
        tr.fly(rng, amplitude=a * DEG, name=str(a), samples=300, sigma_w=sigma_w) for a in (2.0, -2.0, 1.0)
    ]
    problem = tr.problem(records)
    return problem, fit(problem, tr.NOTHING, initial_parameters(problem, tr.NOTHING))


def test_in_gusts_it_is_the_lag_nearest_to_the_friction():
    """Least squares of w sgn(alpha') on alpha'; about w sqrt(2/pi) over the standard deviation of a Gaussian rate."""
    problem, null = flown(1.0)
    rate_rad_s = np.concatenate([np.diff(v.flow_rad) / v.dt_s for v in views(null, problem)])
    (nearest,), *_ = np.linalg.lstsq(rate_rad_s[:, None], PLAUSIBLE_RAD * np.sign(rate_rad_s), rcond=None)
    lag_s = imitated_lag_s(problem, null)
    assert lag_s == pytest.approx(nearest, rel=1e-9)
    assert lag_s == pytest.approx(PLAUSIBLE_RAD * np.sqrt(2.0 / np.pi) / rate_rad_s.std(), rel=0.1)


def test_in_calm_air_a_friction_imitates_no_lag():
    assert imitated_lag_s(*flown(0.01)) == 0.0
