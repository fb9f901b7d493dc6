"""Monte Carlo statistics against scipy, hand values and their own replication."""

import numpy as np
import pytest
import report_samples
from hypothesis import given, settings
from hypothesis import strategies as st
from report_synthetic import TRUTH
from scipy import stats

from airtruth.reporting import statistics
from airtruth.reporting.partial import Sample, method_statistics

SAMPLES = {
    "normal": lambda rng, n: rng.standard_normal((n, 3)),
    "skewed": lambda rng, n: rng.exponential(2.0, (n, 3)),
    "heavy": lambda rng, n: rng.standard_t(5.0, (n, 3)),
    "bounded": lambda rng, n: rng.uniform(-1.0, 1.0, (n, 3)),
}


@pytest.mark.parametrize("kind", SAMPLES)
@pytest.mark.parametrize("n", [4, 7, 300])
def test_standard_error_of_the_standard_deviation_is_scipys_k_statistic(kind, n):
    x = SAMPLES[kind](np.random.default_rng(n), n)
    figure = report_samples.standard_deviation(x)
    for j in range(3):
        s = np.std(x[:, j], ddof=1)
        expected = np.sqrt(max(stats.kstatvar(x[:, j], 2), 0.0)) / (2.0 * s)
        assert figure.value[j] == pytest.approx(s, rel=1e-14)
        assert figure.se[j] == pytest.approx(expected, rel=1e-10, abs=1e-14)


@pytest.mark.slow
@pytest.mark.parametrize("kind", SAMPLES)
def test_standard_errors_predict_the_spread_over_replications(kind):
    """6667 replications of 3 columns of 200: spreads are known to about 1 %, 3 % allowed (order 1/n)."""
    rng = np.random.default_rng(11)
    means, stds, mean_ses, std_ses = [], [], [], []
    for _ in range(6667):
        x = SAMPLES[kind](rng, 200)
        mean, std = report_samples.mean(x), report_samples.standard_deviation(x)
        means.append(mean.value)
        stds.append(std.value)
        mean_ses.append(mean.se**2)
        std_ses.append(std.se**2)
    assert np.sqrt(np.mean(mean_ses)) == pytest.approx(np.std(means), rel=0.03)
    # a t distribution with 5 degrees of freedom has no eighth moment: its fourth is learned slowly
    assert np.sqrt(np.mean(std_ses)) == pytest.approx(np.std(stds), rel=0.10 if kind == "heavy" else 0.03)


def test_normal_estimates_give_the_textbook_standard_error():
    x = np.random.default_rng(0).standard_normal((200_000, 1))
    # s/sqrt(2(n - 1)) for a normal sample
    assert report_samples.standard_deviation(x).se[0] == pytest.approx(1.0 / np.sqrt(2.0 * 199_999), rel=0.01)


def test_root_mean_square_by_hand():
    figure = report_samples.rms(np.array([[3.0], [4.0]]))
    # mean square 12.5; of 9 and 16: s = 7/sqrt(2), standard error 3.5; delta method 3.5/(2 sqrt(12.5))
    assert figure.value[0] == pytest.approx(np.sqrt(12.5), rel=1e-15)
    assert figure.se[0] == pytest.approx(3.5 / (2.0 * np.sqrt(12.5)), rel=1e-15)


def test_share_by_hand():
    figure = report_samples.hit_rate(np.array([[1.0, 1.0], [1.0, 0.0], [1.0, 1.0], [1.0, 0.0]]))
    assert figure.value == pytest.approx([1.0, 0.5])
    # Agresti and Coull: p = 6/8 and 4/8 of n + 4 = 8
    assert figure.se == pytest.approx([np.sqrt(0.75 * 0.25 / 8), np.sqrt(0.25 / 8)], rel=1e-15)


