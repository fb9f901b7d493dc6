"""Lateral least squares and instrumental variables against truth, and against an independent least squares."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from airtruth.identification import LATERAL_METHODS, identify_batch
from airtruth.identification.doubts import curvature
from airtruth.identification.estimates import Status, quantities
from airtruth.identification.lateral.curvature import SIGNIFICANT, p_values
from airtruth.identification.lateral.kernels import grow_less, orthonormal, products, swept
from airtruth.identification.lateral.methods import LINEAR
from airtruth.identification.lateral.observation import observe
from airtruth.identification.lateral.problems import ls_problem, rate_of, smoothed
from airtruth.identification.lateral.solve import POSES, regress_batch, regress_joint
from airtruth.identification.options import TERMS, Options
from airtruth.numerics.prefilter import butterworth, edge_samples
from airtruth.physics.motion import LATERAL
from validation.affine_lateral import ALPHA, DENSITY, GTM, NAMES, SPEED, THETA, fly

CALM = fly(runs=2, noise=0.0)
NOISY = fly(runs=3, gust=0.75, seed=3)
DETERMINED = ["CYbeta", "Clbeta", "Clp", "Clda", "Cnbeta", "Cndr"]


def index(names):
    return [NAMES.index(name) for name in names]


@pytest.mark.parametrize("pressure", ["measured", "constant"])
@pytest.mark.parametrize("method", POSES)
def test_noise_free_records_give_the_truth(method, pressure):
    made = regress_batch(CALM, GTM, method, POSES[method], Options(pressure=pressure, tolerance=1e-6))
    assert made.converged.all()
    chosen = index(DETERMINED)
    # what remains is the interpolation of the surfaces between samples
    np.testing.assert_allclose(made.theta[:, chosen], np.tile(THETA[chosen], (2, 1)), rtol=1e-3)
    np.testing.assert_allclose(made.theta, np.tile(THETA, (2, 1)), atol=0.006)
    modes = quantities(made).value[:, 15:]
    np.testing.assert_allclose(modes[:, :3], np.tile([5.985, 0.120, -5.435], (2, 1)), rtol=2e-3)


def independent(batch, run):
    """Regressors (samples, 6) and left sides (samples, 3) of a record at measured pressure, by scipy and plain formulae."""
    c = {name: values[run] for name, values in batch.channels.items()}
    order = butter(4, 5.0, fs=1.0 / batch.dt_s, output="sos")
    pad = edge_samples(butterworth(5.0, 4, batch.dt_s))

    def low(x):
        return sosfiltfilt(order, x, padtype="odd", padlen=pad)

    speed = low(c["airspeed_m_s"])
    force = 0.5 * c["density_kg_m3"] * speed**2 * GTM.wing_area_m2
    p, q, r = c["p_rad_s"], c["q_rad_s"], c["r_rad_s"]
    ixx, iyy, izz, ixz = (getattr(GTM, f"inertia_{n}_kg_m2") for n in ("xx", "yy", "zz", "xz"))
    scale = 1.0 / (force * GTM.span_m)
    slope = np.gradient(scale, batch.dt_s)
    roll, yaw = ixx * p - ixz * r, izz * r - ixz * p

    def rate(x):
        return (-x[4:] + 8 * x[3:-1] - 8 * x[1:-3] + x[:-4]) / (12 * batch.dt_s)

    left = [
        low(GTM.mass_kg * c["ay_m_s2"] / force)[2:-2],
        rate(low(roll * scale)) + low(scale * (-ixz * p * q + (izz - iyy) * q * r) - slope * roll)[2:-2],
        rate(low(yaw * scale)) + low(scale * (ixz * q * r + (iyy - ixx) * p * q) - slope * yaw)[2:-2],
    ]
    half = GTM.span_m / (2 * speed)
    columns = [c["beta_rad"], p * half, r * half, c["aileron_rad"], c["rudder_rad"]]
    regressors = [low(x)[2:-2] for x in columns]
    return np.stack([*regressors, np.ones_like(left[0])], axis=1), np.stack(left, axis=1)


def without_corners(batch):
    """Surfaces of the sensor's noise alone show no servo, so that both least squares read the same surfaces."""
    rng = np.random.default_rng(9)
    rough = {
        name: batch.channels[name] + 2e-3 * rng.standard_normal(batch.t_s.shape)
        for name in ("aileron_rad", "rudder_rad")
    }
    return replace(batch, channels={**batch.channels, **rough})


