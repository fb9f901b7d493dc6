"""The fit: its gradient, what it recovers, the autoregression, and that the answer depends on records alone."""

from dataclasses import replace

import numpy as np
import pytest
import trace_records as tr

from airtruth.effects.registry import EFFECTS
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.terms import AeroTerm, Change
from airtruth.tracing.inference import posterior
from airtruth.tracing.inference.hypothesis import Hypothesis, unconstrained_by
from airtruth.tracing.inference.optimise import fit, initial_parameters
from airtruth.tracing.inference.posterior import Sensitivities, likelihood_terms, sensitivities_of
from airtruth.tracing.inference.whitening import NO_WHITENER, Whitener, autoregression
from airtruth.tracing.model.parameters import SHORT_PERIOD, Parameters
from airtruth.tracing.model.response import respond
from airtruth.tracing.model.response_slopes import respond_with_slopes
from airtruth.tracing.model.settings import common_prior, per_record_prior
from airtruth.units import DEG

DELAY, ARM, KINK = (EFFECTS[k] for k in ("elevator_delay", "vane_arm", "elevator_asymmetry"))
TWO = Hypothesis(Change(), (DELAY, ARM))
MORE = np.array([0.15, -4.0, 0.03, -0.06, 3.0, 0.07])
"""Increments of the derivatives, about one declared standard deviation each."""


# -- gradient


@pytest.fixture(scope="module")
def off_optimum():
    """A record, and a point some standard errors from everything that explains it."""
    settings = replace(tr.SETTINGS, coloured=True)
    problem = tr.problem([tr.fly(np.random.default_rng(1), samples=150)], settings=settings)
    point = tr.point(problem.records, [0.012, 0.2])
    common, per_record = point.common.copy(), point.per_record.copy()
    common[SHORT_PERIOD.common.derivatives] = 0.5 * MORE
    common[SHORT_PERIOD.common.log_noise] = [0.05, -0.08, 0.03]
    common[SHORT_PERIOD.common.rotary :] = [0.3, 0.1, -0.2, 0.03, 0.1, 0.2, 0.4, 0.1, -0.3]
    per_record[0] += [0.001, 0.01, 0.3, -0.2, 0.002, 0.003, 0.02, 0.003, -0.0004, 0.2]
    return problem, Parameters(common, per_record, point.sizes)


def likelihood(problem, point):
    found = sensitivities_of(problem, 0, TWO, point)
    return likelihood_terms(found, NO_WHITENER, levels=True)[0]


def test_derivatives_in_levels_can_be_left_out(off_optimum):
    """Those in the levels of noise and gusts are then zero, and the others stay the same to the last bit."""
    problem, point = off_optimum
    every = sensitivities_of(problem, 0, TWO, point)
    without = sensitivities_of(problem, 0, TWO, point, with_levels=False)
    layout = point.layout
    levels = [*SHORT_PERIOD.common.noise, layout.per_record.start + SHORT_PERIOD.per_record.log_gust]
    rest = np.setdiff1d(np.arange(layout.total), levels)
    assert np.abs(every.w[levels]).any(axis=(1, 2)).all()
    assert not without.t[levels].any()
    assert not without.w[levels].any()
    assert np.array_equal(without.t[rest], every.t[rest])
    assert np.array_equal(without.w[rest], every.w[rest])


def moved(point, i, h):
    common, sizes, per_record = point.common.copy(), point.sizes.copy(), point.per_record.copy()
    if i < SHORT_PERIOD.common.size:
        common[i] += h
    elif i < SHORT_PERIOD.common.size + sizes.size:
        sizes[i - SHORT_PERIOD.common.size] += h
    else:
        per_record[0, i - SHORT_PERIOD.common.size - sizes.size] += h
    return Parameters(common, per_record, sizes)


@pytest.mark.grid
@pytest.mark.parametrize("name", [*SHORT_PERIOD.common.names, "delay", "arm", *SHORT_PERIOD.per_record.names])
def test_gradient_is_that_of_the_likelihood(off_optimum, name):
    """Central differences of the negative log-likelihood itself; the fit's are one-sided, steps as in the model."""
    problem, point = off_optimum
    names = [*SHORT_PERIOD.common.names, "delay", "arm", *SHORT_PERIOD.per_record.names]
    steps = [*SHORT_PERIOD.common.step, 1e-3, 0.01, *SHORT_PERIOD.per_record.step]
    i = names.index(name)
    _, gradient, information = likelihood_terms(
        sensitivities_of(problem, 0, TWO, point), NO_WHITENER, levels=True
    )
    h = 0.5 * steps[i]
    expected = (likelihood(problem, moved(point, i, h)) - likelihood(problem, moved(point, i, -h))) / (
        2.0 * h
    )
    # in standard errors: a hundredth of one is below what ends a search
    unit = np.sqrt(information[i, i]) + 1e-12
    assert gradient[i] / unit == pytest.approx(expected / unit, rel=0.01, abs=0.02)


