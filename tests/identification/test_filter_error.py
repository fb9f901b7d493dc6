"""Filter error on records of the linear short period."""

from dataclasses import replace

import numpy as np
import pytest

from airtruth.errors import ConfigurationError
from airtruth.identification import Options, identify_batch, quantities
from airtruth.identification.estimates import Status
from airtruth.identification.likelihood.cramer_rao import experiment_bound
from airtruth.identification.likelihood.fit import FilterOptions, fit, fit_joint, records
from airtruth.identification.likelihood.linearise import matrices
from airtruth.logs.flight_log import Batch
from validation.linear_flight import AIRSPEED_M_S, GTM, LIGHT, NOISE, THETA, fly, with_channel

AWAY = np.array([4.0, 20.0, 0.3, -1.5, -35.0, -1.5])


def declared(gust=2.0, noise=1.0, **more):
    """The truth of `fly`."""
    sensors = [noise * n for n in NOISE[:3]]
    return FilterOptions(*sensors, LIGHT[0] * gust, LIGHT[1] * gust, LIGHT[2], LIGHT[3], **more)


def some(batch, keep):
    channels = {name: values[keep] for name, values in batch.channels.items()}
    return Batch(batch.run_ids[keep], batch.dt_s, batch.t_s[keep], channels)


def started(batch):
    """iv-f1, and least squares where it failed."""
    estimates = [identify_batch(batch, GTM, n, Options(covariance="none")) for n in ("iv-f1", "ls")]
    return np.where(estimates[0].converged[:, None], estimates[0].theta, estimates[1].theta)


@pytest.mark.slow
@pytest.mark.parametrize(("delay_s", "tolerance"), [(0.0, 1e-4), (0.005, 1e-3), (0.01, 1e-3)])
def test_noise_free_record_gives_the_truth_by_output_error(delay_s, tolerance):
    """The elevator's motion between samples is rebuilt; of edges inside a cell its area, not its shape."""
    options = declared(gust=0.0, level_prior=None, tolerance=1e-6)
    estimates = fit(fly(delay_s=delay_s), GTM, AWAY[None], options)
    assert estimates.method == "output-error"
    assert estimates.status[0] == Status.CONVERGED
    np.testing.assert_allclose(estimates.theta[0], THETA, rtol=tolerance)


def test_noise_free_record_gives_the_truth_by_filter_error():
    """Levels a thousandth of the GTM's: log|S| pulls by their square only, and no noise excites it."""
    options = declared(gust=2e-3, noise=1e-3, level_prior=None, tolerance=1e-4)
    estimates = fit(fly(), GTM, AWAY[None], options)
    assert estimates.method == "filter-error"
    np.testing.assert_allclose(estimates.theta[0], THETA, rtol=1e-3)


def test_estimates_are_unbiased_efficient_and_their_intervals_cover():
    """Against the exact bound; 200 runs know a spread to 5 % and a coverage of 95 % to 1.5 points."""
    batch = fly(runs=200, gust=2.0, noise=1.0, seed=21)
    options = declared()
    estimates = fit(batch, GTM, started(batch), options)
    assert estimates.converged.all()
    error = estimates.theta - THETA
    spread = error.std(axis=0)
    assert (np.abs(error.mean(axis=0)) < 4.0 * spread / np.sqrt(200)).all()
    least = np.sqrt(np.diag(experiment_bound(fly(), GTM, THETA, options)[0]))
    assert (spread < 1.2 * least).all(), spread / least
    assert (spread > 0.85 * least).all(), spread / least
    q = quantities(estimates)
    cover = ((q.lower[:, :6] < THETA) & (q.upper[:, :6] > THETA)).mean(axis=0)
    assert (cover > 0.885).all(), cover


def test_levels_that_are_declared_wrongly_are_found():
    """Declared a third too low, prior 20 %: intervals from the estimated levels still cover."""
    batch = fly(runs=60, gust=2.0, noise=1.0, seed=22)
    low = declared(gust=1.5, noise=0.75)
    start = started(batch)
    right, found = (fit(batch, GTM, start, o) for o in (declared(level_prior=None), low))
    known = fit(batch, GTM, start, replace(low, level_prior=None))
    ratio, without = (
        np.sqrt(np.diagonal(e.covariance, axis1=1, axis2=2) / np.diagonal(right.covariance, axis1=1, axis2=2))
        for e in (found, known)
    )
    assert (np.abs(ratio.mean(axis=0) - 1.0) < 0.1).all()
    assert (without.mean(axis=0) < 0.8).all()


def test_heavy_gusts_do_not_break_it():
    batch = fly(runs=100, gust=4.3, noise=1.0, seed=23)
    estimates = fit(batch, GTM, started(batch), declared(gust=4.3))
    assert estimates.converged.all()
    assert (np.abs(estimates.theta[:, 3] / THETA[3] - 1.0) < 0.5).all()