def test_least_squares_agrees_with_an_independent_one():
    batch = without_corners(NOISY)
    made = regress_batch(batch, GTM, "ls", None, Options())
    assert not observe(batch, GTM, Options()).bend.any()
    for run in range(3):
        x, y = independent(batch, run)
        expected = np.linalg.lstsq(x, y, rcond=None)[0][:5].T.ravel()
        np.testing.assert_allclose(made.theta[run], expected, rtol=1e-10, atol=1e-12)


def test_joint_least_squares_is_that_of_the_stacked_records():
    batch = without_corners(NOISY)
    made = regress_joint([batch], GTM, "ls", None, Options())
    parts = [independent(batch, run) for run in range(3)]
    blocks = [np.zeros((len(x), 3)) for x, _ in parts]
    for run, block in enumerate(blocks):
        block[:, run] = 1.0
    x = np.vstack([np.hstack([x[:, :5], block]) for (x, _), block in zip(parts, blocks, strict=True)])
    y = np.vstack([y for _, y in parts])
    expected = np.linalg.lstsq(x, y, rcond=None)[0][:5].T.ravel()
    assert made.run_ids == ("joint",)
    np.testing.assert_allclose(made.theta[0], expected, rtol=1e-10, atol=1e-12)


def test_coloured_covariance_is_the_double_sum_of_morelli_and_klein():
    batch = without_corners(NOISY)
    made = regress_batch(batch, GTM, "ls", None, Options(covariance="coloured"))
    x, y = independent(batch, 0)
    e = y - x @ np.linalg.lstsq(x, y, rcond=None)[0]
    count = len(x)
    inverse = np.linalg.inv(x.T @ x)
    expected = np.empty((15, 15))
    for i in range(3):
        for j in range(3):
            lags = np.correlate(e[:, i], e[:, j], mode="full") / count  # element count - 1 + k: lag k
            toeplitz = lags[count - 1 + np.subtract.outer(np.arange(count), np.arange(count))]
            block = inverse @ (x.T @ toeplitz @ x) @ inverse
            expected[5 * i : 5 * i + 5, 5 * j : 5 * j + 5] = block[:5, :5]
    size = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(
        made.covariance[0] / np.outer(size, size), expected / np.outer(size, size), rtol=0.0, atol=1e-9
    )


def test_white_covariance_is_that_of_ordinary_least_squares():
    batch = without_corners(NOISY)
    made = regress_batch(batch, GTM, "ls", None, Options(covariance="white"))
    x, y = independent(batch, 0)
    e = y - x @ np.linalg.lstsq(x, y, rcond=None)[0]
    expected = np.kron(e.T @ e / len(x), np.linalg.inv(x.T @ x)[:5, :5])
    np.testing.assert_allclose(np.diag(made.covariance[0]), np.diag(expected), rtol=1e-8)


def test_fourth_order_differences_lose_half_a_percent_at_the_cutoff():
    dt = 0.02
    t = dt * np.arange(200)
    for hz, loss in ((1.0, 1e-5), (5.0, 5e-3)):
        w = 2.0 * np.pi * hz
        gain = rate_of(np.sin(w * t), dt) / (w * np.cos(w * t[2:-2]))
        # (8 sin x - sin 2x)/(6 x), x = w dt
        assert np.median(gain) == pytest.approx(
            (8 * np.sin(w * dt) - np.sin(2 * w * dt)) / (6 * w * dt), rel=1e-9
        )
        assert 1.0 - np.median(gain) == pytest.approx(loss, rel=0.5)