def test_relative_error_by_hand():
    errors = np.array([[3.0, 0.0], [3.0, 8.0]])
    relerr = report_samples.relative_error(errors, np.array([6.0, 8.0]))
    # mean error (3, 4), size 10; along (0.6, 0.8) the errors are 1.8 and 8.2: s = 6.4/sqrt(2), /sqrt(2)/10
    assert relerr.value == pytest.approx(0.5, rel=1e-15)
    assert relerr.se == pytest.approx(0.32, rel=1e-14)
    # covariance trace 0 + 32: sqrt(32/2)/10
    assert relerr.floor == pytest.approx(0.4, rel=1e-14)


def correlated(rng, n, size=6):
    mix = np.linalg.cholesky(0.6 * np.ones((size, size)) + 0.4 * np.eye(size))
    return rng.standard_normal((n, size)) @ mix.T * np.arange(1.0, size + 1.0)


def test_relative_error_standard_error_and_floor_over_replications():
    """4000 replications: spreads are known to 1.1 %, 4 % allowed."""
    rng = np.random.default_rng(5)
    truth, bias = np.array([4.0, 30.0, 0.5, -1.8, -41.0, -1.8]), np.array([2.0, 12.0, 0.4, 0.8, -16.0, 4.0])
    biased, unbiased, ses, floors = [], [], [], []
    for _ in range(4000):
        noise = correlated(rng, 100)
        relerr = report_samples.relative_error(noise + bias, truth)
        biased.append(relerr.value)
        ses.append(relerr.se**2)
        floors.append(relerr.floor**2)
        unbiased.append(report_samples.relative_error(noise, truth).value ** 2)
    assert np.sqrt(np.mean(ses)) == pytest.approx(np.std(biased), rel=0.04)
    assert np.sqrt(np.mean(floors)) == pytest.approx(np.sqrt(np.mean(unbiased)), rel=0.04)


def test_ratio_of_paired_methods_over_replications():
    """Paired runs: the standard error follows the spread of the ratio, unpaired it would be far too wide."""
    rng = np.random.default_rng(6)
    truth = np.array([4.0, 30.0, 0.5, -1.8, -41.0, -1.8])
    ratios, ses, unpaired = [], [], []
    for _ in range(3000):
        common = correlated(rng, 300)
        pair = common + 8.0, common + 0.3 * rng.standard_normal((300, 6)) + 4.0
        a, b = (report_samples.relative_error(errors, truth) for errors in pair)
        one, two = (statistics.influence(errors, errors.mean(axis=0), truth, 300) for errors in pair)
        ratio, se = statistics.ratio(a.value, b.value, (one @ one, two @ two, one @ two))
        ratios.append(ratio)
        ses.append(se**2)
        unpaired.append((ratio * np.hypot(a.se / a.value, b.se / b.value)) ** 2)
    assert np.sqrt(np.mean(ses)) == pytest.approx(np.std(ratios), rel=0.06)
    assert np.sqrt(np.mean(unpaired)) > 1.5 * np.std(ratios)


def test_ratio_to_a_perfect_method_is_unknown():
    assert np.isnan(statistics.ratio(1.0, 0.0, (0.0, 0.0, 0.0))).all()


def campaign_statistics(values, converged=None, flown=None, truth=None, half_width=1.0, status=None):
    n = len(values)
    sample = Sample(
        np.tile(TRUTH, (n, 1)) if truth is None else truth,
        np.ones(n, dtype=bool) if flown is None else flown,
        values,
        values - half_width,
        values + half_width,
        np.ones(n, dtype=bool) if converged is None else converged,
        np.arange(n, dtype=float),
        status or ("",) * n,
    )
    return method_statistics(lambda: [{"": sample}])[""]


