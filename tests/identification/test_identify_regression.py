"""The regression itself: against numpy, against linearmodels, joint, in pieces, and where it fails."""

from dataclasses import replace

import numpy as np
import pytest
from linearmodels.iv import IV2SLS

from airtruth.errors import ConfigurationError
from airtruth.identification import METHODS, Options, Status, identify, identify_batch, identify_joint
from airtruth.identification.condition import observe
from airtruth.identification.methods import method
from airtruth.identification.regression import rows as layout
from airtruth.identification.regression import solve as regression_module
from airtruth.units import G0
from validation.linear_flight import DEG, GTM, THETA, as_log, fly, with_channel

NOISY = fly(runs=4, gust=1.0, noise=1.0, seed=21)
PLAIN = Options(covariance="none")


def stacked(rows, factors):
    """Z, X (3 n, 9) and y (3 n,) of one run: six parameters, three intercepts; the paper's stacking."""

    def block(first):
        columns = rows[first : first + 3].T * [1.0, factors[3], 1.0]
        zero = np.zeros_like(columns)
        return np.vstack(
            [
                np.hstack([factors[0] * columns, zero]),
                np.hstack([zero, factors[1] * columns]),
                np.hstack([factors[2] * columns, zero]),
            ]
        )

    n = rows.shape[1]
    intercepts = np.zeros((3 * n, 3))
    for i in range(3):
        intercepts[i * n : (i + 1) * n, i] = rows[layout.TRIM]
    y = rows[layout.Y_LIFT :].ravel()
    return np.hstack([block(0), intercepts]), np.hstack([block(layout.X_ALPHA), intercepts]), y


def rows_of(batch, name, theta, options):
    observation = observe(batch, GTM, options)
    problem = method(name).pose(observation, options)
    return problem.rows(theta, np.arange(len(batch.run_ids))), observation.factors


def test_factors_follow_the_paper():
    """q_bar S/(m V), q_bar S c/Iyy, q_bar S/(m g), c/(2V) by hand, the lift rows with a minus sign."""
    observation = observe(NOISY, GTM, replace(PLAIN, condition="record"))
    v, rho = 42.85, 0.9931
    force = 0.5 * rho * v**2 * 0.54830
    expected = [-force / (26.195 * v), force * 0.27898 / 6.314, -force / (26.195 * G0), 0.27898 / (2 * v)]
    np.testing.assert_allclose(observation.factors, np.tile(expected, (4, 1)), rtol=1e-14)


def test_ls_is_a_stacked_least_squares_solution():
    estimates = identify_batch(NOISY, GTM, "ls", PLAIN)
    rows, factors = rows_of(NOISY, "ls", estimates.theta, PLAIN)
    for r in range(4):
        _, x, y = stacked(rows[r], factors[r])
        np.testing.assert_allclose(estimates.theta[r], np.linalg.lstsq(x, y)[0][:6], rtol=1e-9)


@pytest.mark.parametrize("name", [m for m in METHODS if m != "ls" and METHODS[m].pose])
def test_iv_step_agrees_with_linearmodels(name):
    """At the fixed point, IV2SLS with the same Z, X, y returns the estimate, to 1e-8."""
    options = replace(PLAIN, tolerance=1e-13)
    estimates = identify_batch(NOISY, GTM, name, options)
    rows, factors = rows_of(NOISY, name, estimates.theta, options)
    for r in range(2):
        z, x, y = stacked(rows[r], factors[r])
        # columns of unit length: linearmodels inverts X'X, whose own columns differ by 1e3
        scale = np.linalg.norm(x, axis=0)
        oracle = IV2SLS(y, None, x / scale, z / np.linalg.norm(z, axis=0)).fit().params.to_numpy() / scale
        np.testing.assert_allclose(estimates.theta[r], oracle[:6], rtol=1e-8)


def test_joint_estimate_is_the_stacked_one():
    options = replace(PLAIN, tolerance=1e-13)
    joint = identify_joint([NOISY], GTM, "iv-f1", options)
    assert joint.run_ids == ("joint",)
    rows, factors = rows_of(NOISY, "iv-f1", np.repeat(joint.theta, 4, axis=0), options)
    normal, right = np.zeros((6, 6)), np.zeros(6)
    for r in range(4):
        z, x, y = stacked(rows[r], factors[r])
        own = np.linalg.qr(x[:, 6:])[0]
        z = z[:, :6] - own @ (own.T @ z[:, :6])
        normal += z.T @ x[:, :6]
        right += z.T @ y
    np.testing.assert_allclose(joint.theta[0], np.linalg.solve(normal, right), rtol=1e-8)


def test_joint_of_records_of_different_length_and_rate():
    """Two noise-free records; the joint LS estimate lies where both agree."""
    parts = [fly(rate_hz=100), fly(rate_hz=50, duration_s=6.0)]
    joint = identify_joint(parts, GTM, "iv-f1", replace(PLAIN, tolerance=1e-9))
    np.testing.assert_allclose(joint.theta[0], THETA, rtol=1e-4)


@pytest.mark.parametrize("name", list(METHODS))
def test_a_run_does_not_depend_on_its_chunk(name, monkeypatch):
    batch = fly(runs=7, gust=2.0, noise=1.0, seed=5)
    whole = identify_batch(batch, GTM, name)
    monkeypatch.setattr(regression_module, "CHUNK_SAMPLES", 3 * 250)
    pieces = identify_batch(batch, GTM, name)
    assert (whole.theta == pieces.theta).all()
    assert (whole.iterations == pieces.iterations).all()
    np.testing.assert_allclose(whole.covariance, pieces.covariance, rtol=1e-9, atol=1e-15)


