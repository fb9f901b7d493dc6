"""Records left out: against actual refits, against simulated gusts; judging changes nothing."""

from dataclasses import replace

import numpy as np
import pytest
import trace_records as tr
from scipy.linalg import solve_continuous_lyapunov

from airtruth.effects.registry import EFFECTS
from airtruth.numerics.normal_equations import step_without
from airtruth.physics.terms import Change
from airtruth.tracing.inference import assess as assessing
from airtruth.tracing.inference.assess import assess, noise_floor
from airtruth.tracing.inference.cross_validate import leave_one_out, one_by_the_other
from airtruth.tracing.inference.hypothesis import Hypothesis
from airtruth.tracing.inference.optimise import fit, initial_parameters
from airtruth.tracing.model.compile import compile_change
from airtruth.tracing.model.parameters import SHORT_PERIOD
from airtruth.tracing.model.response import respond
from airtruth.tracing.selection import predictive
from airtruth.units import DEG

ARM = EFFECTS["vane_arm"]
ONE = Hypothesis(Change(), (ARM,))
MORE = np.array([0.15, -4.0, 0.03, -0.06, 3.0, 0.07])


@pytest.fixture(scope="module")
def fitted():
    """Five records with a vane arm of 0.3 m, and the fit of all."""
    rng = np.random.default_rng(30)
    records = []
    for a in (2.0, -2.0, 1.0, -1.0, 2.5):
        made = tr.fly(rng, tr.TRUTH + MORE, 0.2, amplitude=a * DEG, name=str(a))
        y = made.signals.y.copy()
        y[:, 0] -= 0.3 / tr.V * y[:, 1]
        records.append(replace(made, signals=replace(made.signals, y=y)))
    problem = tr.problem(records)
    start = initial_parameters(problem, ONE)
    return problem, fit(problem, ONE, replace(start, sizes=np.array([0.1])))


@pytest.mark.slow
def test_leave_one_out_is_the_refit_without_the_record(fitted):
    """One step of scoring against the search itself: likelihoods of records left out within 0.3."""
    problem, found = fitted
    likelihood, assessed = leave_one_out(problem, found)
    for i in range(len(problem.records)):
        rest = [k for k in range(len(problem.records)) if k != i]
        less = replace(problem, records=tuple(problem.records[k] for k in rest))
        again = fit(less, ONE, replace(found.point, per_record=found.point.per_record[rest]))
        expected = assess(problem, i, ONE, again.point.common, again.point.sizes, found.point.per_record[i])
        assert likelihood[i] == pytest.approx(expected.likelihood, abs=0.3)
        np.testing.assert_allclose(assessed[i].free_run, expected.free_run, rtol=0.02)
        assert assessed[i].likelihood == likelihood[i]


def test_what_one_record_alone_tells_stays_where_it_is_left_out():
    """A linear problem in three unknowns, two records: the first alone tells of the third unknown.

    Expected: the solution of the second record's normal equations in the other two unknowns.
    """
    rng = np.random.default_rng(20261125)
    ours, others = rng.standard_normal((8, 3)), rng.standard_normal((9, 3))
    others[:, 2] = 0.0
    y, z = rng.standard_normal(8), rng.standard_normal(9)
    own, total = ours.T @ ours, ours.T @ ours + others.T @ others
    best = np.linalg.solve(total, ours.T @ y + others.T @ z)
    step = step_without(ours.T @ (ours @ best - y), own, total, 1e-9, 0.05)
    assert others @ (best + step) == pytest.approx(others @ np.linalg.lstsq(others, z)[0], abs=1e-6)
    # in the measure of the information, the step has no part along what the others do not tell
    assert (total @ step)[2] == pytest.approx(0.0, abs=1e-6)


def test_of_two_records_the_other_is_refitted(fitted):
    problem, found = fitted
    two = replace(problem, records=problem.records[:2])
    both = fit(two, ONE, replace(found.point, per_record=found.point.per_record[:2]))
    likelihood, _ = one_by_the_other(two, both)
    for i, other in ((0, 1), (1, 0)):
        alone = replace(two, records=(two.records[other],))
        again = fit(alone, ONE, replace(both.point, per_record=both.point.per_record[[other]]))
        expected = assess(two, i, ONE, again.point.common, again.point.sizes, both.point.per_record[i])
        assert likelihood[i] == expected.likelihood


