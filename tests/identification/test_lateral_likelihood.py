"""Lateral filter error, output error and equation error in the frequency domain: truth, intervals, innovations."""

from dataclasses import replace

import numpy as np
import pytest

from airtruth.identification import Options, identify, identify_batch, identify_joint
from airtruth.identification.lateral.observation import condition_of, known_inputs
from airtruth.identification.lateral.predictor import SURPLUS, factor_names, levels, predictor_of, records_of
from airtruth.identification.likelihood.fit import scored
from airtruth.identification.likelihood.linearise import Matrices, slopes, values_of
from airtruth.identification.likelihood.predictor import layout
from airtruth.identification.likelihood.scoring import secant
from airtruth.numerics.discretise import assemble, step
from airtruth.physics.lateral import lateral_system
from airtruth.physics.motion import LATERAL
from validation.affine_lateral import ALPHA, GTM, NAMES, THETA, fly, log_of, pitching

DETERMINED = [NAMES.index(n) for n in ("CYbeta", "Clbeta", "Clp", "Clda", "Cnbeta", "Cndr")]
QUIET = fly(runs=2, noise=1e-3)


@pytest.mark.parametrize("method", ["filter-error", "output-error", "frequency"])
def test_quiet_records_give_the_truth(method):
    made = identify_batch(QUIET, GTM, method, motion=LATERAL)
    assert made.converged.all()
    np.testing.assert_allclose(made.theta[:, DETERMINED], np.tile(THETA[DETERMINED], (2, 1)), rtol=5e-4)
    np.testing.assert_allclose(made.theta, np.tile(THETA, (2, 1)), atol=0.005)