def test_airspeed_as_an_output_sharpens_lift():
    """Records drawn from the predictor itself, airspeed included; unbiased and within the smaller bound."""
    options = declared(airspeed_std_m_s=0.0309, airspeed_m_s=AIRSPEED_M_S)
    runs, still = 100, fly(runs=1)
    data = records(still, GTM, options)
    z = np.concatenate([THETA, np.log(options.levels)])
    u, bend = data.signals.u[0], data.signals.bend[0]
    v = matrices(data.layout, np.array([0]), z[None], data.dt_s)
    rng = np.random.default_rng(24)
    root = np.linalg.cholesky(v.noise[0] + 1e-18 * np.eye(5))
    x, y = np.zeros((runs, 5)), []
    for k in range(len(u)):
        y.append(x @ v.c[0].T + v.d[0] @ u[k])
        if k + 1 < len(u):
            both = (u[k] + bend[k + 1], u[k + 1] + bend[k + 1])
            x = (
                x @ v.phi[0].T
                + v.early[0] @ both[0]
                + v.late[0] @ both[1]
                + rng.normal(size=x.shape) @ root.T
            )
    y = np.stack(y, axis=1)
    y += rng.normal(size=y.shape) * options.levels[2:]
    batch = fly(runs=runs)
    for i, name in enumerate(("alpha_rad", "q_rad_s", "az_m_s2", "airspeed_m_s")):
        batch = with_channel(batch, name, y[:, :, i] + still.channels[name].mean())
    estimates = fit(batch, GTM, started(batch), options)
    error = estimates.theta - THETA
    spread = error.std(axis=0)
    assert estimates.converged.all()
    assert (np.abs(error.mean(axis=0)) < 4.0 * spread / np.sqrt(runs)).all()
    least = np.sqrt(np.diag(experiment_bound(still, GTM, THETA, options)[0]))
    without = np.sqrt(np.diag(experiment_bound(still, GTM, THETA, declared())[0]))
    assert (spread < 1.3 * least).all(), spread / least
    assert (least[:3] < 0.5 * without[:3]).all()


def test_joint_of_one_record_is_that_record():
    batch = fly(runs=1, gust=2.0, noise=1.0, seed=25)
    single, joint = fit(batch, GTM, AWAY[None], declared()), fit_joint([batch], GTM, AWAY, declared())
    assert joint.run_ids == ("joint",)
    np.testing.assert_array_equal(joint.theta, single.theta)
    np.testing.assert_array_equal(joint.covariance, single.covariance)


def test_joint_of_many_records_is_sharper():
    """Two lengths and two rates; the information adds up."""
    parts = [
        fly(runs=4, gust=2.0, noise=1.0, seed=26),
        fly(runs=5, gust=2.0, noise=1.0, seed=27, duration_s=4.0, rate_hz=100),
    ]
    options = declared(level_prior=None)
    joint = fit_joint(parts, GTM, AWAY, options)
    assert joint.status[0] == Status.CONVERGED
    each = np.concatenate(
        [np.linalg.inv(fit(p, GTM, np.tile(THETA, (len(p.run_ids), 1)), options).covariance) for p in parts]
    )
    together = np.linalg.inv(each.sum(axis=0))
    np.testing.assert_allclose(np.diag(joint.covariance[0]), np.diag(together), rtol=0.2)
    assert (np.abs(joint.theta[0] - THETA) < 4.0 * np.sqrt(np.diag(joint.covariance[0]))).all()


def test_result_does_not_depend_on_the_other_runs():
    batch = fly(runs=7, gust=2.0, noise=1.0, seed=28)
    start = np.tile(AWAY, (7, 1))
    whole = fit(batch, GTM, start, declared())
    part = fit(some(batch, slice(3, 5)), GTM, start[3:5], declared())
    np.testing.assert_array_equal(part.theta, whole.theta[3:5])
    np.testing.assert_array_equal(part.covariance, whole.covariance[3:5])


def test_biases_do_not_move_an_estimate():
    batch = fly(runs=2, gust=2.0, noise=1.0, seed=29)
    moved = batch
    for name, bias in (("alpha_rad", 0.1), ("q_rad_s", -0.03), ("az_m_s2", 0.4), ("elevator_rad", 0.02)):
        moved = with_channel(moved, name, batch.channels[name] + bias)
    options = declared(tolerance=1e-6)
    start = np.tile(THETA, (2, 1))
    np.testing.assert_allclose(
        fit(moved, GTM, start, options).theta, fit(batch, GTM, start, options).theta, rtol=1e-6
    )


def test_a_start_that_is_no_number_has_no_estimate_and_does_not_touch_the_others():
    batch = fly(runs=2, gust=2.0, noise=1.0, seed=30)
    estimates = fit(batch, GTM, np.array([np.full(6, np.nan), THETA]), declared())
    assert list(estimates.status) == [Status.DIVERGED, Status.CONVERGED]
    assert np.isnan(estimates.theta[0]).all()
    assert np.isfinite(estimates.theta[1]).all()


@pytest.mark.parametrize(
    "wrong",
    [
        {"level_prior": 0.0},
        {"tolerance": -1.0},
        {"airspeed_std_m_s": np.inf},
        {"maximum_iterations": 0},
        {"condition": "mean"},
    ],
)
def test_options_that_mean_nothing_are_refused(wrong):
    with pytest.raises(ConfigurationError, match=next(iter(wrong))):
        declared(**wrong)


def test_start_of_the_gusts_must_be_known():
    with pytest.raises(ConfigurationError, match="allowed: rest, stationary"):
        experiment_bound(fly(), GTM, THETA, declared(), "resting")