def test_information_is_the_expected_curvature():
    """Mean gradient outer product over 40 simulated records is the information: diagonal of six derivatives.

    A variance of 40 draws is within 3 sqrt(2/40) of its mean.
    """
    rng = np.random.default_rng(2)
    scores = []
    for _ in range(40):
        problem = tr.problem([tr.fly(rng, samples=120, sigma_w=0.3)])
        point = tr.point(problem.records)
        per_record = np.zeros((1, SHORT_PERIOD.per_record.size))
        per_record[0, SHORT_PERIOD.per_record.log_gust] = np.log(0.3)
        made = sensitivities_of(problem, 0, tr.NOTHING, replace(point, per_record=per_record))
        # the first second starts from a gust that the filter does not know
        late = Sensitivities(made.r[25:], made.logdet, made.t[:, 25:], made.w, made.white)
        _, gradient, information = likelihood_terms(late, NO_WHITENER, levels=True)
        scores.append(gradient[:6] / np.sqrt(np.diag(information)[:6]))
    variance = np.mean(np.square(scores), axis=0)
    assert np.abs(variance - 1.0).max() < 3.0 * np.sqrt(2.0 / 40.0)


# -- what a fit recovers


def recovered(noise, sigma_w, seed, hypothesis=tr.NOTHING, sizes=(), levels=True):
    rng = np.random.default_rng(seed)
    records = [
        tr.fly(
            rng,
            tr.TRUTH + MORE,
            sigma_w,
            noise=noise,
            amplitude=a * DEG,
            bias=(0.003, -0.002, 0.05),
            name=str(a),
        )
        for a in (2.0, -2.0, 3.0)
    ]
    problem = tr.problem(records)
    start = initial_parameters(problem, hypothesis)
    if not levels:
        start.per_record[:, SHORT_PERIOD.per_record.log_gust] = np.log(0.05)
    found = fit(problem, hypothesis, replace(start, sizes=np.array(sizes, dtype=float)), free_levels=levels)
    assert found is not None
    assert found.converged
    return found


def test_noise_free_records_give_the_derivatives_back():
    """What is left is the prior's pull and the second-order terms of a 3 deg doublet.

    Levels are held at the declared noise and little gust: free ones would follow the residuals to nothing.
    """
    found = recovered(np.zeros(3), 0.0, 3, levels=False)
    error = np.sqrt(np.diag(found.covariance)[:6])
    assert (np.abs(found.point.common[SHORT_PERIOD.common.derivatives] - MORE) < error).all()
    assert (error[3:] < 0.2 * np.abs(MORE[3:])).all()
    np.testing.assert_allclose(found.point.common[[3, 5]], MORE[[3, 5]], rtol=0.05)


@pytest.mark.parametrize("seed", [4, 5, 6])
def test_noisy_records_give_the_derivatives_within_their_errors(seed):
    found = recovered(tr.SETTINGS.noise, 0.3, seed)
    error = np.sqrt(np.diag(found.covariance)[:6])
    assert (np.abs(found.point.common[SHORT_PERIOD.common.derivatives] - MORE) < 3.0 * error).all()
    # three records of 0.3 m/s: the mean log level is within 0.5 (one correlation time is a whole record)
    assert found.point.per_record[:, SHORT_PERIOD.per_record.log_gust].mean() == pytest.approx(
        np.log(0.3), abs=0.5
    )
    np.testing.assert_allclose(found.point.common[SHORT_PERIOD.common.log_noise], 0.0, atol=0.15)


def test_an_effect_that_is_not_there_has_no_size():
    found = recovered(tr.SETTINGS.noise, 0.3, 7, Hypothesis(Change(), (KINK,)), [0.0])
    assert abs(found.point.sizes[0]) < 3.0 * np.sqrt(
        found.covariance[SHORT_PERIOD.common.size, SHORT_PERIOD.common.size]
    )