def test_predictor_has_the_matrices_of_the_linear_model():
    known = known_inputs(QUIET)
    scale = condition_of(QUIET, GTM, Options(), known)
    outputs = tuple(output.name for output in LATERAL.outputs)
    predictor = predictor_of(scale, outputs, 533.4, gusts=True, measured=True)
    own = layout(predictor, 2)
    names = levels(outputs, gusts=True)
    z = np.concatenate([THETA, np.log(np.full(len(names), 0.7))])[None]
    n, inputs, m, _ = own.sizes
    system, process, variance = np.zeros((n + m, n + inputs)), np.zeros(n), np.zeros(m)
    assemble(values_of(own, z)[0], own.location, own.coefficient[0], system, process, variance)
    linear = lateral_system(THETA, scale)
    np.testing.assert_allclose(system[:4, :4], linear.a[0], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(system[:4, n : n + 2], linear.b[0], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(system[n:, :4], linear.c[0], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(system[n:, n : n + 2], linear.d[0], rtol=1e-12, atol=1e-12)
    # the gust acts as a sideslip in forces, moments and on the vane: sigma sqrt(3/2)/V in its first state
    share = 0.7 * np.sqrt(1.5) / scale.airspeed_m_s[0]
    np.testing.assert_allclose(system[1:3, 4], linear.a[0, 1:3, 0] * share, rtol=1e-12)
    np.testing.assert_allclose(system[n, 4], share, rtol=1e-12)
    surplus = predictor.inputs.index(SURPLUS[0])
    np.testing.assert_allclose(system[1:3, n + surplus], linear.a[0, 1:3, 0], rtol=1e-12)
    np.testing.assert_allclose(process[1:3], 0.7**2)


@pytest.mark.parametrize("gusts", [True, False])
def test_slopes_of_the_step_are_those_of_a_complex_step(gusts):
    """Nothing is subtracted in a complex step, so that it is exact to rounding."""
    data = records_of(QUIET, GTM, Options(terms=("alpha",)), 533.4, gusts=gusts)
    own, dt_s = data.layout, 0.05
    z = np.linspace(-0.6, 0.5, own.sizes[3])
    z[:15] = 1.1 * THETA
    free = np.arange(own.sizes[3])[::-1]
    made = slopes(own, np.array([1]), z[None], free, dt_s)
    n, inputs, m, _ = own.sizes
    values = values_of(own, z[None])[0]
    for f, which in enumerate(free):
        moved = values.astype(complex)
        moved[which] += 1e-40j * (values[which] if own.logarithmic[which] else 1.0)
        system = np.empty((n + m, n + inputs), dtype=complex)
        process, variance = np.empty(n, dtype=complex), np.empty(m, dtype=complex)
        phi, noise = np.empty((n, n), dtype=complex), np.empty((n, n), dtype=complex)
        early, late = np.empty((n, inputs), dtype=complex), np.empty((n, inputs), dtype=complex)
        assemble(moved, own.location, own.coefficient[1], system, process, variance)
        step(system, process, n, dt_s, phi, early, late, noise)
        expected = Matrices(phi, early, late, noise, system[n:, :n], system[n:, n:], variance)
        for name, found, right in zip(Matrices._fields, made, expected, strict=True):
            np.testing.assert_allclose(
                found[0, f], right.imag / 1e-40, rtol=1e-11, atol=1e-13, err_msg=f"{name} of {which}"
            )


def test_gradient_is_that_of_differences():
    batch = fly(runs=1, seconds=6.0, gust=0.6, seed=8)
    data = records_of(batch, GTM, Options(), 533.4, gusts=True)
    noise = np.log([0.6, 6e-4, 9e-3, 6e-3, 9e-4, 0.064, 0.01, 0.01])
    z = np.concatenate([1.02 * THETA, noise])[None]
    free = np.arange(z.shape[1])
    run = np.arange(1)
    _, gradient, information = scored(data, z, run, free)
    step = 1e-5
    for i in free[::3]:
        up, down = z.copy(), z.copy()
        up[0, i] += step
        down[0, i] -= step
        slope = (scored(data, up, run, free)[0] - scored(data, down, run, free)[0]) / (2.0 * step)
        assert slope[0] == pytest.approx(gradient[0, i], rel=1e-5, abs=1e-5 * np.sqrt(information[0, i, i]))


@pytest.mark.parametrize("gusts", [True, False])
def test_gradient_without_information_is_that_with_it(gusts):
    """The adjoint of the filter has the gradient of the differentiated filter."""
    data = records_of(fly(runs=2, seconds=6.0, gust=0.6, seed=8), GTM, Options(), 533.4, gusts=gusts)
    noise = np.log(
        [0.6, 6e-4, 9e-3, 6e-3, 9e-4, 0.064, 0.01, 0.01] if gusts else [6e-4, 9e-3, 6e-3, 9e-4, 0.064]
    )
    z = np.tile(np.concatenate([1.02 * THETA, noise]), (2, 1))
    runs, free = np.arange(2), np.arange(z.shape[1])[::-1]
    cost, gradient, information = scored(data, z, runs, free)
    cheap, alone, nothing = scored(data, z, runs, free, informed=False)
    np.testing.assert_array_equal(cheap, cost)
    np.testing.assert_allclose(alone, gradient, rtol=1e-11)
    assert np.isnan(nothing).all()
    assert np.isfinite(information).all()


def test_secant_finds_the_curvature_of_a_quadratic_cost():
    """Broyden's theorem: n steps along conjugate directions give the exact matrix."""
    exact, curvature = np.diag([3.0, 0.5]), np.eye(2)[None]
    for moved in np.eye(2)[:, None]:
        curvature = secant(curvature, moved, moved @ exact)
        np.testing.assert_allclose(np.matmul(curvature, moved[:, :, None])[0, :, 0], (moved @ exact)[0])
    np.testing.assert_allclose(curvature[0], exact)
    bent = secant(curvature, np.ones((1, 2)), -np.ones((1, 2)))
    np.testing.assert_array_equal(bent, curvature)


@pytest.mark.parametrize("gust", [0.0, 1.0])
def test_information_of_the_point_before_leads_to_the_same_maximum(monkeypatch, gust):
    batch = fly(runs=3, seconds=8.0, gust=gust, seed=17)
    fast = identify_batch(batch, GTM, "filter-error", motion=LATERAL)
    monkeypatch.setattr("airtruth.identification.lateral.likelihood._NEAR", 0.0)
    plain = identify_batch(batch, GTM, "filter-error", motion=LATERAL)
    deviation = np.sqrt(np.diagonal(plain.covariance, axis1=1, axis2=2))
    assert (np.abs(fast.theta - plain.theta) < 0.02 * deviation).all()
    np.testing.assert_allclose(np.sqrt(np.diagonal(fast.covariance, axis1=1, axis2=2)), deviation, rtol=0.01)
    assert fast.iterations.sum() <= plain.iterations.sum()


def test_records_without_a_vane_or_bank_are_fitted():
    for lacking in ("beta_rad", "phi_rad"):
        channels = {name: x for name, x in QUIET.channels.items() if name != lacking}
        made = identify_batch(replace(QUIET, channels=channels), GTM, "filter-error", motion=LATERAL)
        np.testing.assert_allclose(made.theta[:, DETERMINED], np.tile(THETA[DETERMINED], (2, 1)), rtol=5e-3)


def test_constant_pressure_is_a_choice():
    batch = fly(runs=2, gust=0.75, seed=1)
    for method in ("filter-error", "frequency"):
        one, other = (
            identify_batch(batch, GTM, method, Options(pressure=p), LATERAL).theta
            for p in ("constant", "measured")
        )
        assert np.abs(one - other).max() > 1e-3


def test_output_error_in_turbulence_is_warned_about():
    log = log_of(fly(q=pitching, runs=2, gust=0.75, seed=6))
    noted = identify(log, GTM, ["output-error", "filter-error"], motion=LATERAL).notes
    warned = [note for note in noted if "not white" in note]
    assert len(warned) == 1
    assert warned[0].startswith("Warning: output-error: the residuals are not white in 2 of 2 runs")
    assert "Use filter-error" in warned[0]
    calm = log_of(fly(q=pitching, runs=2, seed=6))
    assert not any("not white" in n for n in identify(calm, GTM, ["output-error"], motion=LATERAL).notes)


def test_joint_estimates_are_better_than_single_ones():
    batch = fly(runs=4, gust=0.75, seed=11)
    for method in ("filter-error", "frequency"):
        joint = identify_joint([batch], GTM, method, motion=LATERAL)
        single = identify_batch(batch, GTM, method, motion=LATERAL)
        std = np.sqrt(np.diagonal(joint.covariance[0]))
        ratio = std / np.sqrt(np.diagonal(single.covariance, axis1=1, axis2=2)).mean(axis=0)
        np.testing.assert_allclose(ratio, 0.5, rtol=0.2)  # 1/sqrt(4)
        assert (np.abs(joint.theta[0] - THETA) < 4.0 * std).all()


def test_a_band_with_too_few_frequencies_is_refused():
    from airtruth.errors import ConfigurationError

    with pytest.raises(ConfigurationError, match=r"band_hz.*widen the band"):
        identify_batch(QUIET, GTM, "frequency", Options(band_hz=(0.5, 0.7)), LATERAL)


@pytest.mark.slow
@pytest.mark.parametrize("gust", [0.0, 1.0])
def test_filter_error_states_its_error(gust):
    """150 runs of 15 derivatives: coverage within 2.5 standard errors of 95 %, errors as stated."""
    batch = fly(runs=150, gust=gust, seed=1)
    made = identify_batch(batch, GTM, "filter-error", motion=LATERAL)
    assert made.converged.all()
    error = made.theta - THETA
    std = np.sqrt(np.diagonal(made.covariance, axis1=1, axis2=2))
    assert (np.abs(error) < 1.96 * std).mean() == pytest.approx(0.95, abs=0.03)
    assert np.sqrt((error**2).mean(axis=0) / (std**2).mean(axis=0)).mean() == pytest.approx(1.0, abs=0.1)


def swinging(t):
    """A slow change of the angle of attack [rad]."""
    return 0.02 * np.sin(2.2 * t) + 0.01 * np.sin(0.9 * t)


SLOPES = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.6, 0.8, 2.0, 0.3, -0.3, 0.0, -0.7, 0.0, 0.0, 0.2])
"""Changes of the derivatives with alpha [1/rad]."""


@pytest.mark.parametrize("method", ["filter-error", "output-error"])
def test_terms_in_alpha_and_beta_give_the_derivatives_at_the_first_alpha(method):
    """Without the terms the same records are off by several times the tolerance."""
    batch = fly(runs=2, noise=1e-3, alpha=swinging, slopes=SLOPES, curvature=0.3)
    second = round(Options().trim_window_s / batch.dt_s)
    first = batch.channels["alpha_rad"][:, :second].mean(axis=1) - ALPHA
    truth = THETA + first[:, None] * SLOPES
    plain = identify_batch(batch, GTM, method, motion=LATERAL)
    freed = identify_batch(batch, GTM, method, Options(terms=("alpha", "beta")), LATERAL)
    assert freed.converged.all()
    assert freed.theta.shape == (2, 15)
    error, without = (np.abs(made.theta - truth)[:, DETERMINED] for made in (freed, plain))
    assert (error < 1e-3 * np.abs(truth[:, DETERMINED])).all()
    assert without.max() > 10.0 * error.max()


def test_the_gradient_of_the_factors_is_that_of_differences():
    batch = fly(runs=1, seconds=6.0, gust=0.6, seed=8, alpha=swinging, slopes=SLOPES)
    options = Options(terms=("alpha", "beta"))
    data = records_of(batch, GTM, options, 533.4, gusts=True)
    names = factor_names(options.terms)
    assert len(names) == 18
    noise = np.log([0.6, 6e-4, 9e-3, 6e-3, 9e-4, 0.064, 0.01, 0.01])
    z = np.concatenate([1.02 * THETA, np.linspace(-0.5, 0.5, 18), noise])[None]
    free = np.arange(z.shape[1])
    run = np.arange(1)
    _, gradient, information = scored(data, z, run, free)
    step = 1e-5
    for i in range(15, 33, 2):
        up, down = z.copy(), z.copy()
        up[0, i] += step
        down[0, i] -= step
        slope = (scored(data, up, run, free)[0] - scored(data, down, run, free)[0]) / (2.0 * step)
        assert slope[0] == pytest.approx(gradient[0, i], rel=1e-5, abs=1e-5 * np.sqrt(information[0, i, i]))


def test_terms_of_all_runs_are_shared():
    batch = fly(runs=4, gust=0.4, seed=4, alpha=swinging, slopes=SLOPES)
    made = identify_joint([batch], GTM, "filter-error", Options(terms=("alpha",)), motion=LATERAL)
    std = np.sqrt(np.diagonal(made.covariance[0]))
    assert (np.abs(made.theta[0] - THETA) < 4.0 * std).all()