def test_a_run_does_not_depend_on_the_others():
    one = {name: values[1:2] for name, values in NOISY.channels.items()}
    alone = replace(NOISY, run_ids=("r1",), t_s=NOISY.t_s[1:2], channels=one)
    for method, pose in POSES.items():
        made, own = (regress_batch(b, GTM, method, pose, Options()) for b in (NOISY, alone))
        np.testing.assert_array_equal(made.theta[1], own.theta[0])
        np.testing.assert_array_equal(made.covariance[1], own.covariance[0])


def test_records_that_pitch_and_start_in_motion_give_the_truth():
    batch = fly(runs=1, noise=0.0, start=[0.02, 0.1, -0.05, 0.05], q=lambda t: 0.1 * np.sin(2.0 * t))
    for method in ("ls", "iv-f1"):
        made = regress_batch(batch, GTM, method, POSES[method], Options())
        chosen = index(DETERMINED)
        np.testing.assert_allclose(made.theta[0, chosen], THETA[chosen], rtol=2e-3)
    level = {**batch.channels, "q_rad_s": np.zeros_like(batch.t_s)}
    without = regress_batch(replace(batch, channels=level), GTM, "ls", None, Options())
    assert np.abs(without.theta[0, chosen] / THETA[chosen] - 1.0).max() > 5e-3


def test_sideslip_is_reconstructed_where_no_vane_was_flown():
    batch = fly(runs=2, noise=0.0)
    for lacking in (["beta_rad"], ["beta_rad", "phi_rad"], ["beta_rad", "alpha_rad"]):
        channels = {name: x for name, x in batch.channels.items() if name not in lacking}
        made = regress_batch(replace(batch, channels=channels), GTM, "ls", None, Options())
        chosen = index(DETERMINED)
        # a trend in time is free in each equation, for the drift of the integral
        np.testing.assert_allclose(made.theta[:, chosen], np.tile(THETA[chosen], (2, 1)), rtol=1e-2)


def test_a_still_rudder_is_singular():
    batch = fly(runs=2, noise=0.0)
    channels = {**batch.channels, "rudder_rad": np.zeros_like(batch.t_s)}
    made = regress_batch(replace(batch, channels=channels), GTM, "iv-f1", POSES["iv-f1"], Options())
    assert (made.status == Status.SINGULAR).all()
    assert np.isnan(made.theta).all()


def test_names_of_the_table_are_those_of_the_motion():
    assert tuple(NAMES) == LATERAL.parameters
    observation = observe(CALM, GTM, Options())
    assert observation.scale.airspeed_m_s == pytest.approx(SPEED)
    assert observation.scale.alpha_rad == pytest.approx(ALPHA)
    rows = ls_problem(observation, Options(), smoothed(observation, Options())).rows(
        np.empty((2, 15)), np.arange(2)
    )
    assert rows.x.shape == (2, 5, CALM.t_s.shape[1] - 4)
    assert DENSITY > 0.0


def test_terms_are_columns_of_an_independent_least_squares():
    batch = without_corners(NOISY)
    alpha = ALPHA + 0.02 * np.sin(1.3 * batch.t_s)
    batch = replace(batch, channels={**batch.channels, "alpha_rad": alpha})
    made = regress_batch(batch, GTM, "ls", None, Options(terms=("alpha", "beta")))
    order = butter(4, 5.0, fs=1.0 / batch.dt_s, output="sos")
    pad = edge_samples(butterworth(5.0, 4, batch.dt_s))
    first = round(1.0 / batch.dt_s)
    for run in range(3):
        x, y = independent(batch, run)
        c = {name: values[run] for name, values in batch.channels.items()}
        speed = sosfiltfilt(order, c["airspeed_m_s"], padtype="odd", padlen=pad)
        half = GTM.span_m / (2 * speed)
        columns = [c["beta_rad"], c["p_rad_s"] * half, c["r_rad_s"] * half, c["aileron_rad"], c["rudder_rad"]]
        columns = [column - column[0] for column in columns]
        more = [column * (c["alpha_rad"] - c["alpha_rad"][:first].mean()) for column in columns]
        more.append(columns[0] * np.abs(columns[0]))
        x = np.column_stack([x, *(sosfiltfilt(order, m, padtype="odd", padlen=pad)[2:-2] for m in more)])
        expected = np.linalg.lstsq(x, y, rcond=None)[0][:5].T.ravel()
        np.testing.assert_allclose(made.theta[run], expected, rtol=1e-9, atol=1e-11)