def test_a_rival_out_of_reach_ends_a_search_early():
    problem = tr.problem([tr.fly(np.random.default_rng(1), tr.TRUTH + MORE)])
    start = initial_parameters(problem, tr.NOTHING)
    full = fit(problem, tr.NOTHING, start)
    assert fit(problem, tr.NOTHING, start, rival=full.cost - 1e6).cost >= full.cost - 1e-6


def test_a_start_that_cannot_be_evaluated_gives_none():
    problem = tr.problem([tr.fly(np.random.default_rng(1), samples=60)])
    start = tr.point(problem.records)
    start.common[3] = np.nan
    assert fit(problem, tr.NOTHING, start) is None


# -- autoregression


def innovations(rng, a, samples, records):
    found = []
    for _ in range(records):
        r = np.zeros((samples + 50, 3))
        for k in range(1, len(r)):
            r[k] = a @ r[k - 1] + rng.standard_normal(3)
        found.append(r[50:])
    return found


def test_autoregression_finds_a_known_one():
    """Var(1), 4 x 2000 samples: coefficients within 4/sqrt(8000) of the known ones; what is left is white."""
    a = np.array([[0.5, 0.1, 0.0], [-0.2, 0.3, 0.1], [0.0, 0.2, -0.4]])
    rng = np.random.default_rng(8)
    records = innovations(rng, a, 2000, 4)
    found = autoregression(records)
    assert found.coefficients.shape == (1, 3, 3)
    np.testing.assert_allclose(found.coefficients[0], a, atol=4.0 / np.sqrt(8000.0) / np.sqrt(1.0 - 0.5))
    whitened = np.concatenate([found.apply(r)[1:] for r in records])
    np.testing.assert_allclose(whitened.T @ whitened / len(whitened), np.eye(3), atol=0.01)


@pytest.mark.parametrize("seed", range(5))
def test_autoregression_leaves_white_noise_alone(seed):
    found = autoregression(innovations(np.random.default_rng(seed), np.zeros((3, 3)), 250, 3))
    assert found.order == 0
    x = np.random.default_rng(seed).standard_normal((4, 7, 3))
    np.testing.assert_array_equal(found.apply(x), x)


def test_whitener_filters_along_the_samples():
    """Two lags by hand."""
    rng = np.random.default_rng(9)
    a, root, x = rng.standard_normal((2, 3, 3)), rng.standard_normal((3, 3)), rng.standard_normal((5, 6, 3))
    start = rng.standard_normal((3, 3))
    out = Whitener(a, root, start).apply(x)
    for n in range(5):
        for k in range(6):
            past = [a[j - 1] @ x[n, k - j] for j in (1, 2) if k >= 2]
            expected = root @ (x[n, k] - sum(past)) if past else start @ x[n, k]
            np.testing.assert_allclose(out[n, k], expected, rtol=1e-10, atol=1e-12)


def test_the_first_samples_of_a_smooth_record_do_not_outweigh_the_others():
    """A pole of 0.999: the residual has a std of 0.045 times that of the series. The first sample counts as one sample of unit
    variance (10.8 is the chi-square(1) quantile of 0.999); divided by the residual it counts some fifty times."""
    records = innovations(np.random.default_rng(3), 0.999 * np.eye(3), 2000, 4)
    found = autoregression(records)
    first = np.concatenate([found.apply(r)[: found.order] for r in records])
    assert np.square(first).max() < 10.8


# -- the answer depends on the records alone


@pytest.fixture(scope="module")
def three():
    rng = np.random.default_rng(10)
    records = [tr.fly(rng, tr.TRUTH + MORE, amplitude=a * DEG, samples=150, name=str(a)) for a in (2, -2, 1)]
    return records, fit(tr.problem(records), TWO, replace(tr.point(records), sizes=np.array([0.003, 0.05])))


def test_threads_change_no_bit(three):
    records, one = three
    again = fit(
        tr.problem(records, threads=2), TWO, replace(tr.point(records), sizes=np.array([0.003, 0.05]))
    )
    assert again.cost == one.cost
    for name in ("common", "per_record", "sizes"):
        np.testing.assert_array_equal(getattr(again.point, name), getattr(one.point, name))
    np.testing.assert_array_equal(again.covariance, one.covariance)