def test_runs_that_did_not_converge_are_counted_and_kept_out_of_the_mean():
    values = TRUTH + np.random.default_rng(1).standard_normal((10, 8))
    values[0] = np.nan  # did not fly
    values[1] *= 1e3  # finite, not converged
    values[2] = np.nan  # diverged
    values[3, 6:] = np.nan  # aperiodic
    flown, converged = np.arange(10) > 0, np.arange(10) > 2
    status = ("", "maximum iterations", "diverged", *("converged",) * 7)
    s = campaign_statistics(values, converged, flown, status=status)
    c = s.counts
    assert (c.total, c.failed_to_fly, c.used, c.not_converged, c.diverged, c.aperiodic) == (10, 1, 7, 1, 1, 1)
    assert c.reasons == {"maximum iterations": 1, "diverged": 1}
    np.testing.assert_allclose(s.mean.value[:6], values[3:, :6].mean(axis=0), rtol=1e-14)
    np.testing.assert_allclose(s.mean.value[6:], values[4:, 6:].mean(axis=0), rtol=1e-14)
    np.testing.assert_allclose(s.rmse.value[:6], np.sqrt(((values[3:, :6] - TRUTH[:6]) ** 2).mean(axis=0)))
    assert s.iterations.value == np.mean(np.arange(3, 10))
    # the median sees the run that did not converge
    assert s.median[0] == np.median(values[[1, *range(3, 10)], 0])
    assert np.sqrt(s.products[""] * 7 / 6) == pytest.approx(s.relerr.se, rel=1e-12)


def test_each_run_is_compared_with_its_own_truth():
    rng = np.random.default_rng(2)
    truth = TRUTH * (1.0 + 0.2 * rng.standard_normal((50, 1)))
    s = campaign_statistics(truth + 0.5, truth=truth)
    np.testing.assert_allclose(s.rmse.value, 0.5, rtol=1e-12)
    expected = 0.5 * np.sqrt(6.0) / np.linalg.norm(truth[:, :6].mean(axis=0))
    assert s.relerr.value == pytest.approx(expected, rel=1e-12)


def test_coverage_of_normal_intervals():
    values = TRUTH + np.random.default_rng(3).standard_normal((4000, 8))
    s = campaign_statistics(values, half_width=1.959963984540054)
    assert (np.abs(s.coverage.value - 0.95) < 4.0 * s.coverage.se).all()


def test_intervals_that_were_not_stated_cover_nothing_known():
    values = TRUTH + np.random.default_rng(4).standard_normal((20, 8))
    s = campaign_statistics(values, half_width=np.array([np.nan] + [1.0] * 7))
    assert np.isnan(s.coverage.value[0])
    assert np.isfinite(s.coverage.value[1:]).all()


@pytest.mark.parametrize("used", [0, 1, 2, 3])
def test_too_few_runs_give_nan_and_no_warning(used):
    values = TRUTH + np.random.default_rng(7).standard_normal((5, 8))
    s = campaign_statistics(values, converged=np.arange(5) < used)
    assert np.isfinite(s.mean.value).all() == (used > 0)
    assert np.isfinite(s.std.value).all() == (used > 1)
    assert np.isnan(s.std.se).all()
    assert np.isfinite(s.relerr.value) == (used > 0)
    assert np.isfinite(s.relerr.se) == (used > 1)


def test_robust_spread_is_scaled_to_the_normal():
    values = TRUTH + np.random.default_rng(8).standard_normal((100_000, 8))
    # the standard error of the median absolute deviation is 1.17/sqrt(n) for a normal sample
    np.testing.assert_allclose(campaign_statistics(values).mad, 1.0, atol=5 * 1.17 / np.sqrt(100_000))
    assert pytest.approx(1.0 / stats.norm.ppf(0.75), rel=1e-15) == statistics.MAD_TO_STD


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32 - 1), st.integers(5, 60), st.floats(0.01, 100.0))
def test_statistics_do_not_depend_on_the_order_of_runs_or_on_the_scale(seed, n, scale):
    rng = np.random.default_rng(seed)
    values = TRUTH + rng.standard_normal((n, 8))
    converged, flown = rng.random(n) > 0.2, rng.random(n) > 0.1
    order = rng.permutation(n)
    one = campaign_statistics(values, converged, flown)
    sample = Sample(
        np.tile(scale * TRUTH, (n, 1)),
        flown[order],
        scale * values[order],
        scale * (values[order] - 1.0),
        scale * (values[order] + 1.0),
        converged[order],
        np.arange(n, dtype=float)[order],
        ("",) * n,
    )
    other = method_statistics(lambda: [{"": sample}])[""]
    c = one.counts
    assert c == other.counts
    assert c.total == c.failed_to_fly + c.used + c.not_converged + c.diverged
    for name in ("mean", "std", "rmse"):
        np.testing.assert_allclose(getattr(other, name).value, scale * getattr(one, name).value, rtol=1e-9)
        np.testing.assert_allclose(getattr(other, name).se, scale * getattr(one, name).se, rtol=1e-6)
    np.testing.assert_allclose(other.relerr.value, one.relerr.value, rtol=1e-9)
    np.testing.assert_allclose(other.relerr.se, one.relerr.se, rtol=1e-9)
    assert other.products[""] == pytest.approx(one.products[""], rel=1e-6, abs=1e-30)