def test_a_record_far_from_the_start_is_fitted_to_its_end(fitted):
    """Biases and trim far from the start's: the same optimum as from the fit's own parameters."""
    problem, found = fitted
    record = problem.records[0]
    off = replace(record.signals, y=record.signals.y + np.array([0.01, 0.008, 0.5]))
    moved = replace(problem, records=(replace(record, signals=off),))
    point = found.point
    own = point.per_record[0] + np.array([0.0, 0.0, 0.0, 0.0, 0.01, 0.008, 0.5, 0.0, 0.0, 0.0])
    near = assess(moved, 0, ONE, point.common, point.sizes, own)
    far = assess(moved, 0, ONE, point.common, point.sizes)
    assert far.likelihood == pytest.approx(near.likelihood, abs=0.05)


def test_records_left_out_fit_worse_than_records_fitted(fitted):
    """A record left out loses about half its share of the parameters: positive in sum."""
    problem, found = fitted
    likelihood, _ = leave_one_out(problem, found)
    inside = [
        assess(problem, i, ONE, found.point.common, found.point.sizes, found.point.per_record[i]).likelihood
        for i in range(len(problem.records))
    ]
    loss = likelihood.sum() - np.sum(inside)
    assert 0.0 < loss < 3.0 * (SHORT_PERIOD.common.size + 1)


def test_assess_changes_nothing_that_it_is_given(fitted):
    problem, found = fitted
    arguments = [found.point.common, found.point.sizes, found.point.per_record[0]]
    before = [a.copy() for a in arguments]
    y = problem.records[0].signals.y.copy()
    first = assess(problem, 0, ONE, *arguments)
    second = assess(problem, 0, ONE, *arguments)
    for a, b in zip(arguments, before, strict=True):
        np.testing.assert_array_equal(a, b)
    np.testing.assert_array_equal(problem.records[0].signals.y, y)
    assert first.likelihood == second.likelihood
    np.testing.assert_array_equal(first.residual, second.residual)


def test_assess_ends_at_the_fit_s_own_optimum(fitted):
    """From the start as from where the fit ended: the same best own parameters."""
    problem, found = fitted
    for i in range(len(problem.records)):
        near = assess(problem, i, ONE, found.point.common, found.point.sizes, found.point.per_record[i])
        far = assess(problem, i, ONE, found.point.common, found.point.sizes)
        assert far.likelihood == pytest.approx(near.likelihood, abs=0.05)
        np.testing.assert_allclose(far.free_run, near.free_run, rtol=0.01)


@pytest.mark.parametrize("level_m_s", [0.02, 5.0])
def test_a_model_that_flies_badly_is_assessed_at_its_best(fitted, level_m_s):
    """Half of the static stability is missing: the record needs strong gusts, from wherever the search begins."""
    problem, found = fitted
    common = found.point.common.copy()
    common[SHORT_PERIOD.common.index("Cmalpha")] += 0.9
    begin = found.point.per_record[0].copy()
    begin[SHORT_PERIOD.per_record.log_gust] = np.log(level_m_s)
    near = assess(problem, 0, ONE, common, found.point.sizes, begin)
    far = assess(problem, 0, ONE, common, found.point.sizes)
    assert far.likelihood == pytest.approx(near.likelihood, abs=0.5)
    assert near.per_record[SHORT_PERIOD.per_record.log_gust] > np.log(0.3)


def test_a_free_run_without_slopes_ends_where_it_began(fitted, monkeypatch):
    """A motion that diverges has equal slopes of 1e150 everywhere, beside which no prior counts: their matrix is singular."""
    problem, found = fitted
    arguments = problem, 0, ONE, found.point.common, found.point.sizes, found.point.per_record[0]
    expected = assess(*arguments)
    slopes = assessing._free_run_slopes

    def diverging(*given):
        residual, t = slopes(*given)
        return residual, np.full_like(t, 1e150)

    monkeypatch.setattr(assessing, "_free_run_slopes", diverging)
    found_again = assess(*arguments)
    assert np.isfinite(found_again.residual).all()
    assert found_again.likelihood == expected.likelihood


def test_error_is_in_the_channels_units_and_the_effect_lowers_it(fitted):
    problem, found = fitted
    with_it = [assess(problem, i, ONE, found.point.common, found.point.sizes) for i in range(5)]
    without = [assess(problem, i, tr.NOTHING, found.point.common, np.zeros(0)) for i in range(5)]
    assert sum(a.likelihood for a in with_it) < sum(a.likelihood for a in without) - 5.0
    for a in with_it:
        np.testing.assert_allclose(a.free_run, np.sqrt((a.residual**2).mean(axis=0)), rtol=1e-12)
        # innovations of the right model are gusts and noise: 200 samples, a mean square within 30 %
        np.testing.assert_allclose(a.innovation, a.expected, rtol=0.25)