def test_order_of_records_does_not_matter(three):
    records, one = three
    order = [2, 0, 1]
    turned = [records[i] for i in order]
    again = fit(tr.problem(turned), TWO, replace(tr.point(turned), sizes=np.array([0.003, 0.05])))
    error = np.sqrt(np.diag(one.covariance))
    assert again.cost == pytest.approx(one.cost, rel=1e-8)
    np.testing.assert_allclose(
        again.point.common / error[: SHORT_PERIOD.common.size],
        one.point.common / error[: SHORT_PERIOD.common.size],
        atol=1e-6,
    )
    np.testing.assert_allclose(
        again.point.sizes / error[SHORT_PERIOD.common.size :],
        one.point.sizes / error[SHORT_PERIOD.common.size :],
        atol=1e-6,
    )
    np.testing.assert_allclose(again.point.per_record, one.point.per_record[order], atol=1e-7)


# -- derivatives that an effect sets free


def test_a_curvature_sets_its_slope_free_where_it_is_one():
    """About zero it is a slope at a trim of 0.1 rad; at a trim of zero, as in the linear model, it is none."""
    assert {key: free for key, e in EFFECTS.items() if (free := unconstrained_by(e, 0.1, LONGITUDINAL))} == {
        "cl_alpha_nonlinear:quadratic": (0,),
        "cm_alpha_nonlinear:quadratic": (3,),
    }
    assert not any(unconstrained_by(e, 0.0, LONGITUDINAL) for e in EFFECTS.values())


def test_precision_without_a_declared_slope():
    """A variance of 100 more for CLalpha, all else as declared: the marginal covariance says so."""
    made = tr.fly(np.random.default_rng(80))
    tight, free = (
        np.linalg.inv(common_prior([made], tr.SETTINGS, unconstrained)) for unconstrained in ((), (0,))
    )
    more = np.zeros_like(tight)
    more[0, 0] = 100.0
    np.testing.assert_allclose(free, tight + more, rtol=1e-6, atol=1e-9)


@pytest.mark.grid
@pytest.mark.parametrize(("about", "slope"), [(0.1, 0.0), (0.0, 2.0)])
def test_a_curvature_is_found_whatever_angle_it_is_about(about, slope):
    """At a trim of 0.1 rad 10 alpha^2 is 10 (alpha - 0.1)^2 and a slope of 2 that nobody declared, eight standard
    deviations of its prior; its constant of 0.1 is trimmed out.
    """
    rng = np.random.default_rng(81)
    bent = Change(aero=(AeroTerm("CL", "alpha", "quadratic", 10.0, about),))
    plant = tr.plant()
    plant = tr.about(plant, 0.1)
    common, per_record = tr.still()
    per_record[SHORT_PERIOD.per_record.index("alpha0")], per_record[SHORT_PERIOD.per_record.trim.start] = (
        0.1,
        -10.0 * (0.1 - about) ** 2,
    )
    records = []
    for amplitude in (3.0, -3.0, 2.0):
        made = tr.fly(rng, amplitude=amplitude * DEG, name=str(amplitude))
        made = replace(
            made,
            signals=replace(made.signals, theta_rad=np.full_like(made.signals.theta_rad, 0.1)),
            plant=plant,
        )
        y = made.signals.y - respond(made, tr.SETTINGS, bent, common, per_record, free_run=True).e
        y += tr.SETTINGS.noise * rng.standard_normal(y.shape)
        records.append(replace(made, signals=replace(made.signals, y=y)))
    problem = tr.problem(records)
    declared = replace(tr.NOTHING, trim_flow_rad=0.1)
    hypothesis = declared.plus(EFFECTS["cl_alpha_nonlinear:quadratic"])
    assert hypothesis.unconstrained == (0,)
    null = fit(problem, declared, initial_parameters(problem, declared))
    found = fit(problem, hypothesis, replace(null.point, sizes=np.array([5.0])))
    std = np.sqrt(np.diag(found.covariance))
    assert abs(found.point.sizes[0] - 10.0) < 3.0 * std[SHORT_PERIOD.common.size]
    assert std[SHORT_PERIOD.common.size] < 1.5
    assert abs(found.point.common[0] - slope) < 3.0 * std[0]


def test_a_curvature_counts_from_the_trim():
    """alpha^2 and (alpha - 0.1)^2 differ by a line, which the derivatives carry; a break stays where it is."""
    about_zero = EFFECTS["cm_alpha_nonlinear:quadratic"]
    kink = EFFECTS["cm_alpha_nonlinear:break"]
    hypothesis = Hypothesis(Change(), (about_zero, kink), trim_flow_rad=0.1)
    terms = hypothesis.change(np.array([3.0, 0.5, 0.02])).aero
    assert [(t.shape, t.at) for t in terms] == [("quadratic", 0.1), ("above", 0.02)]