ARRAYS = [name for name in Sample.__dataclass_fields__ if name != "motion"]


def parts_of(sample, rows):
    return [
        Sample(
            *(getattr(sample, name)[first : first + rows] for name in ARRAYS),
            motion=sample.motion,
        )
        for first in range(0, len(sample.truth), rows)
    ]


def test_runs_in_parts_give_the_statistics_of_all_runs():
    """Expected values are numpy's over the whole arrays; with outliers, runs that failed, and modes that do not oscillate."""
    rng = np.random.default_rng(12)
    n = 1000
    truth = TRUTH * (1.0 + 0.01 * rng.standard_normal((n, 8)))
    one, two = (
        Sample(
            truth,
            flown,
            values := truth * (1.0 + 0.05 * rng.standard_t(3.0, (n, 8))),
            values - 0.1 * np.abs(truth),
            values + 0.1 * np.abs(truth),
            rng.random(n) > 0.1,
            rng.integers(1, 9, n).astype(float),
            tuple(rng.choice(["a", "b"], n).tolist()),
        )
        for flown in [rng.random(n) > 0.05] * 2
    )
    one.values[::17, 6:] = np.nan
    two.values[::13] = np.nan
    whole = method_statistics(lambda: [{"one": one, "two": two}])
    parts = [{"one": a, "two": b} for a, b in zip(parts_of(one, 37), parts_of(two, 37), strict=True)]
    reduced = method_statistics(lambda: parts)
    used = one.flown & one.converged & np.isfinite(one.values[:, :6]).all(axis=1)
    six, errors = one.values[used, :6], (one.values - truth)[used, :6]
    s = reduced["one"]
    np.testing.assert_allclose(s.mean.value[:6], six.mean(axis=0), rtol=1e-13)
    np.testing.assert_allclose(s.std.value[:6], six.std(axis=0, ddof=1), rtol=1e-12)
    np.testing.assert_allclose(s.rmse.value[:6], np.sqrt((errors**2).mean(axis=0)), rtol=1e-13)
    np.testing.assert_allclose(s.correlation, np.corrcoef(six, rowvar=False), rtol=1e-10, atol=1e-13)
    centre = np.nanmedian(one.values[one.finite], axis=0)
    np.testing.assert_array_equal(s.median, centre)
    spread = np.nanmedian(np.abs(one.values[one.finite] - centre), axis=0)
    np.testing.assert_allclose(s.mad, statistics.MAD_TO_STD * spread, rtol=1e-15)
    for method, other in whole.items():
        assert reduced[method].counts == other.counts
        assert reduced[method].products == pytest.approx(other.products, rel=1e-10)
        for name in ("mean", "std", "rmse", "coverage", "relerr", "relerr_modal", "iterations"):
            a, b = getattr(reduced[method], name), getattr(other, name)
            np.testing.assert_allclose(a.value, b.value, rtol=1e-12)
            np.testing.assert_allclose(a.se, b.se, rtol=1e-10)