def test_free_run_of_a_clean_record_has_no_error():
    """Initial state, biases and trim coefficients are free, and there is nothing else in the record."""
    blank = tr.record(np.zeros((200, 3)), lambda t: tr.doublet(t))
    common, per_record = tr.still()
    per_record[SHORT_PERIOD.per_record.motion_start], per_record[SHORT_PERIOD.per_record.offsets] = (
        [0.01, 0.02],
        [0.002, 0.003, 0.05, 0.01, -0.002],
    )
    y = -respond(blank, tr.SETTINGS, Change(), common, per_record, free_run=True).e
    problem = tr.problem([replace(blank, signals=replace(blank.signals, y=y))])
    found = assess(problem, 0, tr.NOTHING, np.zeros(SHORT_PERIOD.common.size), np.zeros(0))
    assert (found.free_run < 0.05 * tr.SETTINGS.noise).all()


@pytest.mark.parametrize("sigma_w", [0.1, 0.5])
def test_floor_is_the_standard_deviation_of_the_gust_response(sigma_w):
    """Stationary covariance by the Lyapunov equation of the equations written by hand; and 100 s of simulated air."""
    made = tr.fly(np.random.default_rng(31), sigma_w=sigma_w, samples=100)
    problem = tr.problem([made])
    common, per_record = tr.still()
    per_record[SHORT_PERIOD.per_record.log_gust] = np.log(sigma_w)
    found = noise_floor(made, problem.settings, compile_change(Change()), common, per_record)
    a, _, c, _ = tr.motion(sigma_w=sigma_w)
    drive = np.diag([0.0, 0.0, 2.0 * tr.V / tr.LENGTH_W, *np.zeros(5)])
    spread = solve_continuous_lyapunov(a, -drive)
    expected = np.sqrt(np.diag(c @ spread @ c.T) + tr.SETTINGS.noise**2)
    # the filter's linearisation is about the record's mean alpha, not the trim
    np.testing.assert_allclose(found, expected, rtol=2e-3)
    rng = np.random.default_rng(32)
    y = np.concatenate(
        [tr.fly(rng, sigma_w=sigma_w, samples=200, amplitude=0.0).signals.y[100:] for _ in range(50)]
    )
    # 50 independent records, each about one correlation time long: 4/sqrt(100), and some
    np.testing.assert_allclose(
        np.sqrt(((y + np.array([0.0, 0.0, 9.80665])) ** 2).mean(axis=0)), found, rtol=0.4
    )


def test_an_effect_that_alone_keeps_the_free_run_from_diverging_is_no_loss(fitted):
    """Derivatives refitted without a large effect can be those of an unstable aircraft: the free run of every record leaves
    all bounds, and nothing is left to compare."""
    problem, found = fitted
    reference = predictive.reference_of(
        problem, fit(problem, tr.NOTHING, replace(found.point, sizes=np.zeros(0)))
    )
    way = reference.left_out[0]
    lost = [replace(a, residual=np.full_like(a.residual, 1e9)) for a in way.assessments]
    tested = predictive.tested_on_left_out(
        problem, found, replace(reference, left_out=(way._replace(assessments=lost),)), gain=100.0
    )
    assert tested.reasons == ()
    assert (tested.free_run_gain == 0.0).all()


@pytest.mark.parametrize(
    ("gains", "correlation", "loses"),
    [
        ((-2.1, -2.1, 9.0), 0.0, True),
        ((-2.1, -2.1, 9.0), 0.98, False),
        ((-3.0, -3.0, 9.0), 0.98, True),
        ((-9.0, 0.1, 0.1), 0.0, False),
    ],
)
def test_losses_of_two_channels_that_are_one_count_once(gains, correlation, loses):
    """The sum of two standard normals has a standard deviation of sqrt(2 + 2 r): the limit is -4 without correlation."""
    covariance = np.diag([4.0, 9.0, 1.0])
    covariance[0, 1] = covariance[1, 0] = correlation * 6.0
    scaled = np.array(gains) * [2.0, 3.0, 1.0]
    assert predictive.loses_in_two_channels(scaled, covariance) == loses


def test_a_channel_without_a_sensor_loses_nothing():
    assert not predictive.loses_in_two_channels(np.array([0.0, -3.0, 0.0]), np.diag([0.0, 1.0, 0.0]))