@pytest.mark.parametrize("method", ["ls", "iv-lowpass", "iv-f1", "frequency"])
def test_a_curved_rolling_moment_is_found_and_freed(method):
    batch = fly(runs=4, noise=0.2, degrees=4.0, seed=3, curvature=-0.5)
    shown = p_values(batch, GTM, Options()) < SIGNIFICANT
    assert shown[:, TERMS.index("beta"), 1].all()
    assert not shown[:, :, [0, 2]].any()
    error = {}
    for terms in ((), ("beta",)):
        made = identify_batch(batch, GTM, method, Options(terms=terms), LATERAL)
        error[terms] = np.abs(made.theta[:, NAMES.index("Clbeta")] - THETA[NAMES.index("Clbeta")]).mean()
    assert error["beta",] < 0.25 * error[()]


def test_straight_coefficients_show_no_terms():
    batch = fly(runs=60, gust=1.0, seed=5)
    p = p_values(batch, GTM, Options())
    assert (p < 0.05).mean() < 0.09
    assert not (p < SIGNIFICANT).any()


def test_methods_whose_intervals_leave_out_a_nonlinear_term_are_named():
    found = {("alpha", "Cl"): 3, ("beta", "Cn"): 1}
    (sentence,) = curvature(["ls", "iv-f1"], found, 20)
    assert sentence.startswith(
        "ls, iv-f1: the derivatives of Cl change with the angle of attack in 3 of 20 runs"
    )
    assert "--term alpha" in sentence
    assert not list(curvature([], found, 20))
    assert set(LATERAL_METHODS) - set(LINEAR) == {"filter-error"}


def test_free_columns_are_orthonormal_and_one_that_depends_on_others_is_none():
    """Against the projection by a QR factorisation; the third column is the sum of the first two."""
    rng = np.random.default_rng(4)
    columns = rng.standard_normal((2, 4, 60))
    columns[:, 2] = columns[:, 0] + columns[:, 1]
    basis = np.empty_like(columns)
    orthonormal(columns, 1e-12, basis)
    assert not basis[:, 2].any()
    for own, found in zip(columns, basis, strict=True):
        q = np.linalg.qr(own[[0, 1, 3]].T)[0]
        np.testing.assert_allclose(found.T @ found, q @ q.T, atol=1e-13)
    rows, sums = rng.standard_normal((2, 3, 60)), np.empty((2, 4, 7))
    products(columns, rows, columns, sums)
    np.testing.assert_allclose(sums[1, :, :3], columns[1] @ rows[1].T, atol=1e-12)
    np.testing.assert_allclose(sums[1, :, 3:], columns[1] @ columns[1].T, atol=1e-12)


def test_bounded_motions_are_those_of_the_eigenvalues():
    rng = np.random.default_rng(6)
    a = rng.standard_normal((4000, 4, 4)) * np.exp(rng.standard_normal((4000, 1, 1))) - 1.5 * np.eye(4)
    largest = np.linalg.eigvals(a).real.max(axis=1)
    less = np.empty(4001, dtype=np.bool_)
    grow_less(np.concatenate([a, np.full((1, 4, 4), np.nan)]), 0.7, less)
    np.testing.assert_array_equal(less[:-1], largest < 0.7)
    assert 0.2 < (largest < 0.7).mean() < 0.8
    assert not less[-1]


def test_sums_without_constants_are_those_of_projected_rows():
    rng = np.random.default_rng(3)
    z, y, x, free = (rng.normal(size=(rows, 40)) for rows in (5, 3, 5, 2))
    free[1] = 2.0 * free[0]  # no further constant
    sums = np.concatenate([z, free]) @ np.concatenate([y, free, x]).T
    made = np.empty((1, 5, 8))
    swept(sums[None], 3, 2, 1e-12, made)
    unit = free[0] / np.linalg.norm(free[0])
    np.testing.assert_allclose(made[0], (z - np.outer(z @ unit, unit)) @ np.concatenate([x, y]).T, atol=1e-12)
