"""Diagnostics against statsmodels, against canonical correlations, and by their calibration."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

from airtruth.identification import Options, diagnose, identify_batch, residuals
from airtruth.identification.condition import observe
from airtruth.identification.diagnostics import WEAK, instrument_strength, whiteness
from airtruth.identification.methods import method
from airtruth.identification.regression.rows import Projected, project
from validation.linear_flight import GTM, fly

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    from statsmodels.stats.diagnostic import acorr_ljungbox

BATCH = fly(runs=6, gust=1.0, noise=1.0, seed=41)


def diagnosed(batch, name, options=None):
    estimates = identify_batch(batch, GTM, name, options)
    return diagnose(batch, GTM, estimates, options), estimates


def test_ljung_box_is_that_of_statsmodels():
    e = np.random.default_rng(7).normal(size=(4, 3, 300))
    e[1] += 0.1 * np.roll(e[1], 3, axis=-1)
    e -= e.mean(axis=-1, keepdims=True)
    for r in range(4):
        for i in range(3):
            expected = acorr_ljungbox(e[r, i], lags=[20])["lb_pvalue"].iloc[0]
            assert whiteness(e)[1][r, i] == pytest.approx(expected, rel=1e-9)


def test_equivalent_samples_of_known_noise():
    """White noise counts every sample; an AR(1) with rho = .9 counts (1 - rho^2)/(1 + rho^2) of them."""
    rng = np.random.default_rng(0)
    white = rng.normal(size=(200, 1, 2000))
    coloured = np.zeros_like(white)
    for k in range(1, 2000):
        coloured[..., k] = 0.9 * coloured[..., k - 1] + white[..., k]
    assert whiteness(white)[0].mean() == pytest.approx(2000.0, rel=0.05)
    assert whiteness(coloured)[0].mean() == pytest.approx(2000.0 * 0.19 / 1.81, rel=0.1)


def test_cragg_donald_is_the_smallest_canonical_correlation():
    """lambda = (n - k) rho^2/(1 - rho^2)/K, rho the smallest canonical correlation (Cragg, Donald)."""
    estimates = identify_batch(BATCH, GTM, "iv-lowpass")
    observation = observe(BATCH, GTM, Options())
    rows = method("iv-lowpass").pose(observation, Options()).rows(estimates.theta, np.arange(6))
    p = project(rows, estimates.theta, observation.factors, True)
    got, _ = instrument_strength(p)
    for r in range(6):
        d = p.x[r, 2:].T
        away = np.eye(d.shape[0]) - d @ d.T / (d.T @ d)
        x, z = away @ p.x[r, :2].T, away @ p.z[r, :2].T
        qx, qz = np.linalg.qr(x)[0], np.linalg.qr(z)[0]
        rho = np.linalg.svd(qx.T @ qz, compute_uv=False).min()
        n = x.shape[0]
        assert got[r] == pytest.approx((n - 4) * rho**2 / (1.0 - rho**2) / 2.0, rel=1e-9)


def test_kleibergen_paap_is_cragg_donald_in_white_noise():
    """Regressors = instruments + noise: both agree on average if it is white; in correlated noise not."""
    rng = np.random.default_rng(2)
    n, runs = 250, 300
    calm = fly()
    z = np.stack([calm.channels[k][0] for k in ("alpha_rad", "q_rad_s", "elevator_rad")])
    z = np.tile(z - z.mean(axis=1, keepdims=True), (runs, 1, 1))
    e, trim = np.zeros((runs, 3, n)), np.full((runs, n), 1.0 / np.sqrt(n))
    noise = rng.normal(size=(runs, 3, n))
    slow = np.zeros_like(noise)
    for k in range(1, n):
        slow[..., k] = 0.95 * slow[..., k - 1] + noise[..., k]
    ratio = []
    for kind in (noise, slow):
        kind[:, 2] = 0.0
        kind -= kind.mean(axis=2, keepdims=True)
        weak, robust = instrument_strength(Projected(z=z, x=z + 0.02 * kind, e=e, trim=trim))
        ratio.append(np.median(robust / weak))
    assert ratio[0] == pytest.approx(1.0, abs=0.15)
    assert ratio[1] < 0.3


def test_strength_falls_with_the_gusts_and_warns():
    calm, rough = (fly(runs=20, gust=g, noise=1.0, seed=5) for g in (0.5, 8.0))
    strong, _ = diagnosed(calm, "iv-lowpass")
    weak, _ = diagnosed(rough, "iv-lowpass")
    assert np.nanmin(strong.kleibergen_paap) > WEAK
    assert np.nanmedian(weak.kleibergen_paap) < WEAK
    assert (strong.kleibergen_paap < strong.cragg_donald).all()


def test_three_endogenous_regressors_where_the_elevator_has_an_instrument():
    d, _ = diagnosed(BATCH, "iv-reference")
    own, _ = diagnosed(BATCH, "iv-lowpass")
    assert (d.cragg_donald < own.cragg_donald).all()
    ls, _ = diagnosed(BATCH, "ls")
    assert np.isnan(ls.kleibergen_paap).all()


@pytest.mark.slow
def test_cross_correlation_bands_are_honest():
    """Correct model, 200 runs in gusts: 5 % of the lags outside +-1.96, within 2 to 9 %."""
    batch = fly(runs=200, gust=1.0, noise=1.0, seed=43)
    for name in ("iv-lowpass", "iv-f1"):
        d, _ = diagnosed(batch, name)
        assert d.cross_lag_s[0] == pytest.approx(-1.0)
        share = d.cross_share.mean(axis=0)
        assert (share > 0.02).all()
        assert (share < 0.09).all()


def test_cross_correlation_sees_a_missing_effect():
    """60 ms of undeclared delay between surface and air: the moment residual follows the elevator."""
    right = fly(runs=30, gust=0.3, noise=1.0, seed=44)
    late = {**right.channels, "elevator_rad": np.roll(right.channels["elevator_rad"], -3, axis=1)}
    wrong = replace(right, channels=late)
    seen = diagnosed(wrong, "iv-f1")[0].cross_share[:, 1].mean()
    assert seen > 3.0 * diagnosed(right, "iv-f1")[0].cross_share[:, 1].mean()
    assert seen > 0.3


def test_excitation_and_conditioning():
    d, _ = diagnosed(BATCH, "iv-f1")
    np.testing.assert_allclose(d.elevator_rms_rad, BATCH.channels["elevator_rad"].std(axis=1))
    assert (d.condition > 1.0).all()
    assert (d.condition < 20.0).all()


def test_a_run_without_estimate_has_no_diagnostics():
    options = Options()
    estimates = identify_batch(BATCH, GTM, "iv-f1", options)
    estimates.theta[2] = np.nan
    d = diagnose(BATCH, GTM, estimates, options)
    assert np.isnan(d.condition[2])
    assert np.isnan(d.cross_share[2]).all()
    assert np.isfinite(d.condition[[0, 1, 3]]).all()
    e = residuals(BATCH, GTM, estimates, options)
    assert np.isnan(e[2]).all()
    assert np.isfinite(e[3]).all()