def test_log_of_mixed_lengths_keeps_the_order_of_its_runs():
    log = as_log(fly(runs=2, duration_s=6.0), fly(runs=1, rate_hz=100), fly(runs=1, duration_s=6.0))
    table = identify(log, GTM, ("ls", "iv-f1")).to_frame()
    assert table["run_id"].tolist() == [name for name in log.run_ids for _ in range(2)]
    assert table["method"].tolist() == ["ls", "iv-f1"] * 4
    joint = identify(log, GTM, ("ls", "iv-f1"), joint=True).to_frame()
    assert joint["run_id"].tolist() == ["joint", "joint"]


def test_flight_condition_follows_the_motion():
    """Airspeed 43 while q moves, 40 elsewhere: "motion" takes 43, "record" the mean, "window" 40."""
    batch = fly()
    v = np.where((batch.t_s > 0.98) & (batch.t_s < 4.0), 43.0, 40.0)
    batch = with_channel(batch, "airspeed_m_s", v)
    speed = {
        c: observe(batch, GTM, Options(condition=c)).scale.airspeed_m_s[0]
        for c in ("motion", "record", "window")
    }
    assert speed["motion"] == pytest.approx(43.0, abs=0.01)
    assert speed["record"] == pytest.approx(v.mean())
    assert speed["window"] == pytest.approx(40.0, abs=0.1)
    fixed = observe(batch, GTM, Options(airspeed_m_s=41.0)).scale
    assert fixed.airspeed_m_s[0] == 41.0


def test_density_from_pressure_altitude():
    """7000 ft is 0.9931 kg/m3 in the standard atmosphere (0.81064 of sea level, US 1976)."""
    batch = fly()
    channels = {k: v for k, v in batch.channels.items() if k != "density_kg_m3"}
    channels["altitude_m"] = np.full_like(channels["alpha_rad"], 7000 * 0.3048)
    got = observe(replace(batch, channels=channels), GTM, Options()).scale
    assert got.lift[0] == pytest.approx(observe(batch, GTM, Options()).scale.lift[0], rel=2e-4)


def test_divergence_and_other_ends_are_reported_run_by_run():
    """A good run among bad ones: a huge gust, an instrument without information, too few iterations."""
    good = fly(runs=3, seed=1, noise=1.0)
    short = identify_batch(good, GTM, "iv-f1", Options(tolerance=1e-13, maximum_iterations=1))
    assert (short.status == Status.MAXIMUM_ITERATIONS).all()
    assert not short.converged.any()
    assert np.isfinite(short.theta).all()

    flat = good.channels["elevator_command_rad"].copy()
    flat[1] = 0.3
    batch = with_channel(good, "elevator_command_rad", flat)
    by_reference = identify_batch(batch, GTM, "iv-reference")
    assert by_reference.status.tolist() == [Status.CONVERGED, Status.SINGULAR, Status.CONVERGED]
    assert np.isnan(by_reference.theta[1]).all()
    assert np.isnan(by_reference.covariance[1]).all()
    by_actuator = identify_batch(batch, GTM, "iv-actuator")
    assert by_actuator.status.tolist() == [Status.CONVERGED, Status.ACTUATOR, Status.CONVERGED]


def test_an_unstable_auxiliary_model_is_named():
    """Cmalpha of the wrong sign in 20 s of record: e^(20 s times 3/s) is no simulation."""
    good = fly(runs=2, duration_s=20.0, noise=0.2)
    alpha = good.channels["alpha_rad"].copy()
    alpha[0] *= -1.0
    alpha[0] -= 2.0 * alpha[0, 0]
    estimates = identify_batch(with_channel(good, "alpha_rad", alpha), GTM, "iv-f1")
    assert estimates.status.tolist() == [Status.UNSTABLE, Status.CONVERGED]
    assert np.isnan(estimates.theta[0]).all()
    assert np.isfinite(estimates.theta[1]).all()


def test_joint_estimate_fails_as_a_whole():
    batch = with_channel(NOISY, "elevator_command_rad", np.zeros((4, 250)))
    assert identify_joint([batch], GTM, "iv-actuator").status[0] == Status.ACTUATOR
    assert np.isnan(identify_joint([batch], GTM, "iv-actuator").theta).all()


def test_an_unknown_method_lists_those_that_exist():
    with pytest.raises(ConfigurationError, match=r"'iv-f3' does not exist.*did you mean.*iv-f1"):
        identify_batch(NOISY, GTM, "iv-f3")


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("trim", "median", "allowed: intercept, mean"),
        ("covariance", "colored", "did you mean 'coloured'"),
        ("condition", "trim", "allowed: motion, record, window"),
        ("cutoff_hz", -1.0, "between 0 and inf"),
        ("tolerance", 2.0, "between 0 and 1"),
        ("airspeed_m_s", 0.0, "between 0 and inf"),
        ("order", 0, "1 or more"),
    ],
)
def test_options_refuse_what_means_nothing(field, value, message):
    with pytest.raises(ConfigurationError, match=f"option {field} = .*{message}"):
        Options(**{field: value})


def test_a_small_doublet_needs_no_trim_knowledge():
    """Constant errors of every sensor move no estimate: intercepts and first samples take them."""
    clean = fly(amplitude_rad=0.5 * DEG)
    shifted = clean
    for name, bias in (("alpha_rad", 0.02), ("q_rad_s", 0.01), ("az_m_s2", 0.3), ("elevator_rad", -0.03)):
        shifted = with_channel(shifted, name, shifted.channels[name] + bias)
    for name in METHODS:
        a = identify_batch(clean, GTM, name, PLAIN).theta
        np.testing.assert_allclose(identify_batch(shifted, GTM, name, PLAIN).theta, a, rtol=1e-7)