def test_a_loose_coefficient_has_a_wide_offset():
    """Of the coefficient that a curvature bends alone: 0.5 for what is declared as 0.1 and 0.03."""
    made = tr.fly(np.random.default_rng(82))
    std = {
        unconstrained: np.sqrt(np.diag(np.linalg.inv(per_record_prior(made, tr.SETTINGS, unconstrained)[1])))[
            7:9
        ]
        for unconstrained in ((), (0,), (3,))
    }
    np.testing.assert_allclose(std[()], [0.1, 0.03])
    np.testing.assert_allclose(std[(0,)], [0.5, 0.03])
    np.testing.assert_allclose(std[(3,)], [0.1, 0.5])


# -- correlated noise


@pytest.mark.parametrize("share", [0.0, 0.5])
def test_slow_noise_is_told_from_white(share):
    """Half of every sensor's variance over 80 ms, or none; three standard errors. Of none no time can be told."""
    rng = np.random.default_rng(83)
    records = [
        tr.fly(rng, sigma_w=0.1, amplitude=a * DEG, name=str(a), slow_share=share) for a in (2.0, -2.0, 3.0)
    ]
    problem = tr.problem(records, settings=replace(tr.SETTINGS, coloured=True))
    start = initial_parameters(problem, tr.NOTHING)
    common = start.common.copy()
    common[SHORT_PERIOD.common.colour_shares] = 0.2
    found = fit(problem, tr.NOTHING, replace(start, common=common))
    std = np.sqrt(np.diag(found.covariance))
    at = SHORT_PERIOD.common.colour_shares
    if share == 0.0:
        assert (found.point.common[at] < 0.1).all()
        return
    assert found.converged
    assert (np.abs(found.point.common[at] - share) < 3.0 * std[at]).all()
    assert (
        abs(found.point.common[SHORT_PERIOD.common.log_colour_time] - np.log(0.08 / 0.1))
        < 3.0 * std[SHORT_PERIOD.common.log_colour_time]
    )
    assert (std[at] < 0.2).all()


def test_white_records_know_no_slow_noise():
    """Its shares are no parameters then: they stay at none, and no derivative is made for them."""
    problem = tr.problem([tr.fly(np.random.default_rng(84))])
    found = fit(problem, tr.NOTHING, initial_parameters(problem, tr.NOTHING))
    np.testing.assert_array_equal(found.point.common[SHORT_PERIOD.common.colour], 0.0)
    np.testing.assert_array_equal(found.sensitivities[0].t[SHORT_PERIOD.common.colour], 0.0)


def test_a_step_from_which_the_motion_diverges_has_no_derivative(monkeypatch):
    """Innovations of 1e9 after a small step in Cmalpha. Such derivatives gave an information of 1e31, which has no inverse."""
    one = tr.fly(np.random.default_rng(2), sigma_w=0.0)
    problem, point = tr.problem([one]), tr.point([one])
    cmalpha = 3
    assert sensitivities_of(problem, 0, tr.NOTHING, point) is not None

    def diverging(*arguments):
        made, slopes = respond_with_slopes(*arguments)
        slopes.e[slopes.parameters == cmalpha] += 1e9 / SHORT_PERIOD.common.step[cmalpha]
        return made, slopes

    monkeypatch.setattr(posterior, "respond_with_slopes", diverging)
    assert sensitivities_of(problem, 0, tr.NOTHING, point) is None


@pytest.mark.parametrize("other", ["settings", "declared"])
def test_a_start_does_not_depend_on_what_was_started_before(other):
    """Records keep derivatives at the start; those of other settings or another declaration do not serve, to the last bit."""
    sizes = np.array([0.012, 0.2])

    def start(after):
        problem = tr.problem([tr.fly(np.random.default_rng(1), samples=150)])
        if after:
            settings = replace(tr.SETTINGS, noise=3.0 * tr.SETTINGS.noise)
            term = AeroTerm("Cm", "alpha", "linear", 0.1)
            before = replace(problem, settings=settings) if other == "settings" else problem
            declared = Change(aero=(term,)) if other == "declared" else Change()
            initial_parameters(before, Hypothesis(declared, (DELAY,)), sizes[:1])
        return initial_parameters(problem, TWO, sizes).vector

    assert np.array_equal(start(after=True), start(after=False))
